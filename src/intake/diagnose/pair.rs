//! Why the ratio of a frame with AO and of one without is not openness.

use super::{
    Reference,
    agreement::{NAMED, Radius, radius},
    meaning::{SURE, explains, factor, is_as_near, is_different, is_display, left, proportion},
};
use crate::{
    counted::counted,
    intake::Curve,
    layers::{code, linear},
    metrics::image::Encoding,
};
use std::{collections::BTreeMap, fmt};

/// References above this are open: there no AO is to be seen, whatever R is.
const OPEN: f32 = 0.995;
/// Times R: where that closes nothing either, nothing that a renderer does otherwise in the reach of R is to be seen.
const WIDER: std::ops::RangeInclusive<f64> = 1.5..=4.0;
/// Sides of the blocks whose means tell how far noise reaches.
const BLOCK: usize = 16;
/// So many pixels tell a level...
const FEWEST: usize = 64;
/// ... within this, and what noise leaves of it.
const LEVEL: f64 = 0.005;
/// A level below 1 that frames are cut off at: at least so many of their pixels are there, and not more.
const CUT: [f64; 2] = [0.005, 0.9];
/// An exponent or a factor that is nearer to 1 is none.
const NEAR: f64 = 1.01;

/// A frame with AO, the same without it, and what their ratio should be.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// Linear light a pixel of the view, with AO.
    pub with: &'a [f32],
    /// Without it.
    pub without: &'a [f32],
    /// Their ratio; NaN where it is not known.
    pub ratio: &'a [f32],
    /// What the stored numbers of both were taken for.
    pub encoding: Encoding,
}

/// What may be wrong with both frames, or with one of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PairCause {
    /// Where nothing occludes, the frame with AO is so many times as bright.
    Exposure(f64),
    /// The ratio is openness to this power: the frames were encoded, or sent through a curve.
    Power(f64),
    /// Both hold sRGB codes that were taken for linear light.
    Codes,
    /// Both hold linear light that was taken for sRGB codes.
    Decoded,
    /// Both were sent through a tone curve such as v / (1 + v).
    Toned,
    /// So much light is in both that AO does not dim.
    Added(f64),
    /// AO dims this part of the light of each pixel.
    Share(f64),
    /// Both are cut off at a level, at so many pixels.
    Cut {
        /// The greatest value of the frame without AO.
        level: f32,
        /// Pixels that have it.
        count: usize,
    },
    /// R is so many times what was asked for.
    Radius(f64),
}

impl PairCause {
    /// Whether the images may not be measured as they are: no renderer means AO to be so.
    pub fn is_wrong(&self) -> bool {
        match self {
            PairCause::Exposure(_) | PairCause::Codes | PairCause::Decoded => true,
            PairCause::Power(power) => is_display(*power),
            _ => false,
        }
    }
}

impl fmt::Display for PairCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PairCause::Exposure(gain) => write!(
                f,
                "exposure: where nothing occludes, the frame with AO is {gain:.*} times as bright as the one without it; \
                 save both with the same exposure",
                if (gain - 1.0).abs() < 0.1 { 3 } else { 2 }
            ),
            PairCause::Power(power) if self.is_wrong() => write!(
                f,
                "gamma-encoded frames: their ratio is openness to the power 1/{:.1}; save linear light",
                1.0 / power
            ),
            PairCause::Power(power) => write!(
                f,
                "a curve: the ratio is openness to the power {power:.2}; set the power of the AO to 1, and save linear light"
            ),
            PairCause::Codes => {
                write!(
                    f,
                    "gamma-encoded frames: sRGB codes, not linear; declare `encoding = \"srgb\"`, or save linear light"
                )
            }
            PairCause::Decoded => write!(f, "linear frames, taken for sRGB codes; declare `encoding = \"linear\"`"),
            PairCause::Toned => write!(f, "a tone curve; save both frames before tone mapping"),
            PairCause::Added(light) => write!(
                f,
                "light that AO does not dim, {light:.3} in both frames, of lamps or emission; save frames without it"
            ),
            PairCause::Share(share) if *share > 1.0 => {
                write!(f, "AO of strength {share:.2}; set strength or intensity of the AO to 1")
            }
            PairCause::Share(share) => write!(
                f,
                "AO dims {share:.2} of the light alone: its strength is not 1, or the rest is direct or emitted light; save \
                 frames without that"
            ),
            PairCause::Cut { level, count } => write!(
                f,
                "light cut off at {level:.3}, as at {} of the frame without AO; save both darker, or as floats",
                counted(*count, "pixel", "pixels")
            ),
            PairCause::Radius(factor) => write!(f, "R of {factor:.2} times what was asked for"),
        }
    }
}

