//! What CI systems get of a record: the test report, the summary and annotations on
//! GitHub, JSON, exit codes; and that names from anybody break none of them.

use aogauge::{
    gate::{Outcome, Verdict},
    record::{End, IdleGate, Record},
    report::{digest, github, junit},
};
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus};
use serde_json::{Value, json};
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// Runs the program as outside GitHub unless a summary is asked for: exit code, standard
/// output, standard error.
fn aogauge_with(args: &[&str], summary: Option<&Path>) -> (i32, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
    command.args(args).env_remove(github::VARIABLE).env("XDG_CACHE_HOME", "/dev/null");
    command.envs(summary.map(|path| (github::VARIABLE, path)));
    let output = command.output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

fn aogauge(args: &[&str]) -> (i32, String, String) {
    aogauge_with(args, None)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

pub(super) fn stored() -> Record {
    Record::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/records/v4")).unwrap()
}

/// Writes a record's folder without images.
pub(super) fn written(dir: &Path, record: &impl serde::Serialize) -> PathBuf {
    let folder = dir.join("record");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("record.json"), serde_json::to_string(record).unwrap()).unwrap();
    folder
}

/// The stored verdicts pass but for one that is known to fail. This one has of everything.
fn mixed() -> Record {
    let mut record = stored();
    let outcomes = [Outcome::KnownFailure, Outcome::Fail, Outcome::Inconclusive, Outcome::Warn];
    for (verdict, outcome) in record.verdicts.iter_mut().zip(outcomes) {
        verdict.outcome = outcome;
        verdict.reason = format!("because of {outcome:?}");
    }
    let mut pass = record.verdicts[0].clone();
    (pass.outcome, pass.gate, pass.case) = (Outcome::Pass, "It passes".to_owned(), None);
    record.verdicts.push(pass);
    let idle = |gate: &str, excused| IdleGate { gate: gate.to_owned(), reason: "no GPU".to_owned(), excused };
    record.idle_gates = vec![idle("excused", true), idle("unexcused", false)];
    record
}

fn with_errors(mut record: Record) -> Record {
    record.cases[1].error = Some("the device was lost".to_owned());
    record.scenes[0].judge_error = Some("NaN in the judge".to_owned());
    record.incomplete = Some("interrupted".to_owned());
    record
}

/// Reads the XML: it is well-formed, and holds only characters that XML takes.
fn read(xml: &str) -> Report {
    let legal = |c: char| c >= ' ' && u32::from(c) & 0xfffe != 0xfffe || c == '\n';
    assert!(xml.chars().all(legal), "{xml:?}");
    Report::deserialize_from_str(xml).unwrap_or_else(|e| panic!("{e}: {xml}"))
}

fn tests(report: &Report) -> Vec<&TestCase> {
    report.test_suites.iter().flat_map(|s| &s.test_cases).collect()
}

fn named<'a>(report: &'a Report, name: &str) -> &'a TestCase {
    let found: Vec<_> = tests(report).into_iter().filter(|t| t.name.as_str() == name).collect();
    assert_eq!(found.len(), 1, "{name}: {:?}", tests(report).iter().map(|t| t.name.as_str()).collect::<Vec<_>>());
    found[0]
}

/// `failure`, `error`, `skipped` or `success`, with type and message.
fn status(test: &TestCase) -> (&'static str, &str, &str) {
    let of = |s: &'_ Option<quick_junit::XmlString>| s.as_ref().map(|s| s.as_str().to_owned()).unwrap_or_default();
    let leak = |s: String| -> &'static str { Box::leak(s.into_boxed_str()) };
    match &test.status {
        TestCaseStatus::Success { .. } => ("success", "", ""),
        TestCaseStatus::NonSuccess { kind, message, ty, .. } => {
            let kind = if *kind == NonSuccessKind::Failure { "failure" } else { "error" };
            (kind, leak(of(ty)), leak(of(message)))
        }
        TestCaseStatus::Skipped { message, ty, .. } => ("skipped", leak(of(ty)), leak(of(message))),
    }
}

