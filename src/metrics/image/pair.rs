//! Two images made comparable: same shape, weights, no NaN.

use super::{Image, ImageError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Pixels whose value is NaN or infinite, among those of the mask.
///
/// The policy: such a pixel is counted and reported, has no weight in any metric,
/// and stands as 0 in both images where a filter reaches over it. Where both
/// images hold none, that is usually a view past all surfaces, and no fault. In
/// one image only it is one: [`NonFinite::check`] makes it an error, and gates do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NonFinite {
    /// In the reference alone.
    pub reference: usize,
    /// In the test image alone.
    pub test: usize,
    /// In both.
    pub both: usize,
}

impl NonFinite {
    /// Whether no image holds NaN or infinity where the other holds a number.
    ///
    /// # Errors
    /// [`ImageError::NonFinite`] with the counts where one does.
    pub fn check(&self) -> Result<(), ImageError> {
        if self.reference + self.test > 0 {
            return Err(ImageError::NonFinite { reference: self.reference, test: self.test });
        }
        Ok(())
    }
}

/// A reference and a test image of one shape and encoding, with the weights of
/// their pixels.
#[derive(Clone, Debug)]
pub struct Pair<'a> {
    reference: Cow<'a, Image>,
    test: Cow<'a, Image>,
    weights: Option<Vec<f32>>,
    non_finite: NonFinite,
    /// The pixels of these.
    holes: Vec<usize>,
}

impl<'a> Pair<'a> {
    /// Puts two images side by side. `mask` weighs pixels from 0 to 1, a value a
    /// pixel; metrics are weighted means. Metrics with filters (SSIM, FLIP) weigh
    /// the error at the filter's centre, so what lies beyond the mask's border
    /// still shows in the pixels beside it.
    ///
    /// # Errors
    /// [`ImageError`] where shapes or encodings differ, a weight is no weight, or
    /// no pixel is left.
    pub fn new(reference: &'a Image, test: &'a Image, mask: Option<&[f32]>) -> Result<Self, ImageError> {
        check_shapes(reference, test, mask)?;
        let finite = |image: &Image, i: usize| image.planes.iter().all(|p| p[i].is_finite());
        let whole = |image: &Image| image.planes.iter().flatten().all(|v| v.is_finite());
        let mut pair = Pair {
            reference: Cow::Borrowed(reference),
            test: Cow::Borrowed(test),
            weights: mask.map(<[f32]>::to_vec),
            non_finite: NonFinite::default(),
            holes: Vec::new(),
        };
        if !(whole(reference) && whole(test)) {
            let weights = pair.weights.get_or_insert_with(|| vec![1.0; reference.pixels()]);
            for (i, weight) in weights.iter_mut().enumerate() {
                let count = match (finite(reference, i), finite(test, i)) {
                    (true, true) => continue,
                    (false, true) => &mut pair.non_finite.reference,
                    (true, false) => &mut pair.non_finite.test,
                    (false, false) => &mut pair.non_finite.both,
                };
                *count += usize::from(*weight > 0.0);
                *weight = 0.0;
                pair.holes.push(i);
                for image in [&mut pair.reference, &mut pair.test] {
                    image.to_mut().planes.iter_mut().for_each(|p| p[i] = 0.0);
                }
            }
        }
        if pair.weights.as_ref().is_some_and(|w| w.iter().all(|&w| w == 0.0)) {
            let NonFinite { reference: r, test: t, both } = pair.non_finite;
            return Err(ImageError::Nothing { masked: reference.pixels() - r - t - both, non_finite: r + t + both });
        }
        Ok(pair)
    }

    /// What is compared with.
    pub fn reference(&self) -> &Image {
        &self.reference
    }

    /// What is compared.
    pub fn test(&self) -> &Image {
        &self.test
    }

    /// A weight a pixel, 0 to 1; None where all are 1.
    pub fn weights(&self) -> Option<&[f32]> {
        self.weights.as_deref()
    }

