//! What a metric is held against besides a number: the same metric of another
//! estimator beside it, or of the record of another run.

use super::{Gate, Other};
use crate::{
    layers::short_hash,
    metrics::{Absent, Metric, Quantity},
    record::{CaseRecord, Record, SceneRecord, SuiteInfo},
    stats::Estimate,
    suite::Case,
};

/// What gates read of a record.
#[derive(Clone, Copy)]
pub(super) struct Parts<'a> {
    pub suite: &'a SuiteInfo,
    pub scenes: &'a [SceneRecord],
    pub cases: &'a [CaseRecord],
}

impl<'a> From<&'a Record> for Parts<'a> {
    fn from(record: &'a Record) -> Self {
        Parts { suite: &record.suite, scenes: &record.scenes, cases: &record.cases }
    }
}

/// What was found to hold a metric against, and how often it was looked at.
struct Found {
    case: Option<Case>,
    metric: Result<Metric, String>,
    looks: Option<u32>,
}

/// Value and standard error, where they are known and make sense.
pub(super) fn estimate(metric: &Metric) -> Option<Estimate> {
    metric.estimate().filter(|e| e.se >= 0.0)
}

impl<'a> Parts<'a> {
    pub fn scene(&self, name: &str) -> Option<&'a SceneRecord> {
        self.scenes.iter().find(|s| s.name == name)
    }

    pub fn is_on_screen(&self, estimator: &str) -> bool {
        self.suite.methods.get(estimator).is_some_and(crate::suite::EstimatorFile::is_screen_space)
    }

    /// What `metric` is held against, with the looks it had; None where the gate has
    /// a number alone.
    pub fn other(
        &self,
        base: Option<&Parts<'_>>,
        gate: &Gate,
        scene: &str,
        case: Option<&Case>,
        metric: &Metric,
    ) -> Option<(Other, Option<u32>)> {
        let name = gate.against.as_ref()?;
        let found = match (gate.is_against_base(), base, case) {
            (true, Some(base), _) => self.in_base(base, gate, scene, case),
            (false, _, Some(case)) => self.beside(name, gate, case),
            // Such gates are idle, or refused when a suite is loaded.
            _ => Found { case: None, metric: Err(format!("there is no {name} to hold it against")), looks: None },
        };
        let unknown = |m: &Metric| m.note.clone().unwrap_or_else(|| "the metric has no interval".to_owned());
        let difference = match (estimate(metric), &found.metric) {
            (None, _) => Err(unknown(metric)),
            (_, Err(why)) => Err(why.clone()),
            (Some(own), Ok(m)) => {
                estimate(m).map(|e| own.less(&e)).ok_or_else(|| format!("that of {name}: {}", unknown(m)))
            }
        };
        let difference = Quantity::new(difference.map_err(Absent));
        Some((Other { name: name.clone(), case: found.case, metric: found.metric.ok(), difference }, found.looks))
    }

    /// The case of another estimator in the same scene on the same renderer: of as
    /// many rays, else, for methods with rays of their own, that of the most.
    fn beside(&self, name: &str, gate: &Gate, case: &Case) -> Found {
        let theirs = self
            .cases
            .iter()
            .filter(|c| c.case.estimator == name && c.case.scene == case.scene && c.case.renderer == case.renderer);
        let Some(found) = theirs.max_by_key(|c| (c.case.rays == case.rays, c.case.rays)) else {
            return Found { case: None, metric: Err(format!("this run has no such case of {name}")), looks: None };
        };
        let metric = if self.is_on_screen(name) == self.is_on_screen(&case.estimator) {
            metric_of(found, gate, name)
        } else {
            Err(format!(
                "{name} is measured on other pixels: only one of the two works in screen space, on what its camera shows"
            ))
        };
        Found { case: Some(found.case.clone()), metric, looks: found.looks }
    }

    /// The same case, or the judge of the same scene, in the base record, if it is the same.
    fn in_base(&self, base: &Parts<'_>, gate: &Gate, scene: &str, case: Option<&Case>) -> Found {
        let none = |why: String| Found { case: case.cloned(), metric: Err(why), looks: None };
        let (Some(own), Some(old)) = (self.scene(scene), base.scene(scene)) else {
            return none(format!("the base record has no scene '{scene}'"));
        };
        if own.hash != old.hash {
            let [new, old] = [&own.hash, &old.hash].map(|h| short_hash(h));
            return none(format!(
                "scene '{scene}' is not what it was in the base record: its hash is {new}, there {old}; make a new base"
            ));
        }
        // What the camera shows is no matter of the judge's contrast.
        if own.regions != old.regions || case.is_some() && own.screen != old.screen {
            return none(format!("the regions of scene '{scene}' hold other pixels than in the base record"));
        }
        let Some(case) = case else {
            let metric = old.judge.as_ref().map(|j| j.contrast.clone());
            return Found {
                case: None,
                metric: metric.ok_or_else(|| format!("the base record has no judge of scene '{scene}'")),
                looks: None,
            };
        };
        let method = |suite: &'a SuiteInfo| suite.methods.get(&case.estimator);
        match (method(self.suite), base.suite.methods.get(&case.estimator)) {
            (_, None) => return none(format!("the base record has no estimator '{}'", case.estimator)),
            (own, old) if own != old => {
                let name = &case.estimator;
                return none(format!("the estimator '{name}' has other options than in the base record"));
            }
            _ => {}
        }
        let Some(found) = base.cases.iter().find(|c| c.case == *case) else {
            return none(format!("the base record has no case {}", case.id()));
        };
        Found { case: Some(case.clone()), metric: metric_of(found, gate, "the base record"), looks: found.looks }
    }
}

