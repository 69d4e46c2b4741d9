//! Which encoding images have whose maker did not say.

use super::{
    Declared, IntakeError, Reference,
    diagnose::{distance, is_telling},
    read,
};
use crate::{layers::linear, metrics::image::Encoding};
use std::path::Path;

/// sRGB codes must bring images so much nearer to their references than linear openness does,
/// in mean square: noise is not in it, and where nothing tells the two apart, as in images of
/// one ray, linear is taken.
const NEARER: f64 = 0.8;

/// How far a file's images are from their reference taken as linear and as sRGB codes, mean squares, summed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Evidence {
    linear: f64,
    srgb: f64,
    /// Images that it is of.
    pub images: usize,
}

impl Evidence {
    /// Of both.
    #[must_use]
    pub fn with(self, other: Evidence) -> Evidence {
        Evidence {
            linear: self.linear + other.linear,
            srgb: self.srgb + other.srgb,
            images: self.images + other.images,
        }
    }

    /// What it speaks for; None where there is none.
    pub fn encoding(&self) -> Option<Encoding> {
        let encoding = if self.srgb < NEARER * self.linear { Encoding::Srgb } else { Encoding::Linear };
        (self.images > 0).then_some(encoding)
    }
}

/// What a file of integers without a declared encoding tells of it. None of floats; images that hardly vary, or
/// whose scene does not, have no say.
///
/// # Errors
/// As [`read`].
pub fn evidence(
    path: &Path,
    declared: &Declared,
    view: [u32; 2],
    reference: &Reference,
) -> Result<Option<Evidence>, IntakeError> {
    let taken = read(path, declared, view)?;
    if !taken.undeclared {
        return Ok(None);
    }
    let size = view.map(|side| side as usize);
    let telling = taken.replicates.iter().filter(|i| is_telling(i, reference, size));
    let of = |image: &Vec<f32>| {
        let codes: Vec<f32> = image.iter().map(|v| declared.means.through(*v, linear)).collect();
        let far = |image: &[f32]| distance(image, reference, size).max(0.0);
        Evidence { linear: far(image), srgb: far(&codes), images: 1 }
    };
    Ok(Some(telling.map(of).fold(Evidence::default(), Evidence::with)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        intake::Means,
        render::{Estimator, Geometry, Job, Renderer, cpu::Cpu},
        scenes::library,
    };
    use image::{ImageBuffer, Luma};

    #[test]
    fn the_encoding_is_told_by_the_reference() {
        let scene = library::scene("corner").unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let view = scene.measure.view();
        let render = |rays, seed| {
            let job = Job {
                view: &view,
                camera: None,
                estimator: Estimator::CLASSIC,
                ao: scene.ao,
                rays,
                seed,
                replicate: 0,
            };
            Cpu.load(&geometry).unwrap().render(&job).unwrap().values
        };
        let reference = Reference { openness: render(256, 1), scaled: vec![] };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let [width, height] = view.resolution;
        // White has no say.
        ImageBuffer::from_pixel(width, height, Luma([255u8])).save(&path).unwrap();
        let white = evidence(&path, &Declared::default(), view.resolution, &reference).unwrap().unwrap();
        assert_eq!((white.images, white.encoding()), (0, None));
        for rays in [64, 4] {
            let image = render(rays, 2);
            for occlusion in [false, true] {
                for encoding in [Encoding::Linear, Encoding::Srgb] {
                    let code = |v: f32| {
                        let v = if occlusion { 1.0 - v } else { v };
                        if encoding == Encoding::Srgb { crate::layers::srgb(v) } else { (v * 255.0).round() as u8 }
                    };
                    ImageBuffer::from_fn(width, height, |x, y| Luma([code(image[(y * width + x) as usize])]))
                        .save(&path)
                        .unwrap();
                    let means = if occlusion { Means::Occlusion } else { Means::Openness };
                    let declared = Declared { means, ..Declared::default() };
                    let found = evidence(&path, &declared, view.resolution, &reference).unwrap().unwrap();
                    assert_eq!(found.encoding(), Some(encoding), "{rays} rays, {means:?}");
                    let told = Declared { encoding: Some(encoding), ..declared };
                    let taken = read(&path, &told, view.resolution).unwrap();
                    let off = taken.replicates[0].iter().zip(&image).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(off < 6e-3, "{off}");
                    assert_eq!(evidence(&path, &told, view.resolution, &reference).unwrap(), None);
                }
            }
        }
    }
}
