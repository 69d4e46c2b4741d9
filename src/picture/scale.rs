//! What colours of an error map mean: which number has which colour, and where it
//! stands on the bar.
//!
//! A scale is fixed when it is made and never fitted to an image, so that pictures of
//! one scale can be compared. All colour maps can be told apart by colour-blind
//! people: viridis and magma (Smith and van der Walt, matplotlib 1.5, 2015), red to
//! blue and the purples (Brewer, ColorBrewer, 2003) by way of the crate `colorous`.

use super::error_map::MapError;
use colorous::{Gradient, MAGMA, PURPLES, RED_BLUE, VIRIDIS, YELLOW_ORANGE_RED};

/// The colour of an error of 0 on a signed scale: a neutral grey near white.
const NEUTRAL: [u8; 3] = [247; 3];

/// The smallest p-value that has a colour of its own.
pub const LEAST_P: f64 = 1e-6;

/// A fixed scale of numbers and their colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale(Kind);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Absolute { max: f64 },
    Signed { limit: f64 },
    Flip,
    PValue { level: f64 },
    Similarity { least: f64 },
}

/// A limit of an error; 0 stands for 1.
fn limit(name: &'static str, value: f64) -> Result<f64, MapError> {
    if !(value.is_finite() && value >= 0.0) {
        return Err(MapError::Limit { name, value, allowed: "0 and above, finite" });
    }
    Ok(if value == 0.0 { 1.0 } else { value })
}

impl Scale {
    /// Absolute errors from 0 (dark) to `max` (bright) in viridis; greater is worse.
    /// Where `max` is 0, as it is for two images that are equal, the scale goes to 1.
    ///
    /// # Errors
    /// Where `max` is below 0 or not finite.
    pub fn absolute(max: f64) -> Result<Self, MapError> {
        Ok(Scale(Kind::Absolute { max: limit("max", max)? }))
    }

    /// Signed errors, test less reference, from `-limit` (blue: too dark) by 0 (grey
    /// near white) to `limit` (red: too bright). Where `limit` is 0 it is taken as 1.
    ///
    /// # Errors
    /// Where `limit` is below 0 or not finite.
    pub fn signed(limit: f64) -> Result<Self, MapError> {
        Ok(Scale(Kind::Signed { limit: self::limit("limit", limit)? }))
    }

    /// FLIP errors from 0 (black: none) to 1 in magma, entry `round(255 value)`, as in
    /// Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020.
    pub fn flip() -> Self {
        Scale(Kind::Flip)
    }

    /// p-values from 1 down to [`LEAST_P`] on a logarithmic scale: grey where a test
    /// of this level does not reject, and yellow to dark red where it does.
    ///
    /// # Errors
    /// Where `level` is not between [`LEAST_P`] and 1.
    pub fn p_value(level: f64) -> Result<Self, MapError> {
        if !(level > LEAST_P && level < 1.0) {
            return Err(MapError::Limit { name: "level", value: level, allowed: "above 1e-6 and below 1" });
        }
        Ok(Scale(Kind::PValue { level }))
    }

    /// Structural similarity (Wang et al., "Image Quality Assessment", 2004) from 1
    /// (white: alike) down to `least` (dark purple).
    ///
    /// # Errors
    /// Where `least` is not from -1 to below 1.
    pub fn similarity(least: f64) -> Result<Self, MapError> {
        if !(-1.0..1.0).contains(&least) {
            return Err(MapError::Limit { name: "least", value: least, allowed: "-1 to below 1" });
        }
        Ok(Scale(Kind::Similarity { least }))
    }

