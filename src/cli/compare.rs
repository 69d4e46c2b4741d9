//! `aogauge compare`

use super::{Exit, Failure, Format, json, print, tell};
use crate::{
    layers::{Layers, write_png},
    metrics::image::{DEFAULT_PPD, Encoding, Image, ImageError, Maps, NonFinite, Options, Pair, Scores, scores},
    picture::{
        error_map::{self, Caption, ErrorMap, MapError},
        read::read,
        scale::Scale,
    },
    stats::{self, Replicates, ScaleTest, pixel_p_values, three_scales},
};
use clap::ValueEnum;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Compare an image with a reference of the same view, by every full-reference metric.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge compare reference.png test.png\n  \
aogauge compare reference.exr test.exr --layer mean --mask footprint.png\n  \
aogauge compare reference.png test.png --maps maps\n  \
aogauge compare reference.hdr test.hdr --hdr --format json\n\n\
OpenEXR, PNG, JPEG, Radiance HDR and TIFF. docs/metrics.md tells what each metric sees and misses.\n\
Where both are images of a record, with a layer for each replicate, Welch's test at three scales tells\n\
whether they may be samples of one expectation.")]
pub struct Args {
    /// What to compare with.
    reference: PathBuf,
    /// What is compared.
    test: PathBuf,
    /// The layer of OpenEXR images; R, G and B, else Y, else mean unless given.
    #[arg(long)]
    layer: Option<String>,
    /// What the numbers stand for; integers are sRGB codes and floats linear unless given.
    #[arg(long, value_enum)]
    encoding: Option<Meaning>,
    /// An image that weighs pixels: black 0, white 1.
    #[arg(long)]
    mask: Option<PathBuf>,
    /// Pixels per degree for FLIP.
    #[arg(long, default_value_t = DEFAULT_PPD)]
    ppd: f64,
    /// HDR-FLIP too: linear images beyond 0 to 1. It costs a FLIP an exposure.
    #[arg(long)]
    hdr: bool,
    /// SSIMULACRA2 too. It costs several times the rest.
    #[arg(long)]
    ssimulacra2: bool,
    /// Folder for error maps: pictures with their scale, and maps.exr with the numbers.
    #[arg(long)]
    maps: Option<PathBuf>,
    /// Where the scales of the absolute and the signed map end.
    #[arg(long, default_value_t = 0.25, requires = "maps")]
    scale: f64,
    /// What is printed on standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The chance of any rejection, over all places and scales, where both images have
/// one expectation.
const ALPHA: f64 = 0.01;

/// Two images and what was found of them.
#[derive(Serialize)]
struct Found {
    #[serde(flatten)]
    scores: Scores,
    /// Welch's test, from small to large places; absent where there are no replicates.
    #[serde(skip_serializing_if = "Option::is_none")]
    welch: Option<[ScaleTest; 3]>,
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

/// Compares two images.
pub(super) fn execute(args: &Args) -> Result<Exit, Failure> {
    let encoding = args.encoding.map(Encoding::from);
    let layer = args.layer.as_deref();
    let reference = read(&args.reference, layer, encoding)?;
    let test = read(&args.test, layer, encoding)?;
    let mask = args.mask.as_deref().map(read_mask).transpose()?;
    let between =
        |e: ImageError| Failure::usage(format!("{} and {}: {e}", args.reference.display(), args.test.display()));
    let pair = Pair::new(&reference.image, &test.image, mask.as_deref()).map_err(between)?;
    let options = Options { ppd: args.ppd, hdr: args.hdr, exposures: None, ssimulacra2: args.ssimulacra2 };
    let (scores, maps) = scores(&pair, &options).map_err(between)?;
    let sampled = [replicates(&args.reference, layer)?, replicates(&args.test, layer)?];
    let sampled = match &sampled {
        [Some(reference), Some(test)] => Some([sample(reference), sample(test)]),
        _ => None,
    };
    let size = scores.size.map(|n| n as u32);
    if let Some(folder) = &args.maps {
        let p = sampled.as_ref().map(|[reference, test]| pixel_p_values(size, test, reference));
        write_maps(folder, size, maps, p, args.scale)?;
    }
    let welch = sampled.as_ref().map(|[reference, test]| three_scales(size, test, reference, ALPHA, 1));
    let found = Found { scores, welch };
    match args.format {
        Format::Text => print(&(table(&found.scores) + &welch_table(found.welch.as_ref())))?,
        Format::Json => print(&json(&found)?)?,
    }
    let NonFinite { reference, test, both } = found.scores.non_finite;
    if reference + test + both > 0 {
        tell(&format!(
            "warning: NaN or infinity at {reference} pixels of the reference alone, {test} of the test image alone and {both} of both; they are left out"
        ));
    }
    Ok(Exit::Pass)
}

/// The replicates of an image of a record, two or more; none where other layers
/// than the mean are asked for.
fn replicates(path: &Path, layer: Option<&str>) -> Result<Option<Vec<Vec<f32>>>, Failure> {
    let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
    if !is_exr || layer.is_some_and(|l| l != "mean") {
        return Ok(None);
    }
    let layers = Layers::read(path)?.layers;
    let replicates: Vec<Vec<f32>> =
        layers.into_iter().filter(|(name, _)| name.starts_with("replicate-")).map(|(_, values)| values).collect();
    Ok((replicates.len() >= 2).then_some(replicates))
}

fn sample(replicates: &[Vec<f32>]) -> Replicates<'_> {
    Replicates { images: replicates.iter().map(Vec::as_slice).collect(), quantum: 0.0 }
}

fn welch_table(scales: Option<&[ScaleTest; 3]>) -> String {
    let Some(scales) = scales else {
        return String::new();
    };
    let mut text = format!("\nWelch's test of the replicates, family error {ALPHA}\n");
    for test in scales {
        let name = match test.scale {
            stats::Scale::Pixel => "pixels",
            stats::Scale::Tile => "tiles",
            stats::Scale::Image => "image",
        };
        let surest = test.rejected.first().map_or_else(String::new, |d| {
            let [x, y, w, h] = d.place;
            format!("; surest at {x}, {y} ({w} x {h}): bias {:+.5}, p = {:.1e}", d.bias, d.p)
        });
        text += &format!(
            "{name:<14} {} of {} reject, a bias of {:.4} would have been found{surest}\n",
            test.rejected.len(),
            test.tests,
            test.detectable
        );
    }
    text
}

/// A mask's weights: linear, the mean of its channels.
fn read_mask(path: &Path) -> Result<Vec<f32>, Failure> {
    let image: Image = read(path, None, Some(Encoding::Linear))?.image;
    let planes = image.planes();
    let weight = |i: usize| planes.iter().map(|p| p[i]).sum::<f32>() / planes.len() as f32;
    Ok((0..image.pixels()).map(weight).collect())
}

/// Writes a picture a map, and all maps as layers.
fn write_maps(folder: &Path, size: [u32; 2], maps: Maps, p: Option<Vec<f64>>, scale: f64) -> Result<(), Failure> {
    let wrong = |e: MapError| Failure::usage(e.to_string());
    let mut drawn = Vec::new();
    for (name, values, scale) in [
        ("absolute", maps.absolute, Scale::absolute(scale)),
        ("signed", maps.signed, Scale::signed(scale)),
        ("ssim", maps.ssim, Scale::similarity(0.0)),
        ("flip", maps.flip, Ok(Scale::flip())),
        ("hdr-flip", maps.hdr_flip, Ok(Scale::flip())),
    ] {
        if !values.is_empty() {
            drawn.push((name, ErrorMap::new(size, values, scale.map_err(wrong)?).map_err(wrong)?));
        }
    }
    if let Some(p) = p {
        drawn.push(("p-value", ErrorMap::p_values(size, &p, ALPHA).map_err(wrong)?));
    }
    for (name, map) in &drawn {
        let title = match *name {
            "absolute" => "|test - reference|",
            "signed" => "test - reference",
            "p-value" => "Welch's test of each pixel, p",
            other => other,
        };
        write_png(&folder.join(format!("{name}.png")), &map.picture(&Caption { title, unit: "" }))?;
    }
    let all = error_map::layers(drawn.iter().map(|(name, map)| (*name, map))).map_err(wrong)?;
    Ok(all.write(&folder.join("maps.exr"))?)
}

fn table(found: &Scores) -> String {
    let [width, height] = found.size;
    let mut text = format!(
        "{width} x {height} pixels, {} channel{}, {}; FLIP at {} pixels per degree\n\n",
        found.channels,
        if found.channels == 1 { "" } else { "s" },
        found.encoding.label(),
        found.ppd
    );
    for score in &found.scores {
        let value = score.value.map_or_else(|| "–".to_owned(), |v| format!("{v:.6}"));
        let why = score.note.as_deref().unwrap_or_else(|| score.name.reading());
        text += &format!("{:<14} {value:>12}   {why}\n", score.name.label());
    }
    text += &format!("\n{:<14} {:>10} {:>10} {:>10} {:>10}  at\n", "map", "median", "worst 5 %", "worst 1 %", "worst");
    for (name, m) in &found.maps {
        // Of SSIM the lowest values are the worst.
        let (five, one, worst, [x, y]) = match name.as_str() {
            "ssim" => (m.p5, m.p1, m.min, m.min_at),
            _ => (m.p95, m.p99, m.max, m.max_at),
        };
        text += &format!("{name:<14} {:>10.6} {five:>10.6} {one:>10.6} {worst:>10.6}  {x}, {y}\n", m.median);
    }
    text
}
