//! Classic openness, the step at R, in closed form.
//!
//! The point sees the underside and, when it lies beside the box, the near side;
//! both are segments at a constant distance, so with k = distance/R the extruded
//! integrals reduce to one angle and have elementary antiderivatives.

use super::{Measure, Slab, Space};
use std::f64::consts::PI;

/// Openness of one point, each in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Openness {
    /// Flatland, all directions alike: the paper's Fig. 3 over pi.
    pub flat_uniform: f64,
    /// Flatland, weighted by the cosine.
    pub flat_cosine: f64,
    /// Extruded, all directions alike.
    pub extruded_uniform: f64,
    /// Extruded, weighted by the cosine: Eq. 5 with the step at R, which is what
    /// the `classic` estimator measures.
    pub extruded_cosine: f64,
}

impl Openness {
    /// The one of a space and a measure.
    pub fn of(&self, space: Space, measure: Measure) -> f64 {
        match (space, measure) {
            (Space::Flat, Measure::Uniform) => self.flat_uniform,
            (Space::Flat, Measure::Cosine) => self.flat_cosine,
            (Space::Extruded, Measure::Uniform) => self.extruded_uniform,
            (Space::Extruded, Measure::Cosine) => self.extruded_cosine,
        }
    }
}

/// Antiderivative of sqrt(1 - k^2 - u^2) / (1 - u^2).
fn uniform_integral(k: f64, u: f64) -> f64 {
    let a2 = 1.0 - k * k;
    let root = (a2 - u * u).max(0.0).sqrt();
    (u / a2.sqrt()).clamp(-1.0, 1.0).asin() - k * (k * u).atan2(root)
}

/// Antiderivative of acos(k/s) + k sqrt(s^2 - k^2)/s^2, s^2 = 1 - u^2.
fn underside_cosine_integral(k: f64, u: f64) -> f64 {
    let a2 = 1.0 - k * k;
    let s = (1.0 - u * u).sqrt();
    let root = (a2 - u * u).max(0.0).sqrt();
    u * (k / s).min(1.0).acos() + a2 * (k * u).atan2(root)
}

/// Antiderivative of acos(k/c) + k sqrt(c^2 - k^2)/c^2.
fn side_cosine_integral(k: f64, c: f64) -> f64 {
    c * (k / c).min(1.0).acos() - k * (1.0 - (k / c).powi(2)).max(0.0).sqrt()
}

impl Slab {
    /// Openness of the ground at `t` from the box's middle, for rays of length
    /// `radius`; all lengths above zero, t of either sign.
    ///
    /// # Example
    /// ```
    /// use aogauge::flatland::Slab;
    /// let curtain = Slab { width: 0.02, gap: 0.10, height: 1.0 };
    /// let under = curtain.openness(0.0, 0.25).extruded_cosine;
    /// let beside = curtain.openness(0.08, 0.25).extruded_cosine;
    /// assert!(under > beside, "the artifact: brighter under the curtain");
    /// ```
    pub fn openness(&self, t: f64, radius: f64) -> Openness {
        let t = t.abs();
        let mut closed = [0.0; 4];
        let (left, right) = (-self.width / 2.0 - t, self.width / 2.0 - t);
        let k = self.gap / radius;
        if k < 1.0 {
            let reach = (1.0 - k * k).sqrt();
            // Cosine of the angle from the ground towards a corner of the underside.
            let [lo, hi] = [left, right].map(|x| (x / x.hypot(self.gap)).clamp(-reach, reach));
            closed[0] += (lo.acos() - hi.acos()) / PI;
            closed[1] += (hi - lo) / 2.0;
            closed[2] += (uniform_integral(k, hi) - uniform_integral(k, lo)) / PI;
            closed[3] += (underside_cosine_integral(k, hi) - underside_cosine_integral(k, lo)) / PI;
        }
        let k = -right / radius;
        if k > 0.0 && k < 1.0 {
            let steepest = k.acos();
            let [lo, hi] = [self.gap, self.gap + self.height].map(|y| y.atan2(-right).min(steepest));
            closed[0] += (hi - lo) / PI;
            closed[1] += (lo.cos() - hi.cos()) / 2.0;
            closed[2] += (uniform_integral(k, hi.sin()) - uniform_integral(k, lo.sin())) / PI;
            closed[3] += (side_cosine_integral(k, lo.cos()) - side_cosine_integral(k, hi.cos())) / PI;
        }
        let [flat_uniform, flat_cosine, extruded_uniform, extruded_cosine] = closed.map(|c| 1.0 - c);
        Openness { flat_uniform, flat_cosine, extruded_uniform, extruded_cosine }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matches_the_reference_to_1e_6() {
        let all: serde_json::Value = serde_json::from_str(include_str!("../../tests/reference/openness.json")).unwrap();
        let (radius, height) = (all["R"].as_f64().unwrap(), all["h"].as_f64().unwrap());
        let rows = all["rows"].as_array().unwrap();
        assert!(rows.len() > 20);
        for row in rows {
            let get = |name: &str| row[name].as_f64().unwrap();
            let slab = Slab { width: get("w"), gap: get("m"), height };
            let o = slab.openness(get("t"), radius);
            for (value, name) in [
                (o.flat_uniform, "flat_u"),
                (o.flat_cosine, "flat_c"),
                (o.extruded_uniform, "ext_u"),
                (o.extruded_cosine, "ext_c"),
            ] {
                let expected = get(name);
                assert!((value - expected).abs() < 1e-6, "{name} of {row}: {value}, expected {expected}");
            }
            assert_eq!(o, slab.openness(-get("t"), radius), "symmetric in t");
        }
    }

    #[test]
    fn out_of_reach_is_open() {
        let slab = Slab { width: 0.1, gap: 0.3, height: 1.0 };
        assert_eq!(slab.openness(0.0, 0.25).extruded_cosine, 1.0);
        let low = Slab { gap: 0.1, ..slab };
        assert_eq!(low.openness(0.4, 0.25).flat_uniform, 1.0);
    }
}