    /// What it is called as a layer: `absolute`, `signed`, `flip`, `p-value` or `ssim`.
    pub fn name(&self) -> &'static str {
        match self.0 {
            Kind::Absolute { .. } => "absolute",
            Kind::Signed { .. } => "signed",
            Kind::Flip => "flip",
            Kind::PValue { .. } => "p-value",
            Kind::Similarity { .. } => "ssim",
        }
    }

    /// The numbers at its two ends, in the order of the bar from the left.
    pub fn ends(&self) -> [f64; 2] {
        match self.0 {
            Kind::Absolute { max } => [0.0, max],
            Kind::Signed { limit } => [-limit, limit],
            Kind::Flip => [0.0, 1.0],
            Kind::PValue { .. } => [1.0, LEAST_P],
            Kind::Similarity { least } => [1.0, least],
        }
    }

    /// Whether there may be numbers beyond its left and right ends. They have the
    /// colour of the end.
    pub fn open(&self) -> [bool; 2] {
        match self.0 {
            Kind::Absolute { .. } | Kind::PValue { .. } => [false, true],
            Kind::Signed { .. } => [true, true],
            Kind::Flip => [false, false],
            Kind::Similarity { least } => [false, least > -1.0],
        }
    }

    /// Where a number stands on the bar: 0 at the left end, 1 at the right one, and
    /// at the nearer end where it lies beyond. None for NaN.
    pub fn position(&self, value: f64) -> Option<f64> {
        if value.is_nan() {
            return None;
        }
        let [from, to] = self.ends();
        let position = match self.0 {
            // Of 0 and below, which have no logarithm, too.
            Kind::PValue { .. } => value.clamp(LEAST_P, 1.0).log10() / LEAST_P.log10(),
            _ => (value.clamp(from.min(to), from.max(to)) - from) / (to - from),
        };
        Some(position.clamp(0.0, 1.0))
    }

    /// The colour of a number, 8-bit sRGB. None for NaN.
    pub fn color(&self, value: f64) -> Option<[u8; 3]> {
        self.position(value).map(|p| self.color_at(p))
    }

    /// The colour at a place of the bar, 0 to 1.
    pub fn color_at(&self, position: f64) -> [u8; 3] {
        match self.0 {
            Kind::Absolute { .. } => entry(VIRIDIS, position),
            Kind::Flip => entry(MAGMA, position),
            Kind::Signed { .. } => diverging(2.0 * position - 1.0),
            Kind::PValue { level } => p_color(position, self.position(level).unwrap_or(0.0)),
            Kind::Similarity { .. } if position < 0.5 / 255.0 => [255; 3],
            Kind::Similarity { .. } => entry(PURPLES, position),
        }
    }

    /// Places on the bar with their numbers.
    pub fn ticks(&self) -> Vec<(f64, String)> {
        let at = |v: f64| (self.position(v).unwrap_or(0.0), number(v));
        match self.0 {
            Kind::PValue { .. } => (0..=6).map(|e| at(10f64.powi(-e))).collect(),
            Kind::Signed { limit } => [-1.0, -0.5, 0.0, 0.5, 1.0].map(|s| at(s * limit)).to_vec(),
            _ => {
                let [from, to] = self.ends();
                steps(from.min(to), from.max(to)).into_iter().map(at).collect()
            }
        }
    }

    /// The place on the bar that is marked: the level of a test.
    pub fn mark(&self) -> Option<f64> {
        match self.0 {
            Kind::PValue { level } => self.position(level),
            _ => None,
        }
    }

    /// What the bar says: the measure, its `unit` where it has one, and how to read it.
    pub fn label(&self, unit: &str) -> String {
        let of = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
        match self.0 {
            Kind::Absolute { .. } => format!("absolute error{of}"),
            Kind::Signed { .. } => format!("signed error{of}: blue too dark, red too bright"),
            Kind::Flip => "FLIP error: 0 none, 1 greatest".to_owned(),
            Kind::PValue { level } => format!("p-value: colour below the level {}, grey above", number(level)),
            Kind::Similarity { .. } => "SSIM: 1 alike, lower is less alike".to_owned(),
        }
    }
}

/// One of 256 colours of a map.
fn entry(map: Gradient, position: f64) -> [u8; 3] {
    map.eval_rational((position.clamp(0.0, 1.0) * 255.0).round() as usize, 256).as_array()
}

/// Blue by grey to red, -1 to 1, in 255 steps of which the middle one is 0: eleven
/// colours of the map with lines between them. Its own middle is not quite grey, and
/// would hint at a sign.
fn diverging(t: f64) -> [u8; 3] {
    let anchor = |i: usize| if i == 5 { NEUTRAL } else { RED_BLUE.eval_rational(10 - i, 11).as_array() };
    let place = ((t.clamp(-1.0, 1.0) * 127.0).round() / 127.0 + 1.0) * 5.0;
    let below = (place as usize).min(9);
    let part = place - below as f64;
    let (a, b) = (anchor(below), anchor(below + 1));
    [0, 1, 2].map(|c| (f64::from(a[c]) * (1.0 - part) + f64::from(b[c]) * part).round() as u8)
}

