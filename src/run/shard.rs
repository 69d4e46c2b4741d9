//! A part of a run, on a machine of its own.

use super::{
    BUILD, Means, Prepared, RunError, at_first_failure,
    journal::{Done, Journal},
    mine,
    progress::Progress,
    rendering::{Rendered, Studio},
    timing,
};
use crate::{
    counted::counted,
    disk::{DiskError, read_json, write_json},
    record::{Budget, Machine, RecordFolder, SHARD, Undecided},
    suite::Platform,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{fmt, path::Path, str::FromStr, time::Instant};

/// Version of the format of `shard.json`.
const VERSION: u32 = 2;

/// Shards of one run, at most.
const MOST: u32 = 65_536;

/// Which of several parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// From 1.
    pub index: u32,
    /// How many there are.
    pub of: u32,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(k, n)| Some([k.parse().ok()?, n.parse().ok()?]));
        match parts {
            Some([index, of]) if (1..=MOST).contains(&of) && (1..=of).contains(&index) => Ok(Shard { index, of }),
            _ => Err(format!("'{text}' is no shard: give K/N, K from 1 to N and N at most {MOST}, or auto")),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

/// What names a shard in its environment: the name of a system, the variables of index
/// and count, and the first index, or the variable that holds it.
const SYSTEMS: [[&str; 4]; 4] = [
    ["GitLab", "CI_NODE_INDEX", "CI_NODE_TOTAL", "1"],
    ["Slurm", "SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN"],
    ["Kubernetes", "JOB_COMPLETION_INDEX", "JOB_COMPLETIONS", "0"],
    ["GitHub Actions", "MATRIX_INDEX", "MATRIX_TOTAL", "0"],
];

impl Shard {
    /// K and N as the environment of what runs the shards has them, with its name:
    /// `AOGAUGE_SHARD=K/N`; GitLab's `parallel` (`CI_NODE_INDEX` from 1, `CI_NODE_TOTAL`); Slurm
    /// arrays (`SLURM_ARRAY_TASK_ID` from `SLURM_ARRAY_TASK_MIN`, `SLURM_ARRAY_TASK_COUNT`); indexed
    /// Jobs of Kubernetes (`JOB_COMPLETION_INDEX` from 0, and `JOB_COMPLETIONS`, which the Job must
    /// set itself). GitHub's matrices set no variable of their own: the workflow hands
    /// over `strategy.job-index` (from 0) and `strategy.job-total` as `MATRIX_INDEX` and `MATRIX_TOTAL`.
    /// An empty variable counts as none. `AOGAUGE_SHARD` goes before all others.
    ///
    /// # Errors
    /// One sentence, where no such variables are set, only one of a pair is, they are no
    /// shard, or two systems name different ones, as a Slurm array that was submitted by a parallel
    /// job of GitLab has it.
    pub fn of_environment(get: &dyn Fn(&str) -> Option<String>) -> Result<(Shard, &'static str), String> {
        let get = |name: &str| get(name).filter(|value| !value.trim().is_empty());
        if let Some(text) = get("AOGAUGE_SHARD") {
            return Ok((text.trim().parse().map_err(|e| format!("AOGAUGE_SHARD: {e}"))?, "AOGAUGE_SHARD"));
        }
        let (mut found, mut half) = (Vec::new(), None);
        for [name, index, of, first] in SYSTEMS {
            let [k, n] = [get(index), get(of)];
            if let (Some(k), Some(n)) = (&k, &n) {
                let first = if first.parse::<u32>().is_ok() { Some(first.to_owned()) } else { get(first) };
                let first = first.unwrap_or_else(|| "0".to_owned());
                found.push((Shard::counted([index, k], [of, n], &first)?, name));
            } else if k.is_some() || n.is_some() {
                // GitLab sets the count in every job, so that alone it says nothing.
                let [set, missing] = if k.is_some() { [index, of] } else { [of, index] };
                half = half.or(Some(format!("{set} is set, but {missing} is not: {name} needs both to name a shard")));
            }
        }
        let none = || "no shard is named by the environment: give --shard K/N, or set AOGAUGE_SHARD".to_owned();
        let Some(&one) = found.first() else { return Err(half.unwrap_or_else(none)) };
        match found.iter().find(|other| other.0 != one.0) {
            Some((shard, name)) => Err(format!(
                "{} says shard {}, {name} says {shard}: give --shard K/N, or set AOGAUGE_SHARD",
                one.1, one.0
            )),
            None => Ok(one),
        }
    }

    /// The shard of an index that is counted from `first` on.
    fn counted([index, k]: [&str; 2], [of, n]: [&str; 2], first: &str) -> Result<Shard, String> {
        let number = |name: &str, text: &str| {
            text.trim().parse::<u32>().map_err(|_| format!("{name} is '{text}', not a number of 0 or more"))
        };
        let (k, n, first) = (number(index, k)?, number(of, n)?, number("the first index", first)?);
        let at = k.checked_sub(first).filter(|k| *k < n && n <= MOST);
        let at = at.ok_or_else(|| {
            format!("{index} is {k} and {of} is {n}: the index must go from {first} in steps of 1, one for each shard")
        })?;
        Ok(Shard { index: at + 1, of: n })
    }
}

/// A part of a run on disk: `shard.json`, written last. Its images lie beside it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ShardRecord {
    /// Version of this format.
    pub version: u32,
    /// Version of the tool that wrote it.
    pub tool: String,
    /// What that is built from, hashed.
    pub build: String,
    /// Which part.
    pub shard: Shard,
    /// What decides which images come of the run, hashed: equal in all its shards.
    pub identity: String,
    /// The suite, as it was asked for.
    pub suite: String,
    /// Seed of all randomness.
    pub seed: u32,
    /// What there was to render on.
    pub platform: Platform,
    /// Whether external renderers were left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub without_external: bool,
    /// What the names of cases had to contain.
    pub filter: Option<String>,
    /// The most replicates of a run that goes on until it is sure.
    pub until_sure: Option<u32>,
    /// Then: after so many seconds no replicates were added.
    pub max_time: Option<f64>,
    /// Then: what is read of the base record, hashed, where a gate is against it.
    pub base: Option<String>,
    /// Then: what `max_time` ended.
    pub ended: Vec<Undecided>,
    /// Where it ran.
    pub machine: Machine,
    /// When it began, UTC.
    pub began: String,
    /// Wall clock, seconds.
    pub seconds: f64,
    /// CPU threads.
    pub threads: usize,
    /// Its units.
    pub units: Vec<Done>,
    /// Why it ended early.
    pub incomplete: Option<String>,
}

