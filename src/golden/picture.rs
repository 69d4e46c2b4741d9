//! Images that tests hold against goldens: as files, and compared.

use super::{Comparison, Limits, Sampled, Terms, TileMeans, compare, sampled::layer};
use crate::{
    counted::counted,
    disk::DiskError,
    layers::{Layers, load, pixel_hash, write_png},
    metrics::image::{DEFAULT_PPD, Encoding, Image, Pair, flip, signed_map},
    picture::{
        error_map::{Caption, ErrorMap},
        read::{Values, decode_samples, read},
        scale::Scale,
    },
};
use image::RgbImage;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    slice,
};

/// An image that a test made.
#[derive(Clone, Debug)]
pub enum Picture {
    /// 8-bit colours, sRGB. Its golden is a PNG.
    Rgb(RgbImage),
    /// Floats, one plane or three. Its golden is an OpenEXR file.
    Planes(Image),
    /// A sample: independent replicates, kept as mean, variance and means of tiles.
    Sampled(Sampled),
}

/// What may differ from a golden.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// Nothing, to the last bit.
    Exact,
    /// What is hardly seen: limits on FLIP, SSIM and the greatest difference.
    Limits(Limits),
    /// Another sample of the same expectation may come: the chance that it is refused
    /// is `alpha`. Needs an image of two replicates or more, and so little noise that a
    /// bias of [`MUST_SEE`](super::MUST_SEE) in a tile would be seen.
    Sampled {
        /// The false-alarm rate of one assertion, in (0, 1).
        alpha: f64,
    },
}

impl From<RgbImage> for Picture {
    fn from(image: RgbImage) -> Self {
        Picture::Rgb(image)
    }
}

impl From<Image> for Picture {
    fn from(image: Image) -> Self {
        Picture::Planes(image)
    }
}

impl From<Sampled> for Picture {
    fn from(image: Sampled) -> Self {
        Picture::Sampled(image)
    }
}

impl From<Limits> for Tolerance {
    fn from(limits: Limits) -> Self {
        Tolerance::Limits(limits)
    }
}

/// How two images differ, in words; None where they do not.
pub(super) type Difference = Option<String>;

