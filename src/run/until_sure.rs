//! Replicates are added where a verdict is not decided yet.
//!
//! The cases of one scene and ray count make a block: they are compared with each other,
//! so they keep in step. A block begins with 4 replicates and doubles them until each of its
//! verdicts is decided, or the most are reached. Each look spends its share of the error
//! ([`spending`](crate::stats::spending)), and is corrected by Bonferroni over all the verdicts that the plan
//! can come to ([`decided`](crate::stats::decided)): so what ends a block depends on nothing outside
//! its scene, on one machine or on many, and stands when Holm's correction is made over
//! the whole run.

use super::{
    RunError,
    measuring::Counts,
    rendering::{Rendered, Studio},
    suite_info,
    unit::Unit,
};
use crate::{
    gate::{Evidence, family_at_most, judge},
    record::CaseRecord,
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

impl Studio<'_> {
    /// Renders a scene as the plan says. Returns how many replicates each case has.
    pub fn scene(&self, rendered: &mut Rendered) -> Result<Counts, RunError> {
        let replicates = self.set.plan.suite.file.replicates.get();
        let Some(most) = self.set.plan.until_sure else {
            self.render(&self.set.units(), replicates, rendered)?;
            return Ok(Counts::all(replicates));
        };
        let (cases, first): (Vec<Unit<'_>>, Vec<Unit<'_>>) =
            self.set.units().into_iter().partition(|u| matches!(u, Unit::Case(_)));
        self.render(&first, replicates, rendered)?;
        if !self.set.is_ready(rendered) || cases.is_empty() {
            return Ok(Counts::default());
        }
        self.until_sure(most, rendered)
    }

    /// Renders the cases of a scene whose judge and converged images are there, until
    /// their verdicts are decided. Returns how many replicates each has and which look that was.
    fn until_sure(&self, most: u32, rendered: &mut Rendered) -> Result<Counts, RunError> {
        let (set, plan) = (self.set, self.set.plan);
        let judged = set.judge(self.journal.folder, rendered)?;
        let scenes: Vec<&str> = plan.scenes().map(|s| s.name.as_str()).collect();
        let family = family_at_most(&plan.suite.gates, &scenes, &plan.cases);
        let mut counts = Counts::default();
        let mut open: BTreeSet<u32> = set.cases().map(|c| block(plan, c)).collect();
        for (look, n) in (1..).zip(looks(most)) {
            let late = || self.means.until.is_some_and(|end| Instant::now() >= end);
            if open.is_empty() || self.means.stop.is_asked() || (look > 1 && late()) {
                break;
            }
            let units: Vec<Unit<'_>> = set.cases().filter(|c| open.contains(&block(plan, c))).map(Unit::Case).collect();
            self.render(&units, n, rendered)?;
            if self.means.stop.is_asked() {
                break;
            }
            for case in set.cases().filter(|c| open.contains(&block(plan, c))) {
                counts.set(case, n, look);
            }
            let records = set.case_records(rendered, &judged, &counts);
            open = self.undecided(&records, family).into_iter().filter(|b| open.contains(b)).collect();
        }
        Ok(counts)
    }

    /// The blocks with a verdict that more replicates may decide.
    fn undecided(&self, cases: &[CaseRecord], family: usize) -> BTreeSet<u32> {
        let plan = self.set.plan;
        let evidence = Evidence {
            suite: &suite_info(plan),
            gpu: "",
            filter: Some(""),
            scenes: &[],
            cases,
            base: plan.base.as_ref(),
            no_base: plan.no_base,
        };
        let (verdicts, _) = judge(&evidence);
        let open = verdicts.iter().filter_map(|v| {
            let p = [v.p_holds?.raw, v.p_broken?.raw];
            let sure = decided(p, family, v.spent, 1.0 - v.confidence);
            v.case.as_ref().filter(|_| !sure && v.can_be_decided(family)).map(|c| block(plan, c))
        });
        open.collect()
    }
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