/// Grey up to the level, colour beyond it, so that rejections stand out.
fn p_color(position: f64, level: f64) -> [u8; 3] {
    if position <= level {
        return [(250.0 - 50.0 * position / level.max(f64::MIN_POSITIVE)).round() as u8; 3];
    }
    entry(YELLOW_ORANGE_RED, 0.25 + 0.75 * (position - level) / (1.0 - level))
}

/// Round numbers from `from` to `to`, both ends among them.
fn steps(from: f64, to: f64) -> Vec<f64> {
    let rough = (to - from) / 5.0;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= rough).unwrap_or(rough);
    let first = (from / step).ceil();
    // Numbers near an end would run into it.
    let inside = (0..6).map(|i| (first + f64::from(i)) * step).filter(|v| v - from > 0.6 * step && to - v > 0.6 * step);
    std::iter::once(from).chain(inside).chain([to]).collect()
}

/// A number as short as three significant digits allow.
pub fn number(value: f64) -> String {
    let text = if value == 0.0 {
        "0".to_owned()
    } else if (9.995e-4..1e5).contains(&value.abs()) {
        let decimals = (2.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
    } else {
        let text = format!("{value:.2e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'))
    };
    text.replace('-', "\u{2212}")
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// One scale of each kind.
    pub fn all() -> [Scale; 5] {
        [
            Scale::absolute(0.5).unwrap(),
            Scale::signed(0.5).unwrap(),
            Scale::flip(),
            Scale::p_value(0.01).unwrap(),
            Scale::similarity(0.0).unwrap(),
        ]
    }

    #[test]
    fn ends_and_zero_have_their_colours() {
        let [absolute, signed, flip, p, ssim] = all();
        for (scale, value, color) in [
            (absolute, 0.0, [0x44, 0x01, 0x54]),
            (absolute, 0.5, [0xfd, 0xe7, 0x25]),
            (signed, -0.5, [0x05, 0x30, 0x61]),
            (signed, 0.0, [247; 3]),
            (signed, -0.0, [247; 3]),
            (signed, 0.5, [0x67, 0x00, 0x1f]),
            (flip, 0.0, [0x00, 0x00, 0x04]),
            (flip, 1.0, [0xfc, 0xfd, 0xbf]),
            (p, 1.0, [250; 3]),
            (p, 0.01, [200; 3]),
            (p, 1e-6, [0x80, 0x00, 0x26]),
            (ssim, 1.0, [255; 3]),
            (ssim, 0.0, [0x3f, 0x00, 0x7d]),
        ] {
            assert_eq!(scale.color(value), Some(color), "{} {value}", scale.name());
        }
        assert!(all().iter().all(|s| s.color(f64::NAN).is_none()));
    }

    #[test]
    fn what_lies_beyond_has_the_colour_of_the_end() {
        let [absolute, signed, _, p, ssim] = all();
        for (scale, value, end) in [
            (absolute, f64::INFINITY, 0.5),
            (absolute, -1.0, 0.0),
            (signed, -7.0, -0.5),
            (signed, f64::INFINITY, 0.5),
            (p, 0.0, 1e-6),
            (p, -1.0, 1e-6),
            (p, 2.0, 1.0),
            (ssim, -0.3, 0.0),
        ] {
            assert_eq!(scale.color(value), scale.color(end), "{} {value}", scale.name());
        }
    }

    #[test]
    fn a_rejection_is_coloured_and_nothing_else_is() {
        let p = Scale::p_value(0.01).unwrap();
        let grey = |v: f64| p.color(v).is_some_and(|[r, g, b]| r == g && g == b);
        assert!(grey(0.9) && grey(0.0101) && !grey(0.0099) && !grey(1e-5));
        assert_eq!(p.mark(), p.position(0.01));
        assert!((p.position(1e-3).unwrap() - 0.5).abs() < 1e-12);
    }

    /// Entries of matplotlib's table magma, 3.11, times 255 and rounded.
    #[test]
    fn flip_has_the_colours_of_matplotlibs_magma() {
        for (i, color) in MATPLOTLIB_MAGMA {
            let found = Scale::flip().color(f64::from(i) / 255.0).unwrap();
            assert!((0..3).all(|c| found[c].abs_diff(color[c]) <= 1), "{i}: {found:?}, {color:?}");
        }
    }

    const MATPLOTLIB_MAGMA: [(u8, [u8; 3]); 18] = [
        (0, [0, 0, 4]),
        (15, [9, 7, 32]),
        (30, [26, 16, 66]),
        (45, [49, 17, 101]),
        (60, [74, 16, 121]),
        (75, [98, 25, 128]),
        (90, [121, 34, 130]),
        (105, [145, 43, 129]),
        (120, [170, 51, 125]),
        (135, [194, 59, 117]),
        (150, [217, 70, 107]),
        (165, [236, 88, 96]),
        (180, [247, 114, 92]),
        (195, [252, 142, 100]),
        (210, [254, 170, 116]),
        (225, [254, 198, 138]),
        (240, [253, 226, 163]),
        (255, [252, 253, 191]),
    ];

    /// Signs mirror each other: as far from 0, about as dark, and ever darker.
    #[test]
    fn a_signed_scale_is_symmetric() {
        let signed = Scale::signed(1.0).unwrap();
        let luma = |v: f64| {
            signed
                .color(v)
                .map_or(0.0, |[r, g, b]| 0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b))
        };
        for i in 1..=127 {
            let (v, before) = (f64::from(i) / 127.0, f64::from(i - 1) / 127.0);
            assert!(luma(v) < luma(before) && luma(-v) < luma(-before), "{v}");
            assert!((luma(v) - luma(-v)).abs() < 40.0, "{v}: {} {}", luma(v), luma(-v));
            let [[r, _, b], [r_dark, _, b_dark]] = [signed.color(v).unwrap(), signed.color(-v).unwrap()];
            assert!(r > b && b_dark > r_dark, "red is above 0, blue below");
        }
    }

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (0.0, "0"),
            (0.5, "0.5"),
            (-0.25, "\u{2212}0.25"),
            (0.1 + 0.2, "0.3"),
            (1e-6, "1e\u{2212}6"),
            (0.001, "0.001"),
            (1234.5, "1234"),
            (2.5e7, "2.5e7"),
            (0.092_5, "0.0925"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn ticks_are_round_and_name_both_ends() {
        let texts =
            |s: &Scale| s.ticks().into_iter().map(|(_, t)| t).collect::<Vec<_>>().join(" ").replace('\u{2212}', "-");
        let [absolute, signed, flip, p, ssim] = all();
        assert_eq!(texts(&absolute), "0 0.1 0.2 0.3 0.4 0.5");
        assert_eq!(texts(&signed), "-0.5 -0.25 0 0.25 0.5");
        assert_eq!(texts(&flip), "0 0.2 0.4 0.6 0.8 1");
        assert_eq!(texts(&p), "1 0.1 0.01 0.001 1e-4 1e-5 1e-6");
        assert_eq!(texts(&ssim), "0 0.2 0.4 0.6 0.8 1");
        assert_eq!(texts(&Scale::absolute(0.37).unwrap()), "0 0.1 0.2 0.3 0.37");
        for max in [1e-30, 3.3e-7, 0.004, 17.0, 1e30] {
            let ticks = Scale::absolute(max).unwrap().ticks();
            assert!((3..=7).contains(&ticks.len()), "{max}: {ticks:?}");
            assert_eq!((ticks[0].0, ticks[ticks.len() - 1].0), (0.0, 1.0), "{max}");
        }
    }

    #[test]
    fn scales_that_mean_nothing_are_refused() {
        for max in [-0.1, f64::NAN, f64::INFINITY] {
            assert!(Scale::absolute(max).is_err() && Scale::signed(max).is_err(), "{max}");
        }
        for level in [0.0, 1e-6, 1.0, f64::NAN] {
            assert!(Scale::p_value(level).unwrap_err().to_string().contains("level"), "{level}");
        }
        assert!(Scale::similarity(1.0).is_err() && Scale::similarity(-1.1).is_err());
        assert_eq!(Scale::absolute(0.0).unwrap(), Scale::absolute(1.0).unwrap());
        assert_eq!(Scale::signed(0.0).unwrap().color(0.0), Some([247; 3]));
    }
}
