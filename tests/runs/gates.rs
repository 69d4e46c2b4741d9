//! Gates as a user meets them: tiers, a base record, explanations, and records of each
//! version that is read.

use aogauge::{
    gate::{Evidence, Outcome, Verdict, judge},
    record::{OLDEST, Record, VERSION},
};
use serde_json::Value;
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

const SUITE: &str = r#"
description = "x"
scenes = ["curtain-arcade"]
rays = [4]
replicates = 4
converged_rays = 64
look_rays = 1
judge = { precision = 0.2, paths = 2, replicates = 4 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "clipped"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "provokes"
metric = "contrast-error"
estimators = ["classic"]
min = 0.1
warn = { min = 0.9 }
[[gate]]
name = "better than classic"
metric = "contrast-error"
against = "classic"
max = 0.0
[[gate]]
name = "no worse than before"
metric = "bias"
region = "footprint"
against = "base"
max = 0.1
[[gate]]
name = "the judge is as before"
metric = "judge-contrast"
against = "base"
equals = 0.0
within = 0.9
[[gate]]
name = "takes all away"
metric = "removed"
min = 1.0
known_failure = "It takes away a part."
[[gate]]
name = "the GPU agrees"
metric = "renderer-difference"
renderers = ["gpu"]
equals = 0.0
within = 0.01
"#;

/// Runs the program: exit code, standard output, standard error.
fn aogauge(args: &[&str]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_aogauge")).args(args).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

fn run(suite: &Path, out: &Path, more: &[&str]) -> (i32, String) {
    let args = ["run", suite.to_str().unwrap(), "--renderer", "cpu", "--no-cache", "--out", out.to_str().unwrap()];
    let (code, _, text) = aogauge(&[&args[..], more].concat());
    (code, text)
}

fn of<'a>(record: &'a Record, gate: &str) -> Vec<&'a Verdict> {
    record.verdicts.iter().filter(|v| v.gate == gate).collect()
}

#[test]
fn a_run_is_held_against_a_base_and_explains_itself() {
    let dir = tempfile::tempdir().unwrap();
    let [suite, base, now, none] = ["s.toml", "base", "now", "none"].map(|n| dir.path().join(n));
    fs::write(&suite, SUITE).unwrap();

    // A base that was forgotten leaves its gates undecided, unless there is none on purpose.
    let (code, text) = run(&suite, &base, &[]);
    assert_eq!(code, 6, "{text}");
    assert!(text.contains("no base record was given to hold it against: give --base DIR, or --no-base"), "{text}");
    assert!(text.contains("1 passed, 0 failed, 2 inconclusive"), "{text}");
    let forgotten = Record::read(&base).unwrap();
    assert_eq!(judge(&Evidence::from(&forgotten)), (forgotten.verdicts.clone(), forgotten.idle_gates.clone()));
    let (code, text) = run(&suite, &base, &["--no-base"]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("there is no base record to hold it against (--no-base)") && text.contains("WARN"), "{text}");
    let counts = "1 passed, 0 failed, 0 inconclusive, 1 known failure, 1 warning, 3 not run";
    assert!(text.contains(counts) && text.ends_with("report.md: pass\n"), "{text}");
    let (code, text) = run(&suite, &none, &["--no-base", "--base", base.to_str().unwrap()]);
    assert!(code == 2 && text.contains("cannot be used with"), "{text}");
    let first = Record::read(&base).unwrap();
    assert_eq!(first.idle_gates.len(), 3);
    assert!(first.idle_gates.iter().all(|g| g.excused));

    // An unreadable base ends the run before anything is written.
    let (code, text) = run(&suite, &none, &["--base", dir.path().join("gone").to_str().unwrap()]);
    assert!(code == 2 && text.contains("not a record") && !none.exists(), "{text}");

    let (code, text) = run(&suite, &now, &["--seed", "2", "--base", base.to_str().unwrap()]);
    assert_eq!(code, 0, "{text}");
    let record = Record::read(&now).unwrap();
    let worse = of(&record, "no worse than before");
    assert_eq!(worse.len(), 2);
    for v in worse {
        let other = v.against.as_ref().unwrap();
        let before = first.cases.iter().find(|c| Some(&c.case) == v.case.as_ref()).unwrap();
        assert_eq!(other.metric.as_ref(), before.metric(v.metric.name, v.metric.region));
        let difference = v.metric.value.unwrap() - other.metric.as_ref().unwrap().value.unwrap();
        assert_eq!((v.value(), v.outcome), (Some(difference), Outcome::Pass));
    }
    assert_eq!(of(&record, "the judge is as before")[0].outcome, Outcome::Pass);
    let better = of(&record, "better than classic");
    assert_eq!((better.len(), better[0].outcome), (1, Outcome::Pass));
    assert_eq!(of(&record, "provokes")[0].outcome, Outcome::Warn);
    assert_eq!(record.summary.warnings, 1);

    // The record alone is enough to judge it anew.
    let anew = judge(&Evidence { base: Some(&first), ..Evidence::from(&record) });
    assert_eq!(anew, (record.verdicts.clone(), record.idle_gates.clone()));
    for v in &record.verdicts {
        let picture = v.picture.as_ref().unwrap_or_else(|| panic!("{v:?}"));
        assert!(now.join(picture).exists(), "{picture}");
        assert!(v.place.as_ref().unwrap().contains("pixels"), "{:?}", v.place);
        let holds = v.p_holds.unwrap();
        assert!(holds.adjusted >= holds.raw && v.p_broken.is_some() && v.margin.is_some());
    }
    explained(&now);
    divided(dir.path(), &suite, &base, &record);

    // An estimator of other options is not the same estimator, whatever it is called.
    fs::write(&suite, SUITE.replace("receiver_plane = \"clipped\"", "receiver_plane = \"counts\"")).unwrap();
    let (code, text) = run(&suite, &now, &["--base", base.to_str().unwrap()]);
    assert!(code == 6 && text.contains("the estimator 'clipped' has other options than in the base record"), "{text}");
}

