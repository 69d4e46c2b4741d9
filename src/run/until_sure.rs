//! Replicates are added where a verdict is not decided yet.
//!
//! The cases of one scene and ray count make a [block](Blocks): they are compared with each other,
//! so they keep in step. A block begins with 4 replicates and doubles them until each of its
//! verdicts is decided, and whether it warns, or a budget ends, or no number of them would
//! help. Each look spends its share of the error
//! ([`spending`](crate::stats::spending)), and is corrected by Bonferroni over all the verdicts that the plan
//! can come to ([`decided`](crate::stats::decided)): so what ends a block depends on nothing outside
//! its scene, on one machine or on many, and stands when Holm's correction is made over
//! the whole run.

use super::{
    RunError,
    blocks::Blocks,
    judging::{Judged, Unjudged},
    measuring::Counts,
    rendering::{Rendered, Studio},
    suite_info,
    unit::Unit,
};
use crate::{
    gate::{BASE, CONFIDENCE, Evidence, Limit, Standing, Verdict, family_at_most, judge},
    metrics::{Metric, MetricName},
    record::{Budget, CaseRecord, SceneRecord, Undecided},
    stats::decided,
    suite::Case,
};
use std::{collections::BTreeSet, time::Instant};

/// Replicates at the first look.
const FIRST: u32 = 4;

/// Replicates at each look.
fn looks(most: u32) -> Vec<u32> {
    let mut all: Vec<u32> =
        std::iter::successors(Some(FIRST), |n| n.checked_mul(2)).take_while(|n| *n < most).collect();
    all.push(most);
    all
}

/// What is found of a scene before a run is at its end, and may end it.
struct Sight<'a> {
    scene: SceneRecord,
    judged: &'a Result<Judged, Unjudged>,
    /// Tests that all verdicts of the plan come to, at most.
    family: usize,
    blocks: Blocks<'a>,
}

