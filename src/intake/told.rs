//! What is wrong with an image, told to whoever declared what it is: by the names of the fields that they
//! wrote, and with the field itself where that is what is wrong.

use super::{
    Declared, Finding, IntakeError, Means, Reference, Rows, Turn,
    diagnose::{diagnose, distance},
};
use crate::{layers::code, metrics::image::Encoding};

/// The other encoding must bring an image so much nearer to its reference, in mean square, that the
/// declared one is wrong.
const NEARER: f64 = 0.2;

/// Where it is declared what images are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keys {
    /// In `score.toml`, or by options of `aogauge score`.
    Score,
    /// In `image` of a suite's `[[renderer]]`, which has no curve.
    Suite,
}

impl Keys {
    fn of(self, field: &str) -> String {
        match self {
            Keys::Score => field.to_owned(),
            Keys::Suite => format!("image.{field}"),
        }
    }
}

impl IntakeError {
    /// Its sentence, with fields by the names that they have there.
    pub fn of(&self, keys: Keys) -> String {
        let text = self.to_string();
        match self {
            IntakeError::Size { .. } => {
                text.replace("with resolution = ", &format!("with {} = ", keys.of("resolution")))
            }
            _ => text,
        }
    }
}

/// [`diagnose`], where an image was decoded as declared: numbers that were linear before they were decoded
/// are [`Finding::Decoded`], and not the curve that decoding makes of them.
pub fn examine(image: &[f32], reference: &Reference, size: [usize; 2], declared: &Declared) -> Vec<Finding> {
    let mut found = diagnose(image, reference, size);
    let is_meaning = |f: &Finding| f.is_meaning() || matches!(f, Finding::Scaled { .. } | Finding::Between { .. });
    if declared.encoding != Some(Encoding::Srgb) || !found.iter().any(is_meaning) {
        return found;
    }
    let stored: Vec<f32> = image.iter().map(|v| declared.means.through(*v, code)).collect();
    let is_linear = !diagnose(&stored, reference, size).iter().any(is_meaning)
        && distance(&stored, reference, size) < NEARER * distance(image, reference, size);
    if is_linear {
        found.retain(|f| !is_meaning(f));
        found.push(Finding::Decoded);
    }
    found
}

impl Finding {
    /// What was found and what to do about it, by what is declared.
    pub fn told(&self, declared: &Declared, keys: Keys) -> String {
        if let Some(why) = self.contradiction(declared, keys) {
            return why;
        }
        let remedy = match (keys, self) {
            (Keys::Score, _) => self.remedy(),
            (Keys::Suite, Finding::Encoded { gamma: Some(_) }) => "save the buffer without a view transform".to_owned(),
            (Keys::Suite, Finding::Curve { .. }) => "set intensity and power of the AO to 1".to_owned(),
            (Keys::Suite, Finding::Either(_)) => {
                "look what is done to AO after it is traced; `aogauge score` with an image of the self-check can"
                    .to_owned()
            }
            (Keys::Suite, _) => self.remedy().replace("declare `", "declare `image."),
        };
        format!("{}; {remedy}", self.title())
    }

    /// What is declared and is wrong, where that is the cause: to declare it would be no remedy.
    fn contradiction(&self, declared: &Declared, keys: Keys) -> Option<String> {
        let away = |field: &str, value: &str| format!("take `{} = \"{value}\"` away", keys.of(field));
        Some(match (self, declared.encoding) {
            (Finding::Inverted, _) if declared.means == Means::Occlusion => {
                format!("inverted: declared as occlusion, but it looks like openness: {}", away("means", "occlusion"))
            }
            (Finding::Turned(Turn::FlippedY), _) if declared.rows == Rows::Bottom => format!(
                "flipped in y: declared with rows from the bottom, but the file's first row looks like the top of the \
                 view: {}",
                away("rows", "bottom")
            ),
            (Finding::Encoded { .. }, Some(Encoding::Srgb)) => format!(
                "{}, after it was decoded as declared: it was encoded twice; save the buffer without a view transform",
                self.title()
            ),
            (Finding::Encoded { gamma: None }, Some(Encoding::Linear)) => format!(
                "{}, though `{} = \"linear\"` is declared: one of the two is wrong, unless AO is meant to be so",
                self.title(),
                keys.of("encoding")
            ),
            (Finding::Decoded, _) => {
                format!("{}: {}, or declare \"linear\"", self.title(), away("encoding", "srgb"))
            }
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_remedy_is_what_is_declared() {
        let declared = Declared {
            encoding: Some(Encoding::Srgb),
            means: Means::Occlusion,
            rows: Rows::Bottom,
            ..Declared::default()
        };
        let encoded = Finding::Encoded { gamma: None };
        for (finding, says) in [
            (Finding::Inverted, "looks like openness: take `image.means = \"occlusion\"` away"),
            (Finding::Turned(Turn::FlippedY), "take `image.rows = \"bottom\"` away"),
            (Finding::Decoded, "take `image.encoding = \"srgb\"` away"),
            (encoded.clone(), "it was encoded twice"),
        ] {
            let told = finding.told(&declared, Keys::Suite);
            assert!(told.contains(says) && !told.contains("declare `"), "{told}");
        }
        let none = Declared::default();
        for (finding, score, suite) in [
            (Finding::Inverted, "declare `means = ", "declare `image.means = "),
            (Finding::Turned(Turn::FlippedY), "declare `rows = ", "declare `image.rows = "),
            (encoded, "declare `encoding = ", "declare `image.encoding = "),
            (
                Finding::Curve { gain: 1.0, exponent: 2.0 },
                "`curve = \"fit\"`",
                "set intensity and power of the AO to 1",
            ),
        ] {
            assert!(finding.told(&none, Keys::Score).contains(score));
            let told = finding.told(&none, Keys::Suite);
            assert!(told.contains(suite) && !told.contains("`curve"), "{told}");
        }
    }

    #[test]
    fn linear_numbers_that_are_declared_as_codes_are_told() {
        let truth: Vec<f32> = (0..64 * 48).map(|i| 0.15 + 0.8 * ((i % 64) as f32 / 63.0).powi(2)).collect();
        let reference = Reference { openness: truth.clone(), scaled: Vec::new() };
        let decoded: Vec<f32> = truth.iter().map(|v| crate::layers::linear(*v)).collect();
        let declared = |encoding| Declared { encoding: Some(encoding), ..Declared::default() };
        let found = examine(&decoded, &reference, [64, 48], &declared(Encoding::Srgb));
        assert_eq!(found, [Finding::Decoded]);
        assert!(!examine(&decoded, &reference, [64, 48], &declared(Encoding::Linear)).contains(&Finding::Decoded));
        assert_eq!(examine(&truth, &reference, [64, 48], &declared(Encoding::Srgb)), []);
    }
}
