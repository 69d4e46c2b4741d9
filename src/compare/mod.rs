//! Images against references: pairs of files and of folders, by every full-reference
//! metric or pixel by pixel, with limits that make a verdict.
//!
//! Any renderer's images will do: nothing here knows of scenes or suites.

mod channels;
mod difference;
mod exact;
mod folders;
mod limits;
mod outputs;
mod pair;
mod pictures;
mod region;
mod report;
mod sampled;

pub use channels::exact_channels;
pub use difference::Difference;
pub use exact::{Exact, exact, exact_images};
pub use folders::Pairing;
pub use limits::{Limit, Limits, MapName, Measure, Sense, Statistic, Tier, WelchName};
pub use outputs::{Inputs, Outputs};
pub use pictures::{Drawn, Measured, side_by_side, write_maps};
pub use region::{Rect, Region, Weights};
pub use report::{Comparison, LimitReport, LimitState, Mode, Outcome, PairReport, VERSION};
pub use sampled::WelchReport;

use crate::{
    disk::{DiskError, is_zip},
    metrics::image::{Encoding, ImageError, Options},
    picture::{
        error_map::MapError,
        read::{Alpha, Found},
    },
};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// The chance that Welch's test rejects anything, over all places and scales, where
/// both images have one expectation.
pub const ALPHA: f64 = 0.01;

