//! What is written reads back the same.

use crate::builder::rich;
use aogauge_scenes::{
    Projection, Scene,
    gltf::{Imported, import_bytes, write_glb},
    library, views_json,
};
use glam::Vec3;

fn round_trip(scene: &Scene) -> Imported {
    let mut glb = Vec::new();
    write_glb(scene, &mut glb).unwrap();
    import_bytes(&scene.name, &glb, None, 1.0).unwrap_or_else(|e| panic!("{e}"))
}

fn bits(scene: &[aogauge_scenes::Object]) -> Vec<[u32; 3]> {
    scene.iter().flat_map(|o| &o.mesh.positions).map(|p| p.to_array().map(f32::to_bits)).collect()
}

fn close(a: Vec3, b: Vec3) -> bool {
    (a - b).abs().max_element() < 1e-6
}

/// The scene as it comes back from its glb and the scene file beside that.
fn kit_and_back(scene: &Scene) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let file = |ending: &str| folder.path().join(format!("{}.{ending}", scene.name));
    write_glb(scene, std::fs::File::create(file("glb")).unwrap()).unwrap();
    std::fs::write(file("toml"), scene.model_toml(&format!("{}.glb", scene.name)).unwrap()).unwrap();
    Scene::from_file(&file("toml")).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn every_built_in_scene_comes_back_from_its_own_file() {
    for (name, _) in library::SCENES {
        let scene = library::scene(name).unwrap();
        let back = kit_and_back(&scene);
        assert_eq!((&back.measure, &back.look), (&scene.measure, &scene.look), "{name}");
        // In one piece it would print millions of numbers.
        assert!(back == scene, "{name}");
        assert_eq!(back.hash(), scene.hash(), "{name}");
    }
}

#[test]
fn a_rich_scene_comes_back_from_its_own_file() {
    let scene = rich();
    let back = kit_and_back(&scene);
    assert_eq!(back.objects, scene.objects);
    assert_eq!(back, scene);
    assert_eq!(back.hash(), scene.hash());
    assert_eq!(kit_and_back(&scene.twin()).hash(), scene.twin().hash());
}

/// A scene file as a user would write it, beside the glb.
fn own_file(scene: &Scene, gltf: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    write_glb(scene, std::fs::File::create(folder.path().join("model.glb")).unwrap()).unwrap();
    let text = format!(
        "description = 'mine'\nao = {{ radius = 0.25 }}\nenvironment = {{ radiance = 1.0 }}\n[gltf]\nfile = 'model.glb'\n{gltf}"
    );
    let file = folder.path().join("mine.toml");
    std::fs::write(&file, text).unwrap();
    Scene::from_file(&file).map_err(|e| e.to_string())
}

#[test]
fn occluders_are_found_by_the_name_of_their_material_after_an_export() {
    let mut scene = rich();
    let flags: Vec<bool> = scene.objects.iter().map(|o| o.occluder).collect();
    scene.objects.iter_mut().for_each(|o| o.occluder = false);
    let back = own_file(&scene, "occluders = ['red clo?h']\n").unwrap();
    assert_eq!(back.objects.iter().map(|o| o.occluder).collect::<Vec<_>>(), flags);
    assert_eq!((back.measure, back.look), (scene.measure, scene.look));
}

#[test]
fn a_view_may_be_a_camera_of_the_model() {
    let scene = library::scene("curtain-room").unwrap();
    let (m, l) = (&scene.measure, &scene.look);
    let table =
        "[measure]\ncamera = 'measure'\nresolution = [208, 32]\n[look]\ncamera = 'look'\nresolution = [288, 192]\n";
    let back = own_file(&scene, table).unwrap();
    let (measure, look) = (&back.measure, &back.look);
    assert!(close(measure.center, m.center) && close(measure.normal, m.normal) && close(measure.transect, m.transect));
    assert!((measure.clearance - m.clearance).abs() < 1e-6 && (measure.pixel - m.pixel).abs() < 1e-8);
    assert!(close(look.eye, l.eye) && (look.fov - l.fov).abs() < 1e-4);
    let (a, b) = (look.view(), l.view());
    assert!(close(a.ray(0, 0).1, b.ray(0, 0).1) && close(a.ray(287, 191).1, b.ray(287, 191).1));
    // The receiver is looked for nearer to the camera: the centre moves up.
    let nearer = own_file(&scene, &table.replace("'measure'", "'measure'\nclearance = 0.01")).unwrap();
    assert!(close(nearer.measure.center, m.center + m.normal * (m.clearance - 0.01)));
}

