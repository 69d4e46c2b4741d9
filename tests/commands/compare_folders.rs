//! `aogauge compare` of folders and with limits, from outside.

use aogauge::layers::Layers;
use image::{Rgb, RgbImage};
use serde_json::{Value, json};
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

fn compare(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(folder).arg("compare").args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn found(output: &Output, code: i32) -> Value {
    assert_eq!(output.status.code(), Some(code), "{}{}", text(&output.stderr), text(&output.stdout));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn picture(path: &Path, left: u8, size: [u32; 2]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    RgbImage::from_fn(size[0], size[1], |x, _| Rgb([if x < 20 { left } else { 102 }; 3])).save(path).unwrap();
}

/// `a` and `b`: equal.png, sub/off.png by 0.2 in the left half; a/gone.png, b/new.png.
fn folders(root: &Path) {
    for (file, left) in [
        ("a/equal.png", 102),
        ("b/equal.png", 102),
        ("a/sub/off.png", 102),
        ("b/sub/off.png", 153),
        ("a/gone.png", 9),
        ("b/new.png", 9),
    ] {
        picture(&root.join(file), left, [40, 30]);
    }
    fs::write(root.join("a/notes.txt"), "x").unwrap();
}

fn outcomes(found: &Value) -> Vec<(&str, &str)> {
    let pairs = found["pairs"].as_array().unwrap();
    pairs.iter().map(|p| (p["path"].as_str().unwrap(), p["outcome"].as_str().unwrap())).collect()
}

#[test]
fn folders_are_matched_and_what_has_no_partner_is_told() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    let report = found(&compare(root.path(), &["a", "b", "--format", "json"]), 1);
    assert_eq!(outcomes(&report), [("equal.png", "measured"), ("sub/off.png", "measured")]);
    assert_eq!((&report["missing"], &report["new"]), (&json!(["gone.png"]), &json!(["new.png"])));
    assert_eq!((&report["outcome"], &report["left_out"], &report["version"]), (&json!("fail"), &json!(1), &json!(1)));
    let out = compare(root.path(), &["a", "b", "--allow-missing", "--maps", "maps"]);
    assert_eq!(out.status.code(), Some(0));
    let table = text(&out.stdout);
    for line in [
        "MISSING      gone.png",
        "NEW          new.png",
        "measured: 2 measured, 1 missing, 1 new, 1 other files left out",
    ] {
        assert!(table.contains(line), "{line}: {table}");
    }
    assert!(text(&out.stderr).is_empty(), "no bar where standard error is no terminal");
    for file in ["equal.png/flip.png", "sub/off.png/side-by-side.png", "sub/off.png/maps.exr"] {
        assert!(root.path().join("maps").join(file).is_file(), "{file}");
    }
}

#[test]
fn limits_of_both_tiers_make_a_verdict() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    let args = |more: &[&'static str]| [&["a", "b", "--allow-missing", "--format", "json"], more].concat();
    let warn = found(&compare(root.path(), &args(&["--warn", "mae<=0.05", "--fail", "differing<=0.5"])), 0);
    assert_eq!(outcomes(&warn), [("equal.png", "pass"), ("sub/off.png", "warn")]);
    let limits = &warn["pairs"][1]["limits"];
    assert_eq!(
        (&limits[0]["limit"], &limits[0]["value"], &limits[0]["state"]),
        (&json!("differing<=0.5"), &json!(0.5), &json!("holds"))
    );
    assert_eq!((&limits[1]["tier"], &limits[1]["state"]), (&json!("warn"), &json!("broken")));
    let fail = found(&compare(root.path(), &args(&["--fail", "absolute.max<=0.1", "--warn", "mae<=0.05"])), 1);
    assert_eq!(outcomes(&fail), [("equal.png", "pass"), ("sub/off.png", "fail")]);
    // Equal images have an infinite PSNR, which is above every limit.
    let psnr = found(&compare(root.path(), &args(&["--fail", "psnr>=40"])), 1);
    assert_eq!(outcomes(&psnr), [("equal.png", "pass"), ("sub/off.png", "fail")]);
    assert_eq!(psnr["pairs"][0]["limits"][0]["note"], "infinite");
    // 30 rows are too few for MS-SSIM.
    let none = found(&compare(root.path(), &args(&["--fail", "ms-ssim>=0.5"])), 6);
    assert_eq!(outcomes(&none), [("equal.png", "inconclusive"), ("sub/off.png", "inconclusive")]);
    assert!(none["pairs"][0]["limits"][0]["note"].as_str().unwrap().contains("176 pixels or more"));
    let exact = found(&compare(root.path(), &args(&["--exact", "--fail", "largest-difference<=0.1"])), 1);
    assert_eq!(outcomes(&exact), [("equal.png", "pass"), ("sub/off.png", "fail")]);
}

#[test]
fn a_limits_file_has_overrides_and_names_its_lines() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    let limits = |text: &str| fs::write(root.path().join("l.toml"), text).unwrap();
    let run = |code| {
        found(&compare(root.path(), &["a", "b", "--allow-missing", "--format", "json", "--limits", "l.toml"]), code)
    };
    limits("fail = [\"mae<=0.05\"]\n");
    assert_eq!(outcomes(&run(1))[1].1, "fail");
    limits("fail = [\"mae<=0.05\"]\n[[override]]\npath = \"sub/*\"\nfail = [\"mae<=0.2\"]\n");
    assert_eq!(outcomes(&run(0))[1].1, "pass");
    limits("fail = [\"mae<=0.05\"]\n\nfial = []\n");
    let out = compare(root.path(), &["a", "b", "--limits", "l.toml"]);
    assert_eq!(out.status.code(), Some(2));
    let message = text(&out.stderr);
    assert!(message.contains("l.toml") && message.contains("line 3") && message.contains("fial"), "{message}");
}