impl Studio<'_> {
    /// Renders a scene as the plan says. Returns how many replicates each case has.
    pub fn scene(&self, rendered: &mut Rendered) -> Result<Counts, RunError> {
        let replicates = self.set.subject.plan.suite.file.replicates.get();
        let all = Counts::all(replicates);
        let until_sure = self.set.subject.plan.until_sure;
        if until_sure.is_none() && !self.means.fail_fast {
            self.render(&self.set.units(), replicates, rendered)?;
            return Ok(all);
        }
        let (cases, first): (Vec<Unit<'_>>, Vec<Unit<'_>>) =
            self.set.units().into_iter().partition(|u| matches!(u, Unit::Case(_)));
        self.render(&first, replicates, rendered)?;
        if !self.set.subject.is_ready(rendered) || cases.is_empty() || self.means.stop.is_asked() {
            return Ok(if until_sure.is_some() { Counts::default() } else { all });
        }
        let judged = self.set.subject.judge(self.journal.folder, rendered)?;
        let plan = self.set.subject.plan;
        let scenes: Vec<&str> = plan.scenes().map(|s| s.name.as_str()).collect();
        let sight = Sight {
            scene: self.set.subject.scene_facts(rendered, &judged),
            judged: &judged,
            family: family_at_most(&plan.suite.gates, &scenes, &plan.cases),
            blocks: Blocks::new(plan, self.set.subject.cases()),
        };
        let Some(most) = until_sure else {
            let red = |rendered: &Rendered| self.red(&sight, &self.verdicts(&sight, rendered, &all));
            self.render_watched(&cases, replicates, rendered, &red)?;
            return Ok(all);
        };
        let counts = self.until_sure(most, &sight, rendered)?;
        if !counts.stopped {
            for case in self.set.subject.cases() {
                self.trim(case, counts.replicates(case), rendered)?;
            }
        }
        Ok(counts)
    }

    /// Renders the cases of a scene until their verdicts are decided. Returns how many
    /// replicates each has and which look that was.
    fn until_sure(&self, most: u32, sight: &Sight<'_>, rendered: &mut Rendered) -> Result<Counts, RunError> {
        let (set, blocks) = (self.set, &sight.blocks);
        let mut counts = Counts::default();
        let mut open: BTreeSet<u32> = set.subject.cases().map(|c| blocks.of(c)).collect();
        let end = |rays: u32, replicates: u32, by: Budget| {
            let scene = set.scene.name.clone();
            Undecided { scene, rays, replicates, by }
        };
        let mut before = 0;
        for (look, n) in (1..).zip(looks(most)) {
            if look > 1 {
                let is_spent = |b: &u32| self.is_spent(*b, n, blocks, rendered);
                let (spent, rest): (BTreeSet<u32>, BTreeSet<u32>) = open.iter().copied().partition(is_spent);
                counts.undecided.extend(spent.into_iter().map(|b| end(b, before, Budget::MaxTime)));
                open = rest;
            }
            if open.is_empty() {
                return Ok(counts);
            }
            let units: Vec<Unit<'_>> =
                set.subject.cases().filter(|c| open.contains(&blocks.of(c))).map(Unit::Case).collect();
            if !self.means.stop.is_asked() {
                self.render(&units, n, rendered)?;
            }
            if self.means.stop.is_asked() {
                counts.stopped = true;
                return Ok(counts);
            }
            for case in set.subject.cases().filter(|c| open.contains(&blocks.of(c))) {
                counts.set(case, n, look);
            }
            let verdicts = self.verdicts(sight, rendered, &counts);
            let (undecided, kept) = self.undecided(sight, &verdicts, rendered, &counts);
            let closed = open.difference(&undecided).filter(|b| kept.contains(*b));
            counts.undecided.extend(closed.map(|b| end(*b, n, Budget::Floor)));
            open = open.intersection(&undecided).copied().collect();
            if let Some(why) = self.red(sight, &verdicts).filter(|_| self.means.fail_fast) {
                rendered.ended.get_or_insert(why);
                self.means.stop.ask();
                counts.stopped = !open.is_empty();
                return Ok(counts);
            }
            before = n;
        }
        counts.undecided.extend(open.into_iter().map(|b| end(b, before, Budget::MaxReplicates)));
        Ok(counts)
    }

    /// Whether a block must do without another look, of `n` replicates. What is there
    /// already costs no time; in a merge that is all there is.
    fn is_spent(&self, rays: u32, n: u32, blocks: &Blocks<'_>, rendered: &Rendered) -> bool {
        if self.means.is_merge {
            let name = &self.set.scene.name;
            let of = |e: &Undecided| e.scene == *name && e.rays == rays && e.replicates < n;
            return self.means.ended.iter().any(of);
        }
        let is_there = |c: &Case| match rendered.images.get(&c.id()) {
            Some(Ok(images)) => images.replicates.len() >= n as usize,
            Some(Err(_)) => true,
            None => false,
        };
        self.until.is_some_and(|end| Instant::now() >= end)
            && !self.set.subject.cases().filter(|c| blocks.of(c) == rays).all(is_there)
    }

    /// The verdicts on what there is of the scene.
    fn verdicts(&self, sight: &Sight<'_>, rendered: &Rendered, counts: &Counts) -> Vec<Verdict> {
        let cases: Vec<CaseRecord> = self.set.subject.case_records(rendered, sight.judged, counts);
        let evidence = Evidence {
            suite: &suite_info(self.set.subject.plan),
            gpu: "",
            filter: Some(""),
            scenes: std::slice::from_ref(&sight.scene),
            cases: &cases,
            base: self.set.subject.plan.base.as_ref(),
            no_base: self.set.subject.plan.no_base,
            handed_in: false,
        };
        judge(&evidence).0
    }

    /// The blocks with a verdict, or a warning, that more replicates may decide, and those with
    /// one that no number of them does.
    fn undecided(
        &self,
        sight: &Sight<'_>,
        verdicts: &[Verdict],
        rendered: &Rendered,
        counts: &Counts,
    ) -> (BTreeSet<u32>, BTreeSet<u32>) {
        let error = |case: &Case| self.set.subject.classic_error(case, rendered, sight.judged, counts);
        let unsure = verdicts.iter().filter_map(|v| {
            let case = v.case.as_ref()?;
            Some((sight.blocks.of(case), prospect(v, sight.family).or_else(|| unclear(v, error))?))
        });
        let (open, kept): (Vec<_>, Vec<_>) = unsure.partition(|(_, can_be_decided)| *can_be_decided);
        let blocks = |of: Vec<(u32, bool)>| of.into_iter().map(|(block, _)| block).collect();
        (blocks(open), blocks(kept))
    }

    /// A gate that is surely red, whatever the other verdicts of the plan come to: as for
    /// what ends a block, by Bonferroni's correction, so that Holm's leaves it red.
    fn red(&self, sight: &Sight<'_>, verdicts: &[Verdict]) -> Option<String> {
        let known =
            |gate: &str| self.set.subject.plan.suite.gates.iter().any(|g| g.name == gate && g.known_failure.is_some());
        let is_red = |v: &&Verdict| {
            let p = if known(&v.gate) { v.p_holds } else { v.p_broken };
            p.is_some_and(|p| decided([p.raw, f64::NAN], sight.family, v.spent, 1.0 - v.confidence))
        };
        verdicts.iter().find(is_red).map(|v| format!("{} fails '{}'", v.subject(), v.gate))
    }
}

