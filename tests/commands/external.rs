//! Renderers that are commands, as a suite names them: what becomes of their images, and
//! what of those that hang, crash, lie or leave nothing.

use aogauge::layers::Layers;
use serde_json::{Value, json};
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

const AOGAUGE: &str = env!("CARGO_BIN_EXE_aogauge");

const SUITE: &str = r#"
description = "x"
scenes = ["plane"]
rays = [4]
replicates = 4
converged_rays = 64
look_rays = 1
judge = { precision = 1.0, paths = 1, replicates = 8, max_replicates = 8 }
[[estimator]]
name = "classic"
kind = "classic"
"#;

/// A list in TOML, whatever the texts hold.
fn list(texts: &[&str]) -> String {
    toml::Value::from(texts.to_vec()).to_string()
}

/// A renderer of classic AO.
fn renderer(name: &str, command: &[&str], more: &str) -> String {
    format!("[[renderer]]\nname = '{name}'\nestimators = ['classic']\ncommand = {}\n{more}\n", list(command))
}

/// aogauge itself, with the seed it is given.
const ITSELF: [&str; 9] =
    [AOGAUGE, "render", "{scene_toml}", "--out", "{output}", "--rays", "{rays}", "--seed", "{seed}"];

fn command(folder: &Path, suite: &str, more: &str) -> Command {
    fs::write(folder.join("suite.toml"), suite).unwrap();
    let mut command = Command::new(AOGAUGE);
    command.current_dir(folder).args(["run", "suite.toml", "--no-cache"]);
    if !more.contains("--out") {
        command.args(["--out", "out"]);
    }
    command.args(more.split_whitespace()).env("NODEVICE_SELECT", "1");
    command
}

fn record(folder: &Path, ended: &Output) -> Value {
    let text = fs::read_to_string(folder.join("out/record.json"));
    serde_json::from_str(&text.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&ended.stderr)))).unwrap()
}

/// Runs a suite in a folder, and returns its exit code and record.
fn run(folder: &Path, suite: &str, more: &str) -> (Option<i32>, Value) {
    let ended = command(folder, suite, more).output().unwrap();
    (ended.status.code(), record(folder, &ended))
}

fn case<'a>(record: &'a Value, renderer: &str) -> &'a Value {
    let cases = record["cases"].as_array().unwrap();
    cases.iter().find(|c| c["case"]["renderer"] == renderer).unwrap_or_else(|| panic!("{record}"))
}

fn metric<'a>(case: &'a Value, name: &str) -> &'a Value {
    let all = case["metrics"].as_array().unwrap();
    let of = |m: &&Value| m["name"] == name && (m["region"].is_null() || m["region"] == "all");
    all.iter().find(of).unwrap_or_else(|| panic!("{case}"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value}"))
}

