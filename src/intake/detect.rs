//! Which encoding an image has whose maker did not say.

use super::{
    Declared, IntakeError, Reference, Taken,
    diagnose::{distance, faults_aside},
    read,
};
use crate::metrics::image::Encoding;
use std::path::Path;

/// sRGB codes must bring an image so much nearer to its reference than linear openness does,
/// in mean square: noise is not in it, and where nothing tells the two apart, as in images of
/// one ray, linear is taken.
const NEARER: f64 = 0.8;

/// [`read`], and where integers are stored without a declared encoding, the one of `linear` and
/// `srgb` that brings the first image nearer to the reference; a warning says which.
///
/// # Errors
/// As [`read`].
pub fn read_against(
    path: &Path,
    declared: &Declared,
    view: [u32; 2],
    reference: &Reference,
) -> Result<Taken, IntakeError> {
    let taken = read(path, declared, view)?;
    let size = view.map(|side| side as usize);
    let comparable = taken.replicates.first().is_some_and(|i| faults_aside(i, reference, size));
    if !taken.undeclared || !comparable {
        return Ok(taken);
    }
    let of = |encoding| {
        let taken = read(path, &Declared { encoding: Some(encoding), ..declared.clone() }, view)?;
        let far = taken.replicates.first().map_or(f64::INFINITY, |image| distance(image, reference, size));
        Ok::<_, IntakeError>((taken, far))
    };
    let (linear, srgb) = (of(Encoding::Linear)?, of(Encoding::Srgb)?);
    let mut taken = if srgb.1 < NEARER * linear.1 { srgb.0 } else { linear.0 };
    taken.undeclared = true;
    taken.warnings.push(format!(
        "no encoding is declared and the file stores integers: taken as \"{}\", which is nearer to the reference; \
         declare `encoding`",
        taken.encoding.label()
    ));
    Ok(taken)
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
                    let taken = read_against(&path, &declared, view.resolution, &reference).unwrap();
                    assert_eq!((taken.encoding, taken.undeclared), (encoding, true), "{rays} rays, {means:?}");
                    assert!(taken.warnings.last().unwrap().contains(encoding.label()), "{:?}", taken.warnings);
                    let off = taken.replicates[0].iter().zip(&image).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    assert!(off < 6e-3, "{off}");
                    let told = Declared { encoding: Some(encoding), ..declared };
                    assert!(!read_against(&path, &told, view.resolution, &reference).unwrap().undeclared);
                }
            }
        }
    }
}
