//! `aogauge run`

mod dry_run;
pub(super) mod interrupt;

use super::{
    Exit, Failure, Format, json,
    on_gpu::OnGpu,
    print,
    report::{Beside, told},
    tell,
};
use crate::{
    counted::counted,
    gate::Gate,
    judge_cache::JudgeCache,
    record::{Machine, Record, RecordFolder},
    render::{
        RenderError, Renderer,
        cpu::Cpu,
        external::{ExternalError, Ready},
        gpu::{Gpu, Persistent},
    },
    report,
    run::{Means, Observer, Prepared, Shard, ShardRecord, Stop},
    suite::{Plan, Platform, Suite},
    untrusted::{line, logged},
};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::{
    path::{Path, PathBuf},
    time::Duration,
};

/// Render a suite, measure, judge, and write a record and its report.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge run\n  aogauge run my-suite.toml --out reports/mine\n  \
aogauge run --seed 7 --renderer cpu --format json\n  aogauge run --report markdown,junit,github")]
pub struct Args {
    /// A built-in suite by name, or a suite file.
    #[arg(default_value = "thin-occluders")]
    suite: String,
    /// Folder for record.json, its reports and the images. An older record or finished shard
    /// of that name is moved aside to NAME.previous, in place of the one before.
    #[arg(long, default_value = "reports/latest")]
    out: PathBuf,
    /// Seed of all randomness; the suite's unless given.
    #[arg(long)]
    seed: Option<u32>,
    /// The folder of an earlier record, for gates `against = "base"`. Of shards, give it to
    /// merge; with --until-sure to all of them, too.
    #[arg(long, value_name = "DIR")]
    base: Option<PathBuf>,
    /// There is no earlier record yet: gates against it are left out. Without this and without
    /// --base they are inconclusive.
    #[arg(long, conflicts_with = "base")]
    no_base: bool,
    /// Who renders.
    #[arg(long, value_enum, default_value_t)]
    renderer: Choice,
    #[command(flatten)]
    on_gpu: OnGpu,
    /// Only cases whose scene/estimator/renderer/rays contains this, and those that they
    /// are compared with.
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// Only a part of the run, for `aogauge merge`: K/N, or auto for what GitLab, Slurm,
    /// Kubernetes, GitHub Actions or AOGAUGE_SHARD say.
    #[arg(long, value_name = "K/N", conflicts_with_all = ["report", "image_base"])]
    shard: Option<String>,
    /// Begin with 4 replicates, and double them where a verdict or a warning is not decided
    /// yet. The error level is kept. Clear cases end early, others go beyond the suite's replicates.
    #[arg(long)]
    until_sure: bool,
    /// The most replicates of a case with --until-sure; four times the suite's unless given.
    #[arg(long, requires = "until_sure", value_parser = clap::value_parser!(u32).range(2..=1024))]
    max_replicates: Option<u32>,
    /// With --until-sure, add no replicates after so many seconds. Each case has 4 even so.
    /// What is decided then depends on how fast the machine is. A shard has this time for itself.
    #[arg(long, requires = "until_sure", value_name = "SECONDS", value_parser = seconds)]
    max_time: Option<Duration>,
    /// End the run at the first failure: a judge, an image or a case that ends with an error,
    /// or a gate that is red for sure, whatever is still to come. It is looked at after each case (with
    /// --until-sure after each look at a scene); of a shard without --until-sure, errors alone count. The
    /// record is then marked incomplete, exit code 5, unless all was done.
    #[arg(long)]
    fail_fast: bool,
    /// What renders longer than so many seconds ends with an error: the judge of a scene, a
    /// converged image, the pictures, or the replicates of a case (with --until-sure at each look). On a
    /// GPU the image at hand is waited for; the command of an external renderer is ended.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    case_timeout: Option<Duration>,
    /// Only say what would be rendered, and what it costs.
    #[arg(long)]
    dry_run: bool,
    /// Do not go on where an unfinished run of the same plan ended; begin anew.
    #[arg(long)]
    fresh: bool,
    /// CPU threads; all unless given. Results do not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Trace the judge anew, without the images that earlier runs left in the
    /// user's cache folder, and leave none.
    #[arg(long)]
    no_cache: bool,
    #[command(flatten)]
    beside: Beside,
    /// What is printed on standard output: nothing, or the record.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Choice {
    /// The CPU, the GPU where there is one, and the external renderers of the suite.
    #[default]
    Auto,
    /// The CPU only.
    Cpu,
    /// The CPU, and the GPU on every case; an error where there is none. No external
    /// renderers.
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
    fn step(&self, done: u64, total: u64, what: &str) {
        self.0.set_length(total);
        self.0.set_position(done);
        self.0.set_message(line(what));
    }
}

