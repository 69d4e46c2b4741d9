//! Rays of a shaded point decided together: directions eight at a time, all primary
//! rays by one walk of the tree, then the secondary rays of those that are open. What
//! `decide` says of each, bit by bit.

use super::{Decided, Primary, Shading};
use crate::{
    render::sampler::{Sampler, turn},
    trace::{Packet, Queue},
};
use pulp::{Arch, NullaryFnOnce};

/// The most rays that go together.
pub(super) const MOST: usize = Queue::MOST;

/// Eight rays in the frame of a surface, side by side.
#[derive(Clone, Copy)]
struct Eight {
    turn: [[f32; 8]; 2],
    tilt: [[f32; 8]; 2],
    /// Numbers left to chance.
    shift: [[f32; 8]; 2],
}

impl Eight {
    const NONE: Eight = Eight { turn: [[0.0; 8]; 2], tilt: [[0.0; 8]; 2], shift: [[0.0; 8]; 2] };
}

/// The work of drawing a group, compiled for AVX2 too. Multiplications and additions are
/// not fused in either, so the bits are the same.
struct Draw<'a> {
    shading: &'a Shading<'a>,
    sampler: &'a Sampler,
    first: u32,
    chance: bool,
    drawn: &'a mut [Eight],
    directions: &'a mut [Packet; 4],
}

impl NullaryFnOnce for Draw<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Shading { frame: [t, b], normal, .. } = *self.shading;
        for (pack, (eight, direction)) in self.drawn.iter_mut().zip(self.directions).enumerate() {
            let first = self.first + 8 * pack as u32;
            let [u, v] = self.sampler.pairs(first, 0);
            for lane in 0..8 {
                let [cos_phi, sin_phi] = turn(v[lane]);
                let (sin_theta, cos_theta) = (u[lane].sqrt(), (1.0 - u[lane]).sqrt());
                for axis in 0..3 {
                    let along = t[axis] * cos_phi + b[axis] * sin_phi;
                    direction.0[axis][lane] = along * sin_theta + normal[axis] * cos_theta;
                }
                eight.turn[0][lane] = cos_phi;
                eight.turn[1][lane] = sin_phi;
                eight.tilt[0][lane] = sin_theta;
                eight.tilt[1][lane] = cos_theta;
            }
            if self.chance {
                eight.shift = self.sampler.pairs(first, 1);
            }
        }
    }
}

/// Secondary rays that wait for their walk.
struct Waiting {
    queue: Queue,
    /// Which primary ray each is of, and which of its secondary rays.
    of: [(u8, u8); MOST],
}

