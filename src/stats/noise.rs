//! Whether two sampled images are equally noisy, and whether their noise explains how
//! they differ.

use super::upper_tail;
use schemars::JsonSchema;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Noise of one image beside that of another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Noise {
    /// Variance of the first over that of the second, summed over the image; above 1
    /// the first is noisier. 1 where neither has any, infinite where the second has
    /// none.
    #[schemars(with = "Option<f64>")]
    pub ratio: f64,
    /// Two-sided p-value of "both are equally noisy"; 1 where there is nothing to test.
    pub p: f64,
}

/// Compares the noise of two images whose pixels are independent, by their variance
/// over replicates a pixel. Pixels that are no number on either side are left out.
///
/// Variances are unbiased, so their differences d have expectation 0 at every pixel
/// where nothing changed, whatever the distribution of a pixel is: the F test would
/// need normal ones, and openness is binomial. t = sum d / sqrt(sum d^2), a
/// self-normalised sum (Logan, Mallows, Rice, Shepp, Annals of Probability 1(5),
/// 1973), held against Student's t of (sum d^2)^2 / sum d^4 degrees of freedom.
pub fn noise_of_pixels(image: &[f32], against: &[f32]) -> Noise {
    let pairs = || image.iter().zip(against).map(|(a, b)| [f64::from(*a), f64::from(*b)]);
    let known = || pairs().filter(|[a, b]| a.is_finite() && b.is_finite());
    let [a, b] = known().fold([0.0; 2], |[x, y], [a, b]| [x + a, y + b]);
    let (t, df) = self_normalised(known().map(|[a, b]| a - b));
    Noise { ratio: ratio(a, b), p: (2.0 * upper_tail(df, t.abs())).min(1.0) }
}

/// Compares the noise of two images by their replicates, two or more a side, each a
/// row of values (pixels, or means of tiles). Values may depend on each other within a
/// replicate, as in filtered images; replicates must not.
///
/// F is the ratio of the variances summed over the row. Such a sum has no more degrees
/// of freedom than its correlation leaves: (n - 1) (tr S)^2 / tr S^2 (Satterthwaite,
/// Biometrics Bulletin 2, 1946; Box, Annals of Mathematical Statistics 25, 1954), with
/// tr S^2 estimated without bias for normal values (Bai and Saranadasa, Statistica
/// Sinica 6, 1996).
pub fn noise_of_replicates(image: &[Vec<f32>], against: &[Vec<f32>]) -> Noise {
    let columns = image.iter().chain(against).map(Vec::len).min().unwrap_or(0);
    let known: Vec<usize> =
        (0..columns).filter(|&c| image.iter().chain(against).all(|row| row[c].is_finite())).collect();
    let [a, b] = [image, against].map(|rows| total_variance(rows, &known));
    let p = match (a.sum > 0.0, b.sum > 0.0) {
        (false, false) => 1.0,
        (true, true) => {
            let tail = |x: &Total, y: &Total| FisherSnedecor::new(x.df, y.df).map_or(f64::NAN, |f| f.sf(x.sum / y.sum));
            (2.0 * tail(&a, &b).min(tail(&b, &a))).min(1.0)
        }
        // One side has none: with two degrees of freedom or more no chance.
        _ => 0.0,
    };
    Noise { ratio: ratio(a.sum, b.sum), p: if p.is_nan() { 1.0 } else { p } }
}

/// The p-value of "noise explains how the means differ", for images whose pixels are
/// independent: small where pixels differ more than their variances allow, even where
/// no single pixel is beyond doubt and the means of places are equal. `replicates` of
/// the first and the second.
///
/// e = (difference of means)^2 - (v1/n1 + v2/n2) has expectation 0 at every pixel where
/// nothing changed. t = sum e / sqrt(sum e^2) as in [`noise_of_pixels`], one-sided. 1
/// where there is no noise and no difference.
pub fn unexplained(means: [&[f32]; 2], variances: [&[f32]; 2], replicates: [u32; 2]) -> f64 {
    let n = replicates.map(f64::from);
    let pixels = means[0].len().min(means[1].len()).min(variances[0].len()).min(variances[1].len());
    let excess = (0..pixels).map(|i| {
        let [a, b] = means.map(|m| f64::from(m[i]));
        (a - b).powi(2) - f64::from(variances[0][i]) / n[0] - f64::from(variances[1][i]) / n[1]
    });
    let (t, df) = self_normalised(excess.filter(|e| e.is_finite()));
    if t == 0.0 { 1.0 } else { upper_tail(df, t) }
}

