//! `aogauge scene show`

use super::{load, source};
use crate::{
    cli::{Exit, Failure, Format, json, print, tell},
    counted::counted,
    preview,
    scenes::{Material, Mesh, Parameters, Scene, Sky, luminance},
    untrusted::logged_lines,
};
use serde::Serialize;
use std::path::PathBuf;

/// Show what is in a scene: all parameters, its objects, and a preview.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  aogauge scene show curtain-arcade --preview arcade.png\n  aogauge scene show my-scene.toml"
)]
pub struct Args {
    /// A built-in scene by name, or a scene file.
    scene: String,
    /// Write a picture from the look view here: path-traced, in colour, PNG.
    #[arg(long)]
    preview: Option<PathBuf>,
    /// Paths a pixel of the preview; four at least.
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
    /// The scene file, with all defaults filled in.
    parameters: Parameters,
    objects: Vec<Shape>,
    totals: Totals,
}

#[derive(Serialize)]
struct Shape {
    name: String,
    occluder: bool,
    triangles: usize,
    bounds: [[f32; 3]; 2],
    material: Surface,
}

#[derive(Serialize)]
struct Surface {
    base_color: [f32; 3],
    textured: bool,
    metallic: f32,
    roughness: f32,
    emissive: [f32; 3],
}

#[derive(Serialize)]
struct Totals {
    objects: usize,
    triangles: usize,
    occluders: usize,
    occluder_triangles: usize,
    bounds: [[f32; 3]; 2],
    /// The light, in words.
    environment: String,
    /// Names of the cameras that a model brought along.
    cameras: Vec<String>,
}

fn bounds(mesh: &Mesh) -> [[f32; 3]; 2] {
    mesh.bounds().unwrap_or_default().map(|v| v.to_array())
}

fn shapes(scene: &Scene) -> Vec<Shape> {
    let surface = |m: &Material| Surface {
        base_color: m.base_color,
        textured: m.texture.is_some(),
        metallic: m.metallic,
        roughness: m.roughness,
        emissive: m.emissive,
    };
    let shape = |o: &crate::scenes::Object| Shape {
        name: o.name.clone(),
        occluder: o.occluder,
        triangles: o.mesh.triangles.len(),
        bounds: bounds(&o.mesh),
        material: surface(&o.material),
    };
    scene.objects.iter().map(shape).collect()
}

fn totals(scene: &Scene, shapes: &[Shape]) -> Totals {
    let corner = |side: usize, pick: fn(f32, f32) -> f32| {
        std::array::from_fn(|axis| shapes.iter().map(|o| o.bounds[side][axis]).reduce(pick).unwrap_or(0.0))
    };
    let occluders = || shapes.iter().filter(|s| s.occluder);
    Totals {
        objects: shapes.len(),
        triangles: shapes.iter().map(|s| s.triangles).sum(),
        occluders: occluders().count(),
        occluder_triangles: occluders().map(|s| s.triangles).sum(),
        bounds: [corner(0, f32::min), corner(1, f32::max)],
        environment: environment(scene),
        cameras: scene.cameras.iter().map(|c| c.name.clone()).collect(),
    }
}

fn environment(scene: &Scene) -> String {
    let sky = match scene.environment.sky {
        Sky::None => "no sky".to_owned(),
        Sky::Uniform(radiance) => format!("uniform sky of radiance {radiance}"),
        Sky::Gradient { zenith, horizon, ground } => {
            format!("sky of radiance {zenith} at the zenith, {horizon} at the horizon, {ground} below")
        }
    };
    let lamps = scene.objects.iter().filter(|o| luminance(o.material.emissive) > 0.0).count();
    let more = |n: usize, one, many| if n == 0 { String::new() } else { format!(", {}", counted(n, one, many)) };
    sky + &more(scene.environment.portals.len(), "portal", "portals")
        + &more(lamps, "lamp", "lamps")
        + &more(scene.lights.len(), "punctual light", "punctual lights")
}

/// Three numbers, to a tenth of a millimetre.
fn point(p: [f32; 3]) -> String {
    let number = |v: f32| (f64::from(v) * 1e4).round() / 1e4 + 0.0;
    format!("[{}, {}, {}]", number(p[0]), number(p[1]), number(p[2]))
}

impl Surface {
    fn text(&self) -> String {
        let [r, g, b] = self.base_color;
        let mut text = if r == g && g == b { format!("albedo {r}") } else { format!("color {:?}", self.base_color) };
        if self.textured {
            text += ", textured";
        }
        if self.metallic > 0.0 {
            text += &format!(", metallic {}", self.metallic);
        }
        if self.emissive != [0.0; 3] {
            text += &format!(", emission {:?}", self.emissive);
        }
        text
    }
}

impl Shown {
    fn text(&self) -> String {
        let control = if self.control { " (control)" } else { "" };
        let mut text = format!(
            "{}{control}\n\n# Parameters, with defaults filled in\n\n{}\n# Objects\n\n",
            self.name,
            self.parameters.toml()
        );
        let width = self.objects.iter().map(|o| o.name.len()).max().unwrap_or(0).max(8);
        let rows = self.objects.iter().map(|o| {
            let [lo, hi] = o.bounds.map(point);
            let mark = if o.occluder { "occluder" } else { "" };
            let (name, triangles) = (&o.name, o.triangles);
            format!(
                "{name:<width$}  {triangles:>9} {:<9}  {mark:<8}  {lo} to {hi} m  {}\n",
                if triangles == 1 { "triangle" } else { "triangles" },
                o.material.text()
            )
        });
        text.extend(rows);
        let t = &self.totals;
        let [lo, hi] = t.bounds.map(point);
        text += &format!(
            "\n# Totals\n\ntriangles    {} in {}\noccluders    {}, {}\nbounds       {lo} to {hi} m\nenvironment  {}\n",
            t.triangles,
            counted(t.objects, "object", "objects"),
            t.occluders,
            counted(t.occluder_triangles, "triangle", "triangles"),
            t.environment
        );
        if !t.cameras.is_empty() {
            text += &format!("cameras      {}\n", t.cameras.join(", "));
        }
        text + &format!("hash         {}\n", self.hash)
    }
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    if let Some(path) = args.preview.as_ref().filter(|p| p.extension() != Some("png".as_ref())) {
        return Err(Failure::usage(format!("--preview is '{}': it must end in .png", path.display())));
    }
    let scene = load(&args.scene)?;
    let objects = shapes(&scene);
    let shown = Shown {
        name: scene.name.clone(),
        description: scene.description.clone(),
        control: scene.control,
        hash: scene.hash(),
        parameters: Parameters::new(&scene, &args.scene, &source(&args.scene)?)?,
        totals: totals(&scene, &objects),
        objects,
    };
    print(&match args.format {
        Format::Json => json(&shown)?,
        Format::Text => logged_lines(&shown.text()),
    })?;
    if let Some(path) = &args.preview {
        preview::write(&scene, args.rays, path)?;
        tell(&path.display().to_string());
    }
    Ok(Exit::Pass)
}
