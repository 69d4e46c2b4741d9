//! Every full-reference metric of a pair, with the maps they come from.

use super::{
    Encoding, Exposures, ImageError, MapSummary, NonFinite, Pair, absolute_map, flip, flip::DEFAULT_PPD, hdr_flip,
    ms_ssim, pointwise, signed_map, ssim, summary,
};
use crate::{counted::counted, metrics::Absent};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A full-reference metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ScoreName {
    /// Mean of test less reference, signed; 0 is unbiased.
    MeanError,
    /// Mean absolute error.
    Mae,
    /// Mean squared error.
    Mse,
    /// Root mean squared error.
    Rmse,
    /// Peak signal-to-noise ratio for values of range 1, dB.
    Psnr,
    /// Relative mean squared error.
    RelativeMse,
    /// Symmetric mean absolute percentage error, as a share.
    Smape,
    /// Structural similarity.
    Ssim,
    /// Structural similarity at five scales.
    MsSsim,
    /// Mean FLIP error of images in [0, 1].
    Flip,
    /// Mean HDR-FLIP error.
    HdrFlip,
    /// SSIMULACRA2. Reported, never gated: perceptual scores punish the darkening
    /// that extended AO intends.
    Ssimulacra2,
}

impl ScoreName {
    /// All of them, in the order of a report.
    pub const ALL: [ScoreName; 12] = [
        ScoreName::MeanError,
        ScoreName::Mae,
        ScoreName::Mse,
        ScoreName::Rmse,
        ScoreName::Psnr,
        ScoreName::RelativeMse,
        ScoreName::Smape,
        ScoreName::Ssim,
        ScoreName::MsSsim,
        ScoreName::Flip,
        ScoreName::HdrFlip,
        ScoreName::Ssimulacra2,
    ];

    /// As it is written in options, reports and JSON.
    pub fn label(self) -> &'static str {
        match self {
            ScoreName::MeanError => "mean-error",
            ScoreName::Mae => "mae",
            ScoreName::Mse => "mse",
            ScoreName::Rmse => "rmse",
            ScoreName::Psnr => "psnr",
            ScoreName::RelativeMse => "relative-mse",
            ScoreName::Smape => "smape",
            ScoreName::Ssim => "ssim",
            ScoreName::MsSsim => "ms-ssim",
            ScoreName::Flip => "flip",
            ScoreName::HdrFlip => "hdr-flip",
            ScoreName::Ssimulacra2 => "ssimulacra2",
        }
    }

    /// Its unit, and what it is for equal images, for people.
    pub fn reading(self) -> &'static str {
        match self {
            ScoreName::MeanError => "0 is unbiased, above 0 the test image is too bright",
            ScoreName::Psnr => "dB, higher is better",
            ScoreName::Ssim | ScoreName::MsSsim => "1 is equal, higher is better",
            ScoreName::Flip | ScoreName::HdrFlip => "0 is equal, 1 the most, lower is better",
            ScoreName::Ssimulacra2 => "100 is equal, higher is better; reported, never gated",
            _ => "0 is equal, lower is better",
        }
    }
}

/// One number, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Score {
    /// Which.
    pub name: ScoreName,
    /// The value; null where it is not defined or infinite.
    pub value: Option<f64>,
    /// Why the value is null, or what it leaves out.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub note: Option<String>,
}

/// What of the set to compute, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Pixels per degree for FLIP, 1 to 1000.
    pub ppd: f64,
    /// HDR-FLIP, which costs a FLIP an exposure, over the exposures of the
    /// reference or given ones; linear images only.
    pub hdr: bool,
    /// Exposures of HDR-FLIP; None derives them from the reference.
    pub exposures: Option<Exposures>,
    /// SSIMULACRA2, which costs several times the rest of the set.
    pub ssimulacra2: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options { ppd: DEFAULT_PPD, hdr: false, exposures: None, ssimulacra2: false }
    }
}

/// Maps of the error, a value a pixel, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Maps {
    /// |test - reference|, mean over channels; as in all maps NaN where an image holds no number.
    pub absolute: Vec<f32>,
    /// test - reference, mean over channels.
    pub signed: Vec<f32>,
    /// SSIM; empty where the image is too small.
    pub ssim: Vec<f32>,
    /// FLIP.
    pub flip: Vec<f32>,
    /// HDR-FLIP; empty where it was not asked for.
    pub hdr_flip: Vec<f32>,
}

/// All that was found of a pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scores {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Channels.
    pub channels: usize,
    /// What the numbers stand for.
    pub encoding: Encoding,
    /// Sum of the mask's weights over the pixels with numbers.
    pub weight: f64,
    /// Pixels without a number.
    pub non_finite: NonFinite,
    /// Pixels per degree of FLIP.
    pub ppd: f64,
    /// Exposures of HDR-FLIP, where it was computed.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub exposures: Option<Exposures>,
    /// The metrics, in a fixed order.
    pub scores: Vec<Score>,
    /// Summaries of the maps: `absolute`, `signed`, `ssim`, `flip`, `hdr-flip`.
    pub maps: BTreeMap<String, MapSummary>,
}

impl Scores {
    /// A metric's value, where it has one.
    pub fn value(&self, name: ScoreName) -> Option<f64> {
        self.scores.iter().find(|s| s.name == name)?.value
    }
}

