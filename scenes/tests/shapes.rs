//! Every legal parameter set gives a sound mesh; every illegal one is refused by
//! name and range. What is legal is read from the published schema, so a new
//! parameter is tested as soon as it is declared.

#![allow(clippy::unwrap_used, clippy::panic)]

mod legal;

use aogauge_scenes::{Mesh, Scene};
use glam::Vec3;
use legal::{FAMILIES, Kind, Parameter, legal, parameters, shape};
use proptest::{prelude::*, test_runner::TestRunner};
use serde_json::Value;
use std::{cell::Cell, collections::HashMap};

/// Whether every piece of a family's part must be closed; the other parts are
/// shells, seen from one side.
fn solid(family: &str, part: &str, text: &str) -> bool {
    let given: toml::Table = toml::from_str(text).unwrap();
    // Of the families made of sheets, only these are a single layer by default.
    let thick = |key: &str| match given.get(key) {
        Some(value) => value.as_float().or(value.as_integer().map(|v| v as f64)) != Some(0.0),
        None => !["banner", "leaves", "atrium"].contains(&family),
    };
    match (family, part) {
        ("plane" | "arcade" | "room", _) | ("shelf", "it.wall") => false,
        ("atrium", part) => {
            ["it.curtain-", "it.banner-"].iter().any(|p| part.starts_with(p)) && thick("cloth_thickness")
        }
        ("curtain" | "slatted-fence" | "blinds" | "leaves", _) | ("banner", "it.cloth") | ("shelf", "it.board") => {
            thick("thickness")
        }
        _ => true,
    }
}

/// Panics unless the mesh is sound: valid, without degenerate triangles, and each
/// of its pieces closed with its normals outward, or open where it may be.
fn check(mesh: &Mesh, solid: bool, what: &str) {
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
        let closed = is_closed(&piece);
        assert!(closed || !solid, "{what}: a piece is not closed");
        assert!(!closed || volume > 0.0, "{what}: a piece is inside out: {volume}");
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
                        check(&o.mesh, solid(family, &o.name, &text), &format!("{family}: {}\n{text}", o.name));
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
        // Of two corners of a block drawn at random, one in eight is above the other.
        let least = if family == "block" { 15 } else { 40 };
        assert!(made.get() >= least, "{family}: {} made, {} refused", made.get(), refused.get());
    }
}

/// A little under the lowest, and over the highest.
fn beyond(min: f64, max: f64) -> [String; 2] {
    [format!("{:?}", min - 0.01), format!("{:?}", max + 1.0)]
}

