//! The extended method, summed exactly over all directions of a vertical plane.
//!
//! Cut the extruded world by the vertical plane through the shaded point at
//! azimuth psi, 0 being across the box. It holds the normal n, so it holds with
//! the primary ray w also d2 = w x d1, and meets the box in a rectangle: that of
//! the cross-section, stretched horizontally by 1/cos psi. In it, primary and second
//! secondary ray make a T of fixed size that turns about the point with the
//! primary's angle theta. What closes them changes only where an end of the T
//! crosses a side of the rectangle or the T sweeps over a corner: angles with
//! closed forms. The first secondary ray, along d1, leaves the plane
//! horizontally; whether it is closed changes where its middle enters the box's
//! heights or its end reaches the box's side, again in closed form.
//!
//! Between these angles nothing changes, so weights are summed exactly, and only
//! psi is left to quadrature. Flatland is the one plane psi = 0: there d1 stands
//! on it, runs along the box, and is never closed where the primary is open.

use super::{Measure, Model, ReceiverPlane, Slab, Space, quadrature::integrate};
use std::f64::consts::{FRAC_PI_2, PI};

/// A vertical plane through the shaded point, which is its origin; x along the
/// plane, y up.
struct Plane {
    /// The box: least and greatest x, least and greatest y.
    x: [f64; 2],
    y: [f64; 2],
    /// R and R'.
    radius: f64,
    secondary: f64,
    /// How far d1's ends reach in x, in this plane's stretched coordinates.
    aside: f64,
    receiver_plane: ReceiverPlane,
}

/// Angles within the half circle, ascending. 64 hold all that a plane has.
struct Angles {
    list: [f64; 64],
    len: usize,
}

impl Angles {
    fn new() -> Self {
        let mut list = [0.0; 64];
        [list[0], list[1]] = [-FRAC_PI_2, FRAC_PI_2];
        Angles { list, len: 2 }
    }

    /// Adds an angle; one that is not there (asin of more than 1 is NaN) or not
    /// above the ground is left out.
    fn push(&mut self, angle: f64) {
        if angle.abs() < FRAC_PI_2 && self.len < self.list.len() {
            self.list[self.len] = angle;
            self.len += 1;
        }
    }

    fn sorted(&mut self) -> &[f64] {
        let list = &mut self.list[..self.len];
        list.sort_unstable_by(f64::total_cmp);
        list
    }
}

impl Plane {
    fn corners(&self) -> impl Iterator<Item = [f64; 2]> {
        self.x.into_iter().flat_map(|x| self.y.map(|y| [x, y]))
    }

    /// Every angle from the normal at which a decision may change.
    fn critical(&self) -> Angles {
        let mut angles = Angles::new();
        let half = self.radius / 2.0;
        let (end, delta) = (half.hypot(self.secondary), self.secondary.atan2(half));
        for x in self.x {
            angles.push((x / self.radius).asin());
            let at = (x / end).asin();
            for turn in [-delta, delta] {
                angles.push(at + turn);
                angles.push(PI.copysign(at) - at + turn);
            }
        }
        for y in self.y {
            let [primary, second, first] = [y / self.radius, y / end, y / half].map(f64::acos);
            for sign in [-1.0, 1.0] {
                angles.push(sign * primary);
                angles.push(sign * first);
                angles.push(sign * second - delta);
                angles.push(sign * second + delta);
            }
        }
        for [x, y] in self.corners() {
            let towards = x.atan2(y);
            let swept = (half / x.hypot(y)).acos();
            for angle in [towards, towards - swept, towards + swept] {
                angles.push(angle);
            }
        }
        for x in [self.x[0] - self.aside, self.x[1] + self.aside] {
            angles.push((x / half).asin());
        }
        if self.receiver_plane == ReceiverPlane::Counts {
            angles.push(delta - FRAC_PI_2);
            angles.push(FRAC_PI_2 - delta);
        }
        angles
    }

