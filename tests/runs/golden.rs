//! `aogauge golden` from outside: several goldens a case, whole changes, archives,
//! lists.

use aogauge::layers::{Layers, pixel_hash};
use serde_json::{Value, json};
use std::{
    collections::BTreeSet,
    fs::{self, File},
    io::Write,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::LazyLock,
    time::{Duration, Instant},
};
use tempfile::TempDir;
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

const SCENE: &str = include_str!("../../benches/golden_verify_scene.toml");
const SUITE: &str = r#"
description = "x"
scenes = ["scene.toml"]
rays = [4]
replicates = 8
converged_rays = 32
golden_rays = 4
look_rays = 1
judge = { precision = 1.0, paths = 1, replicates = 4, max_replicates = 4 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "denoised"
kind = "classic"
denoise = {}
"#;

fn command(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
    command.env("XDG_CACHE_HOME", "/dev/null").args(args);
    command
}

pub(super) fn aogauge(args: &[&str]) -> Output {
    command(args).output().unwrap()
}

/// Runs, checks the exit code and returns all that is printed.
fn expect(code: i32, args: &[&str]) -> String {
    let output = aogauge(args);
    let [stderr, stdout] = [output.stderr, output.stdout].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert_eq!(output.status.code(), Some(code), "aogauge {args:?}\n{stderr}");
    stderr + &stdout
}

fn stdout(args: &[&str]) -> String {
    String::from_utf8(aogauge(args).stdout).unwrap()
}

pub(super) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

pub(super) struct Runs {
    _dir: TempDir,
    pub(super) suite: PathBuf,
    /// Seeds 1 and 2.
    pub(super) out: [PathBuf; 2],
}

/// Two records for all tests.
pub(super) static RUNS: LazyLock<Runs> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("scene.toml"), SCENE).unwrap();
    let suite = dir.path().join("suite.toml");
    fs::write(&suite, SUITE).unwrap();
    let out = ["1", "2"].map(|seed| {
        let out = dir.path().join(seed);
        expect(0, &["run", text(&suite), "--out", text(&out), "--renderer", "cpu", "--seed", seed]);
        out
    });
    Runs { _dir: dir, suite, out }
});

pub(super) fn copied(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() { copied(&path, &target) } else { fs::copy(&path, &target).map(|_| ()).unwrap() }
    }
}

pub(super) fn edited(out: &Path, change: impl FnOnce(&mut Value)) {
    let path = out.join("record.json");
    let mut record = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    change(&mut record);
    fs::write(&path, record.to_string()).unwrap();
}

/// A copy of a record whose first case stands there `n` times under names of its own.
fn with_cases(out: &Path, to: &Path, n: usize) {
    copied(out, to);
    edited(to, |record| {
        let one = record["cases"][0].clone();
        record["cases"] = (0..n)
            .map(|i| {
                let mut case = one.clone();
                case["case"]["estimator"] = json!(format!("e{i}"));
                case
            })
            .collect();
    });
}

/// Changes an image, and its hash too: of a golden as if it had been approved so, in a record as
/// if it had been measured so.
fn mean(path: &Path, change: impl Fn(usize, f32) -> f32) {
    let mut layers = Layers::read(path).unwrap();
    for (name, values) in &mut layers.layers {
        if name == "mean" || name.starts_with("replicate-") {
            values.iter_mut().enumerate().for_each(|(i, v)| *v = change(i, *v));
        }
    }
    if let Some(hash) = layers.attributes.get_mut("pixel-hash") {
        *hash = pixel_hash(&layers.layers["mean"]);
    }
    layers.write(path).unwrap();
    let record = path.ancestors().nth(3).unwrap();
    if record.join("record.json").exists() {
        let image = text(path.strip_prefix(record).unwrap());
        edited(record, |record| {
            for case in record["cases"].as_array_mut().unwrap().iter_mut().filter(|case| case["image"] == image) {
                case["hash"] = json!(pixel_hash(&layers.layers["mean"]));
            }
        });
    }
}

