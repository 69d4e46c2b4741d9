//! Which cases are in both records, and what they were run with.

use super::Setting;
use crate::record::{CaseRecord, Record};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// A case or judge that ended with an error and had none before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LostCase {
    /// The case, or the scene of the judge.
    pub name: String,
    /// The error.
    pub error: String,
}

/// Which cases are in both records.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Coverage {
    /// Cases that gave an image in both records.
    pub compared: usize,
    /// Of these, those whose images are the same to the last bit.
    pub identical: usize,
    /// Cases that ended with an error in the new record and gave an image before.
    pub lost: Vec<LostCase>,
    /// Judges that failed in the new record and did not before.
    pub lost_judges: Vec<LostCase>,
    /// Cases of the base, with an image, that are not in the new record.
    pub gone: Vec<String>,
    /// Cases that give an image now and were not in the base, or ended with an error
    /// there.
    pub new: Vec<String>,
    /// Of the new ones, those that ended with an error in the base: there is nothing to
    /// compare them with, and that is no fault of the new run.
    pub recovered: usize,
    /// Cases that ended with an error in both records.
    pub still_failing: usize,
}

/// The cases of a record by name.
pub(super) fn by_id(record: &Record) -> BTreeMap<String, &CaseRecord> {
    record.cases.iter().map(|c| (c.case.id(), c)).collect()
}

/// Whether two cases gave the same pixels.
pub(super) fn is_identical(base: &CaseRecord, new: &CaseRecord) -> bool {
    base.hash.is_some() && base.hash == new.hash
}

pub(super) fn coverage(base: &Record, new: &Record) -> Coverage {
    let (old, cases) = (by_id(base), by_id(new));
    let mut found = Coverage::default();
    for was in base.cases.iter().filter(|c| c.error.is_none()) {
        let id = was.case.id();
        match cases.get(&id) {
            None => found.gone.push(id),
            Some(CaseRecord { error: Some(e), .. }) => found.lost.push(LostCase { name: id, error: e.clone() }),
            Some(is) => {
                found.compared += 1;
                found.identical += usize::from(is_identical(was, is));
            }
        }
    }
    for is in &new.cases {
        let id = is.case.id();
        let gave = old.get(&id).is_some_and(|c| c.error.is_none());
        if is.error.is_none() && !gave {
            found.recovered += usize::from(old.contains_key(&id));
            found.new.push(id);
        } else if is.error.is_some() && old.contains_key(&id) && !gave {
            found.still_failing += 1;
        }
    }
    let failed = |r: &Record, name: &str| r.scenes.iter().any(|s| s.name == name && s.judge_error.is_some());
    let judges = new.scenes.iter().filter(|s| !failed(base, &s.name) && base.scenes.iter().any(|b| b.name == s.name));
    found.lost_judges =
        judges.filter_map(|s| Some(LostCase { name: s.name.clone(), error: s.judge_error.clone()? })).collect();
    found
}

/// What the runs were made with, where it differs.
pub(super) fn settings(base: &Record, new: &Record) -> Vec<Setting> {
    let of = |r: &Record| {
        let golden = r.suite.golden_rays.map_or_else(|| "none".to_owned(), |n| n.to_string());
        [
            ("suite", r.suite.name.clone()),
            ("cases asked for", r.filter.clone().unwrap_or_else(|| "all".to_owned())),
            ("tool", r.tool.clone()),
            ("seed", r.seed.to_string()),
            ("replicates", r.suite.replicates.to_string()),
            ("converged rays", r.suite.converged_rays.to_string()),
            ("golden rays", golden),
            ("system", format!("{} {}", r.machine.os, r.machine.arch)),
            ("processor", r.machine.cpu.clone()),
            ("GPU", r.machine.gpu.clone()),
        ]
    };
    let pairs = of(base).into_iter().zip(of(new)).filter(|((_, a), (_, b))| a != b);
    pairs.map(|((what, base), (_, new))| Setting { what: what.to_owned(), base, new }).collect()
}
