//! Removing goldens: of cases that are no more, and by name.

use super::{
    Notice, Slot, Store,
    store::{Snapshot, golden_cases},
};
use crate::{
    counted::counted,
    disk::DiskError,
    record::Record,
    suite::{Plan, Platform, Rays, Suite},
};
use std::collections::BTreeSet;

/// The slots of a suite's golden cases: none where it sets no `golden_rays`.
pub fn named_by_suite(suite: &Suite) -> BTreeSet<Slot> {
    let golden = suite.file.golden_rays.map(Rays::get);
    let cases = Plan::new(suite, Platform::Cpu, None).cases.into_iter().filter(|c| Some(c.rays) == golden);
    cases.map(|c| Slot { scene: c.scene, estimator: c.estimator, rays: c.rays, name: None }).collect()
}

/// The slots of a record's golden cases. A record cannot tell what was left out of it;
/// `of_suite` are the slots of its suite, by [`named_by_suite`].
///
/// # Errors
/// One sentence, where a case ended with an error or the record lacks one of its suite.
pub fn named_by_record(record: &Record, of_suite: &BTreeSet<Slot>) -> Result<BTreeSet<Slot>, String> {
    if let Some(lost) = record.cases.iter().find(|c| c.error.is_some()) {
        return Err(format!("the case {} ended with an error: run the suite again", lost.case.id()));
    }
    let named: BTreeSet<Slot> = golden_cases(record).map(Slot::of).collect();
    match of_suite.difference(&named).next() {
        None => Ok(named),
        Some(Slot { scene, estimator, rays, .. }) => Err(format!(
            "the record has no golden case of estimator '{estimator}' in scene '{scene}' at {}, which its suite '{}' names: give a record of the whole suite",
            counted(*rays, "ray", "rays"),
            record.suite.name
        )),
    }
}

fn orphans(snapshot: &Snapshot, named: &BTreeSet<Slot>) -> Vec<Slot> {
    let is_named = |slot: &Slot| named.contains(&Slot { name: None, ..slot.clone() });
    snapshot.files.keys().filter(|s| !is_named(s)).cloned().collect()
}

impl Store {
    /// The goldens of cases that `named` does not hold.
    ///
    /// # Errors
    /// Where the store cannot be listed.
    pub fn orphans(&self, named: &BTreeSet<Slot>) -> Result<Vec<Slot>, DiskError> {
        self.reading(|snapshot| orphans(snapshot, named))
    }

    /// Removes the goldens of cases that `named` does not hold, all of them or none, and
    /// returns them. `told` as in [`Store::change`].
    ///
    /// # Errors
    /// Where the store cannot be listed or written.
    pub fn prune(&self, named: &BTreeSet<Slot>, told: &dyn Fn(Notice)) -> Result<Vec<Slot>, DiskError> {
        self.removing(|snapshot| orphans(snapshot, named), told)
    }

    /// Removes goldens, all of them or none. Returns those that the store does not have;
    /// where there are any, nothing is removed. `told` as in [`Store::change`].
    ///
    /// # Errors
    /// Where the store cannot be listed or written.
    pub fn remove(&self, slots: &BTreeSet<Slot>, told: &dyn Fn(Notice)) -> Result<Vec<Slot>, DiskError> {
        let mut missing = Vec::new();
        let wanted = |snapshot: &Snapshot| {
            missing = slots.iter().filter(|s| !snapshot.files.contains_key(s)).cloned().collect();
            if missing.is_empty() { slots.iter().cloned().collect() } else { Vec::new() }
        };
        self.removing(wanted, told)?;
        Ok(missing)
    }

    /// Removes what `which` chooses of the store as it is once no other change is under
    /// way.
    fn removing(
        &self,
        which: impl FnOnce(&Snapshot) -> Vec<Slot>,
        told: &dyn Fn(Notice),
    ) -> Result<Vec<Slot>, DiskError> {
        if !self.folder().exists() {
            return Ok(which(&Snapshot::default()));
        }
        let mut change = self.change(told)?;
        let slots = which(&self.snapshot()?);
        for slot in &slots {
            change.remove(&slot.path());
        }
        if !slots.is_empty() {
            change.commit()?;
        }
        Ok(slots)
    }
}
