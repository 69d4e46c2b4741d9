//! Which metrics changed by more than their noise.

use super::{
    ALPHA, Both, Turn,
    coverage::{by_id, is_identical},
    grounds::Grounds,
};
use crate::{
    gate::CONFIDENCE,
    metrics::{Metric, MetricName, regions::Region},
    record::{CaseRecord, Record},
    stats::{holm, welch_of_estimates},
};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// Differences up to this, relative to values above 1, are rounding: images are 32-bit
/// floats.
const ROUNDING: f64 = 1e-6;

/// A metric that changed by more than its noise.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct MetricChange {
    /// The case, or the scene with `(judge)`.
    pub case: String,
    /// The occluder it is taken under, where it is one of several.
    pub occluder: Option<String>,
    /// The metric.
    pub metric: MetricName,
    /// Its region.
    pub region: Option<Region>,
    /// Its value.
    pub value: Both<f64>,
    /// New less base.
    pub difference: f64,
    /// Welch's 95 % interval of the difference, of this metric alone.
    pub interval: Option<[f64; 2]>,
    /// Two-sided p-value of Welch's test, of this metric alone.
    pub p: f64,
    /// The same adjusted over all metrics by Holm.
    pub adjusted_p: f64,
    /// Which way it went.
    pub turn: Turn,
}

/// A metric that had a value and has none, or has no standard error to test it with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct ValueLost {
    /// The case, or the scene with `(judge)`.
    pub case: String,
    /// The occluder it is taken under, where it is one of several.
    pub occluder: Option<String>,
    /// The metric.
    pub metric: MetricName,
    /// Its region.
    pub region: Option<Region>,
    /// Why.
    pub why: Option<String>,
}

/// The metrics of the cases that gave an image in both records.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Metrics {
    /// The chance of naming any metric in `changed` where none changed: the family
    /// error of Holm's correction. A metric is named where its adjusted p is below.
    pub alpha: f64,
    /// Whether both runs drew the same random numbers. They then share noise that
    /// Welch's test takes for independent: it finds less than there is, and nothing
    /// that is not.
    pub same_seed: bool,
    /// Metrics tested.
    pub tested: usize,
    /// Not tested: of images that are the same to the last bit, with equal values.
    pub identical: usize,
    /// Not compared: of another scene or method, or held against another classic AO.
    pub incomparable: usize,
    /// Those that changed, the most significant first, of equal ones the largest.
    pub changed: Vec<MetricChange>,
    /// Those that lost their value.
    pub lost: Vec<ValueLost>,
}

impl Metrics {
    /// How many changed this way.
    pub fn turned(&self, turn: Turn) -> usize {
        self.changed.iter().filter(|m| m.turn == turn).count()
    }
}

/// What a metric should come to.
#[derive(Clone, Copy, PartialEq)]
enum Aim {
    Higher,
    Lower,
    Zero,
}

/// None where no side is better by itself: openness and contrast depend on the scene,
/// and errors against Q measure the direction of light more than AO.
fn aim(name: MetricName, is_control: bool) -> Option<Aim> {
    match name {
        MetricName::Removed => Some(Aim::Higher),
        MetricName::Mae | MetricName::Rmse => Some(Aim::Lower),
        MetricName::ContrastError | MetricName::Bias | MetricName::RendererDifference => Some(Aim::Zero),
        // Elsewhere the extension is there to darken.
        MetricName::OverDarkening if is_control => Some(Aim::Zero),
        _ => None,
    }
}

/// Better or worse where the metric came nearer to its aim, or went further away, by
/// more than half the interval of the difference: from -0.1 to 0.1 is neither.
fn turn(aim: Option<Aim>, value: Both<f64>, half: f64) -> Turn {
    let gain = match aim {
        None => return Turn::Changed,
        Some(Aim::Higher) => value.new - value.base,
        Some(Aim::Lower) => value.base - value.new,
        Some(Aim::Zero) => value.base.abs() - value.new.abs(),
    };
    match gain {
        g if g > half => Turn::Better,
        g if g < -half => Turn::Worse,
        _ => Turn::Changed,
    }
}

/// A metric with its place in the record.
struct Measured<'a> {
    scene: &'a str,
    case: Option<&'a CaseRecord>,
    occluder: Option<&'a str>,
    metric: &'a Metric,
}

type Key = (String, Option<String>, MetricName, Option<Region>);

/// Every metric of a record: of cases, under each occluder, and K(Q) of judges.
fn all(record: &Record) -> BTreeMap<Key, Measured<'_>> {
    let of_cases = record.cases.iter().flat_map(|c| {
        let own = c.metrics.iter().map(|m| (None, m));
        let under = c.occluders.iter().flat_map(|o| o.metrics.iter().map(|m| (Some(o.name.as_str()), m)));
        let measured = move |(occluder, metric)| Measured { scene: &c.case.scene, case: Some(c), occluder, metric };
        own.chain(under).map(measured)
    });
    let of_judges = record.scenes.iter().filter_map(|s| {
        let metric = &s.judge.as_ref()?.contrast;
        Some(Measured { scene: &s.name, case: None, occluder: None, metric })
    });
    of_cases.chain(of_judges).map(|m| (m.key(), m)).collect()
}

