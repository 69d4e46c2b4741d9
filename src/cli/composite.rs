//! `aogauge composite`

use super::{
    Exit, Failure, Format, json, print,
    render::{Method, Which, is_png},
    scene::load,
    tell,
};
use crate::{
    counted::counted,
    layers::{Layers, write_png},
    picture::{split, tone},
    render::{
        Estimator, Geometry, Kind, Openness, RenderError, Renderer,
        composite::{Composite, Composition, Lighting, compose, mean_radiance, shade, sun},
        cpu::Cpu,
        materials::Materials,
    },
    scenes::{Scene, View, luminance},
    suite::EstimatorFile,
};
use glam::Vec3;
use serde::Serialize;
use std::{
    f32::consts::PI,
    path::{Path, PathBuf},
};

/// Compose a picture: direct light by glTF's BRDF, ambient light times AO, emission.
///
/// Lights are those of the model and the sun; ambient light has the radiance of
/// the scene's sky. docs/composite.md has the formulas.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge composite curtain-arcade --sun 250,40 --out classic.png\n  \
aogauge composite atrium --sun 200,55 --split --rays 32 --scale 4 --out split.png\n  \
aogauge composite sponza.toml --sun 170,70 --estimator extended --set receiver_plane=clipped --out extended.exr\n  \
aogauge composite atrium --preset unity-high --ambient 0.9,1.0,1.2 --exposure -1.5 --samples 16 --out unity.png")]
pub struct Args {
    /// A built-in scene by name, or a scene file.
    scene: String,
    /// The picture: .png is tone-mapped (Khronos PBR Neutral) and sRGB, .exr has
    /// linear layers: color, direct, ambient, emission, ao, albedo, normal, depth.
    #[arg(long)]
    out: PathBuf,
    /// Three pictures in one: without AO, by the method without its secondary rays,
    /// and by the method, extended (receiver_plane=clipped) unless given.
    #[arg(long)]
    split: bool,
    /// With --split, write the three whole pictures, too, beside it.
    #[arg(long, requires = "split")]
    parts: bool,
    #[command(flatten)]
    method: Method,
    /// From where.
    #[arg(long, value_enum, default_value_t = Which::Look)]
    view: Which,
    /// The eye of the look view in place of the scene's, metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true, conflicts_with = "view")]
    eye: Option<[f32; 3]>,
    /// The point at the centre of the look view, metres.
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_point, allow_hyphen_values = true, conflicts_with = "view")]
    target: Option<[f32; 3]>,
    /// Vertical field of view of the look view, 1 to 169 degrees.
    #[arg(long, value_name = "DEGREES", value_parser = parse_fov, allow_hyphen_values = true, conflicts_with = "view")]
    fov: Option<f32>,
    /// Pixels for each pixel of the view, each way.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=16))]
    scale: u32,
    /// Points a pixel at which the scene is seen; --rays are shared among them.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    samples: u32,
    /// Where the sun stands: degrees from -Z towards +X (-360 to 360), and above
    /// the horizon (above 0, to 90).
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = parse_sun, allow_hyphen_values = true)]
    sun: Option<[f32; 2]>,
    /// Irradiance of the sun on a surface that faces it, one number or R,G,B; five
    /// times what the ambient light gives an open surface, unless given.
    #[arg(long, value_name = "E", value_parser = parse_light, requires = "sun", allow_hyphen_values = true)]
    sun_irradiance: Option<[f32; 3]>,
    /// Ambient radiance, one number or R,G,B; that of the scene's sky unless given.
    #[arg(long, value_name = "L", value_parser = parse_light, allow_hyphen_values = true)]
    ambient: Option<[f32; 3]>,
    /// Light is multiplied by two to this power, -30 to 30; unless given, so that
    /// the picture without AO is middle grey on the average.
    #[arg(long, value_name = "EV", value_parser = parse_exposure, allow_hyphen_values = true)]
    exposure: Option<f32>,
    /// What is printed on standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Most pixels of a picture: it is held in memory with all its parts.
const MOST_PIXELS: usize = 1 << 24;

fn numbers(text: &str) -> Result<Vec<f32>, String> {
    let number = |part: &str| {
        let number = part.trim().parse::<f32>().ok().filter(|v| v.is_finite());
        number.ok_or_else(|| format!("'{part}' is no number"))
    };
    text.split(',').map(number).collect()
}

