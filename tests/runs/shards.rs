//! A run that is cut short and goes on, and one that is divided and merged: both come
//! to the record of a run that is neither.

use serde_json::{Value, json};
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::LazyLock,
    time::{Duration, Instant},
};

const SUITE: &str = r#"
description = "x"
scenes = ["plane", "curtain-open"]
rays = [4, 8]
replicates = 4
converged_rays = 64
golden_rays = 8
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
"#;

struct Whole {
    dir: tempfile::TempDir,
    files: BTreeMap<PathBuf, Vec<u8>>,
    took: Duration,
}

/// The record of a run in one piece.
static WHOLE: LazyLock<Whole> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("small.toml"), SUITE).unwrap();
    let out = dir.path().join("whole");
    let began = Instant::now();
    assert!(run(dir.path(), &out, &[]).status.success());
    let took = began.elapsed();
    let files = files(&out);
    Whole { dir, files, took }
});

fn aogauge(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
    command.current_dir(folder).args(args);
    command
}

fn command(folder: &Path, out: &Path, more: &[&str]) -> Command {
    let out = out.to_str().unwrap();
    let mut command = aogauge(folder, &["run", "small.toml", "--renderer", "cpu", "--no-cache", "--out", out]);
    command.args(more);
    command
}

fn run(folder: &Path, out: &Path, more: &[&str]) -> Output {
    command(folder, out, more).output().unwrap()
}

/// Every file of a folder but reports, which hold times; the record without its times.
fn files(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![out.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let mut bytes = fs::read(&path).unwrap();
            if path.ends_with("record.json") {
                let mut record: Value = serde_json::from_slice(&bytes).unwrap();
                record["timing"] = json!(null);
                bytes = record.to_string().into_bytes();
            }
            // These show the times.
            if !path.ends_with("report.md") && !path.ends_with("pictures/cost.svg") {
                found.insert(path.strip_prefix(out).unwrap().to_owned(), bytes);
            }
        }
    }
    found
}

fn same(out: &Path) {
    let (own, whole) = (files(out), &WHOLE.files);
    assert_eq!(own.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    for (path, bytes) in &own {
        assert!(bytes == &whole[path], "{} differs", path.display());
    }
}

/// Whether the folder would be taken for a finished record.
fn looks_whole(out: &Path) -> bool {
    let Ok(text) = fs::read_to_string(out.join("record.json")) else { return false };
    let record: Value = serde_json::from_str(&text).unwrap();
    record.get("incomplete").is_none()
}

fn kill_after(mut child: Child, after: Duration) -> bool {
    std::thread::sleep(after);
    let killed = child.try_wait().unwrap().is_none();
    child.kill().unwrap();
    child.wait().unwrap();
    killed
}

fn quiet(command: &mut Command) -> Child {
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

#[test]
fn a_run_killed_at_any_moment_goes_on_to_the_same_record() {
    let dir = WHOLE.dir.path();
    let out = dir.join("killed");
    let (mut killed, mut resumed) = (0, 0);
    // 50 moments spread over the time of a run; each goes on from the one before until
    // a run is through, so that some are killed while they read what is there. Every
    // other one counts from when units begin to be kept: however slow the machine is,
    // some leave something.
    for moment in 0..50u32 {
        let mut child = quiet(&mut command(dir, &out, &[]));
        let units = out.join(".aogauge-run/units");
        while moment % 2 == 1 && !units.exists() && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(1));
        }
        killed += usize::from(kill_after(child, WHOLE.took * (moment * 37 % 100) / 120));
        if looks_whole(&out) {
            same_but_report(&out);
            fs::remove_dir_all(&out).unwrap();
        } else if out.join(".aogauge-run/units").exists() {
            resumed += 1;
        }
    }
    assert!(killed >= 20 && resumed >= 10, "{killed} killed, {resumed} left something");
    let last = run(dir, &out, &[]);
    assert!(last.status.success(), "{}", String::from_utf8_lossy(&last.stderr));
    same(&out);
}

