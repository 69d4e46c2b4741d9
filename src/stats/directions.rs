//! Whether directions are cosine distributed about a normal.

use super::{ChiSquare, ChiSquareError, chi_square};
use glam::{DVec3, Vec3};

/// How far below the horizon rounding may put a direction, as a cosine.
const ROUNDING: f64 = 1e-5;

/// A histogram of directions over cells of equal probability: rings times sectors of
/// the hemisphere about a normal, cosine weighted.
///
/// sin^2 of the angle to the normal is uniform there (Malley's method), so rings are
/// equal parts of it, and sectors equal parts of the turn about the normal.
///
/// Count independent directions: of a stratified sampler, one sample of each of many
/// seeds. Samples of one seed fit too well, which [`ChiSquare::p_two`] shows.
///
/// ```
/// # use aogauge::stats::DirectionHistogram;
/// use glam::Vec3;
/// let mut histogram = DirectionHistogram::new(Vec3::Z, 2, 4);
/// for i in 0..64 {
///     let phi = i as f32 * 2.399_963;
///     histogram.add(Vec3::new(phi.cos(), phi.sin(), 2.0));
/// }
/// // All at one angle to the normal: one ring is full, the other empty.
/// assert!(histogram.test().unwrap().p < 1e-9);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct DirectionHistogram {
    /// Two tangents and the normal.
    frame: [DVec3; 3],
    sectors: usize,
    counts: Vec<u64>,
    outside: u64,
}

impl DirectionHistogram {
    /// About a normal of any length, with 1 to 256 rings and sectors; more or fewer
    /// are taken as the nearest. A normal without direction leaves all outside.
    pub fn new(normal: Vec3, rings: u32, sectors: u32) -> Self {
        let [rings, sectors] = [rings, sectors].map(|n| n.clamp(1, 256) as usize);
        let n = normal.as_dvec3().normalize();
        let axis = if n.x.abs() < 0.6 { DVec3::X } else { DVec3::Y };
        let t = axis.cross(n).normalize();
        DirectionHistogram { frame: [t, n.cross(t), n], sectors, counts: vec![0; rings * sectors], outside: 0 }
    }

    /// Counts a direction of any length above 0. One below the horizon, or none at
    /// all (zero, NaN), is counted as outside.
    pub fn add(&mut self, direction: Vec3) {
        let d = direction.as_dvec3().normalize();
        let [x, y, cosine] = self.frame.map(|axis| axis.dot(d));
        if cosine.is_nan() || cosine <= -ROUNDING {
            self.outside += 1;
            return;
        }
        let part = |share: f64, parts: usize| ((share * parts as f64) as usize).min(parts - 1);
        let ring = part(x * x + y * y, self.counts.len() / self.sectors);
        let turn = y.atan2(x) / std::f64::consts::TAU;
        let sector = part(turn.rem_euclid(1.0), self.sectors);
        self.counts[ring * self.sectors + sector] += 1;
    }

    /// Counts, ring by ring from the normal outwards.
    pub fn counts(&self) -> &[u64] {
        &self.counts
    }

    /// Directions that are not in the hemisphere.
    pub fn outside(&self) -> u64 {
        self.outside
    }

    /// Chi-square of equal counts. A single direction outside has no probability: then
    /// the statistic is infinite and the p-values are 0. As two-sided test (`p_two`) it
    /// also finds directions that are too even.
    ///
    /// # Errors
    /// Fewer than 5 directions a cell, or a single cell.
    pub fn test(&self) -> Result<ChiSquare, ChiSquareError> {
        let cells = self.counts.len();
        if self.outside > 0 {
            return Ok(ChiSquare { statistic: f64::INFINITY, df: cells as f64 - 1.0, p: 0.0, p_two: 0.0 });
        }
        chi_square(&self.counts, &vec![1.0 / cells as f64; cells])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_where_they_should_be() {
        let mut h = DirectionHistogram::new(Vec3::Y * 2.0, 4, 1);
        // sin^2 of 0, .3, .6 and .9.
        for sin2 in [0.0f32, 0.3, 0.6, 0.9] {
            h.add(Vec3::new(sin2.sqrt(), (1.0 - sin2).sqrt(), 0.0) * 3.0);
        }
        assert_eq!(h.counts(), [1, 1, 1, 1]);
        let mut h = DirectionHistogram::new(Vec3::new(1.0, -2.0, 0.5), 1, 8);
        let [t, b, n] = h.frame;
        for i in 0..8 {
            let phi = (f64::from(i) + 0.5) / 8.0 * std::f64::consts::TAU;
            h.add((t * phi.cos() + b * phi.sin() + n).as_vec3());
        }
        assert_eq!(h.counts(), [1; 8]);
    }

    #[test]
    fn what_is_no_direction_of_the_hemisphere_is_outside() {
        let mut h = DirectionHistogram::new(Vec3::Z, 2, 2);
        for d in [Vec3::NEG_Z, Vec3::ZERO, Vec3::NAN, Vec3::new(1.0, 0.0, -0.01)] {
            h.add(d);
        }
        h.add(Vec3::new(1.0, 0.0, -1e-7));
        assert_eq!((h.outside(), h.counts().iter().sum::<u64>()), (4, 1));
        assert_eq!(h.test().unwrap().p, 0.0);
        let mut nowhere = DirectionHistogram::new(Vec3::ZERO, 0, 1_000_000);
        nowhere.add(Vec3::Z);
        assert_eq!((nowhere.outside(), nowhere.counts().len()), (1, 256));
        assert!(DirectionHistogram::new(Vec3::Z, 4, 4).test().is_err());
    }
}
