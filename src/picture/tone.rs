//! Exposure and tone mapping: linear light to sRGB.

use crate::{layers::srgb, scenes::luminance};
use glam::Vec3;
use image::{Rgb, RgbImage};

/// The level that automatic exposure brings the mean of what is seen to: middle
/// grey.
const KEY: f64 = 0.18;
/// Least share of the brightest hundredth that counts in that mean, so that a
/// black corner does not bleach the picture.
const LEAST: f32 = 1e-3;

/// The factor that brings the mean of the logarithm of luminance to middle grey
/// (Reinhard, Stark, Shirley and Ferwerda, "Photographic Tone Reproduction for
/// Digital Images", SIGGRAPH 2002); 1 where nothing shines.
pub fn automatic_exposure(colors: impl Iterator<Item = Vec3>) -> f32 {
    let mut levels: Vec<f32> = colors.map(|c| luminance(c.to_array())).filter(|l| l.is_finite()).collect();
    levels.sort_by(f32::total_cmp);
    let bright = levels.get(levels.len() * 99 / 100).copied().unwrap_or(0.0);
    if bright <= 0.0 {
        return 1.0;
    }
    let logs: f64 = levels.iter().map(|l| f64::from(l.max(bright * LEAST)).ln()).sum();
    (KEY / (logs / levels.len() as f64).exp()) as f32
}

/// Khronos PBR Neutral, 2024: colours of matte surfaces below 0.76 stay as they
/// are but for the 0.04 that a coat adds; what is brighter rolls off to white and
/// keeps its hue (<https://github.com/KhronosGroup/ToneMapping>).
pub fn neutral(color: Vec3) -> Vec3 {
    const COAT: f32 = 0.04;
    const KNEE: f32 = 0.8 - COAT;
    const FADING: f32 = 0.15;
    let least = color.min_element();
    let coat = if least < 2.0 * COAT { least - least * least / (4.0 * COAT) } else { COAT };
    let color = color - coat;
    let peak = color.max_element();
    if peak <= KNEE {
        return color;
    }
    let held = 1.0 - (1.0 - KNEE) * (1.0 - KNEE) / (peak + 1.0 - 2.0 * KNEE);
    let kept = 1.0 / (FADING * (peak - held) + 1.0);
    Vec3::splat(held).lerp(color * (held / peak), kept)
}

/// The picture: light times `exposure`, tone-mapped, as sRGB. `light` is asked for
/// each pixel, row by row.
pub fn developed([width, height]: [u32; 2], exposure: f32, light: impl Fn(usize) -> Vec3) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let color = light(y as usize * width as usize + x as usize);
        Rgb(neutral(color * exposure).to_array().map(srgb))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matte_colours_keep_their_value_and_highlights_their_hue() {
        let matte = Vec3::new(0.7, 0.3, 0.1);
        assert!((neutral(matte) - (matte - 0.04)).length() < 1e-6);
        assert_eq!(neutral(Vec3::ZERO), Vec3::ZERO);
        let mut last = Vec3::ZERO;
        for step in 1..60 {
            let found = neutral(matte * (step as f32 * 0.2));
            assert!(found.cmpge(last).all() && found.max_element() < 1.0, "{step}: {found}");
            last = found;
        }
        let bright = neutral(Vec3::new(4.0, 1.0, 0.0));
        // By hand: least 0, so no coat; held = 1 - 0.0576 / 3.48, kept = 1 / (0.15 (4 - held) + 1).
        assert!((bright.x - 0.983_448).abs() < 1e-5, "{bright}");
        assert!((bright.z - 0.983_448 * (1.0 - 1.0 / 1.452_483)).abs() < 1e-4, "{bright}");
    }

    #[test]
    fn exposure_brings_the_mean_to_middle_grey() {
        let exposure = |levels: &[f32]| automatic_exposure(levels.iter().map(|&l| Vec3::splat(l)));
        assert!((exposure(&[2.0; 9]) - 0.09).abs() < 1e-6);
        assert!((exposure(&[1.0, 4.0]) - 0.09).abs() < 1e-6, "the geometric mean");
        assert_eq!(exposure(&[0.0; 4]), 1.0);
        assert!(exposure(&[1.0, 1.0, 1.0, 0.0]).is_finite());
    }
}
