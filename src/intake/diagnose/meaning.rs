//! What the numbers of an image that lies as it should mean: openness, its codes, openness
//! through a curve, or openness of another R.

use super::{
    Finding, Reference, Scaled, agreement,
    samples::{Samples, square},
};
use crate::{intake::Curve, layers::linear};
use std::mem::discriminant;

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
/// sRGB is near the power 1/2.2; powers in this range are an encoding for display: gammas of 1.8 to 2.6 and what a fit misses them by.
const DISPLAY: [f64; 2] = [1.0 / 2.7, 1.0 / 1.7];
/// The reference must deviate by so much that a strength, one free number, can be told.
const BLENDED: f64 = 0.05;
/// What is added to openness is told from here on: methods that count the receiver's plane take away a tenth.
const ADDED: f64 = 0.15;
/// Powers go so far from 1 either way: farther, nearly all is black or white, as noise of one ray is.
const POWERS: f64 = 4.0;
/// Strengths of AO that are looked for.
const STRENGTHS: std::ops::Range<f64> = 0.05..4.0;

#[derive(Clone)]
struct Hypothesis {
    finding: Finding,
    /// Mean square of what it leaves, and its error.
    left: [f64; 2],
}

/// An image, and what it is held against.
#[derive(Clone, Copy, Debug)]
pub struct Held<'a> {
    /// Openness as it was read, a value a pixel of the view.
    pub image: &'a [f32],
    /// What it should be, as [`Reference::openness`].
    pub reference: &'a [f32],
    /// Width of the view.
    pub width: usize,
}

