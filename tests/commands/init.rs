//! `aogauge init` from outside: what is written loads, runs, and calls what exists.

use aogauge::{cli::Cli, record::Record};
use clap::Parser;
use serde_json::Value;
use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    process::{Command, Output},
};

fn aogauge(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).env("XDG_CACHE_HOME", "/dev/null").args(args).output().unwrap()
}

fn init(code: i32, dir: &Path, more: &[&str]) -> String {
    let output = aogauge(&[&["init", dir.to_str().unwrap()], more].concat());
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    stderr
}

/// Every file below a folder.
fn files(root: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for entry in fs::read_dir(root).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|f| format!("{name}/{f}")));
        } else {
            found.insert(name);
        }
    }
    found
}

#[test]
fn nothing_is_overwritten_and_nothing_is_written_by_half() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("new");
    init(0, &dir, &[]);
    let written = [".github/workflows/aogauge.yml", "aogauge.toml"];
    assert_eq!(files(&dir), written.map(String::from).into());
    fs::write(dir.join(written[0]), "mine").unwrap();
    fs::remove_file(dir.join(written[1])).unwrap();
    let stderr = init(2, &dir, &[]);
    assert!(stderr.contains(written[0]) && stderr.contains("nothing is written"), "{stderr}");
    assert_eq!(files(&dir), [written[0].to_owned()].into());
    assert_eq!(fs::read_to_string(dir.join(written[0])).unwrap(), "mine");
    init(0, &dir, &["--force"]);
    assert_ne!(fs::read_to_string(dir.join(written[0])).unwrap(), "mine");

    let dir = root.path().join("file-in-the-way");
    fs::create_dir(&dir).unwrap();
    fs::write(dir.join(".github"), "").unwrap();
    for more in [&[][..], &["--force"]] {
        assert!(init(2, &dir, more).contains(".github: this is no folder"));
    }
    assert_eq!(files(&dir), [".github".to_owned()].into());
    let help = String::from_utf8(aogauge(&["init", "--help"]).stdout).unwrap();
    assert!(help.contains("Example") && help.contains("--force"), "{help}");
    let stderr = init(0, &dir, &["--ci", "gitlab"]);
    assert!(stderr.contains("include: [{ local: .gitlab/aogauge.yml }]"), "{stderr}");
    assert!(stderr.contains("add reports/, aogauge-record/, aogauge-base/ and aogauge-comment.md to"), "{stderr}");
    assert!(files(&dir).contains(".gitlab/aogauge.yml"));
    let dir = root.path().join("none");
    // What the command that it names to try writes.
    assert!(init(0, &dir, &["--ci", "none"]).contains("add reports/ to .gitignore"));
    assert_eq!(files(&dir), ["aogauge.toml".to_owned()].into());
    #[cfg(unix)]
    {
        fs::remove_file(dir.join("aogauge.toml")).unwrap();
        std::os::unix::fs::symlink("nowhere", dir.join("aogauge.toml")).unwrap();
        assert!(init(2, &dir, &["--ci", "none"]).contains("aogauge.toml: the file is already there"));
    }
}

/// With few rays, so that it takes a second.
#[test]
fn the_suite_runs() {
    let dir = tempfile::tempdir().unwrap();
    init(0, dir.path(), &["--ci", "none"]);
    let path = dir.path().join("aogauge.toml");
    let mut text = fs::read_to_string(&path).unwrap();
    for (from, to) in [
        ("\nrays = [4, 32]", "\nrays = [4]"),
        ("\nreplicates = 16\n\n", "\nreplicates = 8\n\n"),
        ("\nconverged_rays = 512", "\nconverged_rays = 64"),
        ("\ngolden_rays = 32", "\ngolden_rays = 4"),
        ("\nlook_rays = 32", "\nlook_rays = 1"),
        ("\nprecision = 0.02", "\nprecision = 0.1"),
    ] {
        assert_eq!(text.matches(from).count(), 1, "{from}");
        text = text.replace(from, to);
    }
    fs::write(&path, text).unwrap();
    let out = dir.path().join("out");
    let run =
        aogauge(&["run", path.to_str().unwrap(), "--out", out.to_str().unwrap(), "--renderer", "cpu", "--no-cache"]);
    let stderr = String::from_utf8(run.stderr).unwrap();
    assert_eq!(run.status.code(), Some(0), "{stderr}");
    let record = Record::read(&out).unwrap();
    let gates: BTreeSet<&str> = record.verdicts.iter().map(|v| v.gate.as_str()).collect();
    assert_eq!((gates.len(), record.idle_gates.len(), record.suite.name.as_str()), (3, 0, "aogauge"));
}

