//! Local indirect light (the paper's Eq. 3 and 4): a ray sees ambient light of
//! radiance 1 as far as it is open, and the light of its occluder as far as it is
//! not: mu(d) + (1 - mu(d)) L(o). What an occluder sends out is its own emission
//! and what it reflects of the same kind of light, so L is followed by one more ray
//! at a time until Russian roulette ends it. The mean over rays is O + I.
//!
//! Rays of a point go side by side, bounce by bounce: random numbers and directions eight
//! at a time, closest hits eight in a call. What has ended makes room, so that the lanes
//! stay full. Each ray has the bits that it has alone.

use super::{Geometry, LocalIndirect, ao::cosine_distributed, gbuffer::Surface, sampler::Sampler};
use crate::trace::{Hit, Packet, Segments};
use aogauge_scenes::AoScale;
use glam::{DVec3, Vec3};
use pulp::{Arch, NullaryFnOnce};

/// Where the random numbers for Russian roulette begin, beyond those of bounces.
const ROULETTE: u32 = 0x4000_0000;

/// The most rays that go together.
const MOST: usize = 32;

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
    for first in (0..rays).step_by(MOST) {
        let mut light = [Vec3::ZERO; MOST];
        let light = &mut light[..((rays - first) as usize).min(MOST)];
        trace(&Setting { geometry, method, radius, sampler }, surface, first, light);
        light.iter().for_each(|l| sum += l.as_dvec3());
    }
    (sum / f64::from(rays)).as_vec3().to_array()
}

/// What all rays of a point share.
struct Setting<'a> {
    geometry: &'a Geometry,
    method: &'a LocalIndirect,
    radius: f32,
    sampler: &'a Sampler,
}

/// Eight rays that have not ended.
#[derive(Clone, Copy)]
struct Eight {
    /// Which ray each is.
    samples: [u32; 8],
    points: Packet,
    normals: Packet,
    throughputs: Packet,
    sums: Packet,
    /// Of this bounce: where they go, and the numbers for Russian roulette.
    rays: Segments,
    roulette: [f32; 8],
}

/// Draws a bounce, compiled for AVX2 too. Multiplications and additions are not fused in
/// either, so the bits are the same.
struct Draw<'a> {
    eights: &'a mut [Eight],
    bounce: u32,
    sampler: &'a Sampler,
    offset: f32,
}

impl NullaryFnOnce for Draw<'_> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // lanes
    fn call(self) {
        let Draw { eights, bounce, sampler, offset } = self;
        let samplers = [*sampler; 8];
        for eight in eights {
            let mut pairs = [[0.0; 8]; 2];
            Sampler::pairs_of(&samplers, &eight.samples, 8, ROULETTE + bounce, &mut pairs);
            eight.roulette = pairs[0];
            Sampler::pairs_of(&samplers, &eight.samples, 8, bounce, &mut pairs);
            for lane in 0..8 {
                let (point, normal) = (eight.points.get(lane), eight.normals.get(lane));
                eight.rays.origins.set(lane, point + normal * offset);
                eight.rays.directions.set(lane, cosine_distributed(normal, [pairs[0][lane], pairs[1][lane]]).0);
            }
        }
    }
}

/// The light of rays `first` and following, of which there are at most [`MOST`].
fn trace(setting: &Setting<'_>, surface: &Surface, first: u32, light: &mut [Vec3]) {
    let Setting { geometry, method, radius, sampler } = *setting;
    let tracer = &geometry.tracer;
    let start = Eight {
        samples: [first; 8],
        points: Packet::splat(surface.point),
        normals: Packet::splat(surface.normal),
        throughputs: Packet::splat(Vec3::ONE),
        sums: Packet::splat(Vec3::ZERO),
        rays: Segments { tmax: [method.falloff.reach(radius); 8], ..Segments::EMPTY },
        roulette: [0.0; 8],
    };
    let mut eights = [start; MOST / 8];
    for i in 0..MOST {
        eights[i / 8].samples[i % 8] = first + i as u32;
    }
    let mut count = light.len().min(MOST);
    for bounce in 0u32.. {
        if count == 0 {
            return;
        }
        let packs = &mut eights[..count.div_ceil(8)];
        Arch::new().dispatch(Draw { eights: packs, bounce, sampler, offset: tracer.offset() });
        let mut kept = 0;
        for from in (0..count).step_by(8) {
            let lanes = (count - from).min(8);
            let hits = tracer.closest_of(&eights[from / 8].rays, 0xff >> (8 - lanes));
            for lane in 0..lanes {
                let eight = &eights[from / 8];
                let sample = eight.samples[lane];
                let at = [eight.throughputs.get(lane), eight.sums.get(lane)];
                match arrive(setting, hits.get(lane).as_ref(), at, eight.roulette[lane]) {
                    Ok((at, hit)) => {
                        eights[kept / 8].keep(kept % 8, sample, at, hit);
                        kept += 1;
                    }
                    Err(sum) => light[(sample - first) as usize] = sum,
                }
            }
        }
        count = kept;
    }
}

