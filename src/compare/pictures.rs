//! What a comparison draws: a picture and a layer for each map, and one picture for
//! people with reference, test image and map.

use super::{ALPHA, CompareError, Difference};
use crate::{
    layers::{srgb, write_png},
    metrics::image::{Encoding, Image, Maps},
    picture::{
        error_map::{self, Caption, ErrorMap},
        scale::Scale,
        side_by_side,
    },
};
use image::{Rgb, RgbImage};
use std::path::Path;

/// What can be drawn of two images that were compared.
#[derive(Clone, Copy)]
pub struct Drawn<'a> {
    /// Both, pixel by pixel.
    pub difference: Difference<'a>,
    /// Both with the maps of their difference; None of the pixel-exact metric alone.
    pub measured: Option<Measured<'a>>,
}

/// Two images as they were compared, and the maps of their difference.
#[derive(Clone, Copy)]
pub struct Measured<'a> {
    /// What is compared with.
    pub reference: &'a Image,
    /// What is compared.
    pub test: &'a Image,
    /// The maps.
    pub maps: &'a Maps,
    /// Makes the p-values of Welch's test of each pixel, where there are replicates: a
    /// tail of Student's t a pixel, for those who draw them.
    pub p: Option<&'a dyn Fn() -> Vec<f64>>,
}

/// All files that [`write_maps`] may write.
pub(super) const FILES: [&str; 8] = [
    "absolute.png",
    "signed.png",
    "ssim.png",
    "flip.png",
    "hdr-flip.png",
    "p-value.png",
    "maps.exr",
    "side-by-side.png",
];

fn size(image: &Image) -> [u32; 2] {
    image.size().map(|n| n as u32)
}

/// Writes a picture a map, all maps as layers of `maps.exr`, and
/// `side-by-side.png`. `scale` is where the scales of the absolute and the signed map
/// end.
///
/// # Errors
/// Where the scale is none or a file cannot be written.
pub fn write_maps(folder: &Path, drawn: &Measured<'_>, scale: f64) -> Result<(), CompareError> {
    let size = size(drawn.reference);
    let maps = drawn.maps;
    let mut all = Vec::new();
    for (name, title, values, scale) in [
        ("absolute", "|test - reference|", &maps.absolute, Scale::absolute(scale)),
        ("signed", "test - reference", &maps.signed, Scale::signed(scale)),
        ("ssim", "ssim", &maps.ssim, Scale::similarity(0.0)),
        ("flip", "flip", &maps.flip, Ok(Scale::flip())),
        ("hdr-flip", "hdr-flip", &maps.hdr_flip, Ok(Scale::flip())),
    ] {
        if !values.is_empty() {
            all.push((name, title, ErrorMap::new(size, values.clone(), scale?)?));
        }
    }
    if let Some(p) = drawn.p {
        all.push(("p-value", "Welch's test of each pixel alone, p", ErrorMap::p_values(size, &p(), ALPHA)?));
    }
    for (name, title, map) in &all {
        write_png(&folder.join(format!("{name}.png")), &map.picture(&Caption { title, unit: "" }))?;
    }
    error_map::layers(all.iter().map(|(name, _, map)| (*name, map)))?.write(&folder.join("maps.exr"))?;
    Ok(write_png(&folder.join("side-by-side.png"), &side_by_side(drawn)?)?)
}

/// Reference, test image and FLIP map in one picture, small images magnified. HDR-FLIP
/// where it was computed.
///
/// # Errors
/// Where the map does not fit the images.
pub fn side_by_side(drawn: &Measured<'_>) -> Result<RgbImage, CompareError> {
    let hdr = !drawn.maps.hdr_flip.is_empty();
    let (title, values) = if hdr { ("HDR-FLIP", &drawn.maps.hdr_flip) } else { ("FLIP", &drawn.maps.flip) };
    let map = ErrorMap::new(size(drawn.reference), values.clone(), Scale::flip())?;
    Ok(side_by_side::side_by_side([("reference", &seen(drawn.reference)), ("test", &seen(drawn.test))], title, &map))
}

/// An image as a screen shows it: linear light above 1 is white, NaN black.
fn seen(image: &Image) -> RgbImage {
    let planes = image.planes();
    let code = |v: f32| match image.encoding() {
        Encoding::Linear => srgb(v),
        Encoding::Srgb => (v.clamp(0.0, 1.0) * 255.0).round() as u8,
    };
    let [width, height] = size(image);
    RgbImage::from_fn(width, height, |x, y| {
        let i = y as usize * width as usize + x as usize;
        Rgb([0, 1, 2].map(|c| code(planes[c.min(planes.len() - 1)][i])))
    })
}
