//! A plan becomes a record: render, measure, judge, write.
//!
//! A scene is rendered in units, none of which needs another's images: the
//! judge, a converged image a method, pictures, and the replicates of each case. Every
//! finished unit is kept on disk with its hash. All that is measured is measured from
//! these images afterwards, so a run that goes on where a killed one ended, or that is
//! put together from shards, comes to the same record.

mod blocks;
mod case_metrics;
mod error;
mod external;
mod faults;
mod journal;
mod judging;
mod measuring;
mod merge;
mod occluders;
mod on_screen;
mod progress;
mod recording;
mod references;
mod rendering;
mod scoring;
mod set;
mod shard;
mod stop;
mod subject;
mod tracing;
mod unit;
mod until_sure;

pub use error::RunError;
pub use merge::{MergeError, Shards, find as find_shards};
pub use progress::Observer;
pub use references::{References, ReferencesError, ReferencesFile, SceneReferences};
pub use scoring::CaseImages;
pub use shard::{Shard, ShardRecord};
pub use stop::Stop;
pub use subject::Facts;

#[cfg(test)]
mod mutations;

use crate::{
    gate::{Evidence, Gate, judge},
    judge_cache::JudgeCache,
    layers::hex,
    pooled::pooled,
    record::{
        CaseRecord, HandedIn, Machine, Record, RecordFolder, SceneRecord, SuiteInfo, Summary, Timing, Undecided,
        UntilSure, VERSION,
    },
    render::{Renderer, external::Ready},
    suite::{Case, EstimatorFile, Plan, Suite},
};
use error::MAX_GIB;
use journal::Journal;
use measuring::NOT_RENDERED;
use progress::Progress;
use rendering::{Rendered, Studio};
use set::Set;
use sha2::{Digest, Sha256};
use std::time::{Duration, Instant};
use unit::{Unit, shard_of};

/// What the program is built from, hashed.
const BUILD: &str = env!("AOGAUGE_BUILD");

/// With what a plan is run, and what ends it early.
pub struct Means<'a> {
    /// Who renders the reference and the cases on `cpu`.
    pub cpu: &'a (dyn Renderer + Sync),
    /// Who renders the cases on `gpu`.
    pub gpu: Option<&'a (dyn Renderer + Sync)>,
    /// Who renders the cases of external renderers.
    pub external: &'a [Ready<'a>],
    /// What earlier runs judged.
    pub cache: Option<&'a JudgeCache>,
    /// The machine, for the record. A GPU that it calls hardware works beside the CPU.
    pub machine: Machine,
    /// Asks it to end early.
    pub stop: Stop,
    /// A unit that takes longer ends with an error: a judge, a converged image, pictures, or
    /// the replicates of a case (at each look, where there are several). The CPU looks at it within
    /// an image, the GPU between two; an external renderer is ended.
    pub case_timeout: Option<Duration>,
    /// After how long no replicates are added any more where a plan goes on until it is sure.
    /// What then comes of it depends on the machine's speed.
    pub max_time: Option<Duration>,
    /// Whether the first failure ends the run: a unit with an error, or a verdict that is
    /// surely red whatever the others come to.
    pub fail_fast: bool,
    /// Whether all images are there, and a missing one is an error.
    pub(crate) is_merge: bool,
    /// In a merge: what [`Means::max_time`] ended in the shards.
    pub(crate) ended: Vec<Undecided>,
}

impl<'a> Means<'a> {
    /// The CPU alone, and nothing that ends a run early.
    pub fn new(cpu: &'a (dyn Renderer + Sync), machine: Machine) -> Self {
        Means {
            cpu,
            gpu: None,
            external: &[],
            cache: None,
            machine,
            stop: Stop::default(),
            case_timeout: None,
            max_time: None,
            fail_fast: false,
            is_merge: false,
            ended: Vec::new(),
        }
    }
}

/// A plan whose scenes are loaded and checked. Whatever a scene file gets wrong
/// is found here, before anything is written.
pub struct Prepared<'a> {
    plan: &'a Plan<'a>,
    sets: Vec<Set<'a>>,
}

/// A unit of a plan and what it costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// A case's own name, `SCENE/judge`, `SCENE/converged/METHOD` or `SCENE/look`.
    pub unit: String,
    /// About so many rays, all segments counted.
    pub rays: u64,
}