impl Picture {
    fn extension(&self) -> &'static str {
        if matches!(self, Picture::Rgb(_)) { "png" } else { "exr" }
    }

    /// The file of a golden of this kind.
    pub(super) fn path(&self, folder: &Path, name: &str) -> PathBuf {
        folder.join(format!("{name}.{}", self.extension()))
    }

    pub(super) fn write(&self, path: &Path) -> Result<(), DiskError> {
        match self {
            Picture::Rgb(image) => write_png(path, image),
            Picture::Planes(image) => {
                let names: &[&str] = if image.planes().len() == 3 { &["R", "G", "B"] } else { &["Y"] };
                let mut layers = Layers::new(image.size().map(|n| n as u32));
                for (name, plane) in names.iter().zip(image.planes()) {
                    layers = layers.with(name, plane.clone());
                }
                layers.attributes.insert("encoding".into(), image.encoding().label().into());
                layers.write(path)
            }
            Picture::Sampled(s) => {
                let mut layers =
                    Layers::new(s.resolution).with("mean", s.mean.clone()).with("variance", s.variance.clone());
                layers.attributes.insert("replicates".into(), s.replicates.to_string());
                if let Some(tiles) = &s.tiles {
                    layers.attributes.insert("tile-means".into(), tiles.to_json());
                }
                layers.write(path)
            }
        }
    }

    /// Reads a golden of this kind.
    pub(super) fn read_alike(&self, path: &Path) -> Result<Picture, DiskError> {
        match self {
            Picture::Rgb(_) => {
                let samples = decode_samples(path, &load(path)?)?;
                let [width, height] = samples.size.map(|n| n as u32);
                let image = match (samples.channels, samples.values) {
                    (3, Values::U8(bytes)) => RgbImage::from_raw(width, height, bytes),
                    _ => None,
                };
                image.map(Picture::Rgb).ok_or_else(|| DiskError::content(path, "this is no 8-bit RGB image"))
            }
            Picture::Planes(image) => Ok(Picture::Planes(read(path, None, Some(image.encoding()))?.image)),
            Picture::Sampled(_) => {
                let layers = Layers::read(path)?;
                let replicates = layers.attributes.get("replicates").and_then(|t| t.parse().ok());
                let tiles = layers.attributes.get("tile-means");
                let of = |n: u32| TileMeans::from_json(layers.resolution, n, tiles?);
                let (Some(replicates), Some(tiles)) = (replicates, replicates.and_then(of)) else {
                    return Err(DiskError::content(path, "this is no golden of a sampled image"));
                };
                Ok(Picture::Sampled(Sampled {
                    resolution: layers.resolution,
                    mean: layer(&layers, path, "mean")?,
                    variance: layer(&layers, path, "variance")?,
                    tiles: Some(tiles),
                    replicates,
                    rays: 0,
                    seed: None,
                }))
            }
        }
    }

    /// As floats, for what looks at differences.
    fn as_image(&self) -> Result<Image, String> {
        let (size, planes, encoding) = match self {
            Picture::Planes(image) => return Ok(image.clone()),
            Picture::Rgb(image) => {
                let plane = |c: usize| image.pixels().map(|p| f32::from(p.0[c]) / 255.0).collect();
                let size = [image.width() as usize, image.height() as usize];
                (size, vec![plane(0), plane(1), plane(2)], Encoding::Srgb)
            }
            Picture::Sampled(s) => (s.resolution.map(|n| n as usize), vec![s.mean.clone()], Encoding::Linear),
        };
        Image::new(size, planes, encoding).map_err(|e| e.to_string())
    }

    fn is_identical(&self, other: &Picture) -> bool {
        let same = |a: &[f32], b: &[f32]| pixel_hash(a) == pixel_hash(b);
        match (self, other) {
            (Picture::Rgb(a), Picture::Rgb(b)) => a == b,
            (Picture::Planes(a), Picture::Planes(b)) => {
                a.size() == b.size()
                    && a.planes().len() == b.planes().len()
                    && a.planes().iter().zip(b.planes()).all(|(a, b)| same(a, b))
            }
            (Picture::Sampled(a), Picture::Sampled(b)) => {
                a.resolution == b.resolution && same(&a.mean, &b.mean) && same(&a.variance, &b.variance)
            }
            _ => false,
        }
    }

    /// Holds an image against its golden.
    ///
    /// # Errors
    /// A sentence, where the two cannot be compared in this way.
    pub(super) fn differs(&self, golden: &Picture, tolerance: &Tolerance) -> Result<Difference, String> {
        if self.is_identical(golden) {
            return Ok(None);
        }
        match tolerance {
            Tolerance::Exact => self.exactly(golden).map(Some),
            Tolerance::Limits(limits) => {
                let (a, b) = (golden.as_image()?, self.as_image()?);
                let pair = Pair::new(&a, &b, None).map_err(|e| e.to_string())?;
                let measured = limits.measure(&pair).map_err(|e| e.to_string())?;
                let beyond: Vec<String> = measured.iter().filter(|m| !m.holds()).map(ToString::to_string).collect();
                Ok((!beyond.is_empty()).then(|| beyond.join("; ")))
            }
            Tolerance::Sampled { alpha } => match (golden, self) {
                (Picture::Sampled(a), Picture::Sampled(b)) if a.replicates >= 2 && b.replicates >= 2 => {
                    if !(*alpha > 0.0 && *alpha < 1.0) {
                        return Err(format!("alpha is {alpha}: it must lie between 0 and 1"));
                    }
                    if a.resolution != b.resolution {
                        return Err(format!("the golden is {:?} pixels, the image {:?}", a.resolution, b.resolution));
                    }
                    let terms =
                        Terms { alpha: *alpha, family: 1, limits: Limits::default(), regions: &BTreeMap::new() };
                    let found: Comparison = compare(a, b, &terms);
                    if found.is_blind() {
                        return Ok(Some(format!("{}; take more rays or replicates", found.line())));
                    }
                    Ok((!found.passes()).then(|| found.line()))
                }
                _ => Err("a sampled tolerance needs an image of two replicates or more".into()),
            },
        }
    }

    fn exactly(&self, golden: &Picture) -> Result<String, String> {
        let (a, b) = (golden.as_image()?, self.as_image()?);
        if a.size() != b.size() || a.planes().len() != b.planes().len() {
            return Err(format!(
                "the golden has {} x {} pixels of {}, the image {} x {} of {}",
                a.size()[0],
                a.size()[1],
                counted(a.planes().len(), "channel", "channels"),
                b.size()[0],
                b.size()[1],
                counted(b.planes().len(), "channel", "channels")
            ));
        }
        let told = |(pixels, first): (usize, usize)| {
            let [x, y] = [first % a.size()[0], first / a.size()[0]];
            format!("{pixels} of {} pixels differ, the first at {x},{y}", a.pixels())
        };
        let same = "the means are the same";
        match (differing(a.planes(), b.planes()), golden, self) {
            (Some(found), ..) => Ok(told(found)),
            (None, Picture::Sampled(a), Picture::Sampled(b)) => {
                let of_variance = differing(slice::from_ref(&a.variance), slice::from_ref(&b.variance));
                Ok(of_variance.map_or(same.to_owned(), |found| format!("{same}, the variances of {}", told(found))))
            }
            (None, ..) => Ok("the pixels are the same, the kinds of image differ".to_owned()),
        }
    }

    /// A picture of where an image differs from its golden: FLIP of colours, signed
    /// difference of floats.
    pub(super) fn difference(&self, golden: &Picture) -> Result<RgbImage, String> {
        let (a, b) = (golden.as_image()?, self.as_image()?);
        let pair = Pair::new(&a, &b, None).map_err(|e| e.to_string())?;
        let size = a.size().map(|n| n as u32);
        let (title, values, scale) = if matches!(self, Picture::Rgb(_)) {
            ("FLIP", flip(&pair, DEFAULT_PPD).map_err(|e| e.to_string())?, Scale::flip())
        } else {
            let map = signed_map(&pair);
            let most = map.iter().filter(|v| v.is_finite()).fold(0.0f32, |m, v| m.max(v.abs()));
            let limit = if most > 0.0 { f64::from(most) } else { 1.0 };
            ("test - golden", map, Scale::signed(limit).map_err(|e| e.to_string())?)
        };
        let map = ErrorMap::new(size, values, scale).map_err(|e| e.to_string())?;
        Ok(map.picture(&Caption { title, unit: "" }))
    }

    /// Writes an image that people can look at beside one that is none.
    pub(super) fn write_preview(&self, path: &Path) -> Result<(), DiskError> {
        let Ok(image) = self.as_image() else { return Ok(()) };
        let [width, height] = image.size().map(|n| n as u32);
        let code = |v: f32| match image.encoding() {
            Encoding::Linear => crate::layers::srgb(v),
            Encoding::Srgb => (v.clamp(0.0, 1.0) * 255.0).round() as u8,
        };
        let picture = RgbImage::from_fn(width, height, |x, y| {
            let i = (y * width + x) as usize;
            let planes = image.planes();
            image::Rgb(std::array::from_fn(|c| code(planes[c.min(planes.len() - 1)][i])))
        });
        write_png(path, &picture)
    }
}

/// How many pixels of two images of one size differ in a bit of any plane, and the first
/// of them; None where none does.
fn differing(a: &[Vec<f32>], b: &[Vec<f32>]) -> Option<(usize, usize)> {
    let differs = |i: &usize| a.iter().zip(b).any(|(a, b)| a[*i].to_bits() != b[*i].to_bits());
    let mut pixels = (0..a.first()?.len()).filter(differs);
    let first = pixels.next()?;
    Some((1 + pixels.count(), first))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_differs_of_a_sample_is_said() {
        let sample = |a: f32, b: f32| Picture::from(Sampled::of_replicates([2, 1], &[&[0.5, a], &[0.5, b]]));
        let golden = sample(0.25, 0.75);
        let said = |image: &Picture| image.differs(&golden, &Tolerance::Exact).unwrap();
        assert_eq!(said(&golden), None);
        assert_eq!(said(&sample(0.25, 0.5)).unwrap(), "1 of 2 pixels differ, the first at 1,0");
        let variance = said(&sample(0.0, 1.0)).unwrap();
        assert_eq!(variance, "the means are the same, the variances of 1 of 2 pixels differ, the first at 1,0");
    }
}