#[test]
fn every_verdict_is_a_test_with_its_reason_and_numbers() {
    let record = mixed();
    let report = read(&junit::xml(&record).unwrap());
    let [run, scene] = &report.test_suites[..] else { panic!("{report:?}") };
    assert_eq!((run.name.as_str(), scene.name.as_str()), ("tiny", "curtain-arcade"));
    // Two cases and a judge besides.
    assert_eq!((run.test_cases.len(), scene.test_cases.len()), (1 + 2, 5 + 2 + 1));

    let (kind, ty, message) = status(named(&report, "The scene provokes [classic/cpu/4]"));
    assert_eq!((kind, ty), ("failure", "fail"));
    assert_eq!(message, "contrast-error is 0.301 [0.266, 0.336], must be at least 0.1: because of Fail");
    let TestCaseStatus::NonSuccess { description, .. } = &named(&report, "The scene provokes [classic/cpu/4]").status
    else {
        panic!()
    };
    let description = description.as_ref().unwrap().as_str();
    for part in
        ["Measured is contrast-error of classic on the cpu with 4 rays", "standard error of 0.0129", "See pictures/"]
    {
        assert!(description.contains(part), "{description}");
    }
    let (kind, ty, _) = status(named(&report, "No bias under the occluder [classic/cpu/4]"));
    assert_eq!((kind, ty), ("failure", "inconclusive"));
    let warning = named(&report, "No bias under the occluder [clipped/cpu/4]");
    assert_eq!(status(warning).0, "success");
    assert!(warning.system_out.as_ref().unwrap().as_str().contains("because of Warn"));
    let (kind, ty, message) = status(named(&report, "The extension takes all away [clipped/cpu/4]"));
    assert!(kind == "skipped" && ty == "known-failure" && message.contains("because of KnownFailure"), "{message}");
    assert_eq!(status(named(&report, "It passes [judge]")).0, "success");
    assert_eq!(status(named(&report, "excused")), ("skipped", "not-run", "nothing was held against it: no GPU"));
    assert_eq!(status(named(&report, "unexcused")).1, "inconclusive");

    // Times are those of the record, once each.
    let time = |name: &str| named(&report, name).time.unwrap().as_secs_f64();
    assert_eq!(time("the case is rendered [classic/cpu/4]"), 0.014);
    assert_eq!(time("the scene is judged [judge]"), 0.159);
    assert!((scene.time.unwrap().as_secs_f64() - (0.0137 + 0.0402 + 0.1587)).abs() < 1e-3);
    assert_eq!(report.time.unwrap().as_millis(), 552);
    for (name, value) in [("tool", "aogauge 0.1.0"), ("seed", "1"), ("cpu", "a processor"), ("threads", "2")] {
        assert!(scene.properties.iter().any(|p| p.name.as_str() == name && p.value.as_str() == value), "{name}");
    }
    assert_eq!(scene.timestamp.unwrap().to_rfc3339(), "2026-11-25T04:45:55+00:00");
    // GitLab takes tests of one class and name for one.
    let mut ids: Vec<_> = tests(&report).iter().map(|t| (t.classname.clone().unwrap(), t.name.clone())).collect();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), tests(&report).len());
}

#[test]
fn errors_are_errors_under_the_name_that_passes_otherwise() {
    let (good, bad) = (read(&junit::xml(&mixed()).unwrap()), read(&junit::xml(&with_errors(mixed())).unwrap()));
    for (name, ty, message) in [
        ("the case is rendered [clipped/cpu/4]", "case-error", "the device was lost"),
        ("the scene is judged [judge]", "judge-error", "NaN in the judge"),
        ("the run is complete", "incomplete", "interrupted"),
    ] {
        assert_eq!(status(named(&good, name)).0, "success");
        assert_eq!(status(named(&bad, name)), ("error", ty, message));
    }
    assert_eq!((good.errors, bad.errors), (0, 3));
}

/// What turns a job red agrees: the exit code, the test report, JSON, and annotations.
#[test]
fn the_formats_and_the_exit_code_agree() {
    let dir = tempfile::tempdir().unwrap();
    let only = |outcome: Outcome| {
        let mut record = stored();
        record.verdicts[1].outcome = outcome;
        record
    };
    let idle = |excused| {
        let mut record = mixed();
        record.verdicts.clear();
        record.idle_gates.retain(|g| g.excused == excused);
        record
    };
    let incomplete = |change: fn(&mut Record)| {
        let mut record = stored();
        change(&mut record);
        record
    };
    for (record, code, end) in [
        (stored(), 0, End::Pass),
        (only(Outcome::Warn), 0, End::Pass),
        (idle(true), 4, End::Nothing),
        (only(Outcome::Fail), 1, End::Fail),
        (mixed(), 1, End::Fail),
        (only(Outcome::Inconclusive), 6, End::Inconclusive),
        (idle(false), 6, End::Inconclusive),
        (with_errors(mixed()), 5, End::Incomplete),
        (incomplete(|r| r.incomplete = Some("x".into())), 5, End::Incomplete),
        (incomplete(|r| r.cases[0].error = Some("x".into())), 5, End::Incomplete),
        (incomplete(|r| r.scenes[0].judge_error = Some("x".into())), 5, End::Incomplete),
    ] {
        let folder = written(dir.path(), &record);
        let formats = ["report", text(&folder), "--format", "junit,github", "--format", "json"];
        let (made, out, _) = aogauge(&formats);
        assert_eq!(made, 0, "the reports were made");
        let (gated, again, told) = aogauge(&[&formats[..], &["--gate"]].concat());
        assert_eq!((gated, &again), (code, &out));
        let json: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((&json["exit_code"], &json["outcome"]), (&json!(code), &serde_json::to_value(end).unwrap()));
        let report = read(&fs::read_to_string(folder.join("junit.xml")).unwrap());
        assert_eq!(report.failures + report.errors > 0, code != 0, "{report:?}");
        assert_eq!(
            report.failures + report.errors,
            tests(&report).iter().filter(|t| { matches!(t.status, TestCaseStatus::NonSuccess { .. }) }).count()
        );
        assert_eq!(told.contains("::error "), code == 1 || code == 5, "{told}");
        let summary = fs::read_to_string(folder.join("summary.md")).unwrap();
        assert!(summary.contains(&format!(" {} ·", end.text())), "{summary}");
    }
}

