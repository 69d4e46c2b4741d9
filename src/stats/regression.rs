//! A straight line through points, by least squares.

use super::Estimate;
use thiserror::Error;

/// A line y = intercept + slope x with what is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Change of y for each unit of x; n - 2 degrees of freedom.
    pub slope: Estimate,
    /// y at x = 0.
    pub intercept: Estimate,
    /// Standard deviation of a point of weight 1 about the line, in the unit of y.
    pub scatter: f64,
    /// Correlation of x and y, -1 to 1; NaN where y does not vary.
    pub r: f64,
    /// Weighted means of x and y.
    middle: [f64; 2],
    /// Sum of the weights, and of weight times (x - mean)^2.
    weight: f64,
    spread: f64,
}

/// Why no line was drawn.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum RegressionError {
    /// One list is longer than another.
    #[error("a line needs as many x as y and weights; there are {x} x, {y} y and {weights} weights")]
    Lengths {
        /// How many x.
        x: usize,
        /// How many y.
        y: usize,
        /// How many weights.
        weights: usize,
    },
    /// Two points leave no scatter to judge by.
    #[error("a line with intervals needs 3 points or more, not {0}")]
    TooFew(usize),
    /// All points have one x.
    #[error("a line needs two different x or more; all are {0}")]
    NoSpread(f64),
    /// A value that cannot be used.
    #[error("point {index}: {what} is {value}; it must be {allowed}")]
    Value {
        /// Which point, from 0.
        index: usize,
        /// Which of its numbers.
        what: &'static str,
        /// The number.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
}

/// Least squares: slope = sum w (x - mx)(y - my) / sum w (x - mx)^2, means weighted;
/// scatter^2 = sum w r^2 / (n - 2), its standard error scatter / sqrt(sum w (x -
/// mx)^2) (Draper and Smith, Applied Regression Analysis, 1998, chapters 1 and 9).
///
/// Weights are relative and say how sure a point is: 1 / its variance, up to a
/// factor. None gives each point 1.
///
/// # Errors
/// Fewer than 3 points, one x only, lists of different length, a value that is no
/// finite number, or a weight that is not above 0.
///
/// ```
/// # use aogauge::stats::regress;
/// let line = regress(&[0.0, 1.0, 2.0, 3.0], &[1.0, 3.1, 4.9, 7.0], None).unwrap();
/// assert!((line.slope.value - 1.98).abs() < 1e-12);
/// let [lo, hi] = line.slope.interval(0.95);
/// assert!(lo < 2.0 && 2.0 < hi);
/// ```
pub fn regress(x: &[f64], y: &[f64], weights: Option<&[f64]>) -> Result<Line, RegressionError> {
    let n = x.len();
    check(x, y, weights)?;
    let w = |i: usize| weights.map_or(1.0, |w| w[i]);
    let sum = |f: &dyn Fn(usize) -> f64| (0..n).map(|i| w(i) * f(i)).sum::<f64>();
    let weight = sum(&|_| 1.0);
    let [mx, my] = [sum(&|i| x[i]) / weight, sum(&|i| y[i]) / weight];
    let spread = sum(&|i| (x[i] - mx).powi(2));
    let rise = sum(&|i| (x[i] - mx) * (y[i] - my));
    let slope = rise / spread;
    let df = (n - 2) as f64;
    let left = sum(&|i| (y[i] - my - slope * (x[i] - mx)).powi(2));
    let scatter = (left / df).sqrt();
    let line = Line {
        slope: Estimate { value: slope, se: scatter / spread.sqrt(), df },
        intercept: Estimate { value: 0.0, se: 0.0, df },
        scatter,
        r: (rise / (spread * sum(&|i| (y[i] - my).powi(2))).sqrt()).clamp(-1.0, 1.0),
        middle: [mx, my],
        weight,
        spread,
    };
    Ok(Line { intercept: line.at(0.0), ..line })
}

/// The power law y = c x^slope as a line of logarithms: how fast an error falls with
/// rays. Independent samples give a slope of -1/2. The intercept is ln c.
///
/// # Errors
/// As [`regress`], and where an x or y is not above 0.
pub fn log_log_slope(x: &[f64], y: &[f64]) -> Result<Line, RegressionError> {
    for (what, values) in [("x", x), ("y", y)] {
        if let Some(index) = values.iter().position(|v| !(*v > 0.0 && v.is_finite())) {
            return Err(RegressionError::Value { index, what, value: values[index], allowed: "a number above 0" });
        }
    }
    let ln = |values: &[f64]| values.iter().map(|v| v.ln()).collect::<Vec<_>>();
    regress(&ln(x), &ln(y), None)
}

