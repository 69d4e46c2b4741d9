//! The scene by which a renderer shows that it draws the others as they are meant, and what
//! its image must look like.

use super::{
    KitError,
    scene::{self, of_scene},
};
use crate::{
    disk::DiskError,
    intake::{FACTORS, SELF_CHECK},
    layers::{Layers, srgb, write_png},
    render::{Estimator, Geometry, Job, Renderer, cpu::Cpu},
    scenes::{AoScale, Scene},
    score::self_check::{OPENNESS, SCALED, SCENE},
};
use std::path::Path;

pub(super) use crate::score::self_check::FILE;

/// Rays of the references.
const RAYS: u32 = 256;

/// Writes the scene into a folder of its name, with the picture `expected.png`, and its
/// references into the folder that images are scored against. Returns it.
pub(super) fn write(seed: u32, scenes: &Path, scoring: &Path) -> Result<Scene, KitError> {
    let scene = Scene::from_toml(SCENE, "self-check.toml (built in)", SELF_CHECK, None)?;
    let folder = scenes.join(SCENE);
    scene::write(&scene, &folder)?;
    let geometry = Geometry::new(&scene).map_err(of_scene(&scene))?;
    let view = scene.measure.view();
    let mut loaded = Cpu.load(&geometry).map_err(of_scene(&scene))?;
    let mut openness = |factor: f64| {
        let ao = AoScale { radius: (f64::from(scene.ao.radius) * factor) as f32, ..scene.ao };
        let job = Job { view: &view, camera: None, estimator: Estimator::CLASSIC, ao, rays: RAYS, seed, replicate: 0 };
        loaded.render(&job).map(|frame| frame.values).map_err(of_scene(&scene))
    };
    let plain = openness(1.0)?;
    let [width, height] = view.resolution;
    // As it is looked at, so that a person sees the same as of their own.
    let code = |x: u32, y: u32| image::Rgb([srgb(plain[(y * width + x) as usize]); 3]);
    write_png(&folder.join("expected.png"), &image::RgbImage::from_fn(width, height, code))?;
    let mut layers = Layers::new(view.resolution).with(OPENNESS, plain);
    for factor in FACTORS {
        layers = layers.with(&format!("{SCALED}{factor}"), openness(factor)?);
    }
    let written: Result<(), DiskError> = layers.write(&scoring.join(FILE));
    written?;
    Ok(scene)
}
