//! The record: everything one run found, in a folder. It is the one thing that
//! goldens and reports read.
//!
//! `record.json` is written last and is the commit mark: a folder without it is
//! what a killed run left behind. Everything that differs between two runs of the
//! same suite and seed stands under `timing`.

mod end;
mod folder;
mod image;
pub mod pictures;
mod ranges;
mod source;
mod until_sure;
mod version;

pub use end::End;
pub use folder::RecordFolder;
pub(crate) use folder::{aside, is_aside};
pub use source::{HandedIn, Intervals, Shows, Source, UndoneCurve, told_once};
pub use until_sure::{Budget, Undecided, UntilSure};

use crate::{
    counted::counted,
    disk::{DiskError, is_zip, read_text},
    gate::{Gate, Outcome, Verdict},
    metrics::{Metric, artifact::Brighter, convergence::Convergence, profile::Curve, regions::Region},
    pooled::Pooled,
    scenes::check_name,
    suite::Case,
    suite::EstimatorFile,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fs,
    path::{Component, Path},
};

/// Version of the record's format, as it is written.
pub const VERSION: u32 = 4;

/// The oldest version that is still read.
pub const OLDEST: u32 = 3;

/// The file that makes a folder a record.
pub const FILE: &str = "record.json";

/// The file that makes a folder a shard.
pub const SHARD: &str = "shard.json";

/// The folder that a run works in; marks a record that a run has begun to fill.
pub(crate) const BEGUN: &str = ".aogauge-run";

/// Everything one run found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Version of this format.
    pub version: u32,
    /// Version of the tool that wrote it.
    pub tool: String,
    /// The suite.
    pub suite: SuiteInfo,
    /// Seed of all randomness.
    pub seed: u32,
    /// The machine it ran on.
    pub machine: Machine,
    /// What the names of cases had to contain, where only some were asked for.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub filter: Option<String>,
    /// How replicates were added until verdicts were decided; absent where each case has
    /// the suite's.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub until_sure: Option<UntilSure>,
    /// Why the run ended early; absent where it did not.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub incomplete: Option<String>,
    /// Whether it was run without a base record on purpose (`--no-base`).
    #[serde(skip_serializing_if = "std::ops::Not::not", default)]
    pub no_base: bool,
    /// Whose images were measured, where they were handed in; absent where they were
    /// rendered here.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub handed_in: Option<HandedIn>,
    /// What the run came to.
    pub summary: Summary,
    /// Failures first, then in the order of gates and cases.
    pub verdicts: Vec<Verdict>,
    /// Gates that held for no case of this run, with the reason.
    pub idle_gates: Vec<IdleGate>,
    /// The scenes taken together, by estimator, renderer and rays.
    pub pooled: Vec<Pooled>,
    /// The scenes.
    pub scenes: Vec<SceneRecord>,
    /// The cases.
    pub cases: Vec<CaseRecord>,
    /// When, how long, on how many threads: all that differs between two runs.
    pub timing: Timing,
}

/// The suite a record comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SuiteInfo {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub description: String,
    /// Replicates of each case.
    pub replicates: u32,
    /// Rays of the converged images.
    pub converged_rays: u32,
    /// Rays at which goldens are taken.
    pub golden_rays: Option<u32>,
    /// Estimator names, in order; the first of kind classic is `classic`.
    pub estimators: Vec<String>,
    /// What each of them computes.
    pub methods: BTreeMap<String, EstimatorFile>,
    /// The name of the classic estimator.
    pub classic: String,
    /// The commands of its external renderers that took part, as the suite has them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub renderers: BTreeMap<String, Vec<String>>,
    /// Its gates, so that a record can be judged anew; empty in records of version 3.
    #[serde(default)]
    pub gates: Vec<Gate>,
}

/// Where a run ran.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// Operating system.
    pub os: String,
    /// Instruction set.
    pub arch: String,
    /// Processor, where the system tells.
    pub cpu: String,
    /// GPU adapter and driver, or why there is none.
    pub gpu: String,
    /// Whether the adapter computes on the CPU; null where there is none.
    pub gpu_is_software: Option<bool>,
}

