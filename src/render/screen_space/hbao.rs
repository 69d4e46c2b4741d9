//! HBAO: how far the horizon rises over the tangent plane, direction by direction
//! (Bavoil, Sainz and Dimitrov, "Image-Space Horizon-Based Ambient Occlusion",
//! 2008). Twin: `gpu/shaders/hbao.wgsl`.

use super::{Point, ScreenSpace};

/// What one direction of the image is open: 1 - (sin h - sin t), h the angle of
/// the horizon and t that of the tangent plane, both over the plane across the
/// line of sight. Each sample that rises above those before it adds its own rise
/// by its own weight. `turned` in [0, 1) is the direction as a part of a turn.
/// `bias` is cosine and sine of the angle by which the tangent plane is lifted.
pub(super) fn direction(
    point: &Point<'_>,
    method: &ScreenSpace,
    [cos_bias, sin_bias]: [f32; 2],
    [turned, jitter]: [f32; 2],
) -> f32 {
    let across = point.across(turned);
    let (along, towards) = (point.normal.dot(across), point.normal.dot(point.to_eye));
    let length = (along * along + towards * towards).sqrt();
    if length < 1e-6 {
        return 1.0;
    }
    let [cos_t, sin_t] = [towards / length, -along / length];
    // Lifted beyond the line of sight there is nothing that could rise above it.
    let below = cos_t * cos_bias - sin_t * sin_bias > 0.0;
    let mut highest = if below { sin_t * cos_bias + cos_t * sin_bias } else { 1.0 };
    let mut closed = 0.0;
    let way = point.way(across);
    for j in 0..method.steps {
        if let Some(seen) = point.horizon(&way, point.place(method, j, jitter), method.falloff)
            && seen.cosine > highest
        {
            closed += (seen.cosine - highest) * seen.weight;
            highest = seen.cosine;
        }
    }
    1.0 - closed
}
