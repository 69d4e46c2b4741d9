//! `aogauge flatland`

use super::{Exit, Failure, Format, json, print, run::bar, tell};
use crate::{
    disk::{refuse_foreign, write_whole},
    flatland::{Estimator, Measure, ReceiverPlane, Setting, Space},
    report::flatland as plots,
    run::Observer,
};
use clap::ValueEnum;
use std::{io::Write, path::PathBuf};

/// Openness under a box, computed without rays (the paper's section 3): profiles, apex, and a map of
/// where the artifact lives.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  aogauge flatland\n  aogauge flatland --width 0.02 --gap 0.05,0.10 --map --out reports/mine\n  \
aogauge flatland --space flat --measure uniform --receiver-plane clipped --format json\n  \
aogauge flatland --falloff exponential --sigma 12"
)]
pub struct Args {
    /// Widths of the box, w, metres.
    #[arg(long, value_delimiter = ',', allow_negative_numbers = true, default_value = "0.02,0.05,0.10,0.20")]
    width: Vec<f64>,
    /// Gaps between the ground and the box, m, metres.
    #[arg(long, value_delimiter = ',', allow_negative_numbers = true, default_value = "0.05,0.10,0.15,0.20")]
    gap: Vec<f64>,
    /// Length of primary rays, R, metres.
    #[arg(long, default_value_t = 0.25, allow_negative_numbers = true)]
    radius: f64,
    /// Height of the box, h, metres.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    height: f64,
    /// Half the length of secondary rays, R', metres; R/4 unless given.
    #[arg(long, allow_negative_numbers = true)]
    secondary_radius: Option<f64>,
    /// How directions are weighted.
    #[arg(long, value_enum, default_value = "cosine")]
    measure: Measure,
    /// The cross-section, or 3D with an infinitely long box.
    #[arg(long, value_enum, default_value = "extruded")]
    space: Space,
    /// What a hit at distance d does: the step closes below R; the exponential lets 1 - exp(-sigma d) through, and
    /// has no extended method.
    #[arg(long, value_enum, default_value_t)]
    falloff: Falloff,
    /// Extinction of the exponential, 1/m; 3/R unless given.
    #[arg(long, allow_negative_numbers = true)]
    sigma: Option<f64>,
    /// End the exponential's rays at R: hits beyond it count as open.
    #[arg(long)]
    limited: bool,
    /// Whether the ground closes secondary rays; both readings unless given.
    #[arg(long, value_enum, value_delimiter = ',')]
    receiver_plane: Vec<ReceiverPlane>,
    /// Map highlight contrast over w/R and m/R too.
    #[arg(long)]
    map: bool,
    /// Folder for flatland.json, profiles.svg and, with --map, map.svg; no file of others is replaced.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How results are printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Falloff {
    /// Classic and extended.
    #[default]
    Step,
    /// Eq. 2.
    Exponential,
}

macro_rules! choices {
    ($type:ty, $($variant:ident = $name:literal, $help:literal);+) => {
        impl ValueEnum for $type {
            fn value_variants<'a>() -> &'a [Self] {
                &[$(<$type>::$variant),+]
            }
            fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
                Some(match self { $(<$type>::$variant => clap::builder::PossibleValue::new($name).help($help)),+ })
            }
        }
    };
}
choices!(Measure, Uniform = "uniform", "All directions alike"; Cosine = "cosine", "By the cosine to the normal");
choices!(Space, Flat = "flat", "The cross-section"; Extruded = "extruded", "3D, the box infinitely long");
choices!(ReceiverPlane, Clipped = "clipped", "Secondary rays end at the ground"; Counts = "counts", "The ground closes them");

/// The longest length that is taken, metres.
const LONGEST: f64 = 1e6;
/// The shortest, so that ratios of lengths stay finite.
const SHORTEST: f64 = 1e-6;
/// The longest list: each value is a panel or a curve of the plot.
const MOST: usize = 8;

/// The files in the folder.
const PROFILES: &str = "profiles.svg";
const MAP: &str = "map.svg";
const NUMBERS: &str = "flatland.json";

