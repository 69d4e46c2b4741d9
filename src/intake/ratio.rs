//! Openness from whole frames: the picture with AO over the picture without it.

use super::{
    Declared, IntakeError, Rows, Share,
    read::{check_size, remarks},
    upsample::upsample,
};
use crate::{
    counted::counted,
    layers::{linear, load},
    metrics::image::Encoding,
    picture::read::{self as picture, LayerChoice, Samples, Values},
    scenes::luminance,
};
use std::path::Path;

/// What can be known of a frame with AO of which there is none without.
pub const LONE_FRAME: &str = "A whole frame holds light, colours and AO in one. Where the receiver has one colour, the \
     contrast of its light across the occluder is known, shadows and bounced light included. Openness, bias, and how much \
     of the contrast comes from AO cannot be known: for these, hand in the AO buffer, or the frame with and without AO.";

/// Openness is not taken from a pixel whose rounding may have moved it by more than this.
const MOST_ROUNDING: f32 = 0.02;
/// Darker than this, linear light of range 1, nothing is divided.
const FLOOR: f32 = 1e-4;

/// So many floats that are exactly 1 are no chance.
const PLATEAU: usize = 8;

/// A whole frame as linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Luminance (Rec. 709 weights) a pixel of the view, row by row from its top left; NaN
    /// where a channel is no finite number.
    pub light: Vec<f32>,
    /// By how much rounding to integers may have moved the luminance of each pixel: half a
    /// code in linear light. Infinite where a channel has the highest code, or is cut off at 1 in a
    /// frame of floats; else 0 of floats.
    pub rounding: Vec<f32>,
    /// What the stored numbers were taken for.
    pub encoding: Encoding,
    /// What whoever made the frame should know.
    pub warnings: Vec<String>,
}

/// Openness by ratio.
#[derive(Clone, Debug, PartialEq)]
pub struct Ratio {
    /// With over without, a value a pixel; NaN where it is not known.
    pub openness: Vec<f32>,
    /// Pixels that are not known though both frames hold numbers: too dark without AO, or
    /// rounded too roughly, or cut off at white.
    pub masked: usize,
    /// By how much rounding may have moved openness at most, over the pixels that are known.
    pub rounding: f32,
    /// Pixels that are known and brighter with AO than without, by more than rounding and 0.001.
    pub brighter: usize,
    /// Those that are darker, likewise.
    pub darker: usize,
}

/// From this share of the known pixels on, and so many times as many as are darker, pixels that are
/// brighter with AO than without mean that the frames are exchanged. Noise leaves as many darker ones.
const EXCHANGED: f64 = 0.05;
const EXCHANGED_TIMES: usize = 10;

impl Ratio {
    /// Refuses frames that are exchanged.
    ///
    /// # Errors
    /// [`IntakeError::Exchanged`].
    pub fn check_order(&self, with: &Path, without: &Path) -> Result<(), IntakeError> {
        let Ratio { brighter, darker, .. } = *self;
        let known = self.openness.iter().filter(|v| v.is_finite()).count();
        if (brighter as f64) < EXCHANGED * known as f64 || brighter < EXCHANGED_TIMES * darker {
            return Ok(());
        }
        Err(IntakeError::Exchanged { with: with.to_owned(), without: without.to_owned(), brighter, known })
    }

    /// What whoever made the frames should know, one sentence each.
    pub fn remarks(&self) -> Vec<String> {
        let masked = (self.masked > 0).then(|| {
            let are = counted(self.masked, "pixel is", "pixels are");
            format!("{are} too dark, too roughly rounded or cut off at white: left out")
        });
        let brighter = (self.brighter > 0)
            .then(|| format!("{} brighter with AO than without it", counted(self.brighter, "pixel is", "pixels are")));
        masked.into_iter().chain(brighter).collect()
    }
}