#[test]
fn any_of_several_goldens_is_enough_and_the_report_says_which() {
    let dir = tempfile::tempdir().unwrap();
    let (goldens, brighter) = (dir.path().join("goldens"), dir.path().join("brighter"));
    copied(&RUNS.out[0], &brighter);
    mean(&brighter.join("images/scene/classic.cpu.4.exr"), |_, v| v - 0.1);
    let approve = |out: &Path, code: i32, more: &[&str]| {
        let base = ["golden", "approve", text(out), "--goldens", text(&goldens), "--reason", "r", "--only", "classic"];
        expect(code, &[&base[..], more].concat())
    };
    approve(&brighter, 0, &[]);
    let verify = |code: i32| {
        expect(code, &["golden", "verify", text(&RUNS.out[1]), "--goldens", text(&goldens), "--only", "classic"])
    };
    let stderr = verify(1);
    assert!(stderr.contains("shift: brighter") && stderr.contains("region "), "{stderr}");
    for bad in ["2", "a.b", "../x"] {
        assert!(approve(&RUNS.out[0], 2, &["--as", bad]).contains("--as"));
    }
    approve(&RUNS.out[0], 0, &["--as", "other-device"]);
    assert!(goldens.join("scene/classic.4.other-device.exr").exists());
    let stderr = verify(0);
    assert!(stderr.contains("classic.4.other-device.exr holds, 1 before it did not"), "{stderr}");

    // Where none holds, the nearest is told about.
    fs::copy(goldens.join("scene/classic.4.exr"), goldens.join("scene/classic.4.third.exr")).unwrap();
    mean(&goldens.join("scene/classic.4.third.exr"), |_, v| v - 0.3);
    fs::remove_file(goldens.join("scene/classic.4.other-device.exr")).unwrap();
    let stderr = verify(1);
    assert!(stderr.contains("nearest of 2: classic.4.exr"), "{stderr}");
    let json = stdout(&["golden", "verify", text(&RUNS.out[1]), "--goldens", text(&goldens), "--format", "json"]);
    let found: Value = serde_json::from_str(&json).unwrap();
    assert!(found["cases"][0]["golden"].as_str().unwrap().ends_with("classic.4.exr"));
    assert_eq!(found["cases"][0]["others"].as_array().unwrap().len(), 1);
    assert_eq!(found["cases"][0]["verdict"]["compared"]["moved"][0]["what"], "shift");
    assert!(found["stale"].is_null());
}

#[test]
fn smoothed_images_are_held_by_their_replicates() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"]);
    let verify = |code: i32| {
        expect(code, &["golden", "verify", text(&RUNS.out[1]), "--goldens", text(&goldens), "--only", "denoised"])
    };
    let stderr = verify(0);
    assert!(stderr.contains("by replicates"), "{stderr}");
    let golden = goldens.join("scene/denoised.4.exr");
    let mut layers = Layers::read(&golden).unwrap();
    let tiles: Vec<Vec<f32>> = serde_json::from_str(&layers.attributes["tile-means"]).unwrap();
    assert_eq!((tiles.len(), tiles[0].len()), (8, 4 * 2));
    let moved: Vec<Vec<f32>> = tiles.iter().map(|r| r.iter().map(|v| v - 0.05).collect()).collect();
    layers.attributes.insert("tile-means".into(), json!(moved).to_string());
    layers.write(&golden).unwrap();
    assert!(verify(1).contains("shift: brighter"));
    layers.attributes.remove("tile-means");
    layers.write(&golden).unwrap();
    assert!(verify(3).contains("lacks means of tiles"));
    layers.attributes.insert("tile-means".into(), "[[1.0]]".into());
    layers.write(&golden).unwrap();
    assert!(verify(3).contains("'tile-means' does not fit"));
}

#[test]
fn images_without_noise_have_tolerances() {
    let dir = tempfile::tempdir().unwrap();
    let (goldens, still) = (dir.path().join("goldens"), dir.path().join("still"));
    copied(&RUNS.out[0], &still);
    let image = still.join("images/scene/classic.cpu.4.exr");
    let mut layers = Layers::read(&image).unwrap();
    layers.layers.get_mut("variance").unwrap().fill(0.0);
    layers.write(&image).unwrap();
    let approve = |out: &Path, code: i32, tolerance: &str| {
        let base = ["golden", "approve", text(out), "--goldens", text(&goldens), "--reason", "r", "--only", "classic"];
        expect(code, &[&base[..], &["--tolerance", tolerance]].concat())
    };
    assert!(approve(&RUNS.out[0], 2, "flip=0.1").contains("never be read"));
    assert!(!goldens.join("scene").exists());
    assert!(approve(&still, 2, "psnr=3").contains("flip-max="));
    approve(&still, 0, "flip=0.05,flip-max=1,ssim=0.5");
    mean(&image, |i, v| if i == 777 { 1.0 - v } else { v });
    let verify =
        |code: i32| expect(code, &["golden", "verify", text(&still), "--goldens", text(&goldens), "--only", "classic"]);
    assert!(verify(0).contains("alike      no noise; flip "));
    approve(&still, 0, "max=1");
    mean(&image, |i, v| if i == 777 { 1.0 - v } else { v });
    let stderr = verify(1);
    assert!(stderr.contains("flip-max") && stderr.contains("at 9, 12, at most 0.1 is allowed"), "{stderr}");
    assert!(stdout(&["golden", "list", "--goldens", text(&goldens)]).contains("tolerance flip=0.002"));
}

#[test]
fn with_the_golden_s_own_seed_one_wrong_pixel_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let (goldens, wrong) = (dir.path().join("goldens"), dir.path().join("wrong"));
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"]);
    copied(&RUNS.out[0], &wrong);
    let place = 64 * 5 + 9;
    mean(&wrong.join("images/scene/classic.cpu.4.exr"), |i, v| if i == place { 1.0 - v } else { v });
    let stderr = expect(1, &["golden", "verify", text(&wrong), "--goldens", text(&goldens), "--only", "classic"]);
    assert!(stderr.contains("same seeds; rays: ") && stderr.contains("of the pixel 9,5 or more"), "{stderr}");
    assert!(stderr.contains("1 pixel differs, in 9,5 (1x1)"), "{stderr}");
}

fn pointer(path: &Path) {
    fs::write(path, "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n").unwrap();
}

