//! `aogauge run --dry-run`

use crate::{
    cli::{Exit, Failure, print, tell},
    counted::counted,
    record::Record,
    run::{Prepared, Shard},
};
use std::path::Path;

/// Prints every unit with its cost, and how long all may take by what the record that
/// lies where this one would go tells of the like.
/// With `until_sure`, replicates of the suite and the most of a case, it says what that means.
pub(super) fn tell_plan(
    prepared: &Prepared<'_>,
    shard: Option<Shard>,
    out: &Path,
    until_sure: Option<[u32; 2]>,
) -> Result<Exit, Failure> {
    let steps = prepared.steps(shard);
    let earlier = Record::read(out).ok();
    let known = |unit: &str| {
        let timing = &earlier.as_ref()?.timing;
        let judge = unit.strip_suffix("/judge");
        judge.and_then(|scene| timing.judges.get(scene)).or_else(|| timing.cases.get(unit)).copied()
    };
    let (mut rays, mut seconds) = (0u64, 0.0);
    for step in &steps {
        let took = known(&step.unit);
        if let Some(took) = took {
            rays += step.rays;
            seconds += took;
        }
        let took = took.map_or_else(String::new, |s| format!("  {s:7.2} s"));
        print(&format!("{:<48} {:>9.2} M rays{took}\n", step.unit, step.rays as f64 / 1e6))?;
    }
    let total = steps.iter().map(|s| s.rays).sum::<u64>();
    let time = if rays > 0 {
        let about = seconds * total as f64 / rays as f64;
        format!("; about {about:.0} s, by the record in {}", out.display())
    } else {
        format!("; how long is not known: there is no record in {} to tell", out.display())
    };
    tell(&format!(
        "{}, {:.1} million rays{time}; nothing is rendered",
        counted(steps.len(), "unit", "units"),
        total as f64 / 1e6
    ));
    if let Some([usual, most]) = until_sure {
        tell(&format!(
            "with --until-sure this is no bound: it counts {} a case, and a case takes {} to {most}",
            counted(usual, "replicate", "replicates"),
            most.min(4)
        ));
    }
    // A shard may be empty, and is a shard all the same.
    Ok(if steps.is_empty() && shard.is_none() { Exit::Nothing } else { Exit::Pass })
}
