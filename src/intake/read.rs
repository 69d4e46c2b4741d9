//! One file becomes openness at the size of a view.

use super::{Declared, IntakeError, Means, Rows, Share, diagnose::number, upsample::upsample};
use crate::{
    counted::counted,
    disk::DiskError,
    layers::{linear, load},
    metrics::image::Encoding,
    picture::read::{self as picture, Alpha, Found, LayerChoice},
};
use std::path::Path;

/// What the layers of independent images are called, before their number.
const REPLICATE: &str = "replicate-";
/// Channels of a grey image may differ by so much, of a range of 1: two steps of 8-bit codes,
/// as dithering and JPEG leave them.
const GREY: f32 = 2.0 / 255.0;
/// Openness outside 0 to 1 by more than this is worth a warning: rounding leaves less.
const BEYOND: f32 = 1e-3;

/// Openness from one file.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// Values at the size of the view, row by row from its top left; one image, or as many as
    /// the file has layers `replicate-NNNN`, in the order of their numbers.
    pub replicates: Vec<Vec<f32>>,
    /// What the stored numbers were taken for.
    pub encoding: Encoding,
    /// Whether the file stores integers and no encoding was declared: then it was taken for
    /// linear, and [`super::diagnose`] tells whether that was right.
    pub undeclared: bool,
    /// What whoever made the image should know, one sentence each, without the file's name.
    pub warnings: Vec<String>,
}

/// Reads one image as openness at the size of a view, `view` pixels wide and high.
///
/// OpenEXR, PNG of 8 and 16 bits, and whatever else [`crate::picture::read`] reads. The
/// stored numbers become linear (by `encoding`), then openness (by `means`), then rows are
/// turned and the image is brought to the view's size. Pixels that hold no finite number
/// stay so; [`super::diagnose`] tells whether they matter. Nothing is clamped.
///
/// # Errors
/// [`IntakeError::Disk`] where the file cannot be read or has no such layer,
/// [`IntakeError::Size`] where its size is not the declared share of the view, told by the
/// header before pixels are decoded, and [`IntakeError::Color`] where its channels differ by
/// more than two steps of 8-bit codes.
pub fn read(path: &Path, declared: &Declared, view: [u32; 2]) -> Result<Taken, IntakeError> {
    let bytes = load(path)?;
    if let Some(size) = picture::claim(path, &bytes)?.size {
        check_size(path, size, declared.resolution, view)?;
    }
    let is_exr = picture::is_exr(path, &bytes);
    let mut warnings = Vec::new();
    let (found, integers) = if is_exr {
        (layers(path, &bytes, declared, &mut warnings)?, false)
    } else {
        let choice = declared.layer.as_deref().map_or(LayerChoice::Main, LayerChoice::Named);
        // Integers are sRGB codes there unless told otherwise, floats are linear.
        let found = picture::decode(path, &bytes, choice, None)?;
        let integers = found.iter().any(|f| f.image.encoding() == Encoding::Srgb);
        (found, integers)
    };
    drop(bytes);
    let undeclared = integers && declared.encoding.is_none();
    if undeclared {
        warnings.push(
            "no encoding is declared and the file stores integers: taken as linear openness; declare `encoding`, \
             \"linear\" or \"srgb\""
                .to_owned(),
        );
    }
    let encoding = declared.encoding.unwrap_or(Encoding::Linear);
    let mut replicates = Vec::with_capacity(found.len());
    for one in found {
        check_size(path, one.image.size(), declared.resolution, view)?;
        remarks(&one, &mut warnings);
        replicates.push(openness(path, &one, declared, encoding, view, &mut warnings)?);
    }
    warnings.dedup();
    Ok(Taken { replicates, encoding, undeclared, warnings })
}

