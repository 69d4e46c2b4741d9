//! What `aogauge bench` measured, as tables.

pub mod cpu;

use crate::{
    bench::{GpuBench, MethodBench, SceneBench},
    counted::counted,
    render::gpu::Clock,
    stats::Spread,
};
use std::fmt::Write as _;

/// The heading of the page.
pub const TITLE: &str = "AO on the GPU";

/// Median and quartiles.
fn spread(s: &Spread) -> String {
    format!("{:.3} [{:.3}, {:.3}]", s.median, s.lower, s.upper)
}

fn conditions(bench: &GpuBench) -> String {
    let clock = match bench.clock {
        Clock::TimestampQueries => "timestamp queries",
        Clock::WallClock => "the CPU's clock, for want of timestamp queries",
    };
    format!(
        "{}{}\n{} x {}, median [quartiles] of {} by {clock}, after {} to warm up",
        bench.adapter,
        if bench.is_software { ", a software adapter" } else { "" },
        bench.resolution[0],
        bench.resolution[1],
        counted(bench.rounds, "round", "rounds"),
        bench.warm_up
    )
}

fn title(scene: &SceneBench) -> String {
    format!(
        "{}: {}, R = {} m, R' = {} m, {} a surface",
        scene.name,
        counted(scene.triangles, "triangle", "triangles"),
        scene.radius,
        scene.secondary_radius,
        counted(scene.pixels, "pixel sees", "pixels see")
    )
}

/// A row's numbers: ms, ms more, millions of rays a second of all and of the
/// secondary kind.
fn cells(m: &MethodBench) -> [String; 4] {
    let rate = |r: Option<f64>| r.map_or_else(String::new, |r| format!("{r:.1}"));
    [
        spread(&m.ms),
        m.extra_ms.as_ref().map_or_else(String::new, spread),
        rate(m.million_rays_a_second),
        rate(m.million_secondary_rays_a_second),
    ]
}

/// For the terminal.
pub fn plain(bench: &GpuBench) -> String {
    let mut text = conditions(bench) + "\n";
    for scene in &bench.scenes {
        let _ = writeln!(text, "\n{}\n", title(scene));
        let _ = writeln!(
            text,
            "{:18} {:>4}  {:>26}  {:>26}  {:>8}  {:>9}",
            "", "rays", "ms", "extra ms", "Mrays/s", "secondary"
        );
        let _ = writeln!(text, "{:18} {:>4}  {:>26}", "G-buffer", 1, spread(&scene.g_buffer_ms));
        for m in &scene.methods {
            let [ms, extra, all, secondary] = cells(m);
            let _ = writeln!(text, "{:18} {:>4}  {ms:>26}  {extra:>26}  {all:>8}  {secondary:>9}", m.method, m.rays);
        }
    }
    text
}

/// For a page.
pub fn markdown(bench: &GpuBench) -> String {
    let mut text = format!("# {TITLE}\n\n{}.\n", conditions(bench).replace('\n', ": "));
    for scene in &bench.scenes {
        let _ = writeln!(text, "\n## {}\n\n{}.\n", scene.name, title(scene));
        text +=
            "| | rays a pixel | ms | ms more than classic | million rays/s, all kinds | million secondary rays/s |\n";
        text += "|---|--:|--:|--:|--:|--:|\n";
        let _ = writeln!(text, "| G-buffer | 1 | {} | | | |", spread(&scene.g_buffer_ms));
        for m in &scene.methods {
            let [ms, extra, all, secondary] = cells(m);
            let _ = writeln!(text, "| {} | {} | {ms} | {extra} | {all} | {secondary} |", m.method, m.rays);
        }
    }
    text + "\nA secondary ray is cast, twice, for each primary ray that is open; what it costs is the difference to \
classic in the same round.\n"
}
