//! Holding a record against its goldens.

use super::{
    Comparison, Golden, Rejected, Slot, Store, Terms,
    approve::{definition, sampled},
    compare,
    stale::{Stale, stale},
    store::{Snapshot, golden_cases},
};
use crate::{
    disk::DiskError,
    record::{CaseRecord, Record},
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Family error of a verification: the chance that any golden of an unchanged
/// renderer is refused.
pub const ALPHA: f64 = 0.01;

/// Version of what `golden verify`, `list` and `size` print as JSON.
pub const VERSION: u32 = 2;

/// What came of one case.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// There is no golden of this case.
    Missing,
    /// The golden cannot be used: it is broken, or of another scene or setting.
    Unusable(String),
    /// The case ended with an error, or the record's own image cannot be read.
    Lost(String),
    /// Golden and image were compared.
    Compared(Box<Comparison>),
}

/// A golden and what came of it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Against {
    /// The golden's file.
    pub golden: PathBuf,
    /// What came of it.
    pub verdict: Verdict,
}

/// A case and what came of it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Checked {
    /// The case.
    pub case: String,
    /// The golden's file: the one that holds, else the nearest.
    pub golden: PathBuf,
    /// What came of it.
    pub verdict: Verdict,
    /// Other goldens of the case. Those after one that holds were not looked at.
    pub others: Vec<Against>,
    /// Why a reviewer refused this very image; null where none did.
    pub rejected: Option<String>,
}

/// What kind of end a verification comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Every golden holds.
    Pass,
    /// An image differs from its golden.
    Fail,
    /// Nothing differs, but a difference that matters could not have been seen.
    Blind,
    /// A golden is missing or unusable.
    Missing,
    /// The record has no image to compare.
    Lost,
}

/// What came of a record.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct Verification {
    /// Version of this format.
    pub version: u32,
    /// The family error over all cases.
    pub alpha: f64,
    /// The cases, in the order of the record.
    pub cases: Vec<Checked>,
    /// Set where so many cases moved the same way that the goldens are probably stale.
    pub stale: Option<Stale>,
    /// Whether an approval was cut short and counts as done.
    pub interrupted: bool,
}

impl Verdict {
    fn outcome(&self) -> Outcome {
        match self {
            Verdict::Missing | Verdict::Unusable(_) => Outcome::Missing,
            Verdict::Lost(_) => Outcome::Lost,
            Verdict::Compared(c) if c.is_blind() => Outcome::Blind,
            Verdict::Compared(c) if c.passes() => Outcome::Pass,
            Verdict::Compared(_) => Outcome::Fail,
        }
    }

    /// Smaller is nearer: what holds, then what was too noisy to tell, then what
    /// differs by its distance, then what cannot be used.
    fn rank(&self) -> (u8, f64) {
        match (self.outcome(), self) {
            (Outcome::Pass, _) => (0, 0.0),
            (Outcome::Blind, _) => (1, 0.0),
            (_, Verdict::Compared(c)) => (2, c.distance),
            _ => (3, 0.0),
        }
    }
}

impl Checked {
    /// The kind of end.
    pub fn outcome(&self) -> Outcome {
        self.verdict.outcome()
    }

    /// One line for people.
    pub fn line(&self) -> String {
        format!("{:<44} {}", self.case, self.text())
    }

    /// The same without the case.
    pub fn text(&self) -> String {
        let text = match &self.verdict {
            Verdict::Missing => format!("MISSING    there is no {}", self.golden.display()),
            Verdict::Unusable(why) => format!("UNUSABLE   {why}"),
            Verdict::Lost(why) => format!("LOST       {why}"),
            Verdict::Compared(c) => c.line(),
        };
        let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let others = match (self.others.len(), self.outcome()) {
            (0, _) => String::new(),
            (n, Outcome::Pass) => format!("; {} holds, {n} before it did not", name(&self.golden)),
            (n, _) => format!("; nearest of {}: {}", n + 1, name(&self.golden)),
        };
        let rejected = self.rejected.as_ref().map_or_else(String::new, |why| format!("; rejected before: {why}"));
        format!("{text}{others}{rejected}")
    }
}

impl Verification {
    /// How many cases came to this end.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.cases.iter().filter(|c| c.outcome() == outcome).count()
    }
}