/// A record that was edited by hand is what its verdicts say, in every sentence.
#[test]
fn counts_are_those_of_the_verdicts() {
    let dir = tempfile::tempdir().unwrap();
    let mut record = serde_json::to_value(stored()).unwrap();
    let pass = record["summary"]["pass"].as_u64().unwrap();
    record["summary"]["pass"] = json!(77);
    let folder = written(dir.path(), &record);
    let args = ["report", text(&folder), "--format", "junit,github,json", "--gate"];
    let (code, out, told) = aogauge(&args);
    let says = |passed: u64, failed: u64| format!("{passed} passed, {failed} failed, 0 inconclusive, 1 known failure");
    assert!(code == 0 && told.contains(&says(pass, 0)) && !told.contains("77 passed"), "{told}");
    assert!(!told.contains("known failures"), "{told}");
    assert_eq!(serde_json::from_str::<Value>(&out).unwrap()["summary"]["pass"], pass);
    assert!(fs::read_to_string(folder.join("summary.md")).unwrap().contains(&says(pass, 0)));

    let passed = record["verdicts"].as_array().unwrap().iter().position(|v| v["outcome"] == "pass").unwrap();
    record["verdicts"][passed]["outcome"] = json!("fail");
    written(dir.path(), &record);
    let (code, _, told) = aogauge(&args);
    assert!(code == 1 && told.contains(&says(pass - 1, 1)), "{told}");
}

/// The help and docs/reports.md name each exit code and outcome there is.
#[test]
fn every_exit_code_is_told() {
    let (_, help, _) = aogauge(&["report", "--help"]);
    let docs = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reports.md")).unwrap();
    let codes = docs.lines().find(|l| l.contains("with `--gate`, where they are made")).unwrap();
    let outcomes = docs.lines().find(|l| l.starts_with("| `outcome`, `exit_code`")).unwrap();
    for (code, end) in [(0, End::Pass), (1, End::Fail), (4, End::Nothing), (5, End::Incomplete), (6, End::Inconclusive)]
    {
        assert!(help.contains(&format!("{code} ")) && codes.contains(&code.to_string()), "{code}: {help}{codes}");
        let name = serde_json::to_value(end).unwrap();
        assert!(outcomes.contains(&format!("`{}`", name.as_str().unwrap())), "{name}: {outcomes}");
    }
}

