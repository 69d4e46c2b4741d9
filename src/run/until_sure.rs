//! Replicates are added where a verdict is not decided yet.
//!
//! The cases of one scene and ray count make a block: they are compared with each other,
//! so they keep in step. A block begins with 4 replicates and doubles them until each of its
//! verdicts is decided, and whether it warns, or a budget ends, or no number of them would
//! help. Each look spends its share of the error
//! ([`spending`](crate::stats::spending)), and is corrected by Bonferroni over all the verdicts that the plan
//! can come to ([`decided`](crate::stats::decided)): so what ends a block depends on nothing outside
//! its scene, on one machine or on many, and stands when Holm's correction is made over
//! the whole run.

use super::{
    RunError,
    judging::{Judged, Unjudged},
    measuring::Counts,
    rendering::{Rendered, Studio},
    suite_info,
    unit::Unit,
};
use crate::{
    gate::{Evidence, Verdict, family_at_most, judge},
    record::{Budget, CaseRecord, SceneRecord, Undecided},
    stats::decided,
    suite::{Case, Plan},
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

/// The block of a case: its rays, or those of the classic case it is compared with.
fn block(plan: &Plan<'_>, case: &Case) -> u32 {
    plan.suite.classic_beside(case).rays
}

/// What is found of a scene before a run is at its end, and may end it.
struct Sight<'a> {
    scene: SceneRecord,
    judged: &'a Result<Judged, Unjudged>,
    /// Tests that all verdicts of the plan come to, at most.
    family: usize,
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
        let (set, plan) = (self.set, self.set.subject.plan);
        let mut counts = Counts::default();
        let mut open: BTreeSet<u32> = set.subject.cases().map(|c| block(plan, c)).collect();
        let end = |rays: u32, replicates: u32, by: Budget| {
            let scene = set.scene.name.clone();
            Undecided { scene, rays, replicates, by }
        };
        let mut before = 0;
        for (look, n) in (1..).zip(looks(most)) {
            if look > 1 {
                let is_spent = |b: &u32| self.is_spent(*b, n, rendered);
                let (spent, rest): (BTreeSet<u32>, BTreeSet<u32>) = open.iter().copied().partition(is_spent);
                counts.undecided.extend(spent.into_iter().map(|b| end(b, before, Budget::MaxTime)));
                open = rest;
            }
            if open.is_empty() {
                return Ok(counts);
            }
            let units: Vec<Unit<'_>> =
                set.subject.cases().filter(|c| open.contains(&block(plan, c))).map(Unit::Case).collect();
            if !self.means.stop.is_asked() {
                self.render(&units, n, rendered)?;
            }
            if self.means.stop.is_asked() {
                counts.stopped = true;
                return Ok(counts);
            }
            for case in set.subject.cases().filter(|c| open.contains(&block(plan, c))) {
                counts.set(case, n, look);
            }
            let verdicts = self.verdicts(sight, rendered, &counts);
            let (undecided, kept) = self.undecided(&verdicts, sight.family);
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
    fn is_spent(&self, rays: u32, n: u32, rendered: &Rendered) -> bool {
        let (plan, name) = (self.set.subject.plan, &self.set.scene.name);
        if self.means.is_merge {
            let of = |e: &Undecided| e.scene == *name && e.rays == rays && e.replicates < n;
            return self.means.ended.iter().any(of);
        }
        let is_there = |c: &Case| match rendered.images.get(&c.id()) {
            Some(Ok(images)) => images.replicates.len() >= n as usize,
            Some(Err(_)) => true,
            None => false,
        };
        self.until.is_some_and(|end| Instant::now() >= end)
            && !self.set.subject.cases().filter(|c| block(plan, c) == rays).all(is_there)
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
    fn undecided(&self, verdicts: &[Verdict], family: usize) -> (BTreeSet<u32>, BTreeSet<u32>) {
        let unsure = verdicts.iter().filter_map(|v| {
            let case = v.case.as_ref()?;
            let p = [v.p_holds?.raw, v.p_broken?.raw];
            let alpha = 1.0 - v.confidence;
            let is_broken = decided([p[1], f64::NAN], family, v.spent, alpha);
            let warns = |p: [f64; 2]| decided(p, family, v.spent, alpha);
            let sure = is_broken || decided(p, family, v.spent, alpha) && warning(v).is_none_or(warns);
            Some((block(self.set.subject.plan, case), v.can_be_decided(family))).filter(|_| !sure)
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

    #[test]
    fn looks_double_up_to_the_most() {
        assert_eq!(looks(64), [4, 8, 16, 32, 64]);
        assert_eq!(looks(50), [4, 8, 16, 32, 50]);
        assert_eq!(looks(4), [4]);
        assert_eq!(looks(2), [2]);
    }
}