#[test]
fn a_pair_that_cannot_be_compared_is_an_error_row() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    picture(&root.path().join("b/gone.png"), 9, [41, 30]);
    fs::write(root.path().join("a/new.png"), "words").unwrap();
    let report = found(&compare(root.path(), &["a", "b", "--format", "json", "--fail", "mae<=0.05"]), 2);
    let expected = [("equal.png", "pass"), ("gone.png", "error"), ("new.png", "error"), ("sub/off.png", "fail")];
    assert_eq!(outcomes(&report), expected);
    let reason = report["pairs"][1]["reason"].as_str().unwrap();
    assert!(reason.contains("the reference has 40 x 30 pixels, the test image 41 x 30"), "{reason}");
    assert!(report["pairs"][2]["reason"].as_str().unwrap().contains("not a readable image"));
}

#[test]
fn nothing_to_compare_records_and_mixtures() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    fs::create_dir_all(root.path().join("empty")).unwrap();
    fs::write(root.path().join("artifact.ZIP"), "PK").unwrap();
    assert_eq!(compare(root.path(), &["empty", "empty"]).status.code(), Some(4));
    assert_eq!(compare(root.path(), &["empty", "b"]).status.code(), Some(4), "new images alone compare nothing");
    assert_eq!(compare(root.path(), &["a", "empty"]).status.code(), Some(1));
    assert_eq!(compare(root.path(), &["a", "empty", "--allow-missing"]).status.code(), Some(4));
    for (args, message) in [
        (["a", "b/equal.png"], "a is a folder and b/equal.png is none"),
        (["a", "nowhere"], "a is a folder and nowhere does not exist"),
        (["nowhere", "a"], "a is a folder and nowhere does not exist"),
        (["a", "artifact.ZIP"], "artifact.ZIP is a zip archive: unpack it first"),
        (["artifact.ZIP", "b/equal.png"], "artifact.ZIP is a zip archive: unpack it first"),
        (["nowhere", "nothing"], "nowhere: cannot read the image"),
    ] {
        let out = compare(root.path(), &args);
        assert_eq!(out.status.code(), Some(2));
        assert!(text(&out.stderr).contains(message), "{}", text(&out.stderr));
    }
    let out = compare(root.path(), &["a", "b", "--diff", "d.png"]);
    assert!(out.status.code() == Some(2) && text(&out.stderr).contains("--maps leaves a side-by-side.png"));
    fs::write(root.path().join("b/record.json"), "{}").unwrap();
    let out = compare(root.path(), &["a", "b"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("b is a record (it has a record.json)"), "{}", text(&out.stderr));
}

