//! What a user meets: exit codes, messages, files.

use serde_json::Value;
use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Runs the program with a cache folder that it cannot make: no test leaves
/// anything with the user, or finds what another left.
fn aogauge(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).env("XDG_CACHE_HOME", "/dev/null").args(args).output().unwrap()
}

/// Runs, checks the exit code and returns standard error.
fn expect(code: i32, args: &[&str]) -> String {
    let output = aogauge(args);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "aogauge {args:?}\n{stderr}");
    stderr
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A curtain over open ground, with room for a change.
fn scene(change: impl Fn(String) -> String) -> String {
    change(
        r#"description = "test"

[ao]
radius = 0.25

[environment]
radiance = 1.0

[measure]
center = [0, 0, 0]
normal = [0, 1, 0]
transect = [1, 0, 0]
clearance = 0.08
resolution = [64, 32]

[look]
eye = [0.75, 0.42, 1.15]
target = [0, 0.08, 0]
resolution = [32, 16]

[[object]]
name = "ground"
shape = { plane = { center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] } }

[[object]]
name = "curtain"
occluder = true
shape = { curtain = { thickness = 0.02, gap = 0.10, height = 1.0, length = 6.0 } }
"#
        .to_owned(),
    )
}

/// A suite of that scene that runs in a moment, with gates.
fn suite(gates: &str) -> String {
    format!(
        r#"description = "test"
scenes = ["scene.toml"]
rays = [4]
replicates = 4
converged_rays = 32
golden_rays = 4
look_rays = 1
judge = {{ precision = 0.1, paths = 4, replicates = 4, max_replicates = 8 }}
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
{gates}
"#
    )
}

/// A folder with `suite.toml` and `scene.toml`.
fn folder(scene: &str, suite: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), scene).unwrap();
    let path = folder.path().join("suite.toml");
    fs::write(&path, suite).unwrap();
    (folder, path)
}

fn run(suite: &Path, out: &Path, code: i32, more: &[&str]) -> String {
    expect(code, &[&["run", text(suite), "--out", text(out), "--renderer", "cpu"], more].concat())
}

fn record(out: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(out.join("record.json")).unwrap()).unwrap()
}

/// Every file below a folder with its bytes.
fn files(root: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(root).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn a_run_leaves_a_record_and_a_report() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let out = dir.path().join("out");
    // With whatever GPU there is: its driver must not chatter.
    let stderr = expect(0, &["run", text(&suite), "--out", text(&out)]);
    assert!(stderr.contains("report.md"), "{stderr}");
    assert!(!stderr.contains('\u{1b}') && !stderr.contains("XDG_RUNTIME_DIR"), "no noise off a terminal: {stderr}");
    let report = fs::read_to_string(out.join("report.md")).unwrap();
    for picture in report.split("](").skip(1).map(|s| s.split(')').next().unwrap()) {
        assert!(out.join(picture).exists(), "{picture}");
    }
    let record = record(&out);
    assert_eq!(record["cases"].as_array().unwrap().len(), 2);
    for image in files(&out).keys().filter(|p| p.extension().is_some_and(|e| e == "exr")) {
        aogauge::layers::Layers::read(&out.join(image)).unwrap();
    }
}

