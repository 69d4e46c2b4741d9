//! `aogauge compare RECORD RECORD` from outside: what is told, in which order, in how many
//! bytes, and what is not told.

use aogauge::{
    changes::{changes, marker},
    layers::{Layers, pixel_hash},
    metrics::{Metric, MetricName, regions::Region},
    record::Record,
    stats::{Estimate, SplitMix64},
};
use serde_json::{Value, json};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::LazyLock,
};
use tempfile::TempDir;

const SCENE: &str = include_str!("../../benches/golden_verify_scene.toml");
const SUITE: &str = r#"
name = "tiny"
description = "x"
scenes = ["scene.toml", "plane"]
rays = [4]
replicates = 8
converged_rays = 32
look_rays = 1
judge = { precision = 1.0, paths = 1, replicates = 4, max_replicates = 4 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "not black"
metric = "openness"
region = "all"
min = 0.1
[[gate]]
name = "not white"
metric = "openness"
region = "all"
scenes = ["scene"]
max = 0.999
"#;

fn aogauge(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).env("XDG_CACHE_HOME", "/dev/null").args(args).output().unwrap()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Compares, checks the exit code and returns both outputs.
fn compare(code: i32, base: &Path, new: &Path, more: &[&str]) -> [String; 2] {
    let output = aogauge(&[&["compare", text(base), text(new)], more].concat());
    let [out, err] = [output.stdout, output.stderr].map(|o| String::from_utf8(o).unwrap());
    assert_eq!(output.status.code(), Some(code), "{out}{err}");
    [out, err]
}

fn found(code: i32, base: &Path, new: &Path, more: &[&str]) -> Value {
    let [out, _] = compare(code, base, new, &[&["--format", "json"], more].concat());
    serde_json::from_str(&out).unwrap()
}

fn markdown(code: i32, base: &Path, new: &Path) -> String {
    let [out, _] = compare(code, base, new, &["--format", "markdown"]);
    assert!(out.len() < 65_536 && out.starts_with("<!-- aogauge: tiny -->\n### "), "{} bytes: {out:.200}", out.len());
    out
}

struct Runs {
    dir: TempDir,
    /// Seeds 1 and 2.
    out: [PathBuf; 2],
}

/// Two records for all tests.
static RUNS: LazyLock<Runs> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("scene.toml"), SCENE).unwrap();
    let suite = dir.path().join("suite.toml");
    fs::write(&suite, SUITE).unwrap();
    let out = ["1", "2"].map(|seed| {
        let out = dir.path().join(seed);
        let run = aogauge(&["run", text(&suite), "--out", text(&out), "--renderer", "cpu", "--seed", seed]);
        assert_eq!(run.status.code(), Some(0), "{}", String::from_utf8_lossy(&run.stderr));
        out
    });
    Runs { dir, out }
});

fn copied(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() { copied(&path, &target) } else { fs::copy(&path, &target).map(|_| ()).unwrap() }
    }
}

/// A copy of the first record with changes of its own.
fn edited(name: &str, change: impl FnOnce(&mut Value)) -> PathBuf {
    let out = RUNS.dir.path().join(name);
    copied(&RUNS.out[0], &out);
    let path = out.join("record.json");
    let mut record = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    change(&mut record);
    fs::write(&path, record.to_string()).unwrap();
    out
}

fn items<'a>(value: &'a mut Value, list: &str) -> &'a mut Vec<Value> {
    value[list].as_array_mut().unwrap()
}

/// A metric of a case.
fn metric<'a>(record: &'a mut Value, case: usize, name: &str, region: &str) -> &'a mut Value {
    let metrics = items(&mut record["cases"][case], "metrics");
    metrics.iter_mut().find(|m| m["name"] == name && m["region"] == region).unwrap()
}

fn strings<'a>(list: &'a Value, field: &str) -> Vec<&'a str> {
    list.as_array().unwrap().iter().map(|v| v[field].as_str().unwrap()).collect()
}

