//! What it costs to verify 1,000 small goldens that are identical to their images.
//! `cargo bench --bench golden_verify`.

#![allow(missing_docs, clippy::unwrap_used)]

use aogauge::{
    golden::{Approval, Outcome, Selection, Store},
    record::{CaseRecord, Record},
};
use divan::{Bencher, counter::ItemsCount};
use std::{fs, path::PathBuf, process::Command};
use tempfile::TempDir;

const CASES: usize = 1000;

/// A record of 1,000 cases, images of their own of one render, and goldens of them.
fn prepared() -> (TempDir, PathBuf, Record, Store) {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let suite = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/golden_verify.toml");
    let run = Command::new(env!("CARGO_BIN_EXE_aogauge"))
        .args(["run", suite, "--renderer", "cpu", "--no-cache", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    let mut record = Record::read(&out).unwrap();
    let one = record.cases[0].clone();
    record.cases = (0..CASES).map(|i| case(&one, i)).collect();
    let method = record.suite.methods["classic"].clone();
    for case in &record.cases {
        record.suite.methods.insert(case.case.estimator.clone(), method.clone());
        fs::copy(out.join(one.image.as_ref().unwrap()), out.join(case.image.as_ref().unwrap())).unwrap();
    }
    let store = Store::new(&dir.path().join("goldens"));
    let approval = Approval {
        reason: "bench",
        only: Selection::Containing(""),
        renderer: "cpu",
        name: None,
        limits: None,
        most: None,
        dry_run: false,
    };
    store.approve(&out, &record, &approval, &|_| ()).unwrap();
    (dir, out, record, store)
}

fn case(one: &CaseRecord, i: usize) -> CaseRecord {
    let mut case = one.clone();
    case.case.estimator = format!("classic-{i}");
    case.image = Some(format!("images/{i}.exr"));
    case
}

#[divan::bench(sample_count = 5)]
fn verify_1000_identical(bencher: Bencher<'_, '_>) {
    let (_dir, out, record, store) = prepared();
    bencher.counter(ItemsCount::new(CASES)).bench_local(|| {
        let found = store.verify(&out, &record, "").unwrap();
        assert_eq!(found.count(Outcome::Pass), CASES);
    });
}

fn main() {
    divan::main();
}
