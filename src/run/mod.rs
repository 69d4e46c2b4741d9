//! A plan becomes a record: render, measure, judge, write.

mod case_metrics;
mod faults;
mod judging;
mod occluders;
mod on_screen;
mod recording;
mod set;

use crate::{
    disk::DiskError,
    gate::Verdict,
    judge_cache::JudgeCache,
    metrics::{Absent, Metric},
    pooled::pooled,
    record::{CaseRecord, IdleGate, Machine, Record, RecordFolder, SceneRecord, SuiteInfo, Summary, Timing, VERSION},
    render::{RenderError, Renderer},
    suite::{EstimatorFile, Plan, Suite},
};
use set::Set;
use std::time::Instant;

/// Images of one scene that are held at once, at most.
const MAX_GIB: f64 = 8.0;

/// Why a run ended without a record.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A file could not be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The CPU reference could not render, so there is nothing to compare with.
    #[error("scene '{scene}': {source}")]
    Render {
        /// The scene.
        scene: String,
        /// Why.
        source: RenderError,
    },
    /// The measure view of a scene looks at the occluder.
    #[error("scene '{scene}': the measure view sees the occluder '{object}'; measure.clearance must end under it")]
    SeesOccluder {
        /// The scene.
        scene: String,
        /// The object it sees.
        object: String,
    },
    /// The measure view of a scene cuts off a flank of an occluder that it measures.
    #[error(
        "scene '{scene}': the measure view cuts off the {flank} flank of an occluder that it measures; raise measure.resolution[0], {columns} now, so that it spans 2 R to each side where the receiver reaches that far, or turn measure.transect across the occluder"
    )]
    CutsFlank {
        /// The scene.
        scene: String,
        /// `left` or `right`.
        flank: &'static str,
        /// Width of the view, pixels.
        columns: u32,
    },
    /// No light reaches the receiver, so there is nothing to judge.
    #[error(
        "scene '{scene}': no light reaches the receiver even without the occluder; check environment and the openings towards it"
    )]
    NoLight {
        /// The scene.
        scene: String,
    },
    /// The images of a scene would not fit into memory.
    #[error(
        "scene '{scene}': its cases would hold {gib:.1} GiB of images at once, more than {MAX_GIB} GiB; lower replicates or measure.resolution"
    )]
    TooMuch {
        /// The scene.
        scene: String,
        /// What it would need.
        gib: f64,
    },
    /// The measure view of a scene sees nothing.
    #[error(
        "scene '{scene}': the measure view sees no surface; check measure.center, measure.normal and measure.clearance"
    )]
    SeesNothing {
        /// The scene.
        scene: String,
    },
}

/// What a run tells about itself on the way.
pub trait Observer {
    /// `done` of `total` steps are done, and `what` comes next.
    fn step(&self, done: usize, total: usize, what: &str);
}

/// How many steps a plan has: each case, each converged image, the judge and the
/// pictures of each scene.
pub fn steps(plan: &Plan<'_>) -> usize {
    let per_scene = plan.suite.methods.len() + 2;
    plan.cases.len() + plan.suite.scenes.len() * per_scene
}

/// A plan whose scenes are loaded and checked. Whatever a scene file gets wrong
/// is found here, before anything is written.
pub struct Prepared<'a> {
    plan: &'a Plan<'a>,
    sets: Vec<Set<'a>>,
}

impl<'a> Prepared<'a> {
    /// Builds the trees, sees what the measure views see, finds the regions, and
    /// makes sure that light reaches what is to be judged.
    ///
    /// # Errors
    /// [`RunError`], which names the scene and the field.
    pub fn new(plan: &'a Plan<'a>) -> Result<Self, RunError> {
        let sets = plan.suite.scenes.iter().map(|scene| Set::new(plan, scene)).collect::<Result<_, _>>()?;
        Ok(Prepared { plan, sets })
    }

