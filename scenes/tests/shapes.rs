//! Every legal parameter set gives a sound mesh; every illegal one is refused by
//! name and range. What is legal is read from the published schema, so a new
//! parameter is tested as soon as it is declared.

#![allow(clippy::unwrap_used, clippy::panic)]

use aogauge_scenes::{Mesh, Object, Scene};
use glam::Vec3;
use proptest::{prelude::*, test_runner::TestRunner};
use serde_json::Value;
use std::{cell::Cell, collections::HashMap};

/// The families, with the type that declares their parameters.
const FAMILIES: [(&str, &str); 12] = [
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
];

/// A shape with these parameters, as a scene reads it.
fn shape(family: &str, parameters: &str) -> Result<Vec<Object>, String> {
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
    let scene = Scene::from_toml("test", "test.toml", &text, None).map_err(|e| e.to_string())?;
    Ok(scene.objects.into_iter().skip(1).collect())
}

/// A parameter and what it may be.
#[derive(Clone, Debug)]
struct Parameter {
    name: String,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    Number { zero: bool, min: f64, max: f64 },
    Count { min: u64, max: u64 },
    Choice(Vec<String>),
}

fn parameters(family: &str) -> Vec<Parameter> {
    let schema = serde_json::to_value(Scene::file_schema()).unwrap();
    let mut found = Vec::new();
    collect(&schema, &schema["$defs"][family], "", &mut found);
    assert!(!found.is_empty(), "{family} is not in the schema");
    found
}

fn collect(schema: &Value, of: &Value, prefix: &str, found: &mut Vec<Parameter>) {
    for (name, declared) in of["properties"].as_object().unwrap() {
        let name = format!("{prefix}{name}");
        let target = |v: &Value| v["$ref"].as_str().map(|r| schema.pointer(r.trim_start_matches('#')).unwrap().clone());
        let optional = declared["anyOf"].get(0).and_then(target);
        let declared = target(declared).or(optional).unwrap_or_else(|| declared.clone());
        let bound = |key: &str| declared[key].as_f64().or(declared["anyOf"][1][key].as_f64());
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
                Some("integer") => Kind::Count { min: min as u64, max: max as u64 },
                _ => Kind::Number { zero: declared["anyOf"].is_array(), min, max },
            }
        };
        found.push(Parameter { name, kind });
    }
}

/// Values of a parameter: its ends, its default (none), and all between, small
/// ones as often as large ones.
fn values(kind: &Kind) -> BoxedStrategy<Option<String>> {
    let any = match kind.clone() {
        Kind::Choice(choices) => prop::sample::select(choices).boxed(),
        // What is capped high is drawn low most of the time, to keep the test quick.
        Kind::Count { min, max } => {
            prop_oneof![8 => min..=max.min(min + 40), 1 => min..=max.min(2000)].prop_map(|n| n.to_string()).boxed()
        }
        Kind::Number { zero, min, max } => {
            let scaled = (0.0..1.0f64).prop_map(move |u| min + (max - min) * u.powi(6));
            let low = if zero { 0.0 } else { min };
            prop_oneof![10 => scaled, 2 => min..=max, 1 => Just(low), 1 => Just(min), 1 => Just(max)]
                .prop_map(|v| format!("{v:.6}"))
                .boxed()
        }
    };
    prop_oneof![any.prop_map(Some), Just(None)].boxed()
}

fn legal(parameters: &[Parameter]) -> impl Strategy<Value = String> + use<> {
    let all: Vec<_> = parameters
        .iter()
        .map(|p| {
            let name = p.name.clone();
            values(&p.kind).prop_map(move |v| v.map(|v| format!("{name} = {v}\n")).unwrap_or_default())
        })
        .collect();
    all.prop_map(|lines| lines.concat())
}

/// Panics unless the mesh is sound: valid, without degenerate triangles, and each
/// of its pieces either open or closed with its normals outward.
fn check(mesh: &Mesh, what: &str) {
    mesh.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
    let [lo, hi] = mesh.bounds().unwrap();
    assert!((hi - lo).max_element() > 0.0, "{what}: empty bounds");
    for (i, [a, b, c]) in mesh.corners().enumerate() {
        let area = (b.as_dvec3() - a.as_dvec3()).cross(c.as_dvec3() - a.as_dvec3()).length();
        assert!(area > 0.0, "{what}: triangle {i} is degenerate: {a} {b} {c}");
    }
    for piece in pieces(mesh) {
        let volume: f64 = piece
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| (mesh.positions[i as usize] - lo).as_dvec3());
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        assert!(!is_closed(&piece) || volume > 0.0, "{what}: a piece is inside out: {volume}");
    }
}

/// The triangles by connected piece.
fn pieces(mesh: &Mesh) -> Vec<Vec<[u32; 3]>> {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for &[a, b, c] in &mesh.triangles {
        let a = root(&mut parent, a);
        for other in [b, c] {
            let other = root(&mut parent, other);
            parent[other as usize] = a;
        }
    }
    let mut pieces: HashMap<u32, Vec<[u32; 3]>> = HashMap::new();
    for t in &mesh.triangles {
        pieces.entry(root(&mut parent, t[0])).or_default().push(*t);
    }
    pieces.into_values().collect()
}

/// Whether every edge is walked once each way.
fn is_closed(triangles: &[[u32; 3]]) -> bool {
    let mut edges: HashMap<[u32; 2], [u32; 2]> = HashMap::new();
    for t in triangles {
        for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
            edges.entry([a.min(b), a.max(b)]).or_default()[usize::from(a < b)] += 1;
        }
    }
    edges.values().all(|&walks| walks == [1, 1])
}

