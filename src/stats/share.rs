//! Intervals of a share: k of n trials.

use super::normal_quantile;
use statrs::distribution::{Beta, ContinuousCDF};

/// Wilson's score interval (JASA 22, 1927) of a share, at a confidence in (0, 1):
/// (k + z^2/2 +- z sqrt(k (n - k)/n + z^2/4)) / (n + z^2). Good for reports:
/// its coverage is near the confidence on average over shares.
///
/// No trial, or a confidence outside (0, 1), gives [0, 1]; k above n gives NaN.
///
/// Coverage at 95 %, summed exactly over the binomial for shares .01 to .99: on
/// average .9511 at n = 64, between .90 and .99 at each share.
pub fn wilson(k: u64, n: u64, confidence: f64) -> [f64; 2] {
    if let Some(known) = without_data(k, n, confidence) {
        return known;
    }
    let z = normal_quantile(0.5 + confidence / 2.0);
    let (k, n, z2) = (k as f64, n as f64, z * z);
    let (middle, half) = (k + z2 / 2.0, z * (k * (n - k) / n + z2 / 4.0).sqrt());
    // At the ends the formula is exactly 0 and 1; rounding is not.
    let low = if k == 0.0 { 0.0 } else { (middle - half) / (n + z2) };
    let high = if k == n { 1.0 } else { (middle + half) / (n + z2) };
    [low, high]
}

/// The exact interval of Clopper and Pearson (Biometrika 26, 1934), at a confidence
/// in (0, 1): it never covers less, and mostly more. Good for claims: "no false alarm
/// in n" is `clopper_pearson(0, n, confidence)`, whose upper end is
/// 1 - ((1 - confidence)/2)^(1/n).
///
/// No trial, or a confidence outside (0, 1), gives [0, 1]; k above n gives NaN.
pub fn clopper_pearson(k: u64, n: u64, confidence: f64) -> [f64; 2] {
    if let Some(known) = without_data(k, n, confidence) {
        return known;
    }
    let alpha = (1.0 - confidence) / 2.0;
    let (open, closed) = (k as f64, (n - k) as f64);
    let low = match k {
        0 => 0.0,
        _ if k == n => (alpha.ln() / open).exp(),
        _ => where_beta_reaches(open, closed + 1.0, alpha),
    };
    let high = match n - k {
        0 => 1.0,
        _ if k == 0 => -(alpha.ln() / closed).exp_m1(),
        _ => where_beta_reaches(open + 1.0, closed, 1.0 - alpha),
    };
    [low, high]
}

/// Quantile of the beta distribution by halving: statrs' own search may not end for
/// parameters in the millions.
fn where_beta_reaches(a: f64, b: f64, p: f64) -> f64 {
    let Ok(beta) = Beta::new(a, b) else { return f64::NAN };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if beta.cdf(middle) < p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The interval where the numbers are not those of an experiment.
fn without_data(k: u64, n: u64, confidence: f64) -> Option<[f64; 2]> {
    if k > n {
        return Some([f64::NAN; 2]);
    }
    (n == 0 || !(confidence > 0.0 && confidence < 1.0)).then_some([0.0, 1.0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::reference::{close, reference};
    use statrs::distribution::{Binomial, Discrete};

    #[test]
    fn intervals_match_the_reference() {
        let all = reference();
        let w = wilson(7, 64, 0.95);
        let c = clopper_pearson(0, 64, 0.95);
        for end in [0, 1] {
            close(w[end], &all["wilson"]["k=7,n=64"][end], "wilson");
            close(c[end], &all["wilson"]["clopper k=0,n=64"][end], "clopper");
        }
    }

    #[test]
    fn intervals_are_symmetric_ordered_and_defined_everywhere() {
        for interval in [wilson, clopper_pearson] {
            for n in [1, 2, 10, 1000, 1_000_000] {
                for k in [0, 1, n / 2, n - 1, n] {
                    let ([lo, hi], share) = (interval(k, n, 0.99), k as f64 / n as f64);
                    assert!(0.0 <= lo && lo <= share && share <= hi && hi <= 1.0, "{k} of {n}: {lo} {hi}");
                    let [mirrored, _] = interval(n - k, n, 0.99);
                    assert!((1.0 - hi - mirrored).abs() < 1e-9, "{k} of {n}");
                }
            }
            assert_eq!(interval(0, 0, 0.95), [0.0, 1.0]);
            assert_eq!(interval(1, 3, 1.0), [0.0, 1.0]);
            assert_eq!(interval(1, 3, f64::NAN), [0.0, 1.0]);
            assert!(interval(4, 3, 0.95)[0].is_nan());
        }
    }

    /// Exact, without chance: the binomial weights of the k whose interval holds p.
    #[test]
    fn coverage_is_as_stated() {
        let n = 64;
        let coverage = |interval: fn(u64, u64, f64) -> [f64; 2], p: f64| -> f64 {
            let binomial = Binomial::new(p, n).unwrap();
            (0..=n)
                .filter(|&k| (interval(k, n, 0.95)[0]..=interval(k, n, 0.95)[1]).contains(&p))
                .map(|k| binomial.pmf(k))
                .sum()
        };
        let shares = || (1..100).map(|i| f64::from(i) / 100.0);
        let wilson: Vec<f64> = shares().map(|p| coverage(wilson, p)).collect();
        let mean = wilson.iter().sum::<f64>() / 99.0;
        assert!((mean - 0.9511).abs() < 0.001, "{mean}");
        assert!(wilson.iter().all(|c| (0.90..=0.99).contains(c)), "{wilson:?}");
        assert!(shares().all(|p| coverage(clopper_pearson, p) >= 0.95));
    }
}