impl<'a> Prepared<'a> {
    /// Builds the trees, sees what the measure views see, finds the regions, and
    /// makes sure that light reaches what is to be judged.
    ///
    /// # Errors
    /// [`RunError`], which names the scene and the field.
    pub fn new(plan: &'a Plan<'a>) -> Result<Self, RunError> {
        let sets = plan.scenes().map(|scene| Set::new(plan, scene)).collect::<Result<_, _>>()?;
        Ok(Prepared { plan, sets })
    }

    /// The seed of the plan.
    pub fn seed(&self) -> u32 {
        self.plan.seed
    }

    /// What will be rendered, in order; of a shard its own part.
    pub fn steps(&self, shard: Option<Shard>) -> Vec<Step> {
        let of = |set: &Set<'a>| {
            let units = mine(set, shard);
            units.into_iter().map(|u| step(set, &u)).collect::<Vec<_>>()
        };
        self.sets.iter().flat_map(of).collect()
    }

    /// All of [`Prepared::steps`] together.
    pub fn cost(&self, shard: Option<Shard>) -> u64 {
        self.steps(shard).iter().map(|s| s.rays).sum()
    }

    /// Everything that decides which images come of it, hashed: the program's sources, the
    /// suite, the scenes' contents, seed, cases and the GPU, and where it goes on until it is
    /// sure, the base. The compiler and the kind of machine are not in it.
    pub fn identity(&self, machine: &Machine) -> String {
        let plan = self.plan;
        let gpu = plan.cases.iter().any(|c| c.renderer == "gpu").then_some(&machine.gpu);
        let scenes: Vec<[&str; 2]> = self.sets.iter().map(|s| [s.scene.name.as_str(), &s.subject.facts.hash]).collect();
        let cases: Vec<String> = plan.cases.iter().map(Case::id).collect();
        let all = serde_json::json!({
            "build": BUILD, "suite": plan.suite.name, "file": plan.suite.file, "scenes": scenes,
            "cases": cases, "seed": plan.seed, "filter": plan.filter, "gpu": gpu, "until-sure": plan.until_sure,
            "base": self.base(),
        });
        hex(&Sha256::digest(all.to_string()))
    }

    /// What is read of the base, hashed, where it decides how many replicates there are.
    pub(crate) fn base(&self) -> Option<String> {
        let is_read = self.plan.until_sure.is_some() && self.plan.suite.gates.iter().any(Gate::is_against_base);
        let base = self.plan.base.as_ref().filter(|_| is_read)?;
        let read = serde_json::json!([base.suite, base.scenes, base.cases]);
        Some(hex(&Sha256::digest(read.to_string())))
    }

    /// Runs the plan and commits its record. What an unfinished run left in the folder
    /// is not rendered again.
    ///
    /// A unit whose renderer fails, panics or takes too long ends with its error; the
    /// others go on. Where the run is asked to stop, the record says that it is
    /// incomplete, and the folder keeps what is needed to go on.
    ///
    /// # Errors
    /// Where a file cannot be written, or a scene turns out to have no light.
    pub fn run(&self, means: &Means<'_>, folder: &RecordFolder, observer: &dyn Observer) -> Result<Record, RunError> {
        let record = self.found(means, folder, observer)?;
        folder.commit(&record)?;
        Ok(record)
    }

    /// Renders what is missing, and measures all.
    fn found(&self, means: &Means<'_>, folder: &RecordFolder, observer: &dyn Observer) -> Result<Record, RunError> {
        let start = Instant::now();
        let mut timing = timing();
        let progress = Progress::new(observer, self.cost(None));
        let (mut scenes, mut cases) = (Vec::new(), Vec::new());
        let until = means.max_time.and_then(|t| start.checked_add(t));
        let (mut ended, mut stopped, mut undecided) = (None, false, Vec::new());
        for set in &self.sets {
            let studio = Studio::new(set, means, Journal { folder }, &progress, until);
            let mut rendered = Rendered::default();
            let counts = studio.scene(&mut rendered)?;
            rendered.note(&set.scene.name, &mut timing);
            let (scene, mut records) = set.subject.measure(folder, &rendered, &counts)?;
            for record in &mut records {
                record.log = rendered.log(&record.case);
            }
            scenes.extend(scene);
            cases.extend(records);
            ended = ended.or(rendered.ended.as_deref().map(at_first_failure));
            stopped |= counts.stopped;
            undecided.extend(counts.undecided);
        }
        // A run that was asked to stop when all was done is whole.
        let is_short = stopped || cases.iter().any(|c| c.error.as_deref() == Some(NOT_RENDERED));
        let early = ended.unwrap_or_else(|| "it was interrupted".to_owned());
        let end = End {
            incomplete: Some(early).filter(|_| means.stop.is_asked() && is_short),
            until_sure: self.plan.until_sure.map(|max_replicates| UntilSure {
                max_replicates,
                max_time: means.max_time.map(|t| t.as_secs_f64()),
                undecided,
            }),
        };
        timing.seconds = start.elapsed().as_secs_f64();
        Ok(record(Found {
            plan: self.plan,
            suite: suite_info(self.plan),
            machine: means.machine.clone(),
            timing,
            end,
            scenes,
            cases,
            handed_in: None,
        }))
    }
}

