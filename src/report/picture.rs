//! Pictures of float images.

use crate::{
    disk::DiskError,
    layers::{srgb, write_png},
};
use image::{Rgb, RgbImage};
use std::path::Path;

/// Where there is no value: no surface, or a pixel of Q that is too noisy.
const NOTHING: Rgb<u8> = Rgb([132, 160, 196]);

/// Paints each value as a square of `scale` pixels.
fn paint(values: &[f32], [width, height]: [u32; 2], scale: u32, grey: impl Fn(f32) -> u8) -> RgbImage {
    RgbImage::from_fn(width * scale, height * scale, |x, y| {
        let value = values[((y / scale) * width + x / scale) as usize];
        if value.is_nan() { NOTHING } else { Rgb([grey(value); 3]) }
    })
}

/// Openness as engines show it: the grey level is the value, 0 black and 1 white,
/// without a transfer curve.
pub fn openness(values: &[f32], resolution: [u32; 2], scale: u32, path: &Path) -> Result<(), DiskError> {
    let grey = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
    write_png(path, &paint(values, resolution, scale, grey))
}

/// Light: exposed so that the 98th percentile is white, then encoded as sRGB.
pub fn irradiance(values: &[f32], resolution: [u32; 2], path: &Path) -> Result<(), DiskError> {
    let white = white(values.iter().copied());
    write_png(path, &paint(values, resolution, 1, |v| srgb(v / white)))
}

/// Coloured light, exposed by the brightest channel of each pixel as in
/// [`irradiance`].
pub fn light(colors: &[[f32; 3]], [width, height]: [u32; 2], path: &Path) -> Result<(), DiskError> {
    let white = white(colors.iter().map(|[r, g, b]| r.max(*g).max(*b)));
    let picture = RgbImage::from_fn(width, height, |x, y| {
        let color = colors[(y * width + x) as usize];
        if color.iter().any(|c| c.is_nan()) { NOTHING } else { Rgb(color.map(|c| srgb(c / white))) }
    });
    write_png(path, &picture)
}

/// The 98th percentile of what is finite.
fn white(values: impl Iterator<Item = f32>) -> f32 {
    let mut sorted: Vec<f32> = values.filter(|v| v.is_finite()).collect();
    sorted.sort_by(f32::total_cmp);
    sorted.get(sorted.len() * 98 / 100).copied().unwrap_or(1.0).max(f32::MIN_POSITIVE)
}
