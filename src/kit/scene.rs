//! A scene packed for other renderers: geometry with and without the occluder,
//! views, region map, G-buffer, and a page that says what to render.

use crate::{
    disk::{DiskError, refuse_foreign, write_whole},
    layers::Layers,
    metrics::regions::{Region, Regions},
    render::{Geometry, RenderError, gbuffer::GBuffer},
    scene_files,
    scenes::{Scene, SceneError, Sky},
};
use std::{io::Write, path::Path};

const PAGE: &str = "README.md";
const REGIONS: &str = "regions.exr";
const GBUFFER: &str = "gbuffer.exr";

/// Why a kit could not be written.
#[derive(Debug, thiserror::Error)]
pub enum KitError {
    /// A file could not be written.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The scene file cannot be made.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// What images are scored against cannot be made.
    #[error(transparent)]
    Run(#[from] crate::run::RunError),
    /// The scene cannot be traced.
    #[error("scene '{scene}': {source}")]
    Render {
        /// The scene.
        scene: String,
        /// Why.
        source: RenderError,
    },
}

/// Writes a scene alone as [`write`] does, into a folder that may hold other things: over an earlier
/// export of the same scene, but over no file that no export wrote.
///
/// # Errors
/// As [`write`], and where such a file is there: then nothing is written.
pub fn write_alone(scene: &Scene, folder: &Path) -> Result<(), KitError> {
    let name = &scene.name;
    let model = ["glb", "twin.glb", "toml"].map(|end| format!("{name}.{end}"));
    let others = [PAGE, "views.json", REGIONS, GBUFFER].map(str::to_owned);
    // The page is written first, so that an export that was killed is known by it as well.
    let marks = [&*title(name), &*file_name(name)];
    refuse_foreign(folder, PAGE, &marks, others.into_iter().chain(model), &format!("export of scene '{name}'"))?;
    write(scene, folder)
}

/// Writes `README.md`, `NAME.glb`, `NAME.toml`, `NAME.twin.glb` (where there is an occluder), `views.json`,
/// `regions.exr` and `gbuffer.exr` into a folder.
///
/// # Errors
/// Where a file cannot be written or the scene is too deep to trace.
pub fn write(scene: &Scene, folder: &Path) -> Result<(), KitError> {
    let render = of_scene(scene);
    let page = page(scene);
    write_whole(&folder.join(PAGE), |out| out.write_all(page.as_bytes()))?;
    scene_files::write(scene, folder)?;
    if scene.has_occluder() {
        scene_files::write_glb(&scene.twin(), &folder.join(format!("{}.twin.glb", scene.name)))?;
    }
    let geometry = Geometry::new(scene).map_err(render)?;
    let view = scene.measure.view();
    let gbuffer = GBuffer::new(&geometry.tracer, &view);
    let regions = Regions::new(scene, &geometry.tracer, &gbuffer);
    let mut masks = Layers::new(view.resolution);
    for region in Region::ALL {
        masks = masks.with(region.label(), regions.mask(region, view.pixels()));
    }
    masks.write(&folder.join(REGIONS))?;
    let channel = |f: &dyn Fn(&crate::render::gbuffer::Surface) -> f32| -> Vec<f32> {
        gbuffer.surfaces.iter().map(|s| s.as_ref().map_or(f32::NAN, f)).collect()
    };
    let mut surfaces = Layers::new(view.resolution);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        surfaces = surfaces
            .with(&format!("position.{name}"), channel(&|s| s.point[axis]))
            .with(&format!("normal.{name}"), channel(&|s| s.normal[axis]));
    }
    Ok(surfaces.write(&folder.join(GBUFFER))?)
}

/// What a renderer says of a scene.
pub(super) fn of_scene(scene: &Scene) -> impl Fn(RenderError) -> KitError + use<> {
    let scene = scene.name.clone();
    move |source| KitError::Render { scene: scene.clone(), source }
}

/// How the page of a scene begins.
fn title(name: &str) -> String {
    format!("# {name}\n")
}

/// What the page says of how images are called.
fn file_name(name: &str) -> String {
    format!("`{name}.<estimator>.<rays>.<replicate>.exr`")
}

fn page(scene: &Scene) -> String {
    let name = &scene.name;
    let m = &scene.measure;
    let [w, h] = m.resolution;
    let twin = if scene.has_occluder() {
        format!("- `{name}.twin.glb`: the same scene with the occluder under judgement taken away.\n")
    } else {
        String::new()
    };
    format!(
        "{}\n{}\n\n\
         ## What is here\n\n\
         - `{name}.glb`: the scene, metres, +Y up, right-handed (glTF 2.0). Nodes of occluders carry `extras.aogauge.occluder`.\n\
         - `{name}.toml`: the scene file for it, with the light and R; `aogauge scene show {name}.toml` reads both back as the same scene.\n{twin}\
         - `views.json`: both views, the sky and its openings, R and R' as numbers. The glb holds them too, as the cameras `measure` (orthographic) and `look` (perspective).\n\
         - `regions.exr`: masks of 0 and 1 in the measure view: all, footprint, left, right, far.\n\
         - `gbuffer.exr`: position and geometric normal behind each pixel centre of the measure view; NaN where there is none.\n\n\
         ## What to render\n\n\
         1. From camera `measure`, {w} x {h} pixels, one sample at each pixel's centre, rows from the top, x along the transect {:?}.\n\
         2. Openness, linear and without a transfer curve: 1 is fully open, 0 closed. Not occlusion, not multiplied with a colour, not blurred.\n\
         3. Rays of length R = {} m, cosine distributed about the geometric normal.\n\
         4. Half the secondary ray, for the extended method: R' = {} m.\n\
         5. AO needs no light. The judge's light is {}: see `environment` in `views.json`.\n\
         6. Several images with seeds of their own, better than one with more rays: intervals are taken over them.\n\n\
         ## How to name it\n\n\
         {}, 32-bit float, one channel `Y` (or the same value in R, G and B); \
         for example `{name}.classic.32.0003.exr`.\n\n\
         Compare your positions with `gbuffer.exr` first: if they differ by more than rounding, the camera is wrong, not the AO.\n",
        title(name),
        scene.description,
        m.transect.to_array(),
        scene.ao.radius,
        scene.ao.secondary_radius,
        match scene.environment.sky {
            Sky::None => "what the emissive surfaces send out".to_owned(),
            Sky::Uniform(radiance) => format!("a uniform sky of radiance {radiance}"),
            Sky::Gradient { zenith, horizon, ground } =>
                format!("a sky of radiance {zenith} at the zenith, {horizon} at the horizon and {ground} below"),
        },
        file_name(name),
    )
}