/// What explains why the ratio of two frames is not as it should be, the nearest first: all that fit
/// about as well. None where it is as it should be, and an empty list where nothing explains it.
pub fn pair_causes(pair: &Pair<'_>, reference: &Reference, size: [usize; 2]) -> Option<Vec<PairCause>> {
    let like = &reference.openness;
    let parts = [pair.with, pair.without, pair.ratio, like];
    if parts.iter().any(|p| p.len() != like.len()) || size[0].checked_mul(size[1]) != Some(like.len()) {
        return None;
    }
    let without = left(pair.ratio, like, size[0]);
    let little = little(pair, reference, size[0]);
    if !is_different(without) {
        return little.map(|cause| vec![cause]);
    }
    let tried = tried(pair, like, size[0]).into_iter().filter(|(_, ratio)| is_open_where(ratio, like));
    let explained = tried.map(|(cause, ratio)| (cause, left(&ratio, like, size[0])));
    let other = radius(pair.ratio, reference, size[0]).filter(Radius::is_told);
    let other = other.map(|r| (PairCause::Radius(r.factor), r.left));
    let mut explained: Vec<_> = explained.filter(|(_, left)| explains(*left, without)).collect();
    // Between two that are known, another R is not drawn so exactly; beside what explains it all it must be as near.
    let is_alone = explained.is_empty();
    let is_near = |left: [f64; 2]| if is_alone { left[0] < NAMED * without[0] } else { explains(left, without) };
    explained.extend(other.filter(|(_, left)| is_near(*left)));
    let Some(best) = explained.iter().map(|e| e.1).reduce(|a, b| if b[0] < a[0] { b } else { a }) else {
        return Some(little.into_iter().collect());
    };
    let fits = |left: [f64; 2]| is_as_near(left, best) || !is_different(left);
    let mut all: Vec<_> = explained.into_iter().filter(|(_, left)| fits(*left)).collect();
    all.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    // The sRGB curve is nearly a power: of the two the nearer.
    let is_curve = |cause: &PairCause| matches!(cause, PairCause::Codes | PairCause::Power(_));
    if let Some(first) = all.iter().find(|(cause, _)| is_curve(cause)).map(|(cause, _)| *cause) {
        all.retain(|(cause, _)| !is_curve(cause) || *cause == first);
    }
    Some(all.into_iter().map(|(cause, _)| cause).collect())
}

/// Exposure that differs by so little that AO hides it but where there is none, so that the ratio is as it should be or
/// nothing else explains it.
///
/// There both frames show the same light, and their ratio is 1 but for noise that they do not share: of that the spread tells, of
/// pixels and, since noise of filtered frames reaches over several, of blocks.
fn little(pair: &Pair<'_>, reference: &Reference, width: usize) -> Option<PairCause> {
    let like = &reference.openness;
    let more = reference.scaled.iter().filter(|s| s.openness.len() == like.len() && WIDER.contains(&s.factor));
    let more: Vec<&[f32]> = more.map(|s| s.openness.as_slice()).collect();
    let is_open = |i: usize| more.iter().all(|openness| openness[i] > OPEN);
    let wide = open_light(pair, like, width, &is_open).map(|found| (found, LEVEL));
    let ([level, error], least) = wide.or_else(|| Some((open_light(pair, like, width, &|_| true)?, 2.0 * LEVEL)))?;
    let undone: Vec<f32> = pair.ratio.iter().map(|v| v / level as f32).collect();
    let is_it = (level - 1.0).abs() > least + SURE * error && !is_different(left(&undone, like, width));
    is_it.then_some(PairCause::Exposure(level))
}

/// The light of the frame with AO over that of the one without it, over pixels that are open and of which `is_of` holds,
/// and its standard error; None where these are hardly any. Of sums, since noise of the frame without AO would make the mean of
/// ratios too large. The error is that of independent pixels or of independent blocks, whichever is larger.
fn open_light(pair: &Pair<'_>, like: &[f32], width: usize, is_of: &dyn Fn(usize) -> bool) -> Option<[f64; 2]> {
    let is_known = |i: &usize| pair.ratio[*i].is_finite() && like[*i] > OPEN && is_of(*i);
    let open: Vec<usize> = (0..like.len()).filter(is_known).collect();
    if open.len() < FEWEST {
        return None;
    }
    let with = |i: usize| f64::from(pair.with[i]);
    let without = |i: usize| f64::from(pair.without[i]) * f64::from(like[i]);
    let all: f64 = open.iter().map(|&i| without(i)).sum();
    let level = open.iter().map(|&i| with(i)).sum::<f64>() / all;
    let (mut pixels, mut blocks) = (0.0, BTreeMap::new());
    for &i in &open {
        let beyond = with(i) - level * without(i);
        pixels += beyond * beyond;
        *blocks.entry((i / width / BLOCK, i % width / BLOCK)).or_insert(0.0) += beyond;
    }
    // The variance of a sum of parts that are independent, whose mean is 0.
    let blocks: f64 = blocks.into_values().map(|sum: f64| sum * sum).sum();
    Some([level, pixels.max(blocks).sqrt() / all])
}

