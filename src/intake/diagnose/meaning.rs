//! What the numbers of an image that lies as it should mean: openness, its codes, openness
//! through a curve, or openness of another R.

use super::{
    Finding, Reference, Scaled, agreement,
    samples::{Samples, square},
};
use crate::{intake::Curve, layers::linear};

/// Root mean square, noise taken away, from which on a difference is looked into.
pub(super) const DIFFERENT: f64 = 0.015;
/// What is left of the mean square difference under a hypothesis that is taken, a fifth as
/// far. The right one leaves its noise; other estimators, held against classic AO, are
/// nearer to classic AO of another R, or through a curve, but not so near.
const LEFT: f64 = 0.04;
/// And what noise may hide of it.
const CERTAIN: f64 = 0.2;
/// A curve has two free numbers and bends one estimator into another where openness hardly
/// varies: the reference must deviate by so much...
const VARIED: f64 = 0.2;
/// ... and the curve must be worth the name: exponent or gain so many times more or less than 1.
const CURVED: f64 = 1.25;
const GAINED: f64 = 1.15;
/// Standard errors between two hypotheses that are told from each other.
pub(super) const SURE: f64 = 4.0;
/// sRGB is near the power 1/2.2; powers in this range are an encoding for display.
const DISPLAY: [f64; 2] = [1.0 / 2.7, 1.0 / 1.7];
/// The reference must deviate by so much that a strength, one free number, can be told.
const BLENDED: f64 = 0.05;
/// Strengths of AO that are looked for.
const STRENGTHS: std::ops::Range<f64> = 0.05..4.0;

#[derive(Clone)]
struct Hypothesis {
    finding: Finding,
    /// Mean square of what it leaves, and its error.
    left: [f64; 2],
}

/// What explains how an image differs from the reference, if anything does.
pub(super) fn find(image: &[f32], reference: &Reference, width: usize) -> Option<Finding> {
    let without = left(image, &reference.openness, width);
    if !is_different(without) {
        return None;
    }
    let hypotheses = values(image, reference, width).into_iter().chain(scales(image, reference, width));
    let blended = strength(image, reference, width).filter(|h| explains(h.left, without));
    let hypotheses = hypotheses.chain(gain(image, reference, width));
    let hypotheses = hypotheses.filter(|h| explains(h.left, without)).chain(blended.clone());
    let best = hypotheses.reduce(|a, b| if b.left[0] < a.left[0] { b } else { a })?;
    // One free number that does nearly as well as two is rather it.
    if let (Finding::Curve { .. }, Some(blended)) = (&best.finding, &blended)
        && blended.left[0] - best.left[0] < 2.0 * blended.left[1].hypot(best.left[1])
    {
        return Some(blended.finding.clone());
    }
    Some(match best.finding {
        Finding::Scaled { factors } => nearer_scale(image, reference, width, best.left)
            .unwrap_or_else(|| same_scales(image, reference, width, &factors)),
        Finding::Encoded { gamma, .. } => {
            let alike = |h: &Hypothesis| h.left[0] - best.left[0] < SURE * h.left[1].hypot(best.left[1]);
            let strength = blended.filter(alike).and_then(|h| match h.finding {
                Finding::Strength { strength } => Some(strength),
                _ => None,
            });
            Finding::Encoded { gamma, strength }
        }
        other => other,
    })
}

/// Whether what a hypothesis leaves of a difference explains it: mean squares with their errors.
pub(super) fn explains(left: [f64; 2], without: [f64; 2]) -> bool {
    let error = without[1].hypot(left[1]);
    let is_left = left[0] < LEFT * without[0] + 2.0 * left[1];
    is_left && left[0] + 2.0 * left[1] < CERTAIN * without[0] && without[0] - left[0] > SURE * error
}

/// Whether a difference, a mean square with its error, is worth an explanation.
pub(super) fn is_different(without: [f64; 2]) -> bool {
    without[0] >= DIFFERENT * DIFFERENT + SURE * without[1]
}

/// Whether another scene's picture explains how an image differs from the reference.
pub(super) fn is_rather(image: &[f32], reference: &[f32], other: &[f32], width: usize) -> bool {
    let without = left(image, reference, width);
    is_different(without) && explains(left(image, other, width), without)
}

/// AO that was blended with white: a factor on occlusion.
fn strength(image: &[f32], reference: &Reference, width: usize) -> Option<Hypothesis> {
    let strength = proportion(image, &reference.openness, |v| 1.0 - v);
    by_one_number(image, reference, width, strength, Finding::Strength { strength })
}

/// A factor on openness: it needs less variety to be told than a curve does.
fn gain(image: &[f32], reference: &Reference, width: usize) -> Option<Hypothesis> {
    let gain = factor(image, &reference.openness);
    by_one_number(image, reference, width, gain, Finding::Curve { gain, exponent: 1.0 })
}

/// The factor on all values of the reference that an image is nearest to, by least squares.
pub(super) fn factor(image: &[f32], reference: &[f32]) -> f64 {
    proportion(image, reference, |v| v)
}