#[test]
fn goldens_are_listed_sized_and_pruned() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    let golden = |code: i32, args: &[&str]| expect(code, &[&["golden"], args, &["--goldens", text(&goldens)]].concat());
    let (out, suite) = (text(&RUNS.out[0]), text(&RUNS.suite));
    for verb in [&["list"][..], &["size"], &["size", "--limit", "1MB"]] {
        assert!(golden(3, verb).contains("there is no folder of goldens"), "{verb:?}");
    }
    fs::create_dir(&goldens).unwrap();
    assert!(golden(4, &["list"]).contains("no golden"));
    golden(0, &["approve", out, "--reason", "größer"]);
    golden(0, &["approve", out, "--reason", "b", "--as", "b", "--only", "classic"]);
    let list = stdout(&["golden", "list", "--goldens", text(&goldens)]);
    assert!(list.contains("größer") && list.contains("8 x 4") && list.contains("cpu on "), "{list}");
    let all: Value =
        serde_json::from_str(&stdout(&["golden", "list", "--goldens", text(&goldens), "--format", "json"])).unwrap();
    let all = &all["goldens"];
    assert_eq!(all.as_array().unwrap().len(), 3);
    assert_eq!(all[1]["name"], "b");
    assert_eq!(all[0]["golden"]["seed"], 1);
    assert_eq!(all[0]["golden"]["resolution"], json!([64, 32]));
    assert_eq!(all[0]["unreadable"], json!(null));

    golden(0, &["size", "--limit", "1MB"]);
    assert!(golden(1, &["size", "--limit", "5kB"]).contains("more than 5.0 kB"));
    let sizes: Value =
        serde_json::from_str(&stdout(&["golden", "size", "--goldens", text(&goldens), "--format", "json"])).unwrap();
    assert_eq!(sizes["total"], sizes["scenes"]["scene"]);
    assert!(sizes["total"].as_u64().unwrap() > 5000);

    pointer(&goldens.join("scene/classic.4.exr"));
    assert!(golden(3, &["list"]).contains("1 cannot be read"));
    assert!(stdout(&["golden", "list", "--goldens", text(&goldens)]).contains("Git LFS pointer"));
    let all = stdout(&["golden", "list", "--goldens", text(&goldens), "--format", "json"]);
    let broken = serde_json::from_str::<Value>(&all).unwrap()["goldens"][0].take();
    assert_eq!(broken["golden"], json!(null));
    assert!(broken["unreadable"].as_str().unwrap().contains("git lfs pull"), "{broken}");

    // What no case names goes; what did not run stays.
    fs::create_dir(goldens.join("gone")).unwrap();
    fs::copy(goldens.join("scene/denoised.4.exr"), goldens.join("gone/classic.4.exr")).unwrap();
    fs::copy(goldens.join("scene/denoised.4.exr"), goldens.join("scene/denoised.8.exr")).unwrap();
    fs::write(goldens.join("README.md"), "not a golden").unwrap();
    for (named_by, code) in [(&[suite][..], 0), (&[suite, out], 0), (&[out], 5)] {
        let stderr = golden(code, &[&["prune"], named_by, &["--dry-run"]].concat());
        assert!(stderr.contains(if code == 0 { "2 goldens would be removed" } else { "give it too" }), "{stderr}");
    }
    assert!(goldens.join("gone/classic.4.exr").exists());
    let removed = stdout(&["golden", "prune", suite, "--goldens", text(&goldens)]);
    assert!(removed.contains("gone/classic.4.exr") && removed.contains("denoised.8.exr"), "{removed}");
    assert!(!goldens.join("gone").exists() && goldens.join("README.md").exists());
    assert!(golden(0, &["prune", suite]).contains("0 goldens removed"));
    assert!(goldens.join("scene/classic.4.b.exr").exists(), "others of a case stay");
}

