//! `aogauge render`

use super::{Exit, Failure, Format, json, on_gpu::OnGpu, print, scene::load, tell};
use crate::{
    counted::counted,
    layers::Layers,
    metrics::regions::Regions,
    render::{
        Estimator, Frame, Geometry, Job, Kind, ReceiverPlane, RenderError, Renderer, cpu::Cpu, gbuffer::GBuffer,
        gpu::Gpu,
    },
    report::picture,
    scenes::{Scene, View},
    screen_camera::screen_camera,
    stats::mean_variance,
    suite::EstimatorFile,
};
use clap::ValueEnum;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Render one image of a scene by one method.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge render curtain-arcade --out classic.png\n  \
aogauge render curtain-arcade --estimator extended --set receiver_plane=clipped --rays 256 --out extended.exr\n  \
aogauge render curtain-room --estimator obscurance --set 'falloff={ exponential = { extinction = 4.0 } }' --out o.exr\n  \
aogauge render curtain-room --rays 4 --set 'temporal={ motion = [0.7, 0.3] }' --set 'denoise={}' --out smooth.exr\n  \
aogauge render curtain-arcade --estimator gtao --view look --out gtao.png\n  \
aogauge render atrium --preset unity-high --view look --out unity.png\n  \
aogauge render atrium --view look --renderer gpu --g-buffer raster --out hybrid.png\n  \
aogauge render curtain-arcade --estimator path-traced --rays 1024 --replicates 8 --out judge.exr")]
pub struct Args {
    /// A built-in scene by name, or a scene file.
    scene: String,
    /// The image: .exr keeps 32-bit values in layers (mean, variance and each
    /// replicate; color.R, .G and .B where the method knows colour), .png is for
    /// looking at.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    method: Method,
    /// Independent images to take the mean of.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    replicates: u32,
    /// From where.
    #[arg(long, value_enum, default_value_t)]
    view: Which,
    /// Without the occluder.
    #[arg(long)]
    twin: bool,
    /// What is printed on standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// A method, its rays, and who renders it: what verbs that render share.
#[derive(Debug, clap::Args)]
pub(super) struct Method {
    /// The method; classic unless given.
    #[arg(long, value_enum, conflicts_with = "preset")]
    pub estimator: Option<Kind>,
    /// A method as an engine or the paper sets it: unity-low, unity-medium,
    /// unity-high, unreal-default, microsoft-sample, paper-4, paper-32,
    /// xegtao-high.
    #[arg(long)]
    pub preset: Option<String>,
    /// An option of the method as in a suite file, KEY=VALUE; may be repeated.
    /// Keys: falloff, faces, intensity, radius, secondary_radius, receiver_plane,
    /// secondary_rays, secondary_sides, secondary_origin, temporal, denoise, steps,
    /// sample_power, radius_multiplier, tangent_bias, thickness.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub options: Vec<String>,
    /// Rays, or paths, a pixel, or slices in screen space; the preset's, or 64.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=65536))]
    rays: Option<u32>,
    /// Seed of all randomness.
    #[arg(long, default_value_t = 1)]
    pub seed: u32,
    /// Who renders.
    #[arg(long, value_enum, default_value_t)]
    pub renderer: By,
    #[command(flatten)]
    pub on_gpu: OnGpu,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Which {
    /// The view that metrics are taken from.
    #[default]
    Measure,
    /// The view that pictures are taken from.
    Look,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum By {
    /// The CPU reference.
    #[default]
    Cpu,
    /// The GPU.
    Gpu,
}

/// What was rendered.
#[derive(Serialize)]
struct Rendered {
    scene: String,
    scene_hash: String,
    estimator: EstimatorFile,
    renderer: String,
    rays: u32,
    replicates: u32,
    seed: u32,
    resolution: [u32; 2],
    /// Over the pixels that see a surface.
    mean: f64,
    seconds: f64,
    image: String,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let is_png = is_png(&args.out)?;
    let (estimator, rays) = args.method.build(Kind::Classic)?;
    let scene = load(&args.scene)?;
    let frames = frames(args, &scene.near_origin(), estimator, rays)?;
    let image = Mean::of(&frames);
    if is_png {
        image.write_png(&args.out)?;
    } else {
        image.write_exr(&frames, &args.out)?;
    }
    let seen: Vec<f64> = image.mean.iter().filter(|v| !v.is_nan()).map(|&v| f64::from(v)).collect();
    let rendered = Rendered {
        scene_hash: scene.hash(),
        scene: scene.name,
        estimator: EstimatorFile::of(&estimator),
        renderer: args.method.renderer.name().into(),
        rays,
        replicates: args.replicates,
        seed: args.method.seed,
        resolution: image.resolution,
        mean: mean_variance(&seen).0,
        seconds: frames.iter().map(|f| f.seconds).sum(),
        image: args.out.display().to_string(),
    };
    match args.format {
        Format::Json => print(&json(&rendered)?)?,
        Format::Text => tell(&format!(
            "{}: {} x {} pixels, {} x {}, {:.2} s, mean {:.4}",
            rendered.image,
            rendered.resolution[0],
            rendered.resolution[1],
            rendered.replicates,
            counted(rays, "ray", "rays"),
            rendered.seconds,
            rendered.mean
        )),
    }
    Ok(Exit::Pass)
}

/// Whether a picture is asked for, and not values.
pub(super) fn is_png(out: &Path) -> Result<bool, Failure> {
    match out.extension().and_then(|e| e.to_str()) {
        Some("exr") => Ok(false),
        Some("png") => Ok(true),
        _ => Err(Failure::usage(format!("--out is '{}': it must end in .exr or .png", out.display()))),
    }
}

impl By {
    /// As it is called on the command line.
    pub fn name(self) -> &'static str {
        match self {
            By::Cpu => "cpu",
            By::Gpu => "gpu",
        }
    }
}

impl Which {
    /// The view of a scene.
    pub fn of(self, scene: &Scene) -> View {
        match self {
            Which::Measure => scene.measure.view(),
            Which::Look => scene.look.view(),
        }
    }
}

impl Method {
    /// The method that the options describe, `unless_given` where they name none,
    /// and the rays a pixel.
    pub fn build(&self, unless_given: Kind) -> Result<(Estimator, u32), Failure> {
        if self.renderer == By::Cpu {
            self.on_gpu.refuse()?;
        }
        let (estimator, own_rays) = method(self, unless_given)?;
        Ok((estimator, self.rays.or(own_rays).unwrap_or(64)))
    }