/// What the numbers of images mean that one renderer made in the same way, so that one finding must explain all of
/// them: an encoding, a strength, a curve or an offset, or [`Finding::Either`] of several. None where they are as they
/// should be, or where nothing explains them all.
pub fn meaning_of(held: &[Held<'_>]) -> Option<Finding> {
    let without = left_of(held, &|image| image.to_vec());
    if !is_different(without) {
        return None;
    }
    let explained = explanations(held, without);
    let best = nearest(&explained)?;
    Some(either(&explained, &best, without))
}

/// Puts what images have in common, by [`meaning_of`], in the place of what each was taken for, where that is among it.
pub fn agree(findings: &mut [Vec<Finding>], shared: &Finding) {
    let kinds = |finding: &Finding| match finding {
        Finding::Either(all) => all.iter().map(discriminant).collect(),
        one => vec![discriminant(one)],
    };
    let of_all = kinds(shared);
    for found in findings.iter_mut().flatten().filter(|f| f.is_meaning()) {
        if kinds(found).iter().any(|kind| of_all.contains(kind)) {
            *found = shared.clone();
        }
    }
}

/// What explains how an image differs from the reference, if anything does.
pub(super) fn find(image: &[f32], reference: &Reference, width: usize) -> Option<Finding> {
    let held = [Held { image, reference: &reference.openness, width }];
    let without = left(image, &reference.openness, width);
    if !is_different(without) {
        return None;
    }
    let explained = explanations(&held, without);
    let scaled: Vec<Hypothesis> = scales(image, reference, width).filter(|h| explains(h.left, without)).collect();
    let best = nearest(&[explained.as_slice(), &scaled].concat())?;
    Some(match best.finding {
        Finding::Scaled { factors } => nearer_scale(image, reference, width, best.left)
            .unwrap_or_else(|| same_scales(image, reference, width, &factors)),
        _ => either(&explained, &best, without),
    })
}

/// The hypothesis that leaves least. One free number that does nearly as well as two is rather it.
fn nearest(all: &[Hypothesis]) -> Option<Hypothesis> {
    let least = |of: &mut dyn Iterator<Item = &Hypothesis>| {
        of.reduce(|a, b| if b.left[0] < a.left[0] { b } else { a }).cloned()
    };
    let best = least(&mut all.iter())?;
    if !has_two_numbers(&best.finding) {
        return Some(best);
    }
    let one = least(&mut all.iter().filter(|h| !has_two_numbers(&h.finding)));
    one.filter(|h| h.left[0] - best.left[0] < 2.0 * h.left[1].hypot(best.left[1])).or(Some(best))
}

fn has_two_numbers(finding: &Finding) -> bool {
    matches!(finding, Finding::Curve { gain, exponent } if *gain != 1.0 && *exponent != 1.0)
}

/// The best of several explanations with all that fit about as well, the best first. Those do which leave no more
/// than the noise beyond what the best leaves, or so little that an image without any finding may differ by it.
fn either(explained: &[Hypothesis], best: &Hypothesis, without: [f64; 2]) -> Finding {
    let fits = |h: &&Hypothesis| {
        let is_as_near = is_as_near(h.left, best.left) || !is_different(h.left);
        let is_other = h.finding != best.finding && !has_two_numbers(&h.finding);
        is_other && is_as_near && explains_some(h.left, without)
    };
    // A curve of two numbers comes near to all the others.
    let mut others: Vec<&Hypothesis> =
        explained.iter().filter(|_| !has_two_numbers(&best.finding)).filter(fits).collect();
    others.sort_by(|a, b| a.left[0].total_cmp(&b.left[0]));
    let mut all = vec![best];
    for other in others {
        if !all.iter().any(|h| is_same_kind(h, other)) {
            all.push(other);
        }
    }
    let all: Vec<Finding> = all.into_iter().map(|h| h.finding.clone()).collect();
    if all.len() == 1 { best.finding.clone() } else { Finding::Either(all) }
}

/// The sRGB curve and a power are told from each other where they are made.
fn is_same_kind(a: &Hypothesis, b: &Hypothesis) -> bool {
    a.finding.is_encoded() && b.finding.is_encoded()
}

/// Whether a hypothesis explains enough of a difference to be named beside one that explains it.
fn explains_some(left: [f64; 2], without: [f64; 2]) -> bool {
    left[0] + 2.0 * left[1] < CERTAIN * without[0]
}

/// Whether what a hypothesis leaves of a difference explains it: mean squares with their errors.
pub(super) fn explains(left: [f64; 2], without: [f64; 2]) -> bool {
    let error = without[1].hypot(left[1]);
    let is_left = left[0] < LEFT * without[0] + 2.0 * left[1];
    is_left && left[0] + 2.0 * left[1] < CERTAIN * without[0] && without[0] - left[0] > SURE * error
}

/// Whether a hypothesis leaves no more than the noise beyond what the best one leaves.
pub(super) fn is_as_near(left: [f64; 2], best: [f64; 2]) -> bool {
    left[0] - best[0] < SURE * left[1].hypot(best[1])
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

/// The factor on all values of the reference that an image is nearest to, by least squares.
pub(super) fn factor(image: &[f32], reference: &[f32]) -> f64 {
    proportion(std::iter::once((image, reference)), |v| v)
}

/// The factor between what `of` makes of references and images, by least squares.
pub(super) fn proportion<'a>(pairs: impl Iterator<Item = (&'a [f32], &'a [f32])>, of: fn(f64) -> f64) -> f64 {
    let pairs = pairs.flat_map(|(image, reference)| image.iter().zip(reference));
    let pairs = pairs.map(|(a, b)| [*a, *b].map(|v| of(f64::from(v))));
    let known = pairs.filter(|p| p.iter().all(|v| v.is_finite()));
    let (both, own) = known.fold((0.0, 0.0), |(both, own), [a, b]| (both + a * b, own + b * b));
    both / own
}

/// What one free number may have made of openness, where it is such that it can be told: AO that was blended with white, a
/// factor on openness, a power of it, and something added to it. They need less variety than a curve of two numbers does.
fn by_one_number(held: &[Held<'_>]) -> Vec<Finding> {
    let pairs = || held.iter().map(|h| (h.image, h.reference));
    let is_telling = |number: f64| STRENGTHS.contains(&number) && number.max(1.0 / number) >= GAINED;
    let mut found = Vec::new();
    let strength = proportion(pairs(), |v| 1.0 - v);
    found.extend(is_telling(strength).then_some(Finding::Strength { strength }));
    let gain = proportion(pairs(), |v| v);
    found.extend(is_telling(gain).then_some(Finding::Curve { gain, exponent: 1.0 }));
    if let Some(exponent) = Curve::power(&pairs().collect::<Vec<_>>())
        && (CURVED..POWERS).contains(&exponent.max(1.0 / exponent))
    {
        found.push(of_power(1.0, exponent));
    }
    let by = Samples::of(pairs().flat_map(|(a, b)| a.iter().copied().zip(b.iter().copied()))).offset();
    found.extend((by.abs() >= ADDED).then_some(Finding::Offset { by }));
    found
}

/// Whether openness to this power is rather encoded for display than meant so.
pub(super) fn is_display(exponent: f64) -> bool {
    (DISPLAY[0]..DISPLAY[1]).contains(&exponent)
}

/// A curve, or the encoding for display that its exponent speaks for.
fn of_power(gain: f64, exponent: f64) -> Finding {
    if is_display(exponent) && (0.95..1.05).contains(&gain) {
        Finding::Encoded { gamma: Some(1.0 / exponent) }
    } else {
        Finding::Curve { gain, exponent }
    }
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
        Finding::Offset { by } => return Some(image.iter().map(|v| v - by as f32).collect()),
        Finding::Either(ref all) => return undone(all.first()?, image),
        _ => return None,
    };
    Some(curve.undo(image))
}

/// The mean square of image less reference, without noise, and its error.
pub(super) fn left(image: &[f32], reference: &[f32], width: usize) -> [f64; 2] {
    square(&image.iter().zip(reference).map(|(a, b)| a - b).collect::<Vec<_>>(), width)
}

/// The same over several images, as pixels, with `undo` applied to each.
fn left_of(held: &[Held<'_>], undo: &dyn Fn(&[f32]) -> Vec<f32>) -> [f64; 2] {
    let each = held.iter().map(|h| (h.image.len() as f64, left(&undo(h.image), h.reference, h.width)));
    let known = each.filter(|(_, [_, error])| error.is_finite());
    let (n, sum, squares) = known.fold((0.0, 0.0, 0.0), |(n, sum, squares), (pixels, [left, error])| {
        (n + pixels, sum + pixels * left, squares + (pixels * error).powi(2))
    });
    if n > 0.0 { [sum / n, f64::sqrt(squares) / n] } else { [0.0, f64::INFINITY] }
}

/// The images as codes, by one free number, and through a curve: what explains how they differ. Codes come first, as
/// they have no free number.
fn explanations(held: &[Held<'_>], without: [f64; 2]) -> Vec<Hypothesis> {
    let hypothesis = |finding: Finding| {
        let left = left_of(held, &|image| undone(&finding, image).unwrap_or_else(|| image.to_vec()));
        Hypothesis { finding, left }
    };
    let of = |h: &Held<'_>| h.image.iter().copied().zip(h.reference.iter().copied()).collect::<Vec<_>>();
    let deviation = Samples::of(held.iter().flat_map(of)).deviation();
    let mut found = vec![hypothesis(Finding::Encoded { gamma: None })];
    if deviation >= BLENDED {
        found.extend(by_one_number(held).into_iter().map(hypothesis));
    }
    let pairs: Vec<(&[f32], &[f32])> = held.iter().map(|h| (h.image, h.reference)).collect();
    if deviation >= VARIED
        && let Some(Curve { gain, exponent, .. }) = Curve::fit(&pairs)
        && (exponent.max(1.0 / exponent) >= CURVED || gain.max(1.0 / gain) >= GAINED)
    {
        found.push(hypothesis(of_power(gain, exponent)));
    }
    // What the sRGB curve explains nearly as well as a power is that.
    let codes = found[0].left[0];
    let is_codes = |h: &Hypothesis| {
        let is_power = matches!(h.finding, Finding::Encoded { gamma: Some(_) });
        is_power && codes < 2.0 * h.left[0] + 1e-5 + SURE * h.left[1]
    };
    found.retain(|h| explains(h.left, without) && !is_codes(h));
    // Noise of few rays makes a power of another method where openness hardly varies: it is named beside others alone.
    let is_power = |h: &Hypothesis| match h.finding {
        Finding::Curve { exponent, .. } => exponent != 1.0,
        Finding::Encoded { gamma } => gamma.is_some(),
        _ => false,
    };
    if deviation < VARIED && found.iter().all(is_power) {
        found.clear();
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
