//! A renderer that fails, or gives what is no number: its case ends with the error,
//! the others go on.

use aogauge::{
    metrics::{MetricName, regions::Region},
    record::{Machine, Record, RecordFolder},
    render::{Frame, Geometry, Job, Kind, Loaded, RenderError, Renderer, cpu::Cpu},
    report,
    run::{Means, Observer, Prepared},
    suite::{Plan, Platform, Suite},
};
use std::{
    path::Path,
    sync::atomic::{AtomicU64, Ordering},
};

/// The CPU under the GPU's name, failing at 8 rays.
struct Failing;

struct LoadedFailing<'a>(Box<dyn Loaded + 'a>);

impl Renderer for Failing {
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedFailing(Cpu.load(geometry)?)))
    }
}

impl Loaded for LoadedFailing<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        if job.rays == 8 && job.replicate == 1 {
            return Err(RenderError::Device("the device was lost: unplugged".into()));
        }
        self.0.render(job)
    }
}

/// Counts what is done.
#[derive(Default)]
struct Steps {
    last: AtomicU64,
    total: AtomicU64,
}

impl Observer for Steps {
    fn step(&self, done: u64, total: u64, _what: &str) {
        assert!(done < total);
        self.last.fetch_max(done, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }
}

#[test]
fn a_failing_case_does_not_lose_the_others() {
    let text = r#"
description = "x"
scenes = ["plane"]
rays = [4, 8]
replicates = 2
converged_rays = 32
look_rays = 1
[[estimator]]
name = "classic"
kind = "classic"
[[gate]]
name = "same"
metric = "renderer-difference"
renderers = ["gpu"]
equals = 0.0
within = 0.01
"#;
    let suite = Suite::from_toml("x", "x.toml", text, Path::new(".")).unwrap();
    let plan = Plan::new(&suite, Platform::Gpu, None);
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let folder = RecordFolder::create(&out).unwrap();
    let observer = Steps::default();
    let machine = Machine::here("a test".into(), Some(false));
    let prepared = Prepared::new(&plan).unwrap();
    let mut means = Means::new(&Cpu, machine);
    means.gpu = Some(&Failing);
    let record = prepared.run(&means, &folder, &observer).unwrap();
    assert_eq!(observer.total.into_inner(), prepared.cost(None));
    assert!(observer.last.into_inner() > 0);
    assert_eq!((record.summary.cases, record.summary.failed_cases, record.summary.pass), (4, 1, 1));
    let failed: Vec<_> = record.cases.iter().filter(|c| c.error.is_some()).collect();
    assert_eq!(failed[0].case.id(), "plane/classic/gpu/8");
    assert!(failed[0].error.as_deref().unwrap().contains("unplugged"));

    let read = report::write(&out, &out).unwrap();
    assert_eq!(read, record);
    assert_eq!(Record::read(&out).unwrap(), record);
    let report = std::fs::read_to_string(out.join("report.md")).unwrap();
    assert!(report.contains("INCOMPLETE") && report.contains("unplugged"));
}

/// The CPU under the GPU's name, whose images of 8 rays hold NaN and infinity.
struct Faulty;

struct LoadedFaulty<'a>(Box<dyn Loaded + 'a>);

impl Renderer for Faulty {
    fn load<'a>(&'a self, geometry: &'a Geometry) -> Result<Box<dyn Loaded + 'a>, RenderError> {
        Ok(Box::new(LoadedFaulty(Cpu.load(geometry)?)))
    }
}

impl Loaded for LoadedFaulty<'_> {
    fn render(&mut self, job: &Job<'_>) -> Result<Frame, RenderError> {
        let mut frame = self.0.render(job)?;
        let width = frame.resolution[0] as usize;
        if job.rays == 8 && job.replicate == 1 {
            frame.values[2 * width + 3] = f32::NAN;
            frame.values[2 * width + 4] = f32::INFINITY;
        }
        if job.rays == 4 {
            // What sees no surface has no number.
            frame.seen[0] = u32::MAX;
            frame.values[0] = f32::NAN;
        }
        // A converged image.
        if job.rays == 64 && job.estimator.kind() == Kind::Extended && job.replicate == 2 {
            frame.values[width] = f32::NEG_INFINITY;
        }
        Ok(frame)
    }
}

const TWO: &str = r#"
description = "x"
scenes = ["plane"]
rays = [4, 8]
replicates = 3
converged_rays = 256
look_rays = 1
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
"#;

fn run(text: &str, cpu: &(dyn Renderer + Sync), gpu: Option<&(dyn Renderer + Sync)>, out: &Path) -> Record {
    let suite = Suite::from_toml("x", "x.toml", text, Path::new(".")).unwrap();
    let plan = Plan::new(&suite, if gpu.is_some() { Platform::Gpu } else { Platform::Cpu }, None);
    let folder = RecordFolder::create(out).unwrap();
    let machine = Machine::here("a test".into(), gpu.map(|_| false));
    let mut means = Means::new(cpu, machine);
    means.gpu = gpu;
    Prepared::new(&plan).unwrap().run(&means, &folder, &Steps::default()).unwrap()
}

