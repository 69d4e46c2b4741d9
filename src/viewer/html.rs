//! The page's file: markup, style, script and data in one.

use super::{Page, Plane, Planes};
use crate::picture::scale::{LEAST_P, Scale};
use base64::{Engine, engine::general_purpose::STANDARD};
use minijinja::{Environment, Value};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::fmt::Write;

const MARKUP: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");

/// In the order that they stand in the page.
const SCRIPTS: [&str; 9] = [
    include_str!("page/dom.js"),
    include_str!("page/planes.js"),
    include_str!("page/scales.js"),
    include_str!("page/pane.js"),
    include_str!("page/charts.js"),
    include_str!("page/stage.js"),
    include_str!("page/list.js"),
    include_str!("page/review.js"),
    include_str!("page/main.js"),
];

/// The level of tests that the p-value map marks.
const LEVEL: f64 = 0.01;

/// Colours of a scale, and what it says of them.
#[derive(Serialize)]
struct Colors {
    /// 256 colours from its left to its right end, six hexadecimal digits each.
    colors: String,
    label: String,
}

impl Colors {
    fn new(scale: &Scale) -> Self {
        let mut colors = String::with_capacity(256 * 6);
        for i in 0..256 {
            let [r, g, b] = scale.color_at(f64::from(i) / 255.0);
            let _ = write!(colors, "{r:02x}{g:02x}{b:02x}");
        }
        Colors { colors, label: scale.label("") }
    }
}

/// What the script reads.
#[derive(Serialize)]
struct Data<'a> {
    #[serde(flatten)]
    page: &'a Page,
    planes: &'a [Plane],
    signed: Option<Colors>,
    flip: Colors,
    p: Option<Colors>,
    least_p: f64,
}

pub(super) fn page(page: &Page, planes: &Planes) -> Result<String, minijinja::Error> {
    let data = Data {
        page,
        planes: planes.all(),
        signed: Scale::signed(1.0).ok().map(|s| Colors::new(&s)),
        flip: Colors::new(&Scale::flip()),
        p: Scale::p_value(LEVEL).ok().map(|s| Colors::new(&s)),
        least_p: LEAST_P,
    };
    let script = script();
    let policy = format!(
        "default-src 'none'; img-src data: blob:; style-src '{}'; script-src '{}'; connect-src 'self'; base-uri 'none'; \
         form-action 'none'",
        hash(STYLE),
        hash(&script)
    );
    // Data of our own types has no reason not to become JSON.
    let json = inert(&serde_json::to_string(&data).unwrap_or_default());
    let mut texts = String::new();
    for (i, plane) in planes.all().iter().enumerate() {
        let _ = writeln!(texts, "<script type=\"text/plain\" id=\"plane-{i}\">{}</script>", plane.text);
    }
    let ready = Value::from_safe_string;
    let mut environment = Environment::new();
    // By its name everything but what is ready is escaped.
    environment.add_template("page.html", MARKUP)?;
    environment.get_template("page.html")?.render(minijinja::context! {
        title => page.title.as_str(),
        policy => ready(policy),
        style => ready(STYLE.to_owned()),
        script => ready(script),
        data => ready(json),
        planes => ready(texts),
    })
}

/// All scripts as one function, so that nothing of it is seen from outside.
fn script() -> String {
    format!("(() => {{\n\"use strict\";\n{}\n}})();\n", SCRIPTS.join("\n"))
}

/// As a content security policy names a text that may run.
fn hash(text: &str) -> String {
    format!("sha256-{}", STANDARD.encode(Sha256::digest(text.as_bytes())))
}

/// JSON that no markup can begin in.
fn inert(json: &str) -> String {
    json.replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029")
}
