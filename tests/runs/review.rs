//! `golden review` as a browser meets it, and as somebody does who should not.

use super::golden::{copied, zipped};
use serde_json::{Value, json};
use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::LazyLock,
};

/// Two records of one suite and different seeds.
static RECORDS: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let tiny = Path::new(env!("CARGO_MANIFEST_DIR")).join(".ci/tiny.toml");
    for seed in ["1", "2"] {
        let args = ["run", tiny.to_str().unwrap(), "--renderer", "cpu", "--no-cache", "--seed", seed, "--out", seed];
        let out = aogauge(dir.path(), &args);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    }
    dir
});

fn aogauge(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(folder).args(args).output().unwrap()
}

/// A store with goldens of seed 1, the plane's made of seed 2's smaller record: missing.
fn store(dir: &Path, only: &str) -> PathBuf {
    let goldens = dir.join("goldens");
    let args = ["golden", "approve", "1", "--goldens", goldens.to_str().unwrap(), "--reason", "first", "--only", only];
    assert!(aogauge(RECORDS.path(), &args).status.success());
    goldens
}

struct Review {
    child: Child,
    port: u16,
    token: String,
}

impl Review {
    fn begin(goldens: &Path, more: &[&str]) -> Review {
        Review::of(Path::new("2"), goldens, more)
    }

    fn of(record: &Path, goldens: &Path, more: &[&str]) -> Review {
        let mut command = Command::new(env!("CARGO_BIN_EXE_aogauge"));
        command.current_dir(RECORDS.path()).args(["golden", "review"]).arg(record);
        command.arg("--goldens").arg(goldens).args(more);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        let (host, token) = address.trim().strip_prefix("http://127.0.0.1:").unwrap().split_once("/?token=").unwrap();
        Review { child, port: host.parse().unwrap(), token: token.to_owned() }
    }

    /// A request as it goes over the wire: status and body.
    fn ask(&self, request: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let answer = String::from_utf8(answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_owned())
    }

    fn get(&self, path: &str, host: &str) -> (u16, String) {
        self.ask(&format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"))
    }

    fn post(&self, path: &str, headers: &str, body: &str) -> (u16, String) {
        self.ask(&format!(
            "POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\
             Connection: close\r\n{headers}\r\n{body}",
            self.port,
            body.len()
        ))
    }

    fn decide(&self, case: &str, decision: &str, reason: &str) -> (u16, String) {
        let body = json!({ "case": case, "decision": decision, "reason": reason }).to_string();
        let (status, body) = self.post("/decide", &format!("x-aogauge-token: {}\r\n", self.token), &body);
        let message =
            serde_json::from_str::<Value>(&body).map(|v| v["message"].as_str().unwrap_or_default().to_owned());
        (status, message.unwrap_or(body))
    }

    fn finish(mut self) -> (i32, String) {
        let (status, _) = self.post("/finish", &format!("x-aogauge-token: {}\r\n", self.token), "{}");
        assert_eq!(status, 200);
        let code = self.child.wait().unwrap().code().unwrap();
        let mut text = String::new();
        self.child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
        (code, text)
    }
}

impl Drop for Review {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn reasons(goldens: &Path) -> Vec<(String, String)> {
    let out = aogauge(goldens, &["golden", "list", "--goldens", ".", "--format", "json"]);
    let text = String::from_utf8(out.stdout).unwrap();
    let list: Value = serde_json::from_str(&text).unwrap();
    let mut found = Vec::new();
    collect(&list, &mut found);
    found.sort();
    found
}

/// Scene and reason of every golden, wherever they stand in the list.
fn collect(value: &Value, found: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) => {
            if let (Some(Value::String(scene)), Some(Value::String(reason))) = (map.get("scene"), map.get("reason")) {
                found.push((scene.clone(), reason.clone()));
            }
            map.values().for_each(|v| collect(v, found));
        }
        Value::Array(all) => all.iter().for_each(|v| collect(v, found)),
        _ => {}
    }
}

fn pair(scene: &str, reason: &str) -> (String, String) {
    (scene.to_owned(), reason.to_owned())
}