    /// Runs the plan and commits its record.
    ///
    /// A case whose renderer fails ends with its error; the others go on. `gpu`
    /// is used for the plan's cases on `gpu`, `cache` for what earlier runs judged.
    ///
    /// # Errors
    /// Where a file cannot be written, or the CPU reference fails.
    pub fn run(
        &self,
        cpu: &dyn Renderer,
        gpu: Option<&dyn Renderer>,
        cache: Option<&JudgeCache>,
        machine: Machine,
        folder: &RecordFolder,
        observer: &dyn Observer,
    ) -> Result<Record, RunError> {
        let plan = self.plan;
        let start = Instant::now();
        let mut timing = Timing {
            began: jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string(),
            threads: rayon::current_num_threads(),
            ..Timing::default()
        };
        let mut progress = Progress { observer, done: 0, total: steps(plan) };
        let (mut scenes, mut cases) = (Vec::new(), Vec::new());
        for set in &self.sets {
            let (scene_record, case_records) = set.run(cpu, gpu, cache, folder, &mut progress, &mut timing)?;
            scenes.push(scene_record);
            cases.extend(case_records);
        }
        timing.seconds = start.elapsed().as_secs_f64();
        let (verdicts, idle_gates) = verdicts(plan, &machine, &scenes, &cases);
        let suite = suite_info(plan.suite);
        let record = Record {
            version: VERSION,
            tool: env!("CARGO_PKG_VERSION").to_owned(),
            seed: plan.seed,
            machine,
            summary: Summary::new(&verdicts, &idle_gates, &scenes, &cases),
            pooled: pooled(&suite, &scenes, &cases),
            verdicts,
            idle_gates,
            scenes,
            cases,
            suite,
            timing,
        };
        folder.commit(&record)?;
        Ok(record)
    }
}

fn suite_info(suite: &Suite) -> SuiteInfo {
    SuiteInfo {
        name: suite.name.clone(),
        description: suite.file.description.clone(),
        replicates: suite.file.replicates.get(),
        converged_rays: suite.file.converged_rays.get(),
        golden_rays: suite.file.golden_rays.map(crate::suite::Rays::get),
        estimators: suite.methods.iter().map(|m| m.name.clone()).collect(),
        methods: suite.methods.iter().map(|m| (m.name.clone(), EstimatorFile::of(&m.estimator))).collect(),
        classic: suite.methods[suite.classic()].name.clone(),
    }
}

/// Holds every gate against every case it applies to. Failures come first.
fn verdicts(
    plan: &Plan<'_>,
    machine: &Machine,
    scenes: &[SceneRecord],
    cases: &[CaseRecord],
) -> (Vec<Verdict>, Vec<IdleGate>) {
    let (mut verdicts, mut idle) = (Vec::new(), Vec::new());
    let no_gpu = !plan.cases.iter().any(|c| c.renderer == "gpu");
    for gate in &plan.suite.gates {
        let before = verdicts.len();
        for scene in scenes.iter().filter(|s| gate.applies_to_judge(&s.name)) {
            let metric = match &scene.judge {
                Some(judge) => judge.contrast.clone(),
                None => Metric::new(gate.metric, None, Err(Absent(scene.no_judge.clone().unwrap_or_default()))),
            };
            verdicts.push(gate.verdict(&scene.name, None, &metric));
        }
        for record in cases.iter().filter(|c| gate.applies_to(&c.case)) {
            if let Some(metric) = record.metric(gate.metric, gate.region) {
                verdicts.push(gate.verdict(&record.case.scene, Some(&record.case), metric));
            }
        }
        let excused = no_gpu && !gate.renderers.is_empty() && gate.renderers.iter().all(|r| r == "gpu");
        if excused {
            let reason = format!("this run used no GPU: {}", machine.gpu);
            idle.push(IdleGate { gate: gate.name.clone(), reason, excused });
        } else if verdicts.len() == before {
            let reason = "no case of this run has this metric".to_owned();
            idle.push(IdleGate { gate: gate.name.clone(), reason, excused });
        } else {
            // A scene that the gate names must not drop out of it unseen.
            for scene in &gate.scenes {
                if !verdicts[before..].iter().any(|v: &Verdict| v.scene == *scene) {
                    let absent = Absent("no case of this scene has this metric".into());
                    verdicts.push(gate.verdict(scene, None, &Metric::new(gate.metric, gate.region, Err(absent))));
                }
            }
        }
    }
    verdicts.sort_by_key(|v| v.outcome);
    (verdicts, idle)
}

struct Progress<'a> {
    observer: &'a dyn Observer,
    done: usize,
    total: usize,
}

impl Progress<'_> {
    fn begin(&self, what: &str) {
        self.observer.step(self.done, self.total, what);
    }

    fn end(&mut self) {
        self.done += 1;
    }
}
