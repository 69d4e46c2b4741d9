//! Limits on what a comparison found, in two tiers, for all images or for some.

use super::CompareError;
use crate::metrics::image::{MapSummary, ScoreName};
use glob::{MatchOptions, Pattern};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{fmt, path::Path, str::FromStr};

/// A number that a limit can be set on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Measure {
    /// A metric by its label.
    Score(ScoreName),
    /// A statistic of a map.
    Map(MapName, Statistic),
    /// Share of pixels of which a channel differs by more than the tolerance.
    Differing,
    /// The largest difference of a channel.
    LargestDifference,
    /// What Welch's test of the replicates of two images of records found.
    Welch(WelchName),
}

/// A number of Welch's test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WelchName {
    /// Places where it rejects that both images have one expectation, over all scales.
    Rejected,
    /// Of these, pixels.
    Pixels,
    /// Tiles.
    Tiles,
    /// Whether the whole image does, 0 or 1.
    Image,
    /// Mean of the test image less mean of the reference.
    Bias,
}

/// A map with a summary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // they are called what they are
pub enum MapName {
    Absolute,
    Signed,
    Ssim,
    Flip,
    HdrFlip,
}

/// A statistic of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // they are called what they are
pub enum Statistic {
    Mean,
    Min,
    P1,
    P5,
    Median,
    P95,
    P99,
    Max,
}

impl MapName {
    const ALL: [MapName; 5] = [MapName::Absolute, MapName::Signed, MapName::Ssim, MapName::Flip, MapName::HdrFlip];

    /// As it is written in options, and the key of its summary.
    pub fn label(self) -> &'static str {
        match self {
            MapName::Absolute => "absolute",
            MapName::Signed => "signed",
            MapName::Ssim => "ssim",
            MapName::Flip => "flip",
            MapName::HdrFlip => "hdr-flip",
        }
    }
}

impl WelchName {
    const ALL: [WelchName; 5] =
        [WelchName::Rejected, WelchName::Pixels, WelchName::Tiles, WelchName::Image, WelchName::Bias];

    fn label(self) -> &'static str {
        match self {
            WelchName::Rejected => "welch.rejected",
            WelchName::Pixels => "welch.pixels",
            WelchName::Tiles => "welch.tiles",
            WelchName::Image => "welch.image",
            WelchName::Bias => "welch.bias",
        }
    }
}

impl Statistic {
    const ALL: [Statistic; 8] = [
        Statistic::Mean,
        Statistic::Min,
        Statistic::P1,
        Statistic::P5,
        Statistic::Median,
        Statistic::P95,
        Statistic::P99,
        Statistic::Max,
    ];

    fn label(self) -> &'static str {
        match self {
            Statistic::Mean => "mean",
            Statistic::Min => "min",
            Statistic::P1 => "p1",
            Statistic::P5 => "p5",
            Statistic::Median => "median",
            Statistic::P95 => "p95",
            Statistic::P99 => "p99",
            Statistic::Max => "max",
        }
    }

    /// The statistic of a summary.
    pub fn of(self, summary: &MapSummary) -> f64 {
        match self {
            Statistic::Mean => summary.mean,
            Statistic::Min => summary.min,
            Statistic::P1 => summary.p1,
            Statistic::P5 => summary.p5,
            Statistic::Median => summary.median,
            Statistic::P95 => summary.p95,
            Statistic::P99 => summary.p99,
            Statistic::Max => summary.max,
        }
    }
}

impl Measure {
    /// Whether the pixel-exact metric alone has it.
    pub fn is_exact(self) -> bool {
        matches!(self, Measure::Differing | Measure::LargestDifference)
    }

    /// Whether HDR-FLIP must be computed for it.
    pub fn needs_hdr(self) -> bool {
        matches!(self, Measure::Score(ScoreName::HdrFlip) | Measure::Map(MapName::HdrFlip, _))
    }
}