/// It draws the same rays for the same seed, and others for others.
#[test]
fn aogauge_as_somebody_elses_renderer_is_the_cpu_within_the_statistics() {
    let dir = tempfile::tempdir().unwrap();
    let suite = SUITE
        .replace("\"plane\"", "\"curtain-open\"")
        .replace("replicates = 4", "golden_rays = 4\nreplicates = 8")
        + &renderer("itself", &ITSELF, "")
        + "[[gate]]\nname = 'same'\nmetric = 'renderer-difference'\nrenderers = ['itself']\nequals = 0\nwithin = 0.02\n\
           [[gate]]\nname = 'seeds'\nmetric = 'distinct-replicates'\nmin = 1\n";
    let (code, record) = run(dir.path(), &suite, "--report markdown,junit,html");
    assert_eq!(code, Some(0), "{record}");
    let [cpu, own] = ["cpu", "itself"].map(|r| case(&record, r));
    let image = |case: &Value| Layers::read(&dir.path().join("out").join(case["image"].as_str().unwrap())).unwrap();
    let [cpu_image, own_image] = [cpu, own].map(image);
    // The first replicate has the run's own seed.
    let bits = |l: &Layers, r: &str| l.get(r).unwrap().iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&cpu_image, "replicate-0000"), bits(&own_image, "replicate-0000"));
    assert_ne!(bits(&cpu_image, "replicate-0001"), bits(&own_image, "replicate-0001"));
    assert_eq!(number(&metric(own, "distinct-replicates")["value"]), 1.0);
    // Not paired: the errors of both add up.
    let difference = metric(own, "renderer-difference");
    let se = |c| number(&metric(c, "openness")["se"]);
    assert!((number(&difference["se"]) - se(cpu).hypot(se(own))).abs() < 1e-9, "{difference}");
    let value = |c| number(&metric(c, "openness")["value"]);
    assert!((number(&difference["value"]) - (value(own) - value(cpu))).abs() < 1e-9, "{difference}");
    for name in ["contrast", "contrast-error", "rmse", "openness"] {
        let [a, b] = [cpu, own].map(|c| metric(c, name));
        let apart = number(&a["se"]).hypot(number(&b["se"]));
        assert!((number(&a["value"]) - number(&b["value"])).abs() < 6.0 * apart, "{name}: {a} {b}");
    }
    assert_eq!(own["log"], "logs/curtain-open/classic.itself.4.log");
    assert!(cpu["log"].is_null());
    let log = fs::read_to_string(dir.path().join("out/logs/curtain-open/classic.itself.4.log")).unwrap();
    assert!(log.contains("=== replicate 7, attempt 1 of 1") && log.contains("--- exit status: 0"), "{log}");
    assert_eq!(record["suite"]["renderers"]["itself"][1], "render");
    assert!(!dir.path().join("out/.aogauge-run").exists());
    let mut approve = Command::new(AOGAUGE);
    approve.current_dir(dir.path()).args(["golden", "approve", "out", "--renderer", "itself", "--reason", "x"]);
    let approved = approve.output().unwrap();
    assert!(approved.status.success() && approved.stdout.ends_with(b".exr\n"), "{approved:?}");
    // One seed gives other numbers in another program: beside goldens of the CPU its images are fresh.
    let golden = |args: &[&str]| {
        let mut golden = Command::new(AOGAUGE);
        golden.current_dir(dir.path()).arg("golden").args(args).args(["--goldens", "of-cpu"]).output().unwrap()
    };
    assert!(golden(&["approve", "out", "--renderer", "cpu", "--reason", "x"]).status.success());
    let held = golden(&["verify", "out"]);
    let text = String::from_utf8(held.stdout).unwrap();
    let of_itself = text.lines().find(|l| l.contains("/itself/4")).unwrap_or_else(|| panic!("{text}"));
    assert!(held.status.success() && of_itself.contains("equal      fresh seeds"), "{text}");
    for report in ["report.md", "report.html", "junit.xml"] {
        assert!(fs::read_to_string(dir.path().join("out").join(report)).unwrap().contains("itself"), "{report}");
    }
}

/// Two parts and their sum, and a run until sure.
#[test]
fn shards_are_merged_with_their_logs() {
    let dir = tempfile::tempdir().unwrap();
    let suite = SUITE.to_owned()
        + &renderer("itself", &ITSELF, "")
        + &renderer("lost", &ITSELF, "scenes = ['plane']\nrays = [4]\ntimeout = 0.001")
        + "[[gate]]\nname = 'open'\nmetric = 'openness'\nregion = 'all'\nequals = 1\nwithin = 0.1\n";
    let (code, whole) = run(dir.path(), &suite, "--renderer auto");
    assert_eq!(code, Some(5), "{whole}");
    for k in [1, 2] {
        let ended = command(dir.path(), &suite, &format!("--shard {k}/2 --out part-{k}")).output().unwrap();
        assert!([Some(0), Some(5)].contains(&ended.status.code()), "{ended:?}");
    }
    let mut merge = Command::new(AOGAUGE);
    let ended = merge.current_dir(dir.path()).args(["merge", "part-1", "part-2", "--out", "merged"]).output().unwrap();
    assert_eq!(ended.status.code(), Some(5), "{ended:?}");
    let merged: Value = serde_json::from_slice(&fs::read(dir.path().join("merged/record.json")).unwrap()).unwrap();
    for field in ["verdicts", "pooled", "scenes", "suite"] {
        assert_eq!(merged[field], whole[field], "{field}");
    }
    for name in ["itself", "lost"] {
        let [a, b] = [&merged, &whole].map(|r| case(r, name));
        assert_eq!([&a["hash"], &a["metrics"], &a["log"]], [&b["hash"], &b["metrics"], &b["log"]]);
        assert!(dir.path().join("merged").join(a["log"].as_str().unwrap()).is_file());
    }
    assert!(case(&merged, "lost")["error"].as_str().unwrap().contains("longer than 0.001 s (timeout)"), "{merged}");
    // Its folder of scenes does not stay in what is uploaded.
    let left = |k| dir.path().join(format!("part-{k}/.aogauge-run/external"));
    assert!([1, 2].map(left).iter().all(|p| fs::read_dir(p).map_or(0, Iterator::count) == 0));

    let suite = suite.replace("timeout = 0.001", "");
    let (code, sure) = run(dir.path(), &suite, "--until-sure --max-replicates 16 --fresh");
    assert_eq!(code, Some(0), "{sure}");
    assert_eq!([&case(&sure, "itself")["replicates"], &case(&sure, "itself")["looks"]], [&json!(4), &json!(1)]);
}