#[test]
fn a_record_is_like_itself_and_like_another_seed() {
    let [one, two] = &RUNS.out;
    let same = found(0, one, one, &[]);
    assert_eq!((&same["cases"]["compared"], &same["cases"]["identical"]), (&json!(4), &json!(4)));
    assert_eq!((&same["metrics"]["tested"], &same["metrics"]["incomparable"]), (&json!(0), &json!(0)));
    assert!(same["metrics"]["identical"].as_u64() > Some(40));
    for list in ["settings", "incomparable", "verdicts", "images"] {
        assert_eq!(same[list], json!([]), "{list}");
    }
    let comment = markdown(0, one, one);
    assert!(comment.contains("### ✅ PASS · tiny: no verdict got worse\n"), "{comment}");
    assert!(comment.contains("4 cases compared, 4 with images that are the same to the last bit."), "{comment}");
    assert_eq!(comment, markdown(0, one, one));

    let other = found(0, one, two, &[]);
    assert_eq!((&other["outcome"], &other["metrics"]["changed"]), (&json!("pass"), &json!([])));
    assert!(other["metrics"]["tested"].as_u64() > Some(40));
    assert_eq!(strings(&other["settings"], "what"), ["seed"]);
    let states = strings(&other["images"], "state");
    assert!(!states.is_empty() && !states.contains(&"moved"), "{other:#}");
    let [table, _] = compare(0, one, two, &[]);
    assert!(
        table.contains("tiny: no verdict got worse") && table.contains("Images: 0 moved, of 2 that differ"),
        "{table}"
    );
}

/// The known standard errors make the known p-values.
#[test]
fn metrics_come_by_significance_then_size_and_noise_is_not_listed() {
    let places = [
        ("openness", "all", 1e-3),
        ("openness", "left", 1e-3),
        ("openness", "right", 0.0),
        ("openness", "footprint", 0.0),
        ("rmse", "left", 6e-4),
        ("bias", "right", 1e-3),
    ];
    let set = |by: [f64; 6], hash: &'static str| {
        move |r: &mut Value| {
            for ((name, region, se), v) in places.into_iter().zip(by) {
                let m = metric(r, 0, name, region);
                (m["value"], m["se"], m["df"]) = (json!(v), json!(se), json!(7));
            }
            r["cases"][0]["hash"] = json!(hash);
        }
    };
    let base = edited("metrics-base", set([0.5, 0.5, 0.5, 0.5, 0.1, -0.01], "one"));
    let new = edited("metrics-new", |r| {
        set([0.53, 0.501, 0.6, 0.7, 0.12, -0.05], "other")(r);
        let lost = metric(r, 0, "mae", "right");
        (lost["value"], lost["note"]) = (Value::Null, json!("why not"));
    });
    let all = found(0, &base, &new, &[]);
    let metrics = &all["metrics"];
    let changed = metrics["changed"].as_array().unwrap();
    let word = |m: &Value, field: &str| m[field].as_str().unwrap().to_owned();
    let rows: Vec<String> =
        changed.iter().map(|m| ["metric", "region", "turn"].map(|f| word(m, f)).join(" ")).collect();
    // Without noise there is no doubt, so size decides; then t of 28, 24 and 21. Openness
    // of the left, with t of 0.7, is counted alone.
    let expected = [
        "openness footprint changed",
        "openness right changed",
        "bias right worse",
        "rmse left worse",
        "openness all changed",
    ];
    assert_eq!(rows, expected, "{metrics:#}");
    let tested = metrics["tested"].as_u64().unwrap();
    assert!(tested > 10);
    let bias = &changed[2];
    assert!((bias["difference"].as_f64().unwrap() + 0.04).abs() < 1e-12);
    // t(.975) of 14 degrees of freedom.
    let [lo, hi] = [0, 1].map(|i| bias["interval"][i].as_f64().unwrap());
    assert!((hi - lo - 2.0 * 2.144_787 * 0.001 * 2f64.sqrt()).abs() < 1e-8, "{lo} {hi}");
    let (p, adjusted) = (bias["p"].as_f64().unwrap(), bias["adjusted_p"].as_f64().unwrap());
    assert!(p > 0.0 && p < 1e-12 && (adjusted / p - (tested - 2) as f64).abs() < 1e-6, "{p} {adjusted}");
    assert_eq!((&metrics["lost"][0]["metric"], &metrics["lost"][0]["why"]), (&json!("mae"), &json!("why not")));
    let comment = markdown(0, &base, &new);
    for part in [
        &format!("<details><summary>Metrics: 2 worse, 3 changed by more than noise, of {tested} tested</summary>"),
        "### ⚠️ CHECK · tiny: no verdict got worse\n",
        "| <b>worse</b> | <code>scene/classic/cpu/4</code> | bias over right | -0.0100 | -0.0500 |",
        "share noise that the tests take for independent",
    ] {
        assert!(comment.contains(part), "{part}\n{comment}");
    }
}