/// Each is refused by file, field, value and range, whatever reads the record.
#[test]
fn numbers_that_no_run_writes_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let stored = serde_json::to_value(stored()).unwrap();
    let metric = "cases[0].metrics[0].value";
    for (place, value, says) in [
        (
            "/cases/0/metrics/0/value",
            json!(1e9),
            format!("{metric} is 1000000000: it must be from -100000000 to 100000000"),
        ),
        ("/cases/0/metrics/0/value", json!("NaN"), format!("{metric}: invalid type: string \"NaN\", expected f64")),
        ("/cases/0/metrics/0/se", json!(-0.1), "cases[0].metrics[0].se is -0.1: it must be from 0 to".to_owned()),
        ("/cases/0/case/rays", json!(-4), "cases[0].case.rays: invalid value: integer `-4`, expected u32".to_owned()),
        ("/cases/0/case/rays", json!(0), "cases[0].case.rays is 0: it must be from 1 to 4294967295".to_owned()),
        ("/verdicts/0/interval", json!([2, 1]), "verdicts[0].interval is 2 to 1: its lower end must".to_owned()),
        ("/verdicts/0/p_holds/raw", json!(1.5), "verdicts[0].p_holds.raw is 1.5: it must be from 0 to 1".to_owned()),
        ("/verdicts/0/confidence", json!(95), "verdicts[0].confidence is 95: it must be from 0.5".to_owned()),
        ("/scenes/0/radius", json!(0), "scenes[0].radius is 0: it must be from 1e-9 to".to_owned()),
        (
            "/scenes/0/resolution/0",
            json!(4_294_967_295u32),
            "scenes[0].resolution is 4294967295: it must be".to_owned(),
        ),
        ("/scenes/0/regions/left", json!(6657), "scenes[0].regions.left is 6657: it must be from 0 to 6656".to_owned()),
        ("/scenes/0/transect", json!([0.5]), "scenes[0].transect has 1 values: it must have 208".to_owned()),
        ("/scenes/0/transect/3", json!(1e308), "scenes[0].transect is 1e308: it must be".to_owned()),
        ("/scenes/0/profiles/1/hi", json!([]), "scenes[0].profiles[1].hi has 0 values: it must have 208".to_owned()),
        ("/scenes/0/judge/q/left/value", json!(-1), "scenes[0].judge.q.left.value is -1: it must be".to_owned()),
        ("/scenes/0/convergence/0/slope/df", json!(-1), "scenes[0].convergence[0].slope.df is -1".to_owned()),
        ("/pooled/0/rmse/pooled/value", json!(-1), "pooled[0].rmse.pooled.value is -1".to_owned()),
        ("/timing/seconds", json!(-1), "timing.seconds is -1: it must be from 0 to".to_owned()),
        ("/suite/replicates", json!(0), "suite.replicates is 0: it must be from 1 to".to_owned()),
    ] {
        let mut record = stored.clone();
        *record.pointer_mut(place).unwrap() = value;
        let folder = written(dir.path(), &record);
        for args in [&["report", text(&folder), "--format", "json"][..], &["explain", text(&folder)]] {
            let (code, out, told) = aogauge(args);
            assert_eq!((code, out.as_str()), (2, ""), "{place}: {told}");
            assert!(told.contains("record.json: ") && told.contains(&says), "{place}: {told}");
        }
    }
}

/// Numbers of which nothing can be drawn are refused before a picture is drawn.
#[test]
fn a_scene_without_a_middle_leaves_no_half_of_a_report() {
    let dir = tempfile::tempdir().unwrap();
    let mut record = stored();
    record.scenes[0].transect.fill(5.0);
    let folder = written(dir.path(), &record);
    let (code, _, told) = aogauge(&["report", text(&folder)]);
    assert!(code == 2 && told.contains("scene 'curtain-arcade': no column of its measure view"), "{told}");
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
}

#[test]
fn json_tells_a_script_what_stopped_the_merge() {
    let dir = tempfile::tempdir().unwrap();
    let folder = written(dir.path(), &with_errors(mixed()));
    let (_, out, _) = aogauge(&["report", text(&folder), "--format", "json,junit"]);
    let json: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(json["version"], digest::VERSION);
    assert_eq!(json["files"], json!([folder.join("junit.xml")]));
    let failures = json["failures"].as_array().unwrap();
    assert_eq!(failures.len(), 2);
    assert_eq!(failures[0]["outcome"], "fail");
    assert_eq!(failures[0]["gate"], "The scene provokes");
    assert_eq!(failures[0]["subject"], "curtain-arcade/classic/cpu/4");
    assert_eq!((&failures[0]["limit"], &failures[0]["metric"]), (&json!({"at-least": 0.1}), &json!("contrast-error")));
    assert_eq!(failures[0]["value"], 0.3010582081444002);
    assert_eq!(failures[0]["interval"], json!([0.2664055221569017, 0.3357108941318987]));
    assert_eq!((&failures[1]["outcome"], &failures[1]["region"]), (&json!("inconclusive"), &json!("footprint")));
    let subjects: Vec<_> = json["errors"].as_array().unwrap().iter().map(|e| e["subject"].clone()).collect();
    assert_eq!(subjects, ["curtain-arcade (judge)", "curtain-arcade/clipped/cpu/4"]);
    assert_eq!(json["incomplete"], "interrupted");
    // It is counted from the verdicts, not taken from a summary that was edited.
    assert_eq!((&json["summary"]["fail"], &json["summary"]["inconclusive"]), (&json!(1), &json!(2)));

    let (code, schema, _) = aogauge(&["schema", "report"]);
    let schema: Value = serde_json::from_str(&schema).unwrap();
    let keys = |v: &Value| v.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    assert_eq!((code, keys(&schema["properties"])), (0, keys(&json)));
    assert_eq!(keys(&schema["$defs"]["Failure"]["properties"]), keys(&failures[0]));
}