/// Whether every pixel that sees a surface holds a number; where a surface is seen, `seen` holds
/// one, and where that is empty, everywhere. Errors name `path`.
///
/// # Errors
/// [`IntakeError::Holes`] with their number and the first of them.
pub fn check_numbers(path: &Path, image: &[f32], seen: &[f32], width: usize) -> Result<(), IntakeError> {
    let is_hole = |&(i, v): &(usize, &f32)| !v.is_finite() && seen.get(i).is_none_or(|s| s.is_finite());
    let mut holes = image.iter().enumerate().filter(is_hole);
    let Some((first, _)) = holes.next() else { return Ok(()) };
    let (count, width) = (1 + holes.count(), width.max(1));
    Err(IntakeError::Holes { path: path.to_owned(), count, first: [first % width, first / width] })
}

/// The replicates of an OpenEXR file, or its one image.
fn layers(
    path: &Path,
    bytes: &[u8],
    declared: &Declared,
    warnings: &mut Vec<String>,
) -> Result<Vec<Found>, IntakeError> {
    if let Some(layer) = &declared.layer {
        return Ok(picture::decode(path, bytes, LayerChoice::Named(layer), None)?);
    }
    let number = |name: &str| name.strip_prefix(REPLICATE).and_then(digits);
    if !picture::layer_names(path, bytes)?.iter().any(|name| number(name).is_some()) {
        return Ok(picture::decode(path, bytes, LayerChoice::Main, None)?);
    }
    let all = picture::decode(path, bytes, LayerChoice::All, None)?;
    let mut replicates: Vec<(u64, Found)> =
        all.into_iter().filter_map(|found| Some((number(&found.layer)?, found))).collect();
    replicates.sort_by_key(|(number, _)| *number);
    let numbers: Vec<u64> = replicates.iter().map(|(number, _)| *number).collect();
    if let Some(n) = numbers.windows(2).find(|n| n[0] == n[1]) {
        let why = format!("two layers are the replicate {}", n[0]);
        return Err(DiskError::content(path, why).into());
    }
    if let Some(n) = numbers.windows(2).find(|n| n[1] - n[0] > 1) {
        warnings.push(format!("replicate {} is followed by {}: what lies between is missing", n[0], n[1]));
    }
    Ok(replicates.into_iter().map(|(_, found)| found).collect())
}

/// A number of decimal digits alone, where it fits.
pub(super) fn digits(text: &str) -> Option<u64> {
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok()).flatten()
}

/// What is odd about an image beside its numbers.
pub(super) fn remarks(found: &Found, warnings: &mut Vec<String>) {
    if found.alpha == Alpha::Varied {
        warnings.push("alpha is not 1 everywhere; it is left out".to_owned());
    }
    if found.origin != [0, 0] {
        let [x, y] = found.origin;
        warnings.push(format!("the pixels begin at ({x}, {y}), not at (0, 0): taken as the whole view"));
    }
}

pub(super) fn check_size(path: &Path, found: [usize; 2], share: Share, view: [u32; 2]) -> Result<(), IntakeError> {
    if share.suits(found, view) {
        return Ok(());
    }
    let hint = if let Some(fits) = Share::ALL.into_iter().find(|s| s.suits(found, view)) {
        format!("; it would be accepted with resolution = \"{}\"", fits.label())
    } else if share.suits([found[1], found[0]], view) {
        "; width and height are exchanged: render the camera `measure` without turning it".to_owned()
    } else {
        let accepted = Share::ALL.map(|s| {
            let [width, height] = s.of(view);
            format!("{width} x {height} as \"{}\"", s.label())
        });
        format!("; accepted are {}", accepted.join(", "))
    };
    let expected = share.of(view);
    Err(IntakeError::Size { path: path.to_owned(), found, expected, view, share, hint })
}