fn parse_sun(text: &str) -> Result<[f32; 2], String> {
    match numbers(text)?[..] {
        [azimuth, _] if !(-360.0..=360.0).contains(&azimuth) => {
            Err(format!("the azimuth is {azimuth}: it must be from -360 to 360 degrees"))
        }
        [_, elevation] if !(elevation > 0.0 && elevation <= 90.0) => {
            Err(format!("the elevation is {elevation}: it must be above 0, to 90 degrees"))
        }
        [azimuth, elevation] => Ok([azimuth, elevation]),
        _ => Err("write AZIMUTH,ELEVATION in degrees".into()),
    }
}

fn parse_light(text: &str) -> Result<[f32; 3], String> {
    let values = numbers(text)?;
    if let Some(v) = values.iter().find(|v| !(0.0..=1e6).contains(*v)) {
        return Err(format!("{v} is out of range: it must be from 0 to 1000000"));
    }
    match values[..] {
        [grey] => Ok([grey; 3]),
        [r, g, b] => Ok([r, g, b]),
        _ => Err("write one number or R,G,B".into()),
    }
}

fn parse_point(text: &str) -> Result<[f32; 3], String> {
    match numbers(text)?[..] {
        [x, y, z] if [x, y, z].iter().all(|v| v.abs() <= 1e6) => Ok([x, y, z]),
        [_, _, _] => Err("a coordinate is out of range: it must be from -1000000 to 1000000 m".into()),
        _ => Err("write X,Y,Z in metres".into()),
    }
}

fn parse_fov(text: &str) -> Result<f32, String> {
    match numbers(text)?[..] {
        [fov] if (1.0..=169.0).contains(&fov) => Ok(fov),
        [fov] => Err(format!("{fov} is out of range: it must be from 1 to 169 degrees")),
        _ => Err("write one number of degrees".into()),
    }
}

fn parse_exposure(text: &str) -> Result<f32, String> {
    match numbers(text)?[..] {
        [ev] if (-30.0..=30.0).contains(&ev) => Ok(ev),
        [ev] => Err(format!("{ev} is out of range: it must be from -30 to 30 stops")),
        _ => Err("write one number of stops".into()),
    }
}

/// What was composed.
#[derive(Serialize)]
struct Composed {
    scene: String,
    scene_hash: String,
    /// From left to right.
    pictures: Vec<Shown>,
    renderer: &'static str,
    rays: u32,
    samples: u32,
    seed: u32,
    resolution: [u32; 2],
    /// Azimuth and elevation, degrees.
    sun: Option<[f32; 2]>,
    sun_irradiance: Option<[f32; 3]>,
    /// Punctual lights of the scene.
    lights: usize,
    ambient: [f32; 3],
    /// Stops.
    exposure: f32,
    /// Of AO.
    seconds: f64,
    image: String,
}

/// One picture, or part of one.
#[derive(Serialize)]
struct Shown {
    name: String,
    /// None for the picture without AO.
    estimator: Option<EstimatorFile>,
    /// Mean openness of what is seen.
    mean_openness: f64,
    /// The whole picture, where it was written.
    image: Option<String>,
}

/// A picture's name and method; None is without AO.
type Named = (String, Option<Estimator>);

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let png = is_png(&args.out)?;
    let (methods, rays) = methods(args)?;
    let mut scene = load(&args.scene)?;
    look(args, &mut scene)?;
    let scene = scene;
    let near = scene.near_origin();
    let lighting = lighting(args, &near)?;
    let view = args.view.of(&near).finer(args.scale);
    if view.pixels() > MOST_PIXELS {
        let [w, h] = view.resolution;
        return Err(Failure::usage(format!(
            "--scale {}: the picture has {w} x {h} pixels: it must have at most {MOST_PIXELS} in all",
            args.scale
        )));
    }
    let picture = composite(args, &near, &view, &methods, rays, &lighting)?;
    // Of the picture without AO, so that it is the same for every method.
    let shown = 0..picture.depth.len();
    let seen = shown.filter(|&i| !picture.depth[i].is_nan());
    let bare = |i: usize| picture.direct[i] + picture.emission[i] + unoccluded(&picture, i, lighting.ambient);
    let exposure = args.exposure.unwrap_or_else(|| tone::automatic_exposure(seen.map(bare)).log2());
    let development = Development { picture: &picture, methods: &methods, exposure, png };
    let whole = |i: usize| -> Result<Option<String>, Failure> {
        let path = beside(&args.out, &methods[i].0);
        args.parts.then(|| development.write(&[i], &path).map(|()| path.display().to_string())).transpose()
    };
    let images = (0..methods.len()).map(whole).collect::<Result<Vec<_>, _>>()?;
    development.write(&(0..methods.len()).collect::<Vec<_>>(), &args.out)?;
    let shown = methods.iter().zip(images).enumerate().map(|(i, ((name, estimator), image))| Shown {
        name: name.clone(),
        estimator: estimator.as_ref().map(EstimatorFile::of),
        mean_openness: mean(&picture.methods[i].ao),
        image,
    });
    let composed = Composed {
        scene_hash: scene.hash(),
        pictures: shown.collect(),
        renderer: args.method.renderer.name(),
        rays,
        samples: args.samples,
        seed: args.method.seed,
        resolution: picture.resolution,
        sun: args.sun,
        sun_irradiance: args.sun.map(|_| lighting.lights.last().map_or([0.0; 3], |l| l.color)),
        lights: scene.lights.len(),
        ambient: lighting.ambient.to_array(),
        exposure,
        seconds: picture.seconds,
        image: args.out.display().to_string(),
        scene: scene.name.clone(),
    };
    told(&composed, args.format)
}