/// Why images cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A file cannot be read or written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The images do not fit each other.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A map cannot be drawn.
    #[error(transparent)]
    Map(#[from] MapError),
    /// Two files do not go together.
    #[error("{} and {}: {source}", reference.display(), test.display())]
    Between {
        /// The reference.
        reference: PathBuf,
        /// The test image.
        test: PathBuf,
        /// Why.
        source: Box<CompareError>,
    },
    /// A rectangle is not within the image.
    #[error("{option} {rect} reaches beyond the image of {} x {} pixels", size[0], size[1])]
    Outside {
        /// The option it came by.
        option: &'static str,
        /// The rectangle.
        rect: Rect,
        /// Width and height of the image.
        size: [usize; 2],
    },
    /// Integers against floats.
    #[error(
        "one image holds integers (8 or 16 bits a channel) and the other floats, and the pixel-exact metric compares \
         numbers as they are stored: save both in one format, or leave --exact away and say by --reference-encoding or \
         --test-encoding what the numbers of one stand for"
    )]
    Kinds,
    /// sRGB codes against linear light.
    #[error(
        "{} and {}: say by --reference-encoding or --test-encoding, linear or srgb, what the numbers of one stand for, and \
         both are compared as linear light; or by --encoding what those of both stand for", taken_for("reference", *reference), taken_for("test image", *test)
    )]
    Encodings {
        /// Of the reference.
        reference: Encoding,
        /// Of the test image.
        test: Encoding,
    },
    /// One image alone has an alpha channel, and it says something.
    #[error(
        "the reference has the channels {reference} and the test image {test}, and alpha is not 1 everywhere: save both \
         with alpha or both without"
    )]
    Alpha {
        /// Channels of the reference.
        reference: &'static str,
        /// Channels of the test image.
        test: &'static str,
    },
    /// Data windows of OpenEXR begin at different places.
    #[error("the data windows begin at different pixels: the reference's at {}, {}, the test image's at {}, {}", reference[0], reference[1], test[0], test[1])]
    Origins {
        /// Of the reference.
        reference: [i32; 2],
        /// Of the test image.
        test: [i32; 2],
    },
    /// The channels of two OpenEXR files have other names.
    #[error(
        "the reference has the channels {reference} and the test image {test}: name a layer of both by --layer, or of \
         one by FILE.exr:LAYER"
    )]
    ChannelNames {
        /// Of the reference.
        reference: String,
        /// Of the test image.
        test: String,
    },
    /// The parts of an OpenEXR file have several sizes.
    #[error("the parts of the OpenEXR files are of several sizes: compare each for itself by --all-layers or --layer")]
    Parts,
    /// Both images together are too large.
    #[error(
        "both images together take {bytes} bytes when they are decoded, at most {most} can be taken: compare smaller \
         ones"
    )]
    Together {
        /// Bytes of both.
        bytes: u64,
        /// The most that may be.
        most: u64,
    },
    /// A layer was named for a folder, or for one of all layers.
    #[error("{}: FILE:LAYER names a layer of one of two images; {why}", file.display())]
    OwnLayer {
        /// The file or folder.
        file: PathBuf,
        /// What does not go with it.
        why: &'static str,
    },
    /// A layer is in one file only.
    #[error("the layer is in {} alone", path.display())]
    Layer {
        /// The file that has it.
        path: PathBuf,
    },
    /// A folder is a record.
    #[error("{} is a record (it has a record.json): compare it with another record, or a folder of images with a folder of images", folder.display())]
    Record {
        /// The folder.
        folder: PathBuf,
    },
    /// The name of an image is no text, and pairs are told by their names.
    #[error(
        "{file:?}: the name of this image is not UTF-8, and no report could name it: rename it; nothing is compared"
    )]
    Name {
        /// The image; its message shows bytes that are no text as escapes.
        file: PathBuf,
    },
    /// Folders in folders without end.
    #[error("{}: folders lie more than {most} deep", folder.display())]
    Deep {
        /// The folder.
        folder: PathBuf,
        /// How deep they may lie.
        most: usize,
    },
    /// A file and a folder.
    #[error("{} is a folder and {} is none: both must be images, or both folders of images", folder.display(), file.display())]
    FolderAndFile {
        /// The folder.
        folder: PathBuf,
        /// The other.
        file: PathBuf,
    },
    /// A folder, and nothing to compare with it.
    #[error("{} is a folder and {} does not exist: both must be images, or both folders of images", folder.display(), missing.display())]
    Missing {
        /// The folder.
        folder: PathBuf,
        /// What is not there.
        missing: PathBuf,
    },
    /// An archive in place of images.
    #[error("{} is a zip archive: unpack it first, and name the folder", file.display())]
    Zip {
        /// The archive.
        file: PathBuf,
    },
    /// What would be written is what is read.
    #[error("{option} would write over {}, which is read here: give it another name", file.display())]
    Overwrites {
        /// The option.
        option: &'static str,
        /// The file.
        file: PathBuf,
    },
    /// Maps would lie among references.
    #[error("--maps {}: this lies in the folder of the references, which is never written: name another folder", folder.display())]
    IntoReferences {
        /// The folder for maps.
        folder: PathBuf,
    },
    /// A limits file is malformed. The message names the line.
    #[error("{file}: {source}")]
    Limits {
        /// The file.
        file: String,
        /// What and where.
        source: Box<toml::de::Error>,
    },
    /// A limit on what is not computed.
    #[error("the limit {limit}: --exact computes differing and largest-difference alone")]
    NotExact {
        /// The limit.
        limit: Limit,
    },
    /// A number is out of its range.
    #[error("the tolerance is {0}, it must be 0 to 1")]
    Tolerance(f64),
}

/// Which layers of OpenEXR images are compared.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Layer {
    /// R, G and B, else Y, else `mean`, else the only channel.
    #[default]
    Main,
    /// One by name.
    Named(String),
    /// All of them, each for itself.
    All,
    /// The main one as of [`Layer::Main`], and all of a file that has none.
    MainOrAll,
}

/// An image of weights, black 0 and white 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// The file; or a folder, whose images weigh those of the same relative path.
    pub path: PathBuf,
    /// The layer of an OpenEXR file.
    pub layer: Option<String>,
}

/// What is said of one of two images alone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Own {
    /// Its layer, in place of [`Settings::layer`].
    pub layer: Option<String>,
    /// What its numbers stand for, in place of [`Settings::encoding`].
    pub encoding: Option<Encoding>,
}