fn openness(
    path: &Path,
    found: &Found,
    declared: &Declared,
    encoding: Encoding,
    view: [u32; 2],
    warnings: &mut Vec<String>,
) -> Result<Vec<f32>, IntakeError> {
    let size = found.image.size();
    let mut values = grey(path, found, warnings)?;
    for v in &mut values {
        let light = if encoding == Encoding::Srgb { linear(*v) } else { *v };
        *v = if declared.means == Means::Occlusion { 1.0 - light } else { light };
    }
    if declared.rows == Rows::Bottom {
        values = values.chunks_exact(size[0]).rev().flatten().copied().collect();
    }
    if let Some(why) = beyond(&values, size[0]) {
        warnings.push(why);
    }
    let view = view.map(|side| side as usize);
    Ok(if size == view { values } else { upsample(&values, size, view, declared.upsample) })
}

/// Says where openness leaves its range, by how many pixels and which is the farthest.
fn beyond(values: &[f32], width: usize) -> Option<String> {
    let far = |v: f32| if v < 0.5 { -v } else { v - 1.0 };
    let beyond = || values.iter().enumerate().filter(|(_, v)| v.is_finite() && far(**v) > BEYOND);
    let farthest = beyond().map(|(i, v)| (i, far(*v))).reduce(|a, b| if b.1 > a.1 { b } else { a })?.0;
    let count = beyond().count();
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let [least, most] = [finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max)];
    let [least, most] = [least, most].map(number);
    let [x, y] = [farthest % width.max(1), farthest / width.max(1)];
    Some(format!(
        "openness lies outside 0 to 1 at {}: it is {least} to {most}, farthest at column {x}, row {y}",
        counted(count, "pixel", "pixels")
    ))
}