/// By the schema: an option that is new must be told of.
#[test]
fn the_suite_explains_every_option() {
    let dir = tempfile::tempdir().unwrap();
    init(0, dir.path(), &["--ci", "none"]);
    let text = fs::read_to_string(dir.path().join("aogauge.toml")).unwrap();
    let schema: Value = serde_json::from_slice(&aogauge(&["schema", "suite"]).stdout).unwrap();
    let words: BTreeSet<&str> = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '_').collect();
    let parts = ["JudgeSettings", "SoftwareAdapter", "EstimatorFile", "GateFile"].map(|p| &schema["$defs"][p]);
    let mut options = 0;
    for part in parts.into_iter().chain([&schema]) {
        for option in part["properties"].as_object().unwrap().keys() {
            assert!(words.contains(option.as_str()), "aogauge.toml does not tell of {option}");
            options += 1;
        }
    }
    assert!(options > 40, "{options}");
    // What stands there as unless given is what it is unless given.
    for (option, value) in [("seed", "1"), ("target_rmse", "0.01")] {
        assert_eq!(schema["properties"][option]["default"].to_string(), value);
        assert!(text.contains(&format!("\n#: {option} = {value}\n")), "{option}");
    }
}

/// The commands of a script: what stands between `;`, `&&`, `||` and the ends of lines.
fn commands(text: &str) -> Vec<Vec<String>> {
    let is_comment = |l: &&str| !l.trim_start().starts_with('#');
    let lines = text.lines().filter(is_comment).flat_map(|l| l.split(';').map(str::to_owned).collect::<Vec<_>>());
    let pieces = lines.flat_map(|l| l.split("&&").flat_map(|p| p.split("||")).map(str::to_owned).collect::<Vec<_>>());
    let trimmed = pieces.map(|p| p.trim().trim_start_matches("- ").trim_start_matches("run: ").trim().to_owned());
    let ours = trimmed.filter(|p| p.starts_with("aogauge ") && !p.starts_with("aogauge:"));
    ours.map(|p| p.split(" > ").next().unwrap().split_whitespace().map(str::to_owned).collect()).collect()
}

#[test]
fn workflows_call_what_exists() {
    let dir = tempfile::tempdir().unwrap();
    init(0, dir.path(), &["--ci", "github"]);
    init(0, dir.path(), &["--ci", "gitlab", "--force"]);
    for file in [".github/workflows/aogauge.yml", ".gitlab/aogauge.yml"] {
        let text = fs::read_to_string(dir.path().join(file)).unwrap();
        let called = commands(&text);
        let verbs: Vec<&str> = called.iter().map(|c| c[1].as_str()).collect();
        assert_eq!(verbs, ["run", "golden", "compare"], "{file}");
        for command in called {
            let parsed = Cli::try_parse_from(&command);
            assert!(parsed.is_ok(), "{file}: {command:?}: {}", parsed.unwrap_err());
        }
        // Comments name commands too.
        for line in text.lines().filter(|l| l.trim_start().starts_with("#   aogauge ")) {
            let words = line.trim_start_matches([' ', '#']).replace("\"first goldens\"", "x");
            assert!(Cli::try_parse_from(words.split_whitespace()).is_ok(), "{line}");
        }
        assert!(!text.contains('\t') && text.ends_with('\n'));
    }
    let text = fs::read_to_string(dir.path().join(".github/workflows/aogauge.yml")).unwrap();
    for line in text.lines().filter_map(|l| l.trim().trim_start_matches("- ").strip_prefix("uses: ")) {
        let (action, version) = line.split_once('@').unwrap();
        let major = version.strip_prefix('v').unwrap();
        assert!(action.starts_with("actions/") && major.parse::<u32>().is_ok(), "{line}");
    }
    // What a pull request brings never stands in a script.
    let scripts = text.split("run: ").skip(1).map(|s| s.split("\n\n").next().unwrap());
    assert!(scripts.filter(|s| s.contains("${{")).count() == 0);
}
