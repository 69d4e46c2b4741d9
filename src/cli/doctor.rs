//! `aogauge doctor`

use super::{Exit, Failure, Format, json, print};
use crate::{
    counted::counted,
    judge_cache::{self, JudgeCache},
    record::cpu_name,
    render::{
        Estimator, Geometry, Job, Renderer,
        cpu::Cpu,
        gpu::{Adapter, Gpu, Maker, System, survey},
    },
    scenes::{View, library},
};
use serde::Serialize;
use std::fmt::Write;

/// Say what aogauge finds on this machine, what it will use, and what is missing.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  aogauge doctor\n  aogauge doctor --format json\n  \
WGPU_ADAPTER_NAME=radeon aogauge doctor")]
pub struct Args {
    /// How it is printed.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Serialize)]
struct Findings {
    version: &'static str,
    verdict: String,
    /// What `run --renderer auto` does.
    auto: &'static str,
    cpu: String,
    cpu_features: Vec<&'static str>,
    threads: usize,
    /// The adapter that is used.
    gpu: Option<String>,
    gpu_is_software: Option<bool>,
    /// Why that one.
    why: Option<String>,
    /// Why there is none.
    missing: Option<String>,
    /// The adapter that would be used but cannot be opened.
    refused: Option<String>,
    /// What is wrong with the one that is used.
    trouble: Option<String>,
    adapters: Vec<Adapter>,
    /// What would be better, and how to get it.
    advice: Vec<String>,
    judge_cache: Option<Cache>,
}

#[derive(Serialize)]
struct Cache {
    folder: String,
    files: usize,
    bytes: u64,
    most_bytes: u64,
}

pub fn execute(args: &Args) -> Result<Exit, Failure> {
    let findings = Findings::here();
    print(&match args.format {
        Format::Json => json(&findings)?,
        Format::Text => findings.text(),
    })?;
    Ok(Exit::Pass)
}

impl Findings {
    fn here() -> Self {
        let mut adapters = survey();
        let gpu = Gpu::open();
        let refused = adapters.iter_mut().find(|a| a.used && gpu.is_err()).map(|chosen| {
            chosen.used = false;
            chosen.name.clone()
        });
        let trouble = gpu.as_ref().ok().and_then(|gpu| trial(gpu).err());
        let found = gpu.as_ref().ok();
        let software = found.map(Gpu::is_software);
        let (verdict, auto) = match (software, &trouble) {
            (None, _) => ("no GPU: the CPU renders".to_owned(), "the CPU renders every case"),
            (Some(_), Some(trouble)) => {
                (format!("the GPU does not work: {trouble}"), "the CPU renders every case; the GPU's cases may fail")
            }
            (Some(true), None) => (
                "works on the CPU and on a software GPU".to_owned(),
                "the CPU renders every case, the GPU those that the suite marks for software adapters",
            ),
            (Some(false), None) => {
                ("works on the CPU and on a hardware GPU".to_owned(), "the CPU and the GPU render every case")
            }
        };
        Findings {
            version: env!("CARGO_PKG_VERSION"),
            verdict,
            auto,
            cpu: cpu_name(),
            cpu_features: cpu_features(),
            threads: rayon::current_num_threads(),
            gpu: found.map(Gpu::describe),
            gpu_is_software: software,
            why: found.and_then(|_| why(&adapters)),
            missing: gpu.as_ref().err().map(ToString::to_string),
            trouble,
            advice: match &refused {
                Some(name) => vec![instead_of(name, &adapters)],
                None => advice(&adapters, System::here(), &Maker::here(), &narrowed()),
            },
            adapters,
            refused,
            judge_cache: JudgeCache::folder_of_user().map(|folder| {
                let (files, bytes) = judge_cache::usage(&folder);
                Cache { folder: folder.display().to_string(), files, bytes, most_bytes: judge_cache::MOST }
            }),
        }
    }

    fn text(&self) -> String {
        let mut page = Page(format!("aogauge {}: {}\n", self.version, self.verdict));
        let gpu = self.gpu.as_deref().or(self.missing.as_deref()).unwrap_or("none");
        page.entry("GPU", gpu);
        if let Some(why) = &self.why {
            page.entry("", why);
        }
        page.entry("run", &format!("--renderer auto: {}", self.auto));
        if self.gpu.is_some() {
            page.entry("", "--renderer gpu: the CPU and the GPU render every case");
        }
        let features =
            if self.cpu_features.is_empty() { String::new() } else { format!(", {}", self.cpu_features.join(", ")) };
        page.entry("CPU", &format!("{}, {}{features}", self.cpu, counted(self.threads, "thread", "threads")));
        let cache = self.judge_cache.as_ref().map_or_else(
            || "no folder of the user's for it: the judge is traced anew in every run".to_owned(),
            |c| {
                let files = counted(c.files, "file", "files");
                format!("{}: {files}, {} of at most {}", c.folder, bytes(c.bytes), bytes(c.most_bytes))
            },
        );
        page.entry("cache", &cache);
        for (i, adapter) in self.adapters.iter().enumerate() {
            page.0.push('\n');
            page.adapter(i + 1, adapter, self.refused.as_deref());
        }
        for (i, advice) in self.advice.iter().enumerate() {
            if i == 0 {
                page.0.push('\n');
            }
            page.entry(if i == 0 { "advice" } else { "" }, advice);
        }
        page.0
    }
}

/// Lines of at most [`COLUMNS`], a word before each entry.
struct Page(String);

const COLUMNS: usize = 100;
const INDENT: usize = 10;

impl Page {
    fn entry(&mut self, word: &str, text: &str) {
        let mut line = format!("{word:INDENT$}");
        for part in text.split_whitespace() {
            let full = line.chars().count() + 1 + part.chars().count() > COLUMNS;
            if full && line.trim_end().chars().count() > INDENT {
                self.line(&line);
                line = " ".repeat(INDENT);
            }
            if line.chars().count() > INDENT {
                line.push(' ');
            }
            line.push_str(part);
        }
        self.line(&line);
    }

