//! Full-reference image metrics: how far a test image is from a reference of the
//! same view.
//!
//! All of them take linear `f32` openness or RGB with a stated [`Encoding`], of any
//! size, over a mask of weights, and treat values that are no finite numbers alike
//! ([`NonFinite`]). [`Scores`] has them all; docs/metrics.md shows what each of
//! them catches and misses.

mod fast_math;
mod filter;
mod flip;
mod hdr_flip;
mod pair;
mod pointwise;
mod scores;
mod ssim;
mod ssimulacra2;
mod summary;

pub use flip::{DEFAULT_PPD, flip, pixels_per_degree};
pub use hdr_flip::{Exposures, HdrFlip, hdr_flip};
pub use pair::{NonFinite, Pair};
pub use pointwise::{Pointwise, RELATIVE_EPSILON, absolute_map, pointwise, signed_map};
pub use scores::{Maps, Options, Score, ScoreName, Scores, scores};
pub use ssim::{MS_SSIM_SIDE, SSIM_SIDE, Ssim, ms_ssim, ssim};
pub use summary::{MapSummary, summary};

use crate::counted::counted;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the numbers of an image stand for.
///
/// It decides how FLIP and SSIMULACRA2, which model the eye, get to light; all
/// other metrics take the numbers as they are. Openness written as sRGB codes and
/// as linear light gives different scores, so every report states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Encoding {
    /// Linear light, or openness, which is used like it.
    Linear,
    /// sRGB codes, IEC 61966-2-1, 0 to 1.
    Srgb,
}

impl Encoding {
    /// As it is written in options and reports.
    pub fn label(self) -> &'static str {
        match self {
            Encoding::Linear => "linear",
            Encoding::Srgb => "srgb",
        }
    }
}

/// Why two images cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImageError {
    /// Planes do not hold one value a pixel each.
    #[error("an image of {width} x {height} pixels needs 1 or 3 planes of {} values, got planes of {planes:?}", width * height)]
    Planes {
        /// Pixels a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Values in each plane.
        planes: Vec<usize>,
    },
    /// The images differ in size.
    #[error("the images differ in size: the reference has {} x {} pixels, the test image {} x {}", reference[0], reference[1], test[0], test[1])]
    Size {
        /// Of the reference.
        reference: [usize; 2],
        /// Of the test image.
        test: [usize; 2],
    },
    /// The images differ in their number of channels.
    #[error("the images differ in channels: the reference has {reference}, the test image {test}")]
    Channels {
        /// Of the reference.
        reference: usize,
        /// Of the test image.
        test: usize,
    },
    /// The images differ in what their numbers stand for.
    #[error("the images differ in encoding: the reference is {}, the test image {}", reference.label(), test.label())]
    Encoding {
        /// Of the reference.
        reference: Encoding,
        /// Of the test image.
        test: Encoding,
    },
    /// The mask has another size.
    #[error("the mask has {mask} values, the images have {pixels} pixels")]
    Mask {
        /// Values in the mask.
        mask: usize,
        /// Pixels of the images.
        pixels: usize,
    },
    /// The mask is an image of another size.
    #[error("the mask has {} x {} pixels, the images have {} x {}", mask[0], mask[1], image[0], image[1])]
    MaskSize {
        /// Of the mask.
        mask: [usize; 2],
        /// Of the images.
        image: [usize; 2],
    },
    /// A weight of the mask is no weight.
    #[error("the mask has the weight {weight} at pixel {pixel}; weights are 0 to 1")]
    Weight {
        /// Its place, row by row.
        pixel: usize,
        /// The weight.
        weight: f32,
    },
    /// Nothing is left to compare.
    #[error("no pixel is left to compare: {masked} are masked, {non_finite} hold NaN or infinity")]
    Nothing {
        /// Pixels with weight 0.
        masked: usize,
        /// Pixels without a finite number in either image.
        non_finite: usize,
    },
    /// Values that are no numbers, where a gate needs numbers.
    #[error("NaN or infinity at {} of the reference alone and {test} of the test image alone", counted(*reference, "pixel", "pixels"))]
    NonFinite {
        /// Pixels of the reference whose test value is finite.
        reference: usize,
        /// Pixels of the test image whose reference is finite.
        test: usize,
    },
    /// A number is out of its range.
    #[error("{what} is {value}, it must be {range}")]
    Range {
        /// What the number is.
        what: &'static str,
        /// The number.
        value: f64,
        /// The allowed range.
        range: &'static str,
    },
}

/// An image of one channel (openness, luminance) or three (red, green, blue).
///
/// # Example
/// ```
/// use aogauge::metrics::image::{Encoding, Image, Pair, pointwise};
/// let reference = Image::new([2, 1], vec![vec![0.5, 1.0]], Encoding::Linear)?;
/// let test = Image::new([2, 1], vec![vec![0.25, 1.0]], Encoding::Linear)?;
/// let pair = Pair::new(&reference, &test, None)?;
/// assert_eq!(pointwise(&pair).mae, 0.125);
/// # Ok::<(), aogauge::metrics::image::ImageError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    size: [usize; 2],
    planes: Vec<Vec<f32>>,
    encoding: Encoding,
}

impl Image {
    /// An image from its planes, each row by row from the top left.
    ///
    /// # Errors
    /// [`ImageError::Planes`] unless there are 1 or 3 planes of width x height
    /// values, at least one each.
    pub fn new([width, height]: [usize; 2], planes: Vec<Vec<f32>>, encoding: Encoding) -> Result<Self, ImageError> {
        let pixels = width.checked_mul(height).filter(|&n| n > 0);
        let fits = matches!(planes.len(), 1 | 3) && planes.iter().all(|p| Some(p.len()) == pixels);
        if !fits {
            let planes = planes.iter().map(Vec::len).collect();
            return Err(ImageError::Planes { width, height, planes });
        }
        Ok(Image { size: [width, height], planes, encoding })
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// Width times height.
    pub fn pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// One plane, or red, green and blue.
    pub fn planes(&self) -> &[Vec<f32>] {
        &self.planes
    }

    /// What the numbers stand for.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }
}
