//! The report of a record: what needs a look comes first, every picture is there, and no
//! name can break it.

use aogauge::{
    metrics::Metric,
    record::{IdleGate, Machine, Record, RecordFolder},
    render::cpu::Cpu,
    report::{self, plots},
    run::{Means, Observer, Prepared},
    suite::{Plan, Platform, Suite},
};
use pulldown_cmark::{Event, Options as Extensions, Parser, Tag, TagEnd};
use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    sync::LazyLock,
};

const SUITE: &str = r#"
description = "A suite with one gate that fails, one that passes, one that holds nothing."
scenes = ["curtain-arcade", "plane"]
rays = [2, 8]
replicates = 8
converged_rays = 32
look_rays = 1
judge = { precision = 0.2, paths = 2, replicates = 4 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "clipped"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "No bias under the occluder"
metric = "bias"
region = "footprint"
scenes = ["curtain-arcade"]
equals = 0.0
within = 0.5
[[gate]]
name = "No false highlight"
metric = "contrast-error"
estimators = ["classic"]
max = 0.05
[[gate]]
name = "The GPU agrees"
metric = "renderer-difference"
renderers = ["gpu"]
equals = 0.0
within = 0.5
"#;

struct Silent;

impl Observer for Silent {
    fn step(&self, _done: u64, _total: u64, _what: &str) {}
}

/// A record with its images, made once.
static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let suite = Suite::from_toml("x", "x.toml", SUITE, Path::new(".")).unwrap();
    let plan = Plan::new(&suite, Platform::Cpu, None);
    let folder = RecordFolder::create(&dir.path().join("record")).unwrap();
    let machine = Machine::here("a test".into(), None);
    let record = Prepared::new(&plan).unwrap().run(&Means::new(&Cpu, machine), &folder, &Silent).unwrap();
    assert_eq!(record.summary.failed_cases, 0);
    dir
});

fn record() -> Record {
    Record::read(&FOLDER.path().join("record")).unwrap()
}

/// The record with changes, beside the images of the first.
fn changed(dir: &Path, change: impl FnOnce(&mut Record)) -> PathBuf {
    let (from, to) = (FOLDER.path().join("record"), dir.join("record"));
    for image in walk(&from.join("images")) {
        let place = to.join(image.strip_prefix(&from).unwrap());
        fs::create_dir_all(place.parent().unwrap()).unwrap();
        fs::copy(image, place).unwrap();
    }
    let mut record = record();
    change(&mut record);
    fs::write(to.join("record.json"), serde_json::to_string(&record).unwrap()).unwrap();
    to
}

fn walk(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() { files.extend(walk(&path)) } else { files.push(path) }
    }
    files.sort();
    files
}

fn page(record: &Path, out: &Path) -> String {
    report::write(record, out).unwrap();
    fs::read_to_string(out.join("report.md")).unwrap()
}

fn parse(text: &str) -> Parser<'_> {
    Parser::new_ext(text, Extensions::ENABLE_TABLES | Extensions::ENABLE_STRIKETHROUGH | Extensions::ENABLE_GFM)
}

/// All of a page but its words: blocks, cells, emphasis, HTML, and where links lead.
fn skeleton(text: &str) -> Vec<String> {
    let of = |event: Event<'_>| match event {
        Event::Text(_) | Event::SoftBreak => None,
        Event::Html(html) | Event::InlineHtml(html) => Some(markup(&html)),
        Event::Start(tag @ (Tag::Link { .. } | Tag::Image { .. })) => Some(target(&tag)),
        other => Some(format!("{other:?}")),
    };
    parse(text).filter_map(of).collect()
}

/// The tags of a piece of HTML, without the words of a summary.
fn markup(html: &str) -> String {
    html.split('<').skip(1).map(|t| format!("<{}>", t.split('>').next().unwrap())).collect()
}