impl Store {
    /// Compares every golden case of a record whose name contains `only` with its
    /// goldens; one that holds is enough. The family error over all tests of all cases
    /// is [`ALPHA`].
    ///
    /// # Errors
    /// Where the store cannot be listed or locked. What is wrong with a golden or a case
    /// is a [`Verdict`].
    pub fn verify(&self, folder: &Path, record: &Record, only: &str) -> Result<Verification, DiskError> {
        let cases: Vec<&CaseRecord> = golden_cases(record).filter(|c| c.case.id().contains(only)).collect();
        let rejections = self.rejections()?;
        self.reading(|snapshot| {
            let check = |case: &&CaseRecord| {
                let mut checked = self.check(snapshot, folder, record, case, cases.len());
                let alike = |r: &&Rejected| r.case == checked.case && Some(&r.pixel_hash) == case.hash.as_ref();
                checked.rejected = rejections.iter().find(alike).map(|r| r.reason.clone());
                checked
            };
            let checked: Vec<Checked> = cases.par_iter().map(check).collect();
            let (version, stale, interrupted) = (VERSION, stale(&checked), snapshot.interrupted);
            Verification { version, alpha: ALPHA, cases: checked, stale, interrupted }
        })
    }

    fn check(&self, snapshot: &Snapshot, folder: &Path, record: &Record, case: &CaseRecord, family: usize) -> Checked {
        let slot = Slot::of(case);
        let name = case.case.id();
        let lost = |why: String| {
            let golden = self.path(&slot);
            Checked { case: name.clone(), golden, verdict: Verdict::Lost(why), others: Vec::new(), rejected: None }
        };
        if let Some(error) = &case.error {
            return lost(error.clone());
        }
        let image = match sampled(folder, record, case) {
            Ok(image) => image,
            Err(e) => return lost(e.to_string()),
        };
        let mut all: Vec<Against> = Vec::new();
        for (own, path) in snapshot.files.iter().filter(|(own, _)| own.is_beside(&slot)) {
            let verdict = match usable(path, record, case, &image) {
                Ok(golden) => {
                    let limits = golden.limits.unwrap_or_default();
                    let terms = Terms { alpha: ALPHA, family, limits, regions: &golden.regions };
                    Verdict::Compared(Box::new(compare(&golden.image, &image, &terms)))
                }
                Err(why) => Verdict::Unusable(why),
            };
            let holds = verdict.outcome() == Outcome::Pass;
            all.push(Against { golden: self.path(own), verdict });
            if holds {
                break;
            }
        }
        let nearest = (0..all.len()).min_by(|&a, &b| {
            let ((x, dx), (y, dy)) = (all[a].verdict.rank(), all[b].verdict.rank());
            x.cmp(&y).then(dx.total_cmp(&dy))
        });
        match nearest {
            None => {
                Checked { case: name, golden: self.path(&slot), verdict: Verdict::Missing, others: all, rejected: None }
            }
            Some(i) => {
                let Against { golden, verdict } = all.remove(i);
                Checked { case: name, golden, verdict, others: all, rejected: None }
            }
        }
    }
}

/// The golden, where it is of the case's identity.
fn usable(path: &Path, record: &Record, case: &CaseRecord, image: &super::Sampled) -> Result<Golden, String> {
    let golden = Golden::read(path).map_err(|e| e.to_string())?;
    let identity = &golden.identity;
    let at = path.display();
    let scene = record.scenes.iter().find(|s| s.name == case.case.scene);
    if scene.is_none_or(|s| s.hash != identity.scene_hash) {
        return Err(format!("{at}: the golden is of another version of the scene; approve it anew"));
    }
    let wanted = definition(record, &case.case.estimator);
    if identity.definition != wanted {
        return Err(format!(
            "{at}: the golden is of {}, the record's '{}' is {wanted}",
            identity.definition, case.case.estimator
        ));
    }
    if identity.rays != case.case.rays || identity.estimator != case.case.estimator {
        return Err(format!(
            "{at}: the golden is of {} at {} rays, not what its name says",
            identity.estimator, identity.rays
        ));
    }
    if identity.resolution != image.resolution {
        return Err(format!("{at}: the golden is {:?} pixels, the image {:?}", identity.resolution, image.resolution));
    }
    if image.tiles.is_some() && golden.image.tiles.is_none() {
        return Err(format!(
            "{at}: the golden lacks means of tiles, which smoothed images are compared by; approve it anew"
        ));
    }
    Ok(golden)
}