/// Shards have no verdicts; merged, they come to those of the whole run. A filter takes
/// along what gates hold its cases against.
fn divided(dir: &Path, suite: &Path, base: &Path, whole: &Record) {
    let [parts, merged, some] = ["parts", "merged", "some"].map(|n| dir.join(n));
    let base = base.to_str().unwrap();
    let (code, text) = run(suite, &dir.join("odd"), &["--shard", "1/2", "--base", base]);
    assert!(code == 0 && text.contains("--base is of no use to a shard without --until-sure"), "{text}");
    for shard in ["1/2", "2/2"] {
        let (code, text) = run(suite, &parts.join(&shard[..1]), &["--seed", "2", "--shard", shard]);
        assert_eq!(code, 0, "{text}");
    }
    let [from, to] = [&parts, &merged].map(|p| p.to_str().unwrap());
    let (code, _, text) = aogauge(&["merge", from, "--out", to, "--base", base]);
    assert_eq!(code, 0, "{text}");
    assert_eq!(Record::read(&merged).unwrap().verdicts, whole.verdicts);

    let (code, text) = run(suite, &some, &["--filter", "clipped"]);
    assert_eq!(code, 6, "{text}");
    let (code, text) = run(suite, &some, &["--filter", "clipped", "--no-base"]);
    assert_eq!(code, 0, "{text}");
    let better = Record::read(&some).unwrap();
    assert_eq!(of(&better, "better than classic")[0].outcome, Outcome::Pass, "{text}");
}

