//! Many paths side by side, bounce by bounce: random numbers, directions and densities
//! eight at a time, rays at portals in packets. Paths that have ended make room, so that
//! the lanes stay full. Each path has the bits that it has alone: `one.rs`.

use super::{PAIRS, SURE_BOUNCES, aimed, portals, radiance};
use crate::{
    render::{Geometry, ao::cosine_distributed, gbuffer::FAR_AWAY, lights::lambert, sampler::Sampler},
    trace::{Faces, Hit, Packet, Queue, Segments},
};
use aogauge_scenes::Portal;
use glam::Vec3;
use pulp::{Arch, NullaryFnOnce};
use std::f32::consts::PI;

/// The most paths that go together.
pub(super) const MOST: usize = 128;

/// A number for each path.
pub(super) type Lane = [f32; MOST];

/// A vector for each path, by axis.
pub(super) type Vectors = [Lane; 3];

/// One of the vectors.
#[inline(always)]
pub(super) fn at(v: &Vectors, i: usize) -> Vec3 {
    Vec3::new(v[0][i], v[1][i], v[2][i])
}

/// Writes one of them.
#[inline(always)]
pub(super) fn put(v: &mut Vectors, i: usize, value: Vec3) {
    for axis in 0..3 {
        v[axis][i] = value[axis];
    }
}

/// Eight of the vectors.
fn eight(v: &Vectors, first: usize) -> Packet {
    let mut packet = Packet([[0.0; 8]; 3]);
    for (to, from) in packet.0.iter_mut().zip(v) {
        to.copy_from_slice(&from[first..][..8]);
    }
    packet
}

/// Where a path begins, and its random numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub point: Vec3,
    pub normal: Vec3,
    pub sampler: Sampler,
    pub sample: u32,
}

/// Estimates irradiance over pi by one path from each start, of which there are at most
/// [`MOST`].
pub(super) fn trace(geometry: &Geometry, starts: &[Start], light: &mut [Vec3]) {
    let mut batch = Batch::new(starts);
    let lights = &geometry.lights;
    // Where surfaces glow, what a ray at a portal meets must be known.
    let together = if lights.has_emitters() { &[][..] } else { lights.portals() };
    for bounce in 0u32.. {
        if batch.count == 0 {
            return;
        }
        let offset = geometry.tracer.offset();
        Arch::new().dispatch(Draw { batch: &mut batch, bounce, offset, aims: together, portals: lights.portals() });
        if !together.is_empty() {
            batch.aim_together(geometry);
        }
        batch.aim_one_by_one(geometry, bounce);
        batch.go_on(geometry, bounce, light);
    }
}

/// Paths that have not ended, in the first `count` lanes.
#[repr(C, align(32))]
struct Batch {
    samplers: [Sampler; MOST],
    samples: [u32; MOST],
    /// Which start each is of.
    starts: [u32; MOST],
    points: Vectors,
    normals: Vectors,
    throughputs: Vectors,
    sums: Vectors,
    /// Of this bounce: where rays start, where the path goes on and the cosine there, the
    /// density with which portals are aimed at along it, and the number for Russian roulette.
    origins: Vectors,
    directions: Vectors,
    cosines: Lane,
    densities: Lane,
    roulette: Lane,
    /// Ways to a portal, with the same.
    aims: Vectors,
    aim_cosines: Lane,
    aim_densities: Lane,
    count: usize,
}

/// Draws what a bounce needs of random numbers, compiled for AVX2 too. Multiplications and
/// additions are not fused in either, so the bits are the same.
struct Draw<'a> {
    batch: &'a mut Batch,
    bounce: u32,
    offset: f32,
    /// Portals to aim at, and all portals.
    aims: &'a [Portal],
    portals: &'a [Portal],
}

impl NullaryFnOnce for Draw<'_> {
    type Output = ();

    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // lanes
    fn call(self) {
        let Draw { batch: b, bounce, offset, aims, portals } = self;
        // Whole vectors; what lies past the last path is not looked at.
        let count = b.count.next_multiple_of(8).min(MOST);
        for i in 0..count {
            put(&mut b.origins, i, at(&b.points, i) + at(&b.normals, i) * offset);
        }
        let mut pairs = [[0.0; MOST]; 2];
        Sampler::pairs_of(&b.samplers, &b.samples, count, PAIRS * bounce + 1, &mut pairs);
        for i in 0..count {
            let (direction, cosine) = cosine_distributed(at(&b.normals, i), [pairs[0][i], pairs[1][i]]);
            put(&mut b.directions, i, direction);
            b.cosines[i] = cosine;
        }
        portals::densities(portals, count, &b.origins, &b.directions, &mut b.densities);
        if bounce >= SURE_BOUNCES {
            Sampler::pairs_of(&b.samplers, &b.samples, count, PAIRS * bounce + 3, &mut pairs);
            b.roulette = pairs[0];
        }
        if !aims.is_empty() {
            Sampler::pairs_of(&b.samplers, &b.samples, count, PAIRS * bounce, &mut pairs);
            portals::aim(aims, count, [&b.origins, &b.normals], &pairs, &mut b.aims, &mut b.aim_cosines);
            portals::densities(aims, count, &b.origins, &b.aims, &mut b.aim_densities);
        }
    }
}