/// Reads a whole frame as linear light at the size of a view.
///
/// Of `declared` encoding, rows, resolution, upsampling and layer count; where no encoding is
/// declared, integers are sRGB codes, as frames are, and floats are linear. A tone curve is
/// not undone: save frames without one.
///
/// # Errors
/// As [`super::read`], colours are allowed.
pub fn frame(path: &Path, declared: &Declared, view: [u32; 2]) -> Result<Frame, IntakeError> {
    let bytes = load(path)?;
    if let Some(size) = picture::claim(path, &bytes)?.size {
        check_size(path, size, declared.resolution, view)?;
    }
    let mut warnings = Vec::new();
    let (size, planes, step) = if picture::is_exr(path, &bytes) {
        let choice = declared.layer.as_deref().map_or(LayerChoice::Main, LayerChoice::Named);
        let found = picture::decode(path, &bytes, choice, None)?.into_iter().next();
        let found = found.ok_or_else(|| IntakeError::Ratio(format!("{} has no layer", path.display())))?;
        remarks(&found, &mut warnings);
        (found.image.size(), found.image.planes().to_vec(), 0.0)
    } else {
        integers(&picture::decode_samples(path, &bytes)?)
    };
    drop(bytes);
    check_size(path, size, declared.resolution, view)?;
    let encoding = declared.encoding.unwrap_or(if step > 0.0 { Encoding::Srgb } else { Encoding::Linear });
    if declared.encoding.is_none() && step > 0.0 {
        warnings.push("no encoding is declared and the file stores integers: taken as sRGB codes".to_owned());
    }
    let [light, rounding] = lights(&planes, step, encoding);
    let at_view = |values: Vec<f32>| arranged(values, size, declared, view);
    Ok(Frame { light: at_view(light), rounding: at_view(rounding), encoding, warnings })
}

/// Size, planes of a range of 1, and the step between two codes; 0 of floats.
fn integers(samples: &Samples) -> ([usize; 2], Vec<Vec<f32>>, f32) {
    let (n, colors) = (samples.channels.max(1), if samples.channels < 3 { 1 } else { 3 });
    fn planes<T: Copy>(values: &[T], n: usize, colors: usize, float: impl Fn(T) -> f32) -> Vec<Vec<f32>> {
        (0..colors).map(|c| values.chunks_exact(n).map(|pixel| float(pixel[c])).collect()).collect()
    }
    let (planes, step) = match &samples.values {
        Values::U8(v) => (planes(v, n, colors, |code| f32::from(code) / 255.0), 1.0 / 255.0),
        Values::U16(v) => (planes(v, n, colors, |code| f32::from(code) / 65_535.0), 1.0 / 65_535.0),
        Values::F32(v) => (planes(v, n, colors, |value| value), 0.0),
    };
    (samples.size, planes, step)
}

/// Whether floats were cut off at white: 1 is the greatest of them, to the last bit, of many, and not of all.
fn is_clipped(planes: &[Vec<f32>]) -> bool {
    let all = || planes.iter().flatten().filter(|v| v.is_finite());
    let (white, below) = (all().filter(|v| **v == 1.0).count(), all().filter(|v| **v < 1.0).count());
    white >= PLATEAU && below > 0 && !all().any(|v| *v > 1.0)
}

/// Luminance a pixel, and by how much half a step of each channel moves it.
fn lights(planes: &[Vec<f32>], step: f32, encoding: Encoding) -> [Vec<f32>; 2] {
    let decode = |code: f32| if encoding == Encoding::Srgb { linear(code) } else { code };
    let of_pixel = |f: &dyn Fn(f32) -> f32, i: usize| match planes {
        [red, green, blue] => luminance([f(red[i]), f(green[i]), f(blue[i])]),
        _ => planes.first().map_or(f32::NAN, |grey| f(grey[i])),
    };
    let is_clipped = step == 0.0 && is_clipped(planes);
    let rounded = |code: f32| match code {
        code if code >= 1.0 && (step > 0.0 || is_clipped) => f32::INFINITY,
        _ if step == 0.0 => 0.0,
        code => (decode(code + step / 2.0) - decode((code - step / 2.0).max(0.0))) / 2.0,
    };
    let pixels = planes.first().map_or(0, Vec::len);
    let finite = |v: f32| if v.is_finite() { v } else { f32::NAN };
    [(0..pixels).map(|i| finite(of_pixel(&decode, i))).collect(), (0..pixels).map(|i| of_pixel(&rounded, i)).collect()]
}

/// Rows from the top, at the size of the view.
fn arranged(mut values: Vec<f32>, size: [usize; 2], declared: &Declared, view: [u32; 2]) -> Vec<f32> {
    if declared.rows == Rows::Bottom {
        values = values.chunks_exact(size[0].max(1)).rev().flatten().copied().collect();
    }
    let view = view.map(|side| side as usize);
    if declared.resolution == Share::Full { values } else { upsample(&values, size, view, declared.upsample) }
}