    /// Pixels without a number.
    pub fn non_finite(&self) -> NonFinite {
        self.non_finite
    }

    /// Pixels that hold no number in one image or in both; they are 0 in what is compared.
    pub(super) fn holes(&self) -> &[usize] {
        &self.holes
    }

    pub(super) fn weight(&self, pixel: usize) -> f64 {
        self.weights.as_ref().map_or(1.0, |w| f64::from(w[pixel]))
    }
}

fn check_shapes(reference: &Image, test: &Image, mask: Option<&[f32]>) -> Result<(), ImageError> {
    if reference.size != test.size {
        return Err(ImageError::Size { reference: reference.size, test: test.size });
    }
    if reference.planes.len() != test.planes.len() {
        return Err(ImageError::Channels { reference: reference.planes.len(), test: test.planes.len() });
    }
    if reference.encoding != test.encoding {
        return Err(ImageError::Encoding { reference: reference.encoding, test: test.encoding });
    }
    let Some(mask) = mask else {
        return Ok(());
    };
    if mask.len() != reference.pixels() {
        return Err(ImageError::Mask { mask: mask.len(), pixels: reference.pixels() });
    }
    match mask.iter().position(|w| !(0.0..=1.0).contains(w)) {
        Some(pixel) => Err(ImageError::Weight { pixel, weight: mask[pixel] }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::image::Encoding;

    fn grey(values: &[f32]) -> Image {
        Image::new([values.len(), 1], vec![values.to_vec()], Encoding::Linear).unwrap()
    }

    #[test]
    fn what_is_no_number_is_counted_and_has_no_weight() {
        let (a, b) = (grey(&[f32::NAN, 0.5, f32::INFINITY, 0.5]), grey(&[f32::NAN, f32::NAN, 0.5, 0.25]));
        let pair = Pair::new(&a, &b, None).unwrap();
        assert_eq!(pair.non_finite(), NonFinite { reference: 1, test: 1, both: 1 });
        assert_eq!(pair.weights().unwrap(), [0.0, 0.0, 0.0, 1.0]);
        assert!(pair.non_finite().check().unwrap_err().to_string().contains("1 pixel of the reference alone"));
        let masked = Pair::new(&a, &b, Some(&[1.0, 0.0, 0.0, 1.0])).unwrap();
        assert_eq!(masked.non_finite(), NonFinite { reference: 0, test: 0, both: 1 });
        assert!(masked.non_finite().check().is_ok());
    }

    #[test]
    fn what_cannot_be_compared_says_why() {
        let a = grey(&[0.5, 0.5]);
        let error = |test: &Image, mask: Option<&[f32]>| Pair::new(&a, test, mask).unwrap_err().to_string();
        assert!(error(&grey(&[0.5; 3]), None).contains("2 x 1 pixels, the test image 3 x 1"));
        let rgb = Image::new([2, 1], vec![vec![0.0; 2]; 3], Encoding::Linear).unwrap();
        assert!(error(&rgb, None).contains("the reference has 1, the test image 3"));
        let srgb = Image::new([2, 1], vec![vec![0.0; 2]], Encoding::Srgb).unwrap();
        assert!(error(&srgb, None).contains("linear, the test image srgb"));
        assert!(error(&a, Some(&[1.0])).contains("the mask has 1 values"));
        assert!(error(&a, Some(&[1.0, 1.5])).contains("weight 1.5 at pixel 1"));
        assert!(error(&a, Some(&[0.0, 0.0])).contains("2 are masked"));
        assert!(error(&grey(&[f32::NAN, f32::NAN]), None).contains("2 hold NaN"));
        assert!(Image::new([0, 1], vec![vec![]], Encoding::Linear).is_err());
        assert!(Image::new([2, 1], vec![vec![0.0; 2]; 2], Encoding::Linear).is_err());
    }
}