#[test]
fn broken_scenes_are_named_by_file_and_line() {
    type Change = fn(String) -> String;
    let cases: [(&str, Change, &[&str]); 12] = [
        (
            "no light",
            |s| s.replace("radiance = 1.0", "radiance = 0"),
            &["scene.toml", "line 7", "from 0.001 to 1000000"],
        ),
        (
            "unknown key",
            |s| s.replace("radius = 0.25", "radius = 0.25\ncolour = 3"),
            &["scene.toml", "line 5", "colour"],
        ),
        (
            "negative radius",
            |s| s.replace("radius = 0.25", "radius = -0.25"),
            &["scene.toml", "line 4", "from 0.001 to 1000 m"],
        ),
        (
            "NaN vertex",
            |s| {
                s.replace(
                    "plane = { center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] }",
                    "polygons = { positions = [[0, 0, 0], [1, 0, nan], [1, 0, 1]], triangles = [[0, 1, 2]] }",
                )
            },
            &["scene.toml", "line 23", "finite"],
        ),
        (
            "index out of range",
            |s| {
                s.replace(
                    "plane = { center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] }",
                    "polygons = { positions = [[0, 0, 0], [1, 0, 0], [1, 0, 1]], triangles = [[0, 1, 3]] }",
                )
            },
            &["scene.toml", "'ground'", "vertex 3"],
        ),
        ("no light at all", |s| s.replace("[environment]\nradiance = 1.0\n", ""), &["scene.toml", "environment"]),
        ("huge resolution", |s| s.replace("[64, 32]", "[640000, 32]"), &["scene.toml", "line 14", "4096"]),
        (
            "sealed box",
            |s| {
                s.replace(
                    "plane = { center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] }",
                    "block = { min = [-4, -1, -4], max = [4, 4, 4] }",
                )
                .replace("center = [0, 0, 0]\nnormal", "center = [0, -1, 0]\nnormal")
            },
            &["no light", "environment"],
        ),
        (
            "far too large",
            |s| s.replace("u = [0, 0, 6], v = [6, 0, 0]", "u = [0, 0, 90000], v = [90000, 0, 0]"),
            &["ao.radius", "45000"],
        ),
        (
            "view over the hem",
            |s| s.replace("clearance = 0.08", "clearance = 0.2"),
            &["'curtain'", "measure.clearance"],
        ),
        (
            "view into the air",
            |s| s.replace("center = [0, 0, 0]\nnormal", "center = [900, 0, 0]\nnormal"),
            &["no surface", "measure.center"],
        ),
        ("two of a name", |s| s.replace("\"ground\"", "\"curtain\""), &["scene.toml", "curtain"]),
    ];
    for (what, change, says) in cases {
        let (dir, suite) = folder(&scene(change), &suite(""));
        let stderr = run(&suite, &dir.path().join("out"), 2, &[]);
        for word in says {
            assert!(stderr.contains(word), "{what}: no '{word}' in\n{stderr}");
        }
        assert!(!dir.path().join("out").exists(), "{what}: nothing is written");
    }
}

#[test]
fn missing_files_and_unknown_names_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let missing = dir.path().join("none.toml");
    assert!(run(&missing, &out, 2, &[]).contains("none.toml"));
    assert!(expect(2, &["run", "thin-ocluders", "--out", text(&out)]).contains("thin-occluders"));
    let (with_suite, path) = folder(&scene(|s| s), &suite(""));
    fs::remove_file(with_suite.path().join("scene.toml")).unwrap();
    assert!(run(&path, &out, 2, &[]).contains("scene.toml"));
    expect(2, &["run", "--no-such-flag"]);
    expect(2, &["report", text(dir.path())]);
    let zip = dir.path().join("record.zip");
    fs::write(&zip, "PK").unwrap();
    assert!(expect(2, &["report", text(&zip)]).contains("record.zip: this is a zip archive: unpack it first"));
    // What may be gated is listed, and nothing that may not.
    let (gated, path) = folder(&scene(|s| s), &suite("[[gate]]\nname = 'g'\nmetric = 'contrast-eror'\nmax = 1"));
    let told = run(&path, &gated.path().join("out"), 2, &[]);
    assert!(told.contains("`contrast-eror`") && told.contains("`contrast-error`"), "{told}");
    assert!(!told.contains("judge-bias") && !told.contains("judge-mae") && !told.contains("judge-rmse"), "{told}");
    // A folder without a name of its own, empty or not.
    let empty = dir.path().join("empty");
    fs::create_dir(&empty).unwrap();
    let here = ["run", "smoke", "--renderer", "cpu", "--out", "."];
    let here = Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(&empty).args(here).output().unwrap();
    let told = String::from_utf8_lossy(&here.stderr);
    assert!(told.contains("moved aside to NAME.previous by the next run, so it must be given by its name"), "{told}");
    assert_eq!(fs::read_dir(&empty).unwrap().count(), 0);
    assert!(!out.exists());
}

#[test]
fn an_output_folder_that_cannot_be_written_is_named() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let file = dir.path().join("file");
    fs::write(&file, "x").unwrap();
    let stderr = run(&suite, &file.join("out"), 2, &[]);
    assert!(stderr.contains("file") && stderr.contains("cannot"), "{stderr}");
    // A folder of somebody's files is not ours to move.
    let mine = dir.path().join("mine");
    fs::create_dir(&mine).unwrap();
    fs::write(mine.join("thesis.tex"), "x").unwrap();
    assert!(run(&suite, &mine, 2, &[]).contains("not a record"));
    assert!(mine.join("thesis.tex").exists());
}