impl Machine {
    /// This machine, with what is known of its GPU.
    pub fn here(gpu: String, gpu_is_software: Option<bool>) -> Self {
        Machine {
            os: std::env::consts::OS.to_owned(),
            arch: std::env::consts::ARCH.to_owned(),
            cpu: cpu_name(),
            gpu,
            gpu_is_software,
        }
    }
}

/// The processor's name, where the system tells.
pub fn cpu_name() -> String {
    let name = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|l| l.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    });
    name.unwrap_or_else(|| format!("{} processor", std::env::consts::ARCH))
}

/// Counts of verdicts and cases.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Summary {
    /// Verdicts that passed.
    pub pass: usize,
    /// Verdicts that failed.
    pub fail: usize,
    /// Verdicts that the data do not decide, and gates idle without excuse.
    pub inconclusive: usize,
    /// Failures that are known and explained.
    pub known_failures: usize,
    /// Verdicts whose limit holds while the stricter one that warns is broken.
    #[serde(default)]
    pub warnings: usize,
    /// Gates that nothing was held against, with an excuse.
    #[serde(default)]
    pub not_run: usize,
    /// Cases rendered.
    pub cases: usize,
    /// Cases that ended with an error.
    pub failed_cases: usize,
    /// Scenes whose judge failed.
    pub failed_judges: usize,
}

impl Summary {
    /// Counts.
    pub fn new(verdicts: &[Verdict], idle: &[IdleGate], scenes: &[SceneRecord], cases: &[CaseRecord]) -> Self {
        let count = |o: Outcome| verdicts.iter().filter(|v| v.outcome == o).count();
        Summary {
            pass: count(Outcome::Pass),
            fail: count(Outcome::Fail),
            inconclusive: count(Outcome::Inconclusive) + idle.iter().filter(|g| !g.excused).count(),
            known_failures: count(Outcome::KnownFailure),
            warnings: count(Outcome::Warn),
            not_run: idle.iter().filter(|g| g.excused).count(),
            cases: cases.len(),
            failed_cases: cases.iter().filter(|c| c.error.is_some()).count(),
            failed_judges: scenes.iter().filter(|s| s.judge_error.is_some()).count(),
        }
    }
}

/// A gate that nothing was held against.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IdleGate {
    /// The gate.
    pub gate: String,
    /// Why.
    pub reason: String,
    /// Whether that is no fault of the run: there was no GPU for a gate on the
    /// GPU, no base record for a gate against it and that on purpose, or no case that was asked for.
    /// A gate that is idle without excuse is inconclusive. Where all gates are idle, excuses do not
    /// help: see [`Record::has_judged_nothing`].
    pub excused: bool,
}

/// What was found of a scene, whatever the estimator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneRecord {
    /// Its name.
    pub name: String,
    /// What it is for.
    pub description: String,
    /// Whether it is a control.
    pub control: bool,
    /// Content hash.
    pub hash: String,
    /// R, metres.
    pub radius: f64,
    /// R', metres.
    pub secondary_radius: f64,
    /// Triangles.
    pub triangles: usize,
    /// Width and height of the measure view, pixels.
    pub resolution: [u32; 2],
    /// Place of each column of the measure view along the transect, in R.
    pub transect: Vec<f64>,
    /// Pixels of each region.
    pub regions: BTreeMap<Region, usize>,
    /// Which flank of each method's converged image is brighter, `Q` among them.
    pub brighter: BTreeMap<String, Brighter>,
    /// The judge; null where there is no occluder to judge.
    pub judge: Option<JudgeRecord>,
    /// Where screen-space methods are computed, and how much of each region is
    /// seen from there; absent in suites without such methods.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub screen: Option<ScreenRecord>,
    /// Why there is no judge.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub no_judge: Option<String>,
    /// Why the judge failed; the run is incomplete then.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub judge_error: Option<String>,
    /// The occluders one by one, in the order of the scene: those in view, where two
    /// or more are.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub occluders: Vec<OccluderRecord>,
    /// How the error of each method falls with its rays, over all pixels and over
    /// the footprint.
    pub convergence: Vec<Convergence>,
    /// Openness along the transect on the CPU, or of what was handed in, at the most rays, and Q.
    pub profiles: Vec<Curve>,
    /// Region masks and converged images, relative to the record.
    pub image: String,
    /// Pictures from the look view, relative to the record.
    pub look: String,
}