fn target(tag: &Tag<'_>) -> String {
    match tag {
        Tag::Link { dest_url, title, .. } => format!("link {dest_url} {title}"),
        Tag::Image { dest_url, title, .. } => format!("image {dest_url} {title}"),
        other => format!("{other:?}"),
    }
}

/// Puts a text wherever a record holds one that is free; names of scenes, estimators and
/// renderers are not.
fn rename(record: &mut Record, text: &str) {
    let some = || Some(text.to_owned());
    record.tool = text.into();
    record.filter = some();
    record.incomplete = some();
    record.suite.name = text.into();
    record.suite.description = text.into();
    record.machine =
        Machine { os: text.into(), arch: text.into(), cpu: text.into(), gpu: text.into(), gpu_is_software: Some(true) };
    record.timing.began = text.into();
    record.idle_gates = vec![
        IdleGate { gate: text.into(), reason: text.into(), excused: false },
        IdleGate { gate: text.into(), reason: text.into(), excused: true },
    ];
    for v in &mut record.verdicts {
        v.gate = format!("{} {text}", if v.gate.starts_with("No bias") { "a" } else { "b" });
        (v.reason, v.place) = (text.into(), some());
        v.picture = v.picture.as_ref().map(|p| if p.ends_with(".png") { p.clone() } else { "x.exr".into() });
    }
    for p in &mut record.pooled {
        p.contrast.left_out = vec![aogauge::pooled::LeftOut { scene: text.into(), why: text.into() }];
    }
    for s in &mut record.scenes {
        (s.description, s.hash, s.no_judge) = (text.into(), text.into(), some());
        for c in &mut s.convergence {
            (c.estimator, c.renderer, c.slope.note) = (text.into(), text.into(), some());
        }
        for (i, p) in s.profiles.iter_mut().enumerate() {
            p.label = format!("{i} {text}");
        }
        let contrast = Metric::clone(&record.cases[0].metrics[0]);
        s.occluders = vec![aogauge::record::OccluderRecord {
            name: text.into(),
            regions: s.regions.clone(),
            shown: None,
            contrast,
            q: s.judge.as_ref().map(|j| j.q.clone()).unwrap_or_default(),
        }];
        for q in s.occluders[0].q.values_mut() {
            q.note = some();
        }
    }
    for c in &mut record.cases {
        c.occluders = vec![aogauge::record::OccluderMetrics { name: text.into(), metrics: c.metrics.clone() }];
        for m in &mut c.metrics {
            m.note = some();
        }
    }
    let last = record.cases.last_mut().unwrap();
    (last.error, last.image) = (some(), None);
}

const HOSTILE: [&str; 9] = [
    "</details></code>\n\n# x\n\n| a | b |\n|---|---|\n| `c` <script>alert(1)</script> <img src=x onerror=alert(1)>",
    "](javascript:alert(1)) ![x](http://evil/y.png) [y]: http://evil **b** _i_ ~~s~~ $m$ @me #1 www.evil.com\\",
    "```\nfence\n```",
    "- item\n- item",
    "1. item",
    "---",
    "    code",
    "\u{0}\u{7}\u{202e}\u{fffe} \" ' & --> ]]> %s {{ record }} {% raw %}",
    "<!-- comment",
];

/// The page has the same blocks, cells and links whatever the names are; only words
/// differ.
#[test]
fn no_name_changes_the_page_but_its_words() {
    let dir = tempfile::tempdir().unwrap();
    let plain = changed(&dir.path().join("plain"), |r| rename(r, "a name"));
    let expected = skeleton(&page(&plain, &dir.path().join("plain-out")));
    assert!(expected.len() > 500 && expected.iter().any(|e| e.starts_with("image pictures/")));
    for (i, text) in HOSTILE.iter().enumerate() {
        let record = changed(&dir.path().join(i.to_string()), |r| rename(r, text));
        let out = dir.path().join(format!("{i}-out"));
        let found = skeleton(&page(&record, &out));
        for (n, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert_eq!(found, expected, "{text}: event {n}");
        }
        assert_eq!(found.len(), expected.len(), "{text}");
        check_plots(&out, text);
    }
}

