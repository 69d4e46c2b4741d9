//! `aogauge compare`

mod records;
mod table;

use super::{Exit, Failure, json, print, run::bar, tell};
use crate::{
    compare::{
        CompareError, Drawn, Inputs, Layer, Limit, Limits, Mask, Mode, Outcome, Outputs, Own, PairReport, Rect, Region,
        Settings, compare, side_by_side, write_maps,
    },
    layers::write_png,
    metrics::image::{DEFAULT_PPD, Encoding, Options},
    run::Observer,
};
use clap::ValueEnum;
use records::Printed;
use std::path::{Path, PathBuf};

/// Compare an image, a folder of images or a record with what it should be or was.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge compare reference.png test.png\n  \
aogauge compare references/ renders/ --fail 'flip<=0.05' --fail 'ssim>=0.98' --warn 'flip.p99<=0.2'\n  \
aogauge compare references/ renders/ --limits limits.toml --maps maps --format json > compare.json\n  \
aogauge compare a.png b.png --exact --fail 'differing<=0'\n  \
aogauge compare a.png b.png --exact --diff differing.png\n  \
aogauge compare a.exr b.exr --all-layers --ignore 0,0,320,40 --maps maps\n  \
aogauge compare a.exr:beauty b.exr\n  \
aogauge compare a.png b.exr --reference-encoding srgb\n  \
aogauge compare base/ reports/latest/ --format markdown > comment.md\n\n\
OpenEXR, PNG, JPEG, Radiance HDR and TIFF. docs/compare.md tells how to use it in CI, docs/metrics.md what each\n\
metric sees and misses. Limits are on mean-error, mae, mse, rmse, psnr, relative-mse, smape, ssim, ms-ssim, flip,\n\
hdr-flip, differing, largest-difference, and on MAP.STATISTIC, such as flip.p99: of the maps absolute, signed, ssim,\n\
flip and hdr-flip the statistics mean, min, p1, p5, median, p95, p99 and max; and on welch.rejected,\n\
welch.pixels, welch.tiles, welch.image and welch.bias of two images of a record.\n\
Exit codes: 0 pass or only warnings, 1 a limit is broken or an image is missing, 2 wrong usage or a pair that cannot\n\
be compared, 4 no image to compare, 6 a metric under a limit has no value.\n\
Of two records (folders with a record.json): what changed of verdicts, metrics, images and times; 0 no verdict got\n\
worse, 1 one did, 2 a record cannot be read, 4 no case in common, 5 cases are lost.")]
pub struct Args {
    /// What to compare with: an image, FILE.exr:LAYER, a folder of images, or a record.
    reference: PathBuf,
    /// What is compared: an image, FILE.exr:LAYER, a folder with images of the same relative
    /// paths, or a record.
    test: PathBuf,
    /// Compare the images of two records as folders of images; of those without one layer
    /// that stands for the rest, such as the judge's, every layer.
    #[arg(long)]
    images: bool,
    /// The pixel-exact metric alone: how many pixels differ, and by how much. Fast.
    #[arg(long, conflicts_with_all = ["maps", "hdr", "ssimulacra2"])]
    exact: bool,
    /// A pixel differs where a channel does by more than this, of a range of 0 to 1;
    /// may be a fraction, such as 2/255.
    #[arg(long, default_value = "0", value_parser = tolerance)]
    tolerance: f64,
    /// A limit whose breach fails, NAME<=VALUE or NAME>=VALUE; may be repeated.
    #[arg(long, value_name = "LIMIT")]
    fail: Vec<Limit>,
    /// A limit whose breach is told and passes; may be repeated.
    #[arg(long, value_name = "LIMIT")]
    warn: Vec<Limit>,
    /// A TOML file of limits, with overrides for some paths.
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    /// Images that the test folder lacks, or cases that the record lacks, do not fail.
    #[arg(long)]
    allow_missing: bool,
    /// The layer of OpenEXR images; R, G and B, else Y, else mean unless given, with --exact
    /// all channels.
    #[arg(long, conflicts_with = "all_layers")]
    layer: Option<String>,
    /// Every layer of OpenEXR images, each for itself.
    #[arg(long)]
    all_layers: bool,
    /// What the numbers stand for; integers are sRGB codes and floats linear unless given.
    #[arg(long, value_enum, conflicts_with = "exact")]
    encoding: Option<Meaning>,
    /// The same of the reference alone. Where the two images then differ, both are compared
    /// as linear light.
    #[arg(long, value_enum, conflicts_with = "exact")]
    reference_encoding: Option<Meaning>,
    /// The same of the test image alone.
    #[arg(long, value_enum, conflicts_with = "exact")]
    test_encoding: Option<Meaning>,
    /// An image that weighs pixels, black 0 and white 1: FILE, FILE.exr:LAYER, or a
    /// folder of such images with the relative paths of those compared.
    #[arg(long)]
    mask: Option<String>,
    /// A rectangle that does not count: x,y,width,height; may be repeated.
    #[arg(long, value_name = "RECT")]
    ignore: Vec<Rect>,
    /// A rectangle outside which nothing counts; may be repeated.
    #[arg(long, value_name = "RECT")]
    only: Vec<Rect>,
    /// The rectangle of both images that is compared.
    #[arg(long, value_name = "RECT")]
    crop: Option<Rect>,
    /// Pixels per degree for FLIP.
    #[arg(long, default_value_t = DEFAULT_PPD)]
    ppd: f64,
    /// HDR-FLIP too: linear images beyond 0 to 1. It costs a FLIP an exposure.
    #[arg(long)]
    hdr: bool,
    /// SSIMULACRA2 too. It costs several times the rest.
    #[arg(long)]
    ssimulacra2: bool,
    /// Folder for error maps: pictures with their scale, maps.exr with the numbers, and
    /// side-by-side.png; of folders, a folder an image. Nothing that is read is written over.
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// The difference of two images. FILE.png: one picture of reference, test image and FLIP
    /// map, or with --exact the pixels that differ in red. FILE.exr: test - reference as
    /// numbers, a layer a channel.
    #[arg(long, value_name = "FILE", value_parser = DiffFile::parse)]
    diff: Option<DiffFile>,
    /// Where the scales of the absolute and the signed map end.
    #[arg(long, default_value_t = 0.25, requires = "maps")]
    scale: f64,
    /// What is printed on standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Printed,
}

