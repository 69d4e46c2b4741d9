//! A curtain: flat, the sheet of the paper's Fig. 1 and Fig. 2 (and with a large
//! thickness the thick box it is compared with), or in folds.

use super::{At, sheet::push_sheet};
use crate::{
    Mesh,
    bounded::{Count, Length, Thickness},
};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cloth hanging over the floor y = 0: `thickness` along x, `length` along z,
/// from `gap` to `gap + height` along y. Folds swing along x, and every fold is
/// whole: their number is `length / pleat_width`, rounded.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Curtain {
    /// The paper's w, along x, metres; 0 for a single, open sheet.
    pub thickness: Thickness,
    /// The paper's m: height of the hem over y = 0, metres.
    pub gap: Length<0, 100_000>,
    /// The paper's h: from hem to top, metres.
    pub height: Length<1, 100_000>,
    /// Extent along z, metres.
    pub length: Length<10, 100_000>,
    /// How it falls.
    pub folds: Folds,
    /// One fold along z, from crest to crest, metres.
    pub pleat_width: Length<10, 10_000>,
    /// From crest to trough along x, metres.
    pub pleat_depth: Length<1, 10_000>,
    /// Straight pieces of a wavy fold. The two flanks of a pleat are straight
    /// anyway.
    pub segments: Count<2, 32>,
    /// x and z of its middle, metres; the origin unless given.
    pub at: At,
}

/// How a curtain falls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Folds {
    /// Without folds.
    #[default]
    Flat,
    /// In sharp pleats: a zig-zag.
    Pleated,
    /// In round folds: a sine.
    Wavy,
}

/// The most folds a curtain has.
const MAX_FOLDS: f32 = 4000.0;

impl Default for Curtain {
    fn default() -> Self {
        Curtain {
            thickness: Thickness(0.02),
            gap: Length(0.1),
            height: Length(1.0),
            length: Length(6.0),
            folds: Folds::Flat,
            pleat_width: Length(0.15),
            pleat_depth: Length(0.08),
            segments: Count(12),
            at: At::default(),
        }
    }
}

impl Curtain {
    pub(crate) fn mesh(&self) -> Result<Mesh, String> {
        let (w, l) = (self.thickness.0 / 2.0, self.length.0 / 2.0);
        let (bottom, top) = (self.gap.0, self.gap.0 + self.height.0);
        let mut mesh = Mesh::default();
        if self.folds == Folds::Flat && w > 0.0 {
            mesh.push_box(self.at.point(-w, bottom, -l), self.at.point(w, top, l));
            return Ok(mesh);
        }
        let folds = (self.length.0 / self.pleat_width.0).round().max(1.0);
        if self.folds != Folds::Flat && folds > MAX_FOLDS {
            return Err(format!("length / pleat_width makes {folds} folds: it must be at most {MAX_FOLDS}"));
        }
        let columns = match self.folds {
            Folds::Flat => 1,
            Folds::Pleated => 2 * folds as u32,
            Folds::Wavy => self.segments.0 * folds as u32,
        };
        let swing = |u: f32| self.pleat_depth.0 / 2.0 * self.shape(f64::from(u) * f64::from(folds));
        let at = |u: f32, v: f32| self.at.point(swing(u), if v > 0.0 { top } else { bottom }, (2.0 * u - 1.0) * l);
        push_sheet(&mut mesh, [columns, 1], at, Vec3::X * self.thickness.0);
        Ok(mesh)
    }

    /// How far a fold swings to +x (1) or -x (-1) after this many folds.
    fn shape(&self, folds: f64) -> f32 {
        match self.folds {
            Folds::Flat => 0.0,
            Folds::Pleated => (4.0 * (folds - folds.round()).abs() - 1.0) as f32,
            Folds::Wavy => -(std::f64::consts::TAU * folds).cos() as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounded::Offset;

    #[test]
    fn stands_where_it_is_told() {
        let mesh = Curtain {
            thickness: Thickness(0.02),
            gap: Length(0.1),
            height: Length(1.0),
            length: Length(4.0),
            at: At { x: Offset(0.5), z: Offset(-1.0) },
            ..Curtain::default()
        }
        .mesh()
        .unwrap();
        let [lo, hi] = mesh.bounds().unwrap();
        assert!((lo - Vec3::new(0.49, 0.1, -3.0)).length() < 1e-6);
        assert!((hi - Vec3::new(0.51, 1.1, 1.0)).length() < 1e-6);
    }

    #[test]
    fn folds_swing_by_their_depth_and_keep_the_hem() {
        for folds in [Folds::Pleated, Folds::Wavy] {
            for thickness in [0.0, 0.01] {
                let curtain = Curtain { folds, thickness: Thickness(thickness), ..Curtain::default() };
                let [lo, hi] = curtain.mesh().unwrap().bounds().unwrap();
                let x = (0.08 + thickness) / 2.0;
                assert!((lo - Vec3::new(-x, 0.1, -3.0)).length() < 1e-5, "{folds:?} {thickness}: {lo}");
                assert!((hi - Vec3::new(x, 1.1, 3.0)).length() < 1e-5, "{folds:?} {thickness}: {hi}");
            }
        }
    }
}