impl ShardRecord {
    /// Reads the shard in a folder.
    ///
    /// # Errors
    /// Where there is none, it is malformed or of another version.
    pub fn read(folder: &Path) -> Result<Self, DiskError> {
        let path = folder.join(SHARD);
        if !path.exists() {
            return Err(DiskError::content(
                folder,
                format!("there is no {SHARD} here: not a shard, or it did not finish"),
            ));
        }
        read_json(&path, VERSION, "a shard", "it is a shard")
    }
}

impl Prepared<'_> {
    /// Renders a part of the plan and leaves it to be merged. `suite` is how the suite
    /// was asked for.
    ///
    /// # Errors
    /// As [`Prepared::run`].
    pub fn run_shard(
        &self,
        shard: Shard,
        suite: &str,
        means: &Means<'_>,
        folder: &RecordFolder,
        observer: &dyn super::Observer,
    ) -> Result<ShardRecord, RunError> {
        let start = Instant::now();
        let timing = timing();
        let progress = Progress::new(observer, self.cost(Some(shard)));
        let journal = Journal { folder };
        let until = means.max_time.and_then(|t| start.checked_add(t));
        let (mut units, mut ended, mut early, mut stopped) = (Vec::new(), Vec::new(), None, false);
        for set in &self.sets {
            let studio = Studio::new(set, means, journal, &progress, until);
            let mut rendered = Rendered::default();
            let own = mine(set, Some(shard));
            match self.plan.until_sure {
                Some(_) if !own.is_empty() => {
                    let counts = studio.scene(&mut rendered)?;
                    stopped |= counts.stopped;
                    ended.extend(counts.undecided.into_iter().filter(|u| u.by == Budget::MaxTime));
                }
                _ => studio.render(&own, self.plan.suite.file.replicates.get(), &mut rendered)?,
            }
            early = early.or(rendered.ended.as_deref().map(at_first_failure));
            units.extend(rendered.done);
        }
        units.sort_by(|a, b| a.unit.cmp(&b.unit));
        let missing = self.steps(Some(shard)).len() - units.len();
        let record = ShardRecord {
            version: VERSION,
            tool: env!("CARGO_PKG_VERSION").to_owned(),
            build: BUILD.to_owned(),
            shard,
            identity: self.identity(&means.machine),
            suite: suite.to_owned(),
            seed: self.plan.seed,
            platform: self.plan.platform,
            without_external: !self.plan.external,
            filter: self.plan.filter.clone(),
            until_sure: self.plan.until_sure,
            max_time: means.max_time.map(|t| t.as_secs_f64()),
            base: self.base(),
            ended,
            machine: means.machine.clone(),
            began: timing.began,
            seconds: start.elapsed().as_secs_f64(),
            threads: timing.threads,
            units,
            incomplete: (missing > 0 || stopped).then(|| {
                let what = match missing {
                    0 => "not all replicates that it asks for are rendered".to_owned(),
                    _ => format!("{} not rendered", counted(missing, "unit is", "units are")),
                };
                format!("{}: {what}", early.as_deref().unwrap_or("it ended early"))
            }),
        };
        write_json(&folder.path().join(SHARD), &record, "the shard")?;
        Ok(record)
    }
}
