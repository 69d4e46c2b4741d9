//! What more replicates of a case can decide, and what they cannot: a part of the standard
//! error may be that of the judge, of the converged image or of a base record, and stays.

use super::{BASE, Limit, Verdict};
use crate::{
    metrics::{Floor, Metric, MetricName},
    stats::{Estimate, decided},
};

/// So many times the replicates that it takes are not worth naming.
const MOST: f64 = 1000.0;

/// Numbers of times the replicates that are looked at, one after the other: up to [`MOST`], then
/// without end.
///
/// What more replicates decide, still more need not: as the own part of the variance goes, the
/// floor's degrees of freedom, often few, are what is left of Welch and Satterthwaite's, and
/// Student's tails grow faster than the standard error falls. So no single number tells.
fn prospects() -> impl Iterator<Item = f64> {
    let steps = 2.0 * MOST.log2();
    (0..steps.ceil() as u32).map(|i| f64::from(i) / 2.0).map(f64::exp2).chain([MOST, f64::INFINITY])
}

/// So many standard errors of its own replicates a value may be thought to move.
const REACH: f64 = 2.0;

/// Something besides a case's replicates that a standard error comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Source {
    /// Its part of the standard error.
    pub se: f64,
    /// What it is.
    pub name: &'static str,
    /// What makes it smaller.
    pub help: &'static str,
}

/// The part of a metric's standard error that is not its own replicates'. All of a
/// judge's is the judge's.
fn floor(metric: &Metric) -> Option<Floor> {
    match metric.name {
        MetricName::JudgeContrast => metric.estimate().and_then(Floor::of),
        _ => metric.floor,
    }
}

/// That of what is held against a limit: the metric, or its difference from another. A base
/// record gets no replicates any more; another case of the run gets them as this one does.
pub(super) fn of_held(metric: &Metric, other: Option<(&str, &Metric)>) -> Option<Floor> {
    let theirs = other.and_then(|(name, metric)| match name {
        BASE => metric.estimate().and_then(Floor::of),
        _ => floor(metric),
    });
    match (floor(metric), theirs) {
        (Some(own), Some(theirs)) => {
            let part = |f: Floor| Estimate { value: 0.0, se: f.se, df: f.df };
            Floor::of(part(own).less(&part(theirs)))
        }
        (own, theirs) => own.or(theirs),
    }
}

/// A value with its error, and the part of that which replicates do not make smaller.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standing {
    held: Estimate,
    floor: Option<Floor>,
}

impl Standing {
    /// That of a metric alone; None where it has no value.
    pub(crate) fn of(metric: &Metric) -> Option<Self> {
        Some(Standing { held: metric.estimate()?, floor: floor(metric) })
    }

    /// The p-values, `[holds, broken]`, of a limit on it.
    pub(crate) fn p(&self, limit: Limit) -> [f64; 2] {
        [limit.p_holds(&self.held), limit.p_broken(&self.held)]
    }

    /// The variance that is of the case's own replicates.
    fn own_variance(&self) -> f64 {
        (self.held.se.powi(2) - self.floor.map_or(0.0, |f| f.se.powi(2))).max(0.0)
    }

    /// What there would be after so many times the replicates, if the value stayed where it is;
    /// `times` may be infinite.
    ///
    /// The own part of the variance falls by that factor, and its degrees of freedom rise
    /// by it. They are what Welch and Satterthwaite's formula leaves for it.
    fn after(&self, times: f64) -> Estimate {
        let Standing { held, floor } = *self;
        let own = self.own_variance();
        let (fixed, of_fixed) = floor.map_or((0.0, 0.0), |f| (f.se.powi(2), f.se.powi(4) / f.df));
        let left = held.se.powi(4) / held.df - of_fixed;
        let of_own = if left > 0.0 { left } else { own * own / held.df };
        let variance = own / times + fixed;
        let welch = of_own / times.powi(3) + of_fixed;
        let df = if welch > 0.0 { variance * variance / welch } else { held.df };
        Estimate { value: held.value, se: variance.sqrt(), df }
    }