fn explained(record: &Path) {
    let record = record.to_str().unwrap();
    let (code, text, _) = aogauge(&["explain", record]);
    assert_eq!(code, 0, "{text}");
    assert!(text.starts_with("WARN  curtain-arcade/classic/cpu/4\n  Gate: provokes\n"), "{text}");
    for says in
        ["KNOWN FAILURE  curtain-arcade/clipped/cpu/4", "NOT RUN", "used no GPU", "So it warns", "Holm's correction"]
    {
        assert!(text.contains(says), "{says}: {text}");
    }
    assert!(!text.contains("PASS") && text.lines().all(|l| l.chars().count() <= 92), "{text}");
    // A case by a part of its id, with what passed; a judge.
    let (_, text, _) = aogauge(&["explain", record, "clipped/cpu"]);
    assert!(text.contains("PASS") && !text.contains("curtain-arcade/classic/cpu/4\n"), "{text}");
    assert!(
        text.contains("That of curtain-arcade/classic/cpu/4 is") && text.contains("That of the base record is"),
        "{text}"
    );
    let (_, text, _) = aogauge(&["explain", record, "arcade/judge"]);
    assert!(
        text.contains("PASS  curtain-arcade (judge)") && text.contains("See pictures/curtain-arcade/q.png."),
        "{text}"
    );
    // For programs.
    let (code, json, _) = aogauge(&["explain", record, "curtain-arcade/classic/cpu/4", "--format", "json"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    let explanations = json["explanations"].as_array().unwrap();
    assert!(code == 0 && json["version"] == 1 && explanations.len() == 2, "{json}");
    assert!(
        explanations.iter().all(|e| e["text"].as_array().unwrap().len() > 4 && e["verdict"]["p_holds"]["raw"].is_f64())
    );
    let (code, _, text) = aogauge(&["explain", record, "clasic"]);
    assert!(code == 4 && text.contains("holds 'clasic'"), "{text}");
    assert_eq!(aogauge(&["explain", "nowhere"]).0, 2);
}

fn stored(version: u32) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/records/v{version}"))
}

/// `tests/records/vN` holds the `record.json` of a run of `tests/records/suite.toml` by
/// the last aogauge that wrote version N.
#[test]
fn a_record_of_every_version_since_the_oldest_is_read() {
    for version in OLDEST..=VERSION {
        let text = fs::read_to_string(stored(version).join("record.json")).unwrap();
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["version"], version);
        let record = Record::read(&stored(version)).unwrap();
        assert_eq!((record.version, record.cases.len(), record.verdicts.len()), (VERSION, 2, 4));
        let count = |o| record.verdicts.iter().filter(|v| v.outcome == o).count();
        assert_eq!((count(Outcome::Pass), count(Outcome::KnownFailure)), (3, 1));
        for v in &record.verdicts {
            assert!(v.value().is_some() && v.interval.is_some() && v.spent == 1.0 && v.confidence == 0.95);
            let equals = matches!(v.limit, aogauge::gate::Limit::Equals { .. });
            assert_eq!(v.p_holds.is_some(), version > 3 || equals, "version 3 had p for equals alone");
        }
        assert_eq!(record.suite.gates.is_empty(), version == 3);
        let (code, text, _) = aogauge(&["explain", stored(version).to_str().unwrap(), "curtain"]);
        assert!(code == 0 && text.contains("So it fails as it is known to: It takes away a part."), "{text}");
        assert_eq!(text.matches("So it passes").count(), 3, "{text}");
    }
}

/// Since version 4 the gates are in the record, and judging it anew comes to the same.
#[test]
fn a_stored_record_is_judged_anew() {
    let record = Record::read(&stored(4)).unwrap();
    let (verdicts, idle) = judge(&Evidence::from(&record));
    assert_eq!(idle, record.idle_gates);
    for (anew, old) in verdicts.iter().zip(&record.verdicts) {
        assert_eq!((&anew.gate, anew.subject(), anew.outcome), (&old.gate, old.subject(), old.outcome));
        let close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
        let (a, b) = (anew.p_holds.unwrap(), old.p_holds.unwrap());
        assert!(close(a.raw, b.raw) && close(a.adjusted, b.adjusted), "{a:?} {b:?}");
    }
}