#[test]
fn every_legal_parameter_set_gives_a_sound_mesh() {
    for (family, declared) in FAMILIES {
        let parameters = parameters(declared);
        let (made, refused) = (Cell::new(0), Cell::new(0));
        // The same cases every time: a failure here must fail everywhere.
        let mut runner = TestRunner::new_with_rng(
            ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() },
            proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
        );
        let result = runner.run(&legal(&parameters), |text| {
            match shape(family, &text) {
                Ok(objects) => {
                    made.set(made.get() + 1);
                    for o in &objects {
                        check(&o.mesh, &format!("{family}: {}\n{text}", o.name));
                    }
                    prop_assert_eq!(objects, shape(family, &text).unwrap(), "the same every time");
                }
                // Legal values may not go together; then two of them are named.
                Err(message) => {
                    refused.set(refused.get() + 1);
                    let named = parameters.iter().filter(|p| message.contains(p.name.as_str())).count();
                    let prefix = format!("object 'it': {family}: ");
                    prop_assert!(message.contains(&prefix) && named >= 2, "{}\n{}", message, text);
                }
            }
            Ok(())
        });
        assert!(result.is_ok(), "{family}: {}", result.unwrap_err());
        assert!(made.get() >= 40, "{family}: {} made, {} refused", made.get(), refused.get());
    }
}

#[test]
fn every_value_out_of_range_is_refused_by_name_and_range() {
    for (family, declared) in FAMILIES {
        for p in parameters(declared) {
            let (bad, bounds) = match &p.kind {
                Kind::Number { zero, min, max } => {
                    let below = if *zero { -1.0 } else { min - 0.01 };
                    (vec![format!("{below:?}"), format!("{:?}", max + 1.0)], vec![min.to_string(), max.to_string()])
                }
                Kind::Count { min, max } => {
                    (vec![(*min as i64 - 1).to_string(), (max + 1).to_string()], vec![min.to_string(), max.to_string()])
                }
                Kind::Choice(choices) if choices[0] == "true" => continue,
                Kind::Choice(choices) => {
                    (vec!["\"neither\"".into()], choices.iter().map(|c| c.trim_matches('"').to_owned()).collect())
                }
            };
            for value in bad {
                let message = shape(family, &format!("{} = {value}", p.name)).unwrap_err();
                for part in bounds.iter().chain([&p.name]) {
                    assert!(
                        message.contains(part.as_str()),
                        "{family}.{} = {value}: no '{part}' in\n{message}",
                        p.name
                    );
                }
            }
            if let Kind::Number { .. } = p.kind {
                let message = shape(family, &format!("{} = nan", p.name)).unwrap_err();
                assert!(message.contains("finite") && message.contains(&p.name), "{message}");
            }
        }
        assert!(shape(family, "colour = 3").unwrap_err().contains("colour"));
    }
}

#[test]
fn every_family_has_defaults_that_work() {
    for (family, _) in FAMILIES {
        let objects = shape(family, "").unwrap_or_else(|e| panic!("{family}: {e}"));
        for o in &objects {
            check(&o.mesh, family);
        }
    }
}

#[test]
fn what_should_be_closed_is_closed() {
    let solid = [
        ("curtain", ""),
        ("curtain", "folds = \"pleated\""),
        ("curtain", "folds = \"wavy\""),
        ("banner", "thickness = 0.005"),
        ("slatted-fence", ""),
        ("blinds", ""),
        ("shelf", "wall = false"),
        ("table", ""),
        ("leaves", "thickness = 0.001"),
        ("leaves", "thickness = 0.001\noutline = \"card\""),
        ("cables", ""),
        ("pillar", "base = { radius = 0.3, height = 0.2 }\ncapital = { radius = 0.25, height = 0.1 }"),
        ("crevice", ""),
        ("sphere", ""),
        ("ridge", ""),
    ];
    for (family, text) in solid {
        for o in shape(family, text).unwrap() {
            assert!(is_closed(&o.mesh.triangles), "{family} {text}: {}", o.name);
        }
    }
    let open = [("curtain", "folds = \"wavy\"\nthickness = 0"), ("leaves", ""), ("blinds", "thickness = 0")];
    for (family, text) in open {
        let objects = shape(family, text).unwrap();
        assert!(pieces(&objects[0].mesh).iter().all(|p| !is_closed(p)), "{family} {text}");
    }
}

#[test]
fn shapes_of_several_parts_know_their_occluder() {
    for (family, thin, thick) in
        [("banner", "it.cloth", "it.rod"), ("shelf", "it.board", "it.wall"), ("table", "it.legs", "it.top")]
    {
        let objects = shape(family, "").unwrap();
        let occluders: Vec<_> = objects.iter().filter(|o| o.occluder).map(|o| o.name.as_str()).collect();
        assert_eq!(occluders, [thin]);
        assert!(objects.iter().any(|o| o.name == thick));
    }
}

#[test]
fn shapes_hang_where_they_are_told() {
    for (family, gap) in [("banner", 0.2), ("blinds", 0.2), ("cables", 0.2), ("slatted-fence", 0.2), ("sphere", 0.2)] {
        let objects = shape(family, &format!("gap = {gap}\nat = {{ x = 3, z = -4 }}")).unwrap();
        let [lo, hi] = objects[0].mesh.bounds().unwrap();
        assert!((lo.y - gap).abs() < 1e-5, "{family}: {lo}");
        let middle = (lo + hi) / 2.0;
        assert!((middle - Vec3::new(3.0, middle.y, -4.0)).length() < 0.05, "{family}: {middle}");
    }
}