    /// Whether more replicates may still decide a limit: by what some number of them leaves of
    /// the standard error, with the value anywhere within 2 of its own standard errors.
    /// `decides` says it of two p-values, `[holds, broken]`.
    pub(crate) fn can_be_decided(&self, limit: Limit, decides: impl Fn([f64; 2]) -> bool) -> bool {
        let reach = REACH * self.own_variance().sqrt();
        let [low, high] = [self.held.value - reach, self.held.value + reach];
        let best = match limit {
            Limit::Equals { target, .. } => target.clamp(low, high),
            _ => self.held.value,
        };
        prospects().map(|times| self.after(times)).any(|after| {
            let at = |value| Standing { held: Estimate { value, ..after }, floor: None };
            [low, best, high].into_iter().any(|value| decides(at(value).p(limit)))
        })
    }
}

impl Verdict {
    /// What is held against the limit, with its error.
    fn standing(&self) -> Option<Standing> {
        let held = self.against.as_ref().map_or_else(|| self.metric.estimate(), |o| o.difference.estimate());
        Some(Standing { held: held?, floor: self.floor })
    }

    /// What is decided in 8 of 10 runs of so many times the replicates, over how far the value
    /// lies from the limit: 1 or less where it would be; None where that is not known.
    fn out_of_sight(&self, times: f64, family: usize) -> Option<f64> {
        let level = (1.0 - self.confidence) * self.spent / family.max(1) as f64;
        let (margin, after) = (self.margin?.abs(), self.standing()?.after(times));
        match after.se {
            _ if margin == 0.0 => Some(f64::INFINITY),
            0.0 => Some(0.0),
            _ => self.limit.detectable(&after, level).map(|d| d / margin),
        }
    }

    /// How many times the replicates of the case decide, in 8 of 10 runs, if the value stays
    /// where it is: 1.1 to 1000. None where more than that would be needed or none suffice,
    /// and where it is not known. `family` is how many verdicts the run has.
    pub fn replicates_needed(&self, family: usize) -> Option<f64> {
        const LEAST: f64 = 1.1;
        let (mut low, mut high) = (LEAST, None);
        for times in prospects().filter(|times| (LEAST..=MOST).contains(times)) {
            if self.out_of_sight(times, family)? <= 1.0 {
                high = Some(times);
                break;
            }
            low = times;
        }
        let mut high = high?;
        for _ in 0..40 {
            let middle = f64::sqrt(low * high);
            if self.out_of_sight(middle, family)? > 1.0 { low = middle } else { high = middle }
        }
        Some(high)
    }

    /// Whether what the case's replicates have no part in is enough to keep the verdict
    /// open, if the value stays where it is: then no number of them decides. Not where a
    /// thousandth of a smaller part of the variance would too, for there the value lies on the limit.
    pub fn is_kept_by_floor(&self, family: usize) -> bool {
        let (Some(floor), Some(se)) = (self.floor, self.se()) else { return false };
        let is_most = 2.0 * floor.se.powi(2) >= se.powi(2);
        let ratios = prospects().map(|times| self.out_of_sight(times, family));
        let least = ratios.reduce(|least, ratio| Some(least?.min(ratio?))).flatten();
        least.is_some_and(|ratio| ratio > 1.0 && (is_most || ratio * ratio < MOST))
    }

    /// Whether more replicates of the case may still decide a limit, that which fails or that which
    /// warns: by what some number of them leaves of the standard error, with the value
    /// anywhere within 2 of its own standard errors. `family` is how many verdicts the run has at most.
    ///
    /// To end there errs no more often than to go on: what is not decided stays so.
    pub fn can_be_decided(&self, limit: Limit, family: usize) -> bool {
        let decides = |p| decided(p, family, self.spent, 1.0 - self.confidence);
        let has_tests = self.p_holds.is_some() && self.p_broken.is_some();
        self.standing().is_some_and(|it| has_tests && it.can_be_decided(limit, decides))
    }

