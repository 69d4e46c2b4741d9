//! What commands print of others' text: reasons, errors, devices, names of files. GitHub's runner takes commands from
//! all that is printed, and a terminal takes escapes.

use super::{
    golden::{RUNS, aogauge, copied, edited, text, zipped},
    report_formats::{stored, written},
};
use image::{Rgb, RgbImage};
use serde_json::{Value, json};
use std::{fs, path::Path};

const REJECTED: &str = "x\n::stop-commands::abc\n::add-mask::pass";
const HOSTILE: &str = "y\n::error ::y\u{1b}[31m\r\n  ##[add-mask]z";

/// Standard output and standard error, either without commands and control characters.
fn harmless(args: &[&str]) -> String {
    let output = aogauge(args);
    let [out, told] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    check(&out, args);
    check(&told, args);
    out + &told
}

fn check(printed: &str, args: &[&str]) {
    for line in printed.split('\n') {
        let is_command = line.trim_start().starts_with("::") || line.contains("##[");
        assert!(!is_command && !line.contains(char::is_control), "aogauge {args:?}: {line:?}\n{printed}");
    }
}

/// Standard output as JSON, whose strings are data as they were; standard error is for people.
fn data(args: &[&str]) -> Value {
    let output = aogauge(args);
    check(&String::from_utf8(output.stderr).unwrap(), args);
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Seed 2's record, of another machine.
fn record(dir: &Path, change: impl FnOnce(&mut Value)) -> String {
    copied(&RUNS.out[1], dir);
    edited(dir, |record| {
        record["machine"]["cpu"] = json!(HOSTILE);
        record["tool"] = json!(HOSTILE);
        change(record);
    });
    text(dir).to_owned()
}

#[test]
fn reasons_and_errors_of_goldens_are_text() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    let mut case = Value::Null;
    let whole = record(&dir.path().join("whole"), |record| case = record["cases"][0].clone());
    let lost = record(&dir.path().join("lost"), |record| record["cases"][0]["error"] = json!(HOSTILE));
    let at = ["--goldens", text(&goldens)];
    let golden = |verb: &str, args: &[&str]| harmless(&[&["golden", verb][..], args, &at[..]].concat());

    assert!(golden("approve", &[&lost, "--reason", "r"]).contains("were lost"));
    assert!(golden("approve", &[&whole, "--reason", HOSTILE]).contains("2 goldens approved"));
    let listed = golden("list", &[]);
    assert_eq!(listed.matches("on y ::error ::y [31m").count(), 2, "{listed}");
    assert_eq!(listed.matches("aogauge y ::error ::y [31m").count(), 2, "{listed}");
    assert_eq!(listed.lines().filter(|l| l.trim_start().starts_with("y ::error ::y [31m")).count(), 2, "{listed}");
    let listed = data(&["golden", "list", "--format", "json", at[0], at[1]]);
    assert_eq!(listed["goldens"][0]["golden"]["reason"], HOSTILE);

    let name = ["scene", "estimator", "renderer"].map(|part| case["case"][part].as_str().unwrap()).join("/");
    let name = format!("{name}/{}", case["case"]["rays"]);
    let rejected = json!([{ "case": name, "pixel_hash": case["hash"], "reason": REJECTED }]);
    let list = json!({ "version": 1, "rejected": rejected });
    fs::write(goldens.join("rejected.json"), list.to_string()).unwrap();
    let found = golden("verify", &[&whole]);
    assert!(found.contains("rejected before: x ::stop-commands::abc ::add-mask::pass"), "{found}");
    let found = data(&["golden", "verify", &whole, "--format", "json", at[0], at[1]]);
    assert_eq!(found["cases"][0]["rejected"], REJECTED);
    assert!(golden("verify", &[&lost]).contains("LOST"));
    // Of an archive, too.
    let zip = dir.path().join("a.zip");
    zipped(Path::new(&whole), &zip, "");
    assert!(golden("verify", &[text(&zip)]).contains("rejected before: x ::stop"));
}

#[cfg(unix)]
#[test]
fn names_of_goldens_files_are_text() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = dir.path().join("goldens");
    let whole = record(&dir.path().join("whole"), |_| ());
    let at = ["--goldens", text(&goldens)];
    let golden = |verb: &str, args: &[&str]| harmless(&[&["golden", verb][..], args, &at[..]].concat());
    golden("approve", &[&whole, "--reason", "r"]);
    for scene in ["scene", "elsewhere"] {
        fs::create_dir_all(goldens.join(scene)).unwrap();
        fs::write(goldens.join(scene).join("classic.4.a\n::error ::b\u{1b}[31m.exr"), "cut").unwrap();
    }
    let shown = "classic.4.a ::error ::b [31m.exr";
    assert!(golden("list", &[]).contains(shown));
    assert!(golden("verify", &[&whole]).contains("UNREADABLE beside it"));
    golden("size", &[]);
    assert!(golden("prune", &[text(&RUNS.suite), "--dry-run"]).contains(shown));
    assert!(golden("remove", &["elsewhere/classic.4.a\n::error ::b\u{1b}[31m"]).contains(shown));
}

/// Lines are broken wherever words end.
#[test]
fn explanations_are_text() {
    let dir = tempfile::tempdir().unwrap();
    let mut record = stored();
    record.cases[0].error = Some("::error::x ".repeat(40));
    record.scenes[0].judge_error = Some(HOSTILE.to_owned());
    for verdict in &mut record.verdicts {
        (verdict.reason, verdict.outcome) = (HOSTILE.to_owned(), aogauge::gate::Outcome::Fail);
    }
    let told = harmless(&["explain", text(&written(dir.path(), &record))]);
    assert_eq!(told.matches(":error::x").count(), 40, "{told}");
}

#[cfg(unix)]
#[test]
fn names_of_images_are_text() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|folder| dir.path().join(folder));
    let hostile = |name: &str| format!("{name}\n::error ::y\u{1b}[31m.png");
    for (folder, names) in [(&a, ["both", "cut", "gone"]), (&b, ["both", "cut", "new"])] {
        fs::create_dir(folder).unwrap();
        for name in names {
            RgbImage::from_pixel(16, 16, Rgb([9; 3])).save(folder.join(hostile(name))).unwrap();
        }
    }
    fs::write(b.join(hostile("cut")), "cut").unwrap();
    let told = harmless(&["compare", text(&a), text(&b), "--fail", "mae<=0.1"]);
    for name in ["both", "cut", "gone", "new"] {
        assert!(told.contains(&format!("{name} ::error ::y [31m.png")), "{name}: {told}");
    }
    harmless(&["compare", text(&a.join(hostile("both"))), text(&b.join(hostile("cut")))]);
}
