use super::*;
use crate::{Scene, library};

/// A view found under these objects on ground at y = 0, with R = `radius`.
fn found(radius: f32, objects: &str) -> Result<MeasureView, String> {
    let text = format!(
        "description = 'x'\nao = {{ radius = {radius} }}\nenvironment = {{ radiance = 1 }}\n\
         object = [{{ name = 'ground', shape = {{ plane = {{ center = [0, 0, 0], u = [0, 0, 12], v = [12, 0, 0] }} }} }}, {objects}]"
    );
    Scene::from_toml("x", "x.toml", &text, None).map(|s| s.measure).map_err(|e| e.to_string())
}

fn occluder(shape: &str) -> String {
    format!("{{ name = 'it', occluder = true, shape = {{ {shape} }} }}")
}

#[test]
fn the_view_under_a_curtain_is_the_one_a_person_would_give() {
    for name in ["curtain-open", "curtain-room", "thick-box"] {
        let scene = library::scene(name).unwrap();
        let found = measure(&scene.objects, scene.ao.radius).unwrap();
        let given = scene.measure;
        assert!((found.normal - given.normal).length() < 1e-4, "{name}: {found:?}");
        assert!((found.transect - given.transect).length() < 1e-3, "{name}: {found:?}");
        assert!((found.clearance - given.clearance).abs() < 1e-4, "{name}: {found:?}");
        assert_eq!((found.pixel, found.resolution), (given.pixel, given.resolution));
        let off = found.center - given.center;
        assert!(off.x.abs() < 0.11 && off.y.abs() < 1e-5, "{name}: {found:?}");
    }
}

#[test]
fn without_a_gap_that_a_view_fits_into_the_message_says_why() {
    let plane = library::scene("plane").unwrap();
    assert!(measure(&plane.objects, 0.25).unwrap_err().contains("has no occluder"));
    let curtain = |gap: f32| occluder(&format!("curtain = {{ gap = {gap} }}"));
    for (radius, objects, expected) in [
        (0.25, curtain(0.0), ["touches", "raise it"]),
        (0.25, curtain(2.0), ["within ao.radius = 0.25 m", "larger ao.radius"]),
        (500.0, curtain(0.1), ["only 0.1 m", "ao.radius = 500 m"]),
        (500.0, curtain(0.0), ["touches", "raise it"]),
        // A block sunk into the ground, and a leg beside a good hem.
        (0.25, occluder("block = { min = [-0.01, -0.1, -1], max = [0.01, 1, 1] }"), ["touches or crosses", "raise it"]),
        (
            0.25,
            format!(
                "{}, {}",
                curtain(0.1),
                occluder("block = { min = [-0.01, 0, 0.2], max = [0.01, 1, 0.21] }").replace("'it'", "'leg'")
            ),
            ["touches or crosses", "raise it"],
        ),
    ] {
        let message = found(radius, &objects).unwrap_err();
        assert!(expected.iter().all(|e| message.contains(e)) && message.contains("[measure]"), "{objects}: {message}");
    }
}

#[test]
fn under_a_round_or_square_base_the_transect_is_a_world_axis() {
    let slab = |min: &str, max: &str| occluder(&format!("block = {{ min = {min}, max = {max} }}"));
    for shape in [
        occluder("sphere = { radius = 0.3, gap = 0.05 }"),
        occluder("sphere = { radius = 0.3, gap = 0.05, subdivisions = 2, at = { x = 0.3, z = 0.7 } }"),
        occluder("pillar = { radius = 0.2, height = 0.3 }").replace("'it'", "'on'")
            + ", "
            + &slab("[-1, 0.5, -1]", "[1, 0.6, 1]")
                .replace("occluder = true", "occluder = false")
                .replace("'it'", "'roof'"),
        slab("[-0.5, 0.1, -0.4]", "[0.5, 1, 0.4]"),
        slab("[-0.4, 0.1, -0.5]", "[0.4, 1, 0.5]"),
    ] {
        // The pillar stands on the ground, under the roof: the view looks up.
        let view = found(0.25, &shape).unwrap();
        assert_eq!(view.transect, Vec3::X, "{shape}: {view:?}");
        assert!(view.normal.y.abs() > 0.999, "{shape}: {view:?}");
    }
    assert_eq!(axis_across(Vec3::X), Vec3::Y);
    assert_eq!(axis_across(Vec3::NEG_Z), Vec3::X);
}

