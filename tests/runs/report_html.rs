//! The HTML report, as whoever opens the file finds it. What a browser does with it is
//! tried in `.ci/browser.mjs`.

use aogauge::layers::Layers;
use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::read::ZlibDecoder;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::LazyLock,
};

/// Names that would break a page which took them for markup.
const HOSTILE: &str = r#"</script><img src=x onerror=alert(1)> | `x` {{ 7*7 }} ]]> <!-- & \u2028"#;

static RUN: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let tiny = Path::new(env!("CARGO_MANIFEST_DIR")).join(".ci/tiny.toml");
    let suite = fs::read_to_string(tiny).unwrap();
    let gate = format!("\n[[gate]]\nname = '''{HOSTILE}'''\nmetric = \"openness\"\nregion = \"all\"\nmin = 0.99\n");
    fs::write(dir.path().join("tiny.toml"), suite.replace("\"Tiny\"", &format!("'''{HOSTILE}'''")) + &gate).unwrap();
    let out = aogauge(dir.path(), &["run", "tiny.toml", "--renderer", "cpu", "--no-cache", "--out", "record"]);
    assert_eq!(out.status.code(), Some(1), "{}", String::from_utf8_lossy(&out.stderr));
    dir
});

fn aogauge(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(folder).args(args).output().unwrap()
}

fn report() -> (PathBuf, String) {
    static HTML: LazyLock<String> = LazyLock::new(|| {
        let out = aogauge(RUN.path(), &["report", "record", "--format", "html"]);
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        fs::read_to_string(RUN.path().join("record/report.html")).unwrap()
    });
    (RUN.path().join("record"), HTML.clone())
}

/// What stands between the first `from` and the next `to`.
fn between<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let start = text.find(from).unwrap_or_else(|| panic!("no '{from}'")) + from.len();
    &text[start..start + text[start..].find(to).unwrap()]
}

fn data(html: &str) -> Value {
    serde_json::from_str(between(html, "id=\"data\">", "</script>")).unwrap()
}

fn plane(html: &str, id: &Value) -> Vec<f32> {
    let text = between(html, &format!("id=\"plane-{id}\">"), "</script>");
    let mut bytes = Vec::new();
    ZlibDecoder::new(STANDARD.decode(text).unwrap().as_slice()).read_to_end(&mut bytes).unwrap();
    let n = bytes.len() / 4;
    (0..n).map(|i| f32::from_le_bytes([0, 1, 2, 3].map(|b| bytes[b * n + i]))).collect()
}

#[test]
fn its_images_are_those_of_the_record_to_the_last_bit() {
    let (record, html) = report();
    let data = data(&html);
    let json: Value = serde_json::from_str(&fs::read_to_string(record.join("record.json")).unwrap()).unwrap();
    let mut seen = 0;
    for case in json["cases"].as_array().unwrap() {
        let own = &case["case"];
        let alike = |i: &&Value| ["scene", "estimator", "renderer", "rays"].iter().all(|k| i[k] == own[k]);
        let item = data["items"].as_array().unwrap().iter().find(alike).unwrap();
        let image = Layers::read(&record.join(case["image"].as_str().unwrap())).unwrap();
        let bits = |v: &[f32]| v.iter().map(|v| if v.is_nan() { 0 } else { v.to_bits() }).collect::<Vec<_>>();
        assert_eq!(bits(&plane(&html, &item["pairs"][0]["test"]["plane"])), bits(image.get("mean").unwrap()));
        seen += 1;
    }
    assert_eq!(seen, 2);
}

#[test]
fn it_is_one_file_that_asks_for_nothing() {
    let (_, html) = report();
    for asked in ["http://", "https://", "src=\"/", "href=\"/", "@import", "url("] {
        // The name space of SVG is a name, no address.
        assert_eq!(html.replace("http://www.w3.org/2000/svg", "").matches(asked).count(), 0, "{asked}");
    }
    let policy = between(&html, "Content-Security-Policy\" content=\"", "\"");
    assert!(policy.starts_with("default-src 'none'"), "{policy}");
    let script = &html[html.rfind("<script>").unwrap() + 8..html.rfind("</script>").unwrap()];
    for text in [between(&html, "<style>", "</style>"), script] {
        assert!(policy.contains(&format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text)))));
    }
}

#[test]
fn names_from_anybody_are_text() {
    let (_, html) = report();
    assert!(!html.contains("<img src=x"));
    // The data, the images and the script end where they should.
    let scripts = html.matches("<script").count();
    assert_eq!(
        (scripts, html.matches("</script>").count()),
        (2 + data(&html)["planes"].as_array().unwrap().len(), scripts)
    );
    let data = data(&html);
    let gate = data["gates"].as_array().unwrap().iter().find(|g| g["gate"].as_str().unwrap() == HOSTILE);
    assert!(gate.is_some_and(|g| g["outcome"] == "fail"));
    assert!(data["summary"].as_str().unwrap().contains(HOSTILE));
}

#[test]
fn the_worst_comes_first() {
    let (_, html) = report();
    let data = data(&html);
    let outcomes: Vec<&str> =
        data["items"].as_array().unwrap().iter().map(|i| i["outcome"].as_str().unwrap()).collect();
    assert_eq!(data["outcome"], "fail");
    assert_eq!(outcomes.first(), Some(&"fail"));
    assert!(outcomes.iter().skip_while(|o| **o == "fail").all(|o| *o != "fail"), "{outcomes:?}");
}

#[test]
fn a_record_without_its_images_is_an_error() {
    report();
    let dir = tempfile::tempdir().unwrap();
    fs::copy(RUN.path().join("record/record.json"), dir.path().join("record.json")).unwrap();
    let out = aogauge(dir.path(), &["report", ".", "--format", "html", "--out", "made"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains(".exr"), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(!dir.path().join("made/report.html").exists());
}