/// Openness from the same frame with AO and without it: their ratio, where all of the light
/// that reaches the surface is dimmed by AO, as ambient light is. Light that it does not dim,
/// of a lamp or of emission, brings the ratio nearer to 1.
///
/// A pixel is not known where the frame without AO is darker than 1e-4, where half a code of
/// both frames may have moved the ratio by more than 0.02 (8-bit sRGB codes below about 106,
/// 8-bit linear ones below about 50, at a ratio of 1), or where a channel is at the highest code, or
/// at 1 in a frame of floats without AO whose greatest value that is, of some pixels and not of all.
///
/// # Errors
/// [`IntakeError::Ratio`] where the frames differ in size, or no pixel is known.
pub fn ratio(with: &Frame, without: &Frame) -> Result<Ratio, IntakeError> {
    let pixels = with.light.len();
    if [&with.rounding, &without.light, &without.rounding].iter().any(|v| v.len() != pixels) {
        let why = format!("they have {pixels} and {} pixels", without.light.len());
        return Err(IntakeError::Ratio(why));
    }
    let mut found = Ratio { openness: Vec::with_capacity(pixels), masked: 0, rounding: 0.0, brighter: 0, darker: 0 };
    for i in 0..pixels {
        let (a, b) = (with.light[i], without.light[i]);
        let value = a / b;
        // With AO there is no more light: floats that reach white where those without AO were not cut off are open.
        let is_open = without.rounding[i] == 0.0 && with.rounding[i].is_infinite();
        let own = if is_open { 0.0 } else { with.rounding[i] };
        let rounding = (own + value.abs() * without.rounding[i]) / b;
        let both = a.is_finite() && b.is_finite();
        // NaN is not known either.
        let known = both && b >= FLOOR && rounding <= MOST_ROUNDING;
        found.masked += usize::from(both && !known);
        found.openness.push(if known { value } else { f32::NAN });
        if known {
            found.rounding = found.rounding.max(rounding);
            found.brighter += usize::from(value > 1.0 + rounding + 1e-3);
            found.darker += usize::from(value < 1.0 - rounding - 1e-3);
        }
    }
    if found.openness.iter().all(|v| v.is_nan()) {
        let why = format!("no pixel is known: {} are too dark, too roughly rounded or white", found.masked);
        return Err(IntakeError::Ratio(why));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layers::{Layers, srgb};
    use image::{ImageBuffer, Luma, Rgb};

    const VIEW: [u32; 2] = [32, 8];

    fn truth(i: usize) -> f32 {
        0.3 + 0.7 * (i % 32) as f32 / 31.0
    }

    /// Light of a shaded, coloured surface.
    fn albedo(i: usize) -> [f32; 3] {
        let shade = 0.35 + 0.5 * (i / 32) as f32 / 7.0;
        [shade, shade * 0.9, shade * 0.7]
    }

    fn floats(path: &Path, with: bool) -> Frame {
        let plane = |c: usize| (0..256).map(|i| albedo(i)[c] * if with { truth(i) } else { 1.0 }).collect::<Vec<f32>>();
        Layers::new(VIEW).with("R", plane(0)).with("G", plane(1)).with("B", plane(2)).write(path).unwrap();
        frame(path, &Declared::default(), VIEW).unwrap()
    }

    #[test]
    fn the_ratio_is_the_openness_that_frames_were_dimmed_by() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let found = ratio(&floats(&path, true), &floats(&path, false)).unwrap();
        assert!((0..256).all(|i| (found.openness[i] - truth(i)).abs() < 1e-6));
        let of = |name: &str| folder.path().join(name);
        assert!(found.check_order(&of("a.with.exr"), &of("a.without.exr")).is_ok());
        let exchanged = ratio(&floats(&path, false), &floats(&path, true)).unwrap();
        let message = exchanged.check_order(&of("a.with.exr"), &of("a.without.exr")).unwrap_err().to_string();
        assert!(message.contains("a.with.exr and ") && message.contains("are exchanged: 248 of 256"), "{message}");
        assert_eq!((found.masked, found.rounding, found.brighter), (0, 0.0, 0));
    }

    #[test]
    fn codes_of_8_bits_stay_within_their_stated_rounding() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let codes = |with: bool| {
            let color = |i: usize| Rgb(albedo(i).map(|v| srgb(v * if with { truth(i) } else { 1.0 })));
            ImageBuffer::from_fn(32, 8, |x, y| color((y * 32 + x) as usize)).save(&path).unwrap();
            frame(&path, &Declared::default(), VIEW).unwrap()
        };
        let (with, without) = (codes(true), codes(false));
        assert!(with.warnings[0].contains("sRGB"), "{:?}", with.warnings);
        let found = ratio(&with, &without).unwrap();
        let worst = (0..256).map(|i| (found.openness[i] - truth(i)).abs()).fold(0.0, f32::max);
        assert!(
            found.masked == 0 && worst > 1e-4 && worst <= found.rounding && found.rounding < 0.02,
            "{worst}: {found:?}"
        );
    }

    #[test]
    fn dark_white_and_empty_pixels_are_masked() {
        let frame = |light: [f32; 5], rounding: f32| Frame {
            light: light.to_vec(),
            rounding: light.map(|v| if v == 1.0 { f32::INFINITY } else { rounding }).to_vec(),
            encoding: Encoding::Linear,
            warnings: vec![],
        };
        let with = frame([0.25, 0.01, 0.5, f32::NAN, 0.0], 0.001);
        let without = frame([0.5, 0.02, 1.0, 0.5, 0.0], 0.001);
        let found = ratio(&with, &without).unwrap();
        let known: Vec<bool> = found.openness.iter().map(|v| v.is_finite()).collect();
        assert_eq!((known, found.masked), (vec![true, false, false, false, false], 3));
        assert!((found.rounding - 0.003).abs() < 1e-6);
        let swapped = ratio(&without, &with).unwrap();
        assert_eq!((swapped.openness[0], swapped.brighter), (2.0, 1));
        let black = frame([0.0; 5], 0.0);
        assert!(ratio(&black, &black).unwrap_err().to_string().contains("no pixel is known"));
        let short = Frame { light: vec![1.0; 4], ..black.clone() };
        assert!(ratio(&black, &short).unwrap_err().to_string().contains("5 and 4 pixels"));
    }

    #[test]
    fn floats_cut_off_at_white_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let of = |most: f32| {
            let light = (0..256).map(|i| (0.5 + i as f32 / 200.0).min(most)).collect::<Vec<f32>>();
            Layers::new(VIEW).with("Y", light).write(&path).unwrap();
            let without = frame(&path, &Declared::default(), VIEW).unwrap();
            let with = Frame { light: vec![0.4; 256], rounding: vec![0.0; 256], ..without.clone() };
            ratio(&with, &without).unwrap().masked
        };
        assert_eq!([of(1.0), of(2.0), of(0.9)], [156, 0, 0]);
        // A white surface in light of 1: the open pixels of the frame with AO are 1, and not cut off.
        Layers::new(VIEW)
            .with("Y", (0..256).map(|i| (0.5 + i as f32 / 200.0).min(1.0)).collect())
            .write(&path)
            .unwrap();
        let with = frame(&path, &Declared::default(), VIEW).unwrap();
        let white = Frame { light: vec![1.0; 256], rounding: vec![0.0; 256], ..with.clone() };
        assert_eq!(ratio(&with, &white).unwrap().masked, 0);
    }

    #[test]
    fn frames_follow_what_is_declared() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        ImageBuffer::from_fn(16, 4, |_, y| Luma([y as u8 * 60])).save(&path).unwrap();
        let declared = Declared {
            encoding: Some(Encoding::Linear),
            rows: Rows::Bottom,
            resolution: Share::Half,
            ..Declared::default()
        };
        let found = frame(&path, &declared, VIEW).unwrap();
        let column: Vec<f32> = (0..8).map(|y| found.light[y * 32] * 255.0 / 60.0).collect();
        let expected = [3.0, 3.0, 2.0, 2.0, 1.0, 1.0, 0.0, 0.0f32];
        assert!(column.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{column:?}");
        assert!((found.rounding[0] - 0.5 / 255.0).abs() < 1e-6);
        assert!(frame(&path, &Declared::default(), VIEW).unwrap_err().to_string().contains("\"half\""));
    }
}