impl fmt::Display for Measure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Measure::Score(name) => f.write_str(name.label()),
            Measure::Map(map, statistic) => write!(f, "{}.{}", map.label(), statistic.label()),
            Measure::Differing => f.write_str("differing"),
            Measure::LargestDifference => f.write_str("largest-difference"),
            Measure::Welch(name) => f.write_str(name.label()),
        }
    }
}

impl FromStr for Measure {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == ScoreName::Ssimulacra2.label() {
            return Err("ssimulacra2 is reported and has no limit: it punishes the darkening that is meant, \
                        and its scale changes between versions; take flip or ms-ssim"
                .to_owned());
        }
        let scores = ScoreName::ALL.into_iter().filter(|&n| n != ScoreName::Ssimulacra2).map(Measure::Score);
        let maps = MapName::ALL.into_iter().flat_map(|m| Statistic::ALL.map(|s| Measure::Map(m, s)));
        let exact = [Measure::Differing, Measure::LargestDifference];
        let welch = WelchName::ALL.map(Measure::Welch);
        let all = || scores.clone().chain(maps.clone()).chain(exact).chain(welch);
        all().find(|m| m.to_string() == text).ok_or_else(|| {
            let names = scores.clone().chain(exact).chain(welch).map(|m| m.to_string());
            let [maps, statistics] = [MapName::ALL.map(MapName::label).join(", "), Statistic::ALL.map(Statistic::label).join(", ")];
            let names = names.collect::<Vec<_>>().join(", ");
            format!("there is no '{text}'; there are: {names}, and MAP.STATISTIC of the maps {maps} and the statistics {statistics}")
        })
    }
}

/// Which side of a limit is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sense {
    /// `<=`
    AtMost,
    /// `>=`
    AtLeast,
}

/// A limit on one number, written `flip<=0.05` or `ssim>=0.98`.
///
/// ```
/// use aogauge::compare::Limit;
/// let limit: Limit = "flip.p99 <= 0.1".parse()?;
/// assert!(limit.holds(0.1) && !limit.holds(0.11) && !limit.holds(f64::NAN));
/// assert_eq!(limit.to_string(), "flip.p99<=0.1");
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub struct Limit {
    /// Of what.
    pub measure: Measure,
    /// Which side is good.
    pub sense: Sense,
    /// The last good value; finite.
    pub value: f64,
}

impl Limit {
    /// Whether a value is on the good side. NaN never is.
    pub fn holds(&self, value: f64) -> bool {
        match self.sense {
            Sense::AtMost => value <= self.value,
            Sense::AtLeast => value >= self.value,
        }
    }
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (sense, (name, value)) = [(Sense::AtMost, "<="), (Sense::AtLeast, ">=")]
            .into_iter()
            .find_map(|(sense, sign)| Some((sense, text.split_once(sign)?)))
            .ok_or_else(|| format!("'{text}' is no limit: NAME<=VALUE or NAME>=VALUE, such as flip<=0.05"))?;
        let measure = name.trim().parse()?;
        let number: Option<f64> = value.trim().parse().ok();
        let value = number
            .filter(|v| v.is_finite())
            .ok_or_else(|| format!("'{}' in '{text}' is no finite number", value.trim()))?;
        Ok(Limit { measure, sense, value })
    }
}

impl TryFrom<String> for Limit {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = match self.sense {
            Sense::AtMost => "<=",
            Sense::AtLeast => ">=",
        };
        write!(f, "{}{sign}{}", self.measure, self.value)
    }
}

/// What follows from a broken limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Tier {
    /// The image fails.
    Fail,
    /// The image passes, with a warning.
    Warn,
}

/// Limits of both tiers.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Set {
    #[serde(default)]
    fail: Vec<Limit>,
    #[serde(default)]
    warn: Vec<Limit>,
}

impl Set {
    fn all(&self) -> impl Iterator<Item = (Tier, Limit)> {
        let tier = |tier: Tier| move |l: &Limit| (tier, *l);
        self.fail.iter().map(tier(Tier::Fail)).chain(self.warn.iter().map(tier(Tier::Warn)))
    }
}

