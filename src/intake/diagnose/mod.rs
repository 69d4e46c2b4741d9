//! What is wrong with an image, told by comparing it with a reference under each hypothesis.
//!
//! Three questions in this order, each with what the one before it found undone:
//! how the image lies ([`place`]), what its numbers mean ([`meaning`]), and by how much it
//! is shifted ([`shift`]). Margins are stated where they are used; all of them are measured
//! against images of 4 rays and of 1 ray, and of other estimators.

mod meaning;
mod place;
mod samples;
mod shift;
#[cfg(test)]
mod tests;

pub use place::{Turn, alike};

use samples::Samples;
use std::fmt;

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
        /// Column and row of the first.
        first: [usize; 2],
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
    /// It was sent through a curve, gain * openness ^ exponent.
    Curve {
        /// Gain.
        gain: f64,
        /// Exponent.
        exponent: f64,
    },
    /// R is not what was asked for. Several factors where the scene looks the same with each.
    Scaled {
        /// Times R.
        factors: Vec<f64>,
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
    let placed = place::find(image, reference, size);
    if placed.correlation < place::LEAST {
        findings.push(Finding::Unlike { correlation: placed.correlation });
        return findings;
    }
    findings.extend((placed.turn != Turn::None).then_some(Finding::Turned(placed.turn)));
    findings.extend(placed.inverted.then_some(Finding::Inverted));
    let upright = placed.undone(image, size);
    let meaning = meaning::find(&upright, reference, size[0]);
    let factor = match &meaning {
        Some(Finding::Scaled { factors }) => factors.first().copied(),
        _ => None,
    };
    let plain = meaning.as_ref().and_then(|m| meaning::undone(m, &upright)).unwrap_or(upright);
    findings.extend(meaning);
    let like = reference.scaled.iter().find(|s| Some(s.factor) == factor).map_or(&reference.openness, |s| &s.openness);
    findings.extend(shift::find(&plain, like, size).map(|pixels| Finding::Shifted { pixels }));
    findings
}

/// How far an image is from the reference, mean square without its noise, however it lies.
pub(super) fn distance(image: &[f32], reference: &Reference, size: [usize; 2]) -> f64 {
    let upright = place::find(image, reference, size).undone(image, size);
    meaning::left(&upright, &reference.openness, size[0])[0]
}

/// Whether an image can be compared with the reference at all: of its size, and not the same
/// everywhere where it is not.
pub(super) fn faults_aside(image: &[f32], reference: &Reference, size: [usize; 2]) -> bool {
    let whole = image.len() == reference.openness.len() && size[0].checked_mul(size[1]) == Some(image.len());
    whole && Samples::new(image, &reference.openness).pairs() > 0
}

fn holes(image: &[f32], reference: &[f32], width: usize) -> Option<Finding> {
    let mut holes = (0..image.len()).filter(|&i| reference[i].is_finite() && !image[i].is_finite());
    let first = holes.next()?;
    Some(Finding::Holes { count: 1 + holes.count(), first: [first % width, first / width] })
}

impl Finding {
    /// What was found, in a few words.
    pub fn title(&self) -> String {
        match self {
            Finding::Size { found, expected } => format!("wrong size: {found} pixels, not {expected}"),
            Finding::Holes { count, first: [x, y] } => {
                format!("NaN: {count} pixels that see a surface hold no number, the first at column {x}, row {y}")
            }
            Finding::Constant { value } => format!("constant: {value} everywhere"),
            Finding::Turned(turn) => turn.title().to_owned(),
            Finding::Inverted => "inverted: 1 is closed".to_owned(),
            Finding::Encoded { gamma: None } => "gamma-encoded: sRGB codes, not linear".to_owned(),
            Finding::Encoded { gamma: Some(gamma) } => format!("gamma-encoded: openness to the power 1/{gamma:.1}"),
            Finding::Curve { gain, exponent } => {
                format!("a curve: {gain:.2} times openness to the power {exponent:.2}")
            }
            Finding::Scaled { factors } => {
                let factors: Vec<String> = factors.iter().map(|f| written(*f)).collect();
                format!("scaled scene: R is {} times what was asked for", factors.join(" or "))
            }
            Finding::Shifted { pixels: [x, y] } => format!("shifted by {x} columns and {y} rows"),
            Finding::Unlike { correlation } => {
                format!("another picture: its correlation with the reference is {correlation:.2}")
            }
        }
    }

    /// Whether the image may be measured all the same, since it may be meant to be so.
    pub fn is_doubt(&self) -> bool {
        matches!(self, Finding::Curve { .. } | Finding::Shifted { .. })
    }

    /// What to do about it.
    pub fn remedy(&self) -> String {
        match self {
            Finding::Size { .. } => "render as many pixels as the view has, or declare `resolution`".to_owned(),
            Finding::Holes { .. } => "look for a division by zero, or pixels that the AO pass leaves out".to_owned(),
            Finding::Constant { .. } => "save the AO buffer itself: this one was cleared and not drawn".to_owned(),
            Finding::Turned(turn) => turn.remedy().to_owned(),
            Finding::Inverted => "declare `means = \"occlusion\"`, or save 1 - occlusion".to_owned(),
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
                let factor = factors.first().copied().unwrap_or(1.0);
                format!(
                    "one unit of the glb is a metre, and R is in metres: multiply the radius by {}, or the scene by {}",
                    written(1.0 / factor),
                    written(factor)
                )
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

/// A factor as people write it: below 1 as a fraction.
fn written(factor: f64) -> String {
    let number = |v: f64| format!("{}", (v * 100.0).round() / 100.0);
    if factor < 0.999 { format!("1/{}", number(1.0 / factor)) } else { number(factor) }
}