/// Nor are maps put among the references, where the next run would miss them in the other folder.
#[test]
fn no_image_of_a_folder_is_written_over() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    let listed = || {
        let mut found = Vec::new();
        for folder in ["a", "b"] {
            let entries = fs::read_dir(root.path().join(folder)).unwrap();
            found.extend(entries.map(|e| e.unwrap().path()).map(|p| (fs::read(&p).ok(), p)));
        }
        found.sort();
        found
    };
    let before = listed();
    let mut ways = vec![("a", "never written"), ("a/maps", "never written"), ("b/../a/./maps", "never written")];
    ways.push(("b", "--maps would write over b/"));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("b", root.path().join("link")).unwrap();
        std::os::unix::fs::symlink("a", root.path().join("other")).unwrap();
        ways.extend([("link", "--maps would write over link/"), ("other/maps", "never written")]);
    }
    for (maps, says) in ways {
        let out = compare(root.path(), &["a", "b", "--maps", maps]);
        assert_eq!(out.status.code(), Some(2), "{maps}");
        assert!(text(&out.stderr).contains(says), "{maps}: {}", text(&out.stderr));
        assert!(listed() == before, "{maps}");
    }
    // A folder within the test folder is its owner's business.
    assert_ne!(compare(root.path(), &["a", "b", "--maps", "b/maps"]).status.code(), Some(2));
    assert!(root.path().join("b/maps").is_dir());
}

#[test]
fn nan_in_one_image_only_fails() {
    let root = tempfile::tempdir().unwrap();
    let write = |name: &str, first: f32| {
        let values = [vec![first], vec![0.5; 399]].concat();
        Layers::new([20, 20]).with("mean", values).write(&root.path().join(name)).unwrap();
    };
    write("a.exr", 0.5);
    write("b.exr", f32::NAN);
    assert_eq!(compare(root.path(), &["a.exr", "b.exr"]).status.code(), Some(1));
    let report = found(&compare(root.path(), &["a.exr", "b.exr", "--fail", "mae<=1", "--format", "json"]), 1);
    assert!(report["pairs"][0]["reason"].as_str().unwrap().contains("1 of the test image alone"));
    assert_eq!(report["pairs"][0]["exact"]["largest"], Value::Null);
    let exact = compare(root.path(), &["a.exr", "b.exr", "--exact", "--fail", "largest-difference<=1"]);
    assert_eq!(exact.status.code(), Some(1));
}

#[test]
fn masks_may_be_a_folder() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    let mask = image::GrayImage::from_fn(40, 30, |x, _| image::Luma([if x < 20 { 0 } else { 255 }]));
    fs::create_dir_all(root.path().join("masks/sub")).unwrap();
    mask.save(root.path().join("masks/sub/off.png")).unwrap();
    let args = ["a", "b", "--allow-missing", "--mask", "masks", "--fail", "differing<=0", "--format", "json"];
    let report = found(&compare(root.path(), &args), 0);
    let pixels = |i: usize| report["pairs"][i]["exact"]["pixels"].as_u64();
    assert_eq!((pixels(0), pixels(1)), (Some(1200), Some(600)));
}

#[test]
fn the_schema_names_what_is_printed() {
    let root = tempfile::tempdir().unwrap();
    folders(root.path());
    let schema = Command::new(env!("CARGO_BIN_EXE_aogauge")).args(["schema", "compare"]).output().unwrap();
    let schema: Value = serde_json::from_slice(&schema.stdout).unwrap();
    let report = found(&compare(root.path(), &["a", "b", "--allow-missing", "--format", "json"]), 0);
    for key in report.as_object().unwrap().keys() {
        assert!(schema["properties"][key].is_object(), "{key}");
    }
    for key in report["pairs"][0].as_object().unwrap().keys() {
        assert!(schema["$defs"]["PairReport"]["properties"][key].is_object(), "{key}");
    }
}