#[test]
fn a_view_by_a_camera_that_will_not_do_is_refused() {
    let scene = rich();
    let measure = |rest: &str| format!("[measure]\nresolution = [208, 32]\n{rest}\n");
    let look = |rest: &str| format!("[look]\nresolution = [288, 192]\n{rest}\n");
    for (table, wanted) in [
        (
            measure("camera = 'mesure'"),
            "measure.camera is 'mesure', but no camera of the model has this name; there are: measure, look, side",
        ),
        (measure("camera = 'look'"), "must be orthographic"),
        (look("camera = 'measure'"), "must be perspective"),
        (look("camera = 'side'"), "tilted sideways"),
        (measure("camera = 'measure'\ncenter = [0, 0, 0]"), "not both"),
        (measure("camera = 'measure'\npixel = 0.001"), "not both"),
        (look("camera = 'look'\neye = [0, 0, 0]"), "not both"),
        (measure("camera = 'measure'\nclearance = 0"), "out of range"),
        (measure("camera = 'measure'").replace("208", "16"), "they must be square"),
        (measure("center = [0, 0, 0]\nnormal = [0, 1, 0]\nclearance = 0.1"), "missing field `transect`"),
        (look("eye = [0, 0, 0]"), "missing field `target`"),
    ] {
        let message = own_file(&scene, &table).unwrap_err();
        assert!(message.contains(wanted) && message.contains("mine.toml"), "{table}: {message}");
    }
    let coarse = own_file(&scene, &measure("camera = 'measure'").replace("208, 32", "104, 16")).unwrap_err();
    assert!(coarse.contains("no larger than ao.radius / 50"), "{coarse}");
    let alone = format!(
        "description = 'x'\nao = {{ radius = 0.25 }}\nenvironment = {{ radiance = 1.0 }}\n{}[[object]]\nname = 'floor'\n{}",
        look("camera = 'look'"),
        "shape = { plane = { center = [0, 0, 0], u = [0, 0, 4], v = [4, 0, 0] } }\n"
    );
    let measure = "[measure]\ncenter = [0, 0, 0]\nnormal = [0, 1, 0]\ntransect = [1, 0, 0]\nclearance = 0.1\nresolution = [96, 64]\n";
    let message = Scene::from_toml("x", "x.toml", &format!("{alone}{measure}"), None).unwrap_err().to_string();
    assert!(message.contains("no model with cameras"), "{message}");
}

/// The JSON of an exported scene, changed and packed again.
fn changed(scene: &Scene, change: impl FnOnce(&mut serde_json::Value)) -> Result<Imported, String> {
    let mut glb = Vec::new();
    write_glb(scene, &mut glb).unwrap();
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let mut json: serde_json::Value = serde_json::from_slice(&glb[20..20 + length]).unwrap();
    change(&mut json);
    let packed = crate::builder::glb(&serde_json::to_vec(&json).unwrap(), &glb[28 + length..]);
    import_bytes("changed.glb", &packed, None, 1.0).map_err(|e| e.to_string())
}

#[test]
fn a_camera_that_has_been_moved_since_counts_itself() {
    let scene = library::scene("curtain-open").unwrap();
    let node = |json: &serde_json::Value, name: &str| {
        json["nodes"].as_array().unwrap().iter().position(|n| n["name"] == name).unwrap()
    };
    let moved = changed(&scene, |json| {
        let (m, l) = (node(json, "measure"), node(json, "look"));
        for (n, axis) in [(m, 12), (l, 13)] {
            let place = &mut json["nodes"][n]["matrix"][axis];
            *place = (place.as_f64().unwrap() + 0.5).into();
        }
    })
    .unwrap();
    let (measure, look) = (moved.measure.unwrap(), moved.look.unwrap());
    assert!(close(measure.center, scene.measure.center + Vec3::X * 0.5), "{measure:?}");
    assert_eq!(measure.resolution, scene.measure.resolution);
    assert!(close(look.eye, scene.look.eye + Vec3::Y * 0.5) && look.resolution == scene.look.resolution);
    assert!(close((look.target - look.eye).normalize(), (scene.look.target - scene.look.eye).normalize()));
}

#[test]
fn a_view_in_extras_is_checked_like_any_input() {
    let scene = library::scene("curtain-open").unwrap();
    for (path, value, wanted) in [
        (
            "/measure/resolution",
            serde_json::json!([4_000_000_000_u32, 32]),
            "resolution[0]: 4000000000 is out of range: it must be a whole number from 16 to 4096",
        ),
        ("/measure/clearance", serde_json::json!(-1), "out of range"),
        ("/measure/normal", serde_json::json!([0, 0, 0]), "zero vector"),
        ("/measure/pixel", serde_json::json!(null), "pixel is missing"),
        ("/measure", serde_json::json!("here"), "holds the measure view in its extras, but"),
        ("/look", serde_json::json!({ "eye": [0, 0, 0] }), "missing field `target`"),
        ("/look", serde_json::json!(scene.look.eye.to_array()), "camera 0 'measure' holds the look view"),
    ] {
        let message = changed(&scene, |json| {
            let camera = usize::from(path == "/look" && value.is_object());
            let extras = &mut json["cameras"][camera]["extras"]["aogauge"];
            match extras.pointer_mut(path) {
                Some(place) => *place = value.clone(),
                None => extras["look"] = value.clone(),
            }
        })
        .unwrap_err();
        assert!(message.contains(wanted) && !message.contains('\n'), "{path} {value}: {message}");
    }
    let twice = changed(&scene, |json| {
        json["nodes"].as_array_mut().unwrap().push(serde_json::json!({ "camera": 0 }));
        let n = json["nodes"].as_array().unwrap().len() - 1;
        json["scenes"][0]["nodes"].as_array_mut().unwrap().push(n.into());
    });
    assert!(twice.unwrap_err().contains("two cameras hold the measure view"));
}

