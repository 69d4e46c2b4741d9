//! A picture of a scene: light on its surfaces, path-traced, in their colours.

use crate::{
    disk::DiskError,
    layers::{srgb, write_png},
    render::{Geometry, RenderError, gbuffer::GBuffer, gbuffer::Surface, materials::Materials, path},
    scenes::{Scene, luminance},
};
use glam::Vec3;
use image::{Rgb, RgbImage};
use std::path::Path;

/// Why a preview could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PreviewError {
    /// The picture could not be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The scene cannot be traced.
    #[error("scene '{scene}': {source}")]
    Render {
        /// The scene.
        scene: String,
        /// Why.
        source: RenderError,
    },
}

/// Points across a pixel, each way.
const FINE: u32 = 2;
/// Display value that the mean of what is seen is exposed to (of its logarithm,
/// so that a window does not leave its room in the dark).
const KEY: f32 = 0.45;
/// The least level that is shown as white, so that what is all of one brightness
/// is not.
const WHITE: f32 = 0.9;
/// The sky as it is shown, at the top and at the bottom of the picture, linear.
const SKY: [Vec3; 2] = [Vec3::new(0.36, 0.52, 0.74), Vec3::new(0.80, 0.86, 0.92)];

/// Writes a PNG of the scene's look view, with `rays` paths a pixel (rounded to
/// a multiple of four, four at least). All surfaces are shown diffuse.
///
/// # Errors
/// Where the scene is too large for its R, or the picture cannot be written.
pub fn write(scene: &Scene, rays: u32, path: &Path) -> Result<(), PreviewError> {
    let geometry = Geometry::new(scene).map_err(|source| PreviewError::Render { scene: scene.name.clone(), source })?;
    let view = scene.look.view().finer(FINE);
    let gbuffer = GBuffer::new(&geometry.tracer, &view);
    let light = path::colors(&geometry, &gbuffer, (rays / (FINE * FINE)).max(1), 1, 0);
    let levels: Vec<f32> = light.iter().map(|&c| luminance(c)).collect();
    let held = without_sparks(&levels, view.resolution);
    let light = light.into_iter().zip(levels.iter().zip(held)).map(|(color, (&level, held))| {
        if level > held { Vec3::from_array(color) * (held / level) } else { Vec3::from_array(color) }
    });
    let materials = Materials::new(scene);
    let color = |surface: &Surface, light: Vec3| {
        let here = materials.at(surface);
        here.base_color * light + here.emission
    };
    let colors: Vec<Option<Vec3>> =
        gbuffer.surfaces.iter().zip(light).map(|(s, light)| s.as_ref().map(|s| color(s, light))).collect();
    Ok(write_png(path, &developed(&colors, view.resolution))?)
}

/// Holds each point to twice the median of its neighbours: a path that was lucky
/// to find a small lamp makes a spark. For the eye only; no number is taken here.
fn without_sparks(light: &[f32], [width, height]: [u32; 2]) -> Vec<f32> {
    let near = |at: u32, end: u32| at.saturating_sub(1)..(at + 2).min(end);
    let point = |x: u32, y: u32| light[(y * width + x) as usize];
    let held = |x: u32, y: u32| {
        let mut around: Vec<f32> =
            near(y, height).flat_map(|v| near(x, width).map(move |u| point(u, v))).filter(|l| l.is_finite()).collect();
        around.sort_by(f32::total_cmp);
        let most = around.get(around.len() / 2).map_or(f32::INFINITY, |median| 2.0 * median);
        // Where there is no surface, NaN stays.
        if point(x, y) > most { most } else { point(x, y) }
    };
    (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| held(x, y)).collect()
}

/// The picture: exposed, tone-mapped, averaged over the points of a pixel. None
/// is the sky.
fn developed(colors: &[Option<Vec3>], [width, height]: [u32; 2]) -> RgbImage {
    let mut seen: Vec<f32> = colors.iter().flatten().map(|c| luminance(c.to_array())).collect();
    seen.sort_by(f32::total_cmp);
    let bright = seen.get(seen.len() * 99 / 100).copied().unwrap_or(1.0).max(f32::MIN_POSITIVE);
    let mean = seen.iter().map(|l| f64::from(l.max(bright * 1e-3)).ln()).sum::<f64>() / seen.len().max(1) as f64;
    let exposure = KEY / mean.exp() as f32;
    // Reinhard's curve with white where the brightest hundredth begins.
    let white = (bright * exposure).max(WHITE);
    let mapped = |c: Vec3| {
        let level = luminance(c.to_array()) * exposure;
        c * exposure * ((1.0 + level / (white * white)) / (1.0 + level))
    };
    let at = |x: u32, y: u32| match colors[(y * width + x) as usize] {
        Some(color) => mapped(color).min(Vec3::ONE),
        None => SKY[0].lerp(SKY[1], (y as f32 + 0.5) / height as f32),
    };
    RgbImage::from_fn(width / FINE, height / FINE, |x, y| {
        let sum = (0..FINE * FINE).map(|i| at(x * FINE + i % FINE, y * FINE + i / FINE)).sum::<Vec3>();
        Rgb((sum / (FINE * FINE) as f32).to_array().map(srgb))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "description = 'x'\nao = { radius = 1 }\nenvironment = { radiance = 3 }\n\
         measure = { center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.1, resolution = [16, 16] }\n\
         look = { eye = [0, 1, 4], target = [0, 0.9, 0], resolution = [64, 64] }\n\
         [[object]]\nname = 'red'\ncolor = [0.6, 0.1, 0.1]\nshape = { plane = { center = [-50, 0, 0], u = [0, 0, 200], v = [100, 0, 0] } }\n\
         [[object]]\nname = 'grey'\nshape = { plane = { center = [50, 0, 0], u = [0, 0, 200], v = [100, 0, 0] } }\n";

    #[test]
    fn a_preview_shows_colours_against_the_sky() {
        let scene = Scene::from_toml("x", "x", TEXT, None).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.png");
        write(&scene, 16, &path).unwrap();
        let picture = image::open(&path).unwrap().into_rgb8();
        assert_eq!(picture.dimensions(), (64, 64));
        let [red, grey, sky] = [(8, 60), (56, 60), (32, 2)].map(|(x, y)| picture.get_pixel(x, y).0);
        assert!(red[0] > 2 * red[1] && red[1] == red[2], "{red:?}");
        assert!(grey[0] == grey[1] && grey[1] == grey[2] && (100..250).contains(&grey[0]), "{grey:?}");
        assert!(sky[2] > sky[0] + 20, "{sky:?}");
    }

    #[test]
    fn sparks_go_and_edges_stay() {
        let light: Vec<f32> = (0..64)
            .map(|i| {
                if i == 19 {
                    90.0
                } else if i % 8 < 4 {
                    1.0
                } else {
                    9.0
                }
            })
            .collect();
        let held = without_sparks(&light, [8, 8]);
        assert!((0..64).all(|i| held[i] == if i == 19 { 2.0 } else { light[i] }), "{held:?}");
        assert!(
            without_sparks(&[f32::NAN, 3.0], [2, 1])
                .iter()
                .zip([f32::NAN, 3.0])
                .all(|(a, b)| a.to_bits() == b.to_bits() || *a == b)
        );
    }
}
