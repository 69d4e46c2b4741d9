//! Every answer of the wide walks against the scalar one: cosine distributed rays, rays
//! along edges and at corners, axis-parallel rays, secondary segments and closest hits, of
//! both faces and of fronts alone, with AVX2 and without.

use super::{Faces, Fan, Packet, Ray, Segments, Tracer};
use crate::{
    render::{
        ao::cosine_distributed,
        gbuffer::{GBuffer, Surface},
        sampler::Sampler,
    },
    scenes::{Scene, View, library},
};
use glam::Vec3;
use std::path::Path;

/// Rays, those that the scalar walk alone meets something on, those that the wide ones
/// alone do, those on which the wide ones differ from each other; and closest hits that
/// are another triangle's, as near as rounding can tell: at an edge, which triangle is
/// left out because another was found first depends on the order of a walk. Of fronts
/// alone, rays that meet nothing but backs are counted, too.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Counts {
    rays: u64,
    missed: u64,
    false_hits: u64,
    differ: u64,
    beside: u64,
    culled: u64,
}

impl Counts {
    fn add(&mut self, truth: u32, fast: u32, portable: u32) {
        self.rays += 32;
        self.missed += u64::from((truth & !fast).count_ones());
        self.false_hits += u64::from((fast & !truth).count_ones());
        self.differ += u64::from((fast ^ portable).count_ones());
    }

    /// A fan of 32 rays, and what the scalar walk says of it.
    fn add_fan(&mut self, [fast, portable]: [&Tracer; 2], fan: &Fan, packets: &[Packet; 4]) -> u32 {
        let ray = |i: usize| Ray::new(fan.origin, packets[i / 8].get(i), fan.tmax);
        let truth = bits(|i| fast.scalar().occluded_by(&ray(i), fan.faces));
        let a = fast.occluded_from(fan, packets, u32::MAX);
        self.add(truth, a, portable.occluded_from(fan, packets, u32::MAX));
        // What one or two packets of it give.
        assert_eq!(fast.occluded_from(fan, &[packets[0]], 0xff), a & 0xff);
        assert_eq!(fast.occluded_from(fan, &[packets[0], packets[1]], 0x1fff), a & 0x1fff);
        truth
    }

    /// As many segments; the first eight one by one, too.
    fn add_segments(&mut self, [fast, portable]: [&Tracer; 2], segments: &[Segments; 4], faces: Faces) -> u32 {
        let ray = |i: usize| {
            let pack = &segments[i / 8];
            Ray::new(pack.origins.get(i), pack.directions.get(i), pack.tmax[i % 8])
        };
        let truth = bits(|i| fast.scalar().occluded_by(&ray(i), faces));
        let [a, b] = [fast, portable].map(|t| t.occluded_segments(segments, u32::MAX, faces));
        self.add(truth, a, b);
        for tracer in [fast, portable] {
            assert_eq!(bits(|i| i < 8 && tracer.occluded_by(&ray(i), faces)), truth & 0xff);
        }
        truth
    }

    /// What was found as nearest: the triangle, where it is known, and the distance.
    fn add_nearest<T: PartialEq>(&mut self, [truth, fast, portable]: [Option<(f32, T)>; 3], offset: f32) {
        self.rays += 1;
        self.missed += u64::from(truth.is_some() && fast.is_none());
        self.differ += u64::from(fast != portable);
        if let Some((t, _)) = &fast
            && fast != truth
        {
            let beside = truth.is_some_and(|(of, _)| (t - of).abs() <= offset);
            self.beside += u64::from(beside);
            self.false_hits += u64::from(!beside);
        }
    }
}

/// What is seen from the eye of the look view in six directions, and in the measure view.
fn points(scene: &Scene, tracer: &Tracer, side: u32) -> Vec<Surface> {
    let eye = scene.look.eye;
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let up = |d: Vec3| if d.y == 0.0 { Vec3::Y } else { Vec3::X };
    let about = axes.map(|d| View::perspective(eye, eye + d, up(d), 92f32.to_radians(), [side; 2]));
    let views = about.into_iter().chain([scene.measure.view()]);
    views.flat_map(|view| GBuffer::new(tracer, &view).surfaces).flatten().collect()
}

/// 32 unit directions from a point, none against its normal.
fn directions(tracer: &Tracer, origin: Vec3, normal: Vec3, group: u32) -> [Vec3; 32] {
    let sampler = Sampler::new(99, group, 0);
    let cosine = |i: u32, dimension: u32| cosine_distributed(normal, sampler.pair(i, dimension)).0;
    // Triangles that are seen from the point, and their neighbours in the tree, to aim at.
    let aim = |i: u32| {
        let seen = tracer.scalar().closest(&Ray::new(origin, cosine(i, 4), 1e30)).map_or(0, |h| h.leaf as usize);
        let beside = (sampler.pair(i, 3)[0] * 4.0) as usize;
        tracer.triangles()[(seen + beside).min(tracer.triangles().len() - 1)]
    };
    let odd = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::new(1.0, 1.0, 0.0)];
    std::array::from_fn(|i| {
        let i = i as u32;
        let towards = match group % 5 {
            0 | 1 => cosine(i, 0),
            2 => {
                let [a, b, _] = aim(i);
                a + (b - a) * sampler.pair(i, 5)[0] - origin
            }
            3 => aim(i)[i as usize % 3] - origin,
            _ if i < 7 => odd[i as usize],
            _ => {
                let c = cosine(i, 0);
                Vec3::new(c.x, if i.is_multiple_of(2) { 0.0 } else { c.y }, if i.is_multiple_of(3) { 0.0 } else { c.z })
            }
        };
        let direction = towards.normalize_or(normal);
        if direction.dot(normal) < 1e-4 { cosine(i, 6) } else { direction }
    })
}