/// What a ray with a throughput and a sum so far has where it arrives, to go on from there;
/// its light where it ends.
#[inline(always)]
fn arrive<'a>(
    setting: &Setting<'_>,
    hit: Option<&'a Hit>,
    [mut throughput, mut sum]: [Vec3; 2],
    roulette: f32,
) -> Result<([Vec3; 2], &'a Hit), Vec3> {
    let Setting { geometry, method, radius, .. } = *setting;
    let hit = hit.ok_or(sum + throughput)?;
    let mu = method.falloff.mu(hit.t, radius);
    sum += throughput * mu;
    throughput *= 1.0 - mu;
    sum += throughput * geometry.emitted(hit.triangle);
    throughput *= geometry.albedo(hit.triangle);
    let survival = throughput.max_element().min(0.95);
    if roulette >= survival {
        return Err(sum);
    }
    Ok(([throughput / survival, sum], hit))
}

impl Eight {
    /// Puts a ray down where it goes on.
    #[inline(always)]
    fn keep(&mut self, lane: usize, sample: u32, [throughput, sum]: [Vec3; 2], hit: &Hit) {
        self.samples[lane & 7] = sample;
        self.throughputs.set(lane, throughput);
        self.sums.set(lane, sum);
        self.points.set(lane, hit.point);
        self.normals.set(lane, hit.normal);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::{Falloff, Scale, gbuffer::GBuffer},
        scenes::library,
        trace::Ray,
    };

    /// One ray at a time: what rays side by side are held against.
    fn one(setting: &Setting<'_>, surface: &Surface, index: u32) -> Vec3 {
        let Setting { geometry, method, radius, sampler } = *setting;
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

    /// All numbers of rays, with and without falloff and lamps, with AVX2 and without.
    #[test]
    fn rays_side_by_side_have_the_bits_of_one_by_one() {
        for (name, falloff) in [
            ("curtain-arcade", Falloff::Step),
            ("ceiling-light", Falloff::Exponential { extinction: 0.3 }),
            ("leaves", Falloff::Quadratic),
        ] {
            let scene = library::scene(name).unwrap();
            let geometry = Geometry::new(&scene).unwrap();
            let portable = Geometry { tracer: geometry.tracer.clone().portable(), ..geometry.clone() };
            let surfaces = GBuffer::new(&geometry.tracer, &scene.measure.view()).surfaces;
            let method = LocalIndirect { falloff, scale: Scale::default() };
            let mut partly = 0;
            for (pixel, s) in surfaces.iter().enumerate().filter_map(|(i, s)| Some((i, s.as_ref()?))).step_by(41) {
                let sampler = Sampler::new(3, pixel as u32, 1);
                let rays = [1, 7, 8, 9, 31, 32, 33, 100][pixel % 8];
                for geometry in [&geometry, &portable] {
                    let setting = Setting { geometry, method: &method, radius: scene.ao.radius, sampler: &sampler };
                    let expected: DVec3 = (0..rays).map(|i| one(&setting, s, i).as_dvec3()).sum();
                    let expected = (expected / f64::from(rays)).as_vec3().to_array();
                    let light = incident(geometry, s, scene.ao, &method, rays, &sampler);
                    assert_eq!(light.map(f32::to_bits), expected.map(f32::to_bits), "{name} {pixel}");
                    partly += u32::from(light[0] != 1.0);
                }
            }
            assert!(partly > 20, "{name}: {partly}");
        }
    }
}