#[test]
fn an_older_record_is_moved_aside() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let out = dir.path().join("out");
    for seed in ["1", "2", "3"] {
        run(&suite, &out, 0, &["--seed", seed]);
    }
    assert_eq!(record(&out)["seed"], 3);
    let previous = dir.path().join("out.previous");
    assert_eq!(record(&previous)["seed"], 2);
    // What a killed run left is no record to keep; nor does a slash at the end matter.
    fs::remove_file(out.join("record.json")).unwrap();
    fs::write(out.join(".aogauge-run"), "").unwrap();
    expect(0, &["run", text(&suite), "--out", &format!("{}/", text(&out)), "--renderer", "cpu", "--seed", "4"]);
    assert_eq!((record(&out)["seed"].as_u64(), record(&previous)["seed"].as_u64()), (Some(4), Some(2)));
    expect(0, &["run", text(&suite), "--out", &format!("{}/", text(&out)), "--renderer", "cpu", "--seed", "5"]);
    assert_eq!((record(&out)["seed"].as_u64(), record(&previous)["seed"].as_u64()), (Some(5), Some(4)));
}

#[test]
fn a_killed_run_leaves_no_record() {
    let slow = suite("")
        .replace("converged_rays = 32", "converged_rays = 65536")
        .replace("look_rays = 1", "look_rays = 65536");
    let (dir, suite) = folder(&scene(|s| s.replace("[32, 16]", "[1024, 1024]")), &slow);
    let out = dir.path().join("out");
    let mut child = Command::new(env!("CARGO_BIN_EXE_aogauge"))
        .args(["run", text(&suite), "--out", text(&out), "--renderer", "cpu"])
        .spawn()
        .unwrap();
    let start = Instant::now();
    while !out.join(".aogauge-run/plan.txt").exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "the run never began");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!out.join("record.json").exists());
    for command in [&["report"][..], &["golden", "verify"]] {
        let stderr = expect(2, &[command, &[text(&out)]].concat());
        assert!(stderr.contains("did not finish"), "{stderr}");
    }
}

#[test]
fn the_same_suite_and_seed_give_the_same_bytes_at_any_thread_count() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let outs = ["1", "2"].map(|threads| {
        let out = dir.path().join(threads);
        run(&suite, &out, 0, &["--threads", threads]);
        out
    });
    let [mut a, mut b] = outs.clone().map(|o| files(&o));
    let json = Path::new("record.json");
    let [mut ra, mut rb] = outs.map(|o| record(&o));
    assert_ne!(ra["timing"]["threads"], rb["timing"]["threads"]);
    for r in [&mut ra, &mut rb] {
        r.as_object_mut().unwrap().remove("timing");
    }
    assert_eq!(serde_json::to_string(&ra).unwrap(), serde_json::to_string(&rb).unwrap());
    for f in [&mut a, &mut b] {
        f.remove(json);
        f.remove(Path::new("report.md")); // it shows the times, as does the plot of cost
        f.remove(Path::new("pictures/cost.svg"));
    }
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "{} differs", name.display());
    }
}

#[test]
fn exit_codes_follow_the_verdicts() {
    let gate = |limit: &str| {
        format!("[[gate]]\nname = \"g\"\nmetric = \"openness\"\nregion = \"all\"\nestimators = [\"classic\"]\n{limit}")
    };
    for (limit, code, says) in [
        ("min = 0.5", 0, "PASS"),
        ("min = 0.99", 1, "FAIL"),
        ("equals = 0.5\nwithin = 0.1", 1, "FAIL"),
        ("min = 0.99\nknown_failure = \"it is dark\"", 0, "KNOWN FAILURE"),
        ("min = 0.5\nknown_failure = \"it is dark\"", 1, "remove the mark"),
        ("min = 0.5\nknown_failure = \" \"", 2, "known_failure"),
    ] {
        let (dir, suite) = folder(&scene(|s| s), &suite(&gate(limit)));
        let stderr = run(&suite, &dir.path().join("out"), code, &[]);
        assert!(stderr.contains(says), "{limit}: {stderr}");
    }
    // A gate that nothing can be held against is not green.
    let (dir, with_gate) = folder(
        &scene(|s| s),
        &suite("[[gate]]\nname = \"g\"\nmetric = \"removed\"\nestimators = [\"classic\"]\nmin = 0.5"),
    );
    let stderr = run(&with_gate, &dir.path().join("out"), 6, &[]);
    assert!(stderr.contains("NOT RUN"), "{stderr}");
    // Nor is one whose judge is less precise than the suite asks.
    let vague = suite("[[gate]]\nname = \"g\"\nmetric = \"judge-contrast\"\nmin = -1.0")
        .replace("precision = 0.1", "precision = 0.0001");
    let (dir, vague) = folder(&scene(|s| s), &vague);
    let stderr = run(&vague, &dir.path().join("out"), 6, &[]);
    assert!(stderr.contains("less precise"), "{stderr}");
    // Too few pixels under the sheet: nothing can be said.
    let narrow = scene(|s| {
        s.replace("resolution = [64, 32]", "resolution = [64, 16]").replace("thickness = 0.02", "thickness = 0.001")
    });
    let (dir, suite) = folder(&narrow, &suite(&gate("min = 0.5").replace("\"all\"", "\"footprint\"")));
    let stderr = run(&suite, &dir.path().join("out"), 6, &[]);
    assert!(stderr.contains("INCONCLUSIVE") && stderr.contains("fewer than 64"), "{stderr}");
}

