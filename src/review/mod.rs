//! A review of goldens: cases whose images do not hold, looked at on a page and approved
//! or rejected one by one. What is decided goes to the store; nothing here renders.

mod page;
mod server;

pub use server::{Ended, ReviewError, serve};

use crate::{
    disk::DiskError,
    golden::{
        Approval, ApproveError, Checked, Golden, Outcome, Rejected, Selection, Slot, Store, Verification, golden_cases,
    },
    record::{CaseRecord, Record},
    report::ReportError,
};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Longest reason, characters.
pub const LONGEST_REASON: usize = 1000;

/// A record and a store, while somebody decides.
#[derive(Clone, Debug)]
pub struct Review {
    store: Store,
    folder: PathBuf,
    record: Record,
    /// What the names of cases must contain.
    only: String,
    /// Whether cases that hold are shown too.
    all: bool,
    found: Verification,
    /// Cases that somebody decided on, in order.
    decisions: Vec<(String, Decision)>,
}

/// What is decided of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Decision {
    /// It is right, and becomes the golden.
    Approve,
    /// It is wrong: the golden stays, and the image is remembered.
    Reject,
}

/// Why nothing was decided.
#[derive(Debug, thiserror::Error)]
pub enum DecideError {
    /// No case of that name is under review.
    #[error("there is no case '{0}' in this review")]
    Unknown(String),
    /// There is no reason, or too long a one.
    #[error("the reason has {0} characters: give one of 1 to {LONGEST_REASON}")]
    Reason(usize),
    /// The case has no image.
    #[error("case '{0}' has no image to decide on: it ended with an error")]
    NoImage(String),
    /// The store refused.
    #[error(transparent)]
    Approve(#[from] ApproveError),
    /// The store cannot be read or written.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

impl Review {
    /// Holds a record in `folder` against a store; of cases whose name contains `only`,
    /// those are under review that [`Review::shown`] tells, or `all`.
    ///
    /// # Errors
    /// Where the record or the store cannot be read.
    pub fn new(store: Store, folder: &Path, only: &str, all: bool) -> Result<Self, DiskError> {
        let record = Record::read(folder)?;
        let found = store.verify(folder, &record, only)?;
        Ok(Review {
            store,
            folder: folder.to_owned(),
            record,
            only: only.to_owned(),
            all,
            found,
            decisions: Vec::new(),
        })
    }

    /// The record.
    pub fn record(&self) -> &Record {
        &self.record
    }

    /// How record and store stand to each other now.
    pub fn verification(&self) -> &Verification {
        &self.found
    }

    /// How often each was decided.
    pub fn count(&self, decision: Decision) -> usize {
        self.decisions.iter().filter(|(_, d)| *d == decision).count()
    }

    /// The cases under review: those that do not hold, those with a golden that cannot be read, those that were decided on, and
    /// where all are shown the others.
    pub fn shown(&self) -> impl Iterator<Item = (&Checked, &CaseRecord)> {
        let decided = |id: &str| self.decisions.iter().any(|(case, _)| case == id);
        let cases = self.found.cases.iter();
        let shown = cases.filter(move |c| self.all || !c.is_whole() || decided(&c.case));
        shown.filter_map(|c| Some((c, golden_cases(&self.record).find(|r| r.case.id() == c.case)?)))
    }

    /// Approves or rejects the image of one case. Returns what was done, for people.
    ///
    /// # Errors
    /// [`DecideError`]; nothing is changed then.
    pub fn decide(&mut self, case: &str, decision: Decision, reason: &str) -> Result<String, DecideError> {
        let reason = reason.trim();
        let length = reason.chars().count();
        if !(1..=LONGEST_REASON).contains(&length) {
            return Err(DecideError::Reason(length));
        }
        let Some((checked, of)) = self.shown().find(|(c, _)| c.case == case) else {
            return Err(DecideError::Unknown(case.to_owned()));
        };
        let Some(hash) = of.hash.clone().filter(|_| of.error.is_none()) else {
            return Err(DecideError::NoImage(case.to_owned()));
        };
        let (kept, first) = (checked.golden.display().to_string(), self.approved(of));
        let (renderer, limits) = (of.case.renderer.clone(), Golden::read(&first).ok().and_then(|g| g.limits));
        let message = match decision {
            Decision::Approve => {
                let only = Selection::Case(case);
                let (name, most, dry_run) = (None, None, false);
                let approval = Approval { reason, only, renderer: &renderer, name, limits, most, dry_run };
                self.store.approve(&self.folder, &self.record, &approval, &|_| ())?;
                format!("Approved: {}.", first.display())
            }
            Decision::Reject => {
                // What is rejected is what was seen.
                of.layers(&self.folder)?;
                let rejected = Rejected { case: case.to_owned(), pixel_hash: hash, reason: reason.to_owned() };
                self.store.reject(&rejected, &|_| ())?;
                format!("Rejected: {kept} stays as it is.")
            }
        };
        self.decisions.retain(|(c, _)| c != case);
        self.decisions.push((case.to_owned(), decision));
        self.found = self.store.verify(&self.folder, &self.record, &self.only)?;
        Ok(message)
    }

    /// The golden that an approval of a case writes: its first one.
    fn approved(&self, case: &CaseRecord) -> PathBuf {
        self.store.path(&Slot::of(case))
    }

    /// What a case has come to, as the page names it.
    fn outcome(&self, case: &str) -> &'static str {
        let rejected = self.decisions.iter().any(|(c, d)| c == case && *d == Decision::Reject);
        let found = self.found.cases.iter().find(|c| c.case == case);
        match found.map(Checked::outcome) {
            _ if rejected => "fail",
            Some(Outcome::Pass) if found.is_some_and(Checked::is_whole) => "pass",
            Some(Outcome::Pass | Outcome::Missing) => "warn",
            Some(Outcome::Fail) => "fail",
            Some(Outcome::Blind) => "inconclusive",
            Some(Outcome::Lost) | None => "error",
        }
    }

    /// The page, with the token that decisions must carry.
    ///
    /// # Errors
    /// Where an image of the record cannot be read.
    pub fn html(&self, token: &str) -> Result<String, ReportError> {
        page::html(self, token)
    }
}