/// `--diff`: what is written is told by the extension.
#[derive(Clone, Debug)]
enum DiffFile {
    /// A picture.
    Picture(PathBuf),
    /// Numbers.
    Numbers(PathBuf),
}

impl DiffFile {
    fn parse(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
            Some("png") => Ok(DiffFile::Picture(path)),
            Some("exr") => Ok(DiffFile::Numbers(path)),
            _ => {
                Err("the name must end in .png, for a picture, or in .exr, for the signed difference as numbers"
                    .to_owned())
            }
        }
    }

    fn path(&self) -> &Path {
        match self {
            DiffFile::Picture(path) | DiffFile::Numbers(path) => path,
        }
    }

    fn write(&self, drawn: &Drawn<'_>) -> Result<(), CompareError> {
        let path = match self {
            DiffFile::Numbers(path) => return Ok(drawn.difference.layers().write(path)?),
            DiffFile::Picture(path) => path,
        };
        let picture = drawn.measured.as_ref().map_or_else(|| Ok(drawn.difference.marked()), side_by_side)?;
        Ok(write_png(path, &picture)?)
    }
}

/// `--encoding`
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Meaning {
    /// Linear light or openness.
    Linear,
    /// sRGB codes.
    Srgb,
}

impl From<Meaning> for Encoding {
    fn from(m: Meaning) -> Self {
        match m {
            Meaning::Linear => Encoding::Linear,
            Meaning::Srgb => Encoding::Srgb,
        }
    }
}

impl From<CompareError> for Failure {
    fn from(e: CompareError) -> Self {
        Failure::usage(e.to_string())
    }
}

/// A number, or one over another.
fn tolerance(text: &str) -> Result<f64, String> {
    let number = |t: &str| t.trim().parse::<f64>().map_err(|_| format!("'{text}' is no number and no fraction"));
    let value = match text.split_once('/') {
        Some((a, b)) => number(a)? / number(b)?,
        None => number(text)?,
    };
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err(format!("'{text}' is not within 0 to 1")) }
}

impl Args {
    fn settings(&self, own_layers: [Option<String>; 2]) -> Result<Settings, Failure> {
        let limits = self.limits.as_deref().map(Limits::load).transpose()?.unwrap_or_default();
        let layer = match &self.layer {
            Some(name) => Layer::Named(name.clone()),
            None if self.all_layers => Layer::All,
            None if self.images => Layer::MainOrAll,
            None => Layer::Main,
        };
        Ok(Settings {
            mode: if self.exact { Mode::Exact } else { Mode::Metrics },
            options: Options { ppd: self.ppd, hdr: self.hdr, exposures: None, ssimulacra2: self.ssimulacra2 },
            layer,
            encoding: self.encoding.map(Encoding::from),
            own: {
                let [reference, test] = own_layers;
                [
                    Own { layer: reference, encoding: self.reference_encoding.map(Encoding::from) },
                    Own { layer: test, encoding: self.test_encoding.map(Encoding::from) },
                ]
            },
            mask: self.mask.as_deref().map(Mask::parse),
            region: Region { ignore: self.ignore.clone(), only: self.only.clone(), crop: self.crop },
            tolerance: self.tolerance,
            limits: limits.and(self.fail.clone(), self.warn.clone()),
            allow_missing: self.allow_missing,
            draw_exact: self.diff.is_some(),
        })
    }

