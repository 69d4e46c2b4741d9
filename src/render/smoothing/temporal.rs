//! Accumulation over frames with reprojection, after Schied et al.,
//! "Spatiotemporal Variance-Guided Filtering", HPG 2017. Twin:
//! `gpu/shaders/temporal.wgsl`.
//!
//! A point that a pixel sees is sought in the frame before: there it was at the
//! pixel's place, moved by W'(p) - W(p), W and W' the way from points to the image
//! now and then. History h, of n' frames, is fetched from the four texels about
//! that place, by bilinear weights, over those that show the same surface: no
//! further from the tangent plane than a pixel's footprint, and facing the same
//! way within 25 degrees. Then n = n' + 1, alpha = max(1/n, blend), and the pixel
//! holds h + alpha (o - h). Without such texels n = 1: the pixel begins anew.

use super::{Shot, above_zero, within};
use crate::render::{gbuffer::Surface, sampler::combine};
use aogauge_scenes::View;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Accumulation over frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Temporal {
    /// Frames that are rendered, each with random numbers of its own: 2 to 256; 16.
    pub frames: u32,
    /// The least share of a new frame, above 0 and at most 1; 0.1. As long as 1/n
    /// is above it, the image is the mean of its n frames.
    pub blend: f32,
    /// Pixels that the camera moves by in a frame, along columns and rows, each -64
    /// to 64; 0. The last frame is taken where the job's view is: the camera slides
    /// where it is orthographic and turns where it is perspective.
    pub motion: [f32; 2],
}

impl Default for Temporal {
    fn default() -> Self {
        Temporal { frames: 16, blend: 0.1, motion: [0.0; 2] }
    }
}

/// Parts that the way between two pixels is divided into. Texture units have 8 bits
/// here, too; and rounding errors of the way, which differ between devices, mostly
/// vanish.
const SUBPIXELS: f32 = 256.0;

/// The least cosine between the normals of one surface in two frames: of 25
/// degrees.
const SAME_WAY: f32 = 0.9;

/// The least weight of texels that show the surface.
const LEAST_WEIGHT: f32 = 0.01;

impl Temporal {
    pub(super) fn check(&self) -> Result<(), String> {
        within("temporal.frames", self.frames, 2, 256)?;
        above_zero("temporal.blend", self.blend, 1.0)?;
        self.motion.into_iter().try_for_each(|m| within("temporal.motion", m, -64.0, 64.0))
    }

    /// Where the camera was `age` frames before the last.
    #[must_use]
    pub fn view(&self, last: &View, age: u32) -> View {
        if age == 0 { *last } else { last.moved(self.motion.map(|m| -m * age as f32)) }
    }

    /// The seed of the frame that is `age` frames before the last, which has the
    /// job's own.
    pub fn seed(seed: u32, age: u32) -> u32 {
        if age == 0 { seed } else { combine(seed, age) }
    }
}

/// What was accumulated: a value a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// Openness; NaN where no surface is seen.
    pub values: Vec<f32>,
    /// n, frames that it is made of; 0 where no surface is seen, a mean of its
    /// texels' after a move.
    pub lengths: Vec<f32>,
}

/// Adds the openness of a frame to what was accumulated before it.
pub fn accumulate(blend: f32, now: Shot<'_>, openness: &[f32], past: Option<(Shot<'_>, &History)>) -> History {
    let width = now.gbuffer.resolution[0];
    let pixel = |(index, surface): (usize, &Option<Surface>)| {
        let Some(surface) = surface else {
            return (f32::NAN, 0.0);
        };
        let here = [index as u32 % width, index as u32 / width];
        let fetched = past.and_then(|(shot, history)| fetch(now, here, surface, shot, history));
        let (before, length) = fetched.unwrap_or((openness[index], 0.0));
        let n = length + 1.0;
        (before + (1.0 / n).max(blend) * (openness[index] - before), n)
    };
    let surfaces = now.gbuffer.surfaces.par_iter().enumerate().with_min_len(256);
    let (values, lengths) = surfaces.map(pixel).unzip();
    History { values, lengths }
}

/// History of a surface and its length; None where it was not seen.
fn fetch(now: Shot<'_>, [x, y]: [u32; 2], surface: &Surface, past: Shot<'_>, history: &History) -> Option<(f32, f32)> {
    let way = past.camera.place(surface.point)? - now.camera.place(surface.point)?;
    let way = (way * SUBPIXELS + 0.5).floor() / SUBPIXELS;
    let base = way.floor();
    let part = way - base;
    let footprint = now.camera.footprint(surface.point);
    let (mut weights, mut value, mut length) = (0.0, 0.0, 0.0);
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let weight = (if dx == 0 { 1.0 - part.x } else { part.x }) * (if dy == 0 { 1.0 - part.y } else { part.y });
        let texel = past.surface(i64::from(x) + base.x as i64 + dx, i64::from(y) + base.y as i64 + dy);
        if let Some((index, _)) = texel.filter(|(_, s)| is_same(surface, s, footprint)) {
            weights += weight;
            value += weight * history.values[index];
            length += weight * history.lengths[index];
        }
    }
    (weights >= LEAST_WEIGHT).then(|| (value / weights, length / weights))
}

/// Whether a texel shows the surface, too.
fn is_same(surface: &Surface, texel: &Surface, footprint: f32) -> bool {
    surface.normal.dot(texel.point - surface.point).abs() <= footprint && surface.normal.dot(texel.normal) >= SAME_WAY
}