/// The camera of screen-space methods. Their metrics, and the judge and classic AO
/// beside them, are taken over the pixels whose points it shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScreenRecord {
    /// Its position, metres from the centre of the measure view.
    pub eye: [f64; 3],
    /// Width and height of its image, pixels.
    pub resolution: [u32; 2],
    /// Pixels of each region that it shows.
    pub regions: BTreeMap<Region, usize>,
}

/// One occluder object of several. Its regions are found with its triangles as the
/// only sheet. They are judged by the scene's own twin, which lacks all occluders: Q
/// is what all of them together do to the light there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OccluderRecord {
    /// The object.
    pub name: String,
    /// Pixels of footprint, left and right.
    pub regions: BTreeMap<Region, usize>,
    /// Those that the camera of screen-space methods shows.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub shown: Option<BTreeMap<Region, usize>>,
    /// K(Q) of its regions.
    pub contrast: Metric,
    /// Q of footprint, left and right.
    pub q: BTreeMap<Region, RegionQ>,
}

/// The metrics of a case under one occluder of several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OccluderMetrics {
    /// The object.
    pub name: String,
    /// Contrast and its error, openness, and errors over footprint and flanks.
    pub metrics: Vec<Metric>,
}

impl OccluderMetrics {
    /// A metric by name, and region where it has one.
    pub fn metric(&self, name: crate::metrics::MetricName, region: Option<Region>) -> Option<&Metric> {
        self.metrics.iter().find(|m| m.name == name && m.region == region)
    }
}

/// What the judge found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JudgeRecord {
    /// K(Q).
    pub contrast: Metric,
    /// Q of footprint, left and right.
    pub q: BTreeMap<Region, RegionQ>,
    /// Paths a pixel in one replicate.
    pub paths: u32,
    /// Replicates it took.
    pub replicates: u32,
    /// Why it took no more.
    pub stopped: Stopped,
    /// Half width of the widest 95 % interval of a region mean, relative; null
    /// where it is not known.
    pub precision: Option<f64>,
    /// The precision asked for.
    pub wanted: f64,
    /// Irradiance and Q, relative to the record.
    pub image: String,
}

/// Why the judge stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Stopped {
    /// Every region mean is as precise as was asked.
    Precise,
    /// The replicates it was allowed are spent.
    Budget,
}

/// Q of a region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegionQ {
    /// The ratio of the region's mean irradiances.
    pub value: Option<f64>,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
    /// Why there is no value.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub note: Option<String>,
}

/// What was found in a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaseRecord {
    /// The case.
    pub case: Case,
    /// Why it ended early; null where it did not.
    pub error: Option<String>,
    /// Mean, variance and replicates, relative to the record; null after an error.
    pub image: Option<String>,
    /// Hash of the mean image's pixels.
    pub hash: Option<String>,
    /// Its metrics.
    pub metrics: Vec<Metric>,
    /// How often its metrics were computed and looked at while its replicates grew;
    /// absent where that was once, when all were there.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub looks: Option<u32>,
    /// Replicates that its metrics are of, the first ones of its image: all of them, unless
    /// the run is incomplete. The suite's where absent.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub replicates: Option<u32>,
    /// What its images were read from, where they were handed in.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub source: Option<Source>,
    /// What the commands of an external renderer said, relative to the record; absent for our
    /// own renderers, and where the run did not come to it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub log: Option<String>,
    /// What is doubtful in images of an external renderer, held against the converged image.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub warnings: Vec<String>,
    /// Its metrics by occluder, where the scene shows two or more.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub occluders: Vec<OccluderMetrics>,
}