#[test]
fn every_built_in_scene_comes_back_to_the_bit() {
    for (name, _) in library::SCENES {
        let scene = library::scene(name).unwrap();
        let back = round_trip(&scene);
        assert_eq!(back.objects, scene.objects, "{name}");
        assert_eq!(bits(&back.objects), bits(&scene.objects), "{name}");
        assert_eq!(back.degenerate, 0, "{name}");
    }
}

#[test]
fn the_views_come_back_as_cameras() {
    for (name, _) in library::SCENES {
        let scene = library::scene(name).unwrap();
        let [measure, look] = &round_trip(&scene).cameras[..] else { panic!("{name}: not two cameras") };
        let (view, m) = (scene.measure.view(), &scene.measure);
        assert_eq!(measure.name, "measure");
        assert!(close(measure.position, m.center + m.normal * m.clearance), "{name}");
        assert!(close(measure.forward, -m.normal));
        assert!(close(measure.up, -view.origin_dy / m.pixel));
        let Projection::Orthographic { half_size: [x, y], near, far } = measure.projection else { panic!() };
        // The image's corner as the camera has it is the corner of the view.
        let right = measure.forward.cross(measure.up);
        assert!(close(right, m.transect));
        assert!(close(measure.position - right * x + measure.up * y, view.origin), "{name}");
        assert!(near == 0.0 && far > m.clearance);

        let view = scene.look.view();
        assert_eq!(look.name, "look");
        assert!(close(look.position, scene.look.eye), "{name}");
        let Projection::Perspective { fov_y, aspect: Some(aspect), .. } = look.projection else { panic!() };
        let (h, right) = ((fov_y / 2.0).tan(), look.forward.cross(look.up));
        assert!(close(look.forward - right * h * aspect + look.up * h, view.direction), "{name}");
    }
}

#[test]
fn materials_textures_lights_and_cameras_come_back() {
    let mut scene = rich();
    let back = round_trip(&scene);
    assert_eq!(back.objects, scene.objects);
    for (a, b) in back.lights.iter().zip(&scene.lights) {
        assert!(close(a.position, b.position) && close(a.direction, b.direction));
        assert_eq!((&a.name, a.kind, a.color, a.intensity, a.range), (&b.name, b.kind, b.color, b.intensity, b.range));
    }
    assert_eq!(back.lights.len(), 3);
    assert_eq!(back.cameras[2], scene.cameras[0]);
    // A scene that has been imported does not gain a second pair of views.
    scene.cameras = back.cameras.clone();
    assert_eq!(round_trip(&scene).cameras.len(), 3);
}

#[test]
fn what_gltf_cannot_say_is_refused_by_name() {
    let mut scene = library::scene("plane").unwrap();
    scene.objects[0].mesh.triangles[0] = [0, 1, 99];
    let message = write_glb(&scene, &mut Vec::new()).unwrap_err().to_string();
    assert!(message.contains("plane") && message.contains("vertex 99"), "{message}");
    let scene = library::scene("plane").unwrap();
    let message = write_glb(&scene, &mut [0_u8; 10][..]).unwrap_err().to_string();
    assert!(message.contains("cannot write"), "{message}");
}

#[test]
fn the_views_are_told_to_programs() {
    let scene = library::scene("curtain-room").unwrap();
    let json: serde_json::Value = serde_json::from_str(&views_json(&scene)).unwrap();
    assert_eq!(json["ao"]["secondary_radius"], 0.0625);
    assert_eq!(json["measure"]["resolution"], serde_json::json!([208, 32]));
    let dx: [f32; 3] = serde_json::from_value(json["measure"]["rays"]["origin_dx"].clone()).unwrap();
    assert_eq!(dx, scene.measure.view().origin_dx.to_array());
    assert!((json["look"]["fov_y"].as_f64().unwrap() - f64::from(scene.look.fov.to_radians())).abs() < 1e-6);
}

/// Leaves the built-in scenes, and a rich one, as GLB where the Khronos validator finds them.
#[test]
fn built_in_scenes_are_left_for_the_validator() {
    let Some(folder) = std::env::var_os("AOGAUGE_GLB_OUT").map(std::path::PathBuf::from) else { return };
    std::fs::create_dir_all(&folder).unwrap();
    let built_in = library::SCENES.map(|(name, _)| (name, library::scene(name).unwrap()));
    for (name, scene) in built_in.into_iter().chain([("rich", rich())]) {
        write_glb(&scene, std::fs::File::create(folder.join(format!("{name}.glb"))).unwrap()).unwrap();
    }
}