/// Computes the set.
///
/// # Errors
/// [`ImageError::Range`] for options out of range. What a pair has no value for
/// (SSIM of an image smaller than its window) is a null with a reason, no error.
pub fn scores(pair: &Pair<'_>, options: &Options) -> Result<(Scores, Maps), ImageError> {
    let image = pair.reference();
    let mut all = single_pixels(pair);
    let mut maps = Maps {
        absolute: absolute_map(pair),
        signed: signed_map(pair),
        ssim: Vec::new(),
        flip: flip(pair, options.ppd)?,
        hdr_flip: Vec::new(),
    };
    all.extend(structure(pair, &mut maps));
    let mut exposures = None;
    if options.hdr && image.encoding() == Encoding::Linear {
        exposures = options.exposures.or_else(|| Exposures::of(pair));
        if let Some(exposures) = exposures {
            maps.hdr_flip = hdr_flip(pair, options.ppd, exposures)?.map;
        }
    }
    let summaries = summaries(pair, &maps);
    let mean = |map: &str, why: &str| summaries.get(map).map(|s| s.mean).ok_or_else(|| Absent(why.to_owned()));
    let mut flip = score(ScoreName::Flip, mean("flip", "no pixel has weight"));
    flip.note = flip.note.or_else(|| clamped(pair));
    all.push(flip);
    if options.hdr {
        let why = if image.encoding() == Encoding::Linear {
            "the reference is black"
        } else {
            "HDR-FLIP needs linear images"
        };
        all.push(score(ScoreName::HdrFlip, mean("hdr-flip", why)));
    }
    if options.ssimulacra2 {
        all.push(score(ScoreName::Ssimulacra2, super::ssimulacra2::ssimulacra2(pair)));
    }
    // Where there is no number there is no error either, and not one of 0.
    for map in [&mut maps.absolute, &mut maps.signed, &mut maps.ssim, &mut maps.flip, &mut maps.hdr_flip] {
        if !map.is_empty() {
            pair.holes().iter().for_each(|&pixel| map[pixel] = f32::NAN);
        }
    }
    let weight = pair.weights().map_or(image.pixels() as f64, |w| w.iter().copied().map(f64::from).sum());
    let scores = Scores {
        size: image.size(),
        channels: image.planes().len(),
        encoding: image.encoding(),
        weight,
        non_finite: pair.non_finite(),
        ppd: options.ppd,
        exposures,
        scores: all,
        maps: summaries,
    };
    Ok((scores, maps))
}

fn single_pixels(pair: &Pair<'_>) -> Vec<Score> {
    let point = pointwise(pair);
    let values = [
        (ScoreName::MeanError, point.mean_error),
        (ScoreName::Mae, point.mae),
        (ScoreName::Mse, point.mse),
        (ScoreName::Rmse, point.rmse()),
        (ScoreName::Psnr, point.psnr(1.0)),
        (ScoreName::RelativeMse, point.relative_mse),
        (ScoreName::Smape, point.smape),
    ];
    values.map(|(name, value)| score(name, Ok(value))).to_vec()
}

fn structure(pair: &Pair<'_>, maps: &mut Maps) -> [Score; 2] {
    match ssim(pair) {
        Ok(finest) => {
            let coarse = ms_ssim(pair, &finest).map_err(|e| absent(&e));
            maps.ssim = finest.map;
            [score(ScoreName::Ssim, Ok(finest.mean)), score(ScoreName::MsSsim, coarse)]
        }
        Err(e) => [ScoreName::Ssim, ScoreName::MsSsim].map(|name| score(name, Err(absent(&e)))),
    }
}

fn summaries(pair: &Pair<'_>, maps: &Maps) -> BTreeMap<String, MapSummary> {
    let named = [
        ("absolute", &maps.absolute),
        ("signed", &maps.signed),
        ("ssim", &maps.ssim),
        ("flip", &maps.flip),
        ("hdr-flip", &maps.hdr_flip),
    ];
    let found = named.into_iter().filter(|(_, map)| !map.is_empty());
    found.filter_map(|(name, map)| Some((name.to_owned(), summary(pair, map)?))).collect()
}

/// FLIP clamps to [0, 1], and so cannot tell what lies beyond.
fn clamped(pair: &Pair<'_>) -> Option<String> {
    let beyond = |i: usize| {
        let mut values = [pair.reference(), pair.test()].into_iter().flat_map(super::Image::planes);
        values.any(|plane| !(0.0..=1.0).contains(&plane[i]))
    };
    let pixels = pair.reference().pixels();
    let n = (0..pixels).filter(|&i| pair.weight(i) > 0.0 && beyond(i)).count();
    (n > 0).then(|| format!("{n} of {} beyond 0 to 1 and clamped: see HDR-FLIP", counted(pixels, "pixel", "pixels")))
}

fn absent(e: &ImageError) -> Absent {
    Absent(e.to_string())
}

fn score(name: ScoreName, value: Result<f64, Absent>) -> Score {
    match value {
        Ok(v) if v.is_finite() => Score { name, value: Some(v), note: None },
        Ok(v) if v > 0.0 => Score { name, value: None, note: Some("infinite: there is no error".to_owned()) },
        Ok(_) => Score { name, value: None, note: Some("not a finite number".to_owned()) },
        Err(Absent(why)) => Score { name, value: None, note: Some(why) },
    }
}