impl CaseRecord {
    /// A case that ended with an error.
    pub fn failed(case: &Case, error: String) -> Self {
        CaseRecord {
            case: case.clone(),
            error: Some(error),
            image: None,
            hash: None,
            metrics: vec![],
            looks: None,
            replicates: None,
            source: None,
            log: None,
            warnings: vec![],
            occluders: vec![],
        }
    }

    /// A metric by name, and region where it has one.
    pub fn metric(&self, name: crate::metrics::MetricName, region: Option<Region>) -> Option<&Metric> {
        self.metrics.iter().find(|m| m.name == name && m.region == region)
    }
}

/// When and how long.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Timing {
    /// When the run began, UTC.
    pub began: String,
    /// Wall clock of the whole run, seconds.
    pub seconds: f64,
    /// CPU threads.
    pub threads: usize,
    /// Seconds of tracing in each case, all replicates, by case.
    pub cases: BTreeMap<String, f64>,
    /// Seconds the judge took, by scene.
    pub judges: BTreeMap<String, f64>,
    /// Replicates of the judge that an earlier run had traced, by scene.
    #[serde(default)]
    pub cached_replicates: BTreeMap<String, usize>,
    /// How often external renderers had to be asked for an image again, by case.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub retries: BTreeMap<String, u32>,
    /// Why the judge's images could not be kept for the next run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache_trouble: Option<String>,
}

impl Record {
    /// Reads a record folder. Its summary is counted anew.
    ///
    /// # Errors
    /// Where `record.json` is missing (the run did not finish), malformed, of
    /// a version that is neither [`VERSION`] nor one since [`OLDEST`], or holds a name, a path or a number that no
    /// run writes.
    pub fn read(folder: &Path) -> Result<Self, DiskError> {
        let path = folder.join(FILE);
        if !path.exists() {
            let why = if folder.join(SHARD).exists() {
                "it is a shard: merge it with the others first"
            } else if is_zip(folder) {
                return Err(DiskError::content(folder, "this is a zip archive: unpack it first, and name the folder"));
            } else if folder.join(BEGUN).exists() {
                "the run that wrote it did not finish"
            } else {
                "not a record"
            };
            return Err(DiskError::content(folder, format!("there is no {FILE} here: {why}")));
        }
        let text = read_text(&path)?;
        let record = version::parse(&text).map_err(|e| DiskError::content(&path, e))?;
        record.check_names().and_then(|()| ranges::check(&record)).map_err(|e| DiskError::content(&path, e))?;
        // It may have been edited: what it holds counts, not what it says of itself.
        let summary = Summary::new(&record.verdicts, &record.idle_gates, &record.scenes, &record.cases);
        Ok(Record { summary, ..record })
    }

    /// Names become file names and image paths are followed, so neither may lead
    /// out of the folder they belong to.
    fn check_names(&self) -> Result<(), String> {
        let others = self.verdicts.iter().filter_map(|v| v.against.as_ref()?.case.as_ref());
        let judged = self.verdicts.iter().filter_map(|v| v.case.as_ref()).chain(others);
        let cases = self.cases.iter().map(|c| &c.case).chain(judged);
        let cases = cases.flat_map(|c| [&c.scene, &c.estimator, &c.renderer]);
        let scenes = self.scenes.iter().map(|s| &s.name).chain(self.verdicts.iter().map(|v| &v.scene));
        let pooled = self.pooled.iter().flat_map(|p| [&p.estimator, &p.renderer]);
        let methods = self.suite.estimators.iter().chain(self.suite.methods.keys()).chain([&self.suite.classic]);
        for name in cases.chain(scenes).chain(pooled).chain(methods).chain(self.suite.renderers.keys()) {
            check_name(name)?;
        }
        let of_cases = self.cases.iter().flat_map(|c| c.image.iter().chain(&c.log));
        let of_scenes = self.scenes.iter().flat_map(|s| [&s.image, &s.look]);
        let of_judges = self.scenes.iter().filter_map(|s| s.judge.as_ref().map(|j| &j.image));
        let of_verdicts = self.verdicts.iter().filter_map(|v| v.picture.as_ref());
        for image in of_cases.chain(of_scenes).chain(of_judges).chain(of_verdicts) {
            if !Path::new(image).components().all(|c| matches!(c, Component::Normal(_))) {
                return Err(format!("the image path '{}' leads out of the record", image.escape_debug()));
            }
            if !image.chars().all(|c| c.is_ascii_alphanumeric() || "-_./".contains(c)) || image.is_empty() {
                return Err(format!(
                    "the image path '{}' may hold letters, digits, '-', '_', '.' and '/' only",
                    image.escape_debug()
                ));
            }
        }
        Ok(())
    }