/// A time of a second or less is no use, and none above a day.
fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse::<f64>() {
        Ok(s) if (0.001..=86_400.0).contains(&s) => Ok(Duration::from_secs_f64(s)),
        _ => Err("give seconds, 0.001 to 86400".to_owned()),
    }
}

pub(super) fn bar() -> Bar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {percent:>3} %  {elapsed} (left {eta})  {wide_msg}") {
        bar.set_style(style);
    }
    // A step may take many seconds; the clock goes on meanwhile.
    bar.enable_steady_tick(Duration::from_millis(200));
    Bar(bar)
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    args.beside.check(args.format)?;
    let suite = Suite::load(&args.suite)?;
    let shard = args.shard.as_deref().map(named).transpose()?;
    let (gpu, missing) = open(args)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(threads.into());
    }
    let pool = pool.build().map_err(|e| Failure::usage(format!("cannot start {:?} threads: {e}", args.threads)))?;
    pool.install(|| prepare(args, &suite, shard, gpu, &missing))
}

/// The part that is asked for.
fn named(shard: &str) -> Result<Shard, Failure> {
    if shard != "auto" {
        return shard.parse().map_err(|e| Failure::usage(format!("--shard: {e}")));
    }
    let (shard, by) = Shard::of_environment(&|name| std::env::var(name).ok())
        .map_err(|e| Failure::usage(format!("--shard auto: {e}")))?;
    tell(&format!("aogauge: shard {shard}, by {by}"));
    Ok(shard)
}

/// Checks everything, then does what was asked.
fn prepare(
    args: &Args,
    suite: &Suite,
    shard: Option<Shard>,
    gpu: Option<Result<Gpu, RenderError>>,
    missing: &str,
) -> Result<Exit, Failure> {
    let platform = match &gpu {
        None => Platform::Cpu,
        Some(Ok(gpu)) if gpu.is_software() && args.renderer == Choice::Auto => Platform::SoftwareGpu,
        Some(_) => Platform::Gpu,
    };
    let mut plan = Plan::new(suite, platform, args.seed);
    if args.renderer != Choice::Auto {
        plan = plan.without_external();
    }
    plan.base = base(args.base.as_deref(), suite)?;
    plan.no_base = args.no_base;
    if args.base.is_some() && shard.is_some() && !args.until_sure {
        tell("aogauge: --base is of no use to a shard without --until-sure: give it to merge");
    }
    let most = args.max_replicates.unwrap_or_else(|| suite.file.replicates.get().saturating_mul(4).min(1024));
    plan.until_sure = args.until_sure.then_some(most);
    if let Some(filter) = &args.filter {
        plan = plan.only(filter);
        if plan.cases.is_empty() {
            let message = format!("suite '{}' has no case on this machine that contains '{filter}'", suite.name);
            return Err(Failure { exit: Exit::Nothing, message });
        }
    }
    let ready = if args.dry_run { Vec::new() } else { ready(&plan)? };
    let prepared = Prepared::new(&plan)?;
    if args.dry_run {
        let replicates = suite.file.replicates.get();
        return dry_run::tell_plan(&prepared, shard, &args.out, plan.until_sure.map(|most| [replicates, most]));
    }
    let machine = match &gpu {
        None => Machine::here(missing.to_owned(), None),
        Some(Ok(gpu)) => Machine::here(gpu.describe(), Some(gpu.is_software())),
        Some(Err(e)) => Machine::here(e.to_string(), None),
    };
    let gpu = gpu.map(Persistent::new);
    let folder = folder(args, &prepared, shard, &machine, &ready)?;
    let cache = if args.no_cache { None } else { JudgeCache::of_user() };
    let stop = Stop::default();
    interrupt::listen(&stop);
    let means = Means {
        gpu: gpu.as_ref().map(|g| g as &(dyn Renderer + Sync)),
        external: &ready,
        cache: cache.as_ref(),
        stop,
        case_timeout: args.case_timeout,
        max_time: args.max_time,
        fail_fast: args.fail_fast,
        ..Means::new(&Cpu, machine)
    };
    if let Some(shard) = shard {
        let record = prepared.run_shard(shard, &args.suite, &means, &folder, &bar())?;
        return end_of_shard(args, &record, &folder);
    }
    let record = prepared.run(&means, &folder, &bar())?;
    if let Some(trouble) = &record.timing.cache_trouble {
        tell(&format!("aogauge: the judge's images are not kept for the next run: {trouble}"));
    }
    finish(&record, &folder, &args.beside, args.format)
}

