//! GTAO: the exact cosine-weighted integral between two horizons, slice by slice
//! (Jimenez, Wu, Pesce and Jarabo, "Practical Real-Time Strategies for Accurate
//! Indirect Occlusion", 2016), or sector by sector, where what the image shows has
//! a thickness (Therrien, Levesque and Gilet, "Screen Space Indirect Lighting with
//! Visibility Bitmask", 2023). Twin: `gpu/shaders/gtao.wgsl`.

use super::{Point, ScreenSpace};
use crate::render::sampler::turn;
use glam::Vec3;

/// The openness that one slice through the line of sight sees: the mean over
/// slices at all angles is that of the point. `turned` in [0, 1) is its angle as a
/// part of half a turn.
///
/// With g the angle of the projected normal to the line of sight and h a horizon,
/// both signed, a side is open by 1/4 (-cos(2h - g) + cos g + 2 h sin g), and the
/// slice weighs as much as the projected normal is long.
pub(super) fn slice(
    point: &Point<'_>,
    method: &ScreenSpace,
    thickness: Option<f32>,
    [turned, jitter]: [f32; 2],
) -> f32 {
    let across = point.across(0.5 * turned);
    let (along, towards) = (point.normal.dot(across), point.normal.dot(point.to_eye));
    let length = (along * along + towards * towards).sqrt();
    if length < 1e-6 {
        return 0.0;
    }
    let [cos_g, sin_g] = [towards / length, along / length];
    if let Some(thickness) = thickness {
        let g = arc_cosine(cos_g).copysign(sin_g);
        let closed = |side| sectors(point, method, thickness, &Side { direction: across * side, side, g }, jitter);
        return length * open(closed(1.0) | closed(-1.0), g, cos_g, sin_g);
    }
    // Horizons lie within a right angle of the normal: cos(g + 90 degrees) is
    // -sin g.
    let forth = horizon(point, method, across, jitter, -sin_g);
    let back = horizon(point, method, -across, jitter, sin_g);
    length * (arc(forth, 1.0, cos_g, sin_g) + arc(back, -1.0, cos_g, sin_g))
}

/// The cosine of the highest horizon to one side, not below `lowest`. A sample
/// that counts in part lifts the horizon by that part.
fn horizon(point: &Point<'_>, method: &ScreenSpace, direction: Vec3, jitter: f32, lowest: f32) -> f32 {
    let way = point.way(direction);
    let mut highest = lowest;
    for j in 0..method.steps {
        if let Some(seen) = point.horizon(&way, point.place(method, j, jitter), method.falloff) {
            highest = highest.max(lowest + (seen.cosine - lowest) * seen.weight);
        }
    }
    highest
}

/// How open one side is: from the line of sight to the horizon of this cosine.
fn arc(cosine: f32, side: f32, cos_g: f32, sin_g: f32) -> f32 {
    let h = side * arc_cosine(cosine);
    let sine = side * (1.0 - cosine * cosine).max(0.0).sqrt();
    let [cos_2h, sin_2h] = [2.0 * cosine * cosine - 1.0, 2.0 * sine * cosine];
    0.25 * (cos_g - (cos_2h * cos_g + sin_2h * sin_g) + 2.0 * h * sin_g)
}

/// Parts of the half circle about the projected normal, a bit each.
pub const SECTORS: u32 = 32;

/// One side of a slice.
struct Side {
    direction: Vec3,
    /// 1 or -1.
    side: f32,
    /// The signed angle of the projected normal.
    g: f32,
}

/// The sectors that samples to one side close: those whose middles lie between
/// the front of a sample and its back.
fn sectors(point: &Point<'_>, method: &ScreenSpace, thickness: f32, side: &Side, jitter: f32) -> u32 {
    let way = point.way(side.direction);
    let mut closed = 0;
    for j in 0..method.steps {
        if let Some(seen) = point.horizon(&way, point.place(method, j, jitter), method.falloff) {
            let back = point.cosine(point.behind(seen.there, thickness));
            closed |= between(side.sector(seen.cosine), side.sector(back));
        }
    }
    closed
}