/// All that a record is made of.
struct Found<'a> {
    plan: &'a Plan<'a>,
    suite: SuiteInfo,
    machine: Machine,
    timing: Timing,
    end: End,
    scenes: Vec<SceneRecord>,
    cases: Vec<CaseRecord>,
    handed_in: Option<HandedIn>,
}

/// Judges what was found.
fn record(found: Found<'_>) -> Record {
    let Found { plan, suite, machine, timing, end, scenes, cases, handed_in } = found;
    let evidence = Evidence {
        suite: &suite,
        gpu: &machine.gpu,
        filter: plan.filter.as_deref(),
        scenes: &scenes,
        cases: &cases,
        base: plan.base.as_ref(),
        no_base: plan.no_base,
        handed_in: handed_in.is_some(),
    };
    let (verdicts, idle_gates) = judge(&evidence);
    Record {
        version: VERSION,
        tool: env!("CARGO_PKG_VERSION").to_owned(),
        seed: plan.seed,
        machine,
        filter: plan.filter.clone(),
        until_sure: end.until_sure,
        incomplete: end.incomplete,
        no_base: plan.no_base,
        handed_in,
        summary: Summary::new(&verdicts, &idle_gates, &scenes, &cases),
        pooled: pooled(&suite, &scenes, &cases),
        verdicts,
        idle_gates,
        scenes,
        cases,
        suite,
        timing,
    }
}

/// How a run came to its end.
struct End {
    /// Why it was early.
    incomplete: Option<String>,
    until_sure: Option<UntilSure>,
}

fn at_first_failure(what: &str) -> String {
    format!("it ended at the first failure (--fail-fast): {what}")
}

/// The units of a scene; of a shard its own part. Where a run goes on until it is sure, what
/// decides must be together, and a shard takes whole scenes.
fn mine<'a>(set: &Set<'a>, shard: Option<Shard>) -> Vec<Unit<'a>> {
    let name = &set.scene.name;
    let key = |unit: &Unit<'a>| {
        if set.subject.plan.until_sure.is_some() { name.clone() } else { unit.id(set.subject.plan, name) }
    };
    let is_mine = |unit: &Unit<'a>| shard.is_none_or(|s| shard_of(&key(unit), s.of) == s.index - 1);
    set.units().into_iter().filter(is_mine).collect()
}

fn step(set: &Set<'_>, unit: &Unit<'_>) -> Step {
    Step { unit: unit.id(set.subject.plan, &set.scene.name), rays: unit.cost(set.subject.plan, set.pixels()) }
}

/// A clock that begins now.
fn timing() -> Timing {
    Timing {
        began: jiff::Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string(),
        threads: rayon::current_num_threads(),
        ..Timing::default()
    }
}

fn suite_info(plan: &Plan<'_>) -> SuiteInfo {
    let suite: &Suite = plan.suite;
    let methods = || plan.methods().into_iter().map(|m| &suite.methods[m]);
    SuiteInfo {
        name: suite.name.clone(),
        description: suite.file.description.clone(),
        replicates: suite.file.replicates.get(),
        converged_rays: suite.file.converged_rays.get(),
        golden_rays: suite.file.golden_rays.map(crate::suite::Rays::get),
        estimators: methods().map(|m| m.name.clone()).collect(),
        methods: methods().map(|m| (m.name.clone(), EstimatorFile::of(&m.estimator))).collect(),
        classic: suite.methods[suite.classic()].name.clone(),
        renderers: plan.external().map(|r| (r.file.name.clone(), r.file.command.clone())).collect(),
        gates: suite.gates.clone(),
    }
}
