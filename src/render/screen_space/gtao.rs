//! GTAO: the exact cosine-weighted integral between two horizons, slice by slice
//! (Jimenez, Wu, Pesce and Jarabo, "Practical Real-Time Strategies for Accurate
//! Indirect Occlusion", 2016). Twin: `gpu/shaders/gtao.wgsl`.

use super::{Point, ScreenSpace};
use glam::Vec3;

/// The openness that one slice through the line of sight sees: the mean over
/// slices at all angles is that of the point. `turned` in [0, 1) is its angle as a
/// part of half a turn.
///
/// With g the angle of the projected normal to the line of sight and h a horizon,
/// both signed, a side is open by 1/4 (-cos(2h - g) + cos g + 2 h sin g), and the
/// slice weighs as much as the projected normal is long.
pub(super) fn slice(point: &Point<'_>, method: &ScreenSpace, [turned, jitter]: [f32; 2]) -> f32 {
    let across = point.across(0.5 * turned);
    let (along, towards) = (point.normal.dot(across), point.normal.dot(point.to_eye));
    let length = (along * along + towards * towards).sqrt();
    if length < 1e-6 {
        return 0.0;
    }
    let [cos_g, sin_g] = [towards / length, along / length];
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