/// A record that names a scene, an estimator or a ray count less than its suite, in
/// whatever way that came about, removes nothing.
#[test]
fn a_record_of_less_than_its_suite_prunes_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let (goldens, partial) = (dir.path().join("goldens"), dir.path().join("partial"));
    let prune = |code: i32, more: &[&str]| {
        expect(code, &[&["golden", "prune", text(&partial), "--goldens", text(&goldens)], more].concat())
    };
    let suite = text(&RUNS.suite);
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"]);
    type Edit = fn(&mut Value);
    let edits: [(Edit, &str); 6] = [
        (|r| r["cases"].as_array_mut().unwrap().truncate(1), "no golden case of estimator 'denoised'"),
        (|r| r["cases"][0]["error"] = json!("lost"), "scene/classic/cpu/4 ended with an error"),
        // A suite cut before the run: what is left fits together.
        (
            |r| {
                r["cases"].as_array_mut().unwrap().truncate(1);
                r["suite"]["estimators"] = json!(["classic"]);
            },
            "no golden case of estimator 'denoised' in scene 'scene' at 4 rays, which its suite 'suite' names",
        ),
        (
            |r| {
                r["scenes"][0]["name"] = json!("other");
                for case in r["cases"].as_array_mut().unwrap() {
                    case["case"]["scene"] = json!("other");
                }
            },
            "in scene 'scene' at 4 rays",
        ),
        (|r| r["suite"]["golden_rays"] = json!(8), "in scene 'scene' at 4 rays"),
        (|r| r["suite"]["golden_rays"] = json!(null), "in scene 'scene' at 4 rays"),
    ];
    for (edit, says) in edits {
        copied(&RUNS.out[0], &partial);
        edited(&partial, edit);
        let stderr = prune(5, &[suite]);
        assert!(stderr.contains(says) && stderr.contains("nothing is removed"), "{says}: {stderr}");
    }
    // By its name it is of a built-in suite, which names much else.
    copied(&RUNS.out[0], &partial);
    edited(&partial, |r| r["suite"]["name"] = json!("thin-occluders"));
    assert!(prune(5, &[]).contains("which its suite 'thin-occluders' names"));
    assert!(prune(5, &[suite]).contains("which its suite 'thin-occluders' names"));
    assert_eq!(reasons(&goldens, 2).len(), 1, "all are there still");

    // The whole record names its cases, as a folder and as an archive of CI.
    copied(&RUNS.out[0], &partial);
    fs::create_dir(goldens.join("gone")).unwrap();
    fs::copy(goldens.join("scene/classic.4.exr"), goldens.join("gone/classic.4.exr")).unwrap();
    assert!(prune(0, &[suite, "--dry-run"]).contains("1 golden would be removed; 2 cases"));
    let zip = dir.path().join("a.zip");
    zipped(&RUNS.out[0], &zip, "artifact/");
    let args = ["golden", "prune", text(&zip), "--goldens", text(&goldens)];
    assert!(expect(5, &args).contains("give it too"));
    assert!(expect(0, &[&args[..], &[suite]].concat()).contains("1 golden removed; 2 cases"));
    fs::write(&zip, "PK, but no archive").unwrap();
    assert!(expect(2, &args).contains("zip file"));
    let nowhere = dir.path().join("nowhere");
    expect(0, &["golden", "prune", suite, "--goldens", text(&nowhere)]);
    assert!(!nowhere.exists());
}

#[test]
fn goldens_are_removed_by_name_all_or_none() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    let golden = |code: i32, args: &[&str]| expect(code, &[&["golden"], args, &["--goldens", text(&goldens)]].concat());
    for name in ["old-device", "third"] {
        golden(0, &["approve", text(&RUNS.out[0]), "--reason", "r", "--as", name]);
    }
    golden(0, &["approve", text(&RUNS.out[0]), "--reason", "r"]);
    let stderr = golden(3, &["remove", "scene/classic.4.third", "scene/classic.4.fourth"]);
    assert!(stderr.contains("1 of 2 goldens does not exist") && stderr.contains("classic.4.fourth.exr"), "{stderr}");
    let stray = dir.path().join("elsewhere/scene");
    fs::create_dir_all(&stray).unwrap();
    let stray = stray.join("classic.4.exr");
    for bad in ["classic.4", "scene/classic", "../scene/classic.4", "scene/..", text(&stray), "README.md"] {
        let stderr = golden(2, &["remove", bad]);
        assert!(stderr.contains("SCENE/ESTIMATOR.RAYS"), "{bad}: {stderr}");
    }
    assert_eq!(reasons(&goldens, 6).len(), 1);
    golden(0, &["remove", "scene/classic.4.third", "scene/denoised.4.third.exr"]);
    let files = ["classic", "denoised"].map(|e| goldens.join(format!("scene/{e}.4.old-device.exr")));
    assert!(golden(0, &["remove", text(&files[0]), text(&files[1])]).contains("2 goldens removed"));
    assert_eq!(reasons(&goldens, 2).len(), 1);
    assert!(goldens.join("scene/classic.4.exr").exists() && !goldens.join(".approval/journal.json").exists());
    assert!(golden(3, &["remove", text(&files[0])]).contains("nothing is removed"));
    let nowhere = dir.path().join("nowhere");
    expect(3, &["golden", "remove", "a/b.4", "--goldens", text(&nowhere)]);
    assert!(!nowhere.exists());
}

#[test]
fn a_lost_case_refuses_the_approval_and_growth_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let (goldens, partial) = (dir.path().join("goldens"), dir.path().join("partial"));
    copied(&RUNS.out[0], &partial);
    edited(&partial, |r| {
        r["cases"][1]["error"] = json!("the device was lost");
        r["cases"][1]["image"] = json!(null);
    });
    let approve = |code: i32, more: &[&str]| {
        let base = ["golden", "approve", text(&partial), "--goldens", text(&goldens), "--reason", "r"];
        expect(code, &[&base[..], more].concat())
    };
    for more in [&[][..], &["--only", "denoised"]] {
        let stderr = approve(5, more);
        assert!(stderr.contains("scene/denoised/cpu/4 (the device was lost)"), "{stderr}");
        assert!(stderr.contains("nothing is approved"), "{stderr}");
    }
    assert!(!goldens.exists());
    let stderr = approve(0, &["--only", "classic"]);
    assert!(stderr.contains("1 golden approved") && stderr.contains("kB more than before"), "{stderr}");
    assert!(approve(0, &["--only", "classic"]).contains(" 0 B more than before"));
    assert!(!stderr.contains("every clone carries them"), "{stderr}");
    // 60 MB that hold nothing.
    File::create(goldens.join("scene/denoised.4.exr")).unwrap().set_len(60_000_000).unwrap();
    let stderr = approve(0, &["--only", "classic"]);
    assert!(stderr.contains("more than 50.0 MB: every clone carries them"), "{stderr}");
    copied(&RUNS.out[0], &partial);
    let stderr = approve(0, &[]);
    assert!(stderr.contains("MB less than before") && !stderr.contains("every clone"), "{stderr}");
}

