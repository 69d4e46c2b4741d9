//! What is wrong with an image, told by comparing it with a reference under each hypothesis.
//!
//! Four questions in this order, each with what the one before it found undone: whether its
//! numbers are in range ([`range`]), how the image lies ([`place`]), what its numbers mean
//! ([`meaning`]), and by how much it is shifted ([`shift`]). Margins are stated where they are used; all of them are measured
//! against images of 4 rays and of 1 ray, and of other estimators.

mod agreement;
mod meaning;
mod pair;
mod place;
mod range;
mod samples;
mod shift;
#[cfg(test)]
mod tests;

pub use agreement::{Cause, Disagreement, agreement};
pub use meaning::{Held, agree, meaning_of};
pub use pair::{Pair, PairCause, pair_causes};
pub use place::{Turn, alike};

use crate::{
    counted::counted,
    metrics::regions::{Region, Regions},
};
use samples::Samples;
use std::{borrow::Cow, fmt};

/// What an image is held against.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reference {
    /// Openness with many rays, a value a pixel of the view; NaN where it sees no surface.
    /// Best of the image's own estimator, else of `classic`.
    pub openness: Vec<f32>,
    /// The same with other R. Only factors that are here can be told; [`FACTORS`] are those
    /// that mistaken units lead to.
    pub scaled: Vec<Scaled>,
}

impl Reference {
    /// A converged image over the pixels that see a surface, with no other R.
    pub fn over(converged: &[f32], regions: &Regions) -> Self {
        let mut openness = vec![f32::NAN; converged.len()];
        for &i in regions.pixels(Region::All) {
            openness[i as usize] = converged[i as usize];
        }
        Reference { openness, scaled: Vec::new() }
    }
}

/// Openness with another R.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaled {
    /// Times R; above 0, not 1.
    pub factor: f64,
    /// Openness with it, as [`Reference::openness`].
    pub openness: Vec<f32>,
}

/// Factors of R that mistaken units lead to: centimetres, inches, decimetres and feet taken
/// for metres, a radius taken for a diameter, and the other way round.
pub const FACTORS: [f64; 10] = [0.01, 1.0 / 39.37, 0.1, 1.0 / 3.28, 0.5, 2.0, 3.28, 10.0, 39.37, 100.0];

/// Standard deviation from which on an image, and its reference, tell one encoding from another.
const TELLING: f64 = 0.03;

/// Something that is wrong with an image, by [`diagnose`].
#[derive(Clone, Debug, PartialEq)]
pub enum Finding {
    /// It has another number of pixels than the reference; nothing else is told.
    Size {
        /// Pixels that it has.
        found: usize,
        /// Pixels that it should have.
        expected: usize,
    },
    /// Pixels that see a surface hold no finite number.
    Holes {
        /// How many.
        count: usize,
        /// How many of them are infinite, and not NaN.
        infinite: usize,
        /// Column and row of the first.
        first: [usize; 2],
    },
    /// Its values are of another scale than 0 to 1.
    Range {
        /// The least of them, as they were stored.
        least: f32,
        /// The greatest.
        most: f32,
        /// What they must be divided by; None where no usual scale explains them.
        scale: Option<f64>,
        /// Pixels that are more than 1 out of range, on either side.
        count: usize,
        /// Column and row of the farthest.
        farthest: [usize; 2],
    },
    /// Openness below 0.
    Negative {
        /// Pixels.
        count: usize,
        /// The least value.
        least: f32,
        /// Whether openness runs from -1 to 1.
        is_signed: bool,
        /// Whether so few pixels are that a filter may have left them.
        is_doubt: bool,
    },
    /// It is the same everywhere, where the scene is not; nothing else is told.
    Constant {
        /// The value.
        value: f32,
    },
    /// It is mirrored or turned.
    Turned(Turn),
    /// 1 means closed.
    Inverted,
    /// It was encoded for display: openness to the power 1 / `gamma`.
    Encoded {
        /// None: the sRGB curve.
        gamma: Option<f64>,
    },
    /// Its numbers were linear before they were decoded as the sRGB codes that they were declared to be, by
    /// [`super::examine`].
    Decoded,
    /// AO was blended with white: 1 - `strength` * (1 - openness).
    Strength {
        /// 1 is as it should be.
        strength: f64,
    },
    /// It was sent through a curve, gain * openness ^ exponent.
    Curve {
        /// Gain.
        gain: f64,
        /// Exponent.
        exponent: f64,
    },
    /// The same was added to openness everywhere.
    Offset {
        /// Below 0 it was taken away.
        by: f64,
    },
    /// One of several, which the images cannot tell from each other; two or more, the nearest first.
    Either(Vec<Finding>),
    /// R is not what was asked for. Several factors where the scene looks the same with each.
    Scaled {
        /// Times R.
        factors: Vec<f64>,
    },
    /// R is not what was asked for, and lies between two factors that are too far apart to tell which it is.
    Between {
        /// The lower, times R.
        low: f64,
        /// The higher.
        high: f64,
    },
    /// It lies beside the reference.
    Shifted {
        /// Columns to the right and rows down, in halves of a pixel.
        pixels: [f64; 2],
    },
    /// It is like no picture of this scene.
    Unlike {
        /// Its correlation with the reference, without the image's noise: 1 is alike.
        correlation: f64,
    },
}