/// A run killed after its record was committed may lack pictures of the report, and leave
/// the file that it was just writing under its temporary name.
fn same_but_report(out: &Path) {
    let of_run = |path: &Path| path.starts_with("pictures") || path.starts_with(".aogauge-run");
    let is_part = |path: &Path| path.extension().is_some_and(|end| end == "part");
    let own = files(out);
    for (path, bytes) in own.iter().filter(|(path, _)| !of_run(path) && !is_part(path)) {
        assert!(Some(bytes) == WHOLE.files.get(path), "{} differs, or is only here", path.display());
    }
    for path in WHOLE.files.keys().filter(|path| !of_run(path)) {
        assert!(own.contains_key(path), "{} is missing", path.display());
    }
}

#[test]
fn what_was_damaged_meanwhile_is_rendered_again() {
    let dir = WHOLE.dir.path();
    let out = dir.join("damaged");
    let image = out.join("images/curtain-open/extended.cpu.8.exr");
    let mut child = quiet(&mut command(dir, &out, &[]));
    while !out.join(".aogauge-run/units/curtain-open+extended+cpu+8.json").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the run was through before it could be killed");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    if out.join(".aogauge-run").exists() {
        let mut bytes = fs::read(&image).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&image, bytes).unwrap();
    }
    let again = run(dir, &out, &[]);
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    same(&out);
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_a_record_marked_incomplete_and_can_go_on() {
    let dir = WHOLE.dir.path();
    let out = dir.join("interrupted");
    let child = command(dir, &out, &[]).stderr(Stdio::piped()).spawn().unwrap();
    while !out.join(".aogauge-run/units/plane+look.json").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let ended = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(5), "{stderr}");
    assert!(stderr.contains("the same command goes on from here"), "{stderr}");
    let record: Value = serde_json::from_str(&fs::read_to_string(out.join("record.json")).unwrap()).unwrap();
    assert_eq!(record["incomplete"], "it was interrupted");
    assert!(fs::read_to_string(out.join("report.md")).unwrap().contains("INCOMPLETE"));
    let again = run(dir, &out, &[]);
    assert!(String::from_utf8_lossy(&again.stderr).contains("going on where an unfinished run"));
    same(&out);
}

/// As a script's background job has it, and `nohup`.
#[cfg(unix)]
#[test]
fn ignored_signals_do_not_keep_a_scheduler_from_ending_a_run() {
    let dir = WHOLE.dir.path();
    let out = dir.join("background");
    let line = format!(
        "trap '' INT HUP; exec {} run small.toml --renderer cpu --no-cache --out {}",
        env!("CARGO_BIN_EXE_aogauge"),
        out.display()
    );
    let child = Command::new("sh").args(["-c", &line]).current_dir(dir).stderr(Stdio::piped()).spawn().unwrap();
    let kill = |signal: &str| Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    while !out.join(".aogauge-run/units/plane+look.json").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(kill("-HUP").success() && kill("-TERM").success());
    let ended = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&ended.stderr);
    // A hang-up that was listened to would have made the other signal end it at once.
    assert!(ended.status.code() == Some(5) && stderr.contains("goes on from here"), "{:?}: {stderr}", ended.status);
    assert!(run(dir, &out, &[]).status.success());
    same(&out);
}

#[test]
fn one_run_at_a_time_fills_a_folder() {
    let dir = WHOLE.dir.path();
    let out = dir.join("shared");
    let mut child = quiet(&mut command(dir, &out, &[]));
    while !out.join(".aogauge-run/units/plane+look.json").exists() {
        std::thread::sleep(Duration::from_millis(1));
    }
    let second = run(dir, &out, &[]);
    let stderr = String::from_utf8_lossy(&second.stderr);
    assert_eq!(second.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("another run is writing into this folder"), "{stderr}");
    assert!(child.wait().unwrap().success());
    same(&out);
}

/// Renders all shards of so many; returns their folders.
fn shards(of: u32, name: &str, more: &[&str]) -> Vec<PathBuf> {
    let dir = WHOLE.dir.path();
    let one = |k: u32| {
        let out = dir.join(format!("{name}-{k}"));
        let part = run(dir, &out, &[&["--shard", &format!("{k}/{of}")], more].concat());
        assert!(part.status.success(), "{}", String::from_utf8_lossy(&part.stderr));
        out
    };
    (1..=of).map(one).collect()
}

