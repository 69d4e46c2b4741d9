//! Closest points, and what is near a point.

use super::{Node, Tracer};
use aogauge_scenes::closest_point;
use glam::Vec3;

impl Tracer {
    /// The nearest point to `point`, within `radius`, on the triangles that
    /// `accept` takes (by their corners).
    pub fn nearest(&self, point: Vec3, radius: f32, accept: impl Fn(&[Vec3; 3]) -> bool) -> Option<Nearest> {
        self.nearest_of(point, radius, |leaf| accept(&self.triangles[leaf as usize]))
    }

    /// The nearest point to `point`, within `radius`, on the triangles that
    /// `accept` takes, by their numbers in [`Self::triangles`].
    pub fn nearest_of(&self, point: Vec3, radius: f32, accept: impl Fn(u32) -> bool) -> Option<Nearest> {
        let mut best = radius * radius;
        let mut found = None;
        let mut stack: Vec<u32> = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if box_distance_squared(node, point) > best {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
                continue;
            }
            for triangle in node.first..node.first + node.count {
                let corners = &self.triangles[triangle as usize];
                let at = closest_point(point, corners);
                let d = (at - point).length_squared();
                if d <= best && accept(triangle) {
                    best = d;
                    found = Some(Nearest { point: at, distance: d.sqrt(), triangle });
                }
            }
        }
        found
    }

    /// Calls `visit` with the corners of every triangle whose tree leaf comes
    /// within `radius` of `point`: at least those that come so near themselves.
    pub fn near(&self, point: Vec3, radius: f32, mut visit: impl FnMut(&[Vec3; 3])) {
        let mut stack: Vec<u32> = if self.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if box_distance_squared(node, point) > radius * radius {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, node.first + 1]);
            } else {
                self.triangles[node.first as usize..(node.first + node.count) as usize].iter().for_each(&mut visit);
            }
        }
    }
}

/// A point on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The point.
    pub point: Vec3,
    /// Its distance from where the search began, metres.
    pub distance: f32,
    /// The triangle, as numbered in [`Tracer::triangles`].
    pub triangle: u32,
}

fn box_distance_squared(node: &Node, point: Vec3) -> f32 {
    (point.clamp(Vec3::from(node.min), Vec3::from(node.max)) - point).length_squared()
}
