//! One path at a time: what paths side by side are held against, bit by bit.

use super::{PAIRS, SURE_BOUNCES, aimed, radiance};
use crate::{
    render::{
        Geometry,
        ao::cosine_distributed,
        gbuffer::{FAR_AWAY, GBuffer},
        lights::lambert,
        path::batch::{self, MOST, Start},
        sampler::Sampler,
    },
    scenes::library,
    trace::Ray,
};
use glam::Vec3;
use std::f32::consts::PI;

/// One path from a surface to the light: an estimate of irradiance over pi.
fn path(geometry: &Geometry, point: Vec3, normal: Vec3, sampler: &Sampler, sample: u32) -> Vec3 {
    let Geometry { tracer, lights, .. } = geometry;
    let (mut point, mut normal) = (point, normal);
    let mut throughput = Vec3::ONE;
    let mut sum = Vec3::ZERO;
    for bounce in 0u32.. {
        let origin = point + normal * tracer.offset();
        let pair = |which: u32| sampler.pair(sample, PAIRS * bounce + which);
        // Random numbers cost hashes: they are drawn where something uses them.
        let aims = [lights.aim_at_portal(origin, || pair(0)), lights.aim_at_emitter(origin, || pair(2))];
        for aim in aims.into_iter().flatten() {
            sum += throughput * aimed(geometry, origin, normal, aim);
        }
        if let Some(arrival) = lights.punctual(origin, || pair(3)[1]) {
            sum += throughput * lambert(&arrival, tracer, origin, normal);
        }
        let (direction, cosine) = cosine_distributed(normal, pair(1));
        let hit = tracer.closest(&Ray::new(origin, direction, FAR_AWAY));
        let radiance = radiance(geometry, direction, hit.as_ref());
        if radiance != Vec3::ZERO {
            // The share that the bounce has in light which aiming could have found.
            let own = cosine / PI;
            let weight = own / (own + lights.density(origin, direction, hit.as_ref(), radiance));
            sum += throughput * radiance * weight;
        }
        let Some(hit) = hit else {
            return sum;
        };
        let albedo = geometry.albedo(hit.triangle);
        throughput *= albedo;
        let most = albedo.max_element();
        if most <= 0.0 {
            return sum;
        }
        if bounce >= SURE_BOUNCES {
            // Below 1 even for an albedo near 1, so that every path ends.
            let survival = most.min(0.95);
            if pair(3)[0] >= survival {
                return sum;
            }
            throughput /= survival;
        }
        (point, normal) = (hit.point, hit.normal);
    }
    sum
}

/// Batches of all sizes, of one pixel and of many, in rooms with one window, under open
/// and two-coloured skies, with lamps; with AVX2 and without.
#[test]
fn paths_side_by_side_have_the_bits_of_one_by_one() {
    for name in ["curtain-room", "curtain-open", "shelf", "ceiling-light", "leaves"] {
        let scene = library::scene(name).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let portable = Geometry { tracer: geometry.tracer.clone().portable(), ..geometry.clone() };
        let surfaces = GBuffer::new(&geometry.tracer, &scene.measure.view()).surfaces;
        let seen: Vec<_> = surfaces.into_iter().flatten().collect();
        let mut lit = 0;
        for (round, count) in [1, 7, 8, 33, MOST, MOST, 60].into_iter().enumerate() {
            let starts: Vec<_> = (0..count)
                .map(|i| {
                    let pixel = (997 * round + i / 5) % seen.len();
                    let sampler = Sampler::new(2, pixel as u32, 3);
                    Start { point: seen[pixel].point, normal: seen[pixel].normal, sampler, sample: (i % 5) as u32 }
                })
                .collect();
            let one = |s: &Start| path(&geometry, s.point, s.normal, &s.sampler, s.sample);
            let expected: Vec<_> = starts.iter().map(one).collect();
            for geometry in [&geometry, &portable] {
                let mut light = vec![Vec3::ZERO; count];
                batch::trace(geometry, &starts, &mut light);
                let bits = |light: &[Vec3]| light.iter().map(|l| l.to_array().map(f32::to_bits)).collect::<Vec<_>>();
                assert_eq!(bits(&light), bits(&expected), "{name}, {count} paths");
            }
            lit += expected.iter().filter(|l| l.max_element() > 0.0).count();
        }
        assert!(lit > 100, "{name}: the test must see light: {lit}");
    }
}
