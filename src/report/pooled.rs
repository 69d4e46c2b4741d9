//! The scenes taken together, as rows of a table.

use super::table::plus_minus;
use crate::{
    gate::CONFIDENCE,
    pooled::{Pool, Pooled},
    record::Record,
};
use serde::Serialize;

/// A method on one renderer with one ray count.
#[derive(Serialize)]
pub(super) struct PooledRow {
    estimator: String,
    renderer: String,
    rays: u32,
    contrast_error: String,
    contrast_error_size: String,
    removed: String,
    bias: String,
    mae: String,
    rmse: String,
    over_darkening: String,
}

/// The rows, and which scenes are in each column.
pub(super) fn rows(record: &Record) -> (Vec<PooledRow>, Vec<String>) {
    let row = |p: &Pooled| PooledRow {
        estimator: p.estimator.clone(),
        renderer: p.renderer.clone(),
        rays: p.rays,
        contrast_error: show(&p.contrast_error),
        contrast_error_size: show(&p.contrast_error_size),
        removed: show(&p.removed),
        bias: show(&p.bias),
        mae: show(&p.mae),
        rmse: show(&p.rmse),
        over_darkening: show(&p.over_darkening),
    };
    (record.pooled.iter().map(row).collect(), scenes(&record.pooled))
}

fn show(pool: &Pool) -> String {
    pool.pooled.estimate().map_or_else(|| "–".to_owned(), |e| plus_minus(e.value, e.interval(CONFIDENCE)))
}

/// What each column is taken over, a line a set of scenes, and who is left out why.
fn scenes(pooled: &[Pooled]) -> Vec<String> {
    type Column = fn(&Pooled) -> &Pool;
    let columns: [(&str, Column); 4] = [
        ("dK", |p| &p.contrast_error),
        ("removed", |p| &p.removed),
        ("errors", |p| &p.rmse),
        ("over-darkening", |p| &p.over_darkening),
    ];
    let mut lines = Vec::new();
    for (column, of) in columns {
        let mut sets: Vec<(String, Vec<String>)> = Vec::new();
        for p in pooled.iter().filter(|p| !of(p).scenes.is_empty() || !of(p).left_out.is_empty()) {
            let pool = of(p);
            let mut text = if pool.scenes.is_empty() { "no scene".to_owned() } else { pool.scenes.join(", ") };
            for out in &pool.left_out {
                text += &format!("; not {} ({})", out.scene, out.why);
            }
            let method = format!("{}/{}/{}", p.estimator, p.renderer, p.rays);
            match sets.iter_mut().find(|(t, _)| *t == text) {
                Some((_, methods)) => methods.push(method),
                None => sets.push((text, vec![method])),
            }
        }
        let one = sets.len() == 1;
        for (text, methods) in sets {
            let who = if one { String::new() } else { format!(" of `{}`", methods.join("`, `")) };
            lines.push(format!("{column}{who}: {text}"));
        }
    }
    lines
}
