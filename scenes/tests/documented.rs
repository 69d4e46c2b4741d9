//! `docs/shapes.md` lists every shape with its parameters as the JSON Schema has
//! them. After a change: `UPDATE_DOCS=1 cargo test -p aogauge-scenes --test documented`.

#![allow(missing_docs, clippy::unwrap_used)]

use serde_json::Value;
use std::{fmt::Write, fs, path::Path};

fn main_text(schema: &Value) -> String {
    let mut text = "# Shapes\n\n\
        Parameters of `shape = { NAME = { ... } }` in an `[[object]]` of a scene file. Lengths are in metres, y is up. What has a\n\
        default may be left out. This page is made from the JSON Schema (`aogauge schema scene`).\n"
        .to_owned();
    for family in schema["$defs"]["Shape"]["oneOf"].as_array().unwrap() {
        let (name, spec) = family["properties"].as_object().unwrap().iter().next().unwrap();
        let spec = resolved(schema, spec);
        let about = [family, &spec].into_iter().find_map(|v| v["description"].as_str()).unwrap_or_default();
        let about = [about.to_owned(), spec["description"].as_str().unwrap_or_default().to_owned()];
        writeln!(
            text,
            "\n## {name}\n\n{}\n\n| parameter | default | range | |\n|---|--:|---|---|",
            one_line(&longer(about))
        )
        .unwrap();
        for (parameter, value) in spec["properties"].as_object().unwrap() {
            let value = resolved(schema, value);
            let what = one_line(value["description"].as_str().unwrap_or_default());
            writeln!(text, "| `{parameter}` | {} | {} | {what} |", default(&value), range(schema, &value)).unwrap();
        }
    }
    text
}

fn longer([a, b]: [String; 2]) -> String {
    if b.len() > a.len() { b } else { a }
}

fn one_line(text: &str) -> String {
    text.replace("\n\n", " ").replace('\n', " ").replace('|', "\\|")
}

/// A schema with its reference looked up; what stands beside the reference wins.
fn resolved(schema: &Value, value: &Value) -> Value {
    let Some(name) = value["$ref"].as_str() else {
        return value.clone();
    };
    let mut found = schema.pointer(name.strip_prefix('#').unwrap()).unwrap().clone();
    for (key, own) in value.as_object().unwrap().iter().filter(|(k, _)| *k != "$ref") {
        found[key] = own.clone();
    }
    found
}

fn default(value: &Value) -> String {
    match &value["default"] {
        Value::Null => String::new(),
        Value::Object(parts) => parts.iter().map(|(k, v)| format!("{k} {v}")).collect::<Vec<_>>().join(", "),
        Value::String(s) => s.clone(),
        other => other.to_string(),
    }
}

fn range(schema: &Value, value: &Value) -> String {
    if let (Some(low), Some(high)) = (value["minimum"].as_f64(), value["maximum"].as_f64()) {
        return format!("{low} to {high}");
    }
    let choices = |list: &Value| -> Vec<String> {
        let all = list.as_array().into_iter().flatten();
        all.map(|c| resolved(schema, c))
            .filter_map(|c| match (&c["const"], &c["enum"], &c["minimum"], &c["maximum"]) {
                (Value::Null, Value::Array(names), ..) => {
                    Some(names.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(", "))
                }
                (Value::Null, _, Value::Number(low), Value::Number(high)) => Some(format!("{low} to {high}")),
                (Value::Null, ..) => None,
                (Value::String(s), ..) => Some(s.clone()),
                (c, ..) => Some(c.to_string()),
            })
            .collect()
    };
    let found = [choices(&value["oneOf"]), choices(&value["anyOf"]), choices(&Value::Array(vec![value.clone()]))];
    found.into_iter().find(|l| !l.is_empty()).unwrap_or_default().join(", ")
}

#[test]
fn every_parameter_is_documented() {
    let schema = serde_json::to_value(aogauge_scenes::Scene::file_schema()).unwrap();
    let text = main_text(&schema);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/shapes.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        fs::write(&path, &text).unwrap();
    }
    let written = fs::read_to_string(&path).unwrap_or_default();
    assert!(written == text, "docs/shapes.md is not what the schema says; run this test with UPDATE_DOCS=1");
}

/// The scene that `docs/scenes.md` shows is one.
#[test]
fn the_example_is_a_scene() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/scenes.md")).unwrap();
    let examples: Vec<&str> = page.split("```toml\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    let example = examples.iter().find(|e| e.contains("[[object]]")).unwrap();
    let scene = aogauge_scenes::Scene::from_toml("example", "docs/scenes.md", example, None).unwrap();
    assert_eq!(scene.objects.len(), 3);
    assert!(scene.has_occluder() && scene.measure.resolution == [208, 32]);
}
