//! Two images of records, replicate by replicate: Welch's test of whether they may
//! have one expectation.

use super::ALPHA;
use crate::stats::{ImageSample, Replicates, ScaleTest, three_scales};
use schemars::JsonSchema;
use serde::Serialize;

/// Values looked at to find the smallest step between them.
const STEP_OF: usize = 1 << 16;

/// Steps below this are rounding, not rays.
const ROUNDING: f64 = 1e-6;

/// The replicates of one image.
#[derive(Clone, Debug)]
pub(super) struct Sampled {
    images: Vec<Vec<f32>>,
    quantum: f64,
}

impl Sampled {
    /// Replicates of so many rays a pixel. Where the file does not tell, one ray is
    /// taken to change a value by the smallest step between any two: of openness that
    /// is 1 / rays or a part of it, of smooth values next to nothing.
    pub(super) fn new(images: Vec<Vec<f32>>, rays: Option<u32>) -> Self {
        let quantum = rays.map_or_else(|| smallest_step(&images), |rays| 1.0 / f64::from(rays.max(1)));
        Sampled { images, quantum }
    }

    /// Whether any replicate differs from another. What a ray is worth is a bound on noise that was not seen by chance; of a
    /// renderer that has none it says nothing.
    fn has_noise(&self) -> bool {
        let same = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| a == b || a.is_nan() && b.is_nan());
        self.images.windows(2).any(|pair| !same(&pair[0], &pair[1]))
    }

    pub(super) fn sample(&self) -> Replicates<'_> {
        Replicates { images: self.images.iter().map(Vec::as_slice).collect(), quantum: self.quantum }
    }
}

fn smallest_step(images: &[Vec<f32>]) -> f64 {
    let values = images.iter().flatten().copied().filter(|v| v.is_finite()).take(STEP_OF);
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    let steps = values.windows(2).map(|w| f64::from(w[1]) - f64::from(w[0]));
    let least = steps.filter(|s| *s > ROUNDING).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// What Welch's test of two images of records found.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct WelchReport {
    /// The chance of any rejection, over all places and scales, where both have one
    /// expectation.
    pub alpha: f64,
    /// Replicates of the reference and of the test image.
    pub replicates: [usize; 2],
    /// Mean of the test image less mean of the reference.
    pub bias: f64,
    /// Its 95 % interval; null where no replicate differs.
    pub interval: Option<[f64; 2]>,
    /// The tests, from small to large places.
    pub scales: [ScaleTest; 3],
}

impl WelchReport {
    pub(super) fn of(size: [u32; 2], [reference, test]: &[Sampled; 2]) -> Self {
        let samples = [reference, test].map(Sampled::sample);
        let pixels: Vec<usize> =
            (0..size[0] as usize * size[1] as usize).filter(|&i| samples.iter().all(|s| s.is_known(i))).collect();
        let bias = samples[1].mean(&pixels).less(&samples[0].mean(&pixels));
        WelchReport {
            alpha: ALPHA,
            replicates: [reference.images.len(), test.images.len()],
            bias: bias.value,
            interval: Some(bias.interval(0.95))
                .filter(|i| [reference, test].iter().any(|s| s.has_noise()) && i.iter().all(|v| v.is_finite())),
            scales: three_scales(size, &samples[1], &samples[0], ALPHA, 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ray_is_the_smallest_step() {
        let images = vec![vec![0.25f32, 1.0, 0.5, f32::NAN], vec![0.75, 0.75, 1.0, 1.0]];
        assert_eq!(Sampled::new(images.clone(), None).quantum, 0.25);
        assert_eq!(Sampled::new(images, Some(8)).quantum, 0.125);
        assert_eq!(Sampled::new(vec![vec![1.0; 4]; 2], None).quantum, 0.0);
    }
}