/// The one plane of an image whose channels are alike.
fn grey(path: &Path, found: &Found, warnings: &mut Vec<String>) -> Result<Vec<f32>, IntakeError> {
    let planes = found.image.planes();
    let [red, green, blue] = planes else { return Ok(planes.first().cloned().unwrap_or_default()) };
    // Channels that differ in being numbers are coloured, those of no number at all are not.
    let spread = |i: usize| {
        let [r, g, b] = [red[i], green[i], blue[i]];
        let alike = r.to_bits() == g.to_bits() && g.to_bits() == b.to_bits() || [r, g, b].iter().all(|v| v.is_nan());
        let spread = r.max(g).max(b) - r.min(g).min(b);
        if alike {
            0.0
        } else if [r, g, b].iter().all(|v| v.is_finite()) {
            spread
        } else {
            f32::INFINITY
        }
    };
    let difference = (0..red.len()).map(spread).fold(0.0, f32::max);
    if difference > GREY {
        let at = (0..red.len()).find(|&i| spread(i) > GREY).unwrap_or(0);
        let width = found.image.size()[0];
        return Err(IntakeError::Color { path: path.to_owned(), difference, first: [at % width, at / width] });
    }
    if difference > 0.0 {
        warnings.push(format!("red, green and blue differ by up to {difference:.4}: their mean is taken"));
        return Ok((0..red.len()).map(|i| (red[i] + green[i] + blue[i]) / 3.0).collect());
    }
    Ok(red.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intake::Upsample;
    use crate::layers::Layers;
    use image::{ImageBuffer, Luma, LumaA, Rgb};
    use std::path::PathBuf;
    use tempfile::TempDir;

    const VIEW: [u32; 2] = [24, 10];

    fn at(x: usize, y: usize) -> f32 {
        (x as f32 + 24.0 * y as f32) / 239.0
    }

    /// Openness whose pixels all differ.
    fn ramp() -> Vec<f32> {
        (0..240).map(|i| at(i % 24, i / 24)).collect()
    }

    struct Files(TempDir);

    impl Files {
        fn new() -> Self {
            Files(tempfile::tempdir().unwrap())
        }

        fn path(&self, name: &str) -> PathBuf {
            self.0.path().join(name)
        }

        fn exr(&self, size: [u32; 2], layers: &[(&str, Vec<f32>)]) -> PathBuf {
            let path = self.path("a.exr");
            let all = layers.iter().fold(Layers::new(size), |l, (name, values)| l.with(name, values.clone()));
            all.write(&path).unwrap();
            path
        }

        fn png8(&self, code: impl Fn(f32) -> f32) -> PathBuf {
            let path = self.path("a.png");
            let pixel = |x: u32, y: u32| Luma([(code(at(x as usize, y as usize)) * 255.0).round() as u8]);
            ImageBuffer::from_fn(24, 10, pixel).save(&path).unwrap();
            path
        }

        fn png16(&self, code: impl Fn(f32) -> f32) -> PathBuf {
            let path = self.path("b.png");
            let pixel = |x: u32, y: u32| Luma([(code(at(x as usize, y as usize)) * 65_535.0).round() as u16]);
            ImageBuffer::from_fn(24, 10, pixel).save(&path).unwrap();
            path
        }
    }

    fn linear_declared() -> Declared {
        Declared { encoding: Some(Encoding::Linear), ..Declared::default() }
    }

    fn farthest(a: &[f32], b: &[f32]) -> f32 {
        assert_eq!(a.len(), b.len());
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    fn error(path: &Path, declared: &Declared) -> String {
        read(path, declared, VIEW).unwrap_err().to_string()
    }

    #[test]
    fn what_we_write_comes_back() {
        let files = Files::new();
        let taken = read(&files.exr(VIEW, &[("mean", ramp()), ("variance", ramp())]), &Declared::default(), VIEW);
        let taken = taken.unwrap();
        assert_eq!(taken.replicates, [ramp()]);
        assert_eq!((taken.undeclared, taken.warnings.len()), (false, 0));
        let taken = read(&files.png16(|v| v), &linear_declared(), VIEW).unwrap();
        assert!(farthest(&taken.replicates[0], &ramp()) < 1e-5);
        assert_eq!(taken.warnings, [""; 0]);
        let taken = read(&files.png8(|v| v), &linear_declared(), VIEW).unwrap();
        let worst = farthest(&taken.replicates[0], &ramp());
        assert!(worst < 2e-3 && worst > 1e-4, "{worst}: rounded to 8 bits");
    }

    #[test]
    fn codes_become_linear_and_undeclared_ones_get_a_warning() {
        let files = Files::new();
        let srgb = |v: f32| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        let path = files.png16(srgb);
        let declared = Declared { encoding: Some(Encoding::Srgb), ..Declared::default() };
        let taken = read(&path, &declared, VIEW).unwrap();
        assert!(farthest(&taken.replicates[0], &ramp()) < 1e-4);
        let taken = read(&path, &Declared::default(), VIEW).unwrap();
        assert_eq!((taken.encoding, taken.undeclared), (Encoding::Linear, true));
        assert!(taken.warnings[0].contains("encoding"), "{:?}", taken.warnings);
        assert!(farthest(&taken.replicates[0], &ramp()) > 0.1, "taken as it is");
        // Codes in floats, where it is declared.
        let path = files.exr(VIEW, &[("ao", ramp().into_iter().map(srgb).collect())]);
        assert!(farthest(&read(&path, &declared, VIEW).unwrap().replicates[0], &ramp()) < 1e-5);
    }

    #[test]
    fn occlusion_and_rows_are_turned() {
        let files = Files::new();
        let path = files.exr(VIEW, &[("ao", ramp())]);
        let declared = Declared { means: Means::Occlusion, rows: Rows::Bottom, ..Declared::default() };
        let taken = read(&path, &declared, VIEW).unwrap();
        let expected: Vec<f32> = (0..240).map(|i| 1.0 - at(i % 24, 9 - i / 24)).collect();
        assert_eq!(taken.replicates, [expected]);
        // Occlusion as sRGB codes is decoded before it is turned.
        let half = vec![0.5; 240];
        let declared = Declared { means: Means::Occlusion, encoding: Some(Encoding::Srgb), ..Declared::default() };
        let taken = read(&files.exr(VIEW, &[("ao", half)]), &declared, VIEW).unwrap();
        assert!((taken.replicates[0][0] - (1.0 - 0.214_041)).abs() < 1e-5);
    }

    #[test]
    fn replicates_are_layers_in_the_order_of_their_numbers() {
        let files = Files::new();
        let flat = |v| vec![v; 240];
        let layers = [
            ("replicate-0010", flat(0.3)),
            ("replicate-0002", flat(0.2)),
            ("mean", flat(0.9)),
            ("replicate-x", flat(0.8)),
        ];
        let taken = read(&files.exr(VIEW, &layers), &Declared::default(), VIEW).unwrap();
        assert_eq!(taken.replicates, [flat(0.2), flat(0.3)]);
        assert!(taken.warnings[0].contains("replicate 2 is followed by 10"), "{:?}", taken.warnings);
        let twice = [("replicate-1", flat(0.3)), ("replicate-01", flat(0.2))];
        assert!(error(&files.exr(VIEW, &twice), &Declared::default()).contains("two layers are the replicate 1"));
        let named = Declared { layer: Some("mean".into()), ..Declared::default() };
        assert_eq!(read(&files.exr(VIEW, &layers), &named, VIEW).unwrap().replicates, [flat(0.9)]);
        let none = Declared { layer: Some("nothing".into()), ..Declared::default() };
        assert!(error(&files.exr(VIEW, &layers), &none).contains("no layer 'nothing'"));
        assert!(error(&files.png8(|v| v), &named).contains("only OpenEXR images have layers"));
    }

    #[test]
    fn smaller_images_are_taken_as_declared() {
        let files = Files::new();
        let small: Vec<f32> = (0..60).map(|i| 0.1 + i as f32 / 100.0).collect();
        let path = files.exr([12, 5], &[("ao", small.clone())]);
        let of = |upsample| Declared { resolution: Share::Half, upsample, ..Declared::default() };
        let nearest = read(&path, &of(Upsample::Nearest), VIEW).unwrap().replicates.remove(0);
        let expected: Vec<f32> = (0..240).map(|i| small[(i / 24 / 2) * 12 + (i % 24) / 2]).collect();
        assert_eq!(nearest, expected);
        let bilinear = read(&path, &of(Upsample::Bilinear), VIEW).unwrap().replicates.remove(0);
        // Column 1 lies a quarter of the way between the first two, row 1 between the first two.
        let expected = 0.1 + 0.25 * 0.01 + 0.25 * 0.12;
        assert!((bilinear[25] - expected).abs() < 1e-6, "{}", bilinear[25]);
        // The bottom row of a small file is the bottom of the view.
        let turned = Declared { rows: Rows::Bottom, ..of(Upsample::Nearest) };
        assert_eq!(read(&path, &turned, VIEW).unwrap().replicates[0][0], small[48]);
    }

    #[test]
    fn a_wrong_size_is_named_with_what_would_do() {
        let files = Files::new();
        let sized = |w: u32, h: u32| files.exr([w, h], &[("ao", vec![0.5; (w * h) as usize])]);
        let full = Declared::default();
        let message = error(&sized(23, 10), &full);
        for part in ["a.exr", "has 23 x 10", "needs 24 x 10", "24 x 10 as \"full\"", "12 x 5 as \"half\"", "6 x 3"] {
            assert!(message.contains(part), "{part}: {message}");
        }
        assert!(error(&sized(12, 5), &full).contains("resolution = \"half\""));
        assert!(error(&sized(6, 2), &full).contains("resolution = \"quarter\""));
        assert!(error(&sized(10, 24), &full).contains("exchanged"));
        let half = Declared { resolution: Share::Half, ..Declared::default() };
        let message = error(&sized(24, 10), &half);
        assert!(message.contains("needs 12 x 5") && message.contains("resolution = \"full\""), "{message}");
    }

    #[test]
    fn grey_in_three_channels_is_grey_and_colours_are_refused() {
        let files = Files::new();
        let of = |shift: f32| {
            let green = ramp().iter().map(|v| v + shift).collect();
            files.exr(VIEW, &[("R", ramp()), ("G", green), ("B", ramp())])
        };
        let taken = read(&of(0.0), &Declared::default(), VIEW).unwrap();
        assert_eq!((taken.replicates, taken.warnings.len()), (vec![ramp()], 0));
        let taken = read(&of(0.006), &Declared::default(), VIEW).unwrap();
        assert!((taken.replicates[0][7] - ramp()[7] - 0.002).abs() < 1e-6);
        assert!(taken.warnings[0].contains("differ by up to 0.0060"), "{:?}", taken.warnings);
        assert!(error(&of(0.1), &Declared::default()).contains("differ by up to 0.1000, first at pixel (0, 0)"));
        let mut green = ramp();
        green[26] = f32::NAN;
        let path = files.exr(VIEW, &[("R", ramp()), ("G", green), ("B", ramp())]);
        assert!(error(&path, &Declared::default()).contains("first at pixel (2, 1)"));
        let path = files.path("c.png");
        ImageBuffer::from_fn(24, 10, |x, _| Rgb([100u8, 100, 100 + u8::from(x == 3) * 9])).save(&path).unwrap();
        assert!(error(&path, &linear_declared()).contains("(3, 0)"));
    }

    #[test]
    fn holes_are_counted_where_a_surface_is_seen() {
        let files = Files::new();
        let mut image = ramp();
        (image[3], image[30], image[31]) = (f32::NAN, f32::INFINITY, f32::NAN);
        let path = files.exr(VIEW, &[("ao", image)]);
        let taken = read(&path, &Declared::default(), VIEW).unwrap();
        assert!(taken.replicates[0][30].is_infinite() && taken.warnings.is_empty(), "{:?}", taken.warnings);
        let mut seen = vec![0.5; 240];
        seen[3] = f32::NAN;
        let check = |seen: &[f32]| check_numbers(&path, &taken.replicates[0], seen, 24).map_err(|e| e.to_string());
        let message = check(&seen).unwrap_err();
        assert!(message.contains("2 pixels") && message.contains("column 6, row 1"), "{message}");
        (seen[30], seen[31]) = (f32::NAN, f32::NAN);
        assert_eq!(check(&seen), Ok(()));
        assert!(check(&[]).unwrap_err().contains("3 pixels"));
    }

    #[test]
    fn odd_images_are_remarked_upon() {
        let files = Files::new();
        let path = files.exr(VIEW, &[("ao", ramp().iter().map(|v| v * 255.0).collect())]);
        let warnings = read(&path, &Declared::default(), VIEW).unwrap().warnings;
        assert!(warnings[0].contains("outside 0 to 1") && warnings[0].contains("255"), "{warnings:?}");
        let path = files.path("d.png");
        ImageBuffer::from_fn(24, 10, |x, _| LumaA([9u8, x as u8])).save(&path).unwrap();
        let warnings = read(&path, &linear_declared(), VIEW).unwrap().warnings;
        assert!(warnings[0].contains("alpha"), "{warnings:?}");
    }

    /// Files that lie about their size, or are no images: an error, whatever is declared.
    #[test]
    fn hostile_files_are_errors() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad-images");
        let mut tried = 0;
        for path in std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
            assert!(read(&path, &Declared::default(), VIEW).is_err(), "{}", path.display());
            tried += 1;
        }
        assert!(tried > 8);
        let files = Files::new();
        let path = files.exr(VIEW, &[("replicate-0001", ramp()), ("replicate-99999999999999999999", ramp())]);
        assert_eq!(read(&path, &Declared::default(), VIEW).unwrap().replicates.len(), 1);
        assert!(error(&files.path("none.exr"), &Declared::default()).contains("none.exr"));
        let whole = std::fs::read(files.png8(|v| v)).unwrap();
        for i in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[i] ^= 0xff;
            std::fs::write(files.path("e.png"), bytes).unwrap();
            let _ = read(&files.path("e.png"), &linear_declared(), VIEW);
        }
    }
}