/// What is wrong with an image of openness, `size` pixels wide and high: all that is found,
/// each with its remedy as its text. Nothing where nothing is.
///
/// What a scene cannot tell, since it looks the same the other way round, is not found;
/// [`alike`] names it.
pub fn diagnose(image: &[f32], reference: &Reference, size: [usize; 2]) -> Vec<Finding> {
    let expected = reference.openness.len();
    if image.len() != expected || size[0].checked_mul(size[1]) != Some(expected) || expected == 0 {
        return vec![Finding::Size { found: image.len(), expected }];
    }
    let mut findings = Vec::new();
    if let Some(holes) = holes(image, &reference.openness, size[0]) {
        findings.push(holes);
    }
    let seen = Samples::new(image, &reference.openness);
    if seen.pairs() == 0 {
        return findings;
    }
    if let Some(value) = seen.constant() {
        findings.push(Finding::Constant { value });
        return findings;
    }
    if let Some(black) = black(image, &reference.openness) {
        findings.push(black);
        return findings;
    }
    let ranged = range::find(image, &reference.openness, size[0]);
    let (ranged, image) = ranged.map_or((None, Cow::Borrowed(image)), |(f, i)| (Some(f), Cow::Owned(i)));
    findings.extend(ranged);
    let placed = place::find(&image, reference, size);
    if placed.correlation < place::LEAST {
        let shifted = shift::far(&image, &reference.openness, size).map(|pixels| Finding::Shifted { pixels });
        findings.push(shifted.unwrap_or(Finding::Unlike { correlation: placed.correlation }));
        return findings;
    }
    findings.extend(turned(&placed));
    findings.extend(placed.inverted.then_some(Finding::Inverted));
    let upright = placed.undone(&image, size);
    let meaning = meaning::find(&upright, reference, size[0]);
    let factor = match &meaning {
        Some(Finding::Scaled { factors }) => factors.first().copied(),
        Some(Finding::Between { low, high }) => Some((low * high).sqrt()),
        _ => None,
    };
    let plain = meaning.as_ref().and_then(|m| meaning::undone(m, &upright)).unwrap_or(upright);
    let is_explained = meaning.is_some();
    findings.extend(meaning);
    let apart = |s: &Scaled| factor.map_or(f64::INFINITY, |f| (s.factor / f).ln().abs());
    let nearest = reference.scaled.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).filter(|_| factor.is_some());
    let like = nearest.map_or(&reference.openness, |s| &s.openness);
    let shifted = shift::find(&plain, like, size);
    let far = || if is_explained { None } else { shift::far(&plain, like, size) };
    findings.extend(shifted.or_else(far).map(|pixels| Finding::Shifted { pixels }));
    findings
}

/// How an image lies, where it lies otherwise than it should.
fn turned(placed: &place::Placed) -> Option<Finding> {
    let all: Vec<Finding> = [&[placed.turn], placed.or.as_slice()].concat().into_iter().map(Finding::Turned).collect();
    match placed.turn {
        Turn::None => None,
        turn if placed.or.is_empty() => Some(Finding::Turned(turn)),
        _ => Some(Finding::Either(all)),
    }
}

/// Whether an image that is not like its reference is like `other`, that of another scene: the
/// difference from it is a fraction of that from its own, by the noise.
pub fn is_rather(image: &[f32], reference: &[f32], other: &[f32], width: usize) -> bool {
    image.len() == reference.len() && image.len() == other.len() && meaning::is_rather(image, reference, other, width)
}

/// How a whole frame lies beside what it may show: openness, or light, by which of them tells it
/// best. Only what is plain is told: much of a frame is neither.
///
/// None where it lies as it should, or cannot be told.
pub fn frame_turn(light: &[f32], like: &[&[f32]], size: [usize; 2]) -> Option<Turn> {
    let fits = size[0].checked_mul(size[1]) == Some(light.len());
    if fits { place::turn_of_frame(light, like, size) } else { None }
}

/// How far an image is from the reference, mean square without its noise, however it lies.
pub(super) fn distance(image: &[f32], reference: &Reference, size: [usize; 2]) -> f64 {
    let upright = place::find(image, reference, size).undone(image, size);
    meaning::left(&upright, &reference.openness, size[0])[0]
}

