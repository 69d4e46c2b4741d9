//! The traversal of `gpu/shaders/trace.wgsl`, word for word, against the binary
//! tree's and against brute force.

use super::*;
use crate::{
    render::{ao::cosine_distributed, gbuffer::GBuffer, sampler::Sampler},
    trace::Ray,
};

/// What a walk met, and what it cost.
#[derive(Default)]
struct Walked {
    hit: Option<(f32, u32)>,
    nodes: u64,
    triangles: u64,
}

/// Twin: `children_met` of trace.wgsl.
fn children_met(node: &WideNode, ray: &Ray, octant: u32, tmax: f32) -> u32 {
    let inverse = ray.inverse.to_array();
    let mut scale = [0.0; 3];
    let mut start = [0.0; 3];
    for axis in 0..3 {
        scale[axis] = f32::from_bits((node.steps >> (8 * axis) & 255) << 23) * inverse[axis];
        start[axis] = (node.origin[axis] - ray.origin[axis]) * inverse[axis];
    }
    let mut met = 0;
    for slot in 0..WIDTH {
        let byte = |words: [u32; 2]| words[slot / 4] >> (8 * (slot % 4)) & 255;
        let meta = byte(node.meta);
        if meta == 0 {
            continue;
        }
        let (mut near, mut far) = (0.0f32, tmax);
        for axis in 0..3 {
            let lo = byte(node.lo[axis]) as f32 * scale[axis] + start[axis];
            let hi = byte(node.hi[axis]) as f32 * scale[axis] + start[axis];
            near = near.max(lo.min(hi));
            far = far.min(lo.max(hi));
        }
        if near <= far * 1.000_000_4 {
            let inner = node.steps >> (24 + slot) & 1 == 1;
            met |= if inner { 1 << (24 + (slot as u32 ^ octant)) } else { (meta >> 5) << (meta & 31) };
        }
    }
    met
}

/// Twin: `walk` of trace.wgsl.
fn walk(wide: &Wide, tracer: &Tracer, ray: &Ray, any: bool) -> Walked {
    let mut walked = Walked::default();
    let mut tmax = ray.tmax;
    let d = ray.direction;
    // The slot that holds what is nearest is the octant's own, so it must come
    // out as the highest bit: 7.
    let octant = 7 - (u32::from(d.x < 0.0) | u32::from(d.y < 0.0) << 1 | u32::from(d.z < 0.0) << 2);
    let mut stack = Vec::new();
    let mut group = (0u32, 1u32 << 31);
    loop {
        if group.1 > 0x00ff_ffff {
            let bit = 31 - group.1.leading_zeros();
            let slot = (bit - 24) ^ octant;
            let before = (group.1 & ((1 << slot) - 1) & 0xff).count_ones();
            group.1 &= !(1 << bit);
            let node = &wide.nodes[(group.0 + before) as usize];
            if group.1 > 0x00ff_ffff {
                stack.push(group);
                assert!(stack.len() <= STACK);
            }
            let met = children_met(node, ray, octant, tmax);
            walked.nodes += 1;
            group = (node.first_node, met & 0xff00_0000 | node.steps >> 24);
            let mut leaves = met & 0x00ff_ffff;
            while leaves != 0 {
                let bit = leaves.trailing_zeros();
                leaves &= leaves - 1;
                let triangle = node.first_triangle + bit;
                let corners = &tracer.triangles()[wide.order[triangle as usize] as usize];
                walked.triangles += 1;
                if let Some((t, _)) = ray.meets(corners, tmax) {
                    tmax = t;
                    walked.hit = Some((t, triangle));
                    if any {
                        return walked;
                    }
                }
            }
        }
        if group.1 <= 0x00ff_ffff {
            match stack.pop() {
                Some(top) => group = top,
                None => return walked,
            }
        }
    }
}

