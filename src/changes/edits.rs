//! Gates that are not what they were: another limit, another metric, other cases.

use crate::{gate::Gate, record::Record};
use schemars::JsonSchema;
use serde::Serialize;
use std::fmt::Display;

/// What is another in a gate of the same name, its limit apart.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct GateEdit {
    /// The gate.
    pub gate: String,
    /// Which of its options, as it is called in suite files.
    pub option: String,
    /// What it was.
    pub base: String,
    /// What it is.
    pub new: String,
}

/// One thing of a gate, or that it has none.
fn or_none<T>(of: Option<&T>, text: impl Fn(&T) -> String) -> String {
    of.map_or_else(|| "none".to_owned(), text)
}

/// What a filter lets through.
fn filter<T: Display>(list: &[T]) -> String {
    match list {
        [] => "all".to_owned(),
        _ => list.iter().map(ToString::to_string).collect::<Vec<_>>().join(", "),
    }
}

/// The options of a gate but the limit, which has a list of its own.
fn options(gate: &Gate) -> [(&'static str, String); 10] {
    [
        ("metric", gate.metric.label().to_owned()),
        ("region", or_none(gate.region.as_ref(), |r| r.label().to_owned())),
        ("warn", or_none(gate.warn.as_ref(), crate::gate::Limit::text)),
        ("against", or_none(gate.against.as_ref(), Clone::clone)),
        ("confidence", gate.confidence.to_string()),
        ("scenes", filter(&gate.scenes)),
        ("estimators", filter(&gate.estimators)),
        ("renderers", filter(&gate.renderers)),
        ("rays", filter(&gate.rays)),
        ("known_failure", or_none(gate.known_failure.as_ref(), Clone::clone)),
    ]
}

/// What became another in the gates that both suites have. Records of version 3 do not
/// hold their gates: then nothing is known.
pub(super) fn edits(base: &Record, new: &Record) -> Vec<GateEdit> {
    let pairs = new.suite.gates.iter().filter_map(|g| Some((base.suite.gates.iter().find(|b| b.name == g.name)?, g)));
    let of_pair = |(was, is): (&Gate, &Gate)| {
        let both = options(was).into_iter().zip(options(is)).filter(|(a, b)| a != b);
        let edit = |((option, base), (_, new)): ((&str, String), (&str, String))| GateEdit {
            gate: is.name.clone(),
            option: option.to_owned(),
            base,
            new,
        };
        both.map(edit).collect::<Vec<_>>()
    };
    pairs.flat_map(of_pair).collect()
}