/// 400 pairs of records of 40 metrics each where nothing changed: the chance of naming
/// any is .01, and more than 12 of 400 has a chance of 3e-4.
#[test]
fn where_nothing_changed_hardly_anything_is_named() {
    let mut base = Record::read(&RUNS.out[0]).unwrap();
    let (mut new, mut random, mut named) = (base.clone(), SplitMix64(3), 0);
    new.seed = 9;
    let mut normal = || {
        let [a, b] = [random.uniform(), random.uniform()];
        (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    };
    use MetricName::*;
    let names = [Openness, Contrast, ContrastError, Removed, Bias, Mae, Rmse, JudgeBias];
    for _ in 0..400 {
        for record in [&mut base, &mut new] {
            record.cases.truncate(1);
            record.scenes.iter_mut().for_each(|s| s.judge = None);
            let metrics = names.iter().flat_map(|&n| Region::ALL.map(|r| (n, r)));
            let mut one = |(name, region)| {
                let values: Vec<f64> = (0..16).map(|_| 0.5 + 0.1 * normal()).collect();
                Metric::new(name, Some(region), Ok(Estimate::of_mean(&values)))
            };
            record.cases[0].metrics = metrics.map(&mut one).collect();
        }
        let found = changes(&base, &new, vec![], false);
        assert_eq!(found.metrics.tested, 40);
        named += usize::from(!found.metrics.changed.is_empty());
    }
    assert!(named <= 12, "{named} of 400");
}

#[test]
fn verdicts_and_images_that_moved_come_first_and_fail() {
    let hostile = "a|b <script>alert(1)</script> `x` @someone #1";
    let new = edited("worse", |r| {
        let verdicts = items(r, "verdicts");
        for v in verdicts.iter_mut() {
            if v["gate"] == "not white" && v["case"]["estimator"] == "extended" {
                (v["outcome"], v["reason"]) = (json!("fail"), json!("the limit is broken"));
            }
            if v["gate"] == "not black" {
                v["gate"] = json!(hostile);
                v["outcome"] = json!("inconclusive");
            }
        }
        r["summary"]["fail"] = json!(1);
        let image = RUNS.dir.path().join("worse/images/scene/classic.cpu.4.exr");
        let mut layers = Layers::read(&image).unwrap();
        layers.layers.get_mut("mean").unwrap().iter_mut().for_each(|v| *v -= 0.1);
        r["cases"][0]["hash"] = json!(pixel_hash(layers.get("mean").unwrap()));
        layers.write(&image).unwrap();
    });
    let base = edited("worse-base", |r| {
        let verdicts = items(r, "verdicts");
        let first = verdicts.iter_mut().find(|v| v["gate"] == "not white" && v["case"]["estimator"] == "classic");
        first.unwrap()["outcome"] = json!("fail");
    });
    let all = found(1, &base, &new, &[]);
    let turns: Vec<(&str, &str)> =
        strings(&all["verdicts"], "turn").into_iter().zip(strings(&all["verdicts"], "new")).collect();
    assert_eq!(turns[0], ("worse", "fail"));
    assert_eq!(turns.last(), Some(&("better", "pass")));
    // A gate of another name is a gate gone and a gate new; its verdicts had none before.
    assert_eq!(
        (&all["gates"]["gone"][0]["gate"], &all["gates"]["new"][0]["gate"]),
        (&json!("not black"), &json!(hostile))
    );
    assert!(turns[1..turns.len() - 1].iter().all(|t| *t == ("changed", "inconclusive")), "{turns:?}");
    let image = &all["images"][0];
    assert_eq!((&image["state"], &image["case"]), (&json!("moved"), &json!("scene/classic/cpu/4")));
    assert!(
        (image["bias"].as_f64().unwrap() + 0.1).abs() < 1e-6 && (image["rmse"].as_f64().unwrap() - 0.1).abs() < 1e-6
    );
    assert!(image["what"].as_str().unwrap().contains("darker"), "{image}");
    let comment = markdown(1, &base, &new);
    assert!(comment.contains("### ❌ FAIL · tiny: 1 verdict got worse"), "{comment}");
    assert!(comment.contains("| <b>PASS → FAIL</b> | not white | <code>scene/extended/cpu/4</code> |"), "{comment}");
    assert!(!comment.contains("<script") && !comment.contains("@someone") && !comment.contains(" #1"), "{comment}");
    assert!(comment.contains("a&#124;b &lt;script&gt;"), "{comment}");
    // A table's rows are whole: as many cells as its head has.
    for row in comment.lines().filter(|l| l.starts_with('|')) {
        assert!(row.ends_with('|') && [3, 4, 5, 6].contains(&(row.matches('|').count() - 1)), "{row}");
    }
}

/// 3,000 cases, all of them worse and all with a changed metric.
#[test]
fn a_comment_has_a_limit_whatever_the_records_hold() {
    let many = |value: f64, outcome: &'static str| {
        move |r: &mut Value| {
            let (case, verdict) = (r["cases"][0].clone(), r["verdicts"][0].clone());
            *items(r, "cases") = (0..3000)
                .map(|i| {
                    let mut case = case.clone();
                    case["case"]["estimator"] = json!(format!("e{i}"));
                    let mut m = case["metrics"][0].clone();
                    (m["value"], m["se"], m["df"]) = (json!(value), json!(1e-6), json!(7));
                    case["metrics"] = json!([m]);
                    case["hash"] = json!(format!("{value}"));
                    case["image"] = json!("images/none.exr");
                    case
                })
                .collect();
            *items(r, "verdicts") = (0..3000)
                .map(|i| {
                    let mut verdict = verdict.clone();
                    verdict["case"]["estimator"] = json!(format!("e{i}"));
                    verdict["gate"] = json!(format!("{}<&|", "long ".repeat(400)));
                    (verdict["outcome"], verdict["reason"]) = (json!(outcome), json!("|\n<b>".repeat(100)));
                    verdict
                })
                .collect();
            r["machine"]["cpu"] = json!(format!("{value}{}", "<".repeat(100_000)));
            r["suite"]["replicates"] = json!(8);
        }
    };
    let (base, new) = (edited("many-base", many(0.5, "pass")), edited("many-new", many(0.6, "fail")));
    let comment = markdown(1, &base, &new);
    assert!(comment.len() > 60_000, "{}: there was room", comment.len());
    assert!(comment.contains("#### Verdicts: 3000 worse\n"), "{comment:.2000}");
    let left: Vec<usize> =
        comment.lines().filter_map(|l| l.strip_prefix('_')?.split_once(" more are left out")?.0.parse().ok()).collect();
    // Verdicts, metrics and images.
    assert_eq!(left.len(), 3);
    let rows = |start: &str| comment.lines().filter(|l| l.starts_with(start)).count();
    assert_eq!(rows("| <b>PASS → FAIL</b> ") + left[0], 3000);
    assert_eq!(rows("| changed ") + left[1], 3000);
    assert_eq!(rows("| not read ") + left[2], 3000);
    assert!(rows("| changed ") >= 10 && rows("| not read ") >= 10, "every table has some");
    assert!(comment.lines().filter(|l| l.starts_with('|')).all(|l| l.ends_with('|')));
    assert!(comment.ends_with("</details>\n"));
    let all = found(1, &base, &new, &[]);
    assert_eq!(all["verdicts"].as_array().unwrap().len(), 3000);
    assert_eq!(all["metrics"]["changed"].as_array().unwrap().len(), 3000);
}