#[test]
fn who_renders_can_be_chosen() {
    let dir = tempfile::tempdir().unwrap();
    let suite = SUITE.replace("rays = [4]", "rays = [4, 8]")
        + &renderer("itself", &ITSELF, "")
        + "[[gate]]\nname = 'same'\nmetric = 'renderer-difference'\nrenderers = ['itself']\nequals = 0\nwithin = 0.02\n\
           [[gate]]\nname = 'open'\nmetric = 'openness'\nregion = 'all'\nequals = 1\nwithin = 0.1\n";
    let renderers = |record: &Value| {
        let all = record["cases"].as_array().unwrap();
        all.iter().map(|c| format!("{}/{}", c["case"]["renderer"], c["case"]["rays"])).collect::<Vec<_>>()
    };
    let (code, record) = run(dir.path(), &suite, "--renderer cpu");
    assert_eq!((code, renderers(&record)), (Some(0), vec!["\"cpu\"/4".to_owned(), "\"cpu\"/8".to_owned()]));
    let idle = &record["idle_gates"][0];
    let says = "this run used none of the renderers it is for: itself";
    assert_eq!([&idle["gate"], &idle["reason"], &idle["excused"]], [&json!("same"), &json!(says), &json!(true)]);
    let (code, record) = run(dir.path(), &suite, "--filter classic/itself/8");
    assert_eq!((code, renderers(&record)), (Some(0), vec!["\"cpu\"/8".to_owned(), "\"itself\"/8".to_owned()]));
}

/// All of it is found before anything is rendered.
#[test]
fn a_renderer_that_cannot_run_is_exit_code_2_and_names_the_field() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("beside"), "no program").unwrap();
    let out = "{output}";
    let missing = "command: the program 'no-such-program-of-anybody' is not found on PATH";
    for (suite, says) in [
        (renderer("x", &["no-such-program-of-anybody", out], ""), missing),
        (renderer("x", &["./nothing", out], ""), "the program './nothing' is not found beside the suite file"),
        (renderer("x", &["beside", out], ""), "for the one beside the suite file write './beside'"),
        (renderer("x", &[AOGAUGE, out], "folder = 'nowhere'"), "renderer 'x': folder: "),
        (renderer("x", &[AOGAUGE, out, "{ray}"], ""), "renderer 'x': command: '{ray}' is no placeholder"),
        (renderer("x", &[AOGAUGE, "{rays}"], ""), "command: {output} is not in it"),
        (renderer("x", &["{suite_folder}/x", out], ""), "the first part is the program"),
        (renderer("x", &[], ""), "command has 0 parts"),
        (renderer("CPU", &[AOGAUGE, out], ""), "'CPU' is the name of our own"),
        (renderer("auto", &[AOGAUGE, out], ""), "'auto' is the name of our own"),
        (renderer("../x", &[AOGAUGE, out], ""), "legal name"),
        (renderer("x", &[AOGAUGE, out], "") + &renderer("X", &[AOGAUGE, out], ""), "'X' is named twice"),
        (renderer("x", &[AOGAUGE, out], "retries = 6"), "0 to 5"),
        (renderer("x", &[AOGAUGE, out], "timeout = 0"), "timeout is 0: it must be 0.001 to 86400 seconds"),
        (renderer("x", &[AOGAUGE, out], "scenes = ['plan']"), "renderer 'x': scenes names 'plan'"),
        (renderer("x", &[AOGAUGE, out], "rays = [5]"), "renderer 'x': rays names"),
        (renderer("x", &[AOGAUGE, out], "colour = 1"), "colour"),
        (renderer("x", &[AOGAUGE, out], "environment = { set = { 'a=b' = '' } }"), "'a=b' is no name of a variable"),
        (renderer("x", &[AOGAUGE, out], "environment = { set = { A = '{x}' } }"), "environment: A: '{x}' is no"),
        (renderer("x", &[AOGAUGE, out], "").replace("['classic']", "['clasic']"), "estimators names 'clasic'"),
        (renderer("x", &[AOGAUGE, out], "").replace("['classic']", "[]"), "estimators is empty"),
    ] {
        let ended = command(dir.path(), &format!("{SUITE}{suite}"), "").output().unwrap();
        let message = String::from_utf8_lossy(&ended.stderr);
        assert!(ended.status.code() == Some(2) && message.contains(says), "{suite}: {message}");
        assert!(!dir.path().join("out").exists());
    }
    // Names may hold dots, and images are called by both.
    let dotted = SUITE.to_owned() + "[[estimator]]\nname = 'classic.x'\nkind = 'obscurance'\nfalloff = 'quadratic'\n";
    let both = renderer("x.y", &[AOGAUGE, out], "") + &renderer("y", &[AOGAUGE, out], "");
    let both = both.replacen("['classic']", "['classic', 'classic.x']", 2);
    let ended = command(dir.path(), &(dotted + &both), "").output().unwrap();
    let message = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.code() == Some(2) && message.contains("would have the name of another's"), "{message}");
}