/// The first eight directions as rays without end.
fn eight(origin: Vec3, directions: &[Vec3; 32]) -> Segments {
    let mut rays = Segments::EMPTY;
    for (lane, &direction) in directions[..8].iter().enumerate() {
        rays.set(lane, origin, direction, 1e30);
    }
    rays
}

/// Bits of what is true.
fn bits(f: impl Fn(usize) -> bool) -> u32 {
    (0..32).fold(0, |m, i| m | u32::from(f(i)) << i)
}

/// Fans, segments and closest hits of a scene: about `rays` fan rays, as many segments,
/// a quarter of closest hits; and all of these of fronts alone.
fn check(scene: &Scene, rays: u64) -> [Counts; 4] {
    let fast = Tracer::new(&scene.triangles().map(|t| t.1).collect::<Vec<_>>());
    let portable = fast.clone().portable();
    let both = [&fast, &portable];
    let points = points(scene, &fast, 96);
    let [mut fans, mut segments, mut closest, mut fronts] = [Counts::default(); 4];
    for group in 0..(rays / 32) as u32 {
        let s = points[group as usize * 7919 % points.len()];
        let origin = s.point + s.normal * fast.offset();
        let directions = directions(&fast, origin, s.normal, group);
        let radius = [0.1, 0.25, 1.0, 3.0][group as usize / 5 % 4];
        let mut packets = [Packet::splat(s.normal); 4];
        let mut crossing = [Segments::EMPTY; 4];
        for (i, &w) in directions.iter().enumerate() {
            packets[i / 8].set(i, w);
            let d1 = w.cross(s.normal).normalize_or(w.any_orthonormal_vector());
            let d = if i % 2 == 0 { d1 } else { w.cross(d1) };
            crossing[i / 8].set(i % 8, origin + w * (radius * 0.5) - d * (radius * 0.25), d, radius * 0.5);
        }
        let fan = Fan { origin, normal: s.normal, tmax: radius, faces: Faces::Both };
        let met = fans.add_fan(both, &fan, &packets);
        let fronts_met = fronts.add_fan(both, &Fan { faces: Faces::Front, ..fan }, &packets);
        fronts.culled += u64::from((met & !fronts_met).count_ones());
        let met = segments.add_segments(both, &crossing, Faces::Both);
        let fronts_met = fronts.add_segments(both, &crossing, Faces::Front);
        fronts.culled += u64::from((met & !fronts_met).count_ones());

        let of_eight = eight(origin, &directions);
        let of_eight = both.map(|t| t.closest_of(&of_eight, 0xff));
        for (lane, &direction) in directions[..8].iter().enumerate() {
            let ray = Ray::new(origin, direction, 1e30);
            let hits = [fast.scalar().closest(&ray), fast.closest(&ray), portable.closest(&ray)];
            // Field by field, bits and all.
            closest.add_nearest(hits.map(|h| h.map(|h| (h.t, h))), fast.offset());
            assert_eq!(fast.distance(&ray, Faces::Both), hits[1].map(|h| h.t));
            for eight in &of_eight {
                assert_eq!(eight.get(lane), hits[1]);
            }
            let [a, b] = both.map(|t| t.distance(&ray, Faces::Front));
            let distances = [fast.scalar().distance(&ray, Faces::Front), a, b];
            fronts.add_nearest(distances.map(|t| t.map(|t| (t, ()))), fast.offset());
            fronts.culled += u64::from(a != hits[1].map(|h| h.t));
        }
    }
    [fans, segments, closest, fronts]
}

#[test]
fn every_answer_is_the_scalar_walks() {
    let mut all_culled = 0;
    for name in ["atrium", "curtain-arcade", "leaves", "blinds"] {
        for counts in check(&library::scene(name).unwrap(), 200_000) {
            let Counts { rays, beside, culled, .. } = counts;
            assert_eq!(counts, Counts { rays, beside, culled, ..Counts::default() }, "{name}");
            assert!(rays >= 49_000 && beside * 10_000 <= rays, "{name}: {counts:?}");
            all_culled += culled;
        }
    }
    assert!(all_culled > 10_000, "{all_culled} answers without backs differ from those with them");
}

/// For `.ci/peers rays`: millions of rays in the scenes of `AOGAUGE_RAY_SCENES`, built in by
/// name or files, divided by spaces.
#[test]
#[ignore = "takes minutes"]
fn ten_million_rays_a_scene() {
    let millions: u64 = std::env::var("AOGAUGE_MILLION_RAYS").map_or(10, |n| n.parse().unwrap());
    let names = std::env::var("AOGAUGE_RAY_SCENES").unwrap_or_else(|_| "atrium".into());
    let (mut wrong, mut text) = (0, String::new());
    for name in names.split_whitespace() {
        let scene = if name.ends_with(".toml") { Scene::from_file(Path::new(name)) } else { library::scene(name) };
        let scene = scene.unwrap();
        let lines =
            ["fans", "segments", "closest hits", "fronts alone"].iter().zip(check(&scene, millions * 1_000_000));
        for (kind, c) in lines {
            let Counts { rays, missed, false_hits, differ, beside, .. } = c;
            wrong += missed + false_hits + differ;
            let name = &scene.name;
            text += &format!(
                "{name:8} {kind:12} {rays:9} rays: {missed} missed, {false_hits} false, {beside} of another triangle at \
                 an edge, {differ} differ between AVX2 and portable\n"
            );
        }
    }
    print!("{text}");
    assert_eq!(wrong, 0);
}