/// Every key that is printed stands in the schema, and what the schema requires is
/// printed.
#[test]
fn what_is_printed_has_a_version_and_a_schema() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"]);
    let (out, goldens) = (text(&RUNS.out[1]), text(&goldens));
    let keys = |of: &Value| of.as_object().unwrap().keys().cloned().collect::<BTreeSet<String>>();
    for verb in [&["verify", out][..], &["list"], &["size"]] {
        let args = [&["golden"], verb, &["--goldens", goldens, "--format", "json"]].concat();
        let printed: Value = serde_json::from_str(&stdout(&args)).unwrap();
        assert_eq!(printed["version"], 2, "{verb:?}");
        let schema: Value = serde_json::from_str(&stdout(&["schema", &format!("golden-{}", verb[0])])).unwrap();
        assert_eq!(keys(&schema["properties"]), keys(&printed), "{verb:?}");
        let parts = match verb[0] {
            "verify" => {
                vec![("Checked", &printed["cases"][0]), ("Comparison", &printed["cases"][0]["verdict"]["compared"])]
            }
            "list" => vec![("Entry", &printed["goldens"][0]), ("About", &printed["goldens"][0]["golden"])],
            _ => vec![],
        };
        for (name, part) in parts {
            assert_eq!(keys(&schema["$defs"][name]["properties"]), keys(part), "{name}");
        }
    }
}

#[test]
fn a_git_lfs_pointer_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"]);
    pointer(&goldens.join("scene/classic.4.exr"));
    let stderr = expect(3, &["golden", "verify", text(&RUNS.out[0]), "--goldens", text(&goldens)]);
    assert!(stderr.contains("UNUSABLE") && stderr.contains("git lfs pull"), "{stderr}");
    // What the pointer stands for nobody knows: it is not written over.
    let before = fs::read(goldens.join("scene/denoised.4.exr")).unwrap();
    for more in [&[][..], &["--dry-run"]] {
        let args = ["golden", "approve", text(&RUNS.out[1]), "--goldens", text(&goldens), "--reason", "new"];
        let stderr = expect(3, &[&args[..], more].concat());
        assert!(stderr.contains("classic.4.exr") && stderr.contains("git lfs pull"), "{stderr}");
        assert!(stderr.contains("nothing is approved"), "{stderr}");
    }
    assert!(fs::read(goldens.join("scene/classic.4.exr")).unwrap().starts_with(b"version"));
    assert!(fs::read(goldens.join("scene/denoised.4.exr")).unwrap() == before);
    // Given up by name, it can be approved.
    expect(0, &["golden", "remove", "scene/classic.4", "--goldens", text(&goldens)]);
    expect(0, &["golden", "approve", text(&RUNS.out[1]), "--goldens", text(&goldens), "--reason", "new"]);
}

/// Whether it comes before the one that holds, or after it.
#[test]
fn a_golden_that_cannot_be_read_is_named_though_another_holds() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    let approve = ["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"];
    expect(0, &approve);
    expect(0, &[&approve[..], &["--as", "b", "--only", "classic"]].concat());
    let verify = ["golden", "verify", text(&RUNS.out[1]), "--goldens", text(&goldens)];
    expect(0, &verify);
    for (broken, holds) in [("classic.4.exr", "classic.4.b.exr"), ("classic.4.b.exr", "classic.4.exr")] {
        let path = goldens.join("scene").join(broken);
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let told = expect(3, &verify);
        assert!(told.contains(&format!("UNREADABLE beside it: {}", path.display())), "{told}");
        assert!(told.contains("2 hold, 0 differ") && told.contains("; 1 golden beside them cannot be read"), "{told}");
        let found: Value = serde_json::from_str(&stdout(&[&verify[..], &["--format", "json"]].concat())).unwrap();
        let case = found["cases"].as_array().unwrap().iter().find(|c| c["case"] == "scene/classic/cpu/4").unwrap();
        assert!(case["golden"].as_str().unwrap().ends_with(holds), "{case}");
        assert_eq!(case["unreadable"].as_array().unwrap().len(), 1);
        fs::write(&path, bytes).unwrap();
    }
    expect(0, &verify);
}

#[test]
fn a_golden_whose_pixels_were_changed_is_unusable() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"]);
    let golden = goldens.join("scene/classic.4.exr");
    let mut layers = Layers::read(&golden).unwrap();
    let approved = layers.attributes["pixel-hash"].clone();
    layers.layers.get_mut("mean").unwrap()[77] += 0.25;
    layers.write(&golden).unwrap();
    let printed = expect(3, &["golden", "verify", text(&RUNS.out[0]), "--goldens", text(&goldens)]);
    assert!(printed.contains("UNUSABLE") && printed.contains(&approved), "{printed}");
    assert!(printed.contains("not those that were approved") && printed.contains("1 missing or unusable"), "{printed}");
    assert!(expect(3, &["golden", "list", "--goldens", text(&goldens)]).contains("1 cannot be read"));
}

