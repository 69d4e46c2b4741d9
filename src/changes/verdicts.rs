//! Verdicts and gates that changed.

use super::{Both, GateEdit, Turn, edits::edits};
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
    /// What is held against the limit: the metric, and what it is less of.
    pub metric: String,
    /// Its value; null in the base where something else was held against the limit.
    pub value: Both<Option<f64>>,
    /// Its interval of the gate's confidence alone.
    pub interval: Both<Option<[f64; 2]>>,
    /// What it must satisfy now.
    pub limit: String,
    /// The stricter limit whose breach warns now; null where there is none.
    pub warn: Option<String>,
    /// What became another in the gate itself, its limit among it, in words.
    pub edited: Vec<String>,
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
    /// What else changed in a gate of the same name.
    pub edits: Vec<GateEdit>,
    /// Cases that a gate does not hold for any more.
    pub withdrawn: Vec<Withdrawn>,
}

impl Gates {
    /// Whether all is as it was.
    pub fn is_empty(&self) -> bool {
        let Gates { new, gone, limits, edits, withdrawn } = self;
        new.is_empty() && gone.is_empty() && limits.is_empty() && edits.is_empty() && withdrawn.is_empty()
    }
}

type Key = (String, String);

fn by_key(record: &Record) -> BTreeMap<Key, &Verdict> {
    record.verdicts.iter().map(|v| ((v.gate.clone(), v.subject()), v)).collect()
}

/// Outcomes are in order, the worst first. A warning is told and passes, and a known failure is what
/// the suite says it is: neither is worse than a pass.
fn turn(base: Option<Outcome>, new: Outcome) -> Turn {
    let Some(base) = base else { return Turn::Changed };
    let passes = |o: Outcome| o > Outcome::Inconclusive;
    match (passes(base), passes(new)) {
        (true, true) if new == Outcome::Pass => Turn::Better,
        (true, true) => Turn::Changed,
        _ if new < base => Turn::Worse,
        _ => Turn::Better,
    }
}

/// What a verdict demands, where it may be held against that of another record.
fn held(v: &Verdict) -> impl PartialEq {
    (v.metric.name, v.metric.region, v.against.as_ref().map(|o| o.name.clone()))
}

/// What became another in a gate, in words.
fn edited(was: Option<&Verdict>, v: &Verdict, edits: &[GateEdit]) -> Vec<String> {
    let limit = was.filter(|w| w.limit != v.limit).map(|w| ("limit", w.limit.text(), v.limit.text()));
    let others = edits.iter().filter(|e| e.gate == v.gate);
    let others = others.map(|e| (e.option.as_str(), e.base.clone(), e.new.clone()));
    limit.into_iter().chain(others).map(|(option, base, new)| format!("{option} {base} → {new}")).collect()
}

/// Verdicts that changed, the worse first, the worst of them first, then in the order
/// of gates and cases.
pub(super) fn changed(base: &Record, new: &Record) -> Vec<VerdictChange> {
    let (old, edits) = (by_key(base), edits(base, new));
    let change = |v: &Verdict| {
        let case = v.subject();
        let was = old.get(&(v.gate.clone(), case.clone())).copied();
        let outcome = was.map(|w| w.outcome);
        let alike = was.filter(|w| held(w) == held(v));
        let is_told = outcome.map_or(v.outcome < Outcome::KnownFailure, |o| o != v.outcome);
        is_told.then(|| VerdictChange {
            gate: v.gate.clone(),
            case,
            base: outcome,
            new: v.outcome,
            turn: turn(outcome, v.outcome),
            metric: v.title(),
            value: Both { base: alike.and_then(Verdict::value), new: v.value() },
            interval: Both { base: alike.and_then(|w| w.interval), new: v.interval },
            limit: v.limit.text(),
            warn: v.warn.map(|w| w.text()),
            edited: edited(was, v, &edits),
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
    // A case that ended with an error has no verdict, whatever the suite demands of it.
    let rendered: BTreeSet<String> = new.cases.iter().filter(|c| c.error.is_none()).map(|c| c.case.id()).collect();
    let is_there = |v: &Verdict| match &v.case {
        Some(case) => rendered.contains(&case.id()),
        None => v.is_on_judge() && new.scenes.iter().any(|s| s.name == v.scene),
    };
    let withdrawn = old.iter().filter(|(k, v)| is.contains(&k.0) && !verdicts.contains_key(k) && is_there(v));
    Gates {
        new: is.difference(&was).map(new_gate).collect(),
        gone: was.difference(&is).map(gone_gate).collect(),
        limits: limits.collect(),
        edits: edits(base, new),
        withdrawn: withdrawn
            .map(|((gate, case), v)| Withdrawn { gate: gate.clone(), case: case.clone(), outcome: v.outcome })
            .collect(),
    }
}