#[cfg(unix)]
mod scripts {
    use super::*;
    use std::{
        os::unix::fs::PermissionsExt,
        process::Stdio,
        time::{Duration, Instant},
    };

    /// A program beside the suite file.
    fn script(folder: &Path, name: &str, text: &str) {
        let path = folder.join(name);
        fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn size() -> [u32; 2] {
        aogauge::scenes::library::scene("plane").unwrap().measure.view().resolution
    }

    /// An image of one value.
    fn flat(path: &Path, [w, h]: [u32; 2], value: f32) {
        Layers::new([w, h]).with("mean", vec![value; (w * h) as usize]).write(path).unwrap();
    }

    fn error(record: &Value, renderer: &str) -> String {
        let case = case(record, renderer);
        case["error"].as_str().unwrap_or_else(|| panic!("{case}")).to_owned()
    }

    /// Whether a process runs; a zombie does not.
    fn runs(id: &str) -> bool {
        let ps = Command::new("ps").args(["-o", "stat=", "-p", id.trim()]).output();
        match fs::read_to_string(format!("/proc/{}/stat", id.trim())) {
            Ok(stat) => !stat.rsplit(')').next().unwrap_or_default().trim_start().starts_with('Z'),
            Err(_) if Path::new("/proc/self/stat").exists() => false,
            Err(_) => ps.is_ok_and(|o| !matches!(o.stdout.first(), None | Some(b'Z'))),
        }
    }

    /// A shell, its child and its grandchild that does not listen wait for ever.
    const HANG: &str = "(trap '' TERM; sh -c 'echo $$ > ids.$$; sleep 1000' & sleep 1000) &\n\
                        echo $$ > ids.$$\necho here I am\nsleep 1000";

    fn ids(folder: &Path) -> Vec<String> {
        let all = fs::read_dir(folder).unwrap().flatten();
        let all = all.filter(|e| e.file_name().to_string_lossy().starts_with("ids."));
        all.map(|e| fs::read_to_string(e.path()).unwrap()).collect()
    }

    /// Each of them fails in its own way, and costs its own case.
    #[test]
    fn what_fails_ends_its_case_and_says_why() {
        let dir = tempfile::tempdir().unwrap();
        let at = dir.path();
        let [w, h] = size();
        flat(&at.join("flat.exr"), [w, h], 0.5);
        flat(&at.join("small.exr"), [w / 2, h], 0.5);
        flat(&at.join("nan.exr"), [w, h], f32::NAN);
        fs::write(at.join("broken.exr"), b"no image").unwrap();
        fs::create_dir(at.join("away")).unwrap();
        flat(&at.join("away/image.exr"), [w, h], 0.5);
        script(at, "hang", HANG);
        script(at, "crash", "echo first\necho second >&2\nexit 3");
        script(at, "killed", "kill -9 $$");
        script(at, "nothing", "exit 0");
        script(at, "link", "ln -s \"$PWD/flat.exr\" \"$1\"");
        script(at, "hard", "ln \"$PWD/flat.exr\" \"$1\"");
        script(at, "folder", "mkdir \"$1\"");
        script(at, "fifo", "mkfifo \"$1\"");
        script(at, "moved", "d=$(dirname \"$1\")\nrm -r \"$d\"\nln -s \"$PWD/away\" \"$d\"");
        script(
            at,
            "loud",
            "head -c 3000000 /dev/zero | tr '\\0' x >&2\nhead -c 9000000 /dev/zero | tr '\\0' y\nexit 1",
        );
        script(at, "litter", "cp flat.exr \"$1\"\nd=$(dirname \"$1\")\nmkdir \"$d/x\"\ncp flat.exr \"$d/x/other.exr\"");
        let own = |name: &str| renderer(name, &[&format!("./{name}"), "{output}"], "");
        let copy = |name: &str| renderer(name, &["cp", &format!("{{suite_folder}}/{name}.exr"), "{output}"], "");
        let suite = SUITE.to_owned()
            + &renderer("hang", &["./hang", "{output}"], "timeout = 0.4\nretries = 1")
            + &["crash", "killed", "nothing", "link", "hard", "folder", "fifo", "moved", "loud", "litter"]
                .map(own)
                .concat()
            + &["flat", "small", "nan", "broken"].map(copy).concat();
        let (code, record) = run(at, &suite, "");
        assert_eq!(code, Some(5), "{record}");
        let renderers: Vec<&str> =
            record["cases"].as_array().unwrap().iter().map(|c| c["case"]["renderer"].as_str().unwrap()).collect();
        assert!(renderers.len() >= 16 && case(&record, "cpu")["error"].is_null(), "{renderers:?}");
        for (renderer, says) in [
            (
                "hang",
                "replicate 0 (the last of 2 attempts): the command took longer than 0.4 s (timeout) and was ended",
            ),
            ("hang", "it said last: here I am; its log is logs/plane/classic.hang.4.log"),
            ("crash", "the command failed (exit status: 3); it said last: second"),
            ("killed", "the command failed (signal: 9"),
            ("nothing", "ended without an error, but left no file at {output}; it said nothing"),
            ("link", "what the command left at {output} is a symbolic link"),
            ("hard", "a file with a second name"),
            ("folder", "is a folder"),
            ("fifo", "is no file"),
            ("moved", "in a folder that was put in the place of its own"),
            ("loud", "the command failed (exit status: 1); it said last: xxx"),
            ("small", &format!("{}", w / 2)),
            ("nan", "NaN"),
            ("broken", "image.exr"),
        ] {
            let why = error(&record, renderer);
            assert!(why.contains(says), "{renderer}: {why}");
            let log = fs::read_to_string(at.join(format!("out/logs/plane/classic.{renderer}.4.log"))).unwrap();
            assert!(log.contains("=== replicate 0, attempt 1 of"), "{renderer}: {log}");
        }
        assert!(error(&record, "loud").len() < 1000);
        let loud = fs::metadata(at.join("out/logs/plane/classic.loud.4.log")).unwrap().len();
        assert!((1 << 20..3 << 20).contains(&loud), "{loud}");
        let hung = fs::read_to_string(at.join("out/logs/plane/classic.hang.4.log")).unwrap();
        assert!(hung.contains("attempt 2 of 2") && hung.contains("--- stdout\nhere I am\n"), "{hung}");
        assert_eq!(record["timing"]["retries"], json!({ "plane/classic/hang/4": 1 }));
        let ids = ids(at);
        assert!(ids.len() == 4 && !ids.iter().any(|id| runs(id)), "{ids:?}");
        // One image for all seeds: no number of replicates makes that an interval.
        for fixed in ["flat", "litter"] {
            assert_eq!(number(&metric(case(&record, fixed), "distinct-replicates")["value"]), 0.25);
        }
        assert_eq!(number(&metric(case(&record, "flat"), "openness")["value"]), 0.5);
        assert!(!at.join("out/.aogauge-run").exists() && at.join("away/image.exr").exists());
    }

    /// What a command leaves is looked at as images are that are handed in.
    #[test]
    fn images_that_are_wrong_as_a_whole_end_their_case() {
        let dir = tempfile::tempdir().unwrap();
        let at = dir.path();
        let [w, h] = aogauge::scenes::library::scene("corner").unwrap().measure.view().resolution;
        let mut render = Command::new(AOGAUGE);
        render.current_dir(at).args(["render", "corner", "--rays", "64", "--replicates", "2", "--out", "whole.exr"]);
        assert!(render.status().unwrap().success());
        let image = Layers::read(&at.join("whole.exr")).unwrap().get("replicate-0000").unwrap().to_vec();
        let write = |name: &str, values: Vec<f32>| Layers::new([w, h]).with("Y", values).write(&at.join(name)).unwrap();
        write("right.exr", image.clone());
        write("inverted.exr", image.iter().map(|v| 1.0 - v).collect());
        write("mirrored.exr", image.chunks(w as usize).flat_map(|r| r.iter().rev().copied()).collect());
        write("codes.exr", image.iter().map(|v| v * 255.0).collect());
        write("strong.exr", image.iter().map(|v| 1.0 - 1.5 * (1.0 - v)).collect());
        let copy = |name: &str| renderer(name, &["cp", &format!("{{suite_folder}}/{name}.exr"), "{output}"], "");
        let names = ["right", "inverted", "mirrored", "codes", "strong"];
        let suite = SUITE.replace("\"plane\"", "\"corner\"") + &names.map(copy).concat();
        let (code, record) = run(at, &suite, "--report markdown,html");
        assert_eq!(code, Some(5), "{record}");
        for (renderer, says) in [
            (
                "inverted",
                "its images are wrong: replicate 0: inverted: 1 is closed; declare `image.means = \"occlusion\"`",
            ),
            ("mirrored", "flipped in x"),
            ("codes", "divide by 255"),
        ] {
            let why = error(&record, renderer);
            assert!(why.contains(says), "{renderer}: {why}");
            assert_eq!(case(&record, renderer)["log"], format!("logs/corner/classic.{renderer}.4.log"));
        }
        let [right, strong] = ["right", "strong"].map(|r| case(&record, r));
        assert!(right["error"].is_null() && right["warnings"].is_null(), "{right}");
        let doubt = strong["warnings"][0].as_str().unwrap_or_else(|| panic!("{strong}"));
        assert!(strong["error"].is_null() && doubt.starts_with("AO of strength 1."), "{doubt}");
        let report = fs::read_to_string(at.join("out/report.md")).unwrap();
        assert!(report.contains("corner/classic/strong/4: AO of strength"), "{report}");
    }

    /// It fails once for each of two replicates.
    #[test]
    fn what_fails_now_and_then_is_tried_again() {
        let dir = tempfile::tempdir().unwrap();
        script(
            dir.path(),
            "flaky",
            "n=$1; shift\nif [ $n -gt 1 ] && [ ! -e done.$n ]; then touch done.$n; echo not today; exit 1; fi\nexec \"$@\"",
        );
        let command: Vec<&str> = ["./flaky", "{replicate}"].into_iter().chain(ITSELF).collect();
        let suite = SUITE.to_owned() + &renderer("flaky", &command, "retries = 5");
        let (code, record) = run(dir.path(), &suite, "");
        assert_eq!(code, Some(0), "{record}");
        assert_eq!(record["timing"]["retries"], json!({ "plane/classic/flaky/4": 2 }));
        let log = fs::read_to_string(dir.path().join("out/logs/plane/classic.flaky.4.log")).unwrap();
        for says in ["=== replicate 2, attempt 2 of 6", "not today", "--- the command failed (exit status: 1)"] {
            assert!(log.contains(says), "{log}");
        }
        assert_eq!(case(&record, "flaky")["hash"], case(&record, "cpu")["hash"], "an open plane reads 1");
    }

    /// What a shell would read is a name like any other.
    #[test]
    fn no_shell_reads_names_and_arguments() {
        let dir = tempfile::tempdir().unwrap();
        let at = &dir.path().join("a b'c\"d;$(touch pwned)`touch pwned`&ü{rays}");
        fs::create_dir_all(at.join("work here")).unwrap();
        script(
            at,
            "say it",
            "printf '%s\\n' \"$@\" > \"$HERE/args.txt\"\nprintf '%s\\n' \"$SECRET|$PLAIN\" > \"$HERE/env.txt\"\n\
             pwd > \"$HERE/pwd.txt\"\ncp \"$HERE/flat.exr\" \"$1\"",
        );
        flat(&at.join("flat.exr"), size(), 0.5);
        let odd = "$(touch pwned); touch pwned | 'x' \"y\" * ~ \\ {{rays}} --";
        let arguments = [
            "./say it",
            "{output}",
            "",
            odd,
            "{scene}",
            "{view}",
            "{rays}",
            "{seed}",
            "{radius}",
            "{secondary_radius}",
            "{estimator}",
            "{width}x{height}",
            "{replicate}",
            "{suite_folder}",
        ];
        let own = |inherit: bool| {
            let set = "set = { HERE = '{suite_folder}', PLAIN = '{{{replicate}}}' }";
            let more = format!("folder = 'work here'\nenvironment = {{ inherit = {inherit}, {set} }}");
            SUITE.to_owned() + &renderer("odd", &arguments, &more)
        };
        for (inherit, secret) in [(true, "told"), (false, "")] {
            let ended = command(at, &own(inherit), "--fresh").env("SECRET", "told").output().unwrap();
            assert_eq!(ended.status.code(), Some(0), "{}", record(at, &ended));
            // Its values may be secrets, and what is logged may be pasted.
            let log = fs::read_to_string(at.join("out/logs/plane/classic.odd.4.log")).unwrap();
            assert!(log.contains("with HERE=… PLAIN=… (values are not logged)") && !log.contains("{3}"), "{log}");
            assert!(log.contains(r"'$(touch pwned); touch pwned | '\''x'\'' "), "{log}");
            let env = fs::read_to_string(at.join("env.txt")).unwrap();
            assert_eq!(env, format!("{secret}|{{3}}\n"));
        }
        let args = fs::read_to_string(at.join("args.txt")).unwrap();
        let args: Vec<&str> = args.lines().collect();
        let [w, h] = size();
        let real = fs::canonicalize(at).unwrap();
        let here = |text: &str| Path::new(text).starts_with(at) || Path::new(text).starts_with(&real);
        assert!(here(args[0]) && args[0].ends_with("/image.exr"), "{args:?}");
        assert_eq!([args[1], args[2]], ["", &odd.replace("{{rays}}", "{rays}")]);
        assert!(args[3].ends_with("/plane.glb") && args[4].ends_with("/views.json") && here(args[3]), "{args:?}");
        assert_eq!(args[5], "4");
        assert!(args[6].parse::<u32>().unwrap() < 1 << 31);
        let scene = aogauge::scenes::library::scene("plane").unwrap();
        let number = |text: &str| text.parse::<f32>().unwrap();
        assert_eq!([number(args[7]), number(args[8])], [scene.ao.radius, scene.ao.secondary_radius]);
        assert_eq!(args[9..12], ["classic", &format!("{w}x{h}"), "3"]);
        assert!(here(args[12]), "{args:?}");
        assert!(fs::read_to_string(at.join("pwd.txt")).unwrap().trim_end().ends_with("/work here"));
        let pwned = |folder: &Path| folder.join("pwned").exists();
        assert!(!pwned(at) && !pwned(dir.path()) && !pwned(&at.join("work here")));
    }

    /// A hung command ends with the run, and with its case's time.
    #[test]
    fn a_run_that_ends_early_takes_its_commands_with_it() {
        let dir = tempfile::tempdir().unwrap();
        script(dir.path(), "hang", HANG);
        let suite = SUITE.to_owned() + &renderer("hang", &["./hang", "{output}"], "");
        let began = Instant::now();
        let (code, record) = run(dir.path(), &suite, "--case-timeout 2");
        assert_eq!(code, Some(5), "{record}");
        let why = error(&record, "hang");
        assert!(why.contains("it took longer than 2 s (--case-timeout): 0 of 4 replicates"), "{why}");
        assert!(began.elapsed() < Duration::from_secs(60));

        let mut child = command(dir.path(), &suite, "--fresh").stderr(Stdio::null()).spawn().unwrap();
        let before = ids(dir.path()).len();
        while ids(dir.path()).len() < before + 2 {
            assert!(began.elapsed() < Duration::from_secs(120));
            std::thread::sleep(Duration::from_millis(10));
        }
        let asked = Instant::now();
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), Some(5));
        assert!(asked.elapsed() < Duration::from_secs(20));
        let text = fs::read_to_string(dir.path().join("out/record.json")).unwrap();
        let record: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(record["incomplete"], "it was interrupted");
        assert!(!ids(dir.path()).iter().any(|id| runs(id)));

        // The same command goes on; a program that is another begins anew.
        let on = |text: &str| {
            script(dir.path(), "hang", text);
            command(dir.path(), &suite, "--renderer auto").output().unwrap()
        };
        let ended = on("exit 1");
        let told = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(ended.status.code() == Some(5) && !told.contains("going on where"), "{told}");
    }
}
