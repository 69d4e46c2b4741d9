//! Openness under Eq. 2, mu(d) = 1 - exp(-sigma d), by quadrature.
//!
//! What the point sees of the box is, as for the step, the underside and perhaps the
//! near side. Along a direction at angle phi in the cross-section they lie at
//! distance q(phi); a direction that leaves the cross-section by eta meets
//! them at q/cos eta. So flatland is one smooth integral over phi a surface, and
//! extruded two.

use super::{Measure, Model, Slab, Space, quadrature::integrate};
use std::f64::consts::{FRAC_PI_2, PI};

/// What exp(-sigma d) sums to over directions that leave the cross-section from a
/// surface at distance `q` in it, per angle phi.
fn along(model: &Model, q: f64, sigma: f64, limited: bool, tolerance: f64) -> f64 {
    let steepest = if limited { (q / model.radius).min(1.0).acos() } else { FRAC_PI_2 };
    let power = match model.measure {
        Measure::Uniform => 1,
        Measure::Cosine => 2,
    };
    2.0 * integrate(|eta| (-sigma * q / eta.cos()).exp() * eta.cos().powi(power), 0.0, steepest, tolerance)
}

/// Openness of the ground at `t`, off by less than `tolerance`.
pub fn openness(model: &Model, slab: &Slab, t: f64, sigma: f64, limited: bool, tolerance: f64) -> f64 {
    let t = t.abs();
    let (left, right) = (-slab.width / 2.0 - t, slab.width / 2.0 - t);
    // Over phi from the ground, a half circle; a share of the tolerance each.
    let sum = |q: &dyn Fn(f64) -> f64, from: f64, to: f64| {
        let share = tolerance / 4.0;
        let integrand = |phi: f64| match (model.space, model.measure) {
            (Space::Flat, Measure::Uniform) => (-sigma * q(phi)).exp() / PI,
            (Space::Flat, Measure::Cosine) => (-sigma * q(phi)).exp() * phi.sin() / 2.0,
            (Space::Extruded, Measure::Uniform) => along(model, q(phi), sigma, limited, share) / (2.0 * PI),
            (Space::Extruded, Measure::Cosine) => along(model, q(phi), sigma, limited, share) * phi.sin() / PI,
        };
        integrate(integrand, from, to, share)
    };
    // Rays that end at R see of a surface at distance k R only what lies within
    // acos(k) of its foot.
    let within = |foot: f64| {
        let k = foot / model.radius;
        if limited { k.min(1.0).acos() } else { FRAC_PI_2 }
    };
    let reach = within(slab.gap);
    let [from, to] = [right, left].map(|x| slab.gap.atan2(x)).map(|a| a.clamp(FRAC_PI_2 - reach, FRAC_PI_2 + reach));
    let mut closed = sum(&|phi| slab.gap / phi.sin(), from, to);
    if right < 0.0 {
        let steepest = within(-right);
        let [from, to] = [slab.gap, slab.gap + slab.height].map(|y| y.atan2(-right).min(steepest));
        closed += sum(&|phi| -right / phi.cos(), from, to);
    }
    (1.0 - closed).clamp(0.0, 1.0)
}
