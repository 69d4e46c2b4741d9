//! Scenes with several occluders: each has regions, a judge and metrics of its own.

use aogauge::{
    metrics::{
        MetricName,
        regions::{Finder, Region, Regions},
    },
    record::{Machine, Record, RecordFolder},
    render::{Geometry, cpu::Cpu, gbuffer::GBuffer},
    report,
    run::{Means, Observer, Prepared},
    scenes::{Scene, library},
    suite::{Plan, Platform, Suite},
};
use glam::Vec3;
use std::fs;

struct Silent;

impl Observer for Silent {
    fn step(&self, _: u64, _: u64, _: &str) {}
}

/// A glTF of a floor and two sheets across it, 5 cm over it, at x = -0.3 and 0.3: the
/// second reaches over a tenth of the view, where it shows too few pixels.
fn model() -> (String, Vec<u8>) {
    let quads: [[[f32; 3]; 4]; 3] = [
        [[-4.0, 0.0, -4.0], [-4.0, 0.0, 4.0], [4.0, 0.0, 4.0], [4.0, 0.0, -4.0]],
        [[-0.3, 0.05, -2.0], [-0.3, 0.05, 2.0], [-0.3, 1.0, 2.0], [-0.3, 1.0, -2.0]],
        [[0.3, 0.05, 0.21], [0.3, 0.05, 2.0], [0.3, 1.0, 2.0], [0.3, 1.0, 0.21]],
    ];
    let mut bytes: Vec<u8> = quads.iter().flatten().flatten().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let bounds = |q: &[[f32; 3]; 4], f: fn(f32, f32) -> f32| {
        let v: [f32; 3] = std::array::from_fn(|a| q.iter().map(|p| p[a]).reduce(f).unwrap());
        format!("{v:?}")
    };
    let mut accessors: Vec<String> = quads
        .iter()
        .enumerate()
        .map(|(i, q)| {
            format!(
                r#"{{"bufferView": 0, "byteOffset": {}, "componentType": 5126, "count": 4, "type": "VEC3", "min": {}, "max": {}}}"#,
                i * 48,
                bounds(q, f32::min),
                bounds(q, f32::max)
            )
        })
        .collect();
    accessors.push(r#"{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}"#.into());
    let mesh = |i: usize| format!(r#"{{"primitives": [{{"attributes": {{"POSITION": {i}}}, "indices": 3}}]}}"#);
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1, 2]}}],
"nodes": [{{"name": "floor", "mesh": 0}}, {{"name": "sheet-left", "mesh": 1}}, {{"name": "sheet-right", "mesh": 2}}],
"meshes": [{}, {}, {}], "accessors": [{}],
"bufferViews": [{{"buffer": 0, "byteLength": 144}}, {{"buffer": 0, "byteOffset": 144, "byteLength": 12}}],
"buffers": [{{"byteLength": 156, "uri": "model.bin"}}]}}"#,
        mesh(0),
        mesh(1),
        mesh(2),
        accessors.join(", ")
    );
    (text, bytes)
}

const SCENE: &str = r#"
description = "Two sheets."
ao = { radius = 0.25 }
environment = { radiance = 1.0 }
measure = { center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.04, resolution = [240, 96] }
look = { eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }
[gltf]
file = "model.gltf"
occluders = ["sheet-*"]
"#;