/// Sum over root of the sum of squares, and its degrees of freedom; 0 of nothing.
fn self_normalised(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut sum, mut squares, mut fourth) = (0.0, 0.0, 0.0);
    for v in values {
        sum += v;
        squares += v * v;
        fourth += v.powi(4);
    }
    // Squares of tiny numbers may vanish before their sum does.
    if squares > 0.0 && fourth > 0.0 { (sum / squares.sqrt(), squares * squares / fourth) } else { (0.0, 1.0) }
}

fn ratio(a: f64, b: f64) -> f64 {
    if a == b { 1.0 } else { a / b }
}

/// A sum of variances and the degrees of freedom it has.
struct Total {
    sum: f64,
    df: f64,
}

fn total_variance(rows: &[Vec<f32>], columns: &[usize]) -> Total {
    let (n, m) = (rows.len(), rows.len() as f64 - 1.0);
    if n < 2 || columns.is_empty() {
        return Total { sum: 0.0, df: 1.0 };
    }
    let means: Vec<f64> =
        columns.iter().map(|&c| rows.iter().map(|r| f64::from(r[c])).sum::<f64>() / n as f64).collect();
    let centred: Vec<Vec<f64>> =
        rows.iter().map(|r| columns.iter().zip(&means).map(|(&c, mean)| f64::from(r[c]) - mean).collect()).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let sum = centred.iter().map(|row| dot(row, row)).sum::<f64>() / m;
    let squares: f64 = centred.iter().flat_map(|a| centred.iter().map(|b| dot(a, b).powi(2))).sum::<f64>() / (m * m);
    let trace = m * m / ((m + 2.0) * (m - 1.0).max(1.0)) * (squares - sum * sum / m);
    // (tr S)^2 is too large by twice the other over m. One independent value at least,
    // at most as many as there are columns.
    let values = (sum * sum - 2.0 * trace / m) / trace;
    let most = columns.len() as f64;
    Total {
        sum,
        df: m * if values >= 1.0 && trace > 0.0 {
            values.min(most)
        } else if trace > 0.0 {
            1.0
        } else {
            most
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degenerate_images_have_a_stated_result() {
        assert_eq!(noise_of_pixels(&[], &[]), Noise { ratio: 1.0, p: 1.0 });
        assert_eq!(noise_of_pixels(&[0.0; 9], &[0.0; 9]), Noise { ratio: 1.0, p: 1.0 });
        assert_eq!(noise_of_pixels(&[f32::NAN, 0.1], &[0.3, 0.1]), Noise { ratio: 1.0, p: 1.0 });
        assert_eq!(noise_of_replicates(&[], &[]), Noise { ratio: 1.0, p: 1.0 });
        let still = vec![vec![0.5; 4]; 4];
        assert_eq!(noise_of_replicates(&still, &still).p, 1.0);
        let moving: Vec<Vec<f32>> = (0..4).map(|i| vec![i as f32; 4]).collect();
        let found = noise_of_replicates(&moving, &still);
        assert!(found.p == 0.0 && found.ratio == f64::INFINITY);
        assert_eq!(unexplained([&[0.5; 3]; 2], [&[0.0; 3]; 2], [4, 4]), 1.0);
        assert_eq!(unexplained([&[], &[]], [&[], &[]], [4, 4]), 1.0);
    }

    /// Equal columns are one value: n - 1 degrees of freedom, the plain F test.
    #[test]
    fn columns_that_move_together_count_once() {
        let side = |values: [f32; 5]| -> Vec<Vec<f32>> { values.iter().map(|v| vec![*v; 7]).collect() };
        let (a, b) = (side([1.0, 2.0, 4.0, 3.0, 9.0]), side([1.0, 1.5, 2.0, 1.0, 2.5]));
        let found = noise_of_replicates(&a, &b);
        // Variances 9.7 and .425.
        assert!((found.ratio - 9.7 / 0.425).abs() < 1e-9);
        let f = FisherSnedecor::new(4.0, 4.0).unwrap();
        assert!((found.p - 2.0 * f.sf(9.7 / 0.425)).abs() < 1e-9, "{found:?}");
    }
}
