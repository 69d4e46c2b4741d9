//! Holding a record against its goldens.

use super::{
    Comparison, Golden, Rejected, Sampled, Slot, Store, Terms,
    approve::{definition, sampled},
    compare,
    stale::{Stale, stale},
    store::{Snapshot, golden_cases},
};
use crate::{
    counted::counted,
    disk::DiskError,
    record::{CaseRecord, Record},
};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

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

/// A golden that cannot be read: broken, a Git LFS pointer, or changed by anything but an approval.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Unreadable {
    /// The golden's file.
    pub golden: PathBuf,
    /// Why, with the file that was read.
    pub why: String,
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
    /// Other goldens of the case. Those after one that holds were not compared.
    pub others: Vec<Against>,
    /// Goldens of the case that cannot be read, whether or not another one holds.
    pub unreadable: Vec<Unreadable>,
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
        let unreadable: String =
            self.unreadable_beside().map(|u| format!("; UNREADABLE beside it: {}", u.why)).collect();
        let rejected = self.rejected.as_ref().map_or_else(String::new, |why| format!("; rejected before: {why}"));
        format!("{text}{others}{unreadable}{rejected}")
    }

    /// Whether a golden of the case holds and all of them can be read.
    pub fn is_whole(&self) -> bool {
        self.outcome() == Outcome::Pass && self.unreadable.is_empty()
    }

    /// Goldens that cannot be read, beside the one that the verdict is of.
    pub fn unreadable_beside(&self) -> impl Iterator<Item = &Unreadable> {
        self.unreadable.iter().filter(|u| u.golden != self.golden)
    }
}

impl Verification {
    /// How many cases came to this end.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.cases.iter().filter(|c| c.outcome() == outcome).count()
    }

    /// One sentence that counts what cases came to, and goldens beside theirs that cannot be read.
    pub fn summary(&self) -> String {
        let [pass, fail, blind, missing, lost] =
            [Outcome::Pass, Outcome::Fail, Outcome::Blind, Outcome::Missing, Outcome::Lost].map(|o| self.count(o));
        let beside: BTreeSet<&Path> =
            self.cases.iter().flat_map(Checked::unreadable_beside).map(|u| u.golden.as_path()).collect();
        let beside = match beside.len() {
            0 => String::new(),
            n => format!("; {} beside them cannot be read", counted(n, "golden", "goldens")),
        };
        format!(
            "{pass} hold, {fail} differ, {blind} too noisy to tell, {missing} missing or unusable, {lost} lost{beside}"
        )
    }

    /// Whether some golden cannot be read.
    pub fn has_unreadable(&self) -> bool {
        self.cases.iter().any(|c| !c.unreadable.is_empty())
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
        let checked = |golden: PathBuf, verdict: Verdict| Checked {
            case: case.case.id(),
            golden,
            verdict,
            others: Vec::new(),
            unreadable: Vec::new(),
            rejected: None,
        };
        let lost = |why: String| checked(self.path(&slot), Verdict::Lost(why));
        if let Some(error) = &case.error {
            return lost(error.clone());
        }
        let image = match sampled(folder, record, case) {
            Ok(image) => image,
            Err(e) => return lost(e.to_string()),
        };
        let (mut all, mut unreadable, mut holds) = (Vec::new(), Vec::new(), false);
        for (own, path) in snapshot.files.iter().filter(|(own, _)| own.is_beside(&slot)) {
            let golden = self.path(own);
            let read = Golden::read(path).map_err(|e| e.to_string());
            if let Err(why) = &read {
                unreadable.push(Unreadable { golden: golden.clone(), why: why.clone() });
            }
            if holds {
                continue;
            }
            let usable = read.and_then(|read| misfit(&read, path, record, case, &image).map_or(Ok(read), Err));
            let verdict = usable.map_or_else(Verdict::Unusable, |golden| {
                let limits = golden.limits.unwrap_or_default();
                let terms = Terms { alpha: ALPHA, family, limits, regions: &golden.regions };
                Verdict::Compared(Box::new(compare(&golden.image, &image, &terms)))
            });
            holds = verdict.outcome() == Outcome::Pass;
            all.push(Against { golden, verdict });
        }
        let nearest = (0..all.len()).min_by(|&a, &b| {
            let ((x, dx), (y, dy)) = (all[a].verdict.rank(), all[b].verdict.rank());
            x.cmp(&y).then(dx.total_cmp(&dy))
        });
        let Some(nearest) = nearest else { return checked(self.path(&slot), Verdict::Missing) };
        let Against { golden, verdict } = all.remove(nearest);
        Checked { others: all, unreadable, ..checked(golden, verdict) }
    }
}

/// Why a golden is not of the case's identity; None where it is.
fn misfit(golden: &Golden, path: &Path, record: &Record, case: &CaseRecord, image: &Sampled) -> Option<String> {
    let identity = &golden.identity;
    let at = path.display();
    let scene = record.scenes.iter().find(|s| s.name == case.case.scene);
    if scene.is_none_or(|s| s.hash != identity.scene_hash) {
        return Some(format!("{at}: the golden is of another version of the scene; approve it anew"));
    }
    let wanted = definition(record, &case.case.estimator);
    if identity.definition != wanted {
        return Some(format!(
            "{at}: the golden is of {}, the record's '{}' is {wanted}",
            identity.definition, case.case.estimator
        ));
    }
    if identity.rays != case.case.rays || identity.estimator != case.case.estimator {
        return Some(format!(
            "{at}: the golden is of {} at {}, not what its name says",
            identity.estimator,
            counted(identity.rays, "ray", "rays")
        ));
    }
    if identity.resolution != image.resolution {
        let [[w, h], [width, height]] = [identity.resolution, image.resolution];
        return Some(format!("{at}: the golden has {w} x {h} pixels, the image {width} x {height}"));
    }
    let lacks = image.tiles.is_some() && golden.image.tiles.is_none();
    lacks.then(|| {
        format!("{at}: the golden lacks means of tiles, which smoothed images are compared by; approve it anew")
    })
}
