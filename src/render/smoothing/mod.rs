//! What engines do to images of few rays: accumulate them over frames
//! ([`temporal`]) and filter them in space ([`atrous`]). Twin:
//! `gpu/shaders/smoothing.wgsl`.
//!
//! Both work on openness before `intensity`: HDRP denoises first, then takes the
//! power.

pub mod atrous;
pub mod temporal;

pub use atrous::Denoise;
pub use temporal::Temporal;

use super::{
    RenderError,
    gbuffer::{GBuffer, Surface},
};
use aogauge_scenes::{View, WorldToImage};
use glam::{Vec2, Vec3};
use std::fmt::Display;

/// What is done to openness after its rays: first over frames, then in space.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Smoothing {
    /// Accumulation over frames.
    pub temporal: Option<Temporal>,
    /// The spatial filter.
    pub denoise: Option<Denoise>,
}

impl Smoothing {
    /// Rays alone.
    pub const NONE: Smoothing = Smoothing { temporal: None, denoise: None };

    /// Frames that one image is made of.
    pub fn frames(&self) -> u32 {
        self.temporal.map_or(1, |t| t.frames)
    }

    /// Whether every option is in its range.
    ///
    /// # Errors
    /// A sentence that names the option, its value and the range.
    pub fn check(&self) -> Result<(), String> {
        self.temporal.map_or(Ok(()), |t| t.check())?;
        self.denoise.map_or(Ok(()), |d| d.check())
    }
}

/// A number from `low` to `high`.
fn within<T: PartialOrd + Display + Copy>(field: &str, value: T, low: T, high: T) -> Result<(), String> {
    if value >= low && value <= high {
        Ok(())
    } else {
        Err(format!("{field} is {value}: it must be from {low} to {high}"))
    }
}

/// A number above 0 and at most `high`.
fn above_zero(field: &str, value: f32, high: f32) -> Result<(), String> {
    if value > 0.0 && value <= high {
        Ok(())
    } else {
        Err(format!("{field} is {value}: it must be above 0 and at most {high}"))
    }
}

/// A view as filters know it: where points appear, and how large its pixels are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// The way from points to the image.
    pub to_image: WorldToImage,
    /// The longer edge of a pixel: metres, or metres a unit of depth where the view
    /// is perspective.
    pub pixel: f32,
}

impl Camera {
    /// The camera of a view.
    ///
    /// # Errors
    /// [`RenderError::Camera`] for a view that is neither orthographic nor
    /// perspective, or has no extent.
    pub fn new(view: &View) -> Result<Self, RenderError> {
        let to_image = view.world_to_image().ok_or(RenderError::Camera)?;
        let [dx, dy] = if to_image.perspective {
            [view.direction_dx, view.direction_dy]
        } else {
            [view.origin_dx, view.origin_dy]
        };
        Ok(Camera { to_image, pixel: dx.length().max(dy.length()) })
    }

    /// The longer edge, in metres, of a pixel's footprint on a surface that faces
    /// the camera at this point.
    fn footprint(&self, point: Vec3) -> f32 {
        if self.to_image.perspective {
            self.pixel * (self.to_image.to_image * (point - self.to_image.origin)).z
        } else {
            self.pixel
        }
    }

    /// Column and row of a point; None behind the camera.
    fn place(&self, point: Vec3) -> Option<Vec2> {
        self.to_image.at(point).map(Vec3::truncate)
    }
}

/// A camera with what it sees.
#[derive(Clone, Copy, Debug)]
pub struct Shot<'a> {
    /// From where.
    pub camera: Camera,
    /// What.
    pub gbuffer: &'a GBuffer,
}

impl Shot<'_> {
    /// Index and surface of a pixel that sees one; None for others, and outside the
    /// image.
    fn surface(&self, x: i64, y: i64) -> Option<(usize, &Surface)> {
        let [width, height] = self.gbuffer.resolution.map(i64::from);
        if x < 0 || y < 0 || x >= width || y >= height {
            return None;
        }
        let index = (y * width + x) as usize;
        self.gbuffer.surfaces[index].as_ref().map(|s| (index, s))
    }
}
