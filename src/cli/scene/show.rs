//! `aogauge scene show`

use super::{load, source};
use crate::{
    cli::{Exit, Failure, Format, json, print, tell},
    render::{Estimator, Geometry, Job, Renderer, cpu::Cpu},
    report::picture,
    scenes::{LookView, MeasureView, Scene},
};
use serde::Serialize;
use std::path::PathBuf;

/// Show what is in a scene: objects, bounds, views, and a preview.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  aogauge scene show curtain-arcade --preview arcade.png\n  aogauge scene show my-scene.toml"
)]
pub struct Args {
    /// A built-in scene by name, or a scene file.
    scene: String,
    /// Write a picture from the look view here: classic openness, PNG.
    #[arg(long)]
    preview: Option<PathBuf>,
    /// Primary rays a pixel of the preview.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65536))]
    rays: u32,
    /// How it is printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Serialize)]
struct Shown {
    name: String,
    description: String,
    control: bool,
    hash: String,
    triangles: usize,
    bounds: [[f32; 3]; 2],
    radius: f32,
    secondary_radius: f32,
    measure: Measure,
    look: Look,
    objects: Vec<Shape>,
    /// The scene file's text.
    parameters: String,
}

#[derive(Serialize)]
struct Measure {
    center: [f32; 3],
    normal: [f32; 3],
    transect: [f32; 3],
    clearance: f32,
    pixel: f32,
    resolution: [u32; 2],
}

#[derive(Serialize)]
struct Look {
    eye: [f32; 3],
    target: [f32; 3],
    fov: f32,
    resolution: [u32; 2],
}

#[derive(Serialize)]
struct Shape {
    name: String,
    occluder: bool,
    triangles: usize,
    bounds: [[f32; 3]; 2],
}

fn shown(scene: &Scene, parameters: String) -> Shown {
    let objects: Vec<Shape> = scene
        .objects
        .iter()
        .map(|o| Shape {
            name: o.name.clone(),
            occluder: o.occluder,
            triangles: o.mesh.triangles.len(),
            bounds: o.mesh.bounds().unwrap_or_default().map(|v| v.to_array()),
        })
        .collect();
    let corner = |side: usize, pick: fn(f32, f32) -> f32| {
        std::array::from_fn(|axis| objects.iter().map(|o| o.bounds[side][axis]).reduce(pick).unwrap_or(0.0))
    };
    let MeasureView { center, normal, transect, clearance, pixel, resolution } = scene.measure;
    let LookView { eye, target, fov, resolution: look } = scene.look;
    Shown {
        name: scene.name.clone(),
        description: scene.description.clone(),
        control: scene.control,
        hash: scene.hash(),
        triangles: objects.iter().map(|o| o.triangles).sum(),
        bounds: [corner(0, f32::min), corner(1, f32::max)],
        radius: scene.ao.radius,
        secondary_radius: scene.ao.secondary_radius,
        measure: Measure {
            center: center.to_array(),
            normal: normal.to_array(),
            transect: transect.to_array(),
            clearance,
            pixel,
            resolution,
        },
        look: Look { eye: eye.to_array(), target: target.to_array(), fov, resolution: look },
        objects,
        parameters,
    }
}

impl Shown {
    fn text(&self) -> String {
        let [lo, hi] = self.bounds;
        let (m, l) = (&self.measure, &self.look);
        let mut text = format!(
            "{}{}\n{}\n\nhash       {}\ntriangles  {}\nbounds     {lo:?} to {hi:?} m\nR, R'      {} m, {} m\n\
             measure    {} x {} pixels of {} m at {:?}, normal {:?}, transect {:?}, clearance {} m\n\
             look       {} x {} pixels from {:?} to {:?}, {} degrees\n\n",
            self.name,
            if self.control { " (control)" } else { "" },
            self.description,
            self.hash,
            self.triangles,
            self.radius,
            self.secondary_radius,
            m.resolution[0],
            m.resolution[1],
            m.pixel,
            m.center,
            m.normal,
            m.transect,
            m.clearance,
            l.resolution[0],
            l.resolution[1],
            l.eye,
            l.target,
            l.fov,
        );
        for o in &self.objects {
            let mark = if o.occluder { "occluder" } else { "" };
            text += &format!("  {:<28} {:>9} triangles  {mark}\n", o.name, o.triangles);
        }
        text += &format!("\n{}", self.parameters);
        text
    }
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let scene = load(&args.scene)?;
    let shown = shown(&scene, source(&args.scene)?);
    print(&match args.format {
        Format::Json => json(&shown)?,
        Format::Text => shown.text(),
    })?;
    if let Some(path) = &args.preview {
        let fail = |e: crate::render::RenderError| Failure::usage(format!("scene '{}': {e}", scene.name));
        let geometry = Geometry::new(&scene).map_err(fail)?;
        let view = scene.look.view();
        let rays = args.rays;
        let job = Job { view: &view, estimator: Estimator::CLASSIC, ao: scene.ao, rays, seed: 1, replicate: 0 };
        let frame = Cpu.load(&geometry).and_then(|mut loaded| loaded.render(&job)).map_err(fail)?;
        picture::openness(&frame.values, frame.resolution, 1, path)?;
        tell(&path.display().to_string());
    }
    Ok(Exit::Pass)
}
