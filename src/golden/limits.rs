//! How far an image without noise may be from its golden.

use crate::metrics::image::{DEFAULT_PPD, ImageError, Pair, SSIM_SIDE, absolute_map, flip, ssim, summary};
use schemars::JsonSchema;
use serde::Serialize;
use std::{fmt, str::FromStr};

/// What may differ between two images that are no samples: screenshots, converged
/// pictures.
///
/// As text: `flip=0.002,flip-max=0.1,ssim=0.995,max=0.5`, any of them; the others have
/// their defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub struct Limits {
    /// The mean FLIP error may be this, 0 to 1; .002 unless given.
    pub flip: f64,
    /// The FLIP error of any pixel may be this, 0 to 1; .1 unless given.
    pub flip_max: f64,
    /// SSIM must be this, -1 to 1; .995 unless given. Images below 11 x 11 pixels have
    /// none, and are not held against it.
    pub ssim: f64,
    /// A pixel may be off by this, mean over channels, in the image's own numbers; any
    /// unless given.
    pub max: Option<f64>,
}

impl Default for Limits {
    fn default() -> Self {
        Limits { flip: 0.002, flip_max: 0.1, ssim: 0.995, max: None }
    }
}

/// A number of a comparison beside its limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Measured {
    /// `flip`, `flip-max`, `ssim` or `max`.
    pub metric: &'static str,
    /// What was found.
    #[schemars(with = "Option<f64>")]
    pub value: f64,
    /// What may be.
    pub limit: f64,
    /// Column and row of the worst pixel, for the maxima.
    pub at: Option<[usize; 2]>,
}

impl Measured {
    /// Whether it keeps its limit. NaN keeps none.
    pub fn holds(&self) -> bool {
        if self.metric == "ssim" { self.value >= self.limit } else { self.value <= self.limit }
    }
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [allows, at] = [
            if self.metric == "ssim" { "at least" } else { "at most" }.to_owned(),
            self.at.map_or_else(String::new, |[x, y]| format!(" at {x}, {y}")),
        ];
        write!(f, "{} {:.5}{at}, {allows} {} is allowed", self.metric, self.value, self.limit)
    }
}

impl Limits {
    /// Measures a pair.
    ///
    /// # Errors
    /// [`ImageError::NonFinite`] where a pixel holds a number in one image only.
    pub fn measure(&self, pair: &Pair<'_>) -> Result<Vec<Measured>, ImageError> {
        pair.non_finite().check()?;
        let mut all = Vec::new();
        let map = flip(pair, DEFAULT_PPD)?;
        if let Some(s) = summary(pair, &map) {
            all.push(Measured { metric: "flip", value: s.mean, limit: self.flip, at: None });
            all.push(Measured { metric: "flip-max", value: s.max, limit: self.flip_max, at: Some(s.max_at) });
        }
        if pair.reference().size().iter().all(|side| *side >= SSIM_SIDE) {
            all.push(Measured { metric: "ssim", value: ssim(pair)?.mean, limit: self.ssim, at: None });
        }
        if let Some(limit) = self.max
            && let Some(s) = summary(pair, &absolute_map(pair))
        {
            all.push(Measured { metric: "max", value: s.max, limit, at: Some(s.max_at) });
        }
        Ok(all)
    }
}

impl FromStr for Limits {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut limits = Limits::default();
        for part in text.split(',') {
            let known = || format!("'{part}': give flip=, flip-max=, ssim= or max= and a number, separated by commas");
            let (name, value) = part.trim().split_once('=').ok_or_else(known)?;
            let value: f64 = value.parse().map_err(|_| known())?;
            let range = match name {
                "flip" | "flip-max" => [0.0, 1.0],
                "ssim" => [-1.0, 1.0],
                "max" => [0.0, f64::MAX],
                _ => return Err(known()),
            };
            if !(range[0]..=range[1]).contains(&value) {
                return Err(match name {
                    "max" => format!("max is {value}: it must be 0 or more"),
                    _ => format!("{name} is {value}: it must be {} to {}", range[0], range[1]),
                });
            }
            match name {
                "flip" => limits.flip = value,
                "flip-max" => limits.flip_max = value,
                "ssim" => limits.ssim = value,
                _ => limits.max = Some(value),
            }
        }
        Ok(limits)
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "flip={},flip-max={},ssim={}", self.flip, self.flip_max, self.ssim)?;
        self.max.map_or(Ok(()), |max| write!(f, ",max={max}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::image::{Encoding, Image};

    #[test]
    fn limits_are_read_and_written() {
        let limits: Limits = "flip=0.01, max=2".parse().unwrap();
        assert_eq!(limits, Limits { flip: 0.01, max: Some(2.0), ..Limits::default() });
        assert_eq!(limits.to_string().parse(), Ok(limits));
        for (text, says) in [
            ("", "give flip="),
            ("flip", "give flip="),
            ("psnr=3", "give flip="),
            ("flip=x", "give flip="),
            ("flip=1.5", "0 to 1"),
            ("ssim=nan", "-1 to 1"),
            ("max=-1", "0 or more"),
        ] {
            let error = text.parse::<Limits>().unwrap_err();
            assert!(error.contains(says), "{text}: {error}");
        }
    }

    #[test]
    fn each_limit_is_held() {
        let image = |change: f32| {
            let mut plane: Vec<f32> = (0..32 * 32).map(|i| (i % 32) as f32 / 32.0).collect();
            plane[100] += change;
            Image::new([32, 32], vec![plane], Encoding::Linear).unwrap()
        };
        let (a, b) = (image(0.0), image(0.4));
        let broken = |limits: &str| -> Vec<&str> {
            let pair = Pair::new(&a, &b, None).unwrap();
            let all = limits.parse::<Limits>().unwrap().measure(&pair).unwrap();
            all.iter().filter(|m| !m.holds()).map(|m| m.metric).collect()
        };
        assert_eq!(broken("flip=1,flip-max=1,ssim=-1"), [""; 0]);
        assert_eq!(broken("flip=0.00001,flip-max=1,ssim=-1"), ["flip"]);
        assert_eq!(broken("flip=1,flip-max=0.05,ssim=-1"), ["flip-max"]);
        assert_eq!(broken("flip=1,flip-max=1,ssim=1"), ["ssim"]);
        assert_eq!(broken("flip=1,flip-max=1,ssim=-1,max=0.3"), ["max"]);
        let pair = Pair::new(&a, &b, None).unwrap();
        let max = Limits { max: Some(0.3), ..Limits::default() }.measure(&pair).unwrap()[3];
        assert_eq!(max.at, Some([4, 3]));
    }
}