#[test]
fn what_is_another_thing_is_not_compared() {
    let scene = edited("scene", |r| {
        let scenes = items(r, "scenes");
        scenes.iter_mut().find(|s| s["name"] == "scene").unwrap()["hash"] = json!("another");
        for case in items(r, "cases") {
            items(case, "metrics")[0]["value"] = json!(7.0);
        }
    });
    let all = found(0, &RUNS.out[0], &scene, &[]);
    assert_eq!(all["incomparable"], json!([{ "kind": "scene", "name": "scene" }]));
    let changed = strings(&all["metrics"]["changed"], "case");
    assert!(!changed.is_empty() && changed.iter().all(|c| c.starts_with("plane/")), "{changed:?}");
    let method = edited("method", |r| {
        r["suite"]["methods"]["classic"]["intensity"] = json!(2.0);
        for case in items(r, "cases") {
            items(case, "metrics").iter_mut().for_each(|m| m["value"] = json!(0.5));
        }
    });
    let all = found(0, &RUNS.out[0], &method, &[]);
    assert_eq!(all["incomparable"], json!([{ "kind": "estimator", "name": "classic" }]));
    let changed = all["metrics"]["changed"].as_array().unwrap();
    assert!(!changed.is_empty());
    for m in changed {
        assert!(m["case"].as_str().unwrap().contains("/extended/"), "{m}");
        // What is held against classic AO is another thing too.
        assert!(m["metric"] != "over-darkening" && m["metric"] != "removed", "{m}");
    }
    assert!(markdown(0, &RUNS.out[0], &method).contains("| estimator | <code>classic</code> |"));
}

