//! What is declared of images: what their numbers mean, and where they lie.

use crate::metrics::image::Encoding;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the images of a renderer are. The default is what aogauge writes itself: openness,
/// rows from the top, as large as the view.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Declared {
    /// What the stored numbers stand for: `linear`, or `srgb` codes. Where it is not
    /// declared, floats are linear, and integers are taken as linear with a warning.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoding: Option<Encoding>,
    /// What a 1 means.
    pub means: Means,
    /// Which row of the view the file begins with.
    pub rows: Rows,
    /// How large the image is beside the view.
    pub resolution: Share,
    /// How an image that is smaller than the view is brought to its size.
    pub upsample: Upsample,
    /// The layer of an OpenEXR file, a channel or three of them (`NAME.R`, `.G`, `.B`).
    /// Without it: the layers `replicate-NNNN`, else R, G and B, else Y, else `mean`, else
    /// the only one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layer: Option<String>,
}

/// What a stored 1 means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Means {
    /// 1 is fully open: what most engines call "AO".
    #[default]
    Openness,
    /// 1 is fully closed.
    Occlusion,
}

/// The first row of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Rows {
    /// It is the top of the view.
    #[default]
    Top,
    /// It is the bottom of the view, as in textures of OpenGL.
    Bottom,
}

/// Width and height of an image over those of the view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Share {
    /// 1.
    #[default]
    Full,
    /// 1/2, rounded up or down.
    Half,
    /// 1/4, rounded up or down.
    Quarter,
}

/// How values between the pixels of a smaller image are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Upsample {
    /// The pixel that holds the centre.
    #[default]
    Nearest,
    /// Between the four nearest pixel centres.
    Bilinear,
}

impl Means {
    /// As it is written in `score.toml`.
    pub fn label(self) -> &'static str {
        match self {
            Means::Openness => "openness",
            Means::Occlusion => "occlusion",
        }
    }
}

impl Means {
    /// Applies a curve to what a file stores, given as openness: occlusion is 1 less that.
    pub(super) fn through(self, openness: f32, curve: impl Fn(f32) -> f32) -> f32 {
        match self {
            Means::Openness => curve(openness),
            Means::Occlusion => 1.0 - curve(1.0 - openness),
        }
    }
}

impl Rows {
    /// As it is written in `score.toml`.
    pub fn label(self) -> &'static str {
        match self {
            Rows::Top => "top",
            Rows::Bottom => "bottom",
        }
    }
}

impl Upsample {
    /// As it is written in `score.toml`.
    pub fn label(self) -> &'static str {
        match self {
            Upsample::Nearest => "nearest",
            Upsample::Bilinear => "bilinear",
        }
    }
}

impl Share {
    /// All of them.
    pub const ALL: [Share; 3] = [Share::Full, Share::Half, Share::Quarter];

    /// As it is written in `score.toml`.
    pub fn label(self) -> &'static str {
        match self {
            Share::Full => "full",
            Share::Half => "half",
            Share::Quarter => "quarter",
        }
    }

    /// Width and height of an image at this share of a view, rounded up.
    pub fn of(self, view: [u32; 2]) -> [usize; 2] {
        view.map(|side| (side as usize).div_ceil(self.divisor()))
    }

    /// Whether an image of this size is at this share of a view: sides may be rounded up or
    /// down.
    pub fn suits(self, size: [usize; 2], view: [u32; 2]) -> bool {
        let by = self.divisor();
        size.iter().zip(view).all(|(&side, whole)| {
            let whole = whole as usize;
            side > 0 && (side == whole.div_ceil(by) || side == whole / by)
        })
    }

    fn divisor(self) -> usize {
        match self {
            Share::Full => 1,
            Share::Half => 2,
            Share::Quarter => 4,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_declared_is_written_as_the_file_says() {
        let text = "encoding = \"srgb\"\nmeans = \"occlusion\"\nrows = \"bottom\"\nresolution = \"half\"\n\
                    upsample = \"bilinear\"\nlayer = \"ao\"\n";
        let declared: Declared = toml::from_str(text).unwrap();
        let expected = Declared {
            encoding: Some(Encoding::Srgb),
            means: Means::Occlusion,
            rows: Rows::Bottom,
            resolution: Share::Half,
            upsample: Upsample::Bilinear,
            layer: Some("ao".into()),
        };
        assert_eq!(declared, expected);
        assert_eq!(toml::from_str::<Declared>(&toml::to_string(&declared).unwrap()).unwrap(), declared);
        assert_eq!(toml::from_str::<Declared>("").unwrap(), Declared::default());
        assert!(toml::from_str::<Declared>("gamma = 2.2").unwrap_err().to_string().contains("gamma"));
        assert!(toml::from_str::<Declared>("resolution = \"third\"").is_err());
    }

    #[test]
    fn shares_round_up_or_down() {
        let view = [209, 32];
        assert_eq!((Share::Half.of(view), Share::Quarter.of(view)), ([105, 16], [53, 8]));
        assert!(Share::Half.suits([105, 16], view) && Share::Half.suits([104, 16], view));
        assert!(!Share::Half.suits([103, 16], view) && !Share::Half.suits([209, 32], view));
        assert!(!Share::Quarter.suits([1, 0], [4, 3]), "an image has pixels");
    }
}