fn merge(shards: &[PathBuf], out: &str) -> Output {
    let mut args = vec!["merge", "--out", out];
    args.extend(shards.iter().map(|s| s.to_str().unwrap()));
    aogauge(WHOLE.dir.path(), &args).output().unwrap()
}

#[test]
fn merged_shards_are_the_whole() {
    let dir = WHOLE.dir.path();
    let mut parts = shards(3, "part", &[]);
    // Machines may see the same suite under other names of its folder.
    let path = parts[1].join("shard.json");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("\"suite\": \"small.toml\""));
    fs::write(&path, text.replace("\"suite\": \"small.toml\"", "\"suite\": \"/data/small.toml\"")).unwrap();
    parts.rotate_left(1);
    let merged = merge(&parts, "merged");
    assert!(merged.status.success(), "{}", String::from_utf8_lossy(&merged.stderr));
    same(&dir.join("merged"));
    // A shard is no record.
    let report = aogauge(dir, &["report", "part-1"]).output().unwrap();
    assert!(String::from_utf8_lossy(&report.stderr).contains("it is a shard: merge it"));

    let refused = |parts: &[PathBuf], code: i32, says: &str| {
        let merged = merge(parts, "refused");
        let stderr = String::from_utf8_lossy(&merged.stderr);
        assert_eq!(merged.status.code(), Some(code), "{stderr}");
        assert!(stderr.contains(says), "{stderr}");
        assert!(!dir.join("refused/record.json").exists());
    };
    refused(&parts[1..], 5, "of 3 shards 1 is missing: 2");
    refused(&[&parts[..], &parts[..1]].concat(), 2, "are both shard 2/3");
    // Another commit of the same version may trace otherwise.
    let of_other_build = |path: &Path| {
        let mut shard: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
        assert!(shard["build"].as_str().is_some_and(|b| b.len() == 64));
        shard["build"] = json!("0".repeat(64));
        shard.to_string()
    };
    let own: Vec<String> = parts.iter().map(|p| fs::read_to_string(p.join("shard.json")).unwrap()).collect();
    fs::write(parts[0].join("shard.json"), of_other_build(&parts[0].join("shard.json"))).unwrap();
    refused(&parts, 2, "their build of aogauge differs");
    for part in &parts[1..] {
        fs::write(part.join("shard.json"), of_other_build(&part.join("shard.json"))).unwrap();
    }
    refused(&parts, 2, "by another build of aogauge than this one");
    for (part, own) in parts.iter().zip(own) {
        fs::write(part.join("shard.json"), own).unwrap();
    }
    let other = shards(3, "seed", &["--seed", "7"]);
    refused(&[&parts[1..], &other[1..2]].concat(), 2, "are not of one run: their seed differs");
    let four = shards(4, "four", &[]);
    refused(&[&parts[..1], &four[..1]].concat(), 2, "number of shards differs");

    let hidden = parts.iter().find(|p| p.join(".aogauge-run/images").exists()).unwrap();
    fs::rename(hidden.join(".aogauge-run"), dir.join("left-behind")).unwrap();
    refused(&parts, 2, "the hidden folder .aogauge-run of the shard is not in it");
    fs::rename(dir.join("left-behind"), hidden.join(".aogauge-run")).unwrap();

    let image = walk(&parts[0]);
    let mut bytes = fs::read(&image).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&image, bytes).unwrap();
    refused(&parts, 2, "it was damaged or replaced");
    // A record that is there stays as it was.
    let onto = merge(&parts, "merged");
    assert_eq!(onto.status.code(), Some(2));
    assert!(!dir.join("merged.previous").exists());
    same(&dir.join("merged"));
    fs::remove_file(&image).unwrap();
    refused(&parts, 2, "cannot read the file");
    fs::write(dir.join("changed.toml"), SUITE.replace("look_rays = 1", "look_rays = 2")).unwrap();
    let changed = aogauge(dir, &["merge", "--suite", "changed.toml", "four-1", "four-2", "four-3", "four-4"]).output();
    let changed = changed.unwrap();
    assert!(String::from_utf8_lossy(&changed.stderr).contains("is not what the shards were rendered from"));
}