#[test]
fn on_github_the_summary_is_appended_and_annotations_are_printed() {
    let dir = tempfile::tempdir().unwrap();
    let folder = written(dir.path(), &with_errors(mixed()));
    let step = dir.path().join("step.md");
    fs::write(&step, "before").unwrap();
    let args = ["report", text(&folder), "--format", "github", "--image-base", "https://example.org/r/"];
    let (code, out, told) = aogauge_with(&args, Some(&step));
    assert_eq!(code, 0, "{told}");
    assert!(told.contains("step.md") && !told.contains("is not set"), "{told}");
    assert!(!folder.join("summary.md").exists());
    let summary = fs::read_to_string(&step).unwrap();
    assert!(summary.starts_with("before\n\n### ❌ INCOMPLETE · tiny: "), "{summary}");
    for part in [
        "#### 2 ended with an error\n",
        "| <code>curtain-arcade/clipped/cpu/4</code> | the device was lost |\n",
        "#### 4 did not pass\n",
        "| <b>FAIL</b> | The scene provokes | <code>curtain-arcade/classic/cpu/4</code> | contrast-error | 0.301",
        "#### 2 gates were not held against anything\n",
        "<summary>1 passed</summary>",
        "](https://example.org/r/pictures/curtain-arcade/minus-q/classic.png)",
        "**The run ended early:** interrupted",
    ] {
        assert!(summary.contains(part), "{part}: {summary}");
    }
    assert!(summary.find("<b>FAIL").unwrap() < summary.find("<b>KNOWN FAILURE").unwrap());

    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines.len(), 9, "{out}");
    assert!(lines[..4].iter().all(|l| l.starts_with("::error title=")) && lines[4].starts_with("::warning"), "{out}");
    assert_eq!(
        lines[3],
        "::error title=Fail%3A The scene provokes::curtain-arcade/classic/cpu/4: contrast-error is 0.301 [0.266, 0.336], \
         must be at least 0.1: because of Fail"
    );
    assert!(lines[8].starts_with("::notice title=Not run%3A excused::"), "{out}");

    // Outside GitHub, or where the variable is empty.
    for summary in [None, Some(Path::new(""))] {
        let (code, again, told) = aogauge_with(&args[..4], summary);
        assert!(code == 0 && again == out && told.contains("GITHUB_STEP_SUMMARY is not set"), "{told}");
        let alone = fs::read_to_string(folder.join("summary.md")).unwrap();
        assert!(!alone.contains("![") && alone.starts_with("### "), "{alone}");
        fs::remove_file(folder.join("summary.md")).unwrap();
    }
    // With JSON, standard output is JSON alone.
    let (_, out, told) = aogauge(&["report", text(&folder), "--format", "github,json"]);
    assert!(serde_json::from_str::<Value>(&out).is_ok() && told.contains("\n::error "), "{out}{told}");
}

#[test]
fn there_are_ten_annotations_at_most_and_failures_come_first() {
    let mut record = mixed();
    let template = record.verdicts[1].clone();
    for n in 0..30 {
        // Three cases of each gate.
        let outcome = if n % 2 == 0 { Outcome::KnownFailure } else { Outcome::Fail };
        for _ in 0..3 {
            record.verdicts.push(Verdict { gate: format!("gate {n}"), outcome, ..template.clone() });
        }
    }
    let lines = github::annotations(&record);
    assert_eq!(lines.len(), github::MOST_ANNOTATIONS);
    assert!(lines.iter().all(|l| l.starts_with("::error ")), "{lines:?}");
    assert!(lines[1].ends_with(" (and 2 more cases)"), "{}", lines[1]);
    // 16 that fail, of which 9 are told.
    let last =
        "::error title=And 27 more::7 errors, 3 warnings, 17 notices are in the job's summary and in the report.";
    assert_eq!(lines[9], last);
}

/// A record whose summary does not fit.
fn large() -> Record {
    let mut record = with_errors(mixed());
    let template = record.verdicts[1].clone();
    for n in 0..400 {
        let outcome = if n % 2 == 0 { Outcome::Pass } else { Outcome::Fail };
        let picture = Some(format!("pictures/curtain-arcade/minus-q/{n}.png"));
        record.verdicts.push(Verdict { gate: format!("gate {n}"), outcome, picture, ..template.clone() });
    }
    record
}