impl Batch {
    fn new(starts: &[Start]) -> Self {
        let (none, one) = ([[0.0; MOST]; 3], [[1.0; MOST]; 3]);
        let mut batch = Batch {
            samplers: [Sampler::new(0, 0, 0); MOST],
            samples: [0; MOST],
            starts: [0; MOST],
            points: none,
            normals: one,
            throughputs: one,
            sums: none,
            origins: none,
            directions: one,
            cosines: none[0],
            densities: none[0],
            roulette: none[0],
            aims: one,
            aim_cosines: none[0],
            aim_densities: none[0],
            count: starts.len().min(MOST),
        };
        for (i, start) in starts.iter().enumerate().take(MOST) {
            batch.samplers[i] = start.sampler;
            batch.samples[i] = start.sample;
            batch.starts[i] = i as u32;
            put(&mut batch.points, i, start.point);
            put(&mut batch.normals, i, start.normal);
        }
        batch
    }

    /// Adds light to a path's sum, by its throughput.
    #[inline(always)]
    fn add(&mut self, i: usize, light: Vec3) {
        let sum = at(&self.sums, i) + at(&self.throughputs, i) * light;
        put(&mut self.sums, i, sum);
    }

    /// Rays at portals where no surface glows: any hit ends them, so they go together.
    /// Twin: `aimed`.
    fn aim_together(&mut self, geometry: &Geometry) {
        let mut queue = Queue::default();
        let mut waiting = [(0, 0.0); Queue::MOST];
        for i in 0..self.count {
            let (cosine, aimed) = (self.aim_cosines[i], self.aim_densities[i]);
            if cosine > 0.0 && aimed > 0.0 {
                let direction = at(&self.aims, i);
                let own = cosine / PI;
                let light = geometry.environment.sky.radiance(direction) * own / (aimed + own);
                waiting[queue.count()] = (i, light);
                queue.push(at(&self.origins, i), direction, FAR_AWAY);
            }
            if queue.is_full() || i + 1 == self.count {
                let count = queue.count();
                let closed = queue.occluded(&geometry.tracer, Faces::Both);
                for (k, &(lane, light)) in waiting[..count].iter().enumerate() {
                    if closed >> k & 1 == 0 {
                        self.add(lane, Vec3::splat(light));
                    }
                }
            }
        }
    }

    /// All other ways to aim.
    fn aim_one_by_one(&mut self, geometry: &Geometry, bounce: u32) {
        let Geometry { tracer, lights, .. } = geometry;
        for i in 0..self.count {
            let (origin, normal) = (at(&self.origins, i), at(&self.normals, i));
            let (sampler, sample) = (self.samplers[i], self.samples[i]);
            let pair = |which: u32| sampler.pair(sample, PAIRS * bounce + which);
            if lights.has_emitters() {
                let aims = [lights.aim_at_portal(origin, || pair(0)), lights.aim_at_emitter(origin, || pair(2))];
                for aim in aims.into_iter().flatten() {
                    self.add(i, aimed(geometry, origin, normal, aim));
                }
            }
            if let Some(arrival) = lights.punctual(origin, || pair(3)[1]) {
                self.add(i, lambert(&arrival, tracer, origin, normal));
            }
        }
    }

    /// Follows each path to its next vertex. Those that end give their light, the others
    /// move together.
    fn go_on(&mut self, geometry: &Geometry, bounce: u32, light: &mut [Vec3]) {
        let mut kept = 0;
        for first in (0..self.count).step_by(8) {
            let lanes = (self.count - first).min(8);
            let rays = Segments {
                origins: eight(&self.origins, first),
                directions: eight(&self.directions, first),
                tmax: [FAR_AWAY; 8],
            };
            let hits = geometry.tracer.closest_of(&rays, 0xff >> (8 - lanes));
            for lane in 0..lanes {
                let (i, hit) = (first + lane, hits.get(lane));
                match self.arrive(geometry, bounce, i, hit.as_ref()).zip(hit) {
                    Some((throughput, hit)) => {
                        self.keep(kept, i, throughput, &hit);
                        kept += 1;
                    }
                    None => light[self.starts[i] as usize] = at(&self.sums, i),
                }
            }
        }
        self.count = kept;
    }

    /// Adds what a path sees where it arrives. What its throughput is from there on; None
    /// where it ends.
    #[inline(always)]
    fn arrive(&mut self, geometry: &Geometry, bounce: u32, i: usize, hit: Option<&Hit>) -> Option<Vec3> {
        let direction = at(&self.directions, i);
        let mut throughput = at(&self.throughputs, i);
        let radiance = radiance(geometry, direction, hit);
        if radiance != Vec3::ZERO {
            // The share that the bounce has in light which aiming could have found.
            let own = self.cosines[i] / PI;
            let aimed = self.densities[i] + geometry.lights.emitter_density(direction, hit, radiance);
            let sum = at(&self.sums, i) + throughput * radiance * (own / (own + aimed));
            put(&mut self.sums, i, sum);
        }
        let albedo = geometry.albedo(hit?.triangle);
        throughput *= albedo;
        let most = albedo.max_element();
        if most <= 0.0 {
            return None;
        }
        if bounce >= SURE_BOUNCES {
            // Below 1 even for an albedo near 1, so that every path ends.
            let survival = most.min(0.95);
            if self.roulette[i] >= survival {
                return None;
            }
            throughput /= survival;
        }
        Some(throughput)
    }

    /// Moves a path to a lane that is free, and to its next vertex.
    #[inline(always)]
    fn keep(&mut self, to: usize, from: usize, throughput: Vec3, hit: &Hit) {
        self.samplers[to] = self.samplers[from];
        self.samples[to] = self.samples[from];
        self.starts[to] = self.starts[from];
        let sum = at(&self.sums, from);
        put(&mut self.sums, to, sum);
        put(&mut self.throughputs, to, throughput);
        put(&mut self.points, to, hit.point);
        put(&mut self.normals, to, hit.normal);
    }
}
