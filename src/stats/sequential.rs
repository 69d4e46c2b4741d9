//! Looking at data while they grow.
//!
//! A test that is made anew after each batch of samples, and stops the sampling as
//! soon as it rejects, errs more often than its level says: five looks at .05 err in
//! about one run of seven. Alpha spending (Lan and DeMets, Biometrika 70, 1983) grants each
//! look a share of the error rate; shares that sum to 1 keep the whole by the union
//! bound, however the looks depend on each other and whoever decides how many there are
//! (Jennison and Turnbull, Group Sequential Methods, 2000, ch. 7). That costs some
//! power against boundaries made for known sample sizes, and needs none.

/// The share of the error rate that look `k` = 1, 2, ... may spend: 6 / (pi^2 k^2),
/// which sums to 1 over all k (Euler's sum of 1/k^2). The first look may spend .608 of it, the
/// fifth .024. Look 0 counts as the first.
///
/// At look k a p-value is compared with alpha times this share; p over this share is
/// a p-value that holds for all looks at once.
pub fn spending(look: u32) -> f64 {
    let k = f64::from(look.max(1));
    6.0 / (std::f64::consts::PI * k).powi(2)
}

/// Whether a look decides, so that sampling may end: p family / spent < alpha for the
/// smaller of two p-values, `[holds, broken]`, of one of `family` tests.
///
/// That is Bonferroni's correction. Whatever it rejects, Holm's rejects too, whatever the other
/// p-values come to; so what ends the sampling stays decided when the family is
/// complete, if it is no larger than was said. NaN decides nothing.
pub fn decided(p: [f64; 2], family: usize, spent: f64, alpha: f64) -> bool {
    p.iter().any(|p| p * family as f64 / spent < alpha)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::{SplitMix64, holm, student};

    const LOOKS: [usize; 5] = [4, 8, 16, 32, 64];

    fn normal(random: &mut SplitMix64) -> f64 {
        // Box and Muller 1958.
        (-2.0 * random.uniform().ln()).sqrt() * (std::f64::consts::TAU * random.uniform()).cos()
    }

    /// p of "greater" and of "smaller" than 0 at each look at one growing sample.
    fn looks(random: &mut SplitMix64, truth: f64) -> [[f64; 2]; 5] {
        let values: Vec<f64> = (0..64).map(|_| truth + normal(random)).collect();
        LOOKS.map(|n| {
            let p = student(&values[..n], 0.0).p_greater;
            [p, 1.0 - p]
        })
    }

    #[test]
    fn shares_sum_to_one() {
        let sum: f64 = (1..100_000).map(spending).sum();
        assert!(sum < 1.0 && sum > 0.999_99, "{sum}");
        assert_eq!(spending(0), spending(1));
        assert!((spending(2) - spending(1) / 4.0).abs() < 1e-15);
    }

    /// 10,000 runs whose truth lies on the limit, looked at five times: a false verdict
    /// either way comes in at most 5 % of them at a level of 2.5 % a side. Without
    /// spending it is more than twice that, or the test would show nothing.
    #[test]
    fn looking_again_does_not_err_more() {
        let mut random = SplitMix64(11);
        let (mut spent, mut unspent) = (0.0, 0.0);
        const RUNS: usize = 10_000;
        for _ in 0..RUNS {
            let looks = looks(&mut random, 0.0);
            let any = |share: fn(u32) -> f64| (1u32..).zip(looks).any(|(k, p)| decided(p, 1, share(k), 0.025));
            spent += f64::from(any(spending)) / RUNS as f64;
            unspent += f64::from(any(|_| 1.0)) / RUNS as f64;
        }
        assert!(spent < 0.05 && spent > 0.02, "{spent}");
        assert!(unspent > 0.1, "{unspent}");
    }

    /// 2,000 runs whose truth is 6 standard deviations from the limit, one of 100
    /// verdicts: nine in ten are decided by the second look.
    #[test]
    fn clear_cases_end_early() {
        let mut random = SplitMix64(12);
        let ends: Vec<u32> = (0..2000)
            .map(|_| {
                let looks = looks(&mut random, 6.0);
                let alone = (1u32..).zip(looks).find(|(k, p)| decided(*p, 1, spending(*k), 0.05));
                let family = (1u32..).zip(looks).find(|(k, p)| decided(*p, 100, spending(*k), 0.05));
                assert!(alone.is_some_and(|a| family.is_some_and(|f| a.0 <= f.0)));
                alone.map_or(9, |a| a.0) * 10 + family.map_or(9, |f| f.0)
            })
            .collect();
        let share = |of: &dyn Fn(u32) -> bool| ends.iter().filter(|e| of(**e)).count() as f64 / 2000.0;
        assert!(share(&|e| e / 10 == 1) > 0.95, "alone, at the first look: {}", share(&|e| e / 10 == 1));
        assert!(share(&|e| e % 10 <= 2) > 0.9, "of 100, at the second: {}", share(&|e| e % 10 <= 2));
    }

    /// What ends the sampling stands when the family is complete.
    #[test]
    fn what_is_decided_holm_rejects() {
        let mut random = SplitMix64(13);
        for _ in 0..500 {
            let p: Vec<f64> = (0..20).map(|_| random.uniform().powi(6)).collect();
            let adjusted = holm(&p);
            for (p, a) in p.iter().zip(&adjusted) {
                assert!(!decided([*p, 1.0], 20, 1.0, 0.05) || *a < 0.05);
            }
        }
        assert!(!decided([f64::NAN; 2], 1, 1.0, 0.05));
        assert!(decided([1.0, 0.01], 4, 1.0, 0.05) && !decided([0.01, 1.0], 5, 1.0, 0.05));
        assert!(decided([0.0, 1.0], 1000, spending(50), 1e-6), "without noise there is no doubt");
    }
}