#[test]
fn a_report_can_be_made_again() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let (out, again) = (dir.path().join("out"), dir.path().join("again"));
    run(&suite, &out, 0, &[]);
    expect(0, &["report", text(&out), "--out", text(&again)]);
    for (name, bytes) in files(&again) {
        assert!(bytes == fs::read(out.join(&name)).unwrap(), "{}", name.display());
    }
    assert!(again.join("report.md").exists());
    // Over a report, and over nothing that no report wrote.
    expect(0, &["report", text(&out), "--out", text(&again), "--format", "markdown,html,junit"]);
    let all = ["report", text(&out), "--format", "markdown,html,junit", "--out"];
    expect(0, &[&all[..], &[text(&again)]].concat());
    let mine = dir.path().join("mine");
    for file in ["report.md", "report.html", "junit.xml", "pictures/scene/q.png", "pictures/cost.svg"] {
        let path = mine.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, "# Notes\n\nmine").unwrap();
        let before = files(&mine);
        let told = expect(2, &[&all[..], &[text(&mine)]].concat());
        let named = if file.starts_with("pictures/scene") { "pictures/scene" } else { file };
        assert!(told.contains(named) && told.contains("no report of aogauge wrote this"), "{told}");
        assert!(files(&mine) == before, "{file}");
        fs::remove_dir_all(&mine).unwrap();
    }
    // What fails halfway leaves nothing that the next report would take for another's.
    let image = fs::read_dir(out.join("images/scene")).unwrap().next().unwrap().unwrap().path();
    let bytes = fs::read(&image).unwrap();
    for found in fs::read_dir(out.join("images/scene")).unwrap().flatten() {
        fs::rename(found.path(), found.path().with_extension("aside")).unwrap();
    }
    expect(2, &["report", text(&out), "--out", text(&mine)]);
    assert_eq!(fs::read_dir(&mine).unwrap().count(), 0);
    for found in fs::read_dir(out.join("images/scene")).unwrap().flatten() {
        fs::rename(found.path(), found.path().with_extension("exr")).unwrap();
    }
    assert!(fs::read(&image).unwrap() == bytes);
    expect(0, &["report", text(&out), "--out", text(&mine)]);
}

/// The maps of a report show the record's own numbers, and the report bears the name
/// that its suite gives itself.
#[test]
fn error_maps_show_what_the_record_holds() {
    let (dir, suite) = folder(&scene(|s| s), &format!("name = \"curtains\"\n{}", suite("")));
    let out = dir.path().join("out");
    run(&suite, &out, 0, &[]);
    assert!(fs::read_to_string(out.join("report.md")).unwrap().starts_with("# curtains: PASS"));
    let record = record(&out);
    assert_eq!(record["suite"]["name"], "curtains");
    let transect = record["scenes"][0]["transect"].as_array().unwrap();
    let first = transect.iter().position(|t| t.as_f64().unwrap().abs() <= 1.04).unwrap();
    let layers = |name: &str| aogauge::layers::Layers::read(&out.join("images/scene").join(name)).unwrap();
    let (regions, judge, case) = (layers("regions.exr"), layers("judge.exr"), layers("extended.cpu.4.exr"));
    let (converged, mean) = (regions.get("converged-extended").unwrap(), case.get("mean").unwrap());
    let (q, se) = (judge.get("q").unwrap(), judge.get("q-relative-se").unwrap());
    let width = transect.len();
    let mut valued = 0;
    for (map, limit) in [("minus-q", 0.5), ("minus-converged", 0.1)] {
        let scale = aogauge::picture::scale::Scale::signed(limit).unwrap();
        let picture = image::open(out.join(format!("pictures/scene/{map}/extended.png"))).unwrap().into_rgb8();
        for (x, y, pixel) in picture.enumerate_pixels() {
            let i = y as usize / 4 * width + first + x as usize / 4;
            let error = if map == "minus-q" { converged[i] - q[i] } else { mean[i] - converged[i] };
            let noisy = map == "minus-q" && (se[i].is_nan() || se[i] > 0.05);
            let color = scale.color(f64::from(error)).filter(|_| !noisy);
            valued += usize::from(color.is_some());
            let checker = aogauge::picture::color_bar::no_value([x, y], 2);
            assert_eq!(pixel.0, color.unwrap_or(checker), "{map} {x} {y}: {error}");
        }
    }
    assert!(valued > 1000, "{valued}");
}

