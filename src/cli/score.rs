//! `aogauge score`

use super::{
    Exit, Failure, Format,
    report::Beside,
    run::{finish, tell_moved},
    tell,
};
use crate::{
    disk::read_text,
    intake::{Means, Rows, Share, Upsample},
    metrics::image::Encoding,
    record::RecordFolder,
    run::{References, ReferencesError},
    score::{self, CurveChoice, Declaration, Fit, KnownCurve, ScoreError},
    untrusted::logged,
};
use serde::de::{
    DeserializeOwned, IntoDeserializer,
    value::{Error, StrDeserializer},
};
use std::path::PathBuf;

/// Judge the images of your own renderer, drawn from a kit (`aogauge scene export --suite`):
/// the same metrics, gates, record and reports as of a run. Nothing is rendered.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge score mine/ --kit kit/ --out reports/mine\n  \
aogauge score mine/ --kit kit/ --means occlusion --rows bottom --curve fit --report markdown,html\n  \
aogauge score mine/ --kit kit/ --gates my-gates.toml --format json\n\n\
Images are called SCENE.ESTIMATOR.RAYS.REPLICATE.exr. What options declare may stand in score.toml beside\nthem. \
docs/your-renderer.md takes you through it.\n\n\
Exit codes: 0 pass, 1 a gate failed, 2 wrong usage, a damaged kit or a wrong self-check image, 4 there is\n\
nothing to score or no gate speaks of it, 5 images are missing or wrong, 6 not decided.")]
pub struct Args {
    /// The folder of the images.
    images: PathBuf,
    /// The kit, or its folder `scoring` alone.
    #[arg(long)]
    kit: PathBuf,
    /// Folder for the record. An older record of that name is moved aside to NAME.previous.
    #[arg(long, default_value = "reports/latest")]
    out: PathBuf,
    #[command(flatten)]
    declared: Declared,
    /// Score what there is: scenes without images are left out.
    #[arg(long)]
    partial: bool,
    /// A TOML file of `[[gate]]` tables, as in suites (docs/gates.md), in place of the suite's
    /// gates.
    #[arg(long, value_name = "FILE")]
    gates: Option<PathBuf>,
    #[command(flatten)]
    beside: Beside,
    /// What is printed on standard output: nothing, or the record.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// What options declare of the images.
#[derive(Clone, Debug, Default, clap::Args)]
struct Declared {
    /// Name of the renderer in the record; that of the folder unless given.
    #[arg(long)]
    renderer: Option<String>,
    /// The estimator of images whose names do not say it.
    #[arg(long)]
    estimator: Option<String>,
    /// Their rays a pixel.
    #[arg(long)]
    rays: Option<u32>,
    /// What stored numbers stand for: linear or srgb. Unless given, floats are linear, and of
    /// integers it is detected, with a warning.
    #[arg(long, value_parser = word::<Encoding>)]
    encoding: Option<Encoding>,
    /// What a stored 1 means: openness (unless given) or occlusion.
    #[arg(long, value_parser = word::<Means>)]
    means: Option<Means>,
    /// The first row of a file: top of the view (unless given) or bottom.
    #[arg(long, value_parser = word::<Rows>)]
    rows: Option<Rows>,
    /// How large images are beside the view: full (unless given), half or quarter.
    #[arg(long, value_parser = word::<Share>)]
    resolution: Option<Share>,
    /// How smaller ones are brought to its size: nearest (unless given) or bilinear.
    #[arg(long, value_parser = word::<Upsample>)]
    upsample: Option<Upsample>,
    /// The layer of OpenEXR files.
    #[arg(long)]
    layer: Option<String>,
    /// Undo an intensity curve, seen = GAIN * openness ^ EXPONENT: two numbers with a comma,
    /// or fit, which finds them on the control scenes.
    #[arg(long, value_name = "fit|GAIN,EXPONENT", value_parser = curve, allow_hyphen_values = true)]
    curve: Option<CurveChoice>,
}

/// A word that a declaration knows.
fn word<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    let word: StrDeserializer<'_, Error> = text.into_deserializer();
    T::deserialize(word).map_err(|e| e.to_string())
}

fn curve(text: &str) -> Result<CurveChoice, String> {
    if text == "fit" {
        return Ok(CurveChoice::Fit(Fit::Fit));
    }
    let parsed = text.split_once(',').and_then(|(g, e)| Some((g.trim().parse().ok()?, e.trim().parse().ok()?)));
    let (gain, exponent) = parsed.ok_or("give fit, or gain (0.000001 to 1000) and exponent (0.1 to 10) as in 1,2.2")?;
    Ok(CurveChoice::Known(KnownCurve { gain, exponent }))
}

impl From<ScoreError> for Failure {
    fn from(e: ScoreError) -> Self {
        let exit = match e {
            ScoreError::Nothing(_) => Exit::Nothing,
            ScoreError::Disagrees(_) => Exit::Incomplete,
            _ => Exit::Usage,
        };
        Failure { exit, message: e.to_string() }
    }
}

impl From<ReferencesError> for Failure {
    fn from(e: ReferencesError) -> Self {
        Failure::usage(e.to_string())
    }
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    args.beside.check(args.format)?;
    let references = References::read(&args.kit)?;
    let options = args.declared.clone();
    let options = Declaration {
        renderer: options.renderer,
        kit: None,
        estimator: options.estimator,
        rays: options.rays,
        encoding: options.encoding,
        means: options.means,
        rows: options.rows,
        resolution: options.resolution,
        upsample: options.upsample,
        layer: options.layer,
        curve: options.curve,
    };
    let declaration = options.or_else(Declaration::read(&args.images)?);
    let gates = match &args.gates {
        Some(path) => Some((path.display().to_string(), read_text(path)?)),
        None => None,
    };
    let gathered = score::gather(&args.images, &references, &declaration, args.partial)?;
    for warning in &gathered.handed_in.warnings {
        tell(&format!("aogauge: {}", logged(warning)));
    }
    let scored =
        references.ready(&gathered.cases, gates.as_ref().map(|(label, text)| (label.as_str(), text.as_str())))?;
    let folder = RecordFolder::create(&args.out)?;
    tell_moved(&folder);
    let record = scored.score(gathered.handed_in, &folder)?;
    finish(&record, &folder, &args.beside, args.format)
}
