//! Verdicts and gates that changed.

use super::{Both, Turn};
use crate::{
    gate::{Outcome, Verdict},
    record::Record,
};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// A verdict that is not what it was.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct VerdictChange {
    /// The gate.
    pub gate: String,
    /// The case, or the scene with `(judge)`.
    pub case: String,
    /// What came of it; null where there was no such verdict before.
    pub base: Option<Outcome>,
    /// What comes of it.
    pub new: Outcome,
    /// Which way it went.
    pub turn: Turn,
    /// The metric.
    pub metric: String,
    /// The metric's value.
    pub value: Both<Option<f64>>,
    /// Its 95 % interval.
    pub interval: Both<Option<[f64; 2]>>,
    /// What it must satisfy now.
    pub limit: String,
    /// Why it is what it is now.
    pub reason: String,
}

/// A gate that was not there.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct NewGate {
    /// The gate.
    pub gate: String,
    /// The worst of its verdicts.
    pub outcome: Outcome,
    /// How many cases it holds for.
    pub cases: usize,
}

/// A gate that is not there any more, or that nothing is held against.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct GoneGate {
    /// The gate.
    pub gate: String,
    /// The worst of its verdicts.
    pub outcome: Outcome,
    /// How many cases it held for.
    pub cases: usize,
    /// Why nothing is held against it; null where the suite has no such gate.
    pub idle: Option<String>,
}

/// A gate whose limit is another one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LimitChange {
    /// The gate.
    pub gate: String,
    /// What it demanded.
    pub base: String,
    /// What it demands.
    pub new: String,
}

/// A case that is still there and is not held against a gate any more.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Withdrawn {
    /// The gate.
    pub gate: String,
    /// The case, or the scene with `(judge)`.
    pub case: String,
    /// What came of it.
    pub outcome: Outcome,
}

/// What became of the gates.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Gates {
    /// Gates that were not there.
    pub new: Vec<NewGate>,
    /// Gates that are not there any more.
    pub gone: Vec<GoneGate>,
    /// Limits that changed.
    pub limits: Vec<LimitChange>,
    /// Cases that a gate does not hold for any more.
    pub withdrawn: Vec<Withdrawn>,
}

impl Gates {
    /// Whether all is as it was.
    pub fn is_empty(&self) -> bool {
        self.new.is_empty() && self.gone.is_empty() && self.limits.is_empty() && self.withdrawn.is_empty()
    }
}

type Key = (String, String);

fn by_key(record: &Record) -> BTreeMap<Key, &Verdict> {
    record.verdicts.iter().map(|v| ((v.gate.clone(), v.subject()), v)).collect()
}

/// Outcomes are in order, the worst first. A known failure is what the suite says it
/// is: no worse than a pass.
fn turn(base: Option<Outcome>, new: Outcome) -> Turn {
    match base {
        None => Turn::Changed,
        Some(Outcome::Pass) if new == Outcome::KnownFailure => Turn::Changed,
        Some(base) if new < base => Turn::Worse,
        Some(_) => Turn::Better,
    }
}

/// Verdicts that changed, the worse first, the worst of them first, then in the order
/// of gates and cases.
pub(super) fn changed(base: &Record, new: &Record) -> Vec<VerdictChange> {
    let old = by_key(base);
    let change = |v: &Verdict| {
        let case = v.subject();
        let was = old.get(&(v.gate.clone(), case.clone())).copied();
        let outcome = was.map(|w| w.outcome);
        let is_told = outcome.map_or(v.outcome < Outcome::KnownFailure, |o| o != v.outcome);
        is_told.then(|| VerdictChange {
            gate: v.gate.clone(),
            case,
            base: outcome,
            new: v.outcome,
            turn: turn(outcome, v.outcome),
            metric: v.metric.title(),
            value: Both { base: was.and_then(|w| w.metric.value), new: v.metric.value },
            interval: Both { base: was.and_then(|w| w.interval), new: v.interval },
            limit: v.limit.text(),
            reason: v.reason.clone(),
        })
    };
    let mut found: Vec<VerdictChange> = new.verdicts.iter().filter_map(change).collect();
    // Of those that got worse, what passed comes first.
    found.sort_by_key(|v| (v.turn, v.new, std::cmp::Reverse(v.base)));
    found
}

/// New and gone gates, and those whose limit or cases changed.
pub(super) fn gates(base: &Record, new: &Record) -> Gates {
    let (old, verdicts) = (by_key(base), by_key(new));
    let names = |of: &BTreeMap<Key, &Verdict>| of.keys().map(|k| k.0.clone()).collect::<BTreeSet<String>>();
    let (was, is) = (names(&old), names(&verdicts));
    let of_gate = |all: &BTreeMap<Key, &Verdict>, gate: &str| {
        let outcomes: Vec<Outcome> = all.iter().filter(|(k, _)| k.0 == gate).map(|(_, v)| v.outcome).collect();
        (outcomes.iter().min().copied().unwrap_or(Outcome::Pass), outcomes.len())
    };
    let idle = |gate: &str| new.idle_gates.iter().find(|g| g.gate == gate).map(|g| g.reason.clone());
    let new_gate = |gate: &String| {
        let (outcome, cases) = of_gate(&verdicts, gate);
        NewGate { gate: gate.clone(), outcome, cases }
    };
    let gone_gate = |gate: &String| {
        let (outcome, cases) = of_gate(&old, gate);
        GoneGate { gate: gate.clone(), outcome, cases, idle: idle(gate) }
    };
    let limit =
        |all: &BTreeMap<Key, &Verdict>, gate: &str| all.iter().find(|(k, _)| k.0 == gate).map(|(_, v)| v.limit.text());
    let limits = was.intersection(&is).filter_map(|gate| {
        let (base, new) = (limit(&old, gate)?, limit(&verdicts, gate)?);
        (base != new).then(|| LimitChange { gate: gate.clone(), base, new })
    });
    let rendered: BTreeSet<String> = new.cases.iter().map(|c| c.case.id()).collect();
    let is_there = |v: &Verdict| match &v.case {
        Some(case) => rendered.contains(&case.id()),
        None => new.scenes.iter().any(|s| s.name == v.scene),
    };
    let withdrawn = old.iter().filter(|(k, v)| is.contains(&k.0) && !verdicts.contains_key(k) && is_there(v));
    Gates {
        new: is.difference(&was).map(new_gate).collect(),
        gone: was.difference(&is).map(gone_gate).collect(),
        limits: limits.collect(),
        withdrawn: withdrawn
            .map(|((gate, case), v)| Withdrawn { gate: gate.clone(), case: case.clone(), outcome: v.outcome })
            .collect(),
    }
}