    /// Whether an image may have several reports, one a layer.
    fn by_layer(&self) -> bool {
        self.all_layers || self.images && self.layer.is_none()
    }

    /// Refuses to write over what is read.
    fn check_outputs(&self, reference: &Path, test: &Path, mask: Option<&Mask>) -> Result<(), CompareError> {
        let diff = self.diff.as_ref().map(DiffFile::path);
        let outputs = Outputs { maps: self.maps.as_deref(), by_layer: self.by_layer(), diff };
        outputs.check(&Inputs { reference, test, mask: mask.map(|m| &*m.path), limits: self.limits.as_deref() })
    }

    /// Of folders, maps lie in a folder an image; of all layers, in one a layer.
    fn maps_folder(&self, root: &Path, report: &PairReport) -> PathBuf {
        let mut folder = root.to_owned();
        if self.reference.is_dir() {
            folder.extend(report.path.split('/'));
        }
        match &report.layer {
            Some(layer) if self.by_layer() => folder.join(file_name(layer)),
            _ => folder,
        }
    }
}

/// A layer's name as the name of a folder: what is no letter, digit, `-` or `_` becomes
/// `%` and its code, so that no name leads elsewhere and no two become one.
fn file_name(layer: &str) -> String {
    let mut name = String::new();
    for (i, byte) in layer.bytes().enumerate() {
        if byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_') || byte == b'.' && i > 0 {
            name.push(char::from(byte));
        } else {
            name += &format!("%{byte:02X}");
        }
    }
    name
}

/// A file and the layer that is named of it, `FILE:LAYER`; what exists as it is written
/// has none.
fn with_layer(path: PathBuf) -> (PathBuf, Option<String>) {
    match path.to_str().map(Mask::parse) {
        Some(Mask { path, layer: Some(layer) }) => (path, Some(layer)),
        _ => (path, None),
    }
}

/// Compares two images, two folders or two records.
pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    if args.as_records() {
        return records::execute(args);
    }
    let [(reference, layer), (test, test_layer)] = args.as_images()?.map(with_layer);
    let settings = args.settings([layer, test_layer])?;
    let folders = args.reference.is_dir();
    if args.diff.is_some() && (folders || args.all_layers) {
        return Err(Failure::usage(
            "--diff draws one picture of two images: --maps leaves a side-by-side.png for each of many",
        ));
    }
    args.check_outputs(&reference, &test, settings.mask.as_ref())?;
    let mut drawn = |report: &PairReport, drawn: &Drawn<'_>| {
        if let (Some(root), Some(measured)) = (&args.maps, &drawn.measured) {
            write_maps(&args.maps_folder(root, report), measured, args.scale)?;
        }
        args.diff.as_ref().map_or(Ok(()), |file| file.write(drawn))
    };
    let found = if folders {
        let bar = bar();
        compare(&reference, &test, &settings, &|done, of, what| bar.step(done as u64, of as u64, what), &mut drawn)
    } else {
        compare(&reference, &test, &settings, &|_, _, _| {}, &mut drawn)
    }?;
    match args.format {
        Printed::Json => print(&json(&found)?)?,
        _ => print(&table::table(&found, folders || args.all_layers))?,
    }
    table::warnings(&found).iter().for_each(|w| tell(w));
    Ok(match found.outcome {
        Outcome::Error => Exit::Usage,
        Outcome::Nothing => Exit::Nothing,
        Outcome::Fail => Exit::Failed,
        Outcome::Inconclusive => Exit::Inconclusive,
        Outcome::Warn | Outcome::Pass | Outcome::Measured => Exit::Pass,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_become_names_of_folders() {
        for (layer, name) in [
            ("color.RGB", "color.RGB"),
            ("../../x", "%2E.%2F..%2Fx"),
            ("a/b", "a%2Fb"),
            ("..", "%2E."),
            ("ä", "%C3%A4"),
        ] {
            assert_eq!(file_name(layer), name);
        }
    }

    #[test]
    fn a_tolerance_may_be_a_fraction() {
        assert_eq!(tolerance("2/255"), Ok(2.0 / 255.0));
        assert_eq!(tolerance("0.5"), Ok(0.5));
        for text in ["", "x", "-1", "2", "1/0", "0/0", "nan"] {
            assert!(tolerance(text).is_err(), "{text}");
        }
    }
}