fn length(option: &str, value: f64) -> Result<f64, Failure> {
    if (SHORTEST..=LONGEST).contains(&value) {
        return Ok(value);
    }
    Err(Failure::usage(format!("--{option} {value} is out of range: give from {SHORTEST} to {LONGEST} metres")))
}

fn lengths(option: &str, values: &[f64]) -> Result<Vec<f64>, Failure> {
    if values.len() > MOST {
        return Err(Failure::usage(format!("--{option} has {} values: give from 1 to {MOST}", values.len())));
    }
    let mut list = values.iter().map(|&v| length(option, v)).collect::<Result<Vec<_>, _>>()?;
    list.sort_by(f64::total_cmp);
    list.dedup();
    Ok(list)
}

impl Args {
    /// Each file may replace one of its own kind alone.
    fn check_out(&self) -> Result<(), Failure> {
        let Some(out) = &self.out else { return Ok(()) };
        let files = [(PROFILES, plots::PROFILES_BEGIN), (MAP, plots::MAP_BEGINS), (NUMBERS, "{\n  \"setting\": {")];
        let mut written = files.into_iter().filter(|(name, _)| self.map || *name != MAP);
        Ok(written.try_for_each(|(name, mark)| refuse_foreign(out, name, &[mark], [name], "study of flatland"))?)
    }

    fn estimators(&self, radius: f64) -> Result<Vec<Estimator>, Failure> {
        let exponential = self.falloff == Falloff::Exponential;
        for (option, given, meant_for_exponential) in [
            ("sigma", self.sigma.is_some(), true),
            ("limited", self.limited, true),
            ("secondary-radius", self.secondary_radius.is_some(), false),
            ("receiver-plane", !self.receiver_plane.is_empty(), false),
        ] {
            if given && meant_for_exponential != exponential {
                let falloff = if meant_for_exponential { "exponential" } else { "step" };
                return Err(Failure::usage(format!("--{option} needs --falloff {falloff}")));
            }
        }
        if exponential {
            let sigma = self.sigma.unwrap_or(3.0 / radius);
            if !(0.0..=1e9).contains(&sigma) {
                return Err(Failure::usage(format!("--sigma {sigma} is out of range: give from 0 to 1e9 per metre")));
            }
            return Ok(vec![Estimator::Obscurance { sigma, limited: self.limited }]);
        }
        let secondary_radius = length("secondary-radius", self.secondary_radius.unwrap_or(radius / 4.0))?;
        let mut estimators = vec![Estimator::Classic];
        for receiver_plane in [ReceiverPlane::Clipped, ReceiverPlane::Counts] {
            if self.receiver_plane.is_empty() || self.receiver_plane.contains(&receiver_plane) {
                estimators.push(Estimator::Extended { secondary_radius, receiver_plane });
            }
        }
        Ok(estimators)
    }

    fn setting(&self) -> Result<Setting, Failure> {
        let radius = length("radius", self.radius)?;
        Ok(Setting {
            radius,
            height: length("height", self.height)?,
            space: self.space,
            measure: self.measure,
            widths: lengths("width", &self.width)?,
            gaps: lengths("gap", &self.gap)?,
            estimators: self.estimators(radius)?,
        })
    }
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let setting = args.setting()?;
    args.check_out()?;
    let mut study = setting.study();
    if args.map {
        let bar = bar();
        study.map = Some(study.setting.map(&|done, total| bar.step(done as u64, total as u64, "boxes of the map")));
    }
    let document = json(&study)?;
    if let Some(out) = &args.out {
        let unplotted = |e| Failure::usage(format!("the plot cannot be drawn: {e}"));
        let mut files = vec![(PROFILES, plots::profiles(&study).map_err(unplotted)?)];
        if let Some(map) = &study.map {
            files.push((MAP, plots::map(&study.setting, map).map_err(unplotted)?));
        }
        // Last, so that where it is, the plots are.
        files.push((NUMBERS, document.clone()));
        for (name, text) in files {
            let path = out.join(name);
            write_whole(&path, |file| file.write_all(text.as_bytes()))?;
            tell(&path.display().to_string());
        }
    }
    print(&match args.format {
        Format::Json => document,
        Format::Text => plots::table(&study),
    })?;
    Ok(Exit::Pass)
}
