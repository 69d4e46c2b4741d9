//! `score.toml`: what whoever hands images in declares of them.

use crate::{
    disk::{DiskError, read_text},
    intake::{Curve, Declared, Means, Rows, Share, Upsample},
    metrics::image::Encoding,
    suite::is_taken,
};
use schemars::JsonSchema;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{self, DeserializeOwned, IntoDeserializer, Visitor},
};
use std::{
    fmt,
    marker::PhantomData,
    path::{Path, PathBuf},
};

/// The file, in the folder of the images. Each field but `kit` is an option of `aogauge score` too,
/// which wins.
pub const FILE: &str = "score.toml";

/// What is declared of all images of a folder.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Declaration {
    /// Name of the renderer in the record: 1 to 64 letters, digits, `-`, `_` and `.`. That of the folder,
    /// unless given.
    pub renderer: Option<String>,
    /// The kit that the images were rendered for, `id` in its `kit.json`: no other is taken. Any, unless given.
    pub kit: Option<String>,
    /// The estimator of images whose names do not say it.
    pub estimator: Option<String>,
    /// Their rays a pixel.
    pub rays: Option<u32>,
    /// What stored numbers stand for: `linear`, or `srgb` codes. Unless given, floats are
    /// linear, and of integers it is detected, with a warning.
    #[serde(deserialize_with = "word")]
    pub encoding: Option<Encoding>,
    /// What a stored 1 means: `openness` unless given, or `occlusion`.
    #[serde(deserialize_with = "word")]
    pub means: Option<Means>,
    /// The first row of a file: `top` of the view unless given, or `bottom`.
    #[serde(deserialize_with = "word")]
    pub rows: Option<Rows>,
    /// How large images are beside the view: `full` unless given, `half` or `quarter`.
    #[serde(deserialize_with = "word")]
    pub resolution: Option<Share>,
    /// How smaller ones are brought to its size: `nearest` unless given, or `bilinear`.
    #[serde(deserialize_with = "word")]
    pub upsample: Option<Upsample>,
    /// The layer of OpenEXR files.
    pub layer: Option<String>,
    /// The curve that openness was sent through, gain * O^exponent, which is undone: none unless
    /// given; `fit` finds it on the control scenes.
    pub curve: Option<CurveChoice>,
}

/// A field that is one of a few words.
trait Word: DeserializeOwned {
    /// Them, for errors.
    const WORDS: &'static str;
}

macro_rules! words {
    ($($word:ty: $words:literal),*) => {$(
        impl Word for $word {
            const WORDS: &'static str = $words;
        }
    )*};
}
words!(
    Encoding: r#""linear" or "srgb""#, Means: r#""openness" or "occlusion""#, Rows: r#""top" or "bottom""#,
    Share: r#""full", "half" or "quarter""#, Upsample: r#""nearest" or "bilinear""#
);

/// Reads one, and says which there are where it is no word at all.
fn word<'de, D: Deserializer<'de>, T: Word>(from: D) -> Result<Option<T>, D::Error> {
    struct Words<T>(PhantomData<T>);
    impl<T: Word> Visitor<'_> for Words<T> {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(T::WORDS)
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
            T::deserialize(text.into_deserializer())
        }
    }
    from.deserialize_any(Words(PhantomData)).map(Some)
}

/// A curve to undo.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "curve must be \"fit\" or { gain = 1.0, exponent = 2.2 }")]
pub enum CurveChoice {
    /// `"fit"`.
    Fit(Fit),
    /// A known one.
    Known(KnownCurve),
}

/// The word `fit`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// Find it on the control scenes.
    Fit,
}

/// A curve of known gain and exponent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct KnownCurve {
    /// Above 0, at most 1000.
    pub gain: f64,
    /// 0.1 to 10.
    pub exponent: f64,
}

impl KnownCurve {
    /// To be undone.
    pub(super) fn curve(&self) -> Curve {
        Curve { gain: self.gain, exponent: self.exponent, ..Curve::IDENTITY }
    }
}

impl Declaration {
    /// Reads the file of a folder; nothing is declared where there is none.
    ///
    /// # Errors
    /// Where it cannot be read, or is malformed: the message names the line or field.
    pub fn read(folder: &Path) -> Result<Self, DiskError> {
        let path = folder.join(FILE);
        if !path.exists() {
            return match misspelt(folder) {
                None => Ok(Self::default()),
                Some(other) => {
                    let why = format!("a file of declarations is called {FILE}, in lower case: rename it");
                    Err(DiskError::content(&other, why))
                }
            };
        }
        toml::from_str(&read_text(&path)?).map_err(|e| DiskError::content(&path, e.to_string()))
    }

    /// The same, with what `other` declares in its place.
    #[must_use]
    pub fn or_else(self, other: Declaration) -> Declaration {
        Declaration {
            renderer: self.renderer.or(other.renderer),
            kit: self.kit.or(other.kit),
            estimator: self.estimator.or(other.estimator),
            rays: self.rays.or(other.rays),
            encoding: self.encoding.or(other.encoding),
            means: self.means.or(other.means),
            rows: self.rows.or(other.rows),
            resolution: self.resolution.or(other.resolution),
            upsample: self.upsample.or(other.upsample),
            layer: self.layer.or(other.layer),
            curve: self.curve.or(other.curve),
        }
    }