    /// What is doubtful in the images of cases that were not rendered here, the same of several once.
    pub fn doubts(&self) -> Vec<String> {
        let of = |c: &CaseRecord| {
            let handed_in = c.source.iter().flat_map(|s| &s.warnings);
            handed_in.chain(&c.warnings).map(|w| (c.case.id(), w.clone())).collect::<Vec<_>>()
        };
        told_once(&self.cases.iter().flat_map(of).collect::<Vec<_>>(), "cases", self.cases.len())
    }

    /// Milliseconds that one replicate of a case took; None where that is not known.
    pub fn milliseconds(&self, case: &CaseRecord) -> Option<f64> {
        let seconds = self.timing.cases.get(&case.case.id())?;
        Some(seconds * 1e3 / f64::from(self.replicates(case).max(1)))
    }

    /// Replicates in the image of a case.
    pub fn replicates(&self, case: &CaseRecord) -> u32 {
        case.replicates.unwrap_or(self.suite.replicates)
    }

    /// Whether the suite has gates and not one of them was held against anything, each
    /// with an excuse: what such a run shows is not that all is well. That there is no base record, on
    /// purpose, is excuse enough where all gates need one. Of images that were handed in: whether the suite has
    /// gates and none of them was held against an image; that the kit's own judge passes is nothing to them.
    pub fn has_judged_nothing(&self) -> bool {
        if self.handed_in.is_some() {
            return !self.suite.gates.is_empty() && self.verdicts.iter().all(|v| v.case.is_none());
        }
        let needs_base = |name: &str| self.suite.gates.iter().any(|g| g.name == name && g.is_against_base());
        let is_first = self.no_base && self.idle_gates.iter().all(|g| needs_base(&g.gate));
        let all_excused = !self.idle_gates.is_empty() && self.idle_gates.iter().all(|g| g.excused);
        self.verdicts.is_empty() && all_excused && !is_first
    }

    /// Whether nothing was judged and no idle gate says so: all gates are on the kit's own judge, and none speaks of the
    /// images that were handed in.
    pub(crate) fn judges_no_image(&self) -> bool {
        self.end() == End::Nothing && self.idle_gates.is_empty()
    }

    /// Text for people: `5 passed, 1 failed, ...`.
    pub fn summary_line(&self) -> String {
        let s = &self.summary;
        let mut line = format!("{} passed, {} failed, {} inconclusive", s.pass, s.fail, s.inconclusive);
        if s.known_failures > 0 {
            line += &format!(", {}", counted(s.known_failures, "known failure", "known failures"));
        }
        if s.warnings > 0 {
            line += &format!(", {}", counted(s.warnings, "warning", "warnings"));
        }
        if s.not_run > 0 {
            line += &format!(", {} not run", s.not_run);
        }
        if s.failed_cases > 0 {
            line += &format!("; {} of {} ended with an error", s.failed_cases, counted(s.cases, "case", "cases"));
        }
        if s.failed_judges > 0 {
            line += &format!("; the judge of {} failed", counted(s.failed_judges, "scene", "scenes"));
        }
        line
    }
}