/// The external renderers of a plan, their programs found.
fn ready<'a>(plan: &Plan<'a>) -> Result<Vec<Ready<'a>>, Failure> {
    let ready = plan.external().map(|r| r.external.find());
    ready.collect::<Result<_, ExternalError>>().map_err(|e| Failure::usage(format!("suite '{}': {e}", plan.suite.name)))
}

/// The folder of the record, as an unfinished run of the same plan left it.
fn folder(
    args: &Args,
    prepared: &Prepared<'_>,
    shard: Option<Shard>,
    machine: &Machine,
    external: &[Ready<'_>],
) -> Result<RecordFolder, Failure> {
    // Another build of the program may round otherwise.
    let program = if args.fresh { None } else { crate::judge_cache::program() };
    let Some(program) = program else {
        let folder = RecordFolder::create(&args.out)?;
        tell_moved(&folder);
        return Ok(folder);
    };
    let shard = shard.map_or_else(String::new, |s| s.to_string());
    let mut plan = format!("{}\n{program}\n{shard}\n", prepared.identity(machine));
    for own in external {
        plan += &format!("{}\n", own.identity()?);
    }
    let folder = RecordFolder::resume(&args.out, &plan)?;
    tell_moved(&folder);
    if folder.is_resumed() {
        tell("aogauge: going on where an unfinished run of the same plan ended (--fresh begins anew)");
    }
    Ok(folder)
}

/// Says where the record or shard is that was in the way.
pub(super) fn tell_moved(folder: &RecordFolder) {
    if let Some(moved) = folder.moved() {
        let [from, to] = [folder.path(), moved].map(Path::display);
        tell(&format!("aogauge: what was in {from} is now in {to}"));
    }
}

/// Cases that ended with an error, and are told one by one.
const MOST_ENDED: usize = 12;

/// Says which cases ended with an error. Where the run ended early, that says why.
fn tell_ended(record: &Record) {
    if record.incomplete.is_some() {
        return;
    }
    let ended: Vec<String> =
        record.cases.iter().filter_map(|c| Some(format!("{}: {}", c.case.id(), c.error.as_ref()?))).collect();
    for why in ended.iter().take(MOST_ENDED) {
        tell(&format!("aogauge: {}", logged(why)));
    }
    if ended.len() > MOST_ENDED {
        tell(&format!(
            "aogauge: {} with an error: they are in the report",
            counted(ended.len() - MOST_ENDED, "more case ended", "more cases ended")
        ));
    }
}

/// Makes the reports, and says how it went.
pub(super) fn finish(record: &Record, folder: &RecordFolder, beside: &Beside, format: Format) -> Result<Exit, Failure> {
    for doubt in record.doubts() {
        tell(&format!("aogauge: {}", logged(&doubt)));
    }
    tell_ended(record);
    let files = beside.make(record, folder.path(), format)?;
    let exit = Exit::of(record);
    let done = if record.handed_in.is_some() { "scored" } else { "rendered" };
    let bare = format!("{done}; the suite has no gates");
    let end = match exit {
        Exit::Pass if record.verdicts.is_empty() && record.idle_gates.is_empty() => &bare,
        Exit::Pass if record.verdicts.is_empty() => "rendered; the gates wait for a base record (--no-base)",
        Exit::Nothing if record.handed_in.is_some() => {
            "nothing of the renderer was judged: no gate speaks of what was handed in; --gates FILE names gates of your own"
        }
        Exit::Nothing => "nothing was judged: the suite has gates, and none of them was held against anything",
        Exit::Pass => "pass",
        _ => "not a pass",
    };
    tell(&format!("{}\n{}\n{}", report::table::plain(record), record.summary_line(), told(&files, end)));
    if record.incomplete.is_some() {
        tell("aogauge: what is done is kept: the same command goes on from here");
    }
    if format == Format::Json {
        print(&json(record)?)?;
    }
    Ok(exit)
}

fn end_of_shard(args: &Args, record: &ShardRecord, folder: &RecordFolder) -> Result<Exit, Failure> {
    let failed = record.units.iter().filter(|d| d.error.is_some()).count();
    let end = record.incomplete.as_ref().map_or_else(String::new, |why| format!("; {}", logged(why)));
    tell(&format!(
        "shard {}: {} rendered, {failed} of them failed{end}\n{}: to be merged with the others (aogauge merge)",
        record.shard,
        counted(record.units.len(), "unit is", "units are"),
        folder.path().display()
    ));
    if args.format == Format::Json {
        print(&json(record)?)?;
    }
    Ok(if failed > 0 || record.incomplete.is_some() { Exit::Incomplete } else { Exit::Pass })
}

/// The record that gates against the base need.
pub(super) fn base(folder: Option<&Path>, suite: &Suite) -> Result<Option<Record>, Failure> {
    if folder.is_some() && !suite.gates.iter().any(Gate::is_against_base) {
        tell("aogauge: --base is of no use here: no gate of this suite is against base");
    }
    Ok(folder.map(Record::read).transpose()?)
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
            base: None,
            no_base: false,
            renderer: Choice::Gpu,
            threads: None,
            filter: None,
            shard: None,
            until_sure: false,
            max_replicates: None,
            max_time: None,
            fail_fast: false,
            case_timeout: None,
            dry_run: false,
            fresh: true,
            no_cache: true,
            on_gpu: OnGpu::default(),
            beside: Beside::default(),
            format: Format::Text,
        };
        // The first case loads, compiles and runs by then.
        let exit = prepare(&args, &suite, None, Some(Ok(losing([9]))), "").unwrap();
        let record = Record::read(&args.out).unwrap();
        let failed: Vec<_> = record.cases.iter().filter(|c| c.error.is_some()).collect();
        assert!(failed.len() == 1 && failed[0].case.renderer == "gpu", "{failed:?}");
        assert!(failed[0].error.as_deref().unwrap().contains("the device was lost"), "{:?}", failed[0].error);
        let whole = record.cases.iter().filter(|c| c.image.is_some() && !c.metrics.is_empty()).count();
        assert_eq!((whole, record.summary.cases, record.summary.pass), (7, 8, 3));
        assert_eq!(exit, Exit::Incomplete);
        assert_eq!(Exit::Incomplete as i32, 5);
    }
}