fn check(x: &[f64], y: &[f64], weights: Option<&[f64]>) -> Result<(), RegressionError> {
    let n = x.len();
    let weighted = weights.map_or(n, <[f64]>::len);
    if y.len() != n || weighted != n {
        return Err(RegressionError::Lengths { x: n, y: y.len(), weights: weighted });
    }
    if n < 3 {
        return Err(RegressionError::TooFew(n));
    }
    let finite = "a finite number";
    for (what, values, allowed) in
        [("x", x, finite), ("y", y, finite), ("the weight", weights.unwrap_or(&[]), "above 0")]
    {
        let wrong = |v: &f64| !v.is_finite() || (what == "the weight" && *v <= 0.0);
        if let Some(index) = values.iter().position(wrong) {
            return Err(RegressionError::Value { index, what, value: values[index], allowed });
        }
    }
    if x.iter().all(|v| *v == x[0]) {
        return Err(RegressionError::NoSpread(x[0]));
    }
    Ok(())
}

impl Line {
    /// The line itself at `x`, with the error of the line: se = scatter sqrt(1 / sum
    /// w + (x - mx)^2 / sum w (x - mx)^2).
    pub fn at(&self, x: f64) -> Estimate {
        let [mx, my] = self.middle;
        let off = x - mx;
        let se = self.scatter * (1.0 / self.weight + off * off / self.spread).sqrt();
        Estimate { value: my + self.slope.value * off, se, df: self.slope.df }
    }

    /// Where one more point of weight 1 would lie at `x`, at a confidence in (0, 1):
    /// the error of the line and the scatter about it.
    pub fn prediction(&self, x: f64, confidence: f64) -> [f64; 2] {
        let line = self.at(x);
        Estimate { se: line.se.hypot(self.scatter), ..line }.interval(confidence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::reference::{close, numbers, reference};

    #[test]
    fn the_slope_of_an_error_matches_the_reference() {
        let all = reference();
        let r = &all["slope"];
        let line = log_log_slope(&numbers(&r["spp"]), &numbers(&r["rmse"])).unwrap();
        close(line.slope.value, &r["slope"], "slope");
        close(line.slope.se, &r["se"], "se");
        let [lo, hi] = line.slope.interval(0.95);
        close(lo, &r["ci95"][0], "lo");
        close(hi, &r["ci95"][1], "hi");
    }

    #[test]
    fn a_weight_of_two_is_the_point_twice_but_for_the_degrees_of_freedom() {
        let weighted = regress(&[0.0, 1.0, 2.0, 4.0], &[1.0, 2.5, 2.0, 5.0], Some(&[1.0, 2.0, 1.0, 1.0])).unwrap();
        let twice = regress(&[0.0, 1.0, 1.0, 2.0, 4.0], &[1.0, 2.5, 2.5, 2.0, 5.0], None).unwrap();
        assert!((weighted.slope.value - twice.slope.value).abs() < 1e-12);
        assert!((weighted.intercept.value - twice.intercept.value).abs() < 1e-12);
        assert!((weighted.slope.se - twice.slope.se * 1.5f64.sqrt()).abs() < 1e-12);
        // A common factor changes nothing.
        let scaled = regress(&[0.0, 1.0, 2.0, 4.0], &[1.0, 2.5, 2.0, 5.0], Some(&[8.0, 16.0, 8.0, 8.0])).unwrap();
        assert!((scaled.slope.se - weighted.slope.se).abs() < 1e-12);
    }

    #[test]
    fn a_line_without_scatter_is_sure_and_a_far_origin_loses_no_digits() {
        let x: Vec<f64> = (0..5).map(|i| 1e9 + f64::from(i)).collect();
        let y: Vec<f64> = x.iter().map(|x| 2.0 * (x - 1e9)).collect();
        let line = regress(&x, &y, None).unwrap();
        assert_eq!((line.slope.value, line.slope.se, line.r), (2.0, 0.0, 1.0));
        assert_eq!(line.prediction(1e9 + 10.0, 0.95), [20.0, 20.0]);
    }

    #[test]
    fn what_makes_no_line_is_refused_with_a_reason() {
        let points = [1.0, 2.0, 3.0];
        let text = |r: Result<Line, RegressionError>| r.unwrap_err().to_string();
        assert_eq!(
            text(regress(&[1.0, 2.0], &[1.0, 2.0], None)),
            "a line with intervals needs 3 points or more, not 2"
        );
        assert_eq!(text(regress(&[0.1; 3], &points, None)), "a line needs two different x or more; all are 0.1");
        assert!(matches!(regress(&points, &points[..2], None), Err(RegressionError::Lengths { .. })));
        assert_eq!(
            text(regress(&points, &[1.0, f64::NAN, 2.0], None)),
            "point 1: y is NaN; it must be a finite number"
        );
        assert_eq!(
            text(regress(&points, &points, Some(&[1.0, 1.0, 0.0]))),
            "point 2: the weight is 0; it must be above 0"
        );
        assert_eq!(text(log_log_slope(&points, &[1.0, 0.0, 2.0])), "point 1: y is 0; it must be a number above 0");
        assert!(regress(&points, &[2.0; 3], None).unwrap().r.is_nan());
    }
}
