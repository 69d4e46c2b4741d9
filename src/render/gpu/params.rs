//! What a dispatch is told: view, method, which places and rays.

use super::Constants;
use crate::render::{Estimator, Faces, Falloff, Job, Openness, ReceiverPlane, RenderError, SecondaryOrigin, Sides};
use aogauge_scenes::View;
use bytemuck::{Pod, Zeroable};
use std::ops::Range;

/// `Params` of ao.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Params {
    origin: [f32; 3],
    width: u32,
    origin_dx: [f32; 3],
    first_place: u32,
    origin_dy: [f32; 3],
    places: u32,
    direction: [f32; 3],
    first_ray: u32,
    direction_dx: [f32; 3],
    rays: u32,
    direction_dy: [f32; 3],
    seed: u32,
    replicate: u32,
    radius: f32,
    secondary_radius: f32,
    offset: f32,
    reach: f32,
    height: u32,
    unused: [u32; 2],
    falloff_numbers: [f32; 3],
    unused_too: u32,
}

/// What the GPU computes of an estimator.
#[derive(Clone, Copy)]
pub(super) struct Program {
    /// Falloff, scale and options; those of openness alone are as they would be
    /// anyway where the stage is another.
    pub method: Openness,
    pub stage: Stage,
}

/// The shader's entry points that fill images.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    /// One number a pixel.
    Openness,
    /// Red, green and blue a pixel.
    Indirect,
}

impl Stage {
    /// Numbers a pixel.
    pub fn channels(self) -> u64 {
        match self {
            Stage::Openness => 1,
            Stage::Indirect => 3,
        }
    }
}

/// Places of an image in tile order: those of whole tiles of 8 x 8 pixels.
pub(super) fn places([width, height]: [u32; 2]) -> u32 {
    width.div_ceil(8) * height.div_ceil(8) * 64
}

/// Rays of all kinds that one invocation traces at most. Mesa's software driver
/// stops every loop of an invocation after 65,535 iterations in all, without a
/// word; with these many a ray may take 680 steps. The shader marks pixels where it
/// happened all the same.
const RAYS_AN_INVOCATION: u32 = 96;

/// Rays that a path of local indirect light has, about: half of them end at each
/// bounce.
const RAYS_A_PATH: u32 = 8;

impl Program {
    /// The program of an estimator.
    ///
    /// # Errors
    /// [`RenderError::Unsupported`] for path tracing.
    pub fn new(estimator: &Estimator) -> Result<Self, RenderError> {
        match estimator {
            Estimator::Openness(method) => Ok(Program { method: *method, stage: Stage::Openness }),
            Estimator::LocalIndirect(l) => {
                let method = Openness { scale: l.scale, ..Openness::plain(l.falloff) };
                Ok(Program { method, stage: Stage::Indirect })
            }
            // Screen space has shaders of its own.
            Estimator::ScreenSpace(_) | Estimator::PathTraced => {
                Err(RenderError::Unsupported { renderer: "gpu", kind: estimator.kind(), knows: "all others" })
            }
        }
    }

    /// Primary rays that one invocation traces at most.
    pub fn rays_an_invocation(&self) -> u32 {
        RAYS_AN_INVOCATION / self.rays_a_primary()
    }

    /// Rays of all kinds that a primary ray comes to at most, or about.
    pub fn rays_a_primary(&self) -> u32 {
        if self.stage == Stage::Indirect {
            return RAYS_A_PATH;
        }
        self.method.extension.map_or(1, |e| {
            // Culled, a secondary ray is two.
            let parts = if self.method.faces == Faces::Front && e.sides == Sides::Two { 2 } else { 1 };
            1 + e.secondary_rays * parts
        })
    }

    /// What all dispatches share: constants of the kernel.
    pub fn constants(&self) -> Constants {
        let mut constants = vec![("FALLOFF", numbers(self.method.falloff).0)];
        if self.stage == Stage::Openness {
            constants.push(("OPTIONS", options(&self.method)));
            constants.push(("SECONDARY_RAYS", self.method.extension.map_or(0, |e| e.secondary_rays)));
        }
        constants
    }

    /// What the dispatch over some places and rays of a job is told; `offset` is
    /// how far ray origins are pushed off surfaces.
    pub fn params(&self, job: &Job<'_>, offset: f32, places: Range<u32>, rays: Range<u32>) -> Params {
        let ao = self.method.scale.on(job.ao);
        let (_, falloff_numbers) = numbers(self.method.falloff);
        let View { resolution, origin, origin_dx, origin_dy, direction, direction_dx, direction_dy } = *job.view;
        Params {
            origin: origin.to_array(),
            width: resolution[0],
            origin_dx: origin_dx.to_array(),
            first_place: places.start,
            origin_dy: origin_dy.to_array(),
            places: places.len() as u32,
            direction: direction.to_array(),
            first_ray: rays.start,
            direction_dx: direction_dx.to_array(),
            rays: rays.len() as u32,
            direction_dy: direction_dy.to_array(),
            seed: job.seed,
            replicate: job.replicate,
            radius: ao.radius,
            secondary_radius: ao.secondary_radius,
            offset,
            reach: self.method.reach(ao.radius),
            height: resolution[1],
            unused: [0; 2],
            falloff_numbers,
            unused_too: 0,
        }
    }
}

/// A falloff as the shader takes it.
fn numbers(falloff: Falloff) -> (u32, [f32; 3]) {
    match falloff {
        Falloff::Step => (0, [0.0; 3]),
        Falloff::Exponential { extinction } => (1, [extinction, 0.0, 0.0]),
        Falloff::Quadratic => (4, [0.0; 3]),
        Falloff::LinearTail { tail } => (2, [tail, 0.0, 0.0]),
        Falloff::Gaussian { lambda, floor, reflectance } => (3, [lambda, floor, reflectance]),
    }
}

/// Options as the shader takes them, a bit each.
fn options(method: &Openness) -> u32 {
    let of_extension = method.extension.map_or(0, |e| {
        u32::from(e.receiver_plane == ReceiverPlane::Clipped) << 1
            | u32::from(e.sides == Sides::One) << 2
            | u32::from(e.origin == SecondaryOrigin::Jittered) << 3
            | u32::from(e.is_turned()) << 4
    });
    u32::from(method.faces == Faces::Front) | of_extension
}