impl Mask {
    /// Reads `FILE`, `FOLDER` or `FILE:LAYER`; what exists as it is written has no
    /// layer.
    pub fn parse(text: &str) -> Self {
        let whole = Mask { path: text.into(), layer: None };
        match text.rsplit_once(':') {
            Some((file, layer)) if !whole.path.exists() && Path::new(file).exists() => {
                Mask { path: file.into(), layer: Some(layer.to_owned()) }
            }
            _ => whole,
        }
    }
}

/// How images are compared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// By what.
    pub mode: Mode,
    /// What the metrics are computed with.
    pub options: Options,
    /// Layers of OpenEXR images.
    pub layer: Layer,
    /// What the numbers stand for; by the kind of file unless given.
    pub encoding: Option<Encoding>,
    /// What is said of the reference alone, and of the test image. Where an encoding is
    /// said of one, and the other's is another, both are compared as linear light.
    pub own: [Own; 2],
    /// Weights of pixels.
    pub mask: Option<Mask>,
    /// Rectangles.
    pub region: Region,
    /// A pixel differs where a channel does by more than this, of a range of 0 to 1.
    pub tolerance: f64,
    /// What must hold.
    pub limits: Limits,
    /// Images of the reference may be missing.
    pub allow_missing: bool,
    /// The pixel-exact metric alone keeps what `drawn` needs, too: files of the same bytes
    /// are decoded.
    pub draw_exact: bool,
}

impl Settings {
    fn check(&self) -> Result<(), CompareError> {
        if !(0.0..=1.0).contains(&self.tolerance) {
            return Err(CompareError::Tolerance(self.tolerance));
        }
        match self.limits.all().find(|l| self.mode == Mode::Exact && !l.measure.is_exact()) {
            Some(limit) => Err(CompareError::NotExact { limit }),
            None => Ok(()),
        }
    }
}

/// Compares two images, or two folders of images by relative path.
///
/// `step` is told how many pairs are done, of how many, and the next one's path.
/// `drawn` is given every pair that has maps, and with [`Settings::draw_exact`] every pair,
/// while its images are in memory.
///
/// # Errors
/// Of two files, whatever keeps them from being compared. Of two folders that becomes
/// an error of the pair, and errors are what concerns all pairs: settings, the folders
/// themselves, and what `drawn` returns.
pub fn compare(
    reference: &Path,
    test: &Path,
    settings: &Settings,
    step: &dyn Fn(usize, usize, &str),
    drawn: &mut dyn FnMut(&PairReport, &Drawn<'_>) -> Result<(), CompareError>,
) -> Result<Comparison, CompareError> {
    settings.check()?;
    let mut settings = settings.clone();
    settings.options.hdr |= settings.limits.all().any(|l| l.measure.needs_hdr());
    let mut comparison = Comparison::new(reference, test, &settings);
    for (file, own) in [reference, test].into_iter().zip(&settings.own) {
        let why = match &settings.layer {
            _ if own.layer.is_none() => continue,
            Layer::All => "--all-layers takes all of both",
            _ if file.is_dir() => "this is a folder",
            _ => continue,
        };
        return Err(CompareError::OwnLayer { file: file.to_owned(), why });
    }
    if let Some(file) = [reference, test].into_iter().find(|path| is_zip(path)) {
        return Err(CompareError::Zip { file: file.to_owned() });
    }
    for (folder, missing) in [(reference, test), (test, reference)] {
        if folder.is_dir() && !missing.exists() {
            return Err(CompareError::Missing { folder: folder.into(), missing: missing.into() });
        }
    }
    match (reference.is_dir(), test.is_dir()) {
        (true, true) => {}
        (false, false) => {
            let name = reference.display().to_string();
            comparison.pairs = pair::Files { reference, test, name: &name, mask: None }.compare(&settings, drawn)?;
            comparison.conclude(settings.allow_missing);
            return Ok(comparison);
        }
        (true, false) => return Err(CompareError::FolderAndFile { folder: reference.into(), file: test.into() }),
        (false, true) => return Err(CompareError::FolderAndFile { folder: test.into(), file: reference.into() }),
    }
    let pairing = Pairing::of(reference, test)?;
    for (i, name) in pairing.both.iter().enumerate() {
        step(i, pairing.both.len(), name);
        let (reference, test) = (&reference.join(name), &test.join(name));
        let mut failed = None;
        let mut keep = |report: &PairReport, maps: &Drawn<'_>| {
            drawn(report, maps).map_err(|e| {
                // What cannot be written concerns all pairs, not this one.
                let message = e.to_string();
                failed = Some(e);
                DiskError::content(Path::new(name), message).into()
            })
        };
        let found = pair::Files { reference, test, name, mask: Some(name) }.compare(&settings, &mut keep);
        if let Some(e) = failed {
            return Err(e);
        }
        let reports = found.unwrap_or_else(|e| vec![PairReport::failed(name, None, &e)]);
        comparison.pairs.extend(reports);
    }
    (comparison.missing, comparison.new) = (pairing.missing, pairing.new);
    comparison.left_out = pairing.left_out;
    comparison.conclude(settings.allow_missing);
    Ok(comparison)
}

