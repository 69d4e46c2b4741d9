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
    /// How many are in dK, and in removed where that differs.
    scenes: String,
    contrast: String,
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
        scenes: count(p),
        contrast: show(&p.contrast),
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

/// How many scenes are in a row: `4`, or `4 / 3` where removed has fewer.
fn count(p: &Pooled) -> String {
    let (all, removed) = (p.contrast_error.scenes.len(), p.removed.scenes.len());
    let pooled = removed > 0 || !p.removed.left_out.is_empty();
    if pooled && removed != all { format!("{all} / {removed}") } else { all.to_string() }
}

fn show(pool: &Pool) -> String {
    pool.pooled.estimate().map_or_else(|| "–".to_owned(), |e| plus_minus(e.value, e.interval(CONFIDENCE)))
}

/// What each column is taken over, a line a set of scenes, and who is left out why.
fn scenes(pooled: &[Pooled]) -> Vec<String> {
    type Column = fn(&Pooled) -> &Pool;
    let columns: [(&str, Column); 5] = [
        ("K", |p| &p.contrast),
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
            let who = if one { String::new() } else { format!(" of {}", methods.join(", ")) };
            lines.push(format!("{column}{who}: {text}"));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pooled::LeftOut;

    #[test]
    fn rows_say_of_how_many_scenes_they_are() {
        let pool = |n: usize| Pool { scenes: vec!["s".to_owned(); n], ..Pool::default() };
        let row = |all, removed| Pooled {
            estimator: "e".into(),
            renderer: "cpu".into(),
            rays: 4,
            contrast: pool(all),
            contrast_error: pool(all),
            contrast_error_size: pool(all),
            removed,
            bias: pool(0),
            mae: pool(0),
            rmse: pool(0),
            over_darkening: pool(0),
        };
        let out = |n| Pool { left_out: vec![LeftOut { scene: "s".into(), why: "w".into() }], ..pool(n) };
        // Classic has no "removed" at all.
        assert_eq!(count(&row(4, pool(0))), "4");
        assert_eq!([count(&row(4, pool(4))), count(&row(4, out(3))), count(&row(4, out(0)))], ["4", "4 / 3", "4 / 0"]);
    }
}