/// Whether more replicates may decide a verdict with p-values: of the limit that fails, else of
/// that which warns, the first that is open. None where neither is, and where there are none.
fn prospect(v: &Verdict, family: usize) -> Option<bool> {
    let p = [v.p_holds?.raw, v.p_broken?.raw];
    let is_decided = |p| decided(p, family, v.spent, 1.0 - v.confidence);
    let is_broken = is_decided([p[1], f64::NAN]);
    let warns = v.warn.zip(warning(v)).filter(|_| !is_broken);
    let mut limits = [(v.limit, p)].into_iter().chain(warns);
    let (open, _) = limits.find(|(_, p)| !is_decided(*p))?;
    Some(v.can_be_decided(open, family))
}

/// Whether more replicates may show a false highlight of classic AO where there is no telling
/// yet, so that what is removed has no value. None where it has one, where there surely
/// is none to remove, and where something else is missing. `error` is dK of classic AO beside a case.
fn unclear(v: &Verdict, error: impl Fn(&Case) -> Option<Metric>) -> Option<bool> {
    let may_show = |case: &Case| {
        let (error, above_zero) = (Standing::of(&error(case)?)?, Limit::AtLeast(0.0));
        let is_clear = |p| decided(p, 1, 1.0, 1.0 - CONFIDENCE);
        Some(error.can_be_decided(above_zero, is_clear)).filter(|_| !is_clear(error.p(above_zero)))
    };
    let mut held = vec![(v.case.as_ref()?, &v.metric)];
    if let Some(other) = &v.against {
        let (case, metric) = (other.case.as_ref()?, other.metric.as_ref()?);
        // A base record stays as it is.
        if other.name != BASE {
            held.push((case, metric));
        } else if metric.value.is_none() {
            return None;
        }
    }
    let is_null = |m: &Metric| m.name == MetricName::Removed && m.value.is_none();
    let open: Option<Vec<bool>> = held.iter().filter(|(_, m)| is_null(m)).map(|(case, _)| may_show(case)).collect();
    open.filter(|all| !all.is_empty()).map(|all| all.into_iter().all(|may| may))
}

/// The p-values of what warns, that it is kept and that it is broken; None where nothing
/// can warn.
fn warning(verdict: &Verdict) -> Option<[f64; 2]> {
    let (limit, broken) = (verdict.warn?, verdict.p_warn_broken?);
    let held = match &verdict.against {
        Some(other) => other.difference.estimate(),
        None => verdict.metric.estimate(),
    };
    Some([limit.p_holds(&held?), broken.raw])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Estimate;
    use serde_json::json;

    #[test]
    fn looks_double_up_to_the_most() {
        assert_eq!(looks(64), [4, 8, 16, 32, 64]);
        assert_eq!(looks(50), [4, 8, 16, 32, 50]);
        assert_eq!(looks(4), [4]);
        assert_eq!(looks(2), [2]);
    }

    /// A verdict on what is removed, without p-values; what it is held against, and its value.
    fn verdict(own: Option<f64>, other: Option<(&str, Option<f64>)>) -> Verdict {
        let case = |name: &str| json!({ "scene": "s", "estimator": name, "renderer": "cpu", "rays": 4 });
        let metric = |value: Option<f64>| json!({ "name": "removed", "value": value, "se": value, "df": value });
        let mut text = json!({
            "gate": "g", "scene": "s", "case": case("e"), "metric": metric(own), "limit": { "at-least": 0.5 },
            "interval": null, "outcome": "inconclusive", "reason": ""
        });
        if let Some((name, value)) = other {
            let difference = json!({ "value": null, "se": null, "df": null });
            text["against"] =
                json!({ "name": name, "case": case(name), "metric": metric(value), "difference": difference });
        }
        serde_json::from_value(text).unwrap()
    }

    #[test]
    fn what_has_no_value_yet_is_open() {
        let error = |value: f64, of_judge: f64| {
            move |_: &Case| {
                let part = Some(Estimate { value: 0.0, se: of_judge, df: 7.0 });
                let whole = Estimate { value, se: 0.02, df: 7.0 };
                Some(Metric::new(MetricName::ContrastError, None, Ok(whole)).with_floor(part))
            }
        };
        let null = verdict(None, None);
        assert_eq!(unclear(&null, error(0.03, 0.005)), Some(true));
        assert_eq!(unclear(&null, error(0.03, 0.0199)), Some(false));
        // It surely is there, and has no value for another reason; surely is not; is not known.
        for sure in [0.1, -0.1] {
            assert_eq!(unclear(&null, error(sure, 0.005)), None);
        }
        assert_eq!(unclear(&null, |_| None), None);
        // The other's may be what is missing. That of a base record is for good.
        for (own, other, open) in [
            (Some(0.6), None, None),
            (Some(0.6), Some(("other", None)), Some(true)),
            (None, Some(("other", None)), Some(true)),
            (None, Some((BASE, Some(0.6))), Some(true)),
            (None, Some((BASE, None)), None),
        ] {
            assert_eq!(unclear(&verdict(own, other), error(0.03, 0.005)), open, "{own:?} {other:?}");
        }
    }
}