    /// What the floor is made of, the largest part first.
    pub(super) fn sources(&self) -> Vec<Source> {
        let other = self.against.as_ref();
        let is_base = other.is_some_and(|o| o.name == BASE);
        let beside = other.filter(|_| !is_base).and_then(|o| floor(o.metric.as_ref()?));
        let square = |f: Option<Floor>| f.map_or(0.0, |f| f.se.powi(2));
        let shared = (square(floor(&self.metric)) + square(beside)).sqrt();
        let of_base = other.filter(|_| is_base).and_then(|o| o.metric.as_ref()?.se).unwrap_or(0.0);
        let (name, help) = match self.metric.name {
            MetricName::Bias => ("the converged image", "raise converged_rays in the suite file"),
            _ => ("the judge", "give the judge a smaller precision in the suite file, and the replicates for it"),
        };
        let base = Source { se: of_base, name: "the base record", help: "make a base record of more replicates" };
        let mut all = vec![Source { se: shared, name, help }, base];
        all.retain(|s| s.se > 0.0);
        all.sort_by(|a, b| b.se.total_cmp(&a.se));
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gate::{
        Gate, Outcome,
        tests::{case, gate, judged, measured, record, scene, suite},
        words,
    };

    const LIMIT: Limit = Limit::AtLeast(0.5);

    /// One verdict on a value with a standard error, a part of which is the judge's.
    fn verdict(limit: Limit, value: f64, se: f64, part: f64) -> Verdict {
        let mut it = measured(case("s", "e", "cpu", 4), value, se);
        let part = Estimate { value: 0.0, se: part, df: 7.0 };
        it.metrics[0] = it.metrics[0].clone().with_floor(Some(part));
        judged(vec![gate(limit)], &[it], None).0.remove(0)
    }

    fn text(v: &Verdict) -> String {
        format!("{} {}", v.reason, words::explain(v, 1).join(" "))
    }

    #[test]
    fn what_is_needed_is_what_would_be_detected() {
        let v = verdict(LIMIT, 0.51, 0.01, 0.0);
        assert!(v.floor.is_none() && v.can_be_decided(LIMIT, 1) && !v.is_kept_by_floor(1));
        let n = v.replicates_needed(1).unwrap();
        let there = Estimate { value: 0.51, se: 0.01 / n.sqrt(), df: 15.0 * n };
        assert!((LIMIT.detectable(&there, 0.05).unwrap() - 0.01).abs() < 1e-9, "{n}");
        assert!(
            text(&v).contains("more replicates would decide") && text(&v).contains("about 8.0 times"),
            "{}",
            text(&v)
        );
        // Half of the variance stays: the other half must fall further.
        let v = verdict(LIMIT, 0.512, 0.01, 0.01 * 0.1f64.sqrt());
        let with = v.replicates_needed(1).unwrap();
        let without = verdict(LIMIT, 0.512, 0.01, 0.0).replicates_needed(1).unwrap();
        assert!(with > 1.5 * without && without > 1.1, "{with} {without}");
        // A larger family asks for more; on the limit no number does.
        assert!(v.replicates_needed(100).is_none_or(|n| n > with));
        let v = verdict(LIMIT, 0.5, 0.01, 0.005);
        assert!(v.replicates_needed(1).is_none() && !v.is_kept_by_floor(1));
        assert!(text(&v).contains("the value lies as near as it can be told"), "{}", text(&v));
    }

    #[test]
    fn a_floor_that_keeps_it_open_is_told_with_what_helps() {
        let v = verdict(LIMIT, 0.51, 0.01, 0.0095);
        assert_eq!(v.outcome, Outcome::Inconclusive);
        assert!(v.replicates_needed(1).is_none() && v.is_kept_by_floor(1) && !v.can_be_decided(LIMIT, 1));
        for says in [
            "more replicates of the case would not decide: the noise of the judge is too large",
            "Of the standard error 0.0095 is that of the judge: more replicates of the case leave it as it is.",
            "No number of replicates of the case decides where the value lies: give the judge a smaller precision",
        ] {
            assert!(text(&v).contains(says), "{says}: {}", text(&v));
        }
        assert!(!text(&v).contains("times the replicates"), "{}", text(&v));
        // The value may be where it is by noise of its own.
        assert!(verdict(LIMIT, 0.51, 0.05, 0.0095).can_be_decided(LIMIT, 1));
        // Both edges of an equivalence may be too near for the rest.
        let equals = Limit::Equals { target: 0.5, within: 0.01 };
        assert!(!verdict(equals, 0.5, 0.011, 0.01).can_be_decided(equals, 1));
        assert!(verdict(equals, 0.5, 0.011, 0.002).can_be_decided(equals, 1));
        assert!(!verdict(equals, 0.5, 0.011, 0.002).can_be_decided(equals, 100_000));
    }

    /// The limit that fails is far away, and what warns is as near as the judge's noise.
    #[test]
    fn each_limit_is_asked_for_itself() {
        let (far, near) = (Limit::AtLeast(0.1), Limit::AtLeast(0.5));
        let mut it = measured(case("s", "e", "cpu", 4), 0.51, 0.01);
        it.metrics[0] = it.metrics[0].clone().with_floor(Some(Estimate { value: 0.0, se: 0.0095, df: 7.0 }));
        let v = judged(vec![Gate { warn: Some(near), ..gate(far) }], &[it], None).0.remove(0);
        assert_eq!(v.outcome, Outcome::Pass);
        assert!(v.can_be_decided(far, 1) && !v.can_be_decided(near, 1));
    }

    /// The floor's few degrees of freedom are not all that is left until its variance is: at 4
    /// times the replicates it is decided over 242 verdicts, at infinitely many it would not be.
    #[test]
    fn what_ever_more_replicates_would_not_decide_some_may() {
        let mut it = measured(case("s", "e", "cpu", 4), 0.5086, 0.003);
        let part = Estimate { value: 0.0, se: 0.00044, df: 3.0 };
        it.metrics[0] = it.metrics[0].clone().with_floor(Some(part));
        let v = judged(vec![gate(LIMIT)], &[it], None).0.remove(0);
        let family = 242;
        let p = |times: f64| LIMIT.p_holds(&v.standing().unwrap().after(times)) * family as f64;
        assert!(
            p(1.0) > 0.05 && p(4.0) < 1e-3 && p(f64::INFINITY) > 0.01,
            "{} {} {}",
            p(1.0),
            p(4.0),
            p(f64::INFINITY)
        );
        let family = 1000;
        assert!(v.out_of_sight(f64::INFINITY, family).unwrap() > 1.0);
        assert!(v.can_be_decided(LIMIT, family) && !v.is_kept_by_floor(family));
        let times = v.replicates_needed(family).unwrap();
        assert!((1.1..8.0).contains(&times), "{times}");
        assert!(v.out_of_sight(times, family).unwrap() <= 1.0 && v.out_of_sight(0.9 * times, family).unwrap() > 1.0);
    }

    /// A base of 8 replicates against a case of ever more: its part stays.
    #[test]
    fn the_noise_of_a_base_record_stays() {
        let against = Gate { against: Some(BASE.into()), ..gate(Limit::AtMost(0.02)) };
        let old = measured(case("s", "e", "cpu", 4), 0.5, 0.006);
        let base = record(suite(vec![]), vec![scene("s")], vec![old]);
        let at = |se| {
            let now = [measured(case("s", "e", "cpu", 4), 0.508, se)];
            judged(vec![against.clone()], &now, Some(&base)).0.remove(0)
        };
        let v = at(0.0001);
        assert_eq!((v.outcome, v.floor), (Outcome::Inconclusive, Some(Floor { se: 0.006, df: 15.0 })));
        assert!(!v.can_be_decided(v.limit, 1) && v.replicates_needed(1).is_none());
        assert!(text(&v).contains("the noise of the base record is too large"), "{}", text(&v));
        assert!(text(&v).contains("make a base record of more replicates"), "{}", text(&v));
        // Another case of the same run gets replicates, too.
        let against = Gate { against: Some("classic".into()), ..against };
        let both =
            [measured(case("s", "classic", "cpu", 4), 0.5, 0.006), measured(case("s", "e", "cpu", 4), 0.508, 0.0001)];
        let v = judged(vec![against], &both, None).0.remove(0);
        assert!(v.floor.is_none() && v.can_be_decided(v.limit, 1) && v.replicates_needed(1).is_some());
    }
}