#[test]
fn a_summary_loses_pictures_first_then_what_passed_then_rows() {
    let (record, base) = (large(), "https://example.org".parse().unwrap());
    let whole = github::summary(&record, Some(&base), usize::MAX).unwrap();
    assert!(!whole.contains("not shown"));
    let counts = |text: &str| {
        [text.matches("![").count(), text.matches("| at least 0.1 |\n").count(), text.matches("| <b>FAIL</b>").count()]
    };
    let all = counts(&whole);
    assert!(all[0] > 200 && all[1] >= 200 && all[2] == 201, "{all:?}");
    let mut seen = [false; 3];
    for room in (2500..whole.len()).step_by(997) {
        let text = github::summary(&record, Some(&base), room).unwrap();
        assert!(text.len() <= room && text.len() + 2000 > room, "{} of {room}", text.len());
        let kept = counts(&text);
        let cut: Vec<bool> = kept.iter().zip(&all).map(|(kept, all)| kept < all).collect();
        assert!(cut[0], "the pictures are the first to go");
        assert!(!cut[1] || kept[0] == 0, "{kept:?}");
        assert!(!cut[2] || kept[1] == 0, "{kept:?}");
        assert!(text.contains("\n<details>") && text.ends_with("</details>\n"));
        let missing: usize =
            text.lines().filter_map(|l| l.strip_prefix('_')?.split_once(" of these ")?.0.parse::<usize>().ok()).sum();
        let rows = |text: &str| text.lines().filter(|l| l.starts_with("| ") || l.starts_with("![")).count();
        assert_eq!(rows(&text) + missing, rows(&whole), "every row is shown or counted");
        for (i, cut) in cut.iter().enumerate() {
            seen[i] |= cut;
        }
    }
    assert_eq!(seen, [true; 3]);
    assert_eq!(github::summary(&record, None, 100), None);
}

#[test]
fn what_the_step_wrote_before_counts() {
    let dir = tempfile::tempdir().unwrap();
    let mut record = large();
    let template = record.verdicts[1].clone();
    let more = |n| Verdict { gate: format!("{n} ").repeat(2000), reason: "x".repeat(100_000), ..template.clone() };
    record.verdicts.extend((0..3000).map(more));
    let folder = dir.path().join("out");
    let step = dir.path().join("step.md");
    for before in [0, 600_000, 999_990, 2_000_000] {
        fs::write(&step, "x".repeat(before)).unwrap();
        let written = github::write(&record, None, Some(&step), &folder).unwrap();
        let size = fs::metadata(&step).unwrap().len() as usize;
        if before > 900_000 {
            assert_eq!((written, size), (github::Written::NoRoom(folder.join("summary.md")), before));
            assert!(fs::metadata(folder.join("summary.md")).unwrap().len() < 1 << 20);
        } else {
            assert_eq!(written, github::Written::Appended(step.clone()));
            assert!(size > 990_000 && size < 1 << 20, "{size}");
        }
    }
    let gone = dir.path().join("gone").join("step.md");
    let error = github::write(&record, None, Some(&gone), &folder).unwrap_err().to_string();
    assert!(error.contains("GITHUB_STEP_SUMMARY") && error.contains("step.md"), "{error}");
}

/// What a name might do.
const HOSTILE: &str = "a|b`c\n::error::x\r\n##[add-mask]y<script>]]>&amp;\"'\u{1b}[31m\u{0}\u{fffe}\u{202e}![i](http://e/x) ../../x %0A,:";

