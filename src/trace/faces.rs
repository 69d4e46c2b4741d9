//! Which side of a triangle a ray can meet. Twin: `faces` in
//! `render/gpu/shaders/triangle.wgsl`.

use super::{
    lanes::Lanes,
    tree8::Block,
    walk::{exact_cross, exact_dot, load3, splat3, sub3},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Which side of a triangle closes a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Faces {
    /// Both.
    #[default]
    Both,
    /// The one whose corners run counter-clockwise: back faces are culled, as in
    /// Unity.
    Front,
}

impl Faces {
    /// Whether a triangle counts for rays along `direction`: its front is turned against
    /// them where (b - a) x (c - a) . d, as it is rounded, is below 0.
    #[inline(always)]
    pub fn count(self, [a, b, c]: &[Vec3; 3], direction: Vec3) -> bool {
        self == Faces::Both || (*b - *a).cross(*c - *a).dot(direction) < 0.0
    }
}

/// Those of a block's triangles in `lanes` that turn their front against a ray: as by
/// [`Faces::count`], to the bit. It is asked of triangles that are met, because most are
/// missed.
#[inline(always)]
pub(super) fn fronts<L: Lanes>(block: &Block, lanes: u32, direction: Vec3) -> u32 {
    let a = load3::<L>(&block.corners[0]);
    let normal = exact_cross(sub3(load3(&block.corners[1]), a), sub3(load3(&block.corners[2]), a));
    // The largest number below 0.
    lanes & exact_dot(normal, splat3(direction)).le(L::splat(-f32::from_bits(1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::sampler::Sampler,
        trace::{Fan, Packet, Queue, Ray, Tracer},
    };

    /// A closed box with its fronts outside, or inside; rays from within, at edges, corners
    /// and along axes.
    #[test]
    fn from_inside_a_box_its_backs_let_all_rays_out_and_its_fronts_none() {
        let mut mesh = aogauge_scenes::Mesh::default();
        mesh.push_box(Vec3::new(-1.0, -0.7, -1.3), Vec3::new(0.9, 1.1, 1.0));
        let outwards: Vec<_> = mesh.corners().collect();
        let inwards: Vec<_> = outwards.iter().map(|&[a, b, c]| [a, c, b]).collect();
        for (triangles, closed) in [(&outwards, 0), (&inwards, u32::MAX)] {
            let fast = Tracer::new(triangles);
            for tracer in [fast.clone(), fast.portable()] {
                for group in 0..300 {
                    let [x, y] = Sampler::new(4, group, 0).pair(0, 0);
                    let origin = Vec3::new(x * 1.8 - 0.95, y * 1.7 - 0.65, 0.25);
                    let direction = |i: u32| {
                        let [a, b, _] = triangles[(group + i) as usize % triangles.len()];
                        match i % 3 {
                            0 => (a - origin).normalize(),
                            1 => (a + (b - a) * Sampler::new(4, group, 1).pair(i, 0)[0] - origin).normalize(),
                            _ => {
                                [Vec3::X, Vec3::Y, Vec3::Z][(i / 3) as usize % 3]
                                    * if i.is_multiple_of(2) { 1.0 } else { -1.0 }
                            }
                        }
                    };
                    let mut queue = Queue::default();
                    for i in 0..32 {
                        let ray = Ray::new(origin, direction(i), 9.0);
                        queue.push(origin, direction(i), 9.0);
                        assert_eq!(tracer.occluded_by(&ray, Faces::Front), closed != 0);
                        assert_eq!(tracer.distance(&ray, Faces::Front).is_some(), closed != 0);
                        assert_eq!(tracer.scalar().occluded_by(&ray, Faces::Front), closed != 0);
                    }
                    assert_eq!(queue.occluded(&tracer, Faces::Front), closed);
                    // A fan goes to one side of a plane.
                    let mut packets = [Packet::splat(Vec3::Y); 4];
                    (0..32u32).for_each(|i| {
                        let d = direction(i);
                        packets[i as usize / 8].set(i as usize % 8, if d.y < 0.0 { -d } else { d });
                    });
                    let fan = Fan { origin, normal: Vec3::Y, tmax: 9.0, faces: Faces::Front };
                    assert_eq!(tracer.occluded_from(&fan, &packets, u32::MAX), closed);
                }
            }
        }
    }
}
