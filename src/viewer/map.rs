//! Maps that are computed before a page is made.

use crate::{
    metrics::image::{DEFAULT_PPD, Encoding, Image, flip},
    stats::{Estimate, welch_of_estimates},
};

/// FLIP a pixel, at [`DEFAULT_PPD`] pixels a degree; NaN where either image holds no
/// number. None where there is nothing to compare.
pub fn flip_map([width, height]: [u32; 2], reference: &[f32], test: &[f32]) -> Option<Vec<f32>> {
    let image =
        |values: &[f32]| Image::new([width as usize, height as usize], vec![values.to_vec()], Encoding::Linear).ok();
    let (reference, test) = (image(reference)?, image(test)?);
    let pair = crate::metrics::image::Pair::new(&reference, &test, None).ok()?;
    let map = flip(&pair, DEFAULT_PPD).ok()?;
    let known = |i: usize| [&reference, &test].iter().all(|m| m.planes()[0][i].is_finite());
    Some(map.into_iter().enumerate().map(|(i, v)| if known(i) { v } else { f32::NAN }).collect())
}

/// Two-sided p-values of Welch's test a pixel; NaN where either side has no number.
/// What 32 bits cannot hold becomes 0.
pub fn p_values(pixels: usize, test: impl Fn(usize) -> Estimate, reference: impl Fn(usize) -> Estimate) -> Vec<f32> {
    (0..pixels).map(|i| welch_of_estimates(&test(i), &reference(i)).p_two as f32).collect()
}