/// Rays of AO from what a scene's views see.
fn ao_rays(name: &str, reach: f32) -> (Tracer, Vec<Ray>) {
    let scene = crate::scenes::library::scene(name).unwrap();
    let triangles: Vec<_> = scene.triangles().map(|(_, corners)| corners).collect();
    let tracer = Tracer::new(&triangles);
    let mut rays = Vec::new();
    for view in [scene.measure.view(), scene.look.view()] {
        for (pixel, surface) in GBuffer::new(&tracer, &view).surfaces.iter().enumerate().step_by(37) {
            let Some(s) = surface else { continue };
            for i in 0..8 {
                let sampler = Sampler::new(5, pixel as u32, 0);
                let (direction, _) = cosine_distributed(s.normal, sampler.pair(i, 0));
                rays.push(Ray::new(s.point + s.normal * tracer.offset(), direction, scene.ao.radius * reach));
            }
        }
    }
    (tracer, rays)
}

#[test]
fn nothing_is_missed_that_the_binary_tree_meets() {
    for name in ["atrium", "curtain-arcade", "pillar", "leaves", "cables", "plane"] {
        let (tracer, rays) = ao_rays(name, 4.0);
        let wide = Wide::new(&tracer);
        let (mut hits, mut nodes, mut tests) = (0, 0, 0);
        for ray in &rays {
            let any = walk(&wide, &tracer, ray, true);
            assert_eq!(any.hit.is_some(), tracer.occluded(ray), "{name}: {ray:?}");
            let closest = walk(&wide, &tracer, ray, false);
            assert_eq!(closest.hit.map(|h| h.0), tracer.closest(ray).map(|h| h.t), "{name}: {ray:?}");
            hits += u32::from(any.hit.is_some());
            nodes += any.nodes;
            tests += any.triangles;
        }
        let each = |n: u64| n as f64 / rays.len() as f64;
        println!("{name}: {} rays, {hits} hits, {:.2} nodes, {:.2} triangles", rays.len(), each(nodes), each(tests));
        assert!(name == "plane" || hits > 100, "{name}: {hits}");
    }
}

#[test]
fn the_tree_holds_every_triangle_once_within_its_boxes() {
    for name in ["atrium", "curtain-open"] {
        let (tracer, _) = ao_rays(name, 1.0);
        let wide = Wide::new(&tracer);
        let mut order = wide.order.clone();
        order.sort_unstable();
        assert!(order.iter().enumerate().all(|(i, &o)| i as u32 == o));
        let (mut slots, mut triangles) = (0, 0);
        for node in &wide.nodes {
            for slot in 0..WIDTH {
                let byte = |words: [u32; 2]| words[slot / 4] >> (8 * (slot % 4)) & 255;
                let meta = byte(node.meta);
                slots += u32::from(meta != 0);
                if meta == 0 || meta & 31 >= 24 {
                    continue;
                }
                for k in 0..(meta >> 5).count_ones() {
                    triangles += 1;
                    let at = node.first_triangle + (meta & 31) + k;
                    for corner in tracer.triangles()[wide.order[at as usize] as usize] {
                        for axis in 0..3 {
                            let step = f64::from(f32::from_bits((node.steps >> (8 * axis) & 255) << 23));
                            let plane = |b| f64::from(node.origin[axis]) + f64::from(byte(b)) * step;
                            let v = f64::from(corner[axis]);
                            assert!(plane(node.lo[axis]) < v && v < plane(node.hi[axis]));
                        }
                    }
                }
            }
        }
        assert_eq!(triangles, wide.order.len());
        println!("{name}: {} nodes, {slots} slots filled, depth {}", wide.nodes.len(), wide.depth);
        assert!(wide.depth <= 12);
    }
}

#[test]
fn trees_of_none_and_of_one_triangle_are_trees() {
    let none = Tracer::new(&[]);
    let ray = Ray::new(Vec3::new(0.2, 0.2, 1.0), Vec3::NEG_Z, 2.0);
    assert!(walk(&Wide::new(&none), &none, &ray, true).hit.is_none());
    let one = Tracer::new(&[[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    assert_eq!(walk(&Wide::new(&one), &one, &ray, true).hit.map(|h| h.1), Some(0));
    let many = Tracer::new(&vec![[Vec3::ZERO, Vec3::X, Vec3::Y]; 3000]);
    let wide = Wide::new(&many);
    assert!(wide.depth <= STACK && walk(&wide, &many, &ray, true).hit.is_some());
}