    /// Whether the box holds a point of `from` + s `along`, s in [0, 1].
    fn meets(&self, from: [f64; 2], along: [f64; 2]) -> bool {
        let (mut enter, mut leave) = (0.0f64, 1.0f64);
        for (axis, [lo, hi]) in [self.x, self.y].into_iter().enumerate() {
            let (o, d) = (from[axis], along[axis]);
            if d == 0.0 {
                if o < lo || o > hi {
                    return false;
                }
                continue;
            }
            let [a, b] = [(lo - o) / d, (hi - o) / d];
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter <= leave
    }

    /// What a direction at `theta` from the normal counts: 0, 1/2 or 1.
    fn scale(&self, theta: f64) -> f64 {
        let (sin, cos) = theta.sin_cos();
        if self.meets([0.0, 0.0], [self.radius * sin, self.radius * cos]) {
            return 0.0;
        }
        let (half, reach) = (self.radius / 2.0, self.secondary);
        let [x, y] = [half * sin, half * cos];
        let first = self.y[0] <= y && y <= self.y[1] && self.x[0] - self.aside <= x && x <= self.x[1] + self.aside;
        // The box hangs over the ground: to cut the ray there changes nothing.
        let ground = self.receiver_plane == ReceiverPlane::Counts && reach * sin.abs() > y;
        let second = ground || self.meets([x - reach * cos, y + reach * sin], [2.0 * reach * cos, -2.0 * reach * sin]);
        1.0 - f64::from(u8::from(first) + u8::from(second)) / 2.0
    }

    /// Openness of the plane; `weight` is the antiderivative of the directions'
    /// density over the half circle, which sums to 1.
    fn openness(&self, weight: impl Fn(f64) -> f64) -> f64 {
        let mut angles = self.critical();
        let mut sum = 0.0;
        for pair in angles.sorted().windows(2) {
            if pair[1] > pair[0] {
                sum += self.scale((pair[0] + pair[1]) / 2.0) * (weight(pair[1]) - weight(pair[0]));
            }
        }
        sum
    }
}

/// Openness of the ground at `t`, off by less than `tolerance` (extruded) or by
/// rounding (flat).
pub fn openness(
    model: &Model,
    slab: &Slab,
    t: f64,
    secondary: f64,
    receiver_plane: ReceiverPlane,
    tolerance: f64,
) -> f64 {
    // No end of a secondary ray is further from the point than this.
    let beneath = slab.gap > (model.radius / 2.0).hypot(secondary);
    if beneath && receiver_plane == ReceiverPlane::Clipped {
        return slab.openness(t, model.radius).of(model.space, model.measure);
    }
    by_planes(model, slab, t, secondary, receiver_plane, tolerance)
}

/// The same, without a look at whether any secondary ray reaches the box.
pub(super) fn by_planes(
    model: &Model,
    slab: &Slab,
    t: f64,
    secondary: f64,
    receiver_plane: ReceiverPlane,
    tolerance: f64,
) -> f64 {
    let t = t.abs();
    let across = [-slab.width / 2.0 - t, slab.width / 2.0 - t];
    let plane = |psi: f64| {
        let (sin, cos) = psi.sin_cos();
        Plane {
            x: across.map(|x| x / cos),
            y: [slab.gap, slab.gap + slab.height],
            radius: model.radius,
            secondary,
            aside: secondary * sin / cos,
            receiver_plane,
        }
    };
    let value = match (model.space, model.measure) {
        (Space::Flat, Measure::Uniform) => plane(0.0).openness(|a| a / PI),
        (Space::Flat, Measure::Cosine) => plane(0.0).openness(|a| a.sin() / 2.0),
        (Space::Extruded, measure) => {
            // Planes turn about the normal: the density has a factor |sin theta|.
            let weight: fn(f64) -> f64 = match measure {
                Measure::Uniform => |a| (1.0 - a.cos()).copysign(a) / 2.0,
                Measure::Cosine => |a| a.sin().powi(2).copysign(a) / 2.0,
            };
            let around = |psi| plane(psi).openness(weight) / FRAC_PI_2;
            integrate(around, 0.0, FRAC_PI_2, tolerance)
        }
    };
    value.clamp(0.0, 1.0)
}