/// The ratio as it would be without each of the causes.
fn tried(pair: &Pair<'_>, like: &[f32], width: usize) -> Vec<(PairCause, Vec<f32>)> {
    let of = |make: &dyn Fn(f32, f32, f32) -> f32| -> Vec<f32> {
        let pixels = pair.with.iter().zip(pair.without).zip(pair.ratio);
        pixels.map(|((a, b), r)| if r.is_finite() { make(*a, *b, *r) } else { f32::NAN }).collect()
    };
    let is_far = |v: f64| v.is_finite() && v.max(1.0 / v) > NEAR;
    let mut all = Vec::new();
    let open = open_light(pair, like, width, &|_| true);
    let gain = open.map_or_else(|| factor(pair.ratio, like), |[level, _]| level);
    if is_far(gain) {
        all.push((PairCause::Exposure(gain), of(&|_, _, r| r / gain as f32)));
    }
    if let Some(power) = Curve::power(&[(pair.ratio, like)]).filter(|p| is_far(*p)) {
        let curve = Curve { exponent: power, ..Curve::IDENTITY };
        all.push((PairCause::Power(power), curve.undo(pair.ratio)));
    }
    match pair.encoding {
        Encoding::Linear => all.push((PairCause::Codes, of(&|a, b, _| linear(a) / linear(b)))),
        Encoding::Srgb => all.push((PairCause::Decoded, of(&|a, b, _| code(a) / code(b)))),
    }
    // Its scale is no matter: it is the same in both.
    let toned = |a: f32, b: f32| if a < 1.0 && b < 1.0 { (a / (1.0 - a)) / (b / (1.0 - b)) } else { f32::NAN };
    all.push((PairCause::Toned, of(&|a, b, _| toned(a, b))));
    let added = added(pair, like);
    if added > 0.0 {
        let light = added as f32;
        all.push((PairCause::Added(added), of(&|a, b, _| (a - light) / (b - light))));
    }
    let share = proportion(std::iter::once((pair.ratio, like)), |v| 1.0 - v);
    if is_far(share) && share > 0.0 {
        all.push((PairCause::Share(share), of(&|_, _, r| 1.0 - (1.0 - r) / share as f32)));
    }
    all.extend(cut(pair, like));
    all
}

/// The same light in both frames by which their ratio comes nearest: with = e + O (without - e), by least squares.
fn added(pair: &Pair<'_>, like: &[f32]) -> f64 {
    let pixels = pair.with.iter().zip(pair.without).zip(pair.ratio.iter().zip(like));
    let known = pixels.filter(|(_, (r, o))| r.is_finite() && o.is_finite());
    let (both, own) = known.fold((0.0, 0.0), |(both, own), ((a, b), (_, o))| {
        let [a, b, o] = [*a, *b, *o].map(f64::from);
        (both + (a - o * b) * (1.0 - o), own + (1.0 - o).powi(2))
    });
    let least = pair.without.iter().copied().filter(|v| v.is_finite()).fold(f32::INFINITY, f32::min);
    let light = both / own;
    // There is light beside it at every pixel.
    if light.is_finite() && light < 0.95 * f64::from(least) { light } else { 0.0 }
}

/// The ratio over the pixels that are not at the greatest value of the frame without AO, where many are: the frames
/// are cut off there.
fn cut(pair: &Pair<'_>, like: &[f32]) -> Option<(PairCause, Vec<f32>)> {
    let known = || (0..like.len()).filter(|&i| pair.ratio[i].is_finite() && like[i].is_finite());
    let level = known().map(|i| pair.without[i]).fold(f32::NEG_INFINITY, f32::max);
    let count = known().filter(|&i| pair.without[i] == level).count();
    let share = count as f64 / known().count().max(1) as f64;
    let rest = (0..like.len()).map(|i| if pair.without[i] < level { pair.ratio[i] } else { f32::NAN }).collect();
    (CUT[0]..CUT[1]).contains(&share).then_some((PairCause::Cut { level, count }, rest))
}

/// Mean of an image where its reference is open, and its standard error; None where that is hardly anywhere.
fn open_level(image: &[f32], like: &[f32]) -> Option<[f64; 2]> {
    let open = || image.iter().zip(like).filter(|(v, o)| v.is_finite() && **o > OPEN).map(|(v, o)| f64::from(v / o));
    let n = open().count();
    let mean = open().sum::<f64>() / n as f64;
    let variance = open().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
    (n >= FEWEST).then(|| [mean, (variance / n as f64).sqrt()])
}

/// Whether nothing is missing where the reference is open.
fn is_open_where(image: &[f32], like: &[f32]) -> bool {
    open_level(image, like).is_none_or(|[mean, error]| (mean - 1.0).abs() < LEVEL + SURE * error)
}

#[cfg(test)]
mod tests;