impl Measured<'_> {
    fn key(&self) -> Key {
        let subject = self.case.map_or_else(|| format!("{} (judge)", self.scene), |c| c.case.id());
        (subject, self.occluder.map(str::to_owned), self.metric.name, self.metric.region)
    }

    fn is_comparable(&self, grounds: &Grounds) -> bool {
        let case = self.case.map_or_else(|| grounds.has_scene(self.scene), |c| grounds.has_case(&c.case));
        case && grounds.has_metric(self.metric.name)
    }
}

/// Tests every metric that is in both records.
pub(super) fn metrics(base: &Record, new: &Record, grounds: &Grounds) -> Metrics {
    let same_seed = base.seed == new.seed;
    let mut found = Metrics {
        alpha: ALPHA,
        same_seed,
        tested: 0,
        identical: 0,
        incomparable: 0,
        changed: Vec::new(),
        lost: Vec::new(),
    };
    let (old, cases) = (all(base), by_id(base));
    let mut tested = Vec::new();
    for ((case, occluder, metric, region), is) in all(new) {
        let given = is.case.is_none_or(|c| c.error.is_none() && cases.get(&case).is_some_and(|b| b.error.is_none()));
        let key = (case, occluder, metric, region);
        let Some(was) = old.get(&key).filter(|_| given) else { continue };
        if !is.is_comparable(grounds) {
            found.incomparable += 1;
            continue;
        }
        let same_image = is.case.is_none_or(|c| was.case.is_some_and(|b| is_identical(b, c)));
        if same_seed && same_image && was.metric.value == is.metric.value {
            found.identical += 1;
            continue;
        }
        let (case, occluder, ..) = key;
        match (was.metric.estimate(), is.metric.estimate()) {
            (Some(a), Some(b)) => {
                let is_control = new.scenes.iter().any(|s| s.name == is.scene && s.control);
                tested.push(test(case, occluder, [was.metric, is.metric], &welch_of_estimates(&b, &a), is_control));
            }
            (Some(_), None) => {
                let why = is.metric.note.clone();
                found.lost.push(ValueLost { case, occluder, metric, region, why });
            }
            _ => {}
        }
    }
    let adjusted = holm(&tested.iter().map(|m| m.p).collect::<Vec<_>>());
    for (metric, adjusted) in tested.iter_mut().zip(adjusted) {
        metric.adjusted_p = adjusted;
    }
    found.tested = tested.len();
    tested.retain(|m| m.adjusted_p < ALPHA);
    tested
        .sort_by(|a, b| a.adjusted_p.total_cmp(&b.adjusted_p).then(b.difference.abs().total_cmp(&a.difference.abs())));
    found.changed = tested;
    found
}

fn test(
    case: String,
    occluder: Option<String>,
    [was, is]: [&Metric; 2],
    welch: &crate::stats::Welch,
    is_control: bool,
) -> MetricChange {
    let value = Both { base: was.value.unwrap_or(f64::NAN), new: is.value.unwrap_or(f64::NAN) };
    let [lo, hi] = welch.difference.interval(CONFIDENCE);
    let difference = welch.difference.value;
    let is_rounding = difference.abs() <= ROUNDING * value.base.abs().max(value.new.abs()).max(1.0);
    MetricChange {
        case,
        occluder,
        metric: is.name,
        region: is.region,
        value,
        difference,
        interval: Some([lo, hi]).filter(|i| i.iter().all(|v| v.is_finite())),
        p: if is_rounding { 1.0 } else { welch.p_two },
        adjusted_p: f64::NAN,
        turn: turn(aim(is.name, is_control), value, (hi - lo) / 2.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_turn_is_towards_the_aim() {
        let of = |name, base, new| turn(aim(name, false), Both { base, new }, 0.01);
        use MetricName::*;
        for (name, base, new, expected) in [
            (Removed, 0.5, 0.6, Turn::Better),
            (Removed, 0.6, 0.5, Turn::Worse),
            (Rmse, 0.5, 0.6, Turn::Worse),
            (ContrastError, 0.3, 0.1, Turn::Better),
            (ContrastError, -0.1, -0.3, Turn::Worse),
            (ContrastError, -0.1, 0.105, Turn::Changed),
            (ContrastError, -0.1, 0.2, Turn::Worse),
            (Openness, 0.1, 0.2, Turn::Changed),
            (JudgeBias, 0.1, 0.2, Turn::Changed),
            (OverDarkening, 0.0, 0.2, Turn::Changed),
        ] {
            assert_eq!(of(name, base, new), expected, "{name:?} {base} {new}");
        }
        assert_eq!(turn(aim(OverDarkening, true), Both { base: 0.0, new: 0.2 }, 0.01), Turn::Worse);
    }
}
