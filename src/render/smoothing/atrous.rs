//! The edge-avoiding a-trous wavelet of Dammertz et al., "Edge-Avoiding A-Trous
//! Wavelet Transform for fast Global Illumination Filtering", HPG 2010. Twin:
//! `gpu/shaders/atrous.wgsl`.
//!
//! Pass i = 0, 1, ... is a 5 x 5 B3 spline h whose taps stand 2^i pixels apart:
//!
//! o'(p) = sum_q h(q - p) w(p, q) o(q) / sum_q h(q - p) w(p, q),
//! w(p, q) = exp(-|n_p - n_q|^2 / normal^2 - (n_p (x_q - x_p) / (plane f))^2 - (o_p - o_q)^2 / (openness / 2^i)^2),
//!
//! n the normals, x the points, f the footprint of the pixel p in metres. The paper
//! weighs by the distance of points; the distance from the tangent plane does not
//! stop at slanted surfaces. The openness term narrows by half each pass, as there,
//! and is not scaled by a variance: with a handful of rays no pixel knows its own.

use super::{Shot, above_zero, within};
use crate::render::gbuffer::Surface;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The spatial filter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Denoise {
    /// How often it is applied, the taps twice as far apart each time: 1 to 8; 4.
    pub passes: u32,
    /// Difference of unit normals at which a weight falls to 1/e, above 0 and at
    /// most 2; 0.125, about 7 degrees.
    pub normal: f32,
    /// Distance from the tangent plane at which it does, in pixels' footprints,
    /// above 0 and at most 1000; 1.
    pub plane: f32,
    /// Difference of openness at which it does in the first pass, above 0 and at
    /// most 100; 0.5. 100 takes no notice of openness.
    pub openness: f32,
}

impl Default for Denoise {
    fn default() -> Self {
        Denoise { passes: 4, normal: 0.125, plane: 1.0, openness: 0.5 }
    }
}

impl Denoise {
    pub(super) fn check(&self) -> Result<(), String> {
        within("denoise.passes", self.passes, 1, 8)?;
        above_zero("denoise.normal", self.normal, 2.0)?;
        above_zero("denoise.plane", self.plane, 1000.0)?;
        above_zero("denoise.openness", self.openness, 100.0)
    }

    /// The difference of openness that pass `pass` weighs by.
    pub(in crate::render) fn openness_at(&self, pass: u32) -> f32 {
        self.openness / (1u32 << pass) as f32
    }
}

/// The B3 spline.
const SPLINE: [f32; 5] = [1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];

/// Filters an image of openness, a value a pixel; what sees no surface stays NaN
/// and counts nowhere.
pub fn filter(denoise: &Denoise, shot: Shot<'_>, openness: &[f32]) -> Vec<f32> {
    (0..denoise.passes).fold(openness.to_vec(), |values, pass| {
        let surfaces = shot.gbuffer.surfaces.par_iter().enumerate().with_min_len(256);
        let pixel = |(index, surface): (usize, &Option<Surface>)| match surface {
            Some(surface) => filtered(denoise, pass, shot, &values, index, surface),
            None => f32::NAN,
        };
        surfaces.map(pixel).collect()
    })
}

fn filtered(denoise: &Denoise, pass: u32, shot: Shot<'_>, values: &[f32], index: usize, surface: &Surface) -> f32 {
    let width = shot.gbuffer.resolution[0] as usize;
    let (x, y) = ((index % width) as i64, (index / width) as i64);
    let step = 1i64 << pass;
    let plane = denoise.plane * shot.camera.footprint(surface.point);
    let sigma = denoise.openness_at(pass);
    let (mut weights, mut sum) = (0.0, 0.0);
    for (dy, row) in (-2..=2).zip(SPLINE) {
        for (dx, column) in (-2..=2).zip(SPLINE) {
            let Some((tap, other)) = shot.surface(x + dx * step, y + dy * step) else {
                continue;
            };
            let turned = (other.normal - surface.normal) / denoise.normal;
            let away = surface.normal.dot(other.point - surface.point) / plane;
            let apart = (values[tap] - values[index]) / sigma;
            let weight = row * column * (-(turned.dot(turned) + away * away + apart * apart)).exp();
            weights += weight;
            sum += weight * values[tap];
        }
    }
    sum / weights
}