#[test]
fn names_break_neither_xml_nor_tables_nor_annotations() {
    let dir = tempfile::tempdir().unwrap();
    let mut record = with_errors(mixed());
    for v in &mut record.verdicts {
        v.gate = format!("{} {HOSTILE}", v.gate);
        v.reason = HOSTILE.to_owned();
        v.place = Some(HOSTILE.to_owned());
        v.metric.note = Some(HOSTILE.to_owned());
    }
    for g in &mut record.idle_gates {
        (g.gate, g.reason) = (format!("{} {HOSTILE}", g.gate), HOSTILE.to_owned());
    }
    record.suite.name = HOSTILE.to_owned();
    record.suite.description = HOSTILE.to_owned();
    record.tool = HOSTILE.to_owned();
    (record.machine.cpu, record.machine.gpu) = (HOSTILE.to_owned(), HOSTILE.to_owned());
    record.cases[1].error = Some(HOSTILE.to_owned());
    record.scenes[0].judge_error = Some(HOSTILE.to_owned());
    record.incomplete = Some(HOSTILE.to_owned());
    record.timing.began = HOSTILE.to_owned();
    record.timing.seconds = 1e12;
    record.timing.judges.insert("curtain-arcade".to_owned(), 1e12);
    let folder = written(dir.path(), &record);
    let (code, out, told) = aogauge(&["report", text(&folder), "--format", "junit,github"]);
    assert_eq!(code, 0, "{told}");
    let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["junit.xml", "record.json", "summary.md"]);
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);

    let report = read(&fs::read_to_string(folder.join("junit.xml")).unwrap());
    assert_eq!(tests(&report).len(), 11);
    assert!(
        tests(&report).iter().any(|t| t.name.as_str().contains("a|b`c ::error::x  ##[add-mask]y<script>]]>&amp;\"'"))
    );

    let summary = fs::read_to_string(folder.join("summary.md")).unwrap();
    assert!(!summary.contains("<script") && !summary.contains("![") && !summary.contains("http://"), "{summary}");
    assert!(summary.chars().all(|c| c == '\n' || !c.is_control()));
    let mut columns = 0;
    for line in summary.lines() {
        let cells = line.matches('|').count();
        if line.starts_with('|') {
            assert!(columns == 0 || cells == columns, "{line}");
            columns = cells;
        } else {
            assert_eq!(cells, 0, "{line}");
            columns = 0;
        }
    }
    // A table's first row, its line of dashes and its rows: 2, 4, 2 and 1 of them.
    assert_eq!(summary.lines().filter(|l| l.starts_with('|')).count(), 4 * 2 + 2 + 4 + 2 + 1);

    assert_eq!(out.lines().count(), 9, "{out}");
    for line in out.lines() {
        let command = line.strip_prefix("::").unwrap();
        let (head, message) = command.split_once("::").unwrap();
        let (kind, title) = head.split_once(" title=").unwrap();
        assert!(["error", "warning", "notice"].contains(&kind), "{line}");
        assert!(!title.contains([':', ',', '\r']) && !message.contains('\r'), "{line}");
        assert!(!line.contains("%0A") || line.contains("%250A"), "{line}");
    }
    assert!(told.lines().all(|l| !l.trim_start().starts_with("::") && !l.contains("##[")), "{told}");
}

/// Names become paths: none leads out of the folder, and nothing is written then.
#[test]
fn a_record_whose_names_lead_elsewhere_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let evil = "../../x";
    type Change = fn(&mut Value, &str);
    let changes: [(&str, Change); 13] = [
        ("scene", |r, e| r["scenes"][0]["name"] = json!(e)),
        ("scene of a case", |r, e| r["cases"][0]["case"]["scene"] = json!(e)),
        ("estimator of a case", |r, e| r["cases"][0]["case"]["estimator"] = json!(e)),
        ("scene of a verdict", |r, e| r["verdicts"][0]["scene"] = json!(e)),
        ("case of a verdict", |r, e| r["verdicts"][0]["case"]["scene"] = json!(e)),
        ("estimator of the suite", |r, e| r["suite"]["estimators"][0] = json!(e)),
        ("classic", |r, e| r["suite"]["classic"] = json!(e)),
        ("method", |r, e| r["suite"]["methods"][e] = r["suite"]["methods"]["classic"].clone()),
        ("pooled", |r, e| r["pooled"][0]["estimator"] = json!(e)),
        ("image of a scene", |r, e| r["scenes"][0]["image"] = json!(e)),
        ("image of a case", |r, e| r["cases"][0]["image"] = json!(e)),
        ("image of the judge", |r, e| r["scenes"][0]["judge"]["image"] = json!(e)),
        ("picture", |r, e| r["verdicts"][0]["picture"] = json!(e)),
    ];
    for (what, change) in changes {
        for name in [evil, "/etc/x", "a\n::error::x", "", "a b`|.png"] {
            let mut record = serde_json::to_value(stored()).unwrap();
            change(&mut record, name);
            let folder = written(dir.path(), &record);
            for format in ["markdown", "junit,github,json"] {
                let (code, out, told) = aogauge(&["report", text(&folder), "--format", format]);
                assert_eq!((code, out.as_str()), (2, ""), "{what} '{name}': {told}");
                assert!(told.contains("legal name") || told.contains("the image path"), "{what} '{name}': {told}");
                assert!(told.lines().count() == 1, "{told}");
            }
            assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "{what}");
        }
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn usage_is_explained() {
    let dir = tempfile::tempdir().unwrap();
    let folder = written(dir.path(), &stored());
    let (code, help, _) = aogauge(&["report", "--help"]);
    assert_eq!(code, 0);
    for part in ["--gate", "--image-base <URL>", "markdown,html,junit", "junit.xml", "Exit codes: 0"] {
        assert!(help.contains(part), "{part}: {help}");
    }
    for (args, part) in [
        (&["report", text(&folder), "--format", "xml"][..], "possible values: markdown"),
        (&["report", text(&folder), "--format", "junit", "--image-base", "https://x.y"], "--format github only"),
        (
            &["report", text(&folder), "--format", "github", "--image-base", "reports/1"],
            "give an address like https://",
        ),
        (&["run", "smoke", "--report", "json", "--format", "json"], "both print on standard output"),
        (&["run", "smoke", "--image-base", "https://x.y"], "--report github only"),
        (&["run", "smoke", "--shard", "1/2", "--report", "junit"], "cannot be used with"),
        (&["report", "nowhere", "--format", "junit"], "not a record"),
    ] {
        let (code, out, told) = aogauge(args);
        assert_eq!((code, out.as_str()), (2, ""), "{args:?}: {told}");
        assert!(told.contains(part), "{args:?}: {told}");
    }
}

