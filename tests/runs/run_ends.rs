//! What ends a run before all is rendered: a gate that is red for sure, time, and who asks
//! it to.

use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Child, Command, Output, Stdio},
    time::{Duration, Instant},
};

const SUITE: &str = r#"
description = "x"
scenes = ["plane", "curtain-open"]
rays = [4, 8]
replicates = 4
converged_rays = 64
look_rays = 1
[judge]
precision = 1.0
paths = 1
replicates = 8
max_replicates = 8
[[estimator]]
name = "classic"
kind = "classic"
[[gate]]
name = "limit"
metric = "openness"
region = "all"
scenes = ["plane"]
"#;

fn command(folder: &Path, suite: &str, more: &str) -> Command {
    fs::write(folder.join("suite.toml"), suite).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
    command.current_dir(folder).args(["run", "suite.toml", "--renderer", "cpu", "--no-cache", "--out", "out"]);
    command.args(more.split_whitespace());
    command
}

/// Runs a suite, and returns its exit code and record.
fn run(suite: &str, more: &str) -> (Option<i32>, Value) {
    let dir = tempfile::tempdir().unwrap();
    let ended = command(dir.path(), suite, more).output().unwrap();
    (ended.status.code(), record(dir.path(), &ended))
}

fn record(folder: &Path, ended: &Output) -> Value {
    let text = fs::read_to_string(folder.join("out/record.json"));
    serde_json::from_str(&text.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&ended.stderr)))).unwrap()
}

fn rendered(record: &Value) -> usize {
    record["cases"].as_array().unwrap().iter().filter(|c| c["error"].is_null()).count()
}

/// An open plane reads 1 in every replicate, so that one case is enough.
#[test]
fn fail_fast_ends_at_the_first_gate_that_is_red() {
    let red = format!("{SUITE}max = 0.5");
    for (more, by_then) in [("--fail-fast", 1), ("--fail-fast --until-sure", 2)] {
        let (code, record) = run(&red, more);
        assert_eq!((code, rendered(&record)), (Some(5), by_then), "{record}");
        let incomplete = record["incomplete"].as_str().unwrap();
        let says = "it ended at the first failure (--fail-fast): plane/classic/cpu/4 fails 'limit'";
        assert_eq!(incomplete, says);
        assert_eq!([&record["verdicts"][0]["gate"], &record["verdicts"][0]["outcome"]], ["limit", "fail"]);
    }
    let (code, record) = run(&red, "");
    assert_eq!((code, rendered(&record)), (Some(1), 4));
    // A known failure that is one ends nothing; one that is mended does.
    let known = |limit: &str| format!("{SUITE}{limit}\nknown_failure = 'so it is'");
    let (code, record) = run(&known("max = 0.5"), "--fail-fast");
    assert_eq!((code, rendered(&record)), (Some(0), 4), "{record}");
    let (code, record) = run(&known("min = 0.5"), "--fail-fast");
    assert_eq!((code, rendered(&record)), (Some(5), 1), "{record}");
}

/// Whatever is not sure yet does not end it, and what ends it stays red: the record up to
/// the failure agrees with that of the whole run.
#[test]
fn fail_fast_needs_evidence() {
    let suite = |max: f64| {
        SUITE
            .replace("scenes = [\"plane\"]", "scenes = [\"curtain-open\"]")
            .replace("region = \"all\"", "region = \"footprint\"")
            + &format!("rays = [4]\nmax = {max}")
    };
    let (_, whole) = run(&suite(0.5), "");
    let first = whole["verdicts"].as_array().unwrap().iter().find(|v| v["case"]["rays"] == 4).unwrap();
    let [value, se] = ["value", "se"].map(|n| first["metric"][n].as_f64().unwrap());
    assert!(se > 0.0);
    let (code, record) = run(&suite(value - se), "--fail-fast");
    assert!(code == Some(6) && rendered(&record) == 4 && record["incomplete"].is_null(), "{record}");
    let (code, record) = run(&suite(value - 100.0 * se), "--fail-fast");
    assert!(code == Some(5) && rendered(&record) == 3, "{record}");
    assert_eq!(record["verdicts"][0]["outcome"], "fail");
}

/// A judge whose first image takes minutes.
fn slow() -> String {
    let judge = SUITE.replace("paths = 1", "paths = 16384").replace("precision = 1.0", "precision = 0.0001");
    format!("{judge}min = 0.5")
}

/// Waits for a run, which must end within some time.
fn wait(mut child: Child, most: Duration) -> Output {
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > most {
            child.kill().unwrap();
            child.wait().unwrap();
            panic!("it did not end within {most:?}");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    child.wait_with_output().unwrap()
}

#[test]
fn the_judge_is_given_no_more_time_than_a_case() {
    let dir = tempfile::tempdir().unwrap();
    let child = command(dir.path(), &slow(), "--case-timeout 1").stderr(Stdio::piped()).spawn().unwrap();
    let ended = wait(child, Duration::from_secs(20));
    let record = record(dir.path(), &ended);
    assert_eq!(ended.status.code(), Some(5));
    let scene = &record["scenes"].as_array().unwrap()[1];
    let why = scene["judge_error"].as_str().unwrap();
    assert!(why.contains("longer than 1 s (--case-timeout): 0 of 8 replicates of the judge"), "{why}");
    // The others are what they would be.
    assert_eq!((rendered(&record), record["summary"]["failed_judges"].as_u64()), (4, Some(1)));
}

#[cfg(unix)]
#[test]
fn a_run_that_is_asked_to_end_does_so_while_the_judge_is_traced() {
    let dir = tempfile::tempdir().unwrap();
    let child = command(dir.path(), &slow(), "--filter curtain-open").stderr(Stdio::piped()).spawn().unwrap();
    while !dir.path().join("out/.aogauge-run").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(Duration::from_millis(500));
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let ended = wait(child, Duration::from_secs(8));
    let record = record(dir.path(), &ended);
    assert_eq!(ended.status.code(), Some(5));
    assert_eq!(record["incomplete"], "it was interrupted");
}