/// Some image of a case in a shard.
fn walk(folder: &Path) -> PathBuf {
    let images = fs::read_dir(folder.join("images")).unwrap().map(|e| e.unwrap().path());
    let mut all: Vec<PathBuf> = images.flat_map(|f| fs::read_dir(f).unwrap().map(|e| e.unwrap().path())).collect();
    all.sort();
    all.into_iter().find(|p| p.extension().is_some_and(|e| e == "exr")).unwrap()
}

#[test]
fn the_environment_names_the_shard() {
    let dir = WHOLE.dir.path();
    let part = |variables: &[(&str, &str)]| {
        let out = dir.join("environment");
        let _ = fs::remove_dir_all(&out);
        let mut command = command(dir, &out, &["--shard", "auto", "--dry-run"]);
        for (name, _) in std::env::vars() {
            if ["AOGAUGE_SHARD", "CI_NODE_", "SLURM_", "JOB_COMPLETION", "MATRIX_"].iter().any(|p| name.starts_with(p))
            {
                command.env_remove(name);
            }
        }
        let ended = command.envs(variables.iter().copied()).output().unwrap();
        (ended.status.code().unwrap(), String::from_utf8(ended.stderr).unwrap())
    };
    for (variables, says) in [
        (vec![("AOGAUGE_SHARD", "2/5")], "shard 2/5, by AOGAUGE_SHARD"),
        (vec![("CI_NODE_INDEX", "2"), ("CI_NODE_TOTAL", "5")], "shard 2/5, by GitLab"),
        (
            vec![("SLURM_ARRAY_TASK_ID", "1"), ("SLURM_ARRAY_TASK_COUNT", "5"), ("SLURM_ARRAY_TASK_MIN", "0")],
            "shard 2/5, by Slurm",
        ),
        (vec![("JOB_COMPLETION_INDEX", "1"), ("JOB_COMPLETIONS", "5")], "shard 2/5, by Kubernetes"),
        (vec![("MATRIX_INDEX", "1"), ("MATRIX_TOTAL", "5")], "shard 2/5, by GitHub Actions"),
        // A job of GitLab that is not parallel starts a Slurm array.
        (
            vec![("CI_NODE_TOTAL", "1"), ("SLURM_ARRAY_TASK_ID", "4"), ("SLURM_ARRAY_TASK_COUNT", "5")],
            "shard 5/5, by Slurm",
        ),
        (vec![("AOGAUGE_SHARD", ""), ("MATRIX_INDEX", "1"), ("MATRIX_TOTAL", "5")], "shard 2/5, by GitHub Actions"),
    ] {
        let (code, stderr) = part(&variables);
        assert!(code == 0 && stderr.contains(says), "{stderr}");
    }
    for (variables, says) in [
        (vec![], "no shard is named by the environment"),
        (vec![("CI_NODE_INDEX", "2")], "CI_NODE_TOTAL is not"),
        (vec![("AOGAUGE_SHARD", "6/5")], "'6/5' is no shard"),
        (vec![("JOB_COMPLETION_INDEX", "5"), ("JOB_COMPLETIONS", "5")], "the index must go from 0"),
        (
            vec![("CI_NODE_INDEX", "2"), ("CI_NODE_TOTAL", "5"), ("MATRIX_INDEX", "2"), ("MATRIX_TOTAL", "5")],
            "GitLab says shard 2/5, GitHub Actions says 3/5",
        ),
        (vec![("JOB_COMPLETION_INDEX", "x"), ("JOB_COMPLETIONS", "5")], "not a number"),
    ] {
        let (code, stderr) = part(&variables);
        assert!(code == 2 && stderr.contains(says), "{stderr}");
    }
}

