//! By how much an image lies beside its reference.

use super::{
    meaning::{explains, is_different, left},
    samples::Samples,
};

/// Whole pixels that are tried each way.
const REACH: isize = 3;
/// Whole pixels must explain this much more of the image's variance, as a share of what is
/// explained without.
const GAIN: f64 = 0.02;
/// Along an axis where neighbours in the reference differ by less than this, root mean square,
/// nothing is told: there another estimator looks like a shift.
const SHARP: f64 = 0.03;
/// Less than this part of a pixel is no shift: filters and upsampling of other programs may
/// lean so far.
const LEAST: f64 = 0.3;
/// Standard errors of a part of a pixel.
const SURE: f64 = 6.0;
/// Pixels that at least must be compared.
const FEWEST: usize = 64;

/// Columns to the right and rows down that an image is shifted by, in halves of a pixel; None
/// where it is not, or where the reference has no edges to tell it by. First whole pixels, by correlation; then the rest from gradients (Lucas
/// and Kanade 1981), beside a gain and an offset of the image. Gradients tell a shift from a
/// blur, which lies on both sides.
pub(super) fn find(image: &[f32], reference: &[f32], size: [usize; 2]) -> Option<[f64; 2]> {
    let share = |by: [isize; 2]| {
        let moved = moved(reference, size, by);
        let samples = Samples::new(image, &moved);
        if samples.pairs() < FEWEST { 0.0 } else { samples.correlation().max(0.0).powi(2) }
    };
    let sharp = [[1, 0], [0, 1]].map(|by| apart(reference, &moved(reference, size, by)) > SHARP);
    let reach = sharp.map(|s| if s { REACH } else { 0 });
    let none = share([0, 0]);
    let all = (-reach[1]..=reach[1]).flat_map(|dy| (-reach[0]..=reach[0]).map(move |dx| [dx, dy]));
    let (best, most) = all.map(|by| (by, share(by))).fold(([0, 0], none), |a, b| if b.1 > a.1 { b } else { a });
    let whole = if most > none * (1.0 + GAIN) + GAIN / 4.0 { best } else { [0, 0] };
    let (part, error) = parts(image, &moved(reference, size, whole), size)?;
    let halves: [f64; 2] = std::array::from_fn(|axis| {
        let is_part = sharp[axis] && part[axis].abs() > LEAST && part[axis].abs() > SURE * error[axis];
        let part = if is_part { part[axis] } else { 0.0 };
        // Adding 0 makes the zero positive.
        ((whole[axis] as f64 + part) * 2.0).round() / 2.0 + 0.0
    });
    (halves != [0.0, 0.0]).then_some(halves)
}

/// Whole pixels that a smooth picture is tried at each way.
const FAR: isize = 8;

/// The same for pictures without edges, in whole pixels: by how far the shifted reference explains
/// what the image differs by. Only a shift that explains nearly all of it is told, so that
/// another estimator is none; of those that do as well the smallest.
pub(super) fn far(image: &[f32], reference: &[f32], size: [usize; 2]) -> Option<[f64; 2]> {
    let without = left(image, reference, size[0]);
    if !is_different(without) {
        return None;
    }
    let all = (-FAR..=FAR).flat_map(|dy| (-FAR..=FAR).map(move |dx| [dx, dy])).filter(|by| *by != [0, 0]);
    let tried: Vec<([isize; 2], [f64; 2])> =
        all.map(|by| (by, left(image, &moved(reference, size, by), size[0]))).collect();
    let least = tried.iter().map(|(_, left)| left[0]).fold(f64::INFINITY, f64::min);
    let as_good = tried.into_iter().filter(|(_, left)| left[0] < least + 2.0 * left[1] + 0.01 * without[0]);
    let (by, left) = as_good.min_by_key(|(by, _)| by[0] * by[0] + by[1] * by[1])?;
    explains(left, without).then(|| by.map(|v| v as f64))
}

/// Root mean square difference of two pictures, where both hold numbers.
fn apart(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).filter(|s| s.is_finite());
    let (sum, n) = squares.fold((0.0, 0.0), |(sum, n), s| (sum + s, n + 1.0));
    if n > 0.0 { (sum / n).sqrt() } else { 0.0 }
}

/// The picture moved by whole pixels; NaN where it comes from beyond its edge.
fn moved(picture: &[f32], [width, height]: [usize; 2], [dx, dy]: [isize; 2]) -> Vec<f32> {
    let at = |i: usize| {
        let (x, y) = ((i % width) as isize - dx, (i / width) as isize - dy);
        let inside = x >= 0 && y >= 0 && (x as usize) < width && (y as usize) < height;
        if inside { picture[y as usize * width + x as usize] } else { f32::NAN }
    };
    (0..picture.len()).map(at).collect()
}

/// Least squares of the image over 1, the reference, and its slopes along columns and rows:
/// the shifts in pixels, and their standard errors.
fn parts(image: &[f32], reference: &[f32], size: [usize; 2]) -> Option<([f64; 2], [f64; 2])> {
    let [width, height] = size;
    let rows: Vec<[f64; 5]> = (1..height.saturating_sub(1))
        .flat_map(|y| (1..width.saturating_sub(1)).map(move |x| y * width + x))
        .map(|i| {
            let at = |i: usize| f64::from(reference[i]);
            let slope = |step: usize| (at(i + step) - at(i - step)) / 2.0;
            [1.0, at(i), slope(1), slope(width), f64::from(image[i])]
        })
        .filter(|row| row.iter().all(|v| v.is_finite()))
        .collect();
    if rows.len() < FEWEST {
        return None;
    }
    let mut normal = [[0.0; 8]; 4];
    for (i, line) in normal.iter_mut().enumerate() {
        for row in &rows {
            (0..4).for_each(|j| line[j] += row[i] * row[j]);
        }
        line[4 + i] = 1.0;
    }
    let inverse = inverted(normal)?;
    let right: [f64; 4] = std::array::from_fn(|i| rows.iter().map(|r| r[i] * r[4]).sum());
    let fit: [f64; 4] = std::array::from_fn(|i| (0..4).map(|j| inverse[i][j] * right[j]).sum());
    let residual = |r: &[f64; 5]| r[4] - (0..4).map(|i| fit[i] * r[i]).sum::<f64>();
    let variance = rows.iter().map(|r| residual(r).powi(2)).sum::<f64>() / (rows.len() - 4) as f64;
    let gain = fit[1];
    if gain <= 0.0 {
        return None;
    }
    Some(([-fit[2] / gain, -fit[3] / gain], [2, 3].map(|i| (variance * inverse[i][i]).sqrt() / gain)))
}

/// The right half of a matrix beside the unit matrix, after elimination; None where it has no
/// inverse.
fn inverted(mut m: [[f64; 8]; 4]) -> Option<[[f64; 4]; 4]> {
    for i in 0..4 {
        let largest = (i..4).max_by(|&a, &b| m[a][i].abs().total_cmp(&m[b][i].abs()))?;
        m.swap(i, largest);
        if m[i][i].abs() < 1e-12 {
            return None;
        }
        let pivot = m[i].map(|v| v / m[i][i]);
        for (j, line) in m.iter_mut().enumerate() {
            let factor = line[i];
            for (v, p) in line.iter_mut().zip(pivot) {
                *v = if j == i { p } else { *v - factor * p };
            }
        }
    }
    Some(m.map(|line| std::array::from_fn(|i| line[4 + i])))
}