const SUITE: &str = r#"
description = "x"
scenes = ["scene.toml"]
rays = [4]
replicates = 4
converged_rays = 64
look_rays = 1
judge = { precision = 0.1, paths = 4, replicates = 8 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
"#;

fn imported() -> (Record, String) {
    let dir = tempfile::tempdir().unwrap();
    let (text, bytes) = model();
    fs::write(dir.path().join("model.gltf"), text).unwrap();
    fs::write(dir.path().join("model.bin"), bytes).unwrap();
    fs::write(dir.path().join("scene.toml"), SCENE).unwrap();
    let suite = Suite::from_toml("x", "x.toml", SUITE, dir.path()).unwrap();
    let plan = Plan::new(&suite, Platform::Cpu, None);
    let out = dir.path().join("out");
    let folder = RecordFolder::create(&out).unwrap();
    let machine = Machine::here("a test".into(), None);
    let record = Prepared::new(&plan).unwrap().run(&Means::new(&Cpu, machine), &folder, &Silent).unwrap();
    assert_eq!(report::write(&out, &out).unwrap(), record);
    let text = fs::read_to_string(out.join("report.md")).unwrap();
    (record, text)
}

#[test]
fn each_sheet_of_a_model_is_measured_by_itself() {
    let (record, text) = imported();
    let [left, right] = &record.scenes[0].occluders[..] else { panic!("{:?}", record.scenes[0].occluders) };
    assert_eq!((left.name.as_str(), right.name.as_str()), ("sheet-left", "sheet-right"));
    // 0.02 R on either side are two columns of 5 mm, the flanks 16 each, their borders among
    // the pixels' centres; the view is
    // 96 rows, the right sheet stands over the last of them.
    assert_eq!(left.regions[&Region::Footprint], 2 * 96);
    assert_eq!((left.regions[&Region::Left], left.regions[&Region::Right]), (16 * 96, 16 * 96));
    assert!((1..64).contains(&right.regions[&Region::Footprint]), "{:?}", right.regions);
    assert!(left.contrast.value.is_some() && left.q.values().all(|q| q.value.is_some_and(|v| v > 0.0 && v < 1.5)));
    let q = &right.q[&Region::Footprint];
    assert!(q.value.is_none() && q.note.as_deref().unwrap().contains("fewer than 64"), "{q:?}");
    assert!(right.contrast.note.as_deref().unwrap().contains("fewer than 64"));
    assert!(right.q[&Region::Left].value.is_some(), "a flank that is large enough has its Q: {:?}", right.q);

    for case in &record.cases {
        let [left, right] = &case.occluders[..] else { panic!("{:?}", case.occluders) };
        // The pixels of the scene's own footprint under the left half are the left
        // sheet's, and classic AO reads them all the same.
        let footprint = Some(Region::Footprint);
        for name in [MetricName::Openness, MetricName::Bias, MetricName::Mae, MetricName::Rmse, MetricName::JudgeMae] {
            assert!(left.metric(name, footprint).unwrap().value.is_some(), "{name:?}");
            assert!(right.metric(name, footprint).unwrap().note.as_deref().unwrap().contains("fewer than 64"));
        }
        let [k, dk] = [MetricName::Contrast, MetricName::ContrastError].map(|n| left.metric(n, None).unwrap());
        assert!(k.value.unwrap().abs() < 0.5 && dk.se.unwrap() > 0.0);
        let removed = left.metric(MetricName::Removed, None);
        assert_eq!(removed.is_some(), case.case.estimator == "extended");
    }
    assert!(text.contains("Occluders one by one (2)") && text.contains("| sheet-left |"), "{text}");
}

/// The atrium has many curtains, and one in view.
#[test]
fn scenes_of_one_occluder_in_view_say_nothing_twice() {
    for name in ["atrium", "curtain-open", "plane"] {
        let scene = library::scene(name).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let finder = Finder::new(&scene, &geometry.tracer);
        let regions = finder.regions(&gbuffer);
        let found = finder.by_occluder(&gbuffer, &regions);
        assert!(found.is_empty(), "{name}: {:?}", found.iter().map(|o| &o.name).collect::<Vec<_>>());
    }
}

/// A view between two curtains of the atrium, one of them drawn aside, with a column
/// beside the hem, on flags with bevels: each has regions, its footprint under its hem.
#[test]
fn beside_the_columns_of_the_atrium_a_curtain_has_its_footprint_under_it() {
    let mut scene = library::scene("atrium").unwrap();
    scene.measure.center.x = 2.4;
    scene.measure.resolution = [208, 256];
    let geometry = Geometry::new(&scene).unwrap();
    let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
    let finder = Finder::new(&scene, &geometry.tracer);
    let found = finder.by_occluder(&gbuffer, &finder.regions(&gbuffer));
    let names: Vec<&str> = found.iter().map(|o| o.name.as_str()).collect();
    assert!(names.len() == 2 && names[0].ends_with("red-4") && names[1].ends_with("green-5"), "{names:?}");
    // The margin, and what the slope of a bevel adds.
    let margin = 0.02 * scene.ao.radius + 0.01;
    for own in &found {
        let cloth = scene.objects.iter().find(|o| o.name == own.name).unwrap().mesh.positions.iter();
        let hem: Vec<Vec3> = cloth.copied().filter(|v| v.y < 0.1).collect();
        let low = hem.iter().copied().reduce(Vec3::min).unwrap() - margin;
        let high = hem.iter().copied().reduce(Vec3::max).unwrap() + margin;
        let footprint = own.regions.pixels(Region::Footprint);
        assert!(footprint.len() > 20, "{}: {}", own.name, footprint.len());
        for &i in footprint {
            let p = gbuffer.surfaces[i as usize].unwrap().point;
            assert!(p.x > low.x && p.x < high.x && p.z > low.z && p.z < high.z, "{}: {p}", own.name);
        }
    }
}

/// A second curtain 0.3 m beside that of the library: the regions of each are what the
/// scene's would be with that curtain as the only occluder.
#[test]
fn each_curtain_has_the_regions_of_a_scene_of_its_own() {
    let mut scene = library::scene("curtain-open").unwrap();
    let mut second = scene.objects.iter().find(|o| o.occluder).unwrap().clone();
    second.name = "second".into();
    second.mesh.positions.iter_mut().for_each(|v| v.x += 0.3);
    scene.objects.push(second);
    let of = |scene: &Scene, find: &mut dyn FnMut(&Finder<'_>, &GBuffer, &Regions)| {
        let geometry = Geometry::new(scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let finder = Finder::new(scene, &geometry.tracer);
        let regions = finder.regions(&gbuffer);
        find(&finder, &gbuffer, &regions);
    };
    let mut found = Vec::new();
    of(&scene, &mut |finder, gbuffer, regions| found = finder.by_occluder(gbuffer, regions));
    let names: Vec<&str> = found.iter().map(|o| o.name.as_str()).collect();
    assert!(names.len() == 2 && names[1] == "second", "{names:?}");
    for own in &found {
        let mut alone = scene.clone();
        alone.objects.retain(|o| !o.occluder || o.name == own.name);
        of(&alone, &mut |_, _, regions| {
            for region in [Region::Footprint, Region::Left, Region::Right] {
                assert_eq!(own.regions.pixels(region), regions.pixels(region), "{} {region:?}", own.name);
                assert!(regions.measurable(region).is_ok());
            }
        });
    }
}
