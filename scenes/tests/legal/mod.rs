//! Parameter sets of the families, read from the published schema: shared by the
//! tests of the meshes and of rendering them.

#![allow(dead_code, clippy::unwrap_used, clippy::panic)]

use aogauge_scenes::{Object, Scene};
use proptest::prelude::*;
use serde_json::Value;

/// The families but `polygons`, which has no ranges to draw from, with the type that declares their parameters.
pub const FAMILIES: [(&str, &str); 17] = [
    ("plane", "Plane"),
    ("block", "Block"),
    ("arcade", "Arcade"),
    ("room", "Room"),
    ("curtain", "Curtain"),
    ("banner", "Banner"),
    ("slatted-fence", "SlattedFence"),
    ("blinds", "Blinds"),
    ("shelf", "Shelf"),
    ("table", "Table"),
    ("leaves", "Leaves"),
    ("cables", "Cables"),
    ("pillar", "Pillar"),
    ("crevice", "Crevice"),
    ("sphere", "Sphere"),
    ("ridge", "Ridge"),
    ("atrium", "Atrium"),
];

/// A scene of a floor and a shape with these parameters.
pub fn scene(family: &str, parameters: &str) -> Result<Scene, String> {
    let text = format!(
        r#"
description = "test"
ao = {{ radius = 0.25 }}
environment = {{ radiance = 1.0 }}
measure = {{ center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.1, resolution = [16, 16] }}
look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}
[[object]]
name = "floor"
shape = {{ plane = {{ center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] }} }}
[[object]]
name = "it"
[object.shape.{family}]
{parameters}"#
    );
    Scene::from_toml("test", "test.toml", &text, None).map_err(|e| e.to_string())
}

/// The shape's own objects.
pub fn shape(family: &str, parameters: &str) -> Result<Vec<Object>, String> {
    Ok(scene(family, parameters)?.objects.into_iter().skip(1).collect())
}

/// A parameter and what it may be.
#[derive(Clone, Debug)]
pub struct Parameter {
    pub name: String,
    pub kind: Kind,
    /// Whether it has no default.
    pub required: bool,
}

impl Parameter {
    /// A line that gives it a legal value, where it must be given.
    pub fn line(&self) -> String {
        match &self.kind {
            _ if !self.required => String::new(),
            Kind::Vector { .. } => format!("{} = [1, 2, 3]\n", self.name),
            _ => format!("{} = 1\n", self.name),
        }
    }
}

#[derive(Clone, Debug)]
pub enum Kind {
    Number {
        zero: bool,
        min: f64,
        max: f64,
    },
    Count {
        min: u64,
        max: u64,
    },
    /// Three numbers.
    Vector {
        min: f64,
        max: f64,
    },
    Choice(Vec<String>),
}

pub fn parameters(family: &str) -> Vec<Parameter> {
    let schema = serde_json::to_value(Scene::file_schema()).unwrap();
    let mut found = Vec::new();
    collect(&schema, &schema["$defs"][family], "", &mut found);
    assert!(!found.is_empty(), "{family} is not in the schema");
    found
}

fn collect(schema: &Value, of: &Value, prefix: &str, found: &mut Vec<Parameter>) {
    for (key, declared) in of["properties"].as_object().unwrap() {
        let required = of["required"].as_array().is_some_and(|r| r.iter().any(|n| n == key));
        let name = format!("{prefix}{key}");
        let target = |v: &Value| v["$ref"].as_str().map(|r| schema.pointer(r.trim_start_matches('#')).unwrap().clone());
        let optional = declared["anyOf"].get(0).and_then(target);
        let declared = target(declared).or(optional).unwrap_or_else(|| declared.clone());
        let vector = declared["type"] == "array";
        let number = if vector { &declared["items"] } else { &declared };
        let bound = |key: &str| number[key].as_f64().or(number["anyOf"][1][key].as_f64());
        let kind = if declared["properties"].is_object() {
            collect(schema, &declared, &format!("{name}."), found);
            continue;
        } else if let Some(choices) = declared["oneOf"].as_array() {
            Kind::Choice(choices.iter().map(|c| c["const"].to_string()).collect())
        } else if let Some(choices) = declared["enum"].as_array() {
            Kind::Choice(choices.iter().map(Value::to_string).collect())
        } else if declared["type"] == "boolean" {
            Kind::Choice(vec!["true".into(), "false".into()])
        } else {
            let (Some(min), Some(max)) = (bound("minimum"), bound("maximum")) else {
                panic!("{name} has no bounds: {declared}");
            };
            match declared["type"].as_str() {
                Some("array") => Kind::Vector { min, max },
                Some("integer") => Kind::Count { min: min as u64, max: max as u64 },
                _ => Kind::Number { zero: declared["anyOf"].is_array(), min, max },
            }
        };
        found.push(Parameter { name, kind, required });
    }
}

/// A number between bounds: their ends, and all between, small ones as often as
/// large ones.
fn number(low: f64, min: f64, max: f64) -> BoxedStrategy<String> {
    let scaled = (0.0..1.0f64).prop_map(move |u| min + (max - min) * u.powi(6));
    let signed = (-1.0..1.0f64).prop_map(move |u| (max.max(-min) * u.powi(7)).clamp(min, max));
    let scaled = if min < 0.0 { signed.boxed() } else { scaled.boxed() };
    prop_oneof![10 => scaled, 2 => min..=max, 1 => Just(low), 1 => Just(min), 1 => Just(max)]
        .prop_map(|v| format!("{v:.6}"))
        .boxed()
}

/// Values of a parameter, and its default (none) where it has one.
fn values(kind: &Kind, required: bool) -> BoxedStrategy<Option<String>> {
    let any = match kind.clone() {
        Kind::Choice(choices) => prop::sample::select(choices).boxed(),
        // What is capped high is drawn low most of the time, to keep the test quick.
        Kind::Count { min, max } => {
            let high = max.min(2000.max(6 * min));
            prop_oneof![8 => min..=max.min(min + 40), 1 => min..=high].prop_map(|n| n.to_string()).boxed()
        }
        Kind::Number { zero, min, max } => number(if zero { 0.0 } else { min }, min, max),
        Kind::Vector { min, max } => {
            [(); 3].map(|()| number(min, min, max)).prop_map(|[x, y, z]| format!("[{x}, {y}, {z}]")).boxed()
        }
    };
    // For the same reason an atrium's count of triangles is not left to its default.
    let many = matches!(kind, Kind::Count { min, .. } if *min > 2000);
    if required || many {
        return any.prop_map(Some).boxed();
    }
    prop_oneof![any.prop_map(Some), Just(None)].boxed()
}

pub fn legal(parameters: &[Parameter]) -> impl Strategy<Value = String> + use<> {
    let all: Vec<_> = parameters
        .iter()
        .map(|p| {
            let name = p.name.clone();
            values(&p.kind, p.required).prop_map(move |v| v.map(|v| format!("{name} = {v}\n")).unwrap_or_default())
        })
        .collect();
    all.prop_map(|lines| lines.concat())
}
