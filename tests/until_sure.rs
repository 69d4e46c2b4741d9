//! A run that adds replicates until its verdicts are decided: the same on any number
//! of threads, in shards, and when it was killed in between.

#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

use serde_json::{Value, json};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    sync::LazyLock,
    time::Duration,
};

const SUITE: &str = r#"
description = "x"
scenes = ["plane", "curtain-open"]
rays = [4, 16]
replicates = 8
converged_rays = 256
look_rays = 1
judge = { precision = 1.0, paths = 1, replicates = 8, max_replicates = 8 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "plane"
metric = "openness"
region = "all"
scenes = ["plane"]
equals = 1.0
within = 0.1
[[gate]]
name = "no bias"
metric = "bias"
region = "footprint"
scenes = ["curtain-open"]
equals = 0.0
within = 0.02
"#;

static DIR: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("small.toml"), SUITE).unwrap();
    dir
});

/// The record of a run in one piece, without its times.
static WHOLE: LazyLock<Value> = LazyLock::new(|| {
    let out = out("whole");
    ok(&run(&out, &[]));
    record(&out)
});

fn out(name: &str) -> PathBuf {
    DIR.path().join(name)
}

fn command(out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
    command.current_dir(DIR.path());
    command.args(["run", "small.toml", "--renderer", "cpu", "--no-cache", "--until-sure", "--max-replicates", "64"]);
    command.args(["--out", out.to_str().unwrap()]).args(more);
    command
}

fn run(out: &Path, more: &[&str]) -> Output {
    command(out, more).output().unwrap()
}

fn ok(ended: &Output) {
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
}

fn record(out: &Path) -> Value {
    let mut record: Value = serde_json::from_str(&fs::read_to_string(out.join("record.json")).unwrap()).unwrap();
    record["timing"] = json!(null);
    record
}

/// Replicates and looks of each case of a scene.
fn counts(record: &Value, scene: &str) -> BTreeSet<(u64, u64)> {
    let cases = record["cases"].as_array().unwrap().iter().filter(|c| c["case"]["scene"] == scene);
    cases.map(|c| (c["replicates"].as_u64().unwrap(), c["looks"].as_u64().unwrap())).collect()
}

#[test]
fn clear_cases_end_early_and_others_go_on() {
    assert_eq!(counts(&WHOLE, "plane"), BTreeSet::from([(4, 1)]));
    let curtain = counts(&WHOLE, "curtain-open");
    assert!(curtain.len() == 2 && curtain.last().unwrap().0 > 8, "{curtain:?}");
    assert_eq!(WHOLE["summary"]["inconclusive"], 0);
    for (replicates, look) in curtain {
        assert_eq!(replicates, 4 << (look - 1));
    }
}

#[test]
fn the_same_verdicts_on_any_number_of_threads_and_in_shards() {
    let one = out("one-thread");
    ok(&run(&one, &["--threads", "1"]));
    assert_eq!(record(&one), *WHOLE);
    let parts: Vec<PathBuf> = (1..=3).map(|k| out(&format!("part-{k}"))).collect();
    for (k, part) in (1..).zip(&parts) {
        ok(&run(part, &["--shard", &format!("{k}/3")]));
    }
    let merged = out("merged");
    let mut merge = Command::new(env!("CARGO_BIN_EXE_aogauge"));
    ok(&merge.current_dir(DIR.path()).arg("merge").args(&parts).arg("--out").arg(&merged).output().unwrap());
    assert_eq!(record(&merged), *WHOLE);
}

#[test]
fn killed_in_between_it_goes_on_to_the_same_record() {
    let out = out("killed");
    let mut killed = 0;
    for moment in 0..10u64 {
        let mut child = command(&out, &[]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(30 + moment * 40));
        killed += usize::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
        if out.join("record.json").exists() {
            break;
        }
    }
    assert!(killed > 0);
    ok(&run(&out, &[]));
    assert_eq!(record(&out), *WHOLE);
}

#[test]
fn a_budget_ends_it_undecided() {
    let some = out("budget");
    let ended = run(&some, &["--max-time", "0.001"]);
    assert_eq!(ended.status.code(), Some(6), "{}", String::from_utf8_lossy(&ended.stderr));
    let record = record(&some);
    assert_eq!(counts(&record, "curtain-open"), BTreeSet::from([(4, 1)]));
    assert!(record["summary"]["inconclusive"].as_u64().unwrap() > 0);
}

/// The converged image is of 4 replicates of 4 rays: its noise alone keeps the verdict
/// open, and to add replicates to the case is in vain.
#[test]
fn it_ends_where_replicates_cannot_decide() {
    let [suite, out] = ["floor.toml", "floor"].map(|n| DIR.path().join(n));
    let head = SUITE.split("[[gate]]").next().unwrap();
    let head = head.replace("rays = [4, 16]", "rays = [4]").replace("converged_rays = 256", "converged_rays = 16");
    let gate = "[[gate]]\nname = \"no bias\"\nmetric = \"bias\"\nregion = \"footprint\"\n\
                scenes = [\"curtain-open\"]\nequals = 0.0\nwithin = 0.0095\n";
    fs::write(&suite, head.replace("\"plane\", ", "") + gate).unwrap();
    let run = |name: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
        command.current_dir(DIR.path()).args(["run", "floor.toml", "--renderer", "cpu", "--no-cache", "--until-sure"]);
        command.args(["--max-replicates", "1024", "--out", name]).output().unwrap()
    };
    let ended = run("floor");
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(6), "{stderr}");
    let record = record(&out);
    assert!(counts(&record, "curtain-open").iter().all(|(n, _)| *n <= 256), "{:?}", counts(&record, "curtain-open"));
    let open = record["verdicts"].as_array().unwrap().iter().filter(|v| v["outcome"] == "inconclusive");
    for verdict in open {
        assert!(verdict["floor"]["se"].as_f64() > Some(0.0) && verdict["floor"]["df"] == 3.0, "{verdict:#}");
        let reason = verdict["reason"].as_str().unwrap();
        assert!(reason.contains("would not decide: the noise of the converged image is too large"), "{reason}");
    }
}
