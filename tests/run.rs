//! A renderer that fails: its case ends with the error, the others go on.

#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

use aogauge::{
    record::{Machine, Record, RecordFolder},
    render::{Frame, Geometry, Job, Loaded, RenderError, Renderer, cpu::Cpu},
    report,
    run::{Observer, Prepared, steps},
    suite::{Plan, Platform, Suite},
};
use std::{cell::Cell, path::Path};

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

/// Counts steps.
#[derive(Default)]
struct Steps {
    last: Cell<usize>,
    total: Cell<usize>,
}

impl Observer for Steps {
    fn step(&self, done: usize, total: usize, _what: &str) {
        assert!(done >= self.last.get() && done < total);
        self.last.set(done);
        self.total.set(total);
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
    let record = prepared.run(&Cpu, Some(&Failing), None, machine, &folder, &observer).unwrap();
    assert_eq!((observer.last.get() + 1, observer.total.get()), (steps(&plan), steps(&plan)));
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
