//! `aogauge doctor`

use super::{Exit, Failure, Format, json, print};
use crate::{record::cpu_name, render::gpu::Gpu};
use serde::Serialize;

/// Say what aogauge finds on this machine and what it will use.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  aogauge doctor")]
pub struct Args {
    /// How it is printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Serialize)]
struct Findings {
    version: &'static str,
    cpu: String,
    threads: usize,
    gpu: Option<String>,
    gpu_is_software: Option<bool>,
    missing: Option<String>,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let gpu = Gpu::open();
    let found = gpu.as_ref().ok();
    let findings = Findings {
        version: env!("CARGO_PKG_VERSION"),
        cpu: cpu_name(),
        threads: rayon::current_num_threads(),
        gpu: found.map(Gpu::describe),
        gpu_is_software: found.map(Gpu::is_software),
        missing: gpu.as_ref().err().map(ToString::to_string),
    };
    let use_of_gpu = match findings.gpu_is_software {
        Some(true) => "software adapter: `run` uses it on the cases marked for it, `run --renderer gpu` on all",
        Some(false) => "hardware: `run` uses it on every case",
        None => "`run` uses the CPU only",
    };
    let text = match args.format {
        Format::Json => json(&findings)?,
        Format::Text => format!(
            "aogauge {}\nCPU: {}, {} threads\nGPU: {}\n     {use_of_gpu}\n",
            findings.version,
            findings.cpu,
            findings.threads,
            findings.gpu.as_deref().or(findings.missing.as_deref()).unwrap_or("none"),
        ),
    };
    print(&text)?;
    Ok(Exit::Pass)
}