fn told(composed: &Composed, format: Format) -> Result<Exit, Failure> {
    match format {
        Format::Json => print(&json(composed)?)?,
        Format::Text => {
            let names: Vec<&str> = composed.pictures.iter().map(|p| p.name.as_str()).collect();
            tell(&format!(
                "{}: {}, {} x {} pixels, {} and {} a pixel, exposure {:.2} EV, AO {:.2} s",
                composed.image,
                names.join(" | "),
                composed.resolution[0],
                composed.resolution[1],
                counted(composed.rays, "ray", "rays"),
                counted(composed.samples, "sample", "samples"),
                composed.exposure,
                composed.seconds
            ));
        }
    }
    Ok(Exit::Pass)
}

/// The pictures that are asked for, and the rays a pixel.
fn methods(args: &Args) -> Result<(Vec<Named>, u32), Failure> {
    if !args.split {
        let (estimator, rays) = args.method.build(Kind::Classic)?;
        if matches!(estimator, Estimator::LocalIndirect(_) | Estimator::PathTraced) {
            return Err(Failure::usage(format!(
                "--estimator {}: a composite takes a method of openness, and this one gives light",
                estimator.kind()
            )));
        }
        return Ok((vec![(estimator.kind().to_string(), Some(estimator))], rays));
    }
    let (estimator, rays) = args.method.build(Kind::Extended)?;
    let Estimator::Openness(extended @ Openness { extension: Some(_), .. }) = estimator else {
        return Err(Failure::usage(format!(
            "--split holds a method against itself without its secondary rays, and {} has none: \
             --estimator must be extended or extended-obscurance",
            estimator.kind()
        )));
    };
    let plain = Estimator::Openness(Openness { extension: None, ..extended });
    let named = |e: Estimator| (e.kind().to_string(), Some(e));
    Ok((vec![("no AO".into(), None), named(plain), named(estimator)], rays))
}

/// Moves the look view.
fn look(args: &Args, scene: &mut Scene) -> Result<(), Failure> {
    let look = &mut scene.look;
    look.eye = args.eye.map_or(look.eye, Vec3::from);
    look.target = args.target.map_or(look.target, Vec3::from);
    look.fov = args.fov.unwrap_or(look.fov);
    let towards = (look.target - look.eye).normalize_or_zero();
    if towards.cross(Vec3::Y).length() < 1e-3 {
        return Err(Failure::usage(format!(
            "--eye {} and --target {}: the camera must not look straight up or down, nor nowhere",
            look.eye, look.target
        )));
    }
    Ok(())
}

fn lighting(args: &Args, scene: &Scene) -> Result<Lighting, Failure> {
    let sky = scene.environment.sky;
    let ambient = match args.ambient {
        Some(ambient) => Vec3::from(ambient),
        None if sky.is_dark() => {
            return Err(Failure::usage(format!(
                "scene '{}' has no sky to take the ambient radiance from: give --ambient, 0 to 1000000",
                scene.name
            )));
        }
        None => Vec3::splat(mean_radiance(sky)),
    };
    let mut lights = scene.lights.clone();
    if let Some([azimuth, elevation]) = args.sun {
        let irradiance = match args.sun_irradiance {
            Some(irradiance) => Vec3::from(irradiance),
            None if ambient == Vec3::ZERO => {
                return Err(Failure::usage(
                    "--ambient is 0, so the sun has no brightness of its own: give --sun-irradiance",
                ));
            }
            None => Vec3::splat(5.0 * PI * luminance(ambient.to_array())),
        };
        lights.push(sun(azimuth, elevation, irradiance));
    }
    Ok(Lighting { lights, ambient, sky })
}

