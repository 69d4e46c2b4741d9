//! Whether an image agrees with its reference as a whole, and with which R it would.

use super::{
    Finding, Reference,
    meaning::{DIFFERENT, SURE, factor, is_as_near, left, undone},
};
use std::fmt;

/// Sides of the blocks that are compared by their means: antialiasing and noise hardly move these.
const BLOCK: usize = 8;
/// Steps that R is looked for in between two of the reference.
const STEPS: u32 = 12;
/// Known factors must lie nearer to each other than so many times for one between them to be told.
const APART: f64 = 2.1;
/// What is left of the mean square difference with another R that is named.
pub(super) const NAMED: f64 = 0.25;

/// By how much an image does not agree with its reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// Root mean square of the differences of blocks, without noise.
    pub rms: f64,
    /// Mean of the differences.
    pub mean: f64,
    /// What brings the image near: all that do about as well, the nearest first.
    pub causes: Vec<Cause>,
}

/// What may make an image differ from its reference as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cause {
    /// R is about so many times what was asked for.
    Radius(f64),
    /// All values are so many times what is expected.
    Gain(f64),
}

impl Disagreement {
    /// By how much, and why, where that is known.
    pub fn because(&self, why: &str) -> String {
        let Disagreement { rms, mean, .. } = self;
        format!(
            "it does not agree with what is expected: mean difference {mean:+.4}, root mean square {rms:.4} over blocks of \
             {BLOCK} x {BLOCK} pixels; {why}"
        )
    }
}

impl fmt::Display for Disagreement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let told = |cause: &Cause| match cause {
            Cause::Radius(factor) => {
                format!("R or scale may be off: R looks like {factor:.2} times what was asked for")
            }
            Cause::Gain(gain) => {
                format!("exposure or intensity may be off: all looks like {gain:.2} times what is expected")
            }
        };
        let why: Vec<String> = self.causes.iter().map(told).collect();
        let why = if why.is_empty() { "R or scale may be off".to_owned() } else { why.join("; or: ") };
        f.write_str(&self.because(&why))
    }
}

/// Whether an image differs from its reference by more than noise leaves, once what was found is undone. One that
/// is shifted cannot be told.
pub fn agreement(image: &[f32], reference: &Reference, size: [usize; 2], found: &[Finding]) -> Option<Disagreement> {
    let is_other = image.len() != reference.openness.len() || size[0] == 0;
    if is_other || found.iter().any(|f| matches!(f, Finding::Shifted { .. })) {
        return None;
    }
    let plain = found.iter().find_map(|f| undone(f, image));
    let [rms, mean] = differs(plain.as_deref().unwrap_or(image), &reference.openness, size[0])?;
    let without = left(image, &reference.openness, size[0])[0];
    let other = radius(image, reference, size[0]).filter(Radius::is_told).map(|r| (Cause::Radius(r.factor), r.left));
    let gain = factor(image, &reference.openness);
    let plain: Vec<f32> = image.iter().map(|v| v / gain as f32).collect();
    let gain = (Cause::Gain(gain), left(&plain, &reference.openness, size[0]));
    let mut named: Vec<_> = other.into_iter().chain([gain]).filter(|(_, left)| left[0] < NAMED * without).collect();
    named.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
    let best = named.first().map_or([f64::INFINITY; 2], |(_, left)| *left);
    named.retain(|(_, left)| is_as_near(*left, best));
    Some(Disagreement { rms, mean, causes: named.into_iter().map(|(cause, _)| cause).collect() })
}

/// Root mean square, without noise, and mean of the differences of blocks, where they are worth an explanation.
fn differs(image: &[f32], reference: &[f32], width: usize) -> Option<[f64; 2]> {
    let across = width.div_ceil(BLOCK);
    let mut blocks = vec![[0.0f64; 3]; across * (image.len() / width).div_ceil(BLOCK)];
    for (i, (a, b)) in image.iter().zip(reference).enumerate() {
        let d = f64::from(a - b);
        if d.is_finite() {
            let [n, sum, squares] = &mut blocks[i / width / BLOCK * across + i % width / BLOCK];
            (*n, *sum, *squares) = (*n + 1.0, *sum + d, *squares + d * d);
        }
    }
    let (mut count, mut signal, mut error, mut mean) = (0.0, 0.0, 0.0, 0.0);
    for [n, sum, squares] in blocks.into_iter().filter(|[n, ..]| *n >= (BLOCK * BLOCK / 2) as f64) {
        let own = sum / n;
        // Variance of the block's mean.
        let noise = ((squares / n - own * own) / (n - 1.0)).max(0.0);
        (count, mean) = (count + 1.0, mean + own);
        (signal, error) = (signal + own * own - noise, error + 2.0 * noise * noise + 4.0 * own * own * noise);
    }
    let (signal, error) = (signal / count, error.sqrt() / count);
    (signal > DIFFERENT * DIFFERENT + SURE * error).then(|| [signal.sqrt(), mean / count])
}

/// The R by which an image is nearest to its reference.
pub(super) struct Radius {
    /// Times what was asked for.
    pub factor: f64,
    /// The known ones that it lies between.
    pub between: [f64; 2],
    /// The mean square that is left, with its error.
    pub left: [f64; 2],
}

impl Radius {
    /// Whether the factor itself can be told: farther apart, walls come into reach that neither of the two sees alone.
    pub fn is_told(&self) -> bool {
        self.between[1] < APART * self.between[0]
    }
}

/// It, looked for between those that are known.
pub(super) fn radius(image: &[f32], reference: &Reference, width: usize) -> Option<Radius> {
    let usable = reference.scaled.iter().filter(|s| s.openness.len() == image.len() && s.factor > 0.0);
    let mut known: Vec<(f64, &[f32])> = usable.map(|s| (s.factor, s.openness.as_slice())).collect();
    known.push((1.0, &reference.openness));
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    let steps = |pair| (0..=STEPS).map(move |step| (pair, f64::from(step) / f64::from(STEPS)));
    let tried = known.windows(2).flat_map(steps).map(|(pair, t)| {
        let [(low, a), (high, b)] = [pair[0], pair[1]];
        let mixed: Vec<f32> = a.iter().zip(b).map(|(a, b)| a + (b - a) * t as f32).collect();
        Radius { factor: low * (high / low).powf(t), between: [low, high], left: left(image, &mixed, width) }
    });
    tried.reduce(|a, b| if b.left[0] < a.left[0] { b } else { a })
}