    /// The GPU, where it is to render.
    pub fn gpu(&self) -> Result<Option<Gpu>, RenderError> {
        match self.renderer {
            By::Cpu => Ok(None),
            By::Gpu => Gpu::with(self.on_gpu.options()).map(Some),
        }
    }
}

fn method(args: &Method, unless_given: Kind) -> Result<(Estimator, Option<u32>), Failure> {
    let mut table = toml::Table::new();
    for option in &args.options {
        let (key, value) =
            option.split_once('=').ok_or_else(|| Failure::usage(format!("--set '{option}': write KEY=VALUE")))?;
        if key == "rays" {
            return Err(Failure::usage("--set rays: give --rays"));
        }
        if !OPTIONS.contains(&key) {
            return Err(Failure::usage(format!(
                "--set '{option}': there is no option '{key}'; there are: {}",
                OPTIONS.join(", ")
            )));
        }
        // A bare word is a string.
        let value = toml::from_str::<toml::Table>(&format!("v = {value}"))
            .ok()
            .and_then(|mut t| t.remove("v"))
            .unwrap_or_else(|| toml::Value::String(value.to_owned()));
        if table.insert(key.to_owned(), value).is_some() {
            return Err(Failure::usage(format!("--set: '{key}' is given twice")));
        }
    }
    let options = || args.options.join(", ");
    let mut file: EstimatorFile = table
        .try_into()
        .map_err(|e: toml::de::Error| Failure::usage(format!("--set {}: {}", options(), e.message())))?;
    file.preset = args.preset.clone();
    if file.preset.is_none() {
        file.kind = Some(args.estimator.unwrap_or(unless_given));
        // Who names the method says what the paper leaves open, too.
        if args.estimator.is_none() && unless_given == Kind::Extended {
            file.receiver_plane.get_or_insert(ReceiverPlane::Clipped);
        }
    }
    let (estimator, rays) = file.build().map_err(|e| Failure::usage(format!("the estimator: {e}")))?;
    Ok((estimator, rays.map(crate::suite::Rays::get)))
}

/// What `--set` takes.
const OPTIONS: [&str; 16] = [
    "falloff",
    "faces",
    "intensity",
    "radius",
    "secondary_radius",
    "receiver_plane",
    "secondary_rays",
    "secondary_sides",
    "secondary_origin",
    "temporal",
    "denoise",
    "steps",
    "sample_power",
    "radius_multiplier",
    "tangent_bias",
    "thickness",
];

fn frames(args: &Args, scene: &Scene, estimator: Estimator, rays: u32) -> Result<Vec<Frame>, Failure> {
    let view = args.view.of(scene);
    let fail = |e: RenderError| Failure::render(&scene.name, &e);
    let twin = args.twin.then(|| scene.twin());
    let geometry = Geometry::new(twin.as_ref().unwrap_or(scene)).map_err(fail)?;
    let gpu = args.method.gpu().map_err(fail)?;
    let renderer: &dyn Renderer = gpu.as_ref().map_or(&Cpu, |g| g);
    let mut loaded = renderer.load(&geometry).map_err(fail)?;
    // The measure view's own depth buffer does not hold the occluder.
    let measured = args.view == Which::Measure && matches!(estimator, Estimator::ScreenSpace(_));
    // Both of a pair are seen from one place: that of the whole scene.
    let whole = if measured && twin.is_some() { Some(Geometry::new(scene).map_err(fail)?) } else { None };
    let camera = measured.then(|| {
        let tracer = &whole.as_ref().unwrap_or(&geometry).tracer;
        let points = GBuffer::new(tracer, &view);
        let regions = Regions::new(scene, tracer, &points);
        screen_camera(scene, tracer, &points, &regions)
    });
    let frame = |replicate| {
        let job = Job {
            view: &view,
            camera: camera.as_ref(),
            estimator,
            ao: scene.ao,
            rays,
            seed: args.method.seed,
            replicate,
        };
        loaded.render(&job).map_err(fail)
    };
    (0..args.replicates).map(frame).collect()
}

/// The mean of the replicates, a value a pixel.
struct Mean {
    resolution: [u32; 2],
    mean: Vec<f32>,
    variance: Vec<f32>,
    colors: Option<Vec<[f32; 3]>>,
}

impl Mean {
    fn of(frames: &[Frame]) -> Self {
        let resolution = frames.first().map_or([0; 2], |f| f.resolution);
        let pixels = frames.first().map_or(0, |f| f.values.len());
        let over = |value: &dyn Fn(&Frame) -> f32| {
            let values: Vec<f64> = frames.iter().map(|f| f64::from(value(f))).collect();
            mean_variance(&values)
        };
        let (mean, variance) = (0..pixels).map(|i| over(&|f| f.values[i])).map(|(m, v)| (m as f32, v as f32)).unzip();
        let colored = frames.iter().all(|f| f.colors.is_some());
        let channel = |i: usize, c: usize| over(&|f| f.colors.as_ref().map_or(f32::NAN, |l| l[i][c])).0 as f32;
        let colors = colored.then(|| (0..pixels).map(|i| [0, 1, 2].map(|c| channel(i, c))).collect());
        Mean { resolution, mean, variance, colors }
    }

    fn write_exr(&self, frames: &[Frame], path: &Path) -> Result<(), Failure> {
        let mut layers = Layers::new(self.resolution).with("mean", self.mean.clone());
        if let Some(colors) = &self.colors {
            for (c, name) in ["color.R", "color.G", "color.B"].into_iter().enumerate() {
                layers = layers.with(name, colors.iter().map(|v| v[c]).collect());
            }
        }
        if frames.len() > 1 {
            layers = layers.with("variance", self.variance.clone());
            for (r, frame) in frames.iter().enumerate() {
                layers = layers.with(&format!("replicate-{r:04}"), frame.values.clone());
            }
        }
        Ok(layers.write(path)?)
    }

    fn write_png(&self, path: &Path) -> Result<(), Failure> {
        match &self.colors {
            Some(colors) => picture::light(colors, self.resolution, path)?,
            None => picture::openness(&self.mean, self.resolution, 1, path)?,
        }
        Ok(())
    }
}
