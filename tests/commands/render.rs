//! What a user meets of estimators: `aogauge render`, suites with options and
//! presets, and the judge's cache.

use aogauge::{layers::Layers, record::Record};
use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

fn aogauge(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge"))
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .args(args)
        .output()
        .unwrap()
}

fn expect(code: i32, folder: &Path, args: &[&str]) -> String {
    let output = aogauge(folder, args);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "aogauge {args:?}\n{stderr}");
    stderr
}

/// Renders the arcade with some options and returns its layers.
fn render(folder: &Path, options: &[&str]) -> Layers {
    expect(0, folder, &[&["render", "curtain-arcade", "--out", "image.exr", "--rays", "32"], options].concat());
    Layers::read(&folder.join("image.exr")).unwrap()
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

#[test]
fn every_estimator_renders_an_image() {
    let dir = tempfile::tempdir().unwrap();
    let exponential = "falloff={ exponential = { extinction = 6.0 } }";
    let classic = mean(render(dir.path(), &[]).get("mean").unwrap());
    let image = |options: &[&str]| mean(render(dir.path(), options).get("mean").unwrap());
    let obscurance = image(&["--estimator", "obscurance", "--set", exponential]);
    let extended = image(&["--estimator", "extended", "--set", "receiver_plane=clipped"]);
    let counts = image(&["--estimator", "extended", "--set", "receiver_plane=counts"]);
    let both = image(&["--estimator", "extended-obscurance", "--set", "receiver_plane=clipped", "--set", exponential]);
    let indirect = image(&["--estimator", "local-indirect"]);
    let light = image(&["--estimator", "path-traced"]);
    // Each does something of its own.
    assert!(counts < extended && extended < classic && both < obscurance, "{counts} {extended} {classic}");
    assert!(indirect > classic + 0.01, "an occluder sends light back: {indirect}, {classic}");
    assert!(light < 0.5, "the arcade is dark: {light}");
    assert!((obscurance - classic).abs() > 0.001);
    let squared = image(&["--set", "intensity=2"]);
    assert!(squared < classic, "{squared}");
    assert!(render(dir.path(), &["--estimator", "local-indirect"]).get("color.R").is_some());
    let twin = image(&["--twin"]);
    assert!(twin > classic, "without the curtain more is open: {twin}");
    // In screen space both of a pair are seen from one place: far from the pillar nothing changes.
    let seen = |options: &[&str]| {
        let shared = ["render", "pillar", "--out", "image.exr", "--estimator", "gtao", "--rays", "4"];
        expect(0, dir.path(), &[&shared, options].concat());
        Layers::read(&dir.path().join("image.exr")).unwrap().get("mean").unwrap().to_vec()
    };
    let (with, without) = (seen(&[]), seen(&["--twin"]));
    let known = with.iter().zip(&without).filter(|(a, b)| a.is_finite() && b.is_finite());
    let [all, equal] = known.fold([0, 0], |[all, equal], (a, b)| [all + 1, equal + usize::from(a == b)]);
    assert!(10 * equal > all, "{equal} of {all} are equal");
}

#[test]
fn replicates_are_layers_and_repeat() {
    let dir = tempfile::tempdir().unwrap();
    let a = render(dir.path(), &["--replicates", "3"]);
    let b = render(dir.path(), &["--replicates", "3"]);
    assert!(a.get("variance").is_some() && a.get("replicate-0002").is_some() && a.get("replicate-0003").is_none());
    assert_eq!(a.get("mean"), b.get("mean"));
    let c = render(dir.path(), &["--replicates", "3", "--seed", "9"]);
    assert_ne!(a.get("mean"), c.get("mean"));
}

#[test]
fn presets_bring_their_rays_along() {
    let dir = tempfile::tempdir().unwrap();
    for (preset, rays) in [("unity-low", 1), ("unity-high", 8), ("paper-32", 32), ("microsoft-sample", 1)] {
        let args = ["render", "curtain-open", "--preset", preset, "--out", "a.png", "--format", "json"];
        let output = aogauge(dir.path(), &args);
        let json: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(json["rays"], rays, "{preset}");
        assert!(dir.path().join("a.png").is_file());
    }
}

#[test]
fn wrong_options_are_named() {
    let dir = tempfile::tempdir().unwrap();
    for (args, says) in [
        (vec!["plane", "--out", "a.jpg"], ".exr or .png"),
        (vec!["plain", "--out", "a.png"], "plain"),
        (vec!["plane", "--out", "a.png", "--set", "radius"], "KEY=VALUE"),
        (vec!["plane", "--out", "a.png", "--set", "raduis=1"], "raduis"),
        (vec!["plane", "--out", "a.png", "--set", "rays=3"], "--rays"),
        (vec!["plane", "--out", "a.png", "--set", "radius=1e-6"], "R = 0.000001 m"),
        (vec!["plane", "--out", "a.png", "--set", "radius=-1"], "radius is -1 m"),
        (vec!["plane", "--out", "a.png", "--set", "radius=1", "--set", "radius=2"], "twice"),
        (vec!["plane", "--out", "a.png", "--set", "faces=behind"], "behind"),
        (vec!["plane", "--out", "a.png", "--estimator", "extended"], "receiver_plane"),
        (vec!["plane", "--out", "a.png", "--preset", "unity"], "unity-low"),
        (vec!["plane", "--out", "a.png", "--rays", "0"], "1..=65536"),
        (vec!["plane", "--out", "/dev/null/a.png"], "/dev/null"),
    ] {
        let stderr = expect(2, dir.path(), &[vec!["render"], args.clone()].concat());
        assert!(stderr.contains(says), "{args:?}: {stderr}");
    }
}

const SUITE: &str = r#"description = "test"
scenes = ["curtain-arcade"]
rays = [4]
replicates = 4
converged_rays = 64
look_rays = 1
judge = { precision = 0.5, paths = 2, replicates = 4, max_replicates = 8 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "unity"
preset = "unity-medium"
[[estimator]]
name = "obscurance"
kind = "extended-obscurance"
falloff = { linear-tail = { tail = 0.615 } }
receiver_plane = "clipped"
secondary_rays = 3
[[estimator]]
name = "bleeding"
kind = "local-indirect"
[[estimator]]
name = "truth"
kind = "path-traced"
"#;

/// A suite may hold every kind of estimator; presets keep their own rays; what the
/// GPU does not compute the CPU renders alone.
#[test]
fn a_suite_takes_every_estimator() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("suite.toml"), SUITE).unwrap();
    expect(0, dir.path(), &["run", "suite.toml", "--out", "out"]);
    let record = Record::read(&dir.path().join("out")).unwrap();
    let cases: Vec<String> = record.cases.iter().map(|c| c.case.id()).filter(|id| id.contains("/cpu/")).collect();
    let expected = ["classic/cpu/4", "unity/cpu/2", "obscurance/cpu/4", "bleeding/cpu/4", "truth/cpu/4"];
    assert_eq!(cases, expected.map(|e| format!("curtain-arcade/{e}")));
    assert!(record.cases.iter().all(|c| c.error.is_none()));
    let written = serde_json::to_value(&record.suite.methods).unwrap();
    assert_eq!(written["unity"]["faces"], "front");
    assert_eq!(written["classic"], serde_json::json!({ "kind": "classic" }));
    // The path tracer's own images have the judge's contrast, within noise.
    let truth = record.cases.iter().find(|c| c.case.estimator == "truth").unwrap();
    assert!(truth.metrics.iter().any(|m| m.value.is_some()));
    fs::write(dir.path().join("bad.toml"), SUITE.replace("secondary_rays = 3", "secondary_rays = 0")).unwrap();
    let stderr = expect(2, dir.path(), &["run", "bad.toml", "--out", "out"]);
    assert!(stderr.contains("estimator 'obscurance'") && stderr.contains("1 to 8"), "{stderr}");
}