impl Shading<'_> {
    /// Decides samples `first` and following, at most [`MOST`], of a method without
    /// falloff.
    pub(super) fn decide_together(&self, first: u32, sampler: &Sampler, decided: &mut [Decided]) {
        let packs = decided.len().div_ceil(8).min(4);
        let mut drawn = [Eight::NONE; 4];
        let mut directions = [Packet::splat(self.normal); 4];
        let drawn = &mut drawn[..packs];
        let chance = self.has_chance();
        Arch::new().dispatch(Draw { shading: self, sampler, first, chance, drawn, directions: &mut directions });

        let all = u32::MAX >> (32 - decided.len().clamp(1, 32));
        let hit = self.occluded_together(&directions, packs, all);
        let extension = self.method.extension;
        let secondary_rays = extension.map_or(0, |e| e.secondary_rays);
        for (i, decided) in decided.iter_mut().enumerate() {
            let hit = hit >> i & 1 == 1;
            *decided = Decided { hit, mu: f32::from(u8::from(!hit)), closed: 0, secondary_rays };
        }
        let Some(extension) = extension else { return };
        let mut waiting = Waiting { queue: Queue::default(), of: [(0, 0); MOST] };
        let [t, b] = self.frame;
        let mut open = all & !hit;
        while open != 0 {
            let i = open.trailing_zeros() as usize;
            open &= open - 1;
            let (of, lane) = (&drawn[i / 8], i % 8);
            let turn = of.turn.map(|v| v[lane]);
            let primary = Primary {
                turn,
                tilt: of.tilt.map(|v| v[lane]),
                along: t * turn[0] + b * turn[1],
                direction: directions[i / 8].get(lane),
            };
            let shift = of.shift.map(|v| v[lane]);
            let fan = self.fan(primary, self.ao.radius, shift, extension);
            for k in 0..secondary_rays {
                fan.segment(self, k, shift[1], extension).rays(self.method.faces, |origin, direction, length| {
                    waiting.of[waiting.queue.count() % MOST] = (i as u8, k as u8);
                    waiting.queue.push(origin, direction, length);
                    if waiting.queue.is_full() {
                        self.close(&mut waiting, decided);
                    }
                });
            }
        }
        self.close(&mut waiting, decided);
    }

    /// Which primary rays meet something within R.
    fn occluded_together(&self, directions: &[Packet; 4], packs: usize, mask: u32) -> u32 {
        let (origin, normal) = (self.origin, self.normal);
        let fan = crate::trace::Fan { origin, normal, tmax: self.ao.radius, faces: self.method.faces };
        let [a, b, ..] = *directions;
        match packs {
            1 => self.tracer.occluded_from(&fan, &[a], mask),
            2 => self.tracer.occluded_from(&fan, &[a, b], mask),
            _ => self.tracer.occluded_from(&fan, directions, mask),
        }
    }

    /// Traces what waits.
    fn close(&self, waiting: &mut Waiting, decided: &mut [Decided]) {
        let mut closed = waiting.queue.occluded(self.tracer, self.method.faces);
        while closed != 0 {
            let (i, k) = waiting.of[closed.trailing_zeros() as usize];
            closed &= closed - 1;
            decided[usize::from(i)].closed |= 1 << k;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::{
            Extension, Faces, Falloff, Geometry, Openness, ReceiverPlane, SecondaryOrigin, Sides, gbuffer::GBuffer,
        },
        scenes::library::scene,
    };
    use glam::Vec3;

    /// In all variants of secondary rays and numbers of rays, with AVX2 and without.
    #[test]
    fn a_group_decides_as_one_by_one() {
        let mut closed = [[0; 2]; 2];
        for name in ["curtain-arcade", "leaves"] {
            let scene = scene(name).unwrap();
            let fast = Geometry::new(&scene).unwrap().tracer;
            let portable = fast.clone().portable();
            let points = GBuffer::new(&fast, &scene.measure.view()).surfaces;
            let paper = Extension::of_the_paper(ReceiverPlane::Counts);
            let clipped = Extension { receiver_plane: ReceiverPlane::Clipped, ..paper };
            let eight = Extension { secondary_rays: 8, sides: Sides::One, ..clipped };
            let jittered = Extension { secondary_rays: 3, origin: SecondaryOrigin::Jittered, ..clipped };
            let extensions = [None, Some(paper), Some(clipped), Some(eight), Some(jittered)];
            for (pixel, s) in points.iter().enumerate().filter_map(|(i, s)| Some((i, s.as_ref()?))).step_by(97) {
                let rays = [1, 4, 8, 13, 16, 21, 32][pixel % 7];
                for (extension, faces) in extensions.into_iter().flat_map(|e| [(e, Faces::Both), (e, Faces::Front)]) {
                    let method = Openness { extension, faces, ..Openness::plain(Falloff::Step) };
                    let sampler = Sampler::new(3, pixel as u32, 1);
                    for tracer in [&fast, &portable] {
                        let shading = Shading::new(tracer, s.point, s.normal, scene.ao, method);
                        for first in [0, 32, 4096] {
                            let mut decided = vec![Decided::NONE; rays];
                            shading.decide_together(first, &sampler, &mut decided);
                            for (i, decided) in (first..).zip(decided) {
                                let shift = if shading.has_chance() { sampler.pair(i, 1) } else { [0.0; 2] };
                                assert_eq!(decided, shading.decide(sampler.pair(i, 0), shift), "{name} {pixel} {i}");
                                closed[faces as usize][0] += u32::from(decided.hit);
                                closed[faces as usize][1] += decided.closed.count_ones();
                            }
                        }
                    }
                }
            }
        }
        assert!(closed.into_iter().flatten().all(|n| n > 500), "the test must meet something: {closed:?}");
    }

    #[test]
    fn directions_side_by_side_have_the_bits_of_one_by_one() {
        let tracer = crate::trace::Tracer::new(&[]);
        for i in 0..3000u32 {
            let [a, b] = Sampler::new(5, i, 0).pair(0, 0);
            let normal = super::super::cosine_distributed(Vec3::Y, [a, b]).0;
            let normal = if i % 2 == 0 { normal } else { -normal }.normalize();
            let ao = aogauge_scenes::AoScale { radius: 1.0, secondary_radius: 0.25 };
            let shading = Shading::new(&tracer, Vec3::ZERO, normal, ao, Openness::plain(Falloff::Step));
            let sampler = Sampler::new(1, i, 2);
            let (mut drawn, mut directions) = ([Eight::NONE; 4], [Packet::splat(Vec3::X); 4]);
            let draw = Draw {
                shading: &shading,
                sampler: &sampler,
                first: i,
                chance: true,
                drawn: &mut drawn,
                directions: &mut directions,
            };
            Arch::new().dispatch(draw);
            for k in 0..32 {
                let index = i + k as u32;
                let (expected, cosine) = super::super::cosine_distributed(normal, sampler.pair(index, 0));
                assert_eq!(
                    directions[k / 8].get(k % 8).to_array().map(f32::to_bits),
                    expected.to_array().map(f32::to_bits)
                );
                assert_eq!(drawn[k / 8].tilt[1][k % 8], cosine);
                assert_eq!(drawn[k / 8].shift.map(|v| v[k % 8]), sampler.pair(index, 1));
            }
        }
    }
}
