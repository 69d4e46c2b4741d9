//! What must be known of images that were handed in, or that external renderers left, a sentence each.

use crate::record::{Intervals, Record, Shows};

/// What is said of a record of such images before its numbers; nothing of our own.
pub fn notes(record: &Record) -> Vec<String> {
    let Some(by) = &record.handed_in else { return record.doubts() };
    let mut notes = vec![format!(
        "These are images of the renderer '{}', handed in and scored against the kit {}. Nothing was rendered here; pictures \
         from the look view are the kit's own.",
        by.renderer, by.kit
    )];
    if let Some(c) = &by.curve {
        let fitted = match &c.rmse {
            Some([before, after]) => format!(
                ", fitted on {}: the difference from the references falls from {before:.4} to {after:.4} (RMSE over classes of equal openness)",
                c.scenes.join(", ")
            ),
            None => ", as it was declared".to_owned(),
        };
        notes.push(format!(
            "An intensity curve was undone, {:.3} times openness to the power {:.3}{fitted}.",
            c.gain, c.exponent
        ));
    }
    notes.extend(by.warnings.iter().cloned());
    let of = |intervals: Intervals, shows: Option<Shows>| {
        let sources = record.cases.iter().filter_map(|c| Some((c.case.id(), c.source.as_ref()?)));
        let own = sources.filter(move |(_, s)| s.intervals == intervals && shows.is_none_or(|w| w == s.shows));
        own.map(|(id, _)| id).collect::<Vec<_>>()
    };
    let tiles = of(Intervals::Tiles, None);
    if !tiles.is_empty() {
        notes.push(format!(
            "One frame alone was handed in of {}: intervals are taken over its tiles (block bootstrap). They hold the noise within \
             that frame, not what differs from frame to frame; several frames with seeds of their own are surer.",
            tiles.join(", ")
        ));
    }
    notes.extend(record.doubts());
    notes
}
