//! The pieces that a run renders, each for itself: none needs another one's images.

use crate::{
    render::{Estimator, Kind},
    suite::{Case, Plan},
};
use sha2::{Digest, Sha256};

/// Independent images that a converged image is the mean of.
pub(super) const CONVERGED_REPLICATES: u32 = 4;

/// One piece of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Unit<'a> {
    /// The path tracer, with and without the occluder.
    Judge,
    /// The converged image of a method, by its index in the suite.
    Converged(usize),
    /// The pictures from the look view.
    Look,
    /// The replicates of a case.
    Case(&'a Case),
}

impl<'a> Unit<'a> {
    /// The units of a scene, those first that nothing can be measured without.
    pub fn of_scene(plan: &Plan<'a>, cases: &[&'a Case], has_judge: bool) -> Vec<Unit<'a>> {
        let judge = has_judge.then_some(Unit::Judge);
        let converged = plan.methods().into_iter().map(Unit::Converged);
        judge.into_iter().chain(converged).chain([Unit::Look]).chain(cases.iter().map(|c| Unit::Case(c))).collect()
    }

    /// Unique in a run: a case's own, `SCENE/judge`, `SCENE/converged/METHOD`, `SCENE/look`.
    pub fn id(&self, plan: &Plan<'_>, scene: &str) -> String {
        match self {
            Unit::Judge => format!("{scene}/judge"),
            Unit::Converged(method) => format!("{scene}/converged/{}", plan.suite.methods[*method].name),
            Unit::Look => format!("{scene}/look"),
            Unit::Case(case) => case.id(),
        }
    }

    /// Whether the GPU renders it.
    pub fn is_on_gpu(&self) -> bool {
        matches!(self, Unit::Case(case) if case.renderer == "gpu")
    }

    /// What it takes, about: rays, all segments of paths and secondary rays counted.
    pub fn cost(&self, plan: &Plan<'_>, [pixels, look_pixels]: [usize; 2]) -> u64 {
        let file = &plan.suite.file;
        let methods = &plan.suite.methods;
        let rays = |estimator: &Estimator| match estimator.kind() {
            Kind::Classic | Kind::Obscurance | Kind::Hbao | Kind::Gtao => 1,
            Kind::Extended | Kind::ExtendedObscurance | Kind::LocalIndirect => 3,
            Kind::PathTraced => 8,
        };
        let (pixels, look) = (pixels as u64, look_pixels as u64);
        match self {
            // With and without the occluder.
            Unit::Judge => pixels * 16 * u64::from(file.judge.paths.get()) * u64::from(file.judge.replicates.get()),
            Unit::Converged(m) => pixels * rays(&methods[*m].estimator) * u64::from(file.converged_rays.get()),
            Unit::Look => {
                let all: u64 = plan.methods().iter().map(|m| rays(&methods[*m].estimator)).sum();
                look * (8 + all) * u64::from(file.look_rays.get())
            }
            Unit::Case(case) => {
                let method = methods.iter().find(|m| m.name == case.estimator);
                let replicates = u64::from(file.replicates.get());
                pixels * method.map_or(1, |m| rays(&m.estimator)) * u64::from(case.rays) * replicates
            }
        }
    }
}

/// The shard of so many that does a unit: the same on every machine, whatever else
/// there is to do.
pub(super) fn shard_of(id: &str, of: u32) -> u32 {
    let hash = Sha256::digest(id.as_bytes());
    let head = hash.iter().take(8).fold(0u64, |n, b| n << 8 | u64::from(*b));
    (head % u64::from(of.max(1))) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_stable_and_even() {
        // Whoever changes these moves the cases of every pipeline.
        assert_eq!(["plane/judge", "plane/look", "a/classic/cpu/4"].map(|id| shard_of(id, 8)), [4, 7, 3]);
        let mut counts = [0u32; 8];
        for i in 0..8000 {
            counts[shard_of(&format!("scene/e{i}/cpu/4"), 8) as usize] += 1;
        }
        // Binomial of mean 1,000 and deviation 30: five deviations.
        assert!(counts.iter().all(|c| (850..1150).contains(c)), "{counts:?}");
    }
}