#[test]
fn every_value_out_of_range_is_refused_by_name_and_range() {
    for (family, declared) in FAMILIES {
        let all = parameters(declared);
        for p in &all {
            let others: String = all.iter().filter(|o| o.name != p.name).map(Parameter::line).collect();
            let refused = |value: &str| shape(family, &format!("{others}{} = {value}", p.name)).unwrap_err();
            let (bad, bounds) = match &p.kind {
                Kind::Number { min, max, .. } => (beyond(*min, *max).to_vec(), vec![format!("from {min} to {max}")]),
                Kind::Vector { min, max } => {
                    let each = |v: String| [format!("[{v}, 1, 1]"), format!("[1, {v}, 1]"), format!("[1, 1, {v}]")];
                    (beyond(*min, *max).into_iter().flat_map(each).collect(), vec![format!("from {min} to {max} m")])
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
                let message = refused(&value);
                for part in bounds.iter().chain([&p.name]) {
                    assert!(
                        message.contains(part.as_str()),
                        "{family}.{} = {value}: no '{part}' in\n{message}",
                        p.name
                    );
                }
            }
            if let Kind::Number { .. } = p.kind {
                let message = refused("nan");
                assert!(message.contains("finite") && message.contains(&p.name), "{message}");
            }
        }
        assert!(shape(family, "colour = 3").unwrap_err().contains("colour"));
    }
}

#[test]
fn every_family_has_defaults_that_work() {
    for (family, _) in FAMILIES.into_iter().filter(|(_, t)| parameters(t).iter().all(|p| !p.required)) {
        let objects = shape(family, "").unwrap_or_else(|e| panic!("{family}: {e}"));
        for o in &objects {
            check(&o.mesh, solid(family, &o.name, ""), family);
        }
    }
}

/// `[ao]` and the other tables of a scene file: what is out of range is refused
/// by name and range.
#[test]
fn every_number_of_a_scene_file_keeps_to_its_range() {
    let text = "description = 'x'\nao = { radius = 1, secondary_radius = 1 }\n\
         environment = { gradient = { zenith = 1, horizon = 1, ground = 1 } }\n\
         measure = { center = [1, 1, 1], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 1, pixel = 0.01, resolution = [16, 16] }\n\
         look = { eye = [2, 2, 2], target = [1, 1, 1], fov = 45, resolution = [16, 16] }\n\
         [[object]]\nname = 'it'\nalbedo = 0.5\nemission = [1, 1, 1]\nshape = { ridge = {} }\n";
    let read = |text: &str| Scene::from_toml("x", "x.toml", text, None);
    assert!(read(text).is_ok(), "{}", read(text).unwrap_err());
    for (field, min, max, unit) in [
        ("radius = 1,", 0.001, 1000.0, " m"),
        ("secondary_radius = 1 ", 0.0001, 1000.0, " m"),
        ("zenith = 1", 0.0, 1e6, ""),
        ("ground = 1", 0.0, 1e6, ""),
        ("center = [1", -1e5, 1e5, " m"),
        ("transect = [1", -1000.0, 1000.0, ""),
        ("clearance = 1", 1e-6, 1000.0, " m"),
        ("pixel = 0.01", 1e-6, 1000.0, " m"),
        ("eye = [2", -1e5, 1e5, " m"),
        ("fov = 45", 1.0, 169.0, " degrees"),
        ("emission = [1", 0.0, 1e6, ""),
    ] {
        let (name, value) = field.split_at(field.find(|c: char| c.is_ascii_digit()).unwrap());
        let rest = value.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
        for bad in beyond(min, max) {
            let message = read(&text.replacen(field, &format!("{name}{bad}{rest}"), 1)).unwrap_err().to_string();
            let range = format!("it must be from {min} to {max}{unit}");
            assert!(message.contains(&range) && message.contains(name), "{field}: {message}");
        }
    }
    for (from, to, range) in [
        ("albedo = 0.5", "albedo = 1", "from 0 up to, but not including, 1"),
        ("resolution = [16", "resolution = [8", "a whole number from 16 to 4096"),
    ] {
        let message = read(&text.replace(from, to)).unwrap_err().to_string();
        assert!(message.contains(range), "{message}");
    }
}

/// No number of the published schema is without bounds, but indices into a list.
#[test]
fn every_number_of_the_schema_has_bounds() {
    fn walk(of: &Value, path: &str, free: &mut Vec<String>) {
        if of["type"] == "number" || of["type"] == "integer" {
            let bounds = if of["anyOf"].is_array() { &of["anyOf"][1] } else { of };
            let above = bounds["maximum"].is_number() || bounds["exclusiveMaximum"].is_number();
            if !(above && bounds["minimum"].is_number()) {
                free.push(path.to_owned());
            }
        }
        match of {
            Value::Object(fields) => fields.iter().for_each(|(k, v)| walk(v, &format!("{path}/{k}"), free)),
            Value::Array(items) => items.iter().enumerate().for_each(|(i, v)| walk(v, &format!("{path}/{i}"), free)),
            _ => {}
        }
    }
    let mut free = Vec::new();
    walk(&serde_json::to_value(Scene::file_schema()).unwrap(), "", &mut free);
    assert_eq!(free, ["/$defs/Polygons/properties/triangles/items/items"]);
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

#[test]
fn a_shape_is_of_one_family() {
    for (family, more, wanted) in [
        ("sphere", "[object.shape.banner]", ["not of 'banner' and 'sphere'", "line 12"]),
        ("banana", "", ["unknown variant `banana`", "line 12"]),
    ] {
        let message = shape(family, more).unwrap_err();
        assert!(wanted.iter().all(|w| message.contains(w)), "{message}");
    }
    for (shape, wanted) in
        [("{}", "expected enum"), ("'sphere'", "a table of one family"), ("3", "a table of one family")]
    {
        let text = format!("description = 'x'\nao = {{ radius = 1 }}\n[[object]]\nname = 'it'\nshape = {shape}\n");
        let message = Scene::from_toml("x", "x.toml", &text, None).unwrap_err().to_string();
        assert!(message.contains(wanted) && message.contains("line 5"), "{shape}: {message}");
    }
}

/// Corners that often fall together, and triangles that may name one too many.
fn polygons() -> impl Strategy<Value = (Vec<[i32; 3]>, Vec<[u32; 3]>)> {
    let corner = [-2..=2, -2..=2, -100_000..=100_000];
    (prop::collection::vec(corner, 3..9), prop::collection::vec([0..9u32, 0..9, 0..9], 1..5))
}

#[test]
fn polygons_are_taken_as_they_are_or_refused_by_triangle() {
    let (taken, flat, beyond) = (Cell::new(0), Cell::new(0), Cell::new(0));
    let config = ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() };
    let rng = proptest::test_runner::TestRng::deterministic_rng(Default::default());
    let result = TestRunner::new_with_rng(config, rng).run(&polygons(), |(corners, triangles)| {
        let made = shape("polygons", &format!("positions = {corners:?}\ntriangles = {triangles:?}"));
        let out = triangles.iter().position(|t| t.iter().any(|&i| i as usize >= corners.len()));
        // In whole numbers, where nothing is rounded.
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| corners[i as usize].map(i64::from));
            let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
            (0..3).any(|k| u[(k + 1) % 3] * v[(k + 2) % 3] != u[(k + 2) % 3] * v[(k + 1) % 3])
        };
        let message = match (out, out.is_none().then(|| triangles.iter().position(|t| !area(t))).flatten()) {
            (Some(i), _) => (beyond.set(beyond.get() + 1), format!("object 'it': triangle {i} names vertex")).1,
            (_, Some(i)) => (flat.set(flat.get() + 1), format!("object 'it': triangle {i} has no area")).1,
            _ => {
                taken.set(taken.get() + 1);
                let mesh = &made.unwrap()[0].mesh;
                prop_assert_eq!(&mesh.triangles, &triangles);
                let positions: Vec<Vec3> = corners.iter().map(|c| Vec3::from_array(c.map(|v| v as f32))).collect();
                prop_assert_eq!(&mesh.positions, &positions);
                return Ok(());
            }
        };
        let refused = made.unwrap_err();
        prop_assert!(refused.contains(&message), "no '{}' in {}", message, refused);
        Ok(())
    });
    assert!(result.is_ok(), "{}", result.unwrap_err());
    assert!([&taken, &flat, &beyond].iter().all(|n| n.get() >= 20), "{taken:?} {flat:?} {beyond:?}");
}