/// The factor between what `of` makes of reference and image, by least squares.
fn proportion(image: &[f32], reference: &[f32], of: fn(f64) -> f64) -> f64 {
    let pairs = image.iter().zip(reference).map(|(a, b)| [*a, *b].map(|v| of(f64::from(v))));
    let known = pairs.filter(|p| p.iter().all(|v| v.is_finite()));
    let (both, own) = known.fold((0.0, 0.0), |(both, own), [a, b]| (both + a * b, own + b * b));
    both / own
}

/// What a finding of one free number leaves, where scene and number are such that it can be told.
fn by_one_number(
    image: &[f32],
    reference: &Reference,
    width: usize,
    number: f64,
    finding: Finding,
) -> Option<Hypothesis> {
    let reference = &reference.openness;
    let is_even = Samples::new(image, reference).deviation() < BLENDED;
    if is_even || !STRENGTHS.contains(&number) || number.max(1.0 / number) < GAINED {
        return None;
    }
    let left = left(&undone(&finding, image)?, reference, width);
    Some(Hypothesis { finding, left })
}

/// The image as it would be without what was found.
pub(super) fn undone(finding: &Finding, image: &[f32]) -> Option<Vec<f32>> {
    let curve = match *finding {
        Finding::Encoded { gamma: None, .. } => return Some(image.iter().map(|v| linear(*v)).collect()),
        Finding::Encoded { gamma: Some(gamma), .. } => Curve { exponent: 1.0 / gamma, ..Curve::IDENTITY },
        Finding::Curve { gain, exponent } => Curve { gain, exponent, ..Curve::IDENTITY },
        Finding::Strength { strength } => {
            return Some(image.iter().map(|v| 1.0 - (1.0 - v) / strength as f32).collect());
        }
        _ => return None,
    };
    Some(curve.undo(image))
}

/// The mean square of image less reference, without noise, and its error.
pub(super) fn left(image: &[f32], reference: &[f32], width: usize) -> [f64; 2] {
    square(&image.iter().zip(reference).map(|(a, b)| a - b).collect::<Vec<_>>(), width)
}

/// The image as codes, and through a curve. Codes come first: they have no free number.
fn values(image: &[f32], reference: &Reference, width: usize) -> Vec<Hypothesis> {
    let left_by = |finding: &Finding| undone(finding, image).map(|u| left(&u, &reference.openness, width));
    let srgb = Finding::Encoded { gamma: None, strength: None };
    let mut found = Vec::new();
    if let Some(left) = left_by(&srgb) {
        found.push(Hypothesis { finding: srgb, left });
    }
    if Samples::new(image, &reference.openness).deviation() < VARIED {
        return found;
    }
    let Some(curve) = Curve::fit(&[(image, reference.openness.as_slice())]) else { return found };
    let (gain, exponent) = (curve.gain, curve.exponent);
    let apart = |v: f64| v.max(1.0 / v);
    if apart(exponent) < CURVED && apart(gain) < GAINED {
        return found;
    }
    let is_display = (DISPLAY[0]..DISPLAY[1]).contains(&exponent) && (0.95..1.05).contains(&gain);
    let finding = if is_display {
        Finding::Encoded { gamma: Some(1.0 / exponent), strength: None }
    } else {
        Finding::Curve { gain, exponent }
    };
    let Some(left) = left_by(&finding) else { return found };
    // What the sRGB curve explains nearly as well is that.
    let is_srgb = is_display && found.iter().any(|h| h.left[0] < 2.0 * left[0] + 1e-5 + SURE * left[1]);
    if !is_srgb {
        found.push(Hypothesis { finding, left });
    }
    found
}

fn scales<'a>(image: &'a [f32], reference: &'a Reference, width: usize) -> impl Iterator<Item = Hypothesis> + 'a {
    let usable = reference.scaled.iter().filter(|s| s.openness.len() == image.len());
    usable.map(move |Scaled { factor, openness }| Hypothesis {
        finding: Finding::Scaled { factors: vec![*factor] },
        left: left(image, openness, width),
    })
}

/// A factor between those that are known, where an image is nearer to that by more than noise leaves: the
/// remedy of the nearest known one would be wrong.
fn nearer_scale(image: &[f32], reference: &Reference, width: usize, known: [f64; 2]) -> Option<Finding> {
    let found = agreement::radius(image, reference, width)?;
    let is_nearer = known[0] - found.left[0] > SURE * known[1].hypot(found.left[1]);
    let [low, high] = found.between;
    let finding = || match found.is_told() {
        true => Finding::Scaled { factors: vec![found.factor] },
        false => Finding::Between { low, high },
    };
    is_nearer.then(finding)
}

/// All factors that the scene looks the same with as with the best of them, which comes first.
fn same_scales(image: &[f32], reference: &Reference, width: usize, best: &[f64]) -> Finding {
    let of = |factor: f64| reference.scaled.iter().find(|s| s.factor == factor).map(|s| &s.openness);
    let chosen = best.first().and_then(|f| of(*f));
    let is_same = |s: &&Scaled| {
        let [apart, _] = chosen.map_or([f64::INFINITY; 2], |c| left(c, &s.openness, width));
        apart < DIFFERENT * DIFFERENT && s.openness.len() == image.len()
    };
    let others = reference.scaled.iter().filter(is_same).map(|s| s.factor).filter(|f| !best.contains(f));
    Finding::Scaled { factors: best.iter().copied().chain(others).collect() }
}
