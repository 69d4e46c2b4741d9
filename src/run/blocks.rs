//! Which cases of a scene get their replicates together, where those are added until verdicts
//! are decided.

use crate::{
    gate::BASE,
    suite::{Case, Plan},
};
use std::collections::{BTreeMap, BTreeSet};

/// The blocks of a scene: cases of one ray count, which are compared with each other, and
/// those of other ray counts that a gate holds them against.
///
/// Cases that end apart would have had different looks. What was decided of one and open of
/// the other could then change, and be charged for the looks of both.
#[derive(Clone, Debug)]
pub(super) struct Blocks<'a> {
    plan: &'a Plan<'a>,
    /// The fewest rays of the block, by the rays of a case, or of the classic case beside it.
    fewest: BTreeMap<u32, u32>,
}

impl<'a> Blocks<'a> {
    /// Those of the cases of a scene.
    pub fn new(plan: &'a Plan<'a>, cases: impl Iterator<Item = &'a Case>) -> Self {
        let rays = |case: &Case| plan.suite.classic_beside(case).rays;
        let (mut fewest, mut joined) = (BTreeMap::new(), BTreeSet::new());
        for case in cases {
            fewest.insert(rays(case), rays(case));
            let others = plan.suite.gates.iter().filter(|g| g.applies_to(case)).filter_map(|g| g.against.as_deref());
            let others = others.filter(|name| *name != BASE).filter_map(|name| plan.beside(case, name));
            joined.extend(others.map(|other| [rays(case), rays(other)]));
        }
        // What is joined to the joined takes as many rounds as there are steps between.
        for _ in 0..fewest.len() {
            for pair in &joined {
                let least = pair.iter().filter_map(|rays| fewest.get(rays)).min().copied();
                least.into_iter().for_each(|least| fewest.extend(pair.map(|rays| (rays, least))));
            }
        }
        Blocks { plan, fewest }
    }

    /// The block of a case, by its fewest rays.
    pub fn of(&self, case: &Case) -> u32 {
        let rays = self.plan.suite.classic_beside(case).rays;
        self.fewest.get(&rays).copied().unwrap_or(rays)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::suite::{Platform, Suite};

    const HEAD: &str = r#"
description = "x"
scenes = ["plane"]
rays = [4, 8, 16, 32]
replicates = 4
converged_rays = 128
look_rays = 1
judge = { precision = 1.0, paths = 1, replicates = 8, max_replicates = 8 }
[[estimator]]
name = "classic"
kind = "classic"
"#;

    /// The block of each case, by estimator and rays.
    fn blocks(more: &str) -> BTreeMap<(String, u32), u32> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.toml");
        std::fs::write(&path, format!("{HEAD}{more}")).unwrap();
        let suite = Suite::load(path.to_str().unwrap()).unwrap();
        let plan = Plan::new(&suite, Platform::Cpu, None);
        let blocks = Blocks::new(&plan, plan.cases.iter());
        plan.cases.iter().map(|c| ((c.estimator.clone(), c.rays), blocks.of(c))).collect()
    }

    fn own(name: &str, rays: u32) -> String {
        format!("[[estimator]]\nname = \"{name}\"\nkind = \"extended\"\nreceiver_plane = \"clipped\"\nrays = {rays}\n")
    }

    fn gate(of: &str, rays: u32, against: &str) -> String {
        format!(
            "[[gate]]\nname = \"{of} {rays} {against}\"\nmetric = \"openness\"\nregion = \"all\"\nestimators = [\"{of}\"]\n\
             rays = [{rays}]\nagainst = \"{against}\"\nmax = 1.0\n"
        )
    }

    #[test]
    fn a_case_is_with_those_that_it_is_held_against() {
        let classic = |blocks: &BTreeMap<(String, u32), u32>| [4, 8, 16, 32].map(|r| blocks[&("classic".into(), r)]);
        // Rays that the suite does not have are with the most.
        let alone = blocks(&(own("a", 16) + &own("b", 7)));
        assert_eq!(classic(&alone), [4, 8, 16, 32]);
        assert_eq!((alone[&("a".into(), 16)], alone[&("b".into(), 7)]), (16, 32));
        let two = blocks(&(own("a", 16) + &gate("classic", 8, "a")));
        assert_eq!((classic(&two), two[&("a".into(), 16)]), ([4, 8, 8, 32], 8));
        // 32 with 16, 16 with 8, 8 with 4.
        let (rays, gates) = (own("a", 8) + &own("b", 16), gate("b", 16, "a") + &gate("classic", 4, "a"));
        let chain = blocks(&(rays + &own("c", 32) + &gate("c", 32, "b") + &gates));
        assert_eq!(classic(&chain), [4; 4]);
        // Of as many rays there is one already.
        let beside = blocks(&(own("a", 16) + &gate("a", 16, "classic")));
        assert_eq!(classic(&beside), [4, 8, 16, 32]);
        // A base record is no case of the run.
        let base = blocks(&(own("a", 16) + &gate("classic", 8, "base")));
        assert_eq!(classic(&base), [4, 8, 16, 32]);
    }
}