#[test]
fn cases_limits_and_times_are_told() {
    let [one, two] = &RUNS.out;
    let lost = edited("lost", |r| {
        let case = &mut r["cases"][1];
        (case["error"], case["image"], case["hash"], case["metrics"]) =
            (json!("the device was lost"), Value::Null, Value::Null, json!([]));
    });
    let all = found(5, one, &lost, &[]);
    assert_eq!((&all["outcome"], &all["cases"]["lost"][0]["error"]), (&json!("lost"), &json!("the device was lost")));
    assert!(markdown(5, one, &lost).contains("#### 1 case or judge ended with an error\n"));
    // It has no verdicts then, and the suite demands what it did.
    let unjudged = edited("unjudged", |r| {
        let case = &mut r["cases"][1];
        (case["error"], case["image"], case["hash"], case["metrics"]) =
            (json!("the device was lost"), Value::Null, Value::Null, json!([]));
        let id = case["case"].clone();
        items(r, "verdicts").retain(|v| v["case"] != id);
    });
    assert_eq!(found(5, one, &unjudged, &[])["gates"]["withdrawn"], json!([]));
    assert_eq!(found(0, &lost, one, &[])["cases"]["new"], json!(["scene/extended/cpu/4"]));
    assert_eq!(found(0, &lost, &lost, &[])["cases"]["still_failing"], json!(1));

    let gone = edited("gone", |r| {
        items(r, "cases").remove(0);
        items(r, "verdicts").iter_mut().for_each(|v| v["limit"] = json!({ "at-least": 0.05 }));
    });
    let all = found(5, one, &gone, &[]);
    assert_eq!(all["cases"]["gone"], json!(["scene/classic/cpu/4"]));
    assert_eq!(
        (&all["gates"]["limits"][0]["base"], &all["gates"]["limits"][0]["new"]),
        (&json!("at least 0.1"), &json!("at least 0.05"))
    );
    found(0, one, &gone, &["--allow-missing"]);
    let early = edited("early", |r| r["incomplete"] = json!("interrupted <by> hand"));
    found(5, one, &early, &["--allow-missing"]);
    assert!(markdown(5, one, &early).contains("tiny: the new run ended early (interrupted &lt;by&gt; hand)\n"));
    let nothing = edited("nothing", |r| items(r, "cases").clear());
    found(5, one, &nothing, &[]);
    found(4, one, &nothing, &["--allow-missing"]);

    let slow = |times: [f64; 4]| {
        move |r: &mut Value| {
            let ids = ["scene/classic/cpu/4", "scene/extended/cpu/4", "plane/classic/cpu/4", "plane/extended/cpu/4"];
            ids.iter().zip(times).for_each(|(id, t)| r["timing"]["cases"][*id] = json!(t));
        }
    };
    let (fast, slow) = (edited("fast", slow([1.0, 1.0, 0.1, 3.0])), edited("slow", slow([1.25, 1.5, 0.25, 1.0])));
    let all = found(0, &fast, &slow, &[]);
    // A quarter more is what a busy machine makes, and so is a tenth of a second.
    assert_eq!(strings(&all["times"]["changed"], "case"), ["scene/extended/cpu/4", "plane/extended/cpu/4"]);
    assert!(
        markdown(0, &fast, &slow).contains("| 1.5 x slower | <code>scene/extended/cpu/4</code> | 1.00 s | 1.50 s |")
    );
    assert_eq!(found(0, one, two, &[])["cases"]["compared"], json!(4));
}