#[test]
fn what_is_decided_reaches_the_store_and_nothing_else_does() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = store(dir.path(), "plane");
    let review = Review::begin(&goldens, &["--all"]);
    let (status, page) = review.get(&format!("/?token={}", review.token), &format!("127.0.0.1:{}", review.port));
    assert!(status == 200 && page.contains("curtain-arcade/classic/cpu/4"), "{status}");
    // No reason, no such case, a path for a name.
    for (case, decision, reason, why) in [
        ("curtain-arcade/classic/cpu/4", "approve", "  ", "1 to 1000"),
        ("curtain-arcade/classic/cpu", "approve", "x", "no case"),
        ("../../x", "approve", "x", "no case"),
        ("/etc/passwd", "reject", "x", "no case"),
    ] {
        let (status, message) = review.decide(case, decision, reason);
        assert!(status == 422 && message.contains(why), "{case}: {status} {message}");
    }
    assert_eq!(reasons(&goldens), [pair("plane", "first")]);

    let (status, message) = review.decide("curtain-arcade/classic/cpu/4", "approve", "  the hem is lit\n");
    assert!(status == 200 && message.contains("classic.4.exr"), "{message}");
    assert_eq!(reasons(&goldens), [pair("curtain-arcade", "the hem is lit"), pair("plane", "first")]);
    let (status, _) = review.decide("plane/classic/cpu/4", "reject", "not this | one");
    assert_eq!(status, 200);
    assert_eq!(reasons(&goldens), [pair("curtain-arcade", "the hem is lit"), pair("plane", "first")]);
    let (_, text) = review.finish();
    assert!(text.contains("1 approved, 1 rejected"), "{text}");

    // The next verification tells of the refusal, an approval takes it back.
    let verify = || {
        let out = aogauge(RECORDS.path(), &["golden", "verify", "2", "--goldens", goldens.to_str().unwrap()]);
        String::from_utf8(out.stdout).unwrap() + &String::from_utf8(out.stderr).unwrap()
    };
    assert!(verify().contains("rejected before: not this | one"), "{}", verify());
    let args = ["golden", "approve", "2", "--goldens", goldens.to_str().unwrap(), "--reason", "after all"];
    assert!(aogauge(RECORDS.path(), &args).status.success());
    assert!(!verify().contains("rejected"), "{}", verify());
}

/// A golden that cannot stand for the image is looked at beside it, with the reason.
#[test]
fn unusable_goldens_are_shown_with_their_reason() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = store(dir.path(), "classic");
    let page = |goldens: &Path| {
        let review = Review::begin(goldens, &["--only", "plane/classic"]);
        review.get(&format!("/?token={}", review.token), &format!("127.0.0.1:{}", review.port)).1
    };
    let golden = goldens.join("plane/classic.4.exr");
    let mut layers = aogauge::layers::Layers::read(&golden).unwrap();
    layers.layers.get_mut("mean").unwrap()[7] += 0.25;
    layers.write(&golden).unwrap();
    let shown = page(&goldens);
    assert!(shown.contains("golden, unusable") && shown.contains("not those that were approved"));
    // Of another size and scene: brought to that of the image.
    let [width, height] = layers.resolution;
    let mut half = aogauge::layers::Layers::new([width / 2, height]);
    half.attributes.clone_from(&layers.attributes);
    for (name, values) in &layers.layers {
        let every = values.chunks(width as usize).flat_map(|row| row.iter().step_by(2).copied()).collect();
        half = half.with(name, every);
    }
    half.write(&golden).unwrap();
    assert!(page(&goldens).contains(&format!("golden, unusable: {} x {height} pixels", width / 2)));
    // What is no image has its reason alone.
    std::fs::write(&golden, "cut").unwrap();
    let shown = page(&goldens);
    assert!(shown.contains("unusable because") && !shown.contains("golden, unusable"));
    // Beside one that holds it is under review, too.
    let args = ["golden", "approve", "2", "--goldens", goldens.to_str().unwrap(), "--reason", "b", "--as", "b"];
    let args = [&args[..], &["--only", "plane/classic"]].concat();
    assert!(aogauge(RECORDS.path(), &args).status.success());
    let shown = page(&goldens);
    assert!(shown.contains("cannot be read") && shown.contains("replaces") && shown.contains("classic.4.exr"));
}