/// A pattern of paths: `*` and `?` stay within a name, `**` reaches over folders.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "String")]
struct Glob(Pattern);

impl TryFrom<String> for Glob {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        Pattern::new(&text).map(Glob).map_err(|e| format!("'{text}' is no pattern of paths: {e}"))
    }
}

impl Glob {
    fn matches(&self, path: &str) -> bool {
        let options = MatchOptions { require_literal_separator: true, ..MatchOptions::new() };
        self.0.matches_with(path, options)
    }
}

/// Limits of the images that a pattern matches.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Override {
    path: Glob,
    #[serde(default)]
    fail: Vec<Limit>,
    #[serde(default)]
    warn: Vec<Limit>,
}

/// A limits file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    fail: Vec<Limit>,
    #[serde(default)]
    warn: Vec<Limit>,
    #[serde(default, rename = "override")]
    overrides: Vec<Override>,
}

/// All limits of a comparison: those of a file, its overrides by path, and those given
/// one by one, which win over both.
///
/// A limit takes the place of an earlier one of the same tier, name and sense; so the
/// last override that matches a path wins, limit by limit.
///
/// ```
/// use aogauge::compare::{Limits, Tier};
/// let limits = Limits::from_toml("limits.toml", r#"
/// fail = ["flip<=0.05"]
/// [[override]]
/// path = "hair/**"
/// fail = ["flip<=0.1"]
/// "#)?;
/// let text = |path| limits.of(path).iter().map(|(_, l)| l.to_string()).collect::<Vec<_>>();
/// assert_eq!((text("box.png"), text("hair/a.png")), (vec!["flip<=0.05".into()], vec!["flip<=0.1".into()]));
/// # Ok::<(), aogauge::compare::CompareError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Limits {
    file: File,
    given: Set,
}

impl Limits {
    /// Limits given one by one.
    pub fn new(fail: Vec<Limit>, warn: Vec<Limit>) -> Self {
        Limits { file: File::default(), given: Set { fail, warn } }
    }

    /// Reads a limits file.
    ///
    /// # Errors
    /// Where it cannot be read, and as [`Limits::from_toml`].
    pub fn load(path: &Path) -> Result<Self, CompareError> {
        Self::from_toml(&path.display().to_string(), &crate::disk::read_text(path)?)
    }

    /// Reads limits from TOML; `file` is what errors call it.
    ///
    /// # Errors
    /// [`CompareError::Limits`] with the line, where a key is unknown, or a limit or a
    /// pattern is none.
    pub fn from_toml(file: &str, text: &str) -> Result<Self, CompareError> {
        let wrong = |e| CompareError::Limits { file: file.to_owned(), source: Box::new(e) };
        Ok(Limits { file: toml::from_str(text).map_err(wrong)?, given: Set::default() })
    }

    /// Adds limits given one by one, which win over those of the file.
    #[must_use]
    pub fn and(mut self, fail: Vec<Limit>, warn: Vec<Limit>) -> Self {
        self.given.fail.extend(fail);
        self.given.warn.extend(warn);
        self
    }

    /// The limits of an image by its path within the folder.
    pub fn of(&self, path: &str) -> Vec<(Tier, Limit)> {
        let sets = [Set { fail: self.file.fail.clone(), warn: self.file.warn.clone() }]
            .into_iter()
            .chain(self.file.overrides.iter().filter(|o| o.path.matches(path)).map(Override::set))
            .chain([self.given.clone()]);
        let mut limits: Vec<(Tier, Limit)> = Vec::new();
        for (tier, limit) in sets.flat_map(|s| s.all().collect::<Vec<_>>()) {
            let same = |(t, l): &&mut (Tier, Limit)| *t == tier && (l.measure, l.sense) == (limit.measure, limit.sense);
            match limits.iter_mut().find(same) {
                Some(earlier) => *earlier = (tier, limit),
                None => limits.push((tier, limit)),
            }
        }
        limits
    }