/// A warning is told and passes, here as in a run.
#[test]
fn a_pass_that_warns_now_is_told_and_passes() {
    let new = edited("warns", |r| {
        r["suite"]["gates"][0]["warn"] = json!({ "at-least": 0.9 });
        let verdict = &mut items(r, "verdicts")[0];
        assert_eq!(verdict["gate"], "not black");
        (verdict["outcome"], verdict["warn"]) = (json!("warn"), json!({ "at-least": 0.9 }));
        verdict["reason"] = json!("the limit holds, but the one that warns, at least 0.9, is broken");
        r["summary"]["warnings"] = json!(1);
    });
    let all = found(0, &RUNS.out[0], &new, &[]);
    let change = &all["verdicts"][0];
    assert_eq!((&all["outcome"], &change["turn"], &change["new"]), (&json!("pass"), &json!("changed"), &json!("warn")));
    assert_eq!((&change["limit"], &change["warn"]), (&json!("at least 0.1"), &json!("at least 0.9")));
    let comment = markdown(0, &RUNS.out[0], &new);
    for says in [
        "### ⚠️ CHECK · tiny: no verdict got worse, 1 warns that did not",
        "| PASS → WARN | not black |",
        "openness over all at least 0.1, and warns unless at least 0.9; the gate itself changed: warn none → at least 0.9 |",
        "| other warn | not black | none | at least 0.9 |",
    ] {
        assert!(comment.contains(says), "{says}: {comment}");
    }
    let back = found(0, &new, &RUNS.out[0], &[]);
    assert_eq!((&back["verdicts"][0]["turn"], &back["verdicts"][0]["base"]), (&json!("better"), &json!("warn")));
}

#[test]
fn a_gate_that_is_another_one_is_told_option_by_option() {
    let new = edited("gates", |r| {
        let gate = &mut r["suite"]["gates"][0];
        (gate["metric"], gate["region"]) = (json!("mae"), json!("left"));
        (gate["confidence"], gate["against"]) = (json!(0.99), json!("base"));
        (gate["scenes"], gate["rays"]) = (json!(["scene", "plane"]), json!([4]));
        (gate["estimators"], gate["renderers"]) = (json!(["extended"]), json!(["cpu"]));
        gate["known_failure"] = json!("Because.");
        for v in items(r, "verdicts").iter_mut().filter(|v| v["gate"] == "not black") {
            (v["metric"]["name"], v["metric"]["region"], v["outcome"]) = (json!("mae"), json!("left"), json!("fail"));
            v["limit"] = json!({ "at-least": 0.2 });
        }
    });
    let all = found(1, &RUNS.out[0], &new, &[]);
    let edits = &all["gates"]["edits"];
    assert!(strings(edits, "gate").iter().all(|g| *g == "not black"), "{edits}");
    let told: Vec<String> = ["option", "base", "new"].map(|f| strings(edits, f).join("; ")).to_vec();
    assert_eq!(
        told,
        [
            "metric; region; against; confidence; scenes; estimators; renderers; rays; known_failure",
            "openness; all; none; 0.95; all; all; all; all; none",
            "mae; left; base; 0.99; scene, plane; extended; cpu; 4; Because.",
        ]
    );
    assert_eq!(all["gates"]["limits"][0]["new"], "at least 0.2");
    let change = &all["verdicts"][0];
    // What was measured then is no base of what is measured now.
    assert_eq!((&change["metric"], &change["value"]["base"]), (&json!("mae over left"), &Value::Null));
    assert!(change["value"]["new"].is_f64() && change["edited"][0] == "limit at least 0.1 → at least 0.2", "{change}");
    let comment = markdown(1, &RUNS.out[0], &new);
    assert!(
        comment.contains("the gate itself changed: limit at least 0.1 → at least 0.2, metric openness → mae"),
        "{comment}"
    );
    assert!(comment.contains("| other confidence | not black | 0.95 | 0.99 |"), "{comment}");
    // The same gates are told of by no word.
    assert_eq!(found(0, &new, &new, &[])["gates"]["edits"], json!([]));
    let [text, _] = compare(0, &RUNS.out[0], &RUNS.out[1], &[]);
    assert!(!text.contains("Gates:") && !text.contains("itself changed"), "{text}");
}

