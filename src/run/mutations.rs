//! Renderers with a mistake made on purpose: the built-in suite must turn red, by the
//! gate that is there for it.

use super::{Means, Observer, Prepared};
use crate::{
    gate::{Outcome, Verdict, family_at_most},
    record::{Machine, Record, RecordFolder},
    render::{
        Frame, Geometry, Job, Loaded, RenderError, Renderer,
        cpu::Cpu,
        gpu::{Gpu, tests::mistaken},
    },
    stats::decided,
    suite::{Plan, Platform, Suite},
};
use std::collections::BTreeSet;

/// What the CPU gets wrong, in all its images.
#[derive(Clone, Copy)]
enum Mistake {
    None,
    LongSecondary,
    OneSeed,
    Bias,
}

struct LoadedWrong<'a>(Mistake, Box<dyn Loaded + 'a>);

impl Renderer for Mistake {
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedWrong(*self, Cpu.load(geometry)?)))
    }
}

impl Loaded for LoadedWrong<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        let mut job = Job { ..*job };
        match self.0 {
            Mistake::LongSecondary => job.ao.secondary_radius *= 2.0,
            Mistake::OneSeed => job.replicate = 0,
            Mistake::None | Mistake::Bias => {}
        }
        let mut frame = self.1.render(&job)?;
        if matches!(self.0, Mistake::Bias) {
            frame.values.iter_mut().for_each(|v| *v += 0.01);
        }
        Ok(frame)
    }
}

struct Silent;

impl Observer for Silent {
    fn step(&self, _: u64, _: u64, _: &str) {}
}

/// The record of some cases of the built-in suite.
fn run(filter: &str, cpu: Mistake, gpu: Option<&Gpu>) -> Record {
    let suite = Suite::load("thin-occluders").unwrap();
    let platform = if gpu.is_some() { Platform::Gpu } else { Platform::Cpu };
    let plan = Plan::new(&suite, platform, None).only(filter);
    let dir = tempfile::tempdir().unwrap();
    let folder = RecordFolder::create(&dir.path().join("out")).unwrap();
    let mut means = Means::new(&cpu, Machine::here("a test".into(), Some(true)));
    means.gpu = gpu.map(|g| g as &(dyn Renderer + Sync));
    Prepared::new(&plan).unwrap().run(&means, &folder, &Silent).unwrap()
}

/// The gates that are red, and would be in a run of the whole suite on the same renderers: some
/// cases alone are a smaller family, in which less evidence does. What stands Bonferroni's correction
/// over all that the suite can be held to, stands Holm's.
fn red(record: &Record) -> BTreeSet<&str> {
    assert_eq!(record.summary.failed_cases, 0);
    let suite = Suite::load("thin-occluders").unwrap();
    let on_gpu = record.cases.iter().any(|c| c.case.renderer == "gpu");
    let plan = Plan::new(&suite, if on_gpu { Platform::Gpu } else { Platform::Cpu }, None);
    let scenes: Vec<&str> = plan.scenes().map(|s| s.name.as_str()).collect();
    let family = family_at_most(&suite.gates, &scenes, &plan.cases);
    assert!(family > 100 && family > 4 * record.verdicts.len(), "{family}");
    let stands = |p: f64, v: &Verdict| decided([1.0, p], family, v.spent, 1.0 - v.confidence);
    let red = record.verdicts.iter().filter(|v| v.outcome == Outcome::Fail);
    red.filter(|v| v.p_broken.is_some_and(|p| stands(p.raw, v))).map(|v| v.gate.as_str()).collect()
}

#[test]
fn without_a_mistake_nothing_is_red() {
    for filter in ["plane/", "corner/classic"] {
        let record = run(filter, Mistake::None, Some(&Gpu::open().unwrap()));
        assert_eq!(record.summary.fail, 0, "{:?}", red(&record));
    }
}

#[test]
fn secondary_rays_that_are_twice_too_long() {
    let record = run("plane/extended-counts", Mistake::LongSecondary, None);
    assert!(red(&record).contains("Where the receiver counts, an open plane reads 0.90"), "{:?}", red(&record));
}

#[test]
fn one_seed_for_all_replicates() {
    let record = run("corner/classic", Mistake::OneSeed, None);
    assert!(red(&record).contains("Each replicate has random numbers of its own"), "{:?}", red(&record));
}

#[test]
fn a_bias_of_a_hundredth() {
    let record = run("plane/", Mistake::Bias, None);
    assert!(red(&record).contains("An open plane reads 1"), "{:?}", red(&record));
    let record = run("corner/classic", Mistake::Bias, None);
    assert!(red(&record).contains("A corner reads what the formula says"), "{:?}", red(&record));
}

#[test]
fn a_missing_cosine() {
    // Uniform over the hemisphere: sin and cos of the polar angle are those of 1 - u.
    let gpu = mistaken(
        "let sin_theta = sqrt(place.x);\n    let cos_theta = sqrt(1.0 - place.x);",
        "let cos_theta = 1.0 - place.x;\n    let sin_theta = sqrt(1.0 - cos_theta * cos_theta);",
    );
    let record = run("corner/classic/gpu", Mistake::None, Some(&gpu));
    let red = red(&record);
    assert!(red.contains("A corner reads what the formula says"), "{red:?}");
    assert!(red.contains("GPU and CPU means are equivalent"), "{red:?}");
}

#[test]
fn a_flipped_normal_on_the_gpu() {
    let gpu = mistaken("dot(front, direction) > 0.0);", "dot(front, direction) < 0.0);");
    let record = run("corner/classic/gpu", Mistake::None, Some(&gpu));
    assert!(red(&record).contains("GPU and CPU means are equivalent"), "{:?}", red(&record));
}