/// A record whose images are not those that were measured: nobody takes one for the other.
#[test]
fn an_image_that_is_not_the_one_that_was_measured_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let (swapped, goldens) = (dir.path().join("swapped"), dir.path().join("goldens"));
    copied(&RUNS.out[0], &swapped);
    let images = swapped.join("images/scene");
    fs::copy(images.join("denoised.cpu.4.exr"), images.join("classic.cpu.4.exr")).unwrap();
    let (swapped, whole, goldens) = (text(&swapped), text(&RUNS.out[0]), text(&goldens));
    const WHY: &str = "classic.cpu.4.exr: not the image that was measured: the hash of its mean is ";
    let refused = expect(2, &["golden", "approve", swapped, "--goldens", goldens, "--reason", "x"]);
    assert!(refused.contains(WHY) && !Path::new(goldens).exists(), "{refused}");
    let refused = expect(2, &["report", swapped, "--format", "html", "--out", text(&dir.path().join("html"))]);
    assert!(refused.contains(WHY), "{refused}");
    expect(0, &["golden", "approve", whole, "--goldens", goldens, "--reason", "x"]);
    let held = expect(5, &["golden", "verify", swapped, "--goldens", goldens]);
    assert!(held.contains(WHY), "{held}");
    for pair in [[whole, swapped], [swapped, whole]] {
        let told = stdout(&["compare", pair[0], pair[1]]);
        assert!(told.contains("not read") && told.contains(WHY), "{told}");
    }
    // Records are often kept without their images, which is no fault.
    fs::remove_dir_all(images).unwrap();
    let told = stdout(&["compare", whole, swapped]);
    assert!(!told.contains("not read"), "{told}");
}

#[test]
fn verdicts_are_results_and_go_to_standard_output() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"]);
    let args = ["golden", "verify", text(&RUNS.out[0]), "--goldens", text(&goldens)];
    let output = aogauge(&args);
    let printed = String::from_utf8(output.stdout).unwrap();
    assert_eq!(printed.lines().filter(|l| l.contains("identical  to the last bit")).count(), 2, "{printed}");
    assert!(printed.ends_with("family error 0.01\n"), "{printed}");
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}

#[test]
fn growth_is_told_and_refused_before_it_happens() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    let approve = |code: i32, more: &[&str]| {
        let base = ["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "r"];
        expect(code, &[&base[..], more].concat())
    };
    let printed = approve(0, &["--dry-run"]);
    assert!(printed.contains("2 goldens would be approved: r; the store would hold "), "{printed}");
    assert!(printed.contains("scene/classic.4.exr") && printed.contains("kB more than before"), "{printed}");
    for more in [&["--limit", "5kB"][..], &["--limit", "5kB", "--dry-run"]] {
        let printed = approve(1, more);
        assert!(printed.contains("the store holds 0 B and would hold "), "{printed}");
        assert!(printed.contains("more than 5.0 kB; nothing is approved"), "{printed}");
    }
    assert!(!goldens.join("scene").exists());
    assert!(approve(2, &["--limit", "5 parsecs"]).contains("MiB"));
    approve(0, &["--limit", "1MB"]);
    // What is replaced does not count twice.
    let total = fs::read_dir(goldens.join("scene")).unwrap().map(|e| e.unwrap().metadata().unwrap().len());
    let total = total.sum::<u64>().to_string();
    assert!(approve(0, &["--limit", &total]).contains(" 0 B more than before"));
}

