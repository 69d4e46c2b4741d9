//! Corrections for many tests. Adjusted p-values come in the order given; one that
//! is below alpha rejects. NaN is a test that was not made: it stays NaN and does
//! not count.
//!
//! | | controls | needs |
//! |---|---|---|
//! | Sidak | any false rejection | independent tests |
//! | Holm | any false rejection | nothing |
//! | Benjamini-Hochberg | share of rejections that are false | independent or positively dependent tests |

/// The level of each of `n` independent tests for a family error of `alpha`:
/// 1 - (1 - alpha)^(1/n) (Sidak 1967), without losing digits for large n. No test
/// counts as one.
pub fn sidak_alpha(alpha: f64, n: usize) -> f64 {
    -((-alpha).ln_1p() / n.max(1) as f64).exp_m1()
}

/// Sidak's adjusted p-values: 1 - (1 - p)^n.
pub fn sidak(p: &[f64]) -> Vec<f64> {
    let n = p.iter().filter(|p| !p.is_nan()).count() as f64;
    p.iter().map(|p| -(n * (-p).ln_1p()).exp_m1()).collect()
}

/// Holm's adjusted p-values (Scandinavian Journal of Statistics 6, 1979): the k-th
/// smallest of n times n - k + 1, never below the one before, at most 1.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let order = ascending(p);
    let n = order.len();
    let mut adjusted = vec![f64::NAN; p.len()];
    let mut least = 0.0;
    for (k, i) in order.into_iter().enumerate() {
        least = ((n - k) as f64 * p[i]).clamp(least, 1.0);
        adjusted[i] = least;
    }
    adjusted
}

/// Benjamini and Hochberg's adjusted p-values (JRSS B 57, 1995): the k-th smallest
/// of n times n / k, never above the one after, at most 1.
pub fn benjamini_hochberg(p: &[f64]) -> Vec<f64> {
    let order = ascending(p);
    let n = order.len() as f64;
    let mut adjusted = vec![f64::NAN; p.len()];
    let mut most: f64 = 1.0;
    for (k, i) in order.into_iter().enumerate().rev() {
        most = most.min(p[i] * n / (k + 1) as f64);
        adjusted[i] = most;
    }
    adjusted
}

/// Places of the p-values that are numbers, the smallest first.
fn ascending(p: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..p.len()).filter(|&i| !p[i].is_nan()).collect();
    order.sort_by(|&a, &b| p[a].total_cmp(&p[b]));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::reference::{close, numbers, reference};

    type Adjust = fn(&[f64]) -> Vec<f64>;
    const ALL: [(&str, Adjust); 3] = [("sidak", sidak), ("holm", holm), ("bh", benjamini_hochberg)];

    #[test]
    fn corrections_match_the_reference_in_any_order() {
        let all = reference();
        let p = numbers(&all["multiple"]["p"]);
        for (name, adjust) in ALL {
            let forth = adjust(&p);
            let back = adjust(&p.iter().rev().copied().collect::<Vec<_>>());
            for (i, v) in forth.iter().enumerate() {
                close(*v, &all["multiple"][name][i], name);
                assert_eq!(*v, back[p.len() - 1 - i], "{name}");
            }
        }
        for n in [2usize, 100, 4096, 65_536] {
            close(sidak_alpha(0.01, n), &all["multiple"]["sidak_alpha"][n.to_string()], "sidak level");
        }
    }

    #[test]
    fn a_test_that_was_not_made_does_not_count() {
        for (name, adjust) in ALL {
            let with = adjust(&[0.02, f64::NAN, 0.3, 0.02]);
            let without = adjust(&[0.02, 0.3, 0.02]);
            assert!(with[1].is_nan(), "{name}");
            assert_eq!([with[0], with[2], with[3]], [without[0], without[1], without[2]], "{name}");
            assert!(adjust(&[]).is_empty());
            assert_eq!(adjust(&[0.0, 1.0])[..], [0.0, 1.0], "{name}");
        }
    }
}
