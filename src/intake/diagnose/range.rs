//! Numbers that no openness has: those of another scale, and those below 0.

use super::{Finding, meaning::left};

/// Openness above this is of another scale, or of no openness at all...
const TOP: f32 = 2.0;
/// ... and below this, as far out of range, where so few are there that no scale and no curve has brought them.
const BOTTOM: f32 = -1.0;
/// The highest codes that integers have, and percent.
const SCALES: [f64; 5] = [100.0, 255.0, 1023.0, 4095.0, 65_535.0];
/// What is left of the mean square of the reference at the right scale: less than half. At a wrong
/// one the image is near 0 and nearly all of it is left.
const LEFT: f64 = 0.5;
/// Values below 0 that rounding and filters leave do not go further.
const BELOW: f32 = -0.05;
/// Nor are they so many: shares of all pixels, from which on they are told, and from which on nothing
/// else can be meant.
const FEW: f64 = 0.01;
const MANY: f64 = 0.05;
/// Openness as -1 to 1 is so many times nearer to its reference once it is brought to 0 to 1.
const SIGNED: f64 = 4.0;

/// What is wrong with the range of an image, and the image as it would be without.
pub(super) fn find(image: &[f32], reference: &[f32], width: usize) -> Option<(Finding, Vec<f32>)> {
    let seen = || image.iter().zip(reference).filter(|(v, r)| v.is_finite() && r.is_finite()).map(|(v, _)| *v);
    let (least, most) = seen().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, m), v| (l.min(v), m.max(v)));
    let all = seen().count().max(1) as f64;
    // What was declared to be occlusion is 1 - v by now. A few pixels so far below are no scale.
    let low = seen().filter(|v| *v < -TOP).count() as f64;
    let closed = least < -1.0 - TOP && most <= TOP && low > FEW * all;
    let at = |scale: f64, v: f32| if closed { 1.0 - (1.0 - v) / scale as f32 } else { v / scale as f32 };
    let is_outlier = least < BOTTOM && seen().filter(|v| *v < BOTTOM).count() as f64 <= FEW * all;
    if most > TOP || least < -1.0 - TOP || is_outlier {
        let (count, farthest) = beyond(image, reference, width);
        let [least, most] = if closed { [1.0 - most, 1.0 - least] } else { [least, most] };
        let scale = scale(image, reference, width, f64::from(most), &at);
        // What else is wrong is told by the other pixels.
        let is_kept = |v: f32| scale.is_some() || (BOTTOM..=TOP).contains(&v);
        let undone = |v: &f32| if is_kept(*v) { at(scale.unwrap_or(1.0), *v) } else { f32::NAN };
        let undone = image.iter().map(undone).collect();
        return Some((Finding::Range { least, most, scale, count, farthest }, undone));
    }
    let below = seen().filter(|v| *v < BELOW).count();
    let share = below as f64 / all;
    if share <= FEW {
        return None;
    }
    let unsigned: Vec<f32> = image.iter().map(|v| (v + 1.0) / 2.0).collect();
    let far = |image: &[f32]| left(image, reference, width)[0].max(0.0);
    let is_signed = least >= -1.0 + BELOW && SIGNED * far(&unsigned) < far(image);
    let finding =
        Finding::Negative { count: below, least, is_signed, is_doubt: share < MANY && !is_signed && least >= BOTTOM };
    Some((finding, if is_signed { unsigned } else { image.to_vec() }))
}

/// How many pixels that see a surface are beyond what openness gets to, and where the farthest is.
fn beyond(image: &[f32], reference: &[f32], width: usize) -> (usize, [usize; 2]) {
    let seen = image.iter().zip(reference).enumerate().filter(|(_, (v, r))| v.is_finite() && r.is_finite());
    let far = |v: f32| if v < 0.0 { -v } else { v - 1.0 };
    let beyond = seen.map(|(i, (v, _))| (i, far(*v))).filter(|(_, far)| *far > TOP - 1.0);
    let (count, at, _) = beyond.fold(
        (0, 0, 0.0),
        |(n, at, most), (i, far)| {
            if far > most { (n + 1, i, far) } else { (n + 1, at, most) }
        },
    );
    (count, [at % width.max(1), at / width.max(1)])
}

/// The scale at which an image is nearest to its reference or to what it would be inverted, where
/// it comes near.
fn scale(image: &[f32], reference: &[f32], width: usize, most: f64, at: &dyn Fn(f64, f32) -> f32) -> Option<f64> {
    let inverted: Vec<f32> = reference.iter().map(|v| 1.0 - v).collect();
    let none = vec![0.0; reference.len()];
    let far = |scale: f64, to: &[f32]| {
        let scaled: Vec<f32> = image.iter().map(|v| at(scale, *v)).collect();
        let all = left(&none, to, width)[0];
        if all > 0.0 { left(&scaled, to, width)[0] / all } else { f64::INFINITY }
    };
    let tried = SCALES.into_iter().filter(|s| *s > 0.98 * most);
    let tried = tried.map(|s| (s, far(s, reference).min(far(s, &inverted))));
    tried.reduce(|a, b| if b.1 < a.1 { b } else { a }).filter(|(_, far)| *far < LEFT).map(|(scale, _)| scale)
}