fn composite(
    args: &Args,
    scene: &Scene,
    view: &View,
    methods: &[Named],
    rays: u32,
    lighting: &Lighting,
) -> Result<Composite, Failure> {
    if args.method.on_gpu.draws() {
        // Light and AO of a pixel must fall on one surface.
        return Err(Failure::usage("--g-buffer raster: a composite finds what pixels see by rays"));
    }
    let fail = |e: RenderError| Failure::render(&scene.name, &e);
    let geometry = Geometry::new(scene).map_err(fail)?;
    let materials = Materials::new(scene);
    let gpu = args.method.gpu().map_err(fail)?;
    let renderer: &dyn Renderer = gpu.as_ref().map_or(&Cpu, |g| g);
    let mut loaded = renderer.load(&geometry).map_err(fail)?;
    let methods: Vec<Option<Estimator>> = methods.iter().map(|(_, e)| *e).collect();
    let what =
        Composition { view, methods: &methods, ao: scene.ao, rays, samples: args.samples, seed: args.method.seed };
    let picture = match &gpu {
        None => compose(&mut *loaded, &what, lighting.ambient, |view| Ok(shade(&geometry, &materials, view, lighting))),
        Some(gpu) => gpu
            .lit(&geometry, &materials, lighting)
            .and_then(|mut lit| compose(&mut *loaded, &what, lighting.ambient, |view| lit.shade(view))),
    };
    picture.map_err(fail)
}

/// Radiance by ambient light that nothing keeps off.
fn unoccluded(picture: &Composite, pixel: usize, ambient: Vec3) -> Vec3 {
    picture.albedo[pixel] * ambient * picture.coverage[pixel]
}

fn mean(values: &[f32]) -> f64 {
    let (sum, n) = values.iter().filter(|v| !v.is_nan()).fold((0.0, 0u32), |(s, n), &v| (s + f64::from(v), n + 1));
    sum / f64::from(n.max(1))
}

/// `a/b.png` and "no AO": `a/b.no-ao.png`.
fn beside(out: &Path, name: &str) -> PathBuf {
    let extension = out.extension().and_then(|e| e.to_str()).unwrap_or_default();
    out.with_extension(format!("{}.{extension}", name.to_lowercase().replace(' ', "-")))
}

/// How a composite is put on disk.
struct Development<'a> {
    picture: &'a Composite,
    methods: &'a [Named],
    /// Stops.
    exposure: f32,
    png: bool,
}

impl Development<'_> {
    /// Writes some of the methods side by side.
    fn write(&self, shown: &[usize], path: &Path) -> Result<(), Failure> {
        let [width, _] = self.picture.resolution;
        let parts: Vec<usize> = (0..width).map(|x| shown[split::part(x, shown.len(), width)]).collect();
        let method = |pixel: usize| parts[pixel % width as usize];
        if !self.png {
            return Ok(self.layers(&method, shown).write(path)?);
        }
        let light = |pixel: usize| self.picture.color(method(pixel), pixel);
        let mut image = tone::developed(self.picture.resolution, self.exposure.exp2(), light);
        if shown.len() > 1 {
            let names: Vec<String> = shown.iter().map(|&i| self.methods[i].0.clone()).collect();
            split::mark(&mut image, &names);
        }
        Ok(write_png(path, &image)?)
    }

    /// Linear light and what it is made of.
    fn layers(&self, method: &dyn Fn(usize) -> usize, shown: &[usize]) -> Layers {
        let p = self.picture;
        let pixels = 0..p.direct.len();
        let of_method = |value: &dyn Fn(usize, usize) -> Vec3| pixels.clone().map(|i| value(method(i), i)).collect();
        let colors: [(&str, [&str; 3], Vec<Vec3>); 6] = [
            ("color", RGB, of_method(&|m, i| p.color(m, i))),
            ("direct", RGB, p.direct.clone()),
            ("ambient", RGB, of_method(&|m, i| p.methods[m].ambient[i])),
            ("emission", RGB, p.emission.clone()),
            ("albedo", RGB, p.albedo.clone()),
            ("normal", ["X", "Y", "Z"], p.normal.clone()),
        ];
        let mut layers = Layers::new(p.resolution).with("depth", p.depth.clone());
        for (name, channels, values) in colors {
            for (c, channel) in channels.into_iter().enumerate() {
                layers = layers.with(&format!("{name}.{channel}"), values.iter().map(|v| v[c]).collect());
            }
        }
        let names: Vec<&str> = shown.iter().map(|&i| self.methods[i].0.as_str()).collect();
        layers.attributes.insert("methods".into(), names.join(" | "));
        layers.attributes.insert("exposure".into(), self.exposure.to_string());
        layers.with("ao", pixels.map(|i| p.methods[method(i)].ao[i]).collect())
    }
}

/// Channels of colour.
const RGB: [&str; 3] = ["R", "G", "B"];