impl Side {
    /// Where the angle of this cosine lies, in sectors.
    fn sector(&self, cosine: f32) -> f32 {
        let share = (self.side * arc_cosine(cosine) - self.g) * std::f32::consts::FRAC_1_PI + 0.5;
        share.clamp(0.0, 1.0) * SECTORS as f32
    }
}

/// The sectors whose middles lie between two places.
fn between(a: f32, b: f32) -> u32 {
    let first = (a.min(b) - 0.5).ceil() as u32;
    let end = (a.max(b) + 0.5).floor() as u32;
    let below = |n: u32| if n >= SECTORS { u32::MAX } else { (1 << n) - 1 };
    if end > first { below(end) & !below(first) } else { 0 }
}

/// How open the sectors are that nothing closes: each weighs the integral between
/// its ends.
fn open(closed: u32, g: f32, cos_g: f32, sin_g: f32) -> f32 {
    let integral = |k: u32| {
        // h = g - 90 degrees + k/32 of 180; then cos(2h - g) is -cos(g + k/32 of
        // a turn).
        let h = g + (k as f32 / SECTORS as f32 - 0.5) * std::f32::consts::PI;
        let [cos, sin] = turn(k as f32 / SECTORS as f32);
        let half = 0.25 * (cos_g + (cos_g * cos - sin_g * sin) + 2.0 * h * sin_g);
        half.copysign(h)
    };
    let mut sum = 0.0;
    let mut start = integral(0);
    for k in 0..SECTORS {
        let end = integral(k + 1);
        if closed >> k & 1 == 0 {
            sum += end - start;
        }
        start = end;
    }
    sum
}

/// Arc cosine by one polynomial on both sides (Abramowitz and Stegun, 4.4.46):
/// that of GPUs is too loose. Error below 1e-6.
fn arc_cosine(x: f32) -> f32 {
    let a = x.abs();
    let p = 0.006_670_09 + a * -0.001_262_491_1;
    let p = 0.030_891_88 + a * (-0.017_088_126 + a * p);
    let p = 0.088_978_99 + a * (-0.050_174_303 + a * p);
    let p = std::f32::consts::FRAC_PI_2 + a * (-0.214_598_8 + a * p);
    let angle = (1.0 - a).max(0.0).sqrt() * p;
    if x < 0.0 { std::f32::consts::PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arc_cosine_is_the_angle() {
        for i in -1000..=1000 {
            let x = i as f32 / 1000.0;
            assert!((f64::from(arc_cosine(x)) - f64::from(x).acos()).abs() < 1e-6, "{x}");
        }
    }

    /// With no sector closed the sectors are the arc from horizon to horizon; one
    /// that is closed takes away its own part.
    #[test]
    fn sectors_make_up_the_half_circle() {
        for g in [-1.2f32, -0.3, 0.0, 0.7] {
            let (sin, cos) = g.sin_cos();
            let whole = arc(-sin, 1.0, cos, sin) + arc(sin, -1.0, cos, sin);
            assert!((open(0, g, cos, sin) - whole).abs() < 1e-5, "{g}");
            assert_eq!(open(u32::MAX, g, cos, sin), 0.0);
            let parts: f32 = (0..32).map(|k| whole - open(1 << k, g, cos, sin)).sum();
            assert!((parts - whole).abs() < 1e-5, "{g}");
        }
        assert_eq!(between(0.0, 32.0), u32::MAX);
        assert_eq!(between(3.6, 0.4), 0b1111);
        assert_eq!(between(5.6, 6.4), 0);
        assert_eq!(between(31.2, 32.0), 1 << 31);
    }

    /// Against the sum over angles of cos(angle - g) |sin angle|.
    #[test]
    fn an_arc_is_the_integral_of_its_side() {
        for (h, g) in [(0.3f64, 0.2f64), (1.2, -0.3), (0.9, 1.1), (1.5, 0.0)] {
            let n = 200_000;
            let integral: f64 = (0..n)
                .map(|i| (f64::from(i) + 0.5) / f64::from(n) * h)
                .map(|a| (a - g).cos() * a.sin() * h / f64::from(n))
                .sum();
            let own = arc(h.cos() as f32, 1.0, g.cos() as f32, g.sin() as f32);
            assert!((f64::from(own) - integral).abs() < 1e-5, "{h} {g}: {own} against {integral}");
        }
    }
}
