//! Local indirect light (the paper's Eq. 3 and 4): a ray sees ambient light of
//! radiance 1 as far as it is open, and the light of its occluder as far as it is
//! not: mu(d) + (1 - mu(d)) L(o). What an occluder sends out is its own emission
//! and what it reflects of the same kind of light, so L is followed by one more ray
//! at a time until Russian roulette ends it. The mean over rays is O + I.

use super::{Geometry, LocalIndirect, ao::cosine_distributed, gbuffer::Surface, sampler::Sampler};
use crate::trace::Ray;
use aogauge_scenes::AoScale;
use glam::{DVec3, Vec3};

/// Where the random numbers for Russian roulette begin, beyond those of bounces.
const ROULETTE: u32 = 0x4000_0000;

/// O + I of one surface by red, green and blue.
pub fn incident(
    geometry: &Geometry,
    surface: &Surface,
    scene: AoScale,
    method: &LocalIndirect,
    rays: u32,
    sampler: &Sampler,
) -> [f32; 3] {
    let radius = method.scale.on(scene).radius;
    let mut sum = DVec3::ZERO;
    for i in 0..rays {
        sum += ray(geometry, surface, radius, method, i, sampler).as_dvec3();
    }
    (sum / f64::from(rays)).as_vec3().to_array()
}

fn ray(
    geometry: &Geometry,
    surface: &Surface,
    radius: f32,
    method: &LocalIndirect,
    index: u32,
    sampler: &Sampler,
) -> Vec3 {
    let tracer = &geometry.tracer;
    let (mut point, mut normal) = (surface.point, surface.normal);
    let mut throughput = Vec3::ONE;
    let mut sum = Vec3::ZERO;
    for bounce in 0u32.. {
        let (direction, _) = cosine_distributed(normal, sampler.pair(index, bounce));
        let origin = point + normal * tracer.offset();
        let Some(hit) = tracer.closest(&Ray::new(origin, direction, method.falloff.reach(radius))) else {
            return sum + throughput;
        };
        let mu = method.falloff.mu(hit.t, radius);
        sum += throughput * mu;
        throughput *= 1.0 - mu;
        sum += throughput * geometry.emitted(hit.triangle);
        throughput *= geometry.albedo(hit.triangle);
        let survival = throughput.max_element().min(0.95);
        if sampler.pair(index, ROULETTE + bounce)[0] >= survival {
            return sum;
        }
        throughput /= survival;
        (point, normal) = (hit.point, hit.normal);
    }
    sum
}