/// Green means that something was judged.
#[test]
fn a_run_that_judges_nothing_is_not_green() {
    let dir = tempfile::tempdir().unwrap();
    let [suite, out] = ["s.toml", "out"].map(|n| dir.path().join(n));
    let head = SUITE.split("[[gate]]").next().unwrap().replace("[\"curtain-arcade\"]", "[\"plane\", \"corner\"]");
    let only = |gates: &str| fs::write(&suite, format!("{head}{gates}")).unwrap();
    let nothing = "nothing was judged: the suite has gates, and none of them was held against anything";
    let on_plane = "[[gate]]\nname = \"g\"\nmetric = \"openness\"\nregion = \"all\"\nscenes = [\"plane\"]\nmin = 0.5\n";

    // The filter leaves nothing that the gate holds for.
    only(on_plane);
    let (code, text) = run(&suite, &out, &["--filter", "corner"]);
    assert!(code == 4 && text.contains(nothing) && text.contains("0 inconclusive, 1 not run"), "{text}");
    assert!(Record::read(&out).unwrap().has_judged_nothing());
    let (code, text) = run(&suite, &out, &["--filter", "plane"]);
    assert!(code == 0 && text.ends_with(": pass\n"), "{text}");

    // There is no GPU, and no other gate.
    only(&on_plane.replace("scenes = [\"plane\"]", "renderers = [\"gpu\"]"));
    let (code, text) = run(&suite, &out, &[]);
    assert!(code == 4 && text.contains(nothing), "{text}");

    // A base that was forgotten; one that cannot be there yet; and that together with a filter.
    only(&format!("{on_plane}against = \"base\"\n"));
    let (code, text) = run(&suite, &out, &[]);
    assert!(code == 6 && text.contains("give --base DIR, or --no-base"), "{text}");
    let (code, text) = run(&suite, &out, &["--no-base"]);
    assert!(code == 0 && text.contains("rendered; the gates wait for a base record (--no-base)"), "{text}");
    assert!(Record::read(&out).unwrap().no_base);
    let (code, text) = run(&suite, &out, &["--filter", "corner"]);
    assert!(code == 4 && text.contains(nothing), "{text}");

    only("");
    let (code, text) = run(&suite, &out, &[]);
    assert!(code == 0 && text.contains("rendered; the suite has no gates"), "{text}");
}

/// Sixteen times the replicates of a case make its own error smaller, and not that of the
/// base: the words must not promise what they cannot keep.
#[test]
fn the_noise_of_a_base_is_not_promised_away() {
    let dir = tempfile::tempdir().unwrap();
    let [suite, base, now] = ["s.toml", "base", "now"].map(|n| dir.path().join(n));
    let head =
        SUITE.split("[[gate]]").next().unwrap().replace("replicates = 4\nconverged", "replicates = 8\nconverged");
    let gate = "[[gate]]\nname = \"g\"\nmetric = \"contrast-error\"\nagainst = \"base\"\nmax = 0.03\n";
    fs::write(&suite, format!("{head}{gate}")).unwrap();
    assert_eq!(run(&suite, &base, &["--no-base"]).0, 0);
    let more = format!("{head}{gate}").replace("replicates = 8\nconverged", "replicates = 128\nconverged");
    assert!(more.contains("replicates = 128"));
    fs::write(&suite, more).unwrap();
    let (code, text) = run(&suite, &now, &["--seed", "2", "--base", base.to_str().unwrap()]);
    assert_eq!(code, 6, "{text}");
    let record = Record::read(&now).unwrap();
    let open: Vec<&Verdict> = record.verdicts.iter().filter(|v| v.outcome == Outcome::Inconclusive).collect();
    assert!(!open.is_empty());
    for v in open {
        let floor = v.floor.unwrap();
        let theirs = v.against.as_ref().unwrap().metric.as_ref().unwrap().se.unwrap();
        assert!(floor.se > theirs && floor.se < v.se().unwrap(), "{v:?}");
        assert!(v.is_kept_by_floor(2) && !v.can_be_decided(v.limit, 2), "{v:?}");
        let says = "more replicates of the case would not decide: the noise of the base record and of the judge";
        assert!(v.reason.contains(says), "{}", v.reason);
    }
    let (_, text, _) = aogauge(&["explain", now.to_str().unwrap()]);
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(text.contains("where the value lies: make a base record of more replicates, or move"), "{text}");
    assert!(!text.contains("times the replicates") && !text.contains("replicates would decide"), "{text}");
}
