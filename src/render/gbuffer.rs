//! What a view sees: the receiver points.

use crate::trace::{Ray, Tracer};
use aogauge_scenes::View;
use glam::Vec3;
use rayon::prelude::*;

/// A point to shade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// On the surface, metres.
    pub point: Vec3,
    /// Unit geometric normal, towards the viewer.
    pub normal: Vec3,
    /// The triangle, as numbered when the tracer was built.
    pub triangle: u32,
}

/// The surface behind each pixel's centre, row by row from the top left.
#[derive(Clone, Debug)]
pub struct GBuffer {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// None where the view sees the sky.
    pub surfaces: Vec<Option<Surface>>,
}

/// Longer than any scene.
pub const FAR_AWAY: f32 = 1e30;

impl GBuffer {
    /// Traces one ray through the centre of each pixel.
    pub fn new(tracer: &Tracer, view: &View) -> Self {
        let width = view.resolution[0];
        let surfaces = (0..view.pixels() as u32)
            .into_par_iter()
            .map(|pixel| {
                let (origin, direction) = view.ray(pixel % width, pixel / width);
                tracer.closest(&Ray::new(origin, direction, FAR_AWAY)).map(|hit| Surface {
                    point: hit.point,
                    normal: hit.normal,
                    triangle: hit.triangle,
                })
            })
            .collect();
        GBuffer { resolution: view.resolution, surfaces }
    }

    /// The triangle that each pixel sees; `u32::MAX` for none.
    pub(super) fn triangles(&self) -> Vec<u32> {
        self.surfaces.iter().map(|s| s.map_or(u32::MAX, |s| s.triangle)).collect()
    }
}