    /// Every limit there is, for any path.
    pub fn all(&self) -> impl Iterator<Item = Limit> {
        let file = self.file.fail.iter().chain(&self.file.warn);
        let overrides = self.file.overrides.iter().flat_map(|o| o.fail.iter().chain(&o.warn));
        file.chain(overrides).chain(&self.given.fail).chain(&self.given.warn).copied()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.all().next().is_none()
    }
}

impl Override {
    fn set(&self) -> Set {
        Set { fail: self.fail.clone(), warn: self.warn.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_and_written_alike() {
        for text in [
            "flip<=0.05",
            "ssim>=0.98",
            "hdr-flip.max<=1",
            "absolute.p99<=0.5",
            "differing<=0",
            "mean-error>=-0.01",
            "welch.tiles<=0",
        ] {
            assert_eq!(text.parse::<Limit>().unwrap().to_string(), text);
        }
        for (text, message) in [
            ("flip", "is no limit"),
            ("flip<0.1", "is no limit"),
            ("flap<=0.1", "there is no 'flap'; there are: mean-error, mae"),
            ("flip.p98<=0.1", "there is no 'flip.p98'"),
            ("flip<=x", "'x' in 'flip<=x' is no finite number"),
            ("flip<=nan", "is no finite number"),
            ("ssimulacra2>=90", "reported and has no limit"),
        ] {
            assert!(text.parse::<Limit>().unwrap_err().contains(message), "{text}");
        }
    }

    #[test]
    fn the_last_override_wins_limit_by_limit_and_the_command_line_over_all() {
        let text = r#"
fail = ["flip<=0.05", "ssim>=0.9"]
warn = ["flip<=0.02"]
[[override]]
path = "hair/**/*.png"
fail = ["flip<=0.1"]
[[override]]
path = "hair/fine/*"
fail = ["flip<=0.2"]
"#;
        let limits = Limits::from_toml("l.toml", text).unwrap();
        let of =
            |limits: &Limits, path: &str| limits.of(path).iter().map(|(t, l)| format!("{t:?} {l}")).collect::<Vec<_>>();
        assert_eq!(of(&limits, "a.png"), ["Fail flip<=0.05", "Fail ssim>=0.9", "Warn flip<=0.02"]);
        assert_eq!(of(&limits, "hair/a.png")[0], "Fail flip<=0.1");
        assert_eq!(of(&limits, "hair/x/y/a.png")[0], "Fail flip<=0.1");
        assert_eq!(of(&limits, "hair/fine/a.png"), ["Fail flip<=0.2", "Fail ssim>=0.9", "Warn flip<=0.02"]);
        assert_eq!(of(&limits, "hair/fine/x/a.png")[0], "Fail flip<=0.1", "a star stays within a folder");
        let given = limits.clone().and(vec!["flip<=0.01".parse().unwrap()], vec![]);
        assert_eq!(of(&given, "hair/a.png")[0], "Fail flip<=0.01");
        assert!(Limits::default().is_empty() && !limits.is_empty());
    }

    #[test]
    fn mistakes_in_a_file_name_the_line() {
        for (text, line, message) in [
            ("fail = [\"flip<=0.05\"]\nwarm = []\n", "line 2", "unknown field `warm`"),
            ("\nfail = [\"flip<=0.05\",\n  \"flap<=1\"]\n", "line 2", "there is no 'flap'"),
            ("\n[[override]]\npath = \"a[\"\n", "line 3", "no pattern of paths"),
            ("[[override]]\nfail = []\n", "line 1", "missing field `path`"),
            ("fail = [\"ssimulacra2>=90\"]", "line 1", "reported and has no limit"),
        ] {
            let error = Limits::from_toml("l.toml", text).unwrap_err().to_string();
            assert!(error.contains("l.toml") && error.contains(line) && error.contains(message), "{error}");
        }
    }
}
