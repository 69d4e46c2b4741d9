//! `aogauge bench cpu`

use super::{
    super::{Exit, Failure, Format, json, run::bar, scene::load},
    check_out, hand_out,
};
use crate::{
    bench::cpu::{CpuBench, Settings, VERSION, processor, scene},
    report::bench::cpu as tables,
    run::Observer,
};
use std::path::PathBuf;

/// Count the rays that the CPU traces a second, by kind, scene and number of threads.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  aogauge bench cpu\n  aogauge bench cpu --scene atrium --scene mine.toml --threads 1,2 \
--out reports/cpu\n  aogauge bench cpu --radius 0.25 --rays 8 --rounds 9 --format json"
)]
pub struct Args {
    /// A built-in scene by name, or a scene file; may be repeated.
    #[arg(long = "scene", default_value = "atrium")]
    scenes: Vec<String>,
    /// Pixels along the side of each of six pictures about the look view's eye; a point
    /// a pixel.
    #[arg(long, default_value_t = 90, value_parser = clap::value_parser!(u32).range(16..=1024))]
    size: u32,
    /// R in metres.
    #[arg(long = "radius", value_delimiter = ',', default_value = "0.25,1", value_parser = radius)]
    radii: Vec<f32>,
    /// Rays a point that are traced together.
    #[arg(long, value_delimiter = ',', default_value = "8,32", value_parser = ["8", "16", "32"])]
    rays: Vec<String>,
    /// Threads at once.
    #[arg(long, value_delimiter = ',', default_value = "1", value_parser = clap::value_parser!(u64).range(1..=256))]
    threads: Vec<u64>,
    /// How often; rates are by medians.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    rounds: u64,
    /// Seed of all randomness.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// Folder for bench.json and bench.md; no file of others is replaced.
    #[arg(long)]
    out: Option<PathBuf>,
    /// What is printed on standard output.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

fn radius(text: &str) -> Result<f32, String> {
    let metres = text.parse().ok().filter(|r: &f32| (1e-3..=1e3).contains(r));
    metres.ok_or_else(|| "write metres from 0.001 to 1000".into())
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    check_out(args.out.as_deref(), tables::TITLE, "processor")?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    if let Some(threads) = args.threads.iter().find(|n| **n > cores as u64) {
        // Rates are by CPU time: threads that wait for a core would count as if they had one.
        return Err(Failure::usage(format!(
            "--threads is {threads}, and this machine runs {cores} at once: write 1 to {cores}"
        )));
    }
    let scenes = args.scenes.iter().map(|name| load(name)).collect::<Result<Vec<_>, _>>()?;
    let settings = Settings {
        size: args.size,
        radii: args.radii.clone(),
        rays: args.rays.iter().filter_map(|n| n.parse().ok()).collect(),
        threads: args.threads.iter().map(|&n| n as usize).collect(),
        rounds: args.rounds as usize,
        seed: args.seed,
    };
    let mut bench = CpuBench {
        version: VERSION,
        tool: env!("CARGO_PKG_VERSION").into(),
        processor: processor(),
        has_avx2: crate::trace::Tracer::new(&[]).is_fast(),
        has_embree: cfg!(feature = "embree"),
        rounds: settings.rounds,
        scenes: vec![],
    };
    let bar = bar();
    for (i, s) in scenes.iter().enumerate() {
        let step = |race: usize, of: usize| bar.step((i * of + race) as u64, (scenes.len() * of) as u64, &s.name);
        let measured = scene(s, &settings, step);
        if measured.points == 0 {
            return Err(Failure::usage(format!("{}: nothing is seen from the eye of the look view", s.name)));
        }
        bench.scenes.push(measured);
    }
    drop(bar);
    hand_out(args.out.as_deref(), args.format, &json(&bench)?, [tables::markdown(&bench), tables::plain(&bench)])?;
    Ok(Exit::Pass)
}
