//! Metrics that look at one pixel at a time.

use super::Pair;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What keeps the relative error of dark pixels finite: relMSE divides by r^2 plus
/// this. The value of Rousselle, Knaus and Zwicker (2012) for radiance.
pub const RELATIVE_EPSILON: f64 = 1e-2;

/// Pixels summed together before sums are added up, whatever the number of threads.
const CHUNK: usize = 1 << 14;

/// Metrics of one pixel at a time: weighted means over pixels and channels of the
/// numbers as they are given, r of the reference and t of the test image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pointwise {
    /// Mean of t - r, signed. 0 is unbiased; above, the test image is too bright.
    pub mean_error: f64,
    /// Mean absolute error, mean |t - r|. 0 and up, lower is better.
    pub mae: f64,
    /// Mean squared error, mean (t - r)^2. 0 and up, lower is better.
    pub mse: f64,
    /// mean (t - r)^2 / (r^2 + 0.01). 0 and up, lower is better.
    pub relative_mse: f64,
    /// Symmetric mean absolute percentage error as a share: mean |t - r| / (|t| + |r|),
    /// 0 where both are 0. 0 to 1, lower is better.
    pub smape: f64,
}

impl Pointwise {
    /// Root of the mean squared error. 0 and up, lower is better.
    pub fn rmse(&self) -> f64 {
        self.mse.sqrt()
    }

    /// Peak signal-to-noise ratio 10 log10(peak^2 / MSE), dB. Higher is better;
    /// infinite for equal images.
    pub fn psnr(&self, peak: f64) -> f64 {
        10.0 * (peak * peak / self.mse).log10()
    }
}

#[derive(Clone, Copy, Default)]
struct Sums {
    weight: f64,
    mean_error: f64,
    mae: f64,
    mse: f64,
    relative_mse: f64,
    smape: f64,
}

impl Sums {
    #[inline(always)]
    fn add(&mut self, r: f32, t: f32, weight: f64) {
        let (r, t) = (f64::from(r), f64::from(t));
        let d = t - r;
        let size = t.abs() + r.abs();
        self.weight += weight;
        self.mean_error += weight * d;
        self.mae += weight * d.abs();
        self.mse += weight * d * d;
        self.relative_mse += weight * d * d / (r * r + RELATIVE_EPSILON);
        self.smape += weight * d.abs() / if size > 0.0 { size } else { 1.0 };
    }

    fn and(self, other: Sums) -> Sums {
        Sums {
            weight: self.weight + other.weight,
            mean_error: self.mean_error + other.mean_error,
            mae: self.mae + other.mae,
            mse: self.mse + other.mse,
            relative_mse: self.relative_mse + other.relative_mse,
            smape: self.smape + other.smape,
        }
    }
}

/// All metrics of one pixel at a time, in one pass, summed in f64.
pub fn pointwise(pair: &Pair<'_>) -> Pointwise {
    let channels = pair.reference().planes().iter().zip(pair.test().planes());
    let mut sums = Sums::default();
    for (reference, test) in channels {
        let parts: Vec<Sums> = reference
            .par_chunks(CHUNK)
            .zip(test.par_chunks(CHUNK))
            .enumerate()
            .map(|(chunk, (reference, test))| {
                let mut sums = Sums::default();
                let at = chunk * CHUNK;
                match pair.weights() {
                    None => reference.iter().zip(test).for_each(|(&r, &t)| sums.add(r, t, 1.0)),
                    Some(w) => {
                        let weighted = reference.iter().zip(test).zip(&w[at..]);
                        weighted.for_each(|((&r, &t), &w)| sums.add(r, t, f64::from(w)));
                    }
                }
                sums
            })
            .collect();
        sums = parts.into_iter().fold(sums, Sums::and);
    }
    let mean = |sum: f64| sum / sums.weight;
    Pointwise {
        mean_error: mean(sums.mean_error),
        mae: mean(sums.mae),
        mse: mean(sums.mse),
        relative_mse: mean(sums.relative_mse),
        smape: mean(sums.smape),
    }
}

/// |t - r| of each pixel, the mean over its channels. Lower is better.
pub fn absolute_map(pair: &Pair<'_>) -> Vec<f32> {
    map(pair, f32::abs)
}

/// t - r of each pixel, the mean over its channels. 0 is right; above, the test
/// image is too bright.
pub fn signed_map(pair: &Pair<'_>) -> Vec<f32> {
    map(pair, |d| d)
}

fn map(pair: &Pair<'_>, f: impl Fn(f32) -> f32 + Sync) -> Vec<f32> {
    let (reference, test) = (pair.reference().planes(), pair.test().planes());
    let mut map = vec![0.0; pair.reference().pixels()];
    let share = 1.0 / reference.len() as f32;
    map.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, map)| {
        let at = chunk * CHUNK;
        for (r, t) in reference.iter().zip(test) {
            let values = r[at..].iter().zip(&t[at..]);
            map.iter_mut().zip(values).for_each(|(m, (r, t))| *m += f(t - r) * share);
        }
    });
    map
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::image::{Encoding, Image};

    #[test]
    fn by_hand() {
        let image = |v: &[f32]| Image::new([v.len(), 1], vec![v.to_vec()], Encoding::Linear).unwrap();
        let (r, t) = (image(&[0.0, 0.5, 1.0, 0.0]), image(&[0.0, 0.75, 0.5, 0.25]));
        let p = pointwise(&Pair::new(&r, &t, None).unwrap());
        assert_eq!((p.mean_error, p.mae, p.mse), (0.0, 0.25, 0.09375));
        assert_eq!(p.rmse(), 0.09375f64.sqrt());
        assert!((p.relative_mse - (0.0625 / 0.26 + 0.25 / 1.01 + 0.0625 / 0.01) / 4.0).abs() < 1e-12);
        assert!((p.smape - (0.0 + 0.2 + 1.0 / 3.0 + 1.0) / 4.0).abs() < 1e-12);
        assert!((p.psnr(1.0) - 10.280_287).abs() < 1e-6);
        let weighted = pointwise(&Pair::new(&r, &t, Some(&[0.0, 1.0, 0.5, 0.0])).unwrap());
        assert!((weighted.mean_error - (0.25 - 0.25) / 1.5).abs() < 1e-12 && (weighted.mae - 0.5 / 1.5).abs() < 1e-12);
        let equal = pointwise(&Pair::new(&r, &r, None).unwrap());
        assert_eq!((equal.mse, equal.psnr(1.0)), (0.0, f64::INFINITY));
    }

    #[test]
    fn maps_are_means_over_channels() {
        let rgb = |v: [f32; 3]| Image::new([1, 1], v.map(|v| vec![v]).to_vec(), Encoding::Linear).unwrap();
        let (r, t) = (rgb([0.5, 0.5, 0.5]), rgb([1.0, 0.25, 0.5]));
        let pair = Pair::new(&r, &t, None).unwrap();
        assert!((absolute_map(&pair)[0] - 0.25).abs() < 1e-7 && (signed_map(&pair)[0] - 0.25 / 3.0).abs() < 1e-7);
    }
}
