//! Rays a second, as tables.

use crate::{
    bench::cpu::{CpuBench, CpuRace, CpuScene, Kind},
    counted::counted,
};
use std::fmt::Write as _;

/// The heading of the page.
pub const TITLE: &str = "Rays on the CPU";

fn conditions(bench: &CpuBench) -> String {
    format!(
        "{}, {}AVX2\nmillion rays a second of CPU time, by medians of {} (by least times){}",
        bench.processor.as_deref().unwrap_or("a processor without name"),
        if bench.has_avx2 { "" } else { "no " },
        counted(bench.rounds, "round", "rounds"),
        if bench.has_embree { "; Embree 3.13: highest build quality, not robust unless named so" } else { "" }
    )
}

fn title(scene: &CpuScene) -> String {
    let triangles = counted(scene.triangles, "triangle", "triangles");
    format!("{}: {triangles}, {}", scene.name, counted(scene.points, "point", "points"))
}

fn name(race: &CpuRace) -> String {
    let kind = match race.kind {
        Kind::AnyHit => "any hit",
        Kind::Segments => "segments",
        Kind::Closest => "closest hit",
    };
    let radius = race.radius.map_or_else(String::new, |r| format!(", R = {r} m"));
    let threads = if race.threads == 1 { String::new() } else { format!(", {} threads", race.threads) };
    format!("{kind}{radius}, {} rays a point{threads}", race.rays)
}

fn over(race: &CpuRace) -> String {
    race.over_embree.map_or_else(String::new, |[median, least]| format!("{median:.2} ({least:.2})"))
}

/// For the terminal.
pub fn plain(bench: &CpuBench) -> String {
    let mut text = conditions(bench) + "\n";
    for scene in &bench.scenes {
        let _ = writeln!(text, "\n{}", title(scene));
        for race in &scene.races {
            let _ = writeln!(text, "\n  {}, {:.1} % hit", name(race), 100.0 * race.hit);
            for way in &race.ways {
                let _ = write!(text, "    {:18} {:8.2} ({:.2})", way.name, way.million_rays_a_second, way.at_best);
                let _ = match way.more_hits {
                    0 => writeln!(text),
                    n => writeln!(text, "  {n:+} hits"),
                };
            }
            if race.over_embree.is_some() {
                let _ = writeln!(text, "    ours over Embree's best: {}", over(race));
            }
        }
    }
    text
}

/// For a page.
pub fn markdown(bench: &CpuBench) -> String {
    let mut text = format!("# {TITLE}\n\n{}.\n", conditions(bench).replace('\n', ": "));
    for scene in &bench.scenes {
        let _ = writeln!(text, "\n## {}\n\n{}.", scene.name, title(scene));
        let mut columns: Vec<&str> = vec![];
        for race in &scene.races {
            let ways: Vec<&str> = race.ways.iter().map(|w| w.name.as_str()).collect();
            if columns != ways {
                let _ = writeln!(text, "\n| | {} |{}", ways.join(" | "), head(bench, " ours over Embree's best |"));
                let _ = writeln!(text, "|---|{}{}", "--:|".repeat(ways.len()), head(bench, "--:|"));
                columns = ways;
            }
            let rate = |w: &crate::bench::cpu::CpuWay| format!("{:.1} ({:.1})", w.million_rays_a_second, w.at_best);
            let rates: Vec<String> = race.ways.iter().map(rate).collect();
            let last = if bench.has_embree { format!(" {} |", over(race)) } else { String::new() };
            let _ = writeln!(text, "| {} | {} |{last}", name(race), rates.join(" | "));
        }
    }
    text + "\nAll ways trace the same rays, in turn, chunk by chunk; each thread's own CPU time counts. Drawing directions is \
inside no way's time.\n"
}

/// A column that only a bench with Embree has.
fn head<'a>(bench: &CpuBench, text: &'a str) -> &'a str {
    if bench.has_embree { text } else { "" }
}
