//! Cables: a bundle of round tubes along catenaries.

use super::{
    At,
    rings::{Ring, push_rings},
};
use crate::{
    Mesh,
    bounded::{Count, Length},
};
use glam::{Vec2, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parallel cables along z, packed in hexagons, hanging in a catenary whose
/// lowest point is `gap` over the floor.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Cables {
    /// How many.
    pub count: Count<1, 61>,
    /// Of a cable, metres.
    pub radius: Length<2, 1_000>,
    /// From the axis of a cable to that of its neighbour, metres.
    pub spacing: Length<4, 5_000>,
    /// Between the two ends, along z, metres.
    pub length: Length<100, 100_000>,
    /// How far the middle hangs below the ends, metres; 0 is taut.
    pub sag: Length<0, 50_000>,
    /// Height of the lowest point over y = 0, metres.
    pub gap: Length<0, 50_000>,
    /// Straight pieces of a cable.
    pub segments: Count<2, 256>,
    /// Sides of a cable.
    pub sides: Count<3, 32>,
    /// x and z of the middle, metres; the origin unless given.
    pub at: At,
}

impl Default for Cables {
    fn default() -> Self {
        Cables {
            count: Count(7),
            radius: Length(0.012),
            spacing: Length(0.026),
            length: Length(4.0),
            sag: Length(0.25),
            gap: Length(0.06),
            segments: Count(64),
            sides: Count(16),
            at: At::default(),
        }
    }
}

/// The flattest curve that is not taken for a straight line: sag over length.
const TAUT: f64 = 1e-5;

impl Cables {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        if self.spacing.0 < 2.0 * self.radius.0 {
            return Err(format!(
                "cables run into each other: spacing {} m must be at least twice the radius {} m",
                self.spacing.0, self.radius.0
            ));
        }
        let places: Vec<Vec2> = hexagon().take(self.count.0 as usize).map(|p| p * self.spacing.0).collect();
        let reach = places.iter().map(|p| p.length()).fold(0.0, f32::max) + self.radius.0;
        let bend = self.bend();
        // A bundle thicker than its tightest bend would cross itself.
        if bend.is_some_and(|a| f64::from(reach) > 0.8 * a) {
            return Err(format!(
                "the bundle, {reach} m in radius, is too thick for its bend of {:.3} m: give a smaller sag, count, spacing or radius",
                bend.unwrap_or_default()
            ));
        }
        let mut mesh = Mesh::default();
        for place in places {
            push_rings(&mut mesh, &self.rings(place, bend), self.sides.0);
        }
        let lowest = mesh.positions.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
        for p in &mut mesh.positions {
            *p += self.at.point(0.0, self.gap.0 - lowest, 0.0);
        }
        Ok(mesh)
    }

    /// The catenary's parameter a, its radius at the lowest point, from
    /// sag = a (cosh(L / 2a) - 1); None of a taut cable.
    fn bend(&self) -> Option<f64> {
        let (half, sag) = (f64::from(self.length.0) / 2.0, f64::from(self.sag.0));
        if sag <= TAUT * half {
            return None;
        }
        // The sag falls as a grows. Bisection on log a; 2 a sinh^2(x / 2a) is the
        // same as above and keeps its digits where a is large.
        let (mut low, mut high) = ((half * 1e-3).ln(), (half / TAUT).ln());
        for _ in 0..80 {
            let middle = (low + high) / 2.0;
            let a = middle.exp();
            let found = 2.0 * a * (half / (2.0 * a)).sinh().powi(2);
            if found > sag { low = middle } else { high = middle }
        }
        Some(high.exp())
    }

    /// The rings of the cable at `place` in the bundle's cross-section.
    fn rings(&self, place: Vec2, bend: Option<f64>) -> Vec<Ring> {
        let half = f64::from(self.length.0) / 2.0;
        let pieces = self.segments.0;
        (0..=pieces)
            .map(|i| {
                let s = 2.0 * f64::from(i) / f64::from(pieces) - 1.0;
                // Even steps along the curve; (y, z) and the slope dy/dz.
                let (y, z, slope) = bend.map_or((0.0, s * half, 0.0), |a| {
                    let slope = s * (half / a).sinh();
                    let z = a * slope.asinh();
                    (2.0 * a * (z / (2.0 * a)).sinh().powi(2), z, slope)
                });
                let along = Vec3::new(0.0, slope as f32, 1.0).normalize();
                let up = along.cross(Vec3::X);
                Ring {
                    center: Vec3::new(place.x, y as f32, z as f32) + up * place.y,
                    a: Vec3::X * self.radius.0,
                    b: up * self.radius.0,
                }
            })
            .collect()
    }
}

/// Places of a hexagonal packing, neighbours 1 apart, ring by ring from the middle.
fn hexagon() -> impl Iterator<Item = Vec2> {
    let corner = |k: u32| {
        let (s, c) = (std::f64::consts::TAU * f64::from(k % 6) / 6.0).sin_cos();
        Vec2::new(c as f32, s as f32)
    };
    let rings = (1u32..).flat_map(move |ring| {
        (0..6 * ring).map(move |i| {
            let (side, step) = (i / ring, (i % ring) as f32);
            corner(side) * (ring as f32 - step) + corner(side + 1) * step
        })
    });
    std::iter::once(Vec2::ZERO).chain(rings)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_sags_as_told_and_the_lowest_point_is_the_gap() {
        let cables = Cables::default();
        let rings = cables.rings(Vec2::ZERO, cables.bend());
        let (end, middle) = (rings[0].center, rings[32].center);
        assert!((end.y - middle.y - 0.25).abs() < 1e-4 && (end.z + 2.0).abs() < 1e-4, "{end} {middle}");
        let [lo, _] = cables.mesh().unwrap().bounds().unwrap();
        assert!((lo.y - 0.06).abs() < 1e-6);
    }

    #[test]
    fn cables_of_a_bundle_keep_their_distance() {
        let places: Vec<Vec2> = hexagon().take(61).collect();
        for (i, p) in places.iter().enumerate() {
            assert!(places[..i].iter().all(|q| p.distance(*q) > 0.999), "{p}");
        }
    }
}