/// Every kind gives the same bytes on one thread and on three.
#[test]
fn results_do_not_depend_on_threads() {
    let dir = tempfile::tempdir().unwrap();
    let jittered = "[[estimator]]\nname = 'jittered'\nkind = 'extended'\nreceiver_plane = 'counts'\n\
                    secondary_origin = 'jittered'\nsecondary_sides = 'one'\n";
    fs::write(dir.path().join("suite.toml"), format!("{SUITE}{jittered}")).unwrap();
    let records = ["1", "3"].map(|threads| {
        let out = format!("out-{threads}");
        let args = ["run", "suite.toml", "--no-cache", "--renderer", "cpu", "--threads", threads, "--out", &out];
        expect(0, dir.path(), &args);
        let record = Record::read(&dir.path().join(out)).unwrap();
        assert_eq!(record.timing.threads.to_string(), threads);
        (record.cases, serde_json::to_string(&record.scenes).unwrap())
    });
    let [(cases, scenes), (others, other_scenes)] = records;
    assert_eq!(scenes, other_scenes);
    for (a, b) in cases.iter().zip(&others) {
        assert!(a.hash.is_some());
        assert_eq!(a.hash, b.hash, "{}", a.case.id());
    }
}

/// A judge that spent its budget says so in one sentence, and cells hold no text.
#[test]
fn an_imprecise_judge_is_told_once() {
    let dir = tempfile::tempdir().unwrap();
    let vague = SUITE.replace("precision = 0.5", "precision = 0.001");
    fs::write(dir.path().join("suite.toml"), vague).unwrap();
    expect(0, dir.path(), &["run", "suite.toml", "--renderer", "cpu", "--out", "out"]);
    let report = fs::read_to_string(dir.path().join("out/report.md")).unwrap();
    // Above it, the pools say why the scene is in none of them.
    let (_, scenes) = report.split_once("## Scenes").unwrap();
    let told = scenes.matches("less precise than asked").count();
    assert!(told == 2, "the judge's line, and under the table: {told}\n{report}");
    assert!(report.contains("No contrast error is taken from it"), "{report}");
    let record = Record::read(&dir.path().join("out")).unwrap();
    let json = serde_json::to_value(&record.scenes[0].judge).unwrap();
    assert_eq!(json["stopped"], "budget");
}