#[test]
fn a_record_of_another_version_is_refused() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let out = dir.path().join("out");
    run(&suite, &out, 0, &[]);
    let path = out.join("record.json");
    let current = fs::read_to_string(&path).unwrap();
    for (version, says) in [
        ("99", "written by a newer aogauge 0.1.0 (record version 99); this one reads versions 3 to 4: update it"),
        (
            "2",
            "written by an older aogauge 0.1.0 (record version 2); this one reads versions 3 to 4: run the suite again",
        ),
        ("-1", "not a record"),
    ] {
        let other = current.replacen("\"version\": 4", &format!("\"version\": {version}"), 1);
        assert_ne!(current, other);
        fs::write(&path, other).unwrap();
        let message = expect(2, &["report", text(&out)]);
        assert!(message.contains(says) && message.contains("record.json"), "{message}");
    }
    fs::write(&path, "[3]").unwrap();
    assert!(expect(2, &["report", text(&out)]).contains("not a record"));
    fs::write(&path, "{").unwrap();
    assert!(expect(2, &["report", text(&out)]).contains("record.json"));
}

#[test]
fn goldens_are_approved_and_verified() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let (out, goldens) = (dir.path().join("out"), dir.path().join("goldens"));
    let verify = |code: i32, out: &Path| {
        let output = aogauge(&["golden", "verify", text(out), "--goldens", text(&goldens)]);
        assert_eq!(output.status.code(), Some(code), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    run(&suite, &out, 0, &[]);

    assert!(verify(3, &out).contains("MISSING"));
    assert!(!goldens.exists(), "a missing golden is never created");
    expect(2, &["golden", "approve", text(&out), "--goldens", text(&goldens)]);
    expect(2, &["golden", "approve", text(&out), "--goldens", text(&goldens), "--reason", " "]);
    expect(4, &["golden", "approve", text(&out), "--goldens", text(&goldens), "--reason", "r", "--only", "nothing"]);
    expect(0, &["golden", "approve", text(&out), "--goldens", text(&goldens), "--reason", "größer Ω → \"ok\""]);
    assert!(verify(0, &out).contains("identical"));

    let fresh = dir.path().join("fresh");
    run(&suite, &fresh, 0, &["--seed", "77"]);
    let stderr = verify(0, &fresh);
    assert!(stderr.contains("fresh seeds") && stderr.contains("would see a bias"), "{stderr}");

    let golden = goldens.join("scene/classic.4.exr");
    let mut layers = aogauge::layers::Layers::read(&golden).unwrap();
    assert_eq!(layers.attributes["reason"], "größer Ω → \"ok\"");
    assert_eq!(layers.attributes["rays"], "4");
    let whole = fs::read(&golden).unwrap();
    for v in layers.layers.get_mut("mean").unwrap() {
        *v -= 0.1;
    }
    let hash = aogauge::layers::pixel_hash(&layers.layers["mean"]);
    layers.attributes.insert("pixel-hash".into(), hash);
    layers.write(&golden).unwrap();
    let stderr = verify(1, &fresh);
    assert!(stderr.contains("DIFFERENT") && stderr.contains("9 of 2057 tests reject"), "{stderr}");
    fs::write(&golden, &whole[..whole.len() / 2]).unwrap();
    assert!(verify(3, &out).contains("UNUSABLE"));
    fs::write(&golden, &whole).unwrap();

    // Approving the same record again changes no byte.
    expect(0, &["golden", "approve", text(&out), "--goldens", text(&goldens), "--reason", "größer Ω → \"ok\""]);
    assert!(fs::read(&golden).unwrap() == whole);

    // A case that was lost is no golden that holds.
    let json = fs::read_to_string(out.join("record.json")).unwrap();
    let lost = json.replacen("\"error\": null", "\"error\": \"lost\"", 1);
    fs::write(out.join("record.json"), &lost).unwrap();
    assert!(verify(5, &out).contains("lost"));
    // Names in a record cannot lead out of the store.
    fs::write(out.join("record.json"), json.replace("\"scene\": \"scene\"", "\"scene\": \"../../evil\"")).unwrap();
    let evil = expect(2, &["golden", "approve", text(&out), "--goldens", text(&goldens), "--reason", "r"]);
    assert!(evil.contains("legal name"), "{evil}");
    fs::write(out.join("record.json"), &json).unwrap();

    fs::write(dir.path().join("scene.toml"), scene(|s| s.replace("gap = 0.10", "gap = 0.12"))).unwrap();
    let moved = dir.path().join("moved");
    run(&suite, &moved, 0, &[]);
    assert!(verify(3, &moved).contains("another version of the scene"));
}

#[test]
fn programs_can_read_the_results() {
    let (dir, suite) = folder(&scene(|s| s), &suite(""));
    let out = dir.path().join("out");
    let run = aogauge(&["run", text(&suite), "--out", text(&out), "--renderer", "cpu", "--format", "json"]);
    let printed: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(printed, record(&out));
    let list: Value = serde_json::from_slice(&aogauge(&["scene", "list", "--format", "json"]).stdout).unwrap();
    assert_eq!(list.as_array().unwrap().len(), aogauge::scenes::library::SCENES.len());
}

/// `aogauge doctor` in an environment, as text and as JSON.
fn doctor(environment: &[(&str, &str)]) -> (String, Value) {
    let run = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
        for name in ["WGPU_BACKEND", "WGPU_ADAPTER_NAME"] {
            command.env_remove(name);
        }
        let output = command.arg("doctor").args(more).envs(environment.iter().copied()).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{environment:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    (run(&[]), serde_json::from_str(&run(&["--format", "json"])).unwrap())
}

#[test]
fn the_doctor_says_what_is_used_and_why() {
    let dir = tempfile::tempdir().unwrap();
    let judged = dir.path().join("aogauge").join("judge");
    fs::create_dir_all(&judged).unwrap();
    fs::write(judged.join("a.exr"), [0; 2048]).unwrap();
    let (page, json) = doctor(&[("XDG_CACHE_HOME", text(dir.path()))]);
    assert!(page.starts_with("aogauge ") && page.lines().all(|l| l.chars().count() <= 100), "{page}");
    let first = page.lines().next().unwrap();
    assert!(first.contains("works on the CPU and on a"), "{page}");
    let adapter = &json["adapters"][0];
    for word in [
        adapter["name"].as_str().unwrap(),
        "--renderer auto: ",
        "timestamps",
        "a binding",
        "threads",
        "chosen because it is ",
    ] {
        let joined = page.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(joined.contains(word), "no {word} in\n{page}");
    }
    assert!(json["cpu"].is_string() && json["threads"].as_u64() > Some(0));
    assert_eq!(json["gpu_is_software"], adapter["kind"] == "software");
    assert!(json["gpu"].as_str().unwrap().starts_with(adapter["name"].as_str().unwrap()));
    assert!(adapter["used"] == true && json["missing"].is_null() && json["trouble"].is_null(), "{json}");
    assert!(adapter["limits"]["binding"].as_u64() >= Some(128 << 20), "{adapter}");
    // Where the cache lies is the system's own affair.
    if cfg!(target_os = "linux") {
        assert_eq!(
            (json["judge_cache"]["files"].as_u64(), json["judge_cache"]["bytes"].as_u64()),
            (Some(1), Some(2048))
        );
        assert!(page.contains("1 file, 2 KiB of at most 1 GiB"), "{page}");
    }
    // A part of its name, in any case, chooses it.
    let part = adapter["name"].as_str().unwrap().to_uppercase();
    let (page, again) = doctor(&[("WGPU_ADAPTER_NAME", &part[..part.len().min(4)])]);
    assert!(again["gpu"] == json["gpu"] && page.contains("WGPU_ADAPTER_NAME="), "{page}");
}

#[test]
fn without_an_adapter_the_doctor_says_what_to_install() {
    let none = "/nonexistent.json";
    for (environment, says) in [
        (vec![("VK_DRIVER_FILES", none), ("VK_ICD_FILENAMES", none), ("WGPU_BACKEND", "vulkan")], "a software one"),
        (vec![("WGPU_BACKEND", "gl")], "aogauge computes on vulkan, metal and dx12"),
        (vec![("WGPU_ADAPTER_NAME", "Voodoo2")], "none has 'Voodoo2' in its name, as WGPU_ADAPTER_NAME asks"),
    ] {
        let (page, json) = doctor(&environment);
        assert!(page.lines().next().unwrap().contains("no GPU: the CPU renders"), "{page}");
        let joined = page.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(joined.contains(says) && page.contains("advice"), "{environment:?}: no {says} in\n{page}");
        assert!(json["gpu"].is_null() && json["missing"].as_str().unwrap().contains(says), "{json}");
    }
}

/// Mesa's AMD driver gives an adapter without hardware, which compiles shaders and
/// runs nothing.
#[test]
fn an_adapter_that_cannot_be_opened_is_said_to_be_so() {
    let null = [("RADV_FORCE_FAMILY", "navi21"), ("WGPU_BACKEND", "vulkan")];
    let (page, json) = doctor(&null);
    let name = json["adapters"][0]["name"].as_str().unwrap();
    if !name.contains("Null hardware") {
        return; // No such driver here.
    }
    assert!(page.starts_with("aogauge ") && page.lines().next().unwrap().contains("no GPU: the CPU renders"), "{page}");
    assert!(page.contains(&format!("{name}, chosen, but cannot be opened")) && !page.contains(", used"), "{page}");
    assert!(
        json["refused"] == name && json["adapters"].as_array().unwrap().iter().all(|a| a["used"] == false),
        "{json}"
    );
    let advice = json["advice"][0].as_str().unwrap();
    assert!(advice.contains("reinstall or update") && advice.contains("WGPU_ADAPTER_NAME"), "{advice}");
    let render = |renderer: &str| {
        let dir = tempfile::tempdir().unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
        command.args([
            "render",
            "plane",
            "--renderer",
            renderer,
            "--rays",
            "1",
            "--out",
            text(&dir.path().join("a.png")),
        ]);
        command.env_remove("WGPU_ADAPTER_NAME").envs(null).output().unwrap()
    };
    let failed = render("gpu");
    let said = String::from_utf8_lossy(&failed.stderr);
    assert!(!failed.status.success() && said.contains(name) && said.contains("cannot be opened"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    assert!(render("cpu").status.success());
}

#[test]
fn every_verb_shows_an_example() {
    let verbs: [&[&str]; 14] = [
        &[],
        &["run"],
        &["report"],
        &["golden", "approve"],
        &["golden", "verify"],
        &["golden", "list"],
        &["golden", "prune"],
        &["golden", "remove"],
        &["golden", "size"],
        &["scene", "list"],
        &["scene", "show"],
        &["scene", "export"],
        &["doctor"],
        &["schema"],
    ];
    for verb in verbs {
        let help = aogauge(&[verb, &["--help"]].concat());
        assert!(String::from_utf8_lossy(&help.stdout).contains("Example"), "{verb:?}");
    }
}

/// Without a driver the CPU renders, and the record says why there is no GPU.
#[test]
fn no_driver_is_no_error_unless_a_gpu_is_asked_for() {
    let (dir, suite) = folder(
        &scene(|s| s),
        &suite(
            "[[gate]]\nname = \"same\"\nmetric = \"renderer-difference\"\nrenderers = [\"gpu\"]\nequals = 0.0\nwithin = 0.1\n\
             [[gate]]\nname = \"not black\"\nmetric = \"openness\"\nregion = \"all\"\nmin = 0.0",
        ),
    );
    let out = dir.path().join("out");
    let blind = |args: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_aogauge"))
            .args(args)
            .env("VK_DRIVER_FILES", "/nonexistent.json")
            .env("VK_ICD_FILENAMES", "/nonexistent.json")
            .output()
            .unwrap()
    };
    let run = blind(&["run", text(&suite), "--out", text(&out)]);
    assert_eq!(run.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&run.stderr).contains("NOT RUN"));
    assert!(record(&out)["machine"]["gpu"].as_str().unwrap().contains("a software one"));
    let asked = blind(&["run", text(&suite), "--out", text(&out), "--renderer", "gpu"]);
    assert_eq!(asked.status.code(), Some(2));
    assert_eq!(record(&out)["seed"], 1, "the older record stays");
}

/// Over an export of the same scene, and over nothing else.
fn exported_over(dir: &Path, kit: &Path) {
    let mine = dir.join("mine");
    fs::create_dir(&mine).unwrap();
    for file in ["README.md", "pillar.glb", "pillar.toml", "views.json", "gbuffer.exr"] {
        fs::write(mine.join(file), "# pillar\n\nmine").unwrap();
        let before = files(&mine);
        let told = expect(2, &["scene", "export", "pillar", "--out", text(&mine)]);
        assert!(told.contains(file) && told.contains("no export of scene 'pillar' wrote this"), "{told}");
        assert!(files(&mine) == before, "{file}");
        fs::remove_file(mine.join(file)).unwrap();
    }
    fs::write(mine.join("notes.txt"), "mine").unwrap();
    expect(0, &["scene", "export", "pillar", "--out", text(&mine)]);
    assert_eq!(fs::read_to_string(mine.join("notes.txt")).unwrap(), "mine");

    let before = files(kit);
    assert!(expect(2, &["scene", "export", "plane", "--out", text(kit)]).contains("no export of scene 'plane' wrote"));
    let own = kit.join("pillar.toml");
    let told = expect(2, &["scene", "export", text(&own), "--out", text(kit)]);
    assert!(told.contains("written over its own file"), "{told}");
    assert!(files(kit) == before);
    // The same scene again, and what was left of it by an export that was killed.
    fs::remove_file(kit.join("regions.exr")).unwrap();
    expect(0, &["scene", "export", "pillar", "--out", text(kit)]);
    assert!(files(kit) == before);
}

#[test]
fn a_scene_can_be_shown_and_taken_elsewhere() {
    let dir = tempfile::tempdir().unwrap();
    let preview = dir.path().join("preview.png");
    let shown = aogauge(&["scene", "show", "pillar", "--preview", text(&preview), "--rays", "1"]);
    let printed = String::from_utf8_lossy(&shown.stdout).into_owned();
    assert!(
        printed.contains("second-curtain") && printed.contains("occluder") && printed.contains("bounds"),
        "{printed}"
    );
    for expected in [
        "secondary_radius = 0.0625",
        "folds = \"flat\"",
        "second-curtain         12 triangles            [-0.01, 0.03, -3] to [0.01, 3, -0.6] m  albedo 0.3",
        "triangles    56 in 4 objects",
        "occluders    1, 12 triangles",
        "environment  uniform sky of radiance 1, 1 portal",
    ] {
        assert!(printed.contains(expected), "no {expected} in\n{printed}");
    }
    assert!(fs::read(&preview).unwrap().starts_with(b"\x89PNG"));
    let jpeg = aogauge(&["scene", "show", "pillar", "--preview", text(&dir.path().join("preview.jpg"))]);
    assert_eq!(jpeg.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&jpeg.stderr).contains("preview.jpg': it must end in .png"));
    let json: Value =
        serde_json::from_slice(&aogauge(&["scene", "show", "pillar", "--format", "json"]).stdout).unwrap();
    assert_eq!(json["parameters"]["ao"]["secondary_radius"], 0.0625);
    assert_eq!(json["parameters"]["object"][2]["shape"]["curtain"]["at"]["z"], 1.55);
    assert_eq!(json["objects"][2]["material"]["base_color"][0], 0.3);
    expect(2, &["scene", "show", "piller"]);

    let kit = dir.path().join("kit");
    expect(0, &["scene", "export", "pillar", "--out", text(&kit)]);
    for file in
        ["pillar.glb", "pillar.toml", "pillar.twin.glb", "views.json", "regions.exr", "gbuffer.exr", "README.md"]
    {
        assert!(kit.join(file).exists(), "{file}");
    }
    exported_over(dir.path(), &kit);
    let masks = aogauge::layers::Layers::read(&kit.join("regions.exr")).unwrap();
    assert_eq!(masks.layers["footprint"].iter().sum::<f32>(), 384.0);
    let surfaces = aogauge::layers::Layers::read(&kit.join("gbuffer.exr")).unwrap();
    assert!(surfaces.layers["normal.z"].iter().all(|n| (n - 1.0).abs() < 1e-6));

    // The kit reads back as the scene it was made from.
    let back = aogauge::scenes::Scene::from_file(&kit.join("pillar.toml")).unwrap();
    assert!(back == aogauge::scenes::library::scene("pillar").unwrap());

    // A scene of the exported model, written by hand.
    let own = dir.path().join("own.toml");
    fs::write(
        &own,
        "description = \"x\"\nao = { radius = 0.25 }\nenvironment = { radiance = 1.0 }\n[gltf]\nfile = \"kit/pillar.glb\"\noccluders = [\"curtain\"]\n",
    )
    .unwrap();
    let json: Value =
        serde_json::from_slice(&aogauge(&["scene", "show", text(&own), "--format", "json"]).stdout).unwrap();
    assert_eq!(json["totals"]["triangles"], 56, "{json}");
    assert_eq!(json["parameters"]["gltf"]["file"], "kit/pillar.glb", "{json}");
    assert!(json["parameters"]["measure"]["clearance"].as_f64().unwrap() > 0.0, "{json}");
    assert!(expect(2, &["scene", "show", "kit/pillar.glb"]).contains("[gltf]"));
}