/// A broken run of the base branch must not redden what mends it.
#[test]
fn a_base_whose_cases_all_failed_is_nothing_to_compare_with_and_no_fault() {
    let broken = edited("all-failed", |r| {
        for case in items(r, "cases") {
            (case["error"], case["image"], case["hash"], case["metrics"]) =
                (json!("the device was lost"), Value::Null, Value::Null, json!([]));
        }
        r["verdicts"] = json!([]);
    });
    let all = found(0, &broken, &RUNS.out[0], &[]);
    assert_eq!((&all["outcome"], &all["cases"]["recovered"]), (&json!("pass"), &json!(4)));
    let says = "no verdict got worse, 4 cases ended with an error in the base: nothing to compare with";
    assert!(markdown(0, &broken, &RUNS.out[0]).contains(says));
    found(5, &RUNS.out[0], &broken, &[]);
    let [text, _] = compare(4, &broken, &broken, &[]);
    assert!(text.contains("4 cases ended with an error in both records"), "{text}");
}

#[test]
fn images_of_records_are_compared_as_folders_where_asked() {
    let [one, two] = &RUNS.out;
    let [by_option, _] = compare(0, one, two, &["--images", "--exact", "--all-layers"]);
    let [by_folder, _] = compare(0, &one.join("images"), &two.join("images"), &["--exact", "--all-layers"]);
    assert!(by_option == by_folder && by_option.contains("scene/classic.cpu.4.exr"), "{by_option}");
    for (args, says) in [
        (&["--exact"][..], "--exact is for images: to compare those of two records, add --images"),
        (&["--fail", "mae<=1"], "--fail is for images"),
        (&["--ppd", "40"], "--ppd is for images"),
        (&["--images", "--format", "markdown"], "--format markdown tells of two records"),
    ] {
        let [_, err] = compare(2, one, two, args);
        assert!(err.contains(says), "{err}");
    }
    // Where no layer stands for an image, every layer is compared; where one does, it is, by its replicates too.
    let maps = RUNS.dir.path().join("maps");
    let all: Value = {
        let [out, _] = compare(0, one, two, &["--images", "--format", "json", "--maps", text(&maps)]);
        serde_json::from_str(&out).unwrap()
    };
    let pairs = all["pairs"].as_array().unwrap();
    let of = |path: &str| -> Vec<_> { pairs.iter().filter(|p| p["path"] == path).collect() };
    let case = of("scene/classic.cpu.4.exr");
    assert!(case.len() == 1 && case[0]["layer"] == "mean" && case[0]["welch"].is_object(), "{case:?}");
    for (image, layer) in [("judge", "q"), ("regions", "region-footprint"), ("look", "path-traced")] {
        let found = of(&format!("scene/{image}.exr"));
        assert!(found.len() > 1 && found.iter().any(|p| p["layer"] == layer), "{image}: {found:?}");
        assert!(maps.join(format!("scene/{image}.exr/{layer}/maps.exr")).exists(), "{image}");
    }
    let [named, _] = compare(0, one, two, &["--images", "--exact"]);
    assert!(named.contains("scene/judge.exr ") && !named.contains("ERROR"), "{named}");
    let [_, err] = compare(2, &one.join("images"), &two.join("images"), &["--images"]);
    assert!(err.contains("--images takes the images of two records"), "{err}");
    let [_, err] = compare(2, &one.join("images"), two, &[]);
    assert!(err.contains("is a record"), "{err}");
    let broken = edited("broken", |r| r["version"] = json!(1));
    let [_, err] = compare(2, one, &broken, &[]);
    assert!(err.contains("record version 1"), "{err}");
}

#[test]
fn the_schema_names_what_is_printed() {
    let schema: Value = serde_json::from_slice(&aogauge(&["schema", "changes"]).stdout).unwrap();
    let all = found(0, &RUNS.out[0], &RUNS.out[1], &[]);
    assert_eq!(all["version"], 1);
    for key in all.as_object().unwrap().keys() {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
    for (part, value) in [("Metrics", &all["metrics"]), ("ImageChange", &all["images"][0]), ("Coverage", &all["cases"])]
    {
        for key in value.as_object().unwrap().keys() {
            assert!(schema["$defs"][part]["properties"][key].is_object(), "{part} {key}");
        }
    }
    assert_eq!(marker(all["suite"].as_str().unwrap()), "<!-- aogauge: tiny -->");
}