/// The judge of an earlier run is used again where nothing has changed, and
/// nowhere else; the result is the same either way.
#[test]
fn the_judge_is_cached_by_content() {
    let dir = tempfile::tempdir().unwrap();
    let shown = String::from_utf8(aogauge(dir.path(), &["scene", "show", "curtain-arcade"]).stdout).unwrap();
    let scene = shown.split("\n# ").nth(1).unwrap().split_once('\n').unwrap().1;
    fs::write(dir.path().join("scene.toml"), scene).unwrap();
    let suite = SUITE.split("[[estimator]]").take(2).collect::<Vec<_>>().join("[[estimator]]");
    fs::write(dir.path().join("suite.toml"), suite.replace("curtain-arcade", "scene.toml")).unwrap();
    let run = |more: &[&str]| {
        expect(0, dir.path(), &[&["run", "suite.toml", "--renderer", "cpu", "--out", "out"], more].concat());
        let record = Record::read(&dir.path().join("out")).unwrap();
        let judge = serde_json::to_string(&record.scenes[0].judge).unwrap();
        (record.timing.cached_replicates["scene"], judge)
    };
    let (none, traced) = run(&[]);
    assert_eq!(none, 0);
    let (found, again) = run(&[]);
    assert!(found >= 4, "{found}");
    assert_eq!(traced, again);
    assert_eq!(run(&["--no-cache"]), (0, traced.clone()));
    assert_eq!(run(&["--seed", "2"]).0, 0, "other random numbers");
    let path = dir.path().join("scene.toml");
    let text = fs::read_to_string(&path).unwrap();
    let changed = text.replacen("thickness = 0.02", "thickness = 0.025", 1);
    assert_ne!(text, changed);
    fs::write(&path, changed).unwrap();
    assert_eq!(run(&[]).0, 0, "another scene");
    fs::write(&path, text.replacen("description = \"", "description = \"Again: ", 1)).unwrap();
    assert!(run(&[]).0 >= 4, "the description changes nothing");
    // Broken files are traced anew.
    for entry in fs::read_dir(dir.path().join("cache/aogauge/judge")).unwrap() {
        fs::write(entry.unwrap().path(), b"rubbish").unwrap();
    }
    assert_eq!(run(&[]), (0, traced));
}
