//! `aogauge bench`

mod cpu;

use super::{Exit, Failure, Format, json, on_gpu::OnGpu, print, run::bar, scene::load, tell};
use crate::{
    bench::{GpuBench, MOST_RAYS, Settings, VERSION, scene},
    disk::{refuse_foreign, write_whole},
    render::gpu::{Gpu, Rounds},
    report::bench as tables,
    run::Observer,
};
use std::{
    io::Write,
    path::{Path, PathBuf},
};

/// Measure how fast AO is, and how fast rays are.
#[derive(Debug, clap::Subcommand)]
pub enum Verb {
    Cpu(cpu::Args),
    Gpu(GpuArgs),
}

/// Time classic and extended AO on the GPU, from the look view of scenes.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  aogauge bench gpu\n  aogauge bench gpu --scene atrium --scene mine.toml --out reports/gpu\n  \
aogauge bench gpu --resolution 640x360 --rays 4 --rounds 5 --format json"
)]
pub struct GpuArgs {
    /// A built-in scene by name, or a scene file; may be repeated.
    #[arg(long = "scene", default_value = "atrium")]
    scenes: Vec<String>,
    /// Width and height in pixels; 1920x1080 unless given, 480x270 on a software adapter.
    #[arg(long, value_parser = resolution)]
    resolution: Option<[u32; 2]>,
    /// Primary rays a pixel.
    #[arg(long, value_delimiter = ',', default_value = "4,32",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_RAYS)))]
    rays: Vec<u32>,
    /// Rounds that count; 50 unless given, 10 on a software adapter.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    rounds: Option<u32>,
    /// Rounds before them; 10 unless given, 1 on a software adapter.
    #[arg(long, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    warm_up: Option<u32>,
    /// Seed of all randomness.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    #[command(flatten)]
    on_gpu: OnGpu,
    /// Folder for bench.json and bench.md; no file of others is replaced.
    #[arg(long)]
    out: Option<PathBuf>,
    /// What is printed on standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The files in a folder.
const NUMBERS: &str = "bench.json";
const PAGE: &str = "bench.md";

/// The largest side of a view.
const LARGEST: u32 = 8192;

/// `1920x1080`.
fn resolution(text: &str) -> Result<[u32; 2], String> {
    let side = |s: &str| s.parse().ok().filter(|n| (16..=LARGEST).contains(n));
    text.split_once('x')
        .and_then(|(w, h)| Some([side(w)?, side(h)?]))
        .ok_or_else(|| format!("write WIDTHxHEIGHT, each from 16 to {LARGEST}"))
}

pub fn execute(verb: &Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Cpu(args) => cpu::execute(args),
        Verb::Gpu(args) => gpu(args),
    }
}

fn gpu(args: &GpuArgs) -> Result<Exit, Failure> {
    check_out(args.out.as_deref(), tables::TITLE, "adapter")?;
    let scenes = args.scenes.iter().map(|name| load(name)).collect::<Result<Vec<_>, _>>()?;
    let gpu = Gpu::with(args.on_gpu.options()).map_err(|e| Failure::usage(e.to_string()))?;
    let usual = |hardware, software| if gpu.is_software() { software } else { hardware };
    let rounds =
        Rounds { warm_up: args.warm_up.unwrap_or(usual(10, 1)), counted: args.rounds.unwrap_or(usual(50, 10)) };
    let settings = Settings {
        resolution: args.resolution.unwrap_or_else(|| if gpu.is_software() { [480, 270] } else { [1920, 1080] }),
        rays: args.rays.clone(),
        rounds,
        seed: args.seed,
    };
    let mut bench = GpuBench {
        version: VERSION,
        tool: env!("CARGO_PKG_VERSION").into(),
        adapter: gpu.describe(),
        is_software: gpu.is_software(),
        clock: gpu.clock(),
        resolution: settings.resolution,
        warm_up: rounds.warm_up,
        rounds: rounds.counted,
        scenes: vec![],
    };
    // What was measured before a scene failed is still told.
    let mut failed = None;
    let bar = bar();
    let each = (rounds.warm_up + rounds.counted) as usize;
    for (i, s) in scenes.iter().enumerate() {
        let step = |round: u32| bar.step((i * each + round as usize) as u64, (scenes.len() * each) as u64, &s.name);
        step(0);
        match scene(&gpu, s, &settings, step) {
            Ok(measured) => bench.scenes.push(measured),
            Err(e) => {
                failed = Some(Failure::render(&s.name, &e));
                break;
            }
        }
    }
    drop(bar);
    hand_out(args.out.as_deref(), args.format, &json(&bench)?, [tables::markdown(&bench), tables::plain(&bench)])?;
    failed.map_or(Ok(Exit::Pass), Err)
}

/// Each file may replace one of the same kind alone, of which its page has the `title` and its numbers the `field`.
fn check_out(folder: Option<&Path>, title: &str, field: &str) -> Result<(), Failure> {
    let Some(folder) = folder else { return Ok(()) };
    let by = format!("bench of '{title}'");
    refuse_foreign(folder, PAGE, &[&format!("# {title}\n")], [PAGE], &by)?;
    Ok(refuse_foreign(folder, NUMBERS, &["\"tool\": ", &format!("\"{field}\": ")], [NUMBERS], &by)?)
}

/// Writes what was measured to a folder, where one is given, and prints it; of texts the page's, then the terminal's.
fn hand_out(folder: Option<&Path>, format: Format, json: &str, [page, plain]: [String; 2]) -> Result<(), Failure> {
    if let Some(folder) = folder {
        for (name, text) in [(NUMBERS, json), (PAGE, &page)] {
            let path = folder.join(name);
            write_whole(&path, |buffer| buffer.write_all(text.as_bytes()))?;
            tell(&path.display().to_string());
        }
    }
    print(if format == Format::Json { json } else { &plain })
}