#[test]
fn a_plan_is_told_filtered_and_ended_early() {
    let dir = WHOLE.dir.path();
    let told = run(dir, &dir.join("nowhere"), &["--dry-run"]);
    let stdout = String::from_utf8(told.stdout).unwrap();
    // 2 scenes x (2 methods x 2 ray counts + 2 converged + look), and one judge.
    assert_eq!((told.status.code(), stdout.lines().count()), (Some(0), 15), "{stdout}");
    assert!(stdout.contains("curtain-open/judge") && !dir.join("nowhere").exists());
    let known = run(dir, &dir.join("whole"), &["--dry-run"]);
    assert!(String::from_utf8_lossy(&known.stderr).contains("by the record in"));

    // Of one case, with the classic case it is compared with.
    let out = dir.join("filtered");
    let some = run(dir, &out, &["--filter", "curtain-open/extended/cpu/8"]);
    let stderr = String::from_utf8_lossy(&some.stderr);
    // The one gate is on another scene.
    assert!(some.status.code() == Some(4) && stderr.contains("nothing was judged"), "{stderr}");
    let record: Value = serde_json::from_str(&fs::read_to_string(out.join("record.json")).unwrap()).unwrap();
    let whole: Value =
        serde_json::from_str(std::str::from_utf8(&WHOLE.files[Path::new("record.json")]).unwrap()).unwrap();
    let ids =
        |r: &Value| -> Vec<String> { r["cases"].as_array().unwrap().iter().map(|c| c["case"].to_string()).collect() };
    assert_eq!((ids(&record).len(), ids(&whole).len()), (2, 8));
    let of = |r: &Value| {
        r["cases"]
            .as_array()
            .unwrap()
            .iter()
            .find(|c| {
                c["case"]["estimator"] == "extended" && c["case"]["rays"] == 8 && c["case"]["scene"] == "curtain-open"
            })
            .unwrap()
            .clone()
    };
    assert_eq!(of(&record), of(&whole));
    assert_eq!(record["filter"], "curtain-open/extended/cpu/8");
    assert_eq!(run(dir, &dir.join("none"), &["--filter", "curtain-closed"]).status.code(), Some(4));

    // Nothing is done within a millisecond; the first that fails ends the run.
    let late = "plane/converged/classic: it took longer than 0.001 s (--case-timeout): 0 of 4 replicates";
    let slow = run(dir, &dir.join("slow"), &["--case-timeout", "0.001", "--fail-fast"]);
    let stderr = String::from_utf8_lossy(&slow.stderr);
    assert_eq!(slow.status.code(), Some(5), "{stderr}");
    let record: Value = serde_json::from_str(&fs::read_to_string(dir.join("slow/record.json")).unwrap()).unwrap();
    let incomplete = record["incomplete"].as_str().unwrap();
    assert!(incomplete.contains("at the first failure (--fail-fast): ") && incomplete.contains(late), "{stderr}");
    let part = run(dir, &dir.join("slow-part"), &["--case-timeout", "0.001", "--fail-fast", "--shard", "1/1"]);
    let stderr = String::from_utf8_lossy(&part.stderr);
    assert!(part.status.code() == Some(5) && stderr.contains(late), "{stderr}");
}

/// More shards than units: one without is done as soon as it begins.
#[test]
fn an_empty_shard_is_a_shard() {
    let dir = WHOLE.dir.path();
    let out = dir.join("empty");
    let empty = (1..=64).map(|k| format!("{k}/64")).find(|shard| {
        let told = run(dir, &out, &["--shard", shard, "--dry-run"]);
        assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stderr));
        told.stdout.is_empty()
    });
    assert_eq!(run(dir, &out, &["--shard", &empty.unwrap()]).status.code(), Some(0));
}

#[test]
fn the_schema_names_what_a_shard_holds() {
    let dir = WHOLE.dir.path();
    let out = dir.join("described");
    let ended = run(dir, &out, &["--shard", "1/4"]);
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    let shard: Value = serde_json::from_str(&fs::read_to_string(out.join("shard.json")).unwrap()).unwrap();
    let schema = aogauge(dir, &["schema", "shard"]).output().unwrap();
    let schema: Value = serde_json::from_slice(&schema.stdout).unwrap();
    for key in shard.as_object().unwrap().keys() {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
    for required in schema["required"].as_array().unwrap() {
        assert!(shard.get(required.as_str().unwrap()).is_some(), "{required}");
    }
    let help = aogauge(dir, &["schema", "--help"]).output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    assert!(help.contains(&format!("record.json, version {}", aogauge::record::VERSION)), "{help}");
}