/// Plots are well-formed, hold nothing that runs, and say names as they are.
fn check_plots(out: &Path, text: &str) {
    let mut words = String::new();
    let plots: Vec<PathBuf> = walk(out).into_iter().filter(|p| p.extension().is_some_and(|e| e == "svg")).collect();
    // Of two scenes profile and convergence, and cost and p-values.
    assert!(plots.len() >= 5, "{plots:?}");
    let legal = ["svg", "title", "rect", "line", "polyline", "polygon", "circle", "text"];
    for plot in plots {
        let svg = fs::read_to_string(&plot).unwrap();
        let tree = roxmltree::Document::parse(&svg).unwrap_or_else(|e| panic!("{}: {e}", plot.display()));
        for node in tree.descendants().filter(roxmltree::Node::is_element) {
            assert!(legal.contains(&node.tag_name().name()), "{}: {node:?}", plot.display());
            assert!(node.attributes().all(|a| !a.name().starts_with("on") && !a.name().contains("href")));
            words += node.text().unwrap_or_default();
        }
        assert_eq!(tree.root_element().attribute("width"), Some("832"));
    }
    let seen = text.chars().map(|c| if c.is_control() { ' ' } else { c });
    let seen: String = seen.filter(|c| !"\u{202e}\u{200e}\u{2066}\u{fffe}\u{ffff}".contains(*c)).collect();
    let start: String = seen.trim().chars().take(8).collect();
    assert!(words.contains(&start), "{start:?} is in no plot");
}

/// What a verdict's picture may be in a hostile record: any path within it. It is shown
/// only where the report drew it.
#[test]
fn pictures_that_were_not_drawn_are_not_shown() {
    let dir = tempfile::tempdir().unwrap();
    let record = changed(dir.path(), |r| {
        for v in &mut r.verdicts {
            v.picture = Some("pictures/evil/none.png".into());
        }
    });
    let text = page(&record, &dir.path().join("out"));
    assert!(!text.contains("evil"), "{text}");
}

#[test]
fn what_failed_comes_first_with_its_numbers_and_its_picture() {
    let dir = tempfile::tempdir().unwrap();
    let text = page(&FOLDER.path().join("record"), dir.path());
    let record = record();
    assert!(text.starts_with("# x: FAIL ❌"), "{text}");
    let at = |part: &str| text.find(part).unwrap_or_else(|| panic!("{part}: {text}"));
    let section = &text[at("## What needs a look")..at("## Verdicts")];
    let failed: Vec<_> = record.verdicts.iter().filter(|v| v.gate == "No false highlight").collect();
    assert!(!failed.is_empty());
    assert!(section.contains("### ❌ FAIL: No false highlight"), "{section}");
    for v in failed {
        let row = section.lines().find(|l| l.contains(&v.subject())).unwrap();
        let value = report::table::value_text(v.value(), v.interval);
        let value = value.split(' ').next().unwrap();
        assert!(row.contains(value) && row.contains("at most 0.05"), "{row}");
        assert!(row.contains("| -0.") && row.contains("the limit is broken"), "{row}");
    }
    assert!(section.contains("](pictures/curtain-arcade/minus-q/classic.png)"), "{section}");
    assert!(
        section.contains("](pictures/curtain-arcade/profile.svg)") && section.contains("If the change is not meant")
    );
    assert!(section.contains("Measured over footprint ("), "{section}");
    assert!(!section.contains("No bias") && text.contains("this run used no GPU"));
    assert!(text.contains("over 8 replicates with seeds of their own"), "{text}");
}