/// Whether an image tells what its numbers stand for: it and its reference vary.
pub(super) fn is_telling(image: &[f32], reference: &Reference, size: [usize; 2]) -> bool {
    let whole = image.len() == reference.openness.len() && size[0].checked_mul(size[1]) == Some(image.len());
    let both = Samples::new(image, &reference.openness);
    // Of its own deviation.
    let own = Samples::new(&reference.openness, image);
    whole && both.pairs() > 0 && both.deviation() >= TELLING && own.deviation() >= TELLING
}

/// 0 to the last bit at every pixel of a scene that is nearly open everywhere. Openness that is drawn
/// the wrong way round is so on an open plane alone, and the remedy names that, too.
fn black(image: &[f32], reference: &[f32]) -> Option<Finding> {
    let known = image.iter().zip(reference).filter(|(v, r)| v.is_finite() && r.is_finite());
    let is_black = known.clone().all(|(v, _)| *v == 0.0) && known.clone().any(|(_, r)| *r > 0.05);
    is_black.then_some(Finding::Constant { value: 0.0 })
}

fn holes(image: &[f32], reference: &[f32], width: usize) -> Option<Finding> {
    let mut holes = (0..image.len()).filter(|&i| reference[i].is_finite() && !image[i].is_finite());
    let first = holes.next()?;
    let (mut count, mut infinite) = (1, usize::from(image[first].is_infinite()));
    for i in holes {
        (count, infinite) = (count + 1, infinite + usize::from(image[i].is_infinite()));
    }
    Some(Finding::Holes { count, infinite, first: [first % width, first / width] })
}

impl Finding {
    /// What was found, in a few words.
    pub fn title(&self) -> String {
        match self {
            Finding::Size { found, expected } => {
                format!("wrong size: {}, not {expected}", counted(*found, "pixel", "pixels"))
            }
            Finding::Holes { count, infinite, first: [x, y] } => {
                let what = match *infinite {
                    0 => "NaN",
                    n if n == *count => "infinity",
                    _ => "NaN and infinity",
                };
                let hold = counted(*count, "pixel that sees a surface holds", "pixels that see a surface hold");
                format!("{what}: {hold} no number, the first at column {x}, row {y}")
            }
            Finding::Range { least, most, scale, count, farthest: [x, y] } => {
                let at = match scale {
                    Some(_) => String::new(),
                    None => {
                        let are = counted(*count, "pixel is", "pixels are");
                        format!("; {are} more than 1 beyond that, the farthest at column {x}, row {y}")
                    }
                };
                let [least, most] = [*least, *most].map(number);
                format!("out of range: values run from {least} to {most}, where openness is 0 to 1{at}")
            }
            Finding::Negative { count, least, is_signed, .. } => {
                let signed = if *is_signed { ", as if it ran from -1 to 1" } else { "" };
                let are = counted(*count, "pixel is", "pixels are");
                format!("negative openness: {are} below 0, the least is {least:.3}{signed}")
            }
            Finding::Constant { value: 0.0 } => "black: 0 everywhere, as of a buffer that was cleared".to_owned(),
            Finding::Constant { value } => format!("constant: {value} everywhere"),
            Finding::Turned(turn) => turn.title().to_owned(),
            Finding::Inverted => "inverted: 1 is closed".to_owned(),
            Finding::Encoded { gamma } => {
                let how =
                    gamma.map_or("sRGB codes, not linear".to_owned(), |g| format!("openness to the power 1/{g:.1}"));
                format!("gamma-encoded: {how}")
            }
            Finding::Offset { by } => format!("an offset: {by:+.2} on openness everywhere"),
            Finding::Either(all) => {
                let titles: Vec<String> = all.iter().map(Finding::title).collect();
                format!("{}; which of them, these images cannot tell", titles.join(", or "))
            }
            Finding::Decoded => "decoded twice: declared as sRGB codes, but its numbers are linear".to_owned(),
            Finding::Strength { strength } => {
                format!("AO of strength {strength:.2}: 1 - {strength:.2} times occlusion")
            }
            Finding::Curve { gain, exponent } => {
                format!("a curve: {gain:.2} times openness to the power {exponent:.2}")
            }
            Finding::Scaled { factors } => {
                let factors: Vec<String> = factors.iter().map(|f| written(*f)).collect();
                format!("scaled scene: R is {} times what was asked for", factors.join(" or "))
            }
            Finding::Between { low, high } => {
                format!("scaled scene: R is between {} and {} times what was asked for", written(*low), written(*high))
            }
            Finding::Shifted { pixels: [x, y] } => {
                let of = |n: f64, one, many| if n.abs() == 1.0 { format!("{n} {one}") } else { format!("{n} {many}") };
                format!("shifted by {} and {}", of(*x, "column", "columns"), of(*y, "row", "rows"))
            }
            Finding::Unlike { correlation } => {
                format!("another picture: its correlation with the reference is {correlation:.2}")
            }
        }
    }

