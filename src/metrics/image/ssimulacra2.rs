//! SSIMULACRA2, by the crate of that name.

use super::{Encoding, Image, Pair};
use crate::metrics::Absent;
use ssimulacra2::{ColorPrimaries, LinearRgb, Rgb, TransferCharacteristic, compute_frame_ssimulacra2};

/// The least width and height it is defined for, pixels.
const LEAST_SIDE: usize = 8;

/// The SSIMULACRA2 score of a pair (Sneyers, Cloudinary 2023): 100 for equal
/// images, about 90 where the eye sees no difference, and below 0 where nothing is
/// alike. It knows no masks.
///
/// # Errors
/// Where an image is smaller than 8 pixels a side, or pixels are masked.
pub(super) fn ssimulacra2(pair: &Pair<'_>) -> Result<f64, Absent> {
    if pair.reference().size().into_iter().min() < Some(LEAST_SIDE) {
        return Err(Absent(format!("SSIMULACRA2 needs {LEAST_SIDE} pixels a side or more")));
    }
    if pair.weights().is_some_and(|w| w.iter().any(|&w| w < 1.0)) {
        return Err(Absent("SSIMULACRA2 knows no masks, and some pixels are masked or hold no number".into()));
    }
    let failed = |e: &dyn std::fmt::Display| Absent(format!("SSIMULACRA2 failed: {e}"));
    let [reference, test] = [pair.reference(), pair.test()].map(linear);
    compute_frame_ssimulacra2(reference?, test?).map_err(|e| failed(&e))
}

fn linear(image: &Image) -> Result<LinearRgb, Absent> {
    let planes = image.planes();
    let [width, height] = image.size();
    let pixel = |i: usize| std::array::from_fn(|c| planes[c.min(planes.len() - 1)][i].clamp(0.0, 1.0));
    let data: Vec<[f32; 3]> = (0..image.pixels()).map(pixel).collect();
    let rgb = match image.encoding() {
        Encoding::Linear => return LinearRgb::new(data, width, height).map_err(|e| Absent(e.to_string())),
        Encoding::Srgb => Rgb::new(data, width, height, TransferCharacteristic::SRGB, ColorPrimaries::BT709),
    };
    LinearRgb::try_from(rgb.map_err(|e| Absent(e.to_string()))?).map_err(|e| Absent(e.to_string()))
}