/// The zip that CI keeps is looked at as its folder is; of one that keeps only what goldens are made of, that.
#[test]
fn an_archive_is_reviewed_with_what_it_holds() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = store(dir.path(), "plane");
    let page = |review: &Review| {
        let (status, page) = review.get(&format!("/?token={}", review.token), &format!("127.0.0.1:{}", review.port));
        assert_eq!(status, 200, "{page}");
        page.replace(&review.token, "")
    };
    let (folder, zip) = (RECORDS.path().join("2"), dir.path().join("a.zip"));
    zipped(&folder, &zip, "artifact/");
    let whole = page(&Review::begin(&goldens, &["--all"]));
    assert!(whole.contains("against Q, what the occluder does") && !whole.contains("The record lacks"));
    assert!(page(&Review::of(&zip, &goldens, &["--all"])) == whole, "the archive's page is another one");

    let thin = dir.path().join("thin");
    copied(&folder, &thin);
    let record: Value = serde_json::from_str(&std::fs::read_to_string(thin.join("record.json")).unwrap()).unwrap();
    let images = record["scenes"].as_array().unwrap().iter().flat_map(|s| [&s["look"], &s["judge"]["image"]]);
    let images: Vec<&str> = images.filter_map(Value::as_str).collect();
    images.iter().for_each(|image| std::fs::remove_file(thin.join(image)).unwrap());
    zipped(&thin, &zip, "");
    let review = Review::of(&zip, &goldens, &["--all"]);
    let shown = page(&review);
    assert!(shown.contains("against its golden") && !shown.contains("against Q, what the occluder does"));
    assert!(shown.contains(&format!("The record lacks {} images of the judge or of look views", images.len())));
    let (status, message) = review.decide("curtain-arcade/classic/cpu/4", "approve", "seen");
    assert_eq!(status, 200, "{message}");
    assert_eq!(reasons(&goldens), [pair("curtain-arcade", "seen"), pair("plane", "first")]);
}

#[test]
fn strangers_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = store(dir.path(), "plane");
    let review = Review::begin(&goldens, &["--all"]);
    let own = format!("127.0.0.1:{}", review.port);
    let page = format!("/?token={}", review.token);
    assert_eq!(review.get(&page, &own).0, 200);
    // Without the token, with half of it, by another name (DNS rebinding).
    for (path, host) in [
        ("/", own.as_str()),
        (&page[..page.len() - 1], &own),
        (&page, "evil.example"),
        (&page, "127.0.0.1:1"),
        (&page, ""),
    ] {
        let (status, body) = review.get(path, host);
        assert!(status == 403 && !body.contains(&review.token), "{path} {host}: {status}");
    }
    for path in ["/../goldens/rejected.json", "/%2e%2e/%2e%2e/etc/passwd", "/goldens", "//etc/passwd"] {
        assert_eq!(review.get(path, &own).0, 404, "{path}");
    }
    let body = json!({ "case": "curtain-arcade/classic/cpu/4", "decision": "approve", "reason": "x" }).to_string();
    let token = format!("x-aogauge-token: {}\r\n", review.token);
    for headers in [
        String::new(),
        "x-aogauge-token: 0\r\n".to_owned(),
        format!("{token}Origin: http://evil.example\r\n"),
        format!("{token}Origin: null\r\n"),
    ] {
        assert_eq!(review.post("/decide", &headers, &body).0, 403, "{headers}");
        assert_eq!(review.post("/finish", &headers, "{}").0, 403, "{headers}");
    }
    // Not what the page sends.
    for body in
        ["", "[]", "{}", r#"{"case":1}"#, &body.replace("approve", "burn"), &body.replace('}', ",\"path\":\"/\"}")]
    {
        assert!((400..500).contains(&review.post("/decide", &token, body).0), "{body}");
    }
    let long = json!({ "case": "x", "decision": "approve", "reason": "x".repeat(100_000) }).to_string();
    assert_eq!(review.post("/decide", &token, &long).0, 413);
    assert_eq!(reasons(&goldens), [pair("plane", "first")]);
    assert_eq!(review.finish().0, 3, "one golden is still missing");
}

#[cfg(unix)]
#[test]
fn it_listens_on_this_machine_alone_and_ends_by_a_signal() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = store(dir.path(), "plane");
    let mut review = Review::begin(&goldens, &[]);
    // Where the system tells: the address is the second word of a line.
    if let Ok(listening) = std::fs::read_to_string("/proc/net/tcp") {
        let port = format!(":{:04X}", review.port);
        let own = listening.lines().filter_map(|l| l.split_whitespace().nth(1)).filter(|a| a.ends_with(&port));
        let own: Vec<&str> = own.collect();
        assert!(!own.is_empty() && own.iter().all(|a| a.starts_with("0100007F")), "{own:?}");
    }
    let killed = Command::new("kill").args(["-INT", &review.child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(review.child.wait().unwrap().code(), Some(3));
}

#[test]
fn where_all_hold_there_is_nothing_to_review() {
    let dir = tempfile::tempdir().unwrap();
    let goldens = store(dir.path(), "");
    let out = aogauge(RECORDS.path(), &["golden", "review", "1", "--goldens", goldens.to_str().unwrap()]);
    assert_eq!(out.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&out.stderr).contains("nothing to review"));
    let out = aogauge(RECORDS.path(), &["golden", "review", "1", "--goldens", "g", "--only", "nothing-like-it"]);
    assert_eq!(out.status.code(), Some(4));
}