/// What the numbers of an image are taken for, and why.
fn taken_for(which: &str, encoding: Encoding) -> String {
    match encoding {
        Encoding::Srgb => format!("the {which} holds integers (as PNG and JPEG do), which are taken for sRGB codes"),
        Encoding::Linear => format!("the {which} holds floats (as OpenEXR does), which are taken for linear light"),
    }
}

/// What of both files was not compared; None where nothing was left out. Alpha of 1
/// everywhere says nothing, and replicates are `tested` elsewhere.
fn left_out(reference: &Found, test: &Found, tested: bool) -> Option<String> {
    const MOST: usize = 8;
    let kept = |name: &&String| !(tested && name.starts_with("replicate-"));
    let [mut ours, mut theirs] = [reference, test].map(|f| f.others.iter().filter(kept).collect::<BTreeSet<_>>());
    // An alpha that says nothing, beside one that does.
    let is_alpha = |name: &&String| name.rsplit('.').next() == Some("A");
    match (reference.alpha, test.alpha) {
        (Alpha::Varied, Alpha::One) => theirs.extend(ours.iter().copied().filter(is_alpha)),
        (Alpha::One, Alpha::Varied) => ours.extend(theirs.iter().copied().filter(is_alpha)),
        _ => {}
    }
    let list = |names: Vec<&&String>, of: &str| {
        let more = names.len().saturating_sub(MOST);
        let shown = names.iter().take(MOST).map(|n| n.as_str()).collect::<Vec<_>>().join(", ");
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        (!names.is_empty()).then(|| format!("{shown}{more} of {of}"))
    };
    let parts = [
        list(ours.intersection(&theirs).collect(), "both"),
        list(ours.difference(&theirs).collect(), "the reference alone"),
        list(theirs.difference(&ours).collect(), "the test image alone"),
    ];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    (!parts.is_empty()).then(|| format!("not compared: {}", parts.join("; ")))
}

/// Alpha is left out. Where one image alone has it, that is a note if it is 1 everywhere
/// and else an error.
fn check_alpha(reference: &Found, test: &Found) -> Result<Option<String>, CompareError> {
    if (reference.alpha == Alpha::None) == (test.alpha == Alpha::None) {
        return Ok(None);
    }
    let channels = |found: &Found| match (found.image.planes().len(), found.alpha) {
        (1, Alpha::None) => "Y",
        (1, _) => "Y, A",
        (_, Alpha::None) => "R, G, B",
        _ => "R, G, B, A",
    };
    let (ours, theirs) = (channels(reference), channels(test));
    if reference.alpha == Alpha::Varied || test.alpha == Alpha::Varied {
        return Err(CompareError::Alpha { reference: ours, test: theirs });
    }
    Ok(Some(format!(
        "the reference has the channels {ours} and the test image {theirs}: alpha is 1 everywhere and left out"
    )))
}

/// The pixels of two images are the same places only where both begin at one.
fn check_origins(reference: [i32; 2], test: [i32; 2]) -> Result<(), CompareError> {
    if reference == test { Ok(()) } else { Err(CompareError::Origins { reference, test }) }
}
