//! What a comparison found, as a table for people.

use crate::{
    compare::{ALPHA, Comparison, Exact, LimitReport, LimitState, Outcome, PairReport, Tier, WelchReport},
    counted::counted,
    metrics::image::{NonFinite, ScoreName, Scores},
    stats,
    untrusted::logged,
};

/// All pairs in a line each with what broke, or all numbers of one.
pub(super) fn table(found: &Comparison, many: bool) -> String {
    match &found.pairs[..] {
        [one] if !many => single(one),
        pairs => list(found, pairs),
    }
}

fn single(pair: &PairReport) -> String {
    let mut text = pair.scores.as_ref().map_or_else(String::new, |s| scores(s) + "\n");
    text += &pair.exact.as_ref().map_or_else(String::new, exact);
    text += &pair.note.as_ref().map_or_else(String::new, |n| format!("note: {}\n", logged(n)));
    text += &welch(pair.welch.as_ref());
    if !pair.limits.is_empty() {
        text += &format!("\n{}\n", pair.outcome.label().to_uppercase());
        text += &pair.limits.iter().map(limit).collect::<String>();
    }
    text + &pair.reason.as_ref().map_or_else(String::new, |r| logged(r) + "\n")
}

fn list(found: &Comparison, pairs: &[PairReport]) -> String {
    // Files and layers have the names that others gave them.
    let name =
        |p: &PairReport| logged(&p.layer.as_ref().map_or_else(|| p.path.clone(), |l| format!("{} [{l}]", p.path)));
    let width = pairs.iter().map(|p| name(p).chars().count()).max().unwrap_or(0).clamp(5, 60);
    let columns = [ScoreName::Mae, ScoreName::Ssim, ScoreName::Flip];
    let mut text = format!("{:<13}{:<width$} {:>11}", "", "image", "differing");
    let has_scores = pairs.iter().any(|p| p.scores.is_some());
    if has_scores {
        text += &columns.map(|n| format!(" {:>9}", n.label())).concat();
    }
    text += "\n";
    for pair in pairs {
        text += &format!("{:<13}{:<width$}", pair.outcome.label().to_uppercase(), name(pair));
        if let Some(exact) = &pair.exact {
            text += &format!(" {:>9.4} %", 100.0 * exact.share);
        }
        if let Some(scores) = &pair.scores {
            let value = |n| scores.value(n).map_or_else(|| "–".to_owned(), |v| format!("{v:.5}"));
            text += &columns.map(|n| format!(" {:>9}", value(n))).concat();
        }
        text += "\n";
        text += &pair.limits.iter().filter(|l| l.state != LimitState::Holds).map(limit).collect::<String>();
        text += &pair.reason.as_ref().map_or_else(String::new, |r| format!("    {}\n", logged(r)));
        text += &pair.note.as_ref().map_or_else(String::new, |n| format!("    note: {}\n", logged(n)));
    }
    text += &found.missing.iter().map(|n| format!("{:<13}{}\n", "MISSING", logged(n))).collect::<String>();
    text += &found.new.iter().map(|n| format!("{:<13}{}\n", "NEW", logged(n))).collect::<String>();
    text + &summary(found)
}

fn summary(found: &Comparison) -> String {
    let kinds = [Outcome::Error, Outcome::Fail, Outcome::Inconclusive, Outcome::Warn, Outcome::Pass, Outcome::Measured];
    let counts = kinds.map(|o| (found.count(o), o.label()));
    let rest = [(found.missing.len(), "missing"), (found.new.len(), "new"), (found.left_out, "other files left out")];
    let all = counts.into_iter().chain(rest).filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}"));
    let all = all.collect::<Vec<_>>().join(", ");
    format!("\n{}: {}\n", found.outcome.label(), if all.is_empty() { "no images" } else { &all })
}

fn limit(l: &LimitReport) -> String {
    let value = l.value.map_or_else(|| logged(l.note.as_deref().unwrap_or_default()), |v| format!("{v:.6}"));
    let state = match (l.state, l.tier) {
        (LimitState::Holds, _) => "holds",
        (LimitState::Broken, Tier::Fail) => "FAIL",
        (LimitState::Broken, Tier::Warn) => "WARN",
        (LimitState::NoValue, _) => "no value",
    };
    format!("    {state:<9}{:<28} {value}\n", logged(&l.limit))
}

