//! A run that adds replicates until its verdicts are decided: the same on any number
//! of threads, in shards, and when it was killed in between.

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
    // As near to what is measured, .90237, as no such number of replicates can tell.
    let gate = "metric = \"openness\"\nregion = \"footprint\"\nestimators = [\"classic\"]";
    let never = [
        ("[4, 16]", "[4]"),
        ("metric = \"bias\"\nregion = \"footprint\"", gate),
        ("equals = 0.0\n", "equals = 0.90237\n"),
        ("within = 0.02", "within = 0.0002"),
    ];
    let never = never.iter().fold(SUITE.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    fs::write(dir.path().join("never.toml"), never).unwrap();
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

fn aogauge(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
    command.current_dir(DIR.path()).args(args);
    command
}

fn command_of(suite: &str, most: &str, out: &Path, more: &[&str]) -> Command {
    let mut command = aogauge(&["run", suite, "--renderer", "cpu", "--no-cache", "--until-sure"]);
    command.args(["--max-replicates", most, "--out", out.to_str().unwrap()]).args(more);
    command
}

fn command(out: &Path, more: &[&str]) -> Command {
    command_of("small.toml", "64", out, more)
}

fn run(out: &Path, more: &[&str]) -> Output {
    command(out, more).output().unwrap()
}

fn ok(ended: &Output) {
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
}

fn ends_with(ended: &Output, code: i32) {
    assert_eq!(ended.status.code(), Some(code), "{}", String::from_utf8_lossy(&ended.stderr));
}

fn merge(parts: &[PathBuf], out: &Path, more: &[&str]) -> Output {
    aogauge(&["merge", "--out", out.to_str().unwrap()]).args(parts).args(more).output().unwrap()
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
    assert_eq!(WHOLE["until_sure"], json!({ "max_replicates": 64, "max_time": null, "undecided": [] }));
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
    ok(&merge(&parts, &merged, &[]));
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

/// Asks a run to end some time after the first look at a scene that needs many.
#[cfg(unix)]
fn interrupted(mut command: Command, out: &Path, after: Duration) -> Output {
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    while !out.join(".aogauge-run/units/curtain-open+extended+cpu+4.json").exists() {
        assert!(child.try_wait().unwrap().is_none(), "the run was through before it could be interrupted");
        std::thread::sleep(Duration::from_millis(1));
    }
    std::thread::sleep(after);
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    child.wait_with_output().unwrap()
}

/// Every case has the suite's replicates or more by then, and no verdict: what is missing can
/// be seen in the looks alone.
#[cfg(unix)]
#[test]
fn interrupted_between_looks_it_is_incomplete_and_goes_on() {
    let whole = out("never");
    ends_with(&command_of("never.toml", "128", &whole, &[]).output().unwrap(), 6);
    let whole = record(&whole);
    let undecided = whole["until_sure"]["undecided"].as_array().unwrap();
    assert!(!undecided.is_empty());
    for u in undecided {
        assert_eq!(
            [&u["scene"], &u["by"], &u["replicates"]],
            [&json!("curtain-open"), &json!("max-replicates"), &json!(128)]
        );
    }
    for after in [0, 20, 60] {
        let out = out(&format!("never-{after}"));
        let command = || command_of("never.toml", "128", &out, &[]);
        ends_with(&interrupted(command(), &out, Duration::from_millis(after)), 5);
        let half = record(&out);
        assert_eq!(half["incomplete"], "it was interrupted");
        assert!(out.join(".aogauge-run/units").exists());
        // What is told of a case is told of the replicates that it is measured from.
        for case in half["cases"].as_array().unwrap().iter().filter(|c| !c["looks"].is_null()) {
            let [replicates, look] = ["replicates", "looks"].map(|n| case[n].as_u64().unwrap());
            assert_eq!(replicates, 4 << (look - 1), "{case}");
        }
        ends_with(&command().output().unwrap(), 6);
        assert_eq!(record(&out), whole);
    }
}

#[cfg(unix)]
#[test]
fn an_interrupted_shard_is_not_done_and_goes_on() {
    let (part, whole, merged) = (out("cut"), out("cut-whole"), out("cut-merged"));
    let shard = || command_of("never.toml", "128", &part, &["--shard", "1/1"]);
    ends_with(&interrupted(shard(), &part, Duration::from_millis(20)), 5);
    let told: Value = serde_json::from_str(&fs::read_to_string(part.join("shard.json")).unwrap()).unwrap();
    assert!(
        told["incomplete"].as_str().unwrap().contains("not all replicates that it asks for"),
        "{}",
        told["incomplete"]
    );
    ends_with(&merge(std::slice::from_ref(&part), &merged, &[]), 5);
    ok(&shard().output().unwrap());
    ends_with(&merge(&[part], &merged, &[]), 6);
    ends_with(&command_of("never.toml", "128", &whole, &[]).output().unwrap(), 6);
    assert_eq!(record(&merged), record(&whole));
}

#[test]
fn a_budget_ends_it_undecided() {
    let some = out("budget");
    let ended = run(&some, &["--max-time", "0.001"]);
    assert_eq!(ended.status.code(), Some(6), "{}", String::from_utf8_lossy(&ended.stderr));
    let record = record(&some);
    assert_eq!(counts(&record, "curtain-open"), BTreeSet::from([(4, 1)]));
    assert!(record["summary"]["inconclusive"].as_u64().unwrap() > 0);
    let told = &record["until_sure"];
    assert_eq!(told["max_time"], 0.001);
    let ended = json!({ "scene": "curtain-open", "rays": 4, "replicates": 4, "by": "max-time" });
    assert!(told["undecided"].as_array().unwrap().contains(&ended), "{told}");

    // No shard comes to a second look either, and their record says the same.
    let parts: Vec<PathBuf> = (1..=2).map(|k| out(&format!("late-{k}"))).collect();
    for (k, part) in (1..).zip(&parts) {
        ok(&run(part, &["--max-time", "0.001", "--shard", &format!("{k}/2")]));
    }
    let merged = out("late");
    ends_with(&merge(&parts, &merged, &[]), 6);
    assert_eq!(self::record(&merged), record);
    ok(&run(&parts[1], &["--max-time", "100", "--shard", "2/2"]));
    let mixed = merge(&parts, &out("mixed"), &[]);
    ends_with(&mixed, 2);
    assert!(String::from_utf8_lossy(&mixed.stderr).contains("their time to go on until sure differs"));
}

/// What an unfinished run had rendered beyond the budget of this one is not left in its images.
#[test]
fn a_record_holds_the_replicates_that_it_tells_of() {
    let some = out("shorter");
    let mut child = command(&some, &[]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let unit = some.join(".aogauge-run/units/curtain-open+classic+cpu+4.json");
    let first = loop {
        if let Ok(text) = fs::read_to_string(&unit) {
            break text;
        }
        assert!(child.try_wait().unwrap().is_none(), "the run was through before it could be killed");
        std::thread::sleep(Duration::from_millis(1));
    };
    // Until the second look at the case.
    while fs::read_to_string(&unit).is_ok_and(|text| text == first) {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let was_killed = unit.exists();
    run(&some, &["--max-time", "0.001"]);
    let record = record(&some);
    let case = &record["cases"].as_array().unwrap()[4];
    assert_eq!([&case["case"]["scene"], &case["case"]["rays"]], [&json!("curtain-open"), &json!(4)]);
    let layers = aogauge::layers::Layers::read(&some.join(case["image"].as_str().unwrap())).unwrap();
    let there = (0..).take_while(|r| layers.get(&format!("replicate-{r:04}")).is_some()).count();
    assert!(was_killed && Some(there as u64) == case["replicates"].as_u64(), "{there}: {case}");
}

const ARCADE: &str = r#"
description = "x"
scenes = ["curtain-arcade", "plane"]
rays = [4]
replicates = 8
seed = 1
converged_rays = 64
look_rays = 1
judge = { precision = 0.2, paths = 4, replicates = 8, max_replicates = 16 }
[[estimator]]
name = "classic"
kind = "classic"
[[gate]]
name = "g"
metric = "contrast-error"
"#;

#[test]
fn a_gate_against_the_base_is_looked_at_in_one_piece_and_in_shards() {
    fs::write(DIR.path().join("base.toml"), format!("{ARCADE}against = 'base'\nmax = 0.01")).unwrap();
    let base = out("base");
    let mut first =
        aogauge(&["run", "base.toml", "--renderer", "cpu", "--no-cache", "--seed", "2", "--no-base", "--out"]);
    ok(&first.arg(&base).output().unwrap());
    let given = ["--base", base.to_str().unwrap()];
    let whole = out("base-whole");
    command_of("base.toml", "64", &whole, &given).output().unwrap();
    let whole = record(&whole);
    // Noise of two judges and of 8 replicates decides nothing at a first look.
    let replicates = whole["cases"][0]["replicates"].as_u64().unwrap();
    assert!(replicates > 4 && whole["verdicts"][0]["p_holds"].is_object(), "{}", whole["verdicts"]);
    let parts: Vec<PathBuf> = (1..=2).map(|k| out(&format!("base-{k}"))).collect();
    for (k, part) in (1..).zip(&parts) {
        ok(&command_of("base.toml", "64", part, &[&given[..], &["--shard", &format!("{k}/2")]].concat())
            .output()
            .unwrap());
    }
    let merged = out("base-merged");
    let ended = merge(&parts, &merged, &given);
    assert!(ended.status.code() != Some(2), "{}", String::from_utf8_lossy(&ended.stderr));
    assert_eq!(record(&merged), whole);
    for (base, says) in [
        (vec![], "a base record: give it here, too (--base)"),
        (vec!["--base", merged.to_str().unwrap()], "the base record is not that of the shards"),
    ] {
        let refused = merge(&parts, &out("base-refused"), &base);
        ends_with(&refused, 2);
        assert!(
            String::from_utf8_lossy(&refused.stderr).contains(says),
            "{}",
            String::from_utf8_lossy(&refused.stderr)
        );
    }
}

/// The limit holds at the first look; whether it warns takes more of them.
#[test]
fn a_warning_is_looked_at_until_it_is_decided() {
    let warning = out("warning");
    let limits = |warn: f64| format!("{ARCADE}max = 1.0\nwarn = {{ max = {warn} }}");
    fs::write(DIR.path().join("warn.toml"), limits(0.01)).unwrap();
    ok(&command_of("warn.toml", "256", &warning, &[]).output().unwrap());
    let clear = record(&warning);
    assert_eq!(counts(&clear, "curtain-arcade"), BTreeSet::from([(4, 1)]));
    assert_eq!(clear["verdicts"][0]["outcome"], "warn");
    // Near what is measured.
    let value = clear["verdicts"][0]["metric"]["value"].as_f64().unwrap();
    fs::write(DIR.path().join("warn.toml"), limits(value)).unwrap();
    ok(&command_of("warn.toml", "64", &warning, &[]).output().unwrap());
    let near = record(&warning);
    assert!(counts(&near, "curtain-arcade").first().unwrap().0 > 4, "{}", near["verdicts"]);
}

#[test]
fn the_cost_of_going_on_is_not_told_as_a_bound() {
    let told = run(&out("nothing"), &["--dry-run"]);
    ok(&told);
    let stderr = String::from_utf8_lossy(&told.stderr);
    assert!(stderr.contains("it counts 8 replicates a case, and a case takes 4 to 64"), "{stderr}");
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
    let ended = record["until_sure"]["undecided"].as_array().unwrap();
    assert!(ended.len() == 1 && ended[0]["by"] == "floor", "{ended:?}");
    let open = record["verdicts"].as_array().unwrap().iter().filter(|v| v["outcome"] == "inconclusive");
    for verdict in open {
        assert!(verdict["floor"]["se"].as_f64() > Some(0.0) && verdict["floor"]["df"] == 3.0, "{verdict:#}");
        let reason = verdict["reason"].as_str().unwrap();
        assert!(reason.contains("would not decide: the noise of the converged image is too large"), "{reason}");
    }
}

/// The same noise, and it is only what warns that it keeps open.
#[test]
fn it_ends_where_replicates_cannot_decide_what_warns() {
    let out = out("floor-warns");
    let head = ARCADE.split("[[gate]]").next().unwrap();
    let head = head.replace("\"curtain-arcade\", \"plane\"", "\"curtain-open\"");
    let head = head.replace("converged_rays = 64", "converged_rays = 16");
    let gate = "[[gate]]\nname = \"g\"\nmetric = \"bias\"\nregion = \"footprint\"\nmax = 0.5\nwarn = { max = 0.003 }\n";
    fs::write(DIR.path().join("floor-warns.toml"), head + gate).unwrap();
    ok(&command_of("floor-warns.toml", "1024", &out, &[]).output().unwrap());
    let record = record(&out);
    let (replicates, _) = counts(&record, "curtain-open").pop_first().unwrap();
    assert!(replicates <= 64, "{replicates}");
    let ended = json!([{ "scene": "curtain-open", "rays": 4, "replicates": replicates, "by": "floor" }]);
    assert_eq!(record["until_sure"]["undecided"], ended);
    assert_eq!(record["verdicts"][0]["outcome"], "pass");
}

/// A curtain before a wall, where the false highlight of classic AO is weak.
const WALL: &str = r#"
description = "x"
[ao]
radius = 0.25
[environment]
radiance = 1.0
[measure]
center = [0, 0, 0]
normal = [0, 1, 0]
transect = [1, 0, 0]
clearance = 0.08
resolution = [104, 16]
[look]
eye = [0.75, 0.42, 1.15]
target = [0, 0.08, 0]
resolution = [32, 32]
[[object]]
name = "ground"
shape = { plane = { center = [0, 0, 0], u = [0, 0, 12], v = [12, 0, 0] } }
[[object]]
name = "wall"
shape = { plane = { center = [-0.5, 1.5, 0], u = [0, 1.5, 0], v = [0, 0, 8] } }
[[object]]
name = "curtain"
occluder = true
shape = { curtain = { thickness = 0.02, gap = 0.10, height = 1.0, length = 6.0 } }
"#;

/// What is removed has no value while there is no telling whether there is anything to remove.
#[test]
fn what_has_no_value_yet_is_looked_at_again() {
    fs::write(DIR.path().join("wall.toml"), WALL).unwrap();
    let head = SUITE.split("[[gate]]").next().unwrap().replace("rays = [4, 16]", "rays = [1]");
    let head = head.replace("converged_rays = 256", "converged_rays = 64").replace("\"clipped\"", "\"counts\"");
    let rendered = |scene: &str, seed: &str, judge: &str| {
        let head = head.replace("\"plane\", \"curtain-open\"", &format!("\"{scene}\""));
        let head = head.replace("precision = 1.0, paths = 1, replicates = 8, max_replicates = 8", judge);
        let gate = "[[gate]]\nname = \"g\"\nmetric = \"removed\"\nestimators = [\"extended\"]\nmin = 0.1\n";
        fs::write(DIR.path().join("removed.toml"), head + gate).unwrap();
        let out = out(&format!("removed-{seed}"));
        command_of("removed.toml", "256", &out, &["--seed", seed]).output().unwrap();
        record(&out)
    };
    let good = "precision = 0.1, paths = 8, replicates = 16, max_replicates = 16";
    let wall = rendered("wall.toml", "5", good);
    let (replicates, _) = counts(&wall, "wall").pop_first().unwrap();
    assert!(replicates > 4, "{}", wall["verdicts"]);
    assert_eq!(wall["verdicts"][0]["outcome"], "pass", "{}", wall["verdicts"]);
    assert_eq!(wall["until_sure"]["undecided"], json!([]));

    // The noise of this judge hides it for good, and that is told.
    let hidden = rendered("wall.toml", "1", "precision = 1.0, paths = 1, replicates = 4, max_replicates = 4");
    let (replicates, _) = counts(&hidden, "wall").pop_first().unwrap();
    assert!(replicates <= 64 && hidden["verdicts"][0]["metric"]["value"].is_null(), "{}", hidden["verdicts"]);
    let ended = json!([{ "scene": "wall", "rays": 1, "replicates": replicates, "by": "floor" }]);
    assert_eq!(hidden["until_sure"]["undecided"], ended);

    // Under the open sky there surely is nothing to remove.
    let none = rendered("curtain-open", "2", good);
    assert_eq!(counts(&none, "curtain-open"), BTreeSet::from([(4, 1)]));
    assert!(none["verdicts"][0]["metric"]["value"].is_null());
    assert_eq!(none["until_sure"]["undecided"], json!([]));
}

/// The first gate is decided at once; that of the other estimator, of rays of its own, never is.
#[test]
fn cases_held_against_each_other_end_together() {
    let out = out("together");
    let head = SUITE.split("[[gate]]").next().unwrap().replace("\"plane\", ", "");
    let gate = "[[gate]]\nmetric = \"openness\"\nregion = \"footprint\"\n";
    let first =
        format!("{gate}name = \"a\"\nestimators = [\"classic\"]\nrays = [4]\nagainst = \"extended\"\nmax = 0.9\n");
    let never = format!("{gate}name = \"b\"\nestimators = [\"extended\"]\nequals = 0.7\nwithin = 1e-6\n");
    let text = format!("{head}rays = 16\n{first}{}", never.replace("equals = 0.7", "equals = 0.69"));
    fs::write(DIR.path().join("together.toml"), text).unwrap();
    command_of("together.toml", "16", &out, &[]).output().unwrap();
    let record = record(&out);
    assert_eq!(counts(&record, "curtain-open"), BTreeSet::from([(16, 3)]));
    let first = record["verdicts"].as_array().unwrap().iter().find(|v| v["gate"] == "a").unwrap();
    assert_eq!(first["outcome"], "pass", "{first}");
    assert!((first["spent"].as_f64().unwrap() - aogauge::stats::spending(3)).abs() < 1e-12, "{first}");
    let ended = json!([{ "scene": "curtain-open", "rays": 4, "replicates": 16, "by": "max-replicates" }]);
    assert_eq!(record["until_sure"]["undecided"], ended);
}
