//! The p-values of a run's verdicts: how the run as a whole looks.

use super::{
    frame::{Axis, Frame},
    legend::{Legend, Sign},
    sheet::{Anchor, INK, Sheet, Stroke, WIDTH},
};
use crate::{
    gate::{Outcome, PValue, Verdict},
    record::Record,
    report::table::outcome_text,
};

const FRAME: f64 = 240.0;
const BINS: usize = 20;

/// From the bottom of a bar to its top; light and dark take turns.
const OUTCOMES: [(Outcome, &str); 5] = [
    (Outcome::Pass, "#56b4e9"),
    (Outcome::KnownFailure, "#332288"),
    (Outcome::Warn, "#e69f00"),
    (Outcome::Inconclusive, "#555555"),
    (Outcome::Fail, "#d55e00"),
];

/// Counts by bin, the last one of those that are exactly 1, then by outcome.
type Counts = [[usize; OUTCOMES.len()]; BINS + 1];

/// Histograms of the p-values of single verdicts, before the correction over all of
/// them: that the limit is broken, and that it holds. 20 bins from 0 to 1, and one of
/// those that are exactly 1, whose value lies on the other side of the limit.
///
/// # Errors
/// Why there is nothing to draw.
pub fn p_values(record: &Record) -> Result<String, String> {
    type Of = fn(&Verdict) -> Option<PValue>;
    let panels: [(&str, Of); 2] = [
        ("p of “the limit is broken”: small where it holds", |v| v.p_holds),
        ("p of “the limit holds”: small where it is broken", |v| v.p_broken),
    ];
    let panels: Vec<(&str, Counts)> = panels.into_iter().map(|(text, of)| (text, counts(record, of))).collect();
    let most = panels.iter().flat_map(|(_, c)| c).map(|bin| bin.iter().sum::<usize>()).max().unwrap_or(0);
    if most == 0 {
        return Err("no verdict of this run has a p-value".to_owned());
    }
    let seen = |i: usize| panels.iter().any(|(_, c)| c.iter().any(|bin| bin[i] > 0));
    let entries = OUTCOMES.iter().enumerate().filter(|(i, _)| seen(*i));
    let entries = entries.map(|(_, (outcome, colour))| (Sign::Field(colour), outcome_text(*outcome).to_lowercase()));
    let legend = Legend::new(entries.collect());
    let top = legend.bottom() + 20.0;
    let mut sheet = Sheet::new(top + FRAME + 54.0, "p-values of the verdicts, each alone");
    legend.draw(&mut sheet);
    let share = WIDTH / panels.len() as f64;
    for (i, (heading, counts)) in panels.iter().enumerate() {
        let left = share * i as f64 + 74.0;
        let place = [left, top, share - 74.0 - 16.0, FRAME];
        let frame = Frame {
            place,
            // Room for the bar of exactly 1, and for the numbers over bars.
            x: Axis::linear([0.0, 1.1].into_iter(), 0.0, 6.0),
            y: Axis::linear([0.0, most as f64 * 1.08].into_iter(), 0.0, (most as f64).min(6.0)),
        };
        frame.grid(&mut sheet);
        bars(&mut sheet, &frame, counts);
        frame.axes(&mut sheet, "p-value (the bar beyond 1.0: exactly 1)", "verdicts");
        sheet.text([left, top - 8.0], heading, 14.0, Anchor::Start, INK);
    }
    Ok(sheet.finish())
}

fn counts(record: &Record, of: fn(&Verdict) -> Option<PValue>) -> Counts {
    let mut counts = Counts::default();
    for verdict in &record.verdicts {
        let Some(p) = of(verdict).map(|p| p.raw).filter(|p| (0.0..=1.0).contains(p)) else { continue };
        let Some(outcome) = OUTCOMES.iter().position(|(o, _)| *o == verdict.outcome) else { continue };
        let bin = if p == 1.0 { BINS } else { ((p * BINS as f64) as usize).min(BINS - 1) };
        counts[bin][outcome] += 1;
    }
    counts
}

fn bars(sheet: &mut Sheet, frame: &Frame, counts: &Counts) {
    for (i, bin) in counts.iter().enumerate() {
        let from = i as f64 / BINS as f64 + if i == BINS { 0.02 } else { 0.0 };
        let (left, right) = (frame.across(from), frame.across(from + 1.0 / BINS as f64));
        let mut below = 0;
        for (&n, (_, colour)) in bin.iter().zip(OUTCOMES) {
            let (bottom, top) = (frame.down(below as f64), frame.down((below + n) as f64));
            if n > 0 {
                // One of many must be seen, too.
                let height = (bottom - top).max(2.0);
                sheet.rectangle([left + 0.5, bottom - height], [right - left - 1.0, height], colour, 1.0);
                sheet.line([left + 0.5, bottom], [right - 0.5, bottom], Stroke::new("#ffffff", 0.8));
            }
            below += n;
        }
        if below > 0 {
            let at = [(left + right) / 2.0, frame.down(below as f64) - 4.0];
            sheet.text(at, &below.to_string(), 10.5, Anchor::Middle, INK);
        }
    }
}