fn exact(found: &Exact) -> String {
    let [width, height] = found.size;
    if found.identical_files {
        return format!("identical files: {width} x {height} pixels, none differs\n");
    }
    let at = found.first.map_or_else(String::new, |[x, y]| format!(", the first at {x}, {y}"));
    let largest = found.largest.map_or_else(|| "NaN or infinity".to_owned(), |l| format!("{l:.6}"));
    format!(
        "{} of {} ({:.6} %){at}; largest difference {largest}\n",
        found.differing,
        counted(found.pixels, "pixel differs", "pixels differ"),
        100.0 * found.share
    )
}

fn scores(found: &Scores) -> String {
    let [width, height] = found.size;
    let mut text = format!(
        "{width} x {height} pixels, {}, {}; FLIP at {} pixels per degree\n\n",
        counted(found.channels, "channel", "channels"),
        found.encoding.label(),
        found.ppd
    );
    for score in &found.scores {
        let value = score.value.map_or_else(|| "–".to_owned(), |v| format!("{v:.6}"));
        let why = score.note.as_deref().unwrap_or_else(|| score.name.reading());
        text += &format!("{:<14} {value:>12}   {why}\n", score.name.label());
    }
    text += &format!(
        "\n{:<14} {:>10} {:>10} {:>10} {:>10} {:>10}  at\n",
        "map", "mean", "median", "worst 5 %", "worst 1 %", "worst"
    );
    for (name, m) in &found.maps {
        // Of SSIM the lowest values are the worst, of signed errors the largest.
        let (five, one, worst, [x, y]) = match name.as_str() {
            "ssim" => (m.p5, m.p1, m.min, m.min_at),
            "signed" if m.min.abs() > m.max.abs() => (m.p5, m.p1, m.min, m.min_at),
            _ => (m.p95, m.p99, m.max, m.max_at),
        };
        text += &format!(
            "{name:<14} {:>10.6} {:>10.6} {five:>10.6} {one:>10.6} {worst:>10.6}  {x}, {y}\n",
            m.mean, m.median
        );
    }
    text
}

fn welch(found: Option<&WelchReport>) -> String {
    let Some(found) = found else {
        return String::new();
    };
    let [reference, test] = found.replicates;
    let interval = found.interval.map_or_else(
        || "; no replicate differs, so its error is not known".to_owned(),
        |[lo, hi]| format!(", 95 % interval {lo:+.5} to {hi:+.5}"),
    );
    let mut text = format!(
        "\nWelch's test of {} against {reference}, family error {ALPHA}; bias {:+.5}{interval}\n",
        counted(test, "replicate", "replicates"),
        found.bias
    );
    for scale in &found.scales {
        let name = match scale.scale {
            stats::Scale::Pixel => "pixels",
            stats::Scale::Tile => "tiles",
            stats::Scale::Image => "image",
        };
        let surest = scale.rejected.first().map_or_else(String::new, |d| {
            let [x, y, w, h] = d.place;
            format!("; surest at {x}, {y} ({w} x {h}): bias {:+.5}, p = {:.1e}", d.bias, d.p)
        });
        // Where no replicate differs, or hardly any is there, nothing can be said.
        let sees = if scale.sees_something() {
            format!("a bias of {:.4} would have been found", scale.detectable)
        } else {
            "what bias would have been found is not known".to_owned()
        };
        text += &format!("{name:<14} {} of {} reject, {sees}{surest}\n", scale.rejected.len(), scale.tests);
    }
    text
}

/// What must not be overlooked, whatever is printed.
pub(super) fn warnings(found: &Comparison) -> Vec<String> {
    let with_scores = found.pairs.iter().filter_map(|p| Some((p, p.scores.as_ref()?.non_finite)));
    let several = found.pairs.len() > 1;
    with_scores
        .filter(|(_, n)| n.reference + n.test + n.both > 0)
        .map(|(pair, NonFinite { reference, test, both })| {
            let of = if several { format!("{}: ", logged(&pair.path)) } else { String::new() };
            format!(
                "warning: {of}NaN or infinity at {} of the reference alone, {test} of the test image alone and {both} of both; they are left out",
                counted(reference, "pixel", "pixels")
            )
        })
        .collect()
}
