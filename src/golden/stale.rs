//! Many cases that moved alike: the goldens are probably older than the renderer.

use super::{Checked, Outcome, Verdict};
use crate::counted::counted;
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{Binomial, DiscreteCDF};
use std::collections::BTreeMap;

/// Level of the sign test.
pub const STALE_LEVEL: f64 = 0.01;

/// Most cases differ, and their signs agree beyond chance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Stale {
    /// Cases compared, each golden once.
    pub compared: usize,
    /// Of those that differ, how many are brighter than their golden.
    pub brighter: usize,
    /// How many are darker.
    pub darker: usize,
    /// Two-sided p-value of the sign test.
    pub p: f64,
}

impl Stale {
    /// One sentence for people.
    pub fn line(&self) -> String {
        format!(
            "{} of {} differ, {} brighter and {} darker (sign test, p = {:.1e}): the goldens are probably stale, or a setting changed",
            self.brighter + self.darker,
            counted(self.compared, "golden", "goldens"),
            self.brighter,
            self.darker,
            self.p
        )
    }
}

/// Whether more than half of the goldens differ and go one way, by the sign test
/// (Arbuthnott 1710; Conover, Practical Nonparametric Statistics, 1999, ch. 3.4): the
/// signs of independent faults are as likely up as down, so k of n alike have
/// probability 2 P(B(n, 1/2) >= k). It rejects below [`STALE_LEVEL`]: 8 of 8, 11 of
/// 12, 17 of 21 suffice; of less than 8 nothing does.
///
/// A golden that two renderers are held against counts once, by the first of them:
/// their signs depend on each other.
pub(super) fn stale(checked: &[Checked]) -> Option<Stale> {
    let mut signs: BTreeMap<&std::path::Path, f64> = BTreeMap::new();
    for case in checked {
        if let Verdict::Compared(c) = &case.verdict {
            let bias = if case.outcome() == Outcome::Fail { c.bias } else { 0.0 };
            signs.entry(&case.golden).or_insert(bias);
        }
    }
    of_signs(signs.len(), &signs.into_values().collect::<Vec<_>>())
}

fn of_signs(compared: usize, biases: &[f64]) -> Option<Stale> {
    let brighter = biases.iter().filter(|b| **b > 0.0).count();
    let darker = biases.iter().filter(|b| **b < 0.0).count();
    let p = sign_test(brighter, darker);
    let stale = Stale { compared, brighter, darker, p };
    (2 * (brighter + darker) > compared && p < STALE_LEVEL).then_some(stale)
}

/// Two-sided p-value; 1 of nothing.
fn sign_test(up: usize, down: usize) -> f64 {
    let (n, most) = ((up + down) as u64, up.max(down) as u64);
    if n == 0 {
        return 1.0;
    }
    Binomial::new(0.5, n).map_or(1.0, |b| (2.0 * b.sf(most - 1)).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sign_test_is_the_binomial_one() {
        // scipy.stats.binomtest(k, n).pvalue
        for (up, down, p) in [
            (8, 0, 0.007_812_5),
            (0, 8, 0.007_812_5),
            (7, 0, 0.015_625),
            (11, 1, 0.006_347_656_25),
            (10, 2, 0.038_574_218_75),
            (16, 4, 0.011_817_932_128_906_25),
            (17, 4, 0.007_197_380_065_917_969),
            (5, 5, 1.0),
            (0, 0, 1.0),
        ] {
            assert!((sign_test(up, down) - p).abs() < 1e-12, "{up}, {down}: {}", sign_test(up, down));
        }
    }

    #[test]
    fn stale_needs_most_cases_and_one_way() {
        let biases = |up: usize, down: usize, still: usize| -> Option<Stale> {
            let all = [vec![0.01; up], vec![-0.02; down], vec![0.0; still]].concat();
            of_signs(all.len(), &all)
        };
        assert!(biases(0, 21, 0).is_some_and(|s| s.darker == 21 && s.p < 1e-6));
        assert!(biases(11, 0, 10).is_some());
        assert!(biases(10, 0, 11).is_none(), "most hold");
        assert!(biases(11, 10, 0).is_none(), "both ways");
        assert!(biases(7, 0, 0).is_none(), "too few");
    }

    /// At the stated level: independent signs of 21 cases, 4,000 times. The test is
    /// discrete: its true level there is .0072.
    #[test]
    fn independent_faults_are_rarely_called_stale() {
        let mut random = crate::stats::SplitMix64(7);
        let mut sign = || if random.bits() >> 63 == 0 { 0.01 } else { -0.01 };
        let alarms = (0..4000).filter(|_| of_signs(21, &(0..21).map(|_| sign()).collect::<Vec<_>>()).is_some()).count();
        assert!((10..=52).contains(&alarms), "{alarms} of 4000");
    }
}
