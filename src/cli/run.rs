//! `aogauge run`

use super::{Exit, Failure, Format, json, on_gpu::OnGpu, print, tell};
use crate::{
    judge_cache::JudgeCache,
    record::{Machine, Record, RecordFolder},
    render::{
        RenderError, Renderer,
        cpu::Cpu,
        gpu::{Gpu, Persistent},
    },
    report,
    run::{Observer, Prepared},
    suite::{Plan, Platform, Suite},
};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::path::PathBuf;

/// Render a suite, measure, judge, and write a record and its report.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge run\n  aogauge run my-suite.toml --out reports/mine\n  \
aogauge run --seed 7 --renderer cpu --format json")]
pub struct Args {
    /// A built-in suite by name, or a suite file.
    #[arg(default_value = "thin-occluders")]
    suite: String,
    /// Folder for record.json, report.md and the images. An older record of that
    /// name is moved aside to NAME.previous.
    #[arg(long, default_value = "reports/latest")]
    out: PathBuf,
    /// Seed of all randomness; the suite's unless given.
    #[arg(long)]
    seed: Option<u32>,
    /// Who renders.
    #[arg(long, value_enum, default_value_t)]
    renderer: Choice,
    #[command(flatten)]
    on_gpu: OnGpu,
    /// CPU threads; all unless given. Results do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Trace the judge anew, without the images that earlier runs left in the
    /// user's cache folder, and leave none.
    #[arg(long)]
    no_cache: bool,
    /// What is printed on standard output: nothing, or the record.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Choice {
    /// The CPU, and the GPU where there is one.
    #[default]
    Auto,
    /// The CPU only.
    Cpu,
    /// The CPU, and the GPU on every case; an error where there is none.
    Gpu,
}

/// Shows a bar on a terminal, and nothing elsewhere.
pub(super) struct Bar(ProgressBar);

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

impl Observer for Bar {
    fn step(&self, done: usize, total: usize, what: &str) {
        self.0.set_length(total as u64);
        self.0.set_position(done as u64);
        self.0.set_message(what.to_owned());
    }
}

pub(super) fn bar() -> Bar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len}  {elapsed} (left {eta})  {wide_msg}") {
        bar.set_style(style);
    }
    // A step may take many seconds; the clock goes on meanwhile.
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    Bar(bar)
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let suite = Suite::load(&args.suite)?;
    let (gpu, missing) = open(args)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(threads.into());
    }
    let pool = pool.build().map_err(|e| Failure::usage(format!("cannot start {:?} threads: {e}", args.threads)))?;
    let (record, folder) = pool.install(|| render(args, &suite, gpu, &missing))?;
    report::write(folder.path(), folder.path())?;
    tell(&format!(
        "{}\n{}\n{}: {}",
        report::table::plain(&record),
        record.summary_line(),
        folder.path().join(report::FILE).display(),
        match exit(&record) {
            Exit::Pass if record.verdicts.is_empty() => "rendered; the suite has no gates",
            Exit::Pass => "pass",
            _ => "not a pass",
        },
    ));
    if args.format == Format::Json {
        print(&json(&record)?)?;
    }
    Ok(exit(&record))
}

/// Checks everything, then makes the folder, then renders.
fn render(
    args: &Args,
    suite: &Suite,
    gpu: Option<Result<Gpu, RenderError>>,
    missing: &str,
) -> Result<(Record, RecordFolder), Failure> {
    let platform = match &gpu {
        None => Platform::Cpu,
        Some(Ok(gpu)) if gpu.is_software() && args.renderer == Choice::Auto => Platform::SoftwareGpu,
        Some(_) => Platform::Gpu,
    };
    let plan = Plan::new(suite, platform, args.seed);
    let machine = match &gpu {
        None => Machine::here(missing.to_owned(), None),
        Some(Ok(gpu)) => Machine::here(gpu.describe(), Some(gpu.is_software())),
        Some(Err(e)) => Machine::here(e.to_string(), None),
    };
    let gpu = gpu.map(Persistent::new);
    let prepared = Prepared::new(&plan)?;
    let folder = RecordFolder::create(&args.out)?;
    let cache = if args.no_cache { None } else { JudgeCache::of_user() };
    let record =
        prepared.run(&Cpu, gpu.as_ref().map(|g| g as &dyn Renderer), cache.as_ref(), machine, &folder, &bar())?;
    if let Some(trouble) = &record.timing.cache_trouble {
        tell(&format!("aogauge: the judge's images are not kept for the next run: {trouble}"));
    }
    Ok((record, folder))
}

/// The GPU, or why there is none. An adapter that lacks what was asked for costs
/// the cases on it, not those on the CPU.
fn open(args: &Args) -> Result<(Option<Result<Gpu, RenderError>>, String), Failure> {
    let gpu = || match Gpu::with(args.on_gpu.options()) {
        Err(e @ (RenderError::RayQuery(_) | RenderError::Raster(_))) => Ok(Err(e)),
        gpu => gpu.map(Ok),
    };
    match args.renderer {
        Choice::Cpu => {
            args.on_gpu.refuse()?;
            Ok((None, "not asked for (--renderer cpu)".to_owned()))
        }
        Choice::Gpu => gpu().map(|g| (Some(g), String::new())).map_err(|e| Failure::usage(e.to_string())),
        Choice::Auto => Ok(match gpu() {
            Ok(gpu) => (Some(gpu), String::new()),
            // Who says how the GPU is to render wants it to.
            Err(e) if args.on_gpu.is_given() => return Err(Failure::usage(e.to_string())),
            Err(e) => (None, e.to_string()),
        }),
    }
}

fn exit(record: &Record) -> Exit {
    let s = &record.summary;
    if s.failed_cases + s.failed_judges > 0 {
        Exit::Incomplete
    } else if s.fail > 0 {
        Exit::Failed
    } else if s.inconclusive > 0 {
        Exit::Inconclusive
    } else {
        Exit::Pass
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::gpu::tests::losing;
    use std::path::Path;

    /// A device is lost while the second of four GPU cases is rendered.
    #[test]
    fn a_lost_device_costs_one_case_and_exit_code_5() {
        let text = r#"
description = "x"
scenes = ["plane"]
rays = [4, 8]
replicates = 2
converged_rays = 32
look_rays = 1
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "same"
metric = "renderer-difference"
renderers = ["gpu"]
equals = 0.0
within = 0.001
"#;
        let suite = Suite::from_toml("x", "x.toml", text, Path::new(".")).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let args = Args {
            suite: String::new(),
            out: dir.path().join("out"),
            seed: None,
            renderer: Choice::Gpu,
            threads: None,
            no_cache: true,
            on_gpu: OnGpu::default(),
            format: Format::Text,
        };
        // The first case loads, compiles and runs by then.
        let (_, folder) = render(&args, &suite, Some(Ok(losing([9]))), "").unwrap();
        let record = Record::read(folder.path()).unwrap();
        let failed: Vec<_> = record.cases.iter().filter(|c| c.error.is_some()).collect();
        assert!(failed.len() == 1 && failed[0].case.renderer == "gpu", "{failed:?}");
        assert!(failed[0].error.as_deref().unwrap().contains("the device was lost"), "{:?}", failed[0].error);
        let whole = record.cases.iter().filter(|c| c.image.is_some() && !c.metrics.is_empty()).count();
        assert_eq!((whole, record.summary.cases, record.summary.pass), (7, 8, 3));
        assert_eq!(exit(&record), Exit::Incomplete);
        assert_eq!(Exit::Incomplete as i32, 5);
    }
}