    /// Whether the image may be measured all the same, since it may be meant to be so.
    pub fn is_doubt(&self) -> bool {
        match self {
            Finding::Curve { .. } | Finding::Strength { .. } | Finding::Offset { .. } | Finding::Shifted { .. } => true,
            Finding::Either(all) => all.first().is_some_and(Finding::is_doubt),
            Finding::Negative { is_doubt, .. } => *is_doubt,
            _ => false,
        }
    }

    /// Whether it is codes for display, or these first of all.
    pub fn is_encoded(&self) -> bool {
        match self {
            Finding::Encoded { .. } => true,
            Finding::Either(all) => all.first().is_some_and(Finding::is_encoded),
            _ => false,
        }
    }

    /// Whether it says what numbers stand for, and not where pixels lie or which are missing.
    pub fn is_meaning(&self) -> bool {
        match self {
            Finding::Encoded { .. } | Finding::Strength { .. } | Finding::Curve { .. } | Finding::Offset { .. } => true,
            Finding::Either(all) => all.iter().all(Finding::is_meaning),
            _ => false,
        }
    }

    /// What to do about it.
    pub fn remedy(&self) -> String {
        match self {
            Finding::Size { .. } => "render as many pixels as the view has, or declare `resolution`".to_owned(),
            Finding::Holes { .. } => "look for a division by zero, or pixels that the AO pass leaves out".to_owned(),
            Finding::Range { scale: Some(scale), .. } => format!("divide by {scale}"),
            Finding::Range { scale: None, .. } => {
                "save the AO buffer alone, before it meets light or exposure, and look for a division by nearly zero"
                    .to_owned()
            }
            Finding::Negative { is_signed: true, .. } => "save (v + 1) / 2".to_owned(),
            Finding::Negative { .. } => {
                "save openness itself: a filter that sharpens, or an intensity above 1, leaves such values".to_owned()
            }
            Finding::Constant { value: 0.0 } => {
                "save the AO buffer itself, after it was drawn; if 1 is closed in it, declare `means = \"occlusion\"`"
                    .to_owned()
            }
            Finding::Constant { .. } => "save the AO buffer itself: this one was cleared and not drawn".to_owned(),
            Finding::Turned(turn) => turn.remedy().to_owned(),
            Finding::Inverted => "declare `means = \"occlusion\"`, or save 1 - occlusion".to_owned(),
            Finding::Decoded => "declare `encoding = \"linear\"`".to_owned(),
            Finding::Strength { .. } => {
                "set strength, intensity or opacity of the AO to 1, or save its buffer before it is blended".to_owned()
            }
            Finding::Offset { .. } => "save openness as it is, with nothing added to it or taken from it".to_owned(),
            Finding::Either(_) => "hand in the image of the self-check, which can".to_owned(),
            Finding::Encoded { gamma: None } => {
                "declare `encoding = \"srgb\"`, or save the buffer without a view transform".to_owned()
            }
            Finding::Encoded { gamma: Some(gamma) } => format!(
                "save the buffer without a view transform, or declare `curve = {{ gain = 1.0, exponent = {:.3} }}`",
                1.0 / gamma
            ),
            Finding::Curve { gain, exponent } => format!(
                "set intensity and power of the AO to 1, or declare `curve = \"fit\"`, or \
                 `curve = {{ gain = {gain:.2}, exponent = {exponent:.2} }}`"
            ),
            Finding::Scaled { factors } => {
                let all =
                    |f: &dyn Fn(f64) -> f64| factors.iter().map(|v| written(f(*v))).collect::<Vec<_>>().join(" or ");
                format!(
                    "one unit of the glb is a metre, and R is in metres: multiply the radius by {}, or the scene by {}",
                    all(&|v| 1.0 / v),
                    all(&|v| v)
                )
            }
            Finding::Between { .. } => {
                "one unit of the glb is a metre, and R is in metres: print both as the renderer has them".to_owned()
            }
            Finding::Shifted { .. } => {
                "take samples at pixel centres of the camera `measure`, without jitter, and crop nothing".to_owned()
            }
            Finding::Unlike { .. } => {
                "check scene, camera `measure` and that this is the AO buffer; compare positions with gbuffer.exr"
                    .to_owned()
            }
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.title(), self.remedy())
    }
}

/// A value as people read it: of many digits with a power of ten.
pub(super) fn number(v: f32) -> String {
    if v.abs() < 1e6 { format!("{v:.3}") } else { format!("{v:.2e}") }
}

/// A factor as people write it: below 1 as a fraction.
fn written(factor: f64) -> String {
    let number = |v: f64| format!("{}", (v * 100.0).round() / 100.0);
    if factor < 0.999 { format!("1/{}", number(1.0 / factor)) } else { number(factor) }
}