/// Nothing is promised that is not there, and nothing drawn that is not shown.
#[test]
fn every_picture_is_there_and_shown() {
    let dir = tempfile::tempdir().unwrap();
    let text = page(&FOLDER.path().join("record"), dir.path());
    let mut shown = BTreeSet::new();
    let (mut row, mut widest) = (0, 0);
    for event in parse(&text) {
        match event {
            Event::Start(Tag::Image { dest_url, .. }) => {
                row += 1;
                shown.insert(dir.path().join(dest_url.as_ref()));
            }
            Event::Start(Tag::TableRow) => row = 0,
            Event::End(TagEnd::TableRow) => widest = widest.max(row),
            _ => {}
        }
    }
    let drawn: BTreeSet<PathBuf> = walk(&dir.path().join("pictures")).into_iter().collect();
    assert_eq!(shown, drawn);
    assert!((3..=4).contains(&widest), "{widest}");
    assert_eq!(text.matches("<details>").count(), text.matches("</details>").count());
    // Each scene is named once as a place, and led to.
    for anchor in ["scene-1", "scene-2"] {
        assert_eq!(text.matches(&format!("<a id=\"{anchor}\"></a>")).count(), 1);
        assert!(text.contains(&format!("](#{anchor})")));
    }
}

#[test]
fn a_page_can_hold_its_pictures() {
    let dir = tempfile::tempdir().unwrap();
    let command = std::process::Command::new(env!("CARGO_BIN_EXE_aogauge"))
        .args(["report", "--embed-images", "--out"])
        .arg(dir.path())
        .arg(FOLDER.path().join("record"))
        .output()
        .unwrap();
    assert!(command.status.success(), "{}", String::from_utf8_lossy(&command.stderr));
    assert_eq!(walk(dir.path()), [dir.path().join("report.md")]);
    let text = fs::read_to_string(dir.path().join("report.md")).unwrap();
    let (mut png, mut svg) = (0, 0);
    for event in parse(&text) {
        if let Event::Start(Tag::Image { dest_url, .. }) = event {
            png += usize::from(dest_url.starts_with("data:image/png;base64,iVBORw0KGgo"));
            svg += usize::from(dest_url.starts_with("data:image/svg+xml;base64,PHN2Zy"));
            assert!(dest_url.starts_with("data:"), "{dest_url}");
        }
    }
    assert!(png > 10 && svg > 4, "{png} {svg}");
}

#[test]
fn plots_depend_on_the_record_alone_or_say_why_there_is_none() {
    let mut record = record();
    let all = |r: &Record| [plots::contrast_error(r), plots::cost(r), plots::p_values(r)];
    assert_eq!(all(&record), all(&record.clone()));
    for svg in all(&record) {
        assert!(svg.unwrap().contains("<title>"));
    }
    let estimators = record.suite.estimators.clone();
    let ranges = plots::Ranges::default();
    let svg = plots::profile(&estimators, &record.scenes[0], &ranges).unwrap();
    assert!(svg.contains("Q, what it does to the light") && svg.contains("clipped"));
    // Numbers that no axis holds.
    for c in &mut record.cases {
        for m in &mut c.metrics {
            (m.value, m.se) = (Some(1e300), Some(1e300));
        }
    }
    for s in &mut record.scenes {
        for p in s.convergence.iter_mut().flat_map(|c| &mut c.points) {
            (p.rmse.value, p.rmse.se) = (Some(-1.0), Some(1e308));
        }
        s.profiles.iter_mut().for_each(|p| p.value.iter_mut().for_each(|v| *v = Some(1e300)));
    }
    record.pooled.clear();
    record.verdicts.clear();
    let [contrast_error, cost, p_values] = all(&record);
    assert!(contrast_error.unwrap_err().contains("no case has a contrast error"));
    assert!(cost.unwrap_err().contains("both an error and a time"));
    assert!(p_values.unwrap_err().contains("no verdict"));
    assert!(plots::profile(&estimators, &record.scenes[0], &ranges).unwrap_err().contains("no profile"));
    assert!(plots::convergence(&estimators, &record.scenes[0]).unwrap_err().contains("three replicates"));
}
