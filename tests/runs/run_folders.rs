//! What a run or a merge finds in its way is kept: finished shards, records, and whatever
//! somebody put there.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    time::Duration,
};

const SUITE: &str = r#"
description = "x"
scenes = ["plane", "curtain-open"]
rays = [4]
replicates = 2
converged_rays = 64
look_rays = 1
judge = { precision = 1.0, paths = 1, replicates = 8, max_replicates = 8 }
[[estimator]]
name = "classic"
kind = "classic"
"#;

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Place(tempfile::tempdir().unwrap());
        fs::write(place.at("small.toml"), SUITE).unwrap();
        place
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, args: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
        command.current_dir(self.0.path()).args(args.split_whitespace());
        command
    }

    fn run(&self, args: &str) -> Output {
        self.command(&format!("run small.toml --renderer cpu --no-cache {args}")).output().unwrap()
    }

    fn merge(&self, args: &str) -> Output {
        self.command(&format!("merge {args}")).output().unwrap()
    }
}

fn stderr(ended: &Output) -> String {
    String::from_utf8_lossy(&ended.stderr).into_owned()
}

fn ends_with(ended: &Output, code: i32, says: &str) {
    assert!(ended.status.code() == Some(code) && stderr(ended).contains(says), "{:?}: {}", ended.status, stderr(ended));
}

#[test]
fn a_finished_shard_is_moved_aside_like_a_record() {
    let place = Place::new();
    ends_with(&place.run("--shard 1/2 --out same"), 0, "");
    let first = fs::read(place.at("same/shard.json")).unwrap();
    ends_with(&place.run("--shard 2/2 --out same"), 0, "what was in same is now in same.previous");
    assert_eq!(fs::read(place.at("same.previous/shard.json")).unwrap(), first);
    // Named by its own name it is a shard still.
    ends_with(&place.merge("same same.previous --out record"), 0, "");
    ends_with(&place.run("--out same"), 0, "what was in same is now in same.previous");
    assert!(place.at("same/record.json").exists() && place.at("same.previous/shard.json").exists());
}

/// As a job has it that is tried again after the suite was changed and changed back.
#[test]
fn what_was_moved_aside_is_not_taken_for_one_of_the_shards() {
    let place = Place::new();
    for part in ["--shard 1/2 --out farm/1", "--seed 9 --shard 2/2 --out farm/2", "--shard 2/2 --out farm/2"] {
        ends_with(&place.run(part), 0, "");
    }
    assert!(place.at("farm/2.previous/shard.json").exists());
    ends_with(&place.merge("farm --out record"), 0, "");
}

#[test]
fn a_merge_spares_its_shards() {
    let place = Place::new();
    for part in ["--shard 1/2 --out farm/1", "--shard 2/2 --out farm/2"] {
        ends_with(&place.run(part), 0, "");
    }
    for (shards, out) in [
        ("farm/1 farm/2", "farm/1"),
        ("farm", "farm/2/"),
        ("farm", "farm/1/record"),
        ("farm", "farm"),
        ("farm/1 farm/2", "farm/../farm/1"),
    ] {
        ends_with(&place.merge(&format!("{shards} --out {out}")), 2, "name another folder than");
    }
    fs::rename(place.at("farm/1"), place.at("record.previous")).unwrap();
    ends_with(&place.merge("record.previous farm/2 --out record"), 2, "would be lost");
    fs::rename(place.at("record.previous"), place.at("farm/1")).unwrap();
    ends_with(&place.merge("farm --out farm/record"), 0, "");
    ends_with(&place.merge("farm --out farm/record"), 0, "what was in farm/record is now in farm/record.previous");
}

/// Begins a run and kills it when its first pictures are there.
fn kill(place: &Place, out: &Path, args: &str) {
    let mut child = place
        .command(&format!("run small.toml --renderer cpu --no-cache {args} --out {}", out.display()))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    while !out.join(".aogauge-run/units").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the run was through before it could be killed");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(out.join(".aogauge-run").exists() && !out.join("record.json").exists());
}

#[test]
fn files_of_others_are_never_removed() {
    let place = Place::new();
    let out = place.at("killed");
    for file in ["notes.txt", "images/notes.txt", "mine/image.exr", "pictures/.keep"] {
        kill(&place, &out, "");
        let file = out.join(file);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, "mine").unwrap();
        ends_with(&place.run("--seed 5 --out killed"), 2, "no run writes this file");
        assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
        // What goes on removes nothing.
        ends_with(&place.run("--out killed"), 0, "");
        assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
        fs::remove_dir_all(&out).unwrap();
    }
    // Its own files are worth nothing.
    kill(&place, &out, "");
    ends_with(&place.run("--seed 5 --out killed"), 0, "");
}

#[test]
fn a_shard_that_was_killed_is_missing() {
    let place = Place::new();
    ends_with(&place.run("--shard 2/2 --out two"), 0, "");
    kill(&place, &place.at("one"), "--shard 1/2");
    ends_with(&place.merge("one two --out record"), 5, "one: the run of this shard did not finish");
    fs::create_dir(place.at("none")).unwrap();
    ends_with(&place.merge("none two --out record"), 5, "none: there is no shard in it");
    ends_with(&place.merge("nowhere two --out record"), 2, "nowhere");
    assert!(!place.at("record").exists());
}