#[test]
fn what_is_no_number_is_a_fault_of_the_renderer() {
    let dir = tempfile::tempdir().unwrap();
    let record = run(TWO, &Cpu, Some(&Faulty), &dir.path().join("gpu"));
    assert_eq!((record.summary.cases, record.summary.failed_cases), (8, 2));
    for case in &record.cases {
        let faulty = case.case.renderer == "gpu" && case.case.rays == 8;
        assert_eq!(case.error.is_some(), faulty, "{:?}", case.error);
        assert_eq!(case.metrics.is_empty(), faulty);
        if let Some(error) = &case.error {
            let says = error.contains("2 values of replicate 1") && error.contains("pixel (3, 2): NaN");
            assert!(says, "{error}");
        }
    }
}

/// The converged image of a method belongs to all its cases.
#[test]
fn a_converged_image_that_is_no_number_costs_its_method() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("cpu");
    let record = run(TWO, &Faulty, None, &out);
    for case in &record.cases {
        let error = case.error.clone().unwrap_or_default();
        match (case.case.estimator.as_str(), case.case.rays) {
            ("extended", 4) => {
                let says = error.contains("converged image") && error.contains("1 values of replicate 2");
                assert!(says && error.contains("pixel (0, 1): -inf"), "{error}");
            }
            (_, 8) => assert!(error.contains("pixel (3, 2)"), "{error}"),
            _ => assert_eq!(error, ""),
        }
    }
    report::write(&out, &out).unwrap();
    assert!(std::fs::read_to_string(out.join("report.md")).unwrap().contains("INCOMPLETE"));
}

/// Two ray counts in an arcade: Sobol samples converge faster than independent ones,
/// the error against the converged image is noise, and pools of one scene are that
/// scene's own values.
#[test]
fn one_scene_converges_and_pools_to_itself() {
    let text = r#"
description = "x"
scenes = ["curtain-arcade", "plane"]
rays = [4, 8, 16]
replicates = 4
converged_rays = 256
look_rays = 1
judge = { precision = 0.05, paths = 8, replicates = 8 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "provokes"
metric = "contrast-error"
estimators = ["classic"]
min = 0.1
[[gate]]
name = "open"
metric = "openness"
region = "all"
scenes = ["plane"]
estimators = ["classic"]
equals = 1.0
within = 0.01
"#;
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let record = run(text, &Cpu, None, &out);
    let arcade = &record.scenes[0];
    assert_eq!(arcade.convergence.len(), 4);
    for c in &arcade.convergence {
        let slope = c.slope.estimate().unwrap();
        assert!(slope.interval(0.95)[1] < -0.5 && slope.value > -1.5, "{}: {slope:?}", c.estimator);
        let rmse: Vec<f64> = c.points.iter().map(|p| p.rmse.value.unwrap()).collect();
        assert!(rmse[0] > rmse[1] && rmse[1] > rmse[2] && rmse[2] > 0.0, "{rmse:?}");
        for p in &c.points {
            let [lo, hi] = p.bias_squared.estimate().unwrap().interval(0.9999);
            assert!(lo < 0.0 && 0.0 < hi, "{}: {:?}", c.estimator, p.bias_squared);
        }
        assert!(c.limit.value.is_some() && c.per_ray.value.is_some_and(|v| v > 0.0));
    }
    // An empty plane is open to every ray, so there is no error to fall.
    assert_eq!(record.scenes[1].convergence.len(), 2);
    assert!(record.scenes[1].convergence.iter().all(|c| c.slope.value.is_none() && c.slope.note.is_some()));

    for pooled in &record.pooled {
        let own =
            record.cases.iter().find(|c| c.case.estimator == pooled.estimator && c.case.rays == pooled.rays).unwrap();
        for (pool, name, region) in [
            (&pooled.contrast_error, MetricName::ContrastError, None),
            (&pooled.rmse, MetricName::Rmse, Some(Region::Footprint)),
        ] {
            assert_eq!(pool.scenes, ["curtain-arcade"]);
            let (own, pool) = (own.metric(name, region).unwrap(), &pool.pooled);
            assert!((pool.value.unwrap() - own.value.unwrap()).abs() < 1e-12);
            assert!((pool.se.unwrap() - own.se.unwrap()).abs() < 1e-12);
        }
        let removed = own.metric(MetricName::Removed, None);
        assert_eq!(pooled.removed.pooled.value.is_some(), removed.is_some());
        if let Some(removed) = removed {
            assert!((pooled.removed.pooled.value.unwrap() - removed.value.unwrap()).abs() < 1e-12);
            // Paired replicates know more than the bound.
            assert!(pooled.removed.pooled.se.unwrap() >= removed.se.unwrap());
            assert_eq!(pooled.over_darkening.scenes, ["plane"]);
        }
    }

    for v in &record.verdicts {
        let exact = v.metric.se == Some(0.0);
        assert_eq!(v.detectable.is_none(), exact, "{v:?}");
        assert!(v.detectable.is_none_or(|d| d > 0.0));
    }
    let markdown = report::write(&out, &out).map(|_| std::fs::read_to_string(out.join("report.md")).unwrap()).unwrap();
    for part in ["## All scenes together", "| detectable |", "<summary>Convergence</summary>", "MAE against Q"] {
        assert!(markdown.contains(part), "{part}");
    }
}