const SUITE: &str = r#"
description = "x|y <b>`z`</b> ![i](http://e/x)"
scenes = ["plane"]
rays = [4]
replicates = 2
converged_rays = 16
look_rays = 1
[[estimator]]
name = "classic"
kind = "classic"
[[gate]]
name = "a|b\n::error::x `c` <script> ##[add-mask]y"
metric = "openness"
region = "all"
min = 2.0
known_failure = "\n::add-mask::x|y\n\n# z"
[[gate]]
name = "fails"
metric = "openness"
region = "all"
min = 2.0
"#;

/// What is made beside the record is what `report` makes of it.
#[test]
fn run_and_merge_make_the_same_reports() {
    let dir = tempfile::tempdir().unwrap();
    let [suite, out, merged, shard] = ["s.toml", "out", "merged", "shard"].map(|n| dir.path().join(n));
    fs::write(&suite, SUITE).unwrap();
    let run = ["run", text(&suite), "--renderer", "cpu", "--no-cache"];
    let all = ["--report", "markdown,junit", "--report", "github,json"];
    let (code, printed, told) = aogauge(&[&run[..], &["--out", text(&out)], &all].concat());
    assert_eq!(code, 1, "{told}");
    let json: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!((&json["exit_code"], json["files"].as_array().unwrap().len()), (&json!(1), 3));
    // The table that a run prints holds no command for the runner, the annotations aside.
    let commands = |l: &&str| l.trim_start().starts_with("::") || l.contains("##[");
    assert_eq!(told.lines().filter(commands).count(), 2, "{told}");
    assert!(
        told.lines()
            .filter(commands)
            .all(|l| l.starts_with("::error title=Fail%3A fails::") || l.starts_with("::notice "))
    );

    let report = fs::read_to_string(out.join("report.md")).unwrap();
    let head = report.split("\n## ").nth(1).unwrap();
    // Every row of a table has the cells of its head.
    for table in head.split("\n\n").filter(|t| t.trim_start().starts_with('|')) {
        let cells: Vec<usize> = table.trim().lines().map(|l| l.matches('|').count()).collect();
        assert!(cells.len() > 2 && cells.iter().all(|n| *n == cells[0]), "{table}");
    }
    assert!(!report.contains("<script") && !report.contains("![i]") && !report.contains("\n# z"), "{head}");

    let files = ["report.md", "junit.xml", "summary.md"].map(|f| fs::read_to_string(out.join(f)).unwrap());
    let copy = dir.path().join("copy");
    let (code, again, _) = aogauge(
        &[&["report", text(&out), "--out", text(&copy), "--format", "markdown,junit,github,json", "--gate"][..]]
            .concat(),
    );
    assert_eq!(code, 1);
    assert_eq!(files, ["report.md", "junit.xml", "summary.md"].map(|f| fs::read_to_string(copy.join(f)).unwrap()));
    assert_eq!(again.replace(text(&copy), text(&out)), printed);
    assert!(copy.join("pictures/plane/look/classic.png").exists() && !copy.join("record.json").exists());

    let (code, _, told) = aogauge(&[&run[..], &["--out", text(&shard), "--shard", "1/1"]].concat());
    assert_eq!(code, 0, "{told}");
    let (code, printed, told) = aogauge(&["merge", text(&shard), "--out", text(&merged), "--report", "junit,github"]);
    assert_eq!(code, 1, "{told}");
    assert!(printed.starts_with("::error title=Fail%3A fails::plane/classic/cpu/4: "), "{printed}");
    assert!(merged.join("junit.xml").exists() && !merged.join("report.md").exists(), "{told}");
    assert!(told.contains("junit.xml") && !told.contains("report.md"), "{told}");
}