    fn line(&mut self, line: &str) {
        self.0.push_str(line.trim_end());
        self.0.push('\n');
    }

    fn adapter(&mut self, number: usize, a: &Adapter, refused: Option<&str>) {
        let use_of_it = match (a.used, a.wanted) {
            (true, _) => ", used",
            (false, true) if refused == Some(&a.name) => ", chosen, but cannot be opened",
            (false, true) => "",
            (false, false) => ", passed over: WGPU_ADAPTER_NAME asks for another",
        };
        self.entry(&format!("adapter {number}"), &format!("{}{use_of_it}", a.name));
        self.entry("", &format!("{}, {}, {}", a.kind, a.backend, a.driver));
        let f = &a.features;
        let subgroups = f.subgroups.map(|[least, most]| {
            if least == most { format!("subgroups of {least}") } else { format!("subgroups of {least} to {most}") }
        });
        let (has, lacks): (Vec<_>, Vec<_>) = [
            ("timestamps", f.timestamps.then(|| "timestamps".to_owned())),
            ("subgroups", subgroups),
            ("16-bit floats", f.f16.then(|| "16-bit floats".to_owned())),
            ("ray query (only --traversal ray-query asks for it)", f.ray_query.then(|| "ray query".to_owned())),
            ("immediates", f.immediates.map(|n| format!("immediates of {n} bytes"))),
        ]
        .into_iter()
        .partition(|(_, there)| there.is_some());
        let mut line = format!("has {}", list(has.into_iter().filter_map(|(_, there)| there)));
        if !lacks.is_empty() {
            let _ = write!(line, "; lacks {}", list(lacks.into_iter().map(|(name, _)| name.to_owned())));
        }
        self.entry("", &line);
        let l = &a.limits;
        self.entry(
            "",
            &format!(
                "at most {} a binding, {} a buffer, {} and {} invocations a workgroup, textures of {} x {}",
                bytes(l.binding),
                bytes(l.buffer),
                bytes(l.workgroup_memory.into()),
                l.workgroup,
                l.texture,
                l.texture
            ),
        );
    }
}

fn list(words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    if words.is_empty() { "nothing of note".into() } else { words.join(", ") }
}

/// Bytes in the largest unit that leaves a number of at least one.
fn bytes(n: u64) -> String {
    let (unit, name) = match n {
        0..0x400 => (1.0, "bytes"),
        0x400..0x10_0000 => (1024.0, "KiB"),
        0x10_0000..0x4000_0000 => (1024.0 * 1024.0, "MiB"),
        0x4000_0000..0x100_0000_0000 => (1024.0 * 1024.0 * 1024.0, "GiB"),
        // Some drivers say so for "no limit".
        _ => return "more than a TiB".into(),
    };
    let shown = format!("{:.1}", n as f64 / unit);
    format!("{} {name}", shown.strip_suffix(".0").unwrap_or(&shown))
}

/// Renders a small image on both, so that a driver that answers but computes
/// wrongly is found here and not by a gate.
fn trial(gpu: &Gpu) -> Result<(), String> {
    let scene = library::scene("curtain-open").map_err(|e| e.to_string())?;
    let geometry = Geometry::new(&scene).map_err(|e| e.to_string())?;
    let view = View { resolution: [64, 32], ..scene.measure.view() };
    let job =
        Job { view: &view, camera: None, estimator: Estimator::CLASSIC, ao: scene.ao, rays: 8, seed: 1, replicate: 0 };
    let values = |renderer: &dyn Renderer| -> Result<Vec<f32>, String> {
        let frame = renderer.load(&geometry).and_then(|mut loaded| loaded.render(&job));
        Ok(frame.map_err(|e| e.to_string())?.values)
    };
    let (cpu, gpu) = (values(&Cpu)?, values(gpu)?);
    let differ = cpu.iter().zip(&gpu).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    if differ * 100 > cpu.len() {
        return Err(format!("{differ} of {} pixels of a test image are not the CPU's", cpu.len()));
    }
    Ok(())
}

/// Why the adapter that is used is the one.
fn why(adapters: &[Adapter]) -> Option<String> {
    let used = adapters.iter().find(|a| a.used)?;
    let wanted = adapters.iter().filter(|a| a.wanted).count();
    let narrowed = narrowed();
    let choice = match (wanted, used.kind) {
        (1, _) => "it is the only one",
        (_, "software") => "it is the first, and none is hardware",
        _ => "it is the first of the best kind: discrete, integrated, virtual, other, software",
    };
    Some(match narrowed.is_empty() {
        true => format!("chosen because {choice}; WGPU_BACKEND and WGPU_ADAPTER_NAME would narrow the choice"),
        false => format!("chosen because {choice} that {} leaves", narrowed.join(" with ")),
    })
}

/// What to do about an adapter that cannot be opened.
fn instead_of(refused: &str, adapters: &[Adapter]) -> String {
    let mend =
        format!("the CPU renders without; the driver of {refused} answers but does not work: reinstall or update it");
    match adapters.iter().find(|a| a.name != refused) {
        Some(other) => format!("{mend}, or set WGPU_ADAPTER_NAME to the name of another, such as '{}'", other.name),
        None => mend,
    }
}

/// The variables that narrow the choice, as they are set.
fn narrowed() -> Vec<String> {
    let set = |name| std::env::var(name).ok().filter(|v| !v.is_empty()).map(|v| format!("{name}={v}"));
    ["WGPU_BACKEND", "WGPU_ADAPTER_NAME"].into_iter().filter_map(set).collect()
}

/// What would be better than what there is.
fn advice(adapters: &[Adapter], system: System, makers: &[Maker], narrowed: &[String]) -> Vec<String> {
    let mut advice = Vec::new();
    let is_used = adapters.iter().any(|a| a.used);
    if !is_used && !narrowed.is_empty() {
        advice.push(format!("{} leaves no adapter: unset it to see what else there is", narrowed.join(" with ")));
    }
    if narrowed.is_empty() && adapters.iter().all(|a| a.kind == "software") {
        let hidden = |m: &Maker| {
            format!("this machine has a GPU by {}, but no driver of it answers: {}", m.name(), system.hardware(*m))
        };
        advice.extend(makers.iter().map(hidden));
    }
    if !is_used {
        advice.push(format!("the CPU renders without; for the GPU renderer and its gates, {}", system.software()));
    }
    advice
}

fn cpu_features() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    let features = [
        ("AVX2", std::arch::is_x86_feature_detected!("avx2")),
        ("FMA", std::arch::is_x86_feature_detected!("fma")),
        ("AVX-512", std::arch::is_x86_feature_detected!("avx512f")),
    ];
    #[cfg(target_arch = "aarch64")]
    let features = [("NEON", true)];
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let features: [(&str, bool); 0] = [];
    features.into_iter().filter(|(_, there)| *there).map(|(name, _)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::gpu::{Features, Limits};

    #[test]
    fn sizes_are_said_in_their_unit() {
        for (n, text) in [
            (0, "0 bytes"),
            (1023, "1023 bytes"),
            (48 << 10, "48 KiB"),
            (128 << 20, "128 MiB"),
            (3 << 29, "1.5 GiB"),
            (u64::MAX, "more than a TiB"),
        ] {
            assert_eq!(bytes(n), text);
        }
    }

    #[test]
    fn lines_end_before_the_page_does() {
        let mut page = Page(String::new());
        page.entry("word", &"twelve chars ".repeat(30));
        assert!(page.0.lines().count() > 3);
        for line in page.0.lines() {
            assert!(
                line.len() <= COLUMNS && (line.starts_with("word      t") || line.starts_with("          t")),
                "{line}"
            );
        }
    }

    #[test]
    fn advice_fits_the_machine() {
        let adapter = |kind| Adapter {
            name: "a".into(),
            kind,
            backend: "vulkan".into(),
            driver: "d".into(),
            used: true,
            wanted: true,
            features: Features { timestamps: true, subgroups: None, f16: false, ray_query: false, immediates: None },
            limits: Limits { binding: 1, buffer: 1, workgroup_memory: 1, workgroup: 1, texture: 1 },
        };
        let (hardware, software) = ([adapter("discrete"), adapter("software")], [adapter("software")]);
        assert!(advice(&hardware, System::Debian, &[Maker::Intel], &[]).is_empty());
        assert!(advice(&software, System::Debian, &[], &[]).is_empty());
        let hidden = advice(&software, System::Arch, &[Maker::Amd], &[]);
        assert!(hidden.len() == 1 && hidden[0].contains("AMD") && hidden[0].contains("vulkan-radeon"), "{hidden:?}");
        let none = advice(&[], System::Fedora, &[Maker::Nvidia], &[]);
        assert!(none[0].contains("akmod-nvidia") && none[1].contains("dnf install mesa-vulkan-drivers"), "{none:?}");
        let narrowed = advice(&[], System::Debian, &[Maker::Nvidia], &["WGPU_BACKEND=gl".to_owned()]);
        assert!(narrowed[0].contains("WGPU_BACKEND=gl") && narrowed[1].contains("apt-get"), "{narrowed:?}");
    }
}