/// An approval that ends in the middle of its files, as a kill may: here a folder stands
/// in the way of the fifth. Then `git checkout` restores the old ones.
#[test]
fn an_interrupted_approval_stays_whole_whatever_is_restored() {
    let (dir, n) = (tempfile::tempdir().unwrap(), 9);
    let (goldens, many, old) = (dir.path().join("goldens"), dir.path().join("many"), dir.path().join("old"));
    with_cases(&RUNS.out[0], &many, n);
    assert!(approving(&many, &goldens, "old").wait().unwrap().success());
    copied(&goldens.join("scene"), &old);
    let raw = || {
        let reason = |i| Layers::read(&goldens.join(format!("scene/e{i}.4.exr"))).unwrap().attributes["reason"].clone();
        (0..n).map(reason).collect::<Vec<_>>()
    };
    let blocked = goldens.join("scene/e4.4.exr");
    fs::remove_file(&blocked).unwrap();
    fs::create_dir_all(blocked.join("in the way")).unwrap();
    assert!(!approving(&many, &goldens, "new").wait().unwrap().success());
    fs::remove_dir_all(&blocked).unwrap();
    fs::copy(old.join("e4.4.exr"), &blocked).unwrap();
    let mixture: BTreeSet<String> = raw().into_iter().collect();
    assert_eq!(mixture.len(), 2, "the files themselves are a mixture");
    assert_eq!(reasons(&goldens, n), ["new".to_owned()].into());
    copied(&old, &goldens.join("scene"));
    assert_eq!(raw(), ["old"; 9]);
    assert_eq!(reasons(&goldens, n), ["new".to_owned()].into(), "restored files change nothing");

    let told = "a change of the goldens was decided and then interrupted";
    let (goldens_text, suite) = (text(&goldens), text(&RUNS.suite));
    for verb in [&["verify", text(&many)][..], &["list"], &["size"], &["prune", suite, "--dry-run"]] {
        let printed = expect(0, &[&["golden"], verb, &["--goldens", goldens_text]].concat());
        assert!(printed.contains(told) && printed.contains("git status"), "{verb:?}: {printed}");
    }
    fs::write(goldens.join(".approval/.aogauge-half.part"), "half").unwrap();
    let printed = expect(3, &["golden", "remove", "a/b.4", "--goldens", goldens_text]);
    assert!(printed.contains("it is finished now: 9 goldens put in place, 0 removed"), "{printed}");
    assert_eq!(raw(), ["new"; 9]);
    let left: BTreeSet<_> = fs::read_dir(goldens.join(".approval"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(left, [".gitignore".to_owned(), "lock".to_owned()].into());
    assert!(!expect(0, &["golden", "verify", text(&many), "--goldens", goldens_text]).contains(told));
}

#[test]
fn many_cases_moved_alike_are_called_stale() {
    let dir = tempfile::tempdir().unwrap();
    let (goldens, many) = (dir.path().join("goldens"), dir.path().join("many"));
    with_cases(&RUNS.out[0], &many, 9);
    expect(0, &["golden", "approve", text(&many), "--goldens", text(&goldens), "--reason", "r"]);
    for i in 0..9 {
        mean(&goldens.join(format!("scene/e{i}.4.exr")), |_, v| v + 0.1);
    }
    edited(&many, |r| r["seed"] = json!(77));
    let args = ["golden", "verify", text(&many), "--goldens", text(&goldens), "--format", "json"];
    let found: Value = serde_json::from_str(&stdout(&args)).unwrap();
    let stale = &found["stale"];
    assert_eq!([&stale["compared"], &stale["brighter"], &stale["darker"]], [9, 0, 9]);
    assert!((stale["p"].as_f64().unwrap() - 2.0f64.powi(-8)).abs() < 1e-12);
    assert!(expect(1, &args).contains("probably stale"));
}

/// Everything in a folder as a zip, under a prefix.
pub(super) fn zipped(from: &Path, to: &Path, prefix: &str) {
    let mut zip = ZipWriter::new(File::create(to).unwrap());
    let mut folders = vec![from.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(from).unwrap().to_str().unwrap().replace('\\', "/");
            put(&mut zip, &format!("{prefix}{name}"), &fs::read(&path).unwrap());
        }
    }
    zip.finish().unwrap();
}

fn put(zip: &mut ZipWriter<File>, name: &str, bytes: &[u8]) {
    zip.start_file(name, SimpleFileOptions::default().compression_method(CompressionMethod::Deflated)).unwrap();
    zip.write_all(bytes).unwrap();
}

#[test]
fn archives_of_ci_are_candidates_and_cannot_harm() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let goldens = at("goldens");
    let approve = |zip: &Path, code: i32| {
        expect(code, &["golden", "approve", text(zip), "--goldens", text(&goldens), "--reason", "from CI"])
    };
    let zip = at("a.zip");
    for prefix in ["", "artifact/reports/"] {
        zipped(&RUNS.out[0], &zip, prefix);
        approve(&zip, 0);
        let stderr = expect(0, &["golden", "verify", text(&zip), "--goldens", text(&goldens)]);
        assert_eq!(stderr.matches("identical").count(), 2, "{stderr}");
    }
    let from_folder = at("from-folder");
    expect(0, &["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&from_folder), "--reason", "from CI"]);
    let file = "scene/classic.4.exr";
    assert!(fs::read(goldens.join(file)).unwrap() == fs::read(from_folder.join(file)).unwrap());

    let record = fs::read(RUNS.out[0].join("record.json")).unwrap();
    let with = |entries: &[(&str, &[u8])]| {
        let path = at("evil.zip");
        let mut zip = ZipWriter::new(File::create(&path).unwrap());
        entries.iter().for_each(|(name, bytes)| put(&mut zip, name, bytes));
        zip.finish().unwrap();
        path
    };
    let before = fs::read(goldens.join(file)).unwrap();
    let evil = String::from_utf8(record.clone()).unwrap().replace("images/scene/classic", "../../images/classic");
    let bomb = vec![0u8; 70 << 20];
    for (entries, says) in [
        (&[("a.txt", &b"x"[..])][..], "holds no record.json"),
        (&[("a/record.json", &record[..]), ("b/record.json", &record[..])], "several records"),
        (&[("record.json", &record[..])], "images/scene/classic.cpu.4.exr"),
        (&[("record.json", evil.as_bytes())], "leads out of the record"),
        (&[("record.json", &bomb[..])], "more than"),
        (&[("record.json", &record[..]), ("images/scene/classic.cpu.4.exr", &bomb[..])], "more than"),
    ] {
        let stderr = approve(&with(entries), 2);
        assert!(stderr.contains(says), "{says}: {stderr}");
    }
    // An entry whose name leads elsewhere is never asked for.
    let beside = at("goldens").parent().unwrap().join("slipped");
    let mut zip = ZipWriter::new(File::create(at("slip.zip")).unwrap());
    put(&mut zip, "../slipped", b"x");
    put(&mut zip, "/tmp/../slipped", b"x");
    zip.finish().unwrap();
    approve(&at("slip.zip"), 2);
    assert!(!beside.exists());
    // Cut short, no zip at all, and one that claims 65,535 entries.
    let whole = fs::read(at("a.zip")).unwrap();
    let mut claims = b"PK\x05\x06\0\0\0\0".to_vec();
    claims.extend([0xff; 12]);
    claims.extend([0, 0]);
    for bytes in [&whole[..whole.len() / 2], b"no zip", b"", &claims] {
        fs::write(at("b.zip"), bytes).unwrap();
        approve(&at("b.zip"), 2);
    }
    assert!(fs::read(goldens.join(file)).unwrap() == before, "what failed changed nothing");
}

/// The reasons of all goldens; one where the store is whole.
fn reasons(goldens: &Path, n: usize) -> BTreeSet<String> {
    let list = stdout(&["golden", "list", "--goldens", text(goldens), "--format", "json"]);
    let list: Value = serde_json::from_str(&list).unwrap();
    let list = &list["goldens"];
    assert_eq!(list.as_array().unwrap().len(), n);
    list.as_array().unwrap().iter().map(|e| e["golden"]["reason"].as_str().unwrap().to_owned()).collect()
}

fn approving(out: &Path, goldens: &Path, reason: &str) -> Child {
    let args = ["golden", "approve", text(out), "--goldens", text(goldens), "--reason", reason];
    command(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Kills approvals at 40 moments spread over the time that one takes.
#[test]
fn an_approval_killed_at_any_moment_leaves_a_whole_store() {
    let (dir, n) = (tempfile::tempdir().unwrap(), 24);
    let (goldens, many) = (dir.path().join("goldens"), dir.path().join("many"));
    with_cases(&RUNS.out[0], &many, n);
    assert!(approving(&many, &goldens, "reason 0").wait().unwrap().success());
    let began = Instant::now();
    assert!(approving(&many, &goldens, "reason 0").wait().unwrap().success());
    let whole = began.elapsed();
    let (mut last, mut new) = ("reason 0".to_owned(), 0);
    for i in 1..=40u32 {
        let reason = format!("reason {i}");
        let mut child = approving(&many, &goldens, &reason);
        // The parts of the golden ratio cover the time evenly.
        std::thread::sleep(whole.mul_f64(f64::from(i) * 0.618_033_988_749 % 1.0));
        child.kill().unwrap();
        child.wait().unwrap();
        let found = reasons(&goldens, n);
        assert!(found == [last.clone()].into() || found == [reason.clone()].into(), "kill {i}: {found:?}");
        if found.contains(&reason) {
            (last, new) = (reason, new + 1);
        }
    }
    println!("40 kills over {whole:?}: {new} left the new store, the others the old one");
    assert!(approving(&many, &goldens, "end").wait().unwrap().success());
    assert_eq!(reasons(&goldens, n), ["end".to_owned()].into());
    assert_eq!(fs::read_dir(goldens.join("scene")).unwrap().count(), n, "nothing else is left");
}

#[test]
fn approvals_and_verifications_at_once_see_whole_stores() {
    let (dir, n) = (tempfile::tempdir().unwrap(), 12);
    let (goldens, many) = (dir.path().join("goldens"), dir.path().join("many"));
    with_cases(&RUNS.out[0], &many, n);
    assert!(approving(&many, &goldens, "first").wait().unwrap().success());
    let mut approvals: Vec<Child> = (0..4).map(|i| approving(&many, &goldens, &format!("reason {i}"))).collect();
    let mut seen = BTreeSet::new();
    while approvals.iter_mut().any(|a| a.try_wait().unwrap().is_none()) {
        let found = reasons(&goldens, n);
        assert_eq!(found.len(), 1, "{found:?}");
        seen.extend(found);
        expect(0, &["golden", "verify", text(&many), "--goldens", text(&goldens)]);
    }
    assert!(approvals.iter_mut().all(|a| a.wait().unwrap().success()));
    println!("seen: {seen:?}");
    assert_eq!(reasons(&goldens, n).len(), 1);
}

/// A lock held elsewhere: an approval waits and says so; a verification waits too.
#[test]
fn who_waits_for_the_lock_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    assert!(approving(&RUNS.out[0], &goldens, "first").wait().unwrap().success());
    assert_eq!(fs::read_to_string(goldens.join(".approval/.gitignore")).unwrap(), "*\n");
    let lock = File::open(goldens.join(".approval/lock")).unwrap();
    lock.lock().unwrap();
    let args = ["golden", "approve", text(&RUNS.out[0]), "--goldens", text(&goldens), "--reason", "second"];
    let child = command(&args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(1500));
    lock.unlock().unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(stderr.contains("waiting for it to end"), "{stderr}");
    assert_eq!(reasons(&goldens, 2), ["second".to_owned()].into());
}