    /// What a single image needs of it.
    pub fn of_images(&self) -> Declared {
        Declared {
            encoding: self.encoding,
            means: self.means.unwrap_or_default(),
            rows: self.rows.unwrap_or_default(),
            resolution: self.resolution.unwrap_or_default(),
            upsample: self.upsample.unwrap_or_default(),
            layer: self.layer.clone(),
        }
    }

    /// Whether its values are in their ranges.
    ///
    /// # Errors
    /// A sentence that names the field.
    pub fn check(&self) -> Result<(), String> {
        if let Some(name) = &self.renderer {
            aogauge_scenes::check_name(name).map_err(|e| format!("renderer: {e}"))?;
            // A record that calls somebody's images those of our CPU would be believed.
            if is_taken(name) {
                return Err(format!("renderer is '{name}', the name of one of aogauge's own: give it another"));
            }
        }
        if let Some(name) = &self.estimator {
            aogauge_scenes::check_name(name).map_err(|e| format!("estimator: {e}"))?;
        }
        if let Some(rays) = self.rays.filter(|r| !(1..=65_536).contains(r)) {
            return Err(format!("rays is {rays}: it must be 1 to 65536"));
        }
        if let Some(CurveChoice::Known(curve)) = &self.curve {
            for (field, value, range) in [("gain", curve.gain, 1e-6..=1000.0), ("exponent", curve.exponent, 0.1..=10.0)]
            {
                if !range.contains(&value) {
                    return Err(format!("curve.{field} is {value}: it must be {} to {}", range.start(), range.end()));
                }
            }
        }
        Ok(())
    }
}

/// A file that is called like the declarations, but for upper and lower case: where the system
/// tells them apart, it would be passed over.
fn misspelt(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    entries.map(|e| e.path()).find(|p| p.file_name().is_some_and(|n| n.eq_ignore_ascii_case(FILE)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_in_another_case_is_not_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Declaration::read(folder.path()).unwrap(), Declaration::default());
        std::fs::write(folder.path().join("Score.toml"), "rays = 4").unwrap();
        match Declaration::read(folder.path()) {
            Err(e) => assert!(e.to_string().contains("Score.toml: a file of declarations is called score.toml"), "{e}"),
            Ok(read) => assert_eq!(read.rays, Some(4), "this system does not tell them apart"),
        }
    }

    #[test]
    fn the_file_is_read_whole_and_options_win() {
        let text = "renderer = 'mine'\nestimator = 'classic'\nrays = 4\nencoding = 'srgb'\nmeans = 'occlusion'\n\
                    rows = 'bottom'\nresolution = 'half'\nupsample = 'bilinear'\nlayer = 'ao'\ncurve = 'fit'";
        let file: Declaration = toml::from_str(text).unwrap();
        assert!(file.check().is_ok());
        assert_eq!((file.curve.clone(), file.rays), (Some(CurveChoice::Fit(Fit::Fit)), Some(4)));
        let option = Declaration { rays: Some(8), means: Some(Means::Openness), ..Declaration::default() };
        let both = option.or_else(file);
        assert_eq!((both.rays, both.means, both.rows), (Some(8), Some(Means::Openness), Some(Rows::Bottom)));
        assert_eq!(both.of_images().resolution, Share::Half);
        let known: Declaration = toml::from_str("curve = { gain = 1.5, exponent = 2.2 }").unwrap();
        assert_eq!(known.curve, Some(CurveChoice::Known(KnownCurve { gain: 1.5, exponent: 2.2 })));
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, says) in [
            ("rays = 0", "rays is 0: it must be 1 to 65536"),
            ("renderer = '../x'", "renderer: "),
            ("renderer = 'CPU'", "the name of one of aogauge's own"),
            ("estimator = ''", "estimator: "),
            ("curve = { gain = 0, exponent = 1 }", "curve.gain is 0: it must be 0.000001 to 1000"),
            ("curve = { gain = 1, exponent = nan }", "curve.exponent is NaN"),
            ("curve = 'fitted'", "curve must be \"fit\""),
            ("means = 'ao'", "openness"),
            ("resolution = 0.5", "`0.5`, expected \"full\", \"half\" or \"quarter\""),
            ("resolution = 'third'", "expected one of `full`, `half`, `quarter`"),
            ("upsample = true", "expected \"nearest\" or \"bilinear\""),
            ("rows = 1", "expected \"top\" or \"bottom\""),
            ("encoding = 2.2", "expected \"linear\" or \"srgb\""),
            ("gamma = 2.2", "gamma"),
        ] {
            let parsed = toml::from_str::<Declaration>(text).map_err(|e| e.to_string());
            let message = parsed.and_then(|d| d.check()).unwrap_err();
            assert!(message.contains(says), "{text}: {message}");
        }
    }
}