/// A hem of 30 000 corners that all hang 0.1 m high but one, which dips to 0.06 m
/// near the middle: sampling would have to be lucky to meet it.
#[test]
fn the_near_plane_lies_under_the_lowest_corner_of_a_fine_hem() {
    let columns = 10_000;
    let corner = |i: u32, y: f32| format!("[0, {y}, {}]", 6.0 * i as f32 / columns as f32 - 3.0);
    let hem = |i: u32| if i == columns / 2 + 77 { 0.06 } else { 0.1 };
    let positions: Vec<String> = (0..=columns).flat_map(|i| [corner(i, hem(i)), corner(i, 1.0)]).collect();
    let triangles: Vec<String> = (0..columns)
        .flat_map(|i| {
            let k = 2 * i;
            [format!("[{}, {}, {}]", k, k + 2, k + 3), format!("[{}, {}, {}]", k, k + 3, k + 1)]
        })
        .collect();
    let shape =
        format!("polygons = {{ positions = [{}], triangles = [{}] }}", positions.join(","), triangles.join(","));
    let view = found(0.25, &occluder(&shape)).unwrap();
    assert!((view.clearance - 0.8 * 0.06).abs() < 1e-5, "{view:?}");
    assert_eq!(view.transect, Vec3::X);
}

/// A storey below, another curtain's top does not lower the view.
#[test]
fn what_hangs_under_the_receiver_does_not_count() {
    let below = occluder("block = { min = [-0.01, -1, -1], max = [0.01, -0.26, 1] }").replace("'it'", "'below'");
    let view = found(0.25, &format!("{}, {below}", occluder("curtain = { gap = 0.1 }"))).unwrap();
    assert!(view.normal.y > 0.999 && (view.clearance - 0.08).abs() < 1e-5, "{view:?}");
}

/// The atrium's curtains hang between columns, many at a time; the view is found
/// on its floor all the same, under one of them, at every size of its meshes.
#[test]
fn under_many_curtains_the_view_is_under_one_of_them() {
    let text = library::SCENES.iter().find(|(name, _)| *name == "atrium").unwrap().1;
    for triangles in [20_000, 250_000] {
        let text = text.replace("triangles = 250000", &format!("triangles = {triangles}"));
        let scene = Scene::from_toml("atrium", "atrium.toml", &text, None).unwrap();
        let found = measure(&scene.objects, scene.ao.radius).unwrap();
        assert!(found.normal.y > 0.99 && found.center.y.abs() < 0.02, "{found:?}");
        let across = found.transect.abs().to_array();
        assert!(across[0].max(across[2]) > 0.999, "curtains hang along an axis: {found:?}");
        assert!(found.clearance > 0.01 && found.clearance < 0.2, "{found:?}");
    }
}

/// One object of four curtains, 2 m apart in a row across them: the view is under
/// one, across it.
#[test]
fn under_one_object_of_many_curtains_the_view_is_across_one_of_them() {
    let at = [-3.0, -1.0, 1.0, 3.0];
    let corners = at.map(|x| format!("[{x}, 0.05, -0.5], [{x}, 0.05, 0.5], [{x}, 1, 0.5], [{x}, 1, -0.5]")).join(", ");
    let triangles = [0, 4, 8, 12].map(|i| format!("[{i}, {}, {}], [{i}, {}, {}]", i + 1, i + 2, i + 2, i + 3));
    let shape = format!("polygons = {{ positions = [{corners}], triangles = [{}] }}", triangles.join(", "));
    let found = found(0.25, &occluder(&shape)).unwrap();
    assert!((found.transect - Vec3::X).length() < 1e-3, "{found:?}");
    assert!(at.iter().any(|x| (x - found.center.x).abs() < 1e-3) && found.center.z.abs() < 0.26, "{found:?}");
}
