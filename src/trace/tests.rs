//! The tracer against brute force, and its wide walks against the scalar one.

use super::*;
use crate::render::sampler::Sampler;
use aogauge_scenes::closest_point;

/// Triangles of many sizes and directions, the same every time.
fn soup(n: u32) -> Vec<[Vec3; 3]> {
    let point = |i: u32, salt: u32| {
        let [a, b] = Sampler::new(7, i, salt).pair(0, 0);
        let [c, _] = Sampler::new(8, i, salt).pair(0, 0);
        Vec3::new(a, b, c) * 2.0 - 1.0
    };
    (0..n)
        .map(|i| {
            let centre = point(i, 0);
            let size = if i % 10 == 0 { 0.8 } else { 0.1 };
            [1, 2, 3].map(|k| centre + point(i, k) * size)
        })
        .collect()
}

fn rays(n: u32, tmax: f32) -> impl Iterator<Item = Ray> {
    (0..n).map(move |i| {
        let [a, b] = Sampler::new(1, i, 1).pair(0, 0);
        let [c, d] = Sampler::new(2, i, 1).pair(0, 0);
        let z = 1.0 - 2.0 * d;
        let (s, phi) = ((1.0 - z * z).sqrt(), 6.283_185_5 * c);
        let direction = Vec3::new(s * phi.cos(), s * phi.sin(), z).normalize();
        Ray::new(Vec3::new(a, b, c) * 2.4 - 1.2, direction, tmax)
    })
}

#[test]
fn the_tree_agrees_with_brute_force() {
    let triangles = soup(400);
    let tracer = Tracer::new(&triangles);
    let mut hits = 0;
    for ray in rays(20_000, 1.5) {
        let brute = triangles
            .iter()
            .enumerate()
            .filter_map(|(i, t)| ray.meets(t, ray.tmax).map(|(t, _)| (t, i as u32)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(tracer.occluded(&ray), brute.is_some());
        assert_eq!(tracer.closest(&ray).map(|h| h.t), brute.map(|b| b.0));
        hits += usize::from(brute.is_some());
    }
    assert!(hits > 5_000, "the test must meet something: {hits}");
}

#[test]
fn no_ray_slips_through_the_edges_and_corners_of_a_closed_box() {
    let mut mesh = aogauge_scenes::Mesh::default();
    mesh.push_box(Vec3::new(-1.0, -0.7, -1.3), Vec3::new(0.9, 1.1, 1.0));
    let triangles: Vec<_> = mesh.corners().collect();
    let tracer = Tracer::new(&triangles);
    for (i, ray) in rays(20_000, 1.0).enumerate() {
        let inside = ray.origin.clamp(Vec3::new(-0.9, -0.6, -1.2), Vec3::new(0.8, 1.0, 0.9));
        let [a, b, _] = triangles[i % triangles.len()];
        let s = (i % 101) as f32 / 100.0;
        let target = a + (b - a) * s;
        let ray = Ray::new(inside, (target - inside).normalize(), 10.0);
        assert!(tracer.occluded(&ray), "{inside} to {target}");
    }
}

#[test]
fn nearest_agrees_with_brute_force() {
    let triangles = soup(200);
    let tracer = Tracer::new(&triangles);
    for ray in rays(500, 1.0) {
        let brute = triangles
            .iter()
            .map(|t| (closest_point(ray.origin, t) - ray.origin).length())
            .min_by(f32::total_cmp)
            .unwrap();
        let found = tracer.nearest(ray.origin, 5.0, |_| true).unwrap();
        assert!((found.distance - brute).abs() < 1e-6);
        assert!((found.point - ray.origin).length() - brute < 1e-6);
        let mut near = 0;
        tracer.near(ray.origin, brute, |_| near += 1);
        assert!(near > 0);
        assert_eq!(tracer.nearest(ray.origin, brute * 0.99, |_| true), None);
    }
}
