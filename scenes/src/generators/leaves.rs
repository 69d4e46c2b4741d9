//! Leaves: opaque cards scattered in a box of air.

use super::{At, sheet::push_sheet};
use crate::{
    Mesh,
    bounded::{Angle, Count, Length, Thickness},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cards in a box that stands `gap` over the floor. Their middles follow an even
/// sequence, so that few cross; their directions are hashed.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Leaves {
    /// How many.
    pub count: Count<1, 20_000>,
    /// Another seed, another scatter.
    pub seed: Count<0, { u32::MAX }>,
    /// The outline of a leaf.
    pub outline: Outline,
    /// Its long way, metres.
    pub size: Length<5, 2_000>,
    /// Its short way, metres.
    pub breadth: Length<5, 2_000>,
    /// Of a leaf, metres; 0 for a single quadrilateral, seen from both sides.
    pub thickness: Thickness,
    /// How far from upright a leaf leans at most, degrees.
    pub lean: Angle<0, 90>,
    /// Extent of the box along x, metres.
    pub width: Length<10, 50_000>,
    /// Extent of the box along y, metres.
    pub height: Length<10, 50_000>,
    /// Extent of the box along z, metres.
    pub length: Length<10, 50_000>,
    /// Height of the box over y = 0, metres.
    pub gap: Length<0, 50_000>,
    /// x and z of the box's middle, metres; the origin unless given.
    pub at: At,
}

/// The outline of a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Outline {
    /// A rhombus.
    Diamond,
    /// A rectangle.
    Card,
}

impl Default for Leaves {
    fn default() -> Self {
        Leaves {
            count: Count(160),
            seed: Count(1),
            outline: Outline::Diamond,
            size: Length(0.1),
            breadth: Length(0.06),
            thickness: Thickness(0.0),
            lean: Angle(25.0),
            width: Length(0.6),
            height: Length(0.8),
            length: Length(1.6),
            gap: Length(0.06),
            at: At::default(),
        }
    }
}

impl Leaves {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        let (long, short) = (self.size.0, self.breadth.0);
        let reach = match self.outline {
            Outline::Diamond => long.max(short),
            Outline::Card => long.hypot(short),
        } + self.thickness.0;
        let air = Vec3::new(self.width.0, self.height.0, self.length.0);
        if air.min_element() < reach {
            return Err(format!("width, height and length must each hold a leaf: be at least {reach} m"));
        }
        let corner = self.at.point(-air.x / 2.0, self.gap.0, -air.z / 2.0) + Vec3::splat(reach / 2.0);
        let mut mesh = Mesh::default();
        for leaf in 0..self.count.0 {
            let center = corner + (air - Vec3::splat(reach)) * self.middle(leaf);
            let [along, beside] = self.axes(leaf);
            let (a, b) = (along * long, beside * short);
            let at = |u: f32, v: f32| match self.outline {
                Outline::Card => center + a * (u - 0.5) + b * (v - 0.5),
                Outline::Diamond => center + a * ((u + v - 1.0) / 2.0) + b * ((v - u) / 2.0),
            };
            push_sheet(&mut mesh, [1, 1], at, -along.cross(beside) * self.thickness.0);
        }
        Ok(mesh)
    }

    /// Where a leaf stands in the box, 0 to 1 each way: the additive recurrence
    /// of the generalised golden ratio (Roberts 2018), begun at a hashed point.
    fn middle(&self, leaf: u32) -> Vec3 {
        const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_3];
        let at = |axis: usize| {
            let start = hash(self.seed.0, u32::MAX, axis as u32);
            (start + STEPS[axis] * f64::from(leaf)).fract() as f32
        };
        Vec3::new(at(0), at(1), at(2))
    }

    /// Unit vectors along the long and the short way of a leaf.
    fn axes(&self, leaf: u32) -> [Vec3; 2] {
        let turn = |salt: u32| (std::f64::consts::TAU * hash(self.seed.0, leaf, salt)).sin_cos();
        let lean = f64::from(self.lean.0).to_radians() * (2.0 * hash(self.seed.0, leaf, 5) - 1.0);
        let ((s, c), (roll_s, roll_c)) = (turn(3), turn(4));
        let (rise, level) = lean.sin_cos();
        let normal = Vec3::new((c * level) as f32, rise as f32, (s * level) as f32);
        let tangent = Vec3::new(-s as f32, 0.0, c as f32);
        let (a, b) = (tangent, normal.cross(tangent));
        let (s, c) = (roll_s as f32, roll_c as f32);
        [a * c + b * s, b * c - a * s]
    }
}

/// A number in [0, 1) that looks random and is the same everywhere: PCG's output
/// function over mixed words (Jarzynski and Olano 2020).
fn hash(seed: u32, leaf: u32, salt: u32) -> f64 {
    let word = [leaf, salt].into_iter().fold(seed, |state, word| {
        let state = (state ^ word.wrapping_mul(0x9e37_79b9)).wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let mixed = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
        (mixed >> 22) ^ mixed
    });
    f64::from(word) / (f64::from(u32::MAX) + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_leaves_come_near_each_other_and_a_seed_moves_them() {
        let leaves = Leaves::default();
        let middles: Vec<Vec3> = (0..leaves.count.0).map(|i| leaves.middle(i) * Vec3::new(0.5, 0.7, 1.5)).collect();
        let near = (0..middles.len())
            .filter(|&i| middles[..i].iter().any(|m| m.distance(middles[i]) < leaves.breadth.0))
            .count();
        assert!(near <= middles.len() / 10, "{near}");
        let other = Leaves { seed: Count(2), ..leaves.clone() };
        assert_ne!(leaves.mesh().unwrap(), other.mesh().unwrap());
        assert_eq!(leaves.mesh().unwrap(), leaves.mesh().unwrap());
    }

    #[test]
    fn leaves_stay_in_their_box() {
        for outline in [Outline::Card, Outline::Diamond] {
            let leaves = Leaves { outline, lean: Angle(90.0), count: Count(2000), ..Leaves::default() };
            let [lo, hi] = leaves.mesh().unwrap().bounds().unwrap();
            assert!(lo.cmpge(Vec3::new(-0.3, 0.06, -0.8) - 1e-5).all(), "{lo}");
            assert!(hi.cmple(Vec3::new(0.3, 0.86, 0.8) + 1e-5).all(), "{hi}");
        }
    }
}