fn metric_of(found: &CaseRecord, gate: &Gate, name: &str) -> Result<Metric, String> {
    if let Some(error) = &found.error {
        return Err(format!("the case of {name} ended with an error: {error}"));
    }
    let label = gate.metric.label();
    found.metric(gate.metric, gate.region).cloned().ok_or_else(|| format!("the case of {name} has no {label}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        gate::{
            BASE, Evidence, Limit, Outcome, judge,
            tests::{gate, record, scene, suite},
        },
        metrics::{MetricName, regions::Region},
        record::{JudgeRecord, ScreenRecord, Stopped},
    };
    use std::collections::BTreeMap;

    /// What the camera shows is no matter of the judge's.
    #[test]
    fn the_judge_of_other_pixels_is_another() {
        let estimate = Estimate { value: 0.1, se: 0.01, df: 15.0 };
        let judged = JudgeRecord {
            contrast: Metric::new(MetricName::JudgeContrast, None, Ok(estimate)),
            q: BTreeMap::new(),
            paths: 1,
            replicates: 16,
            stopped: Stopped::Precise,
            precision: None,
            wanted: 1.0,
            image: String::new(),
        };
        let own = SceneRecord { judge: Some(judged), ..scene("s") };
        let at_base = Gate {
            metric: MetricName::JudgeContrast,
            against: Some(BASE.into()),
            ..gate(Limit::Equals { target: 0.0, within: 0.1 })
        };
        let now = record(suite(vec![at_base]), vec![own.clone()], vec![]);
        let held = |old: &SceneRecord| {
            let base = record(suite(vec![]), vec![old.clone()], vec![]);
            judge(&Evidence { base: Some(&base), ..Evidence::from(&now) }).0.remove(0)
        };
        let mut old = own.clone();
        assert_eq!((held(&old).outcome, held(&old).value()), (Outcome::Pass, Some(0.0)));
        old.screen = Some(ScreenRecord { eye: [0.0; 3], resolution: [8, 8], regions: BTreeMap::new() });
        assert_eq!(held(&old).outcome, Outcome::Pass);
        old.regions.insert(Region::Left, 9);
        let v = held(&old);
        assert!(v.outcome == Outcome::Inconclusive && v.reason.contains("hold other pixels"), "{}", v.reason);
    }
}
