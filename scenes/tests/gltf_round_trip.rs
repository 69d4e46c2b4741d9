//! What is written reads back the same.

#![allow(clippy::unwrap_used, clippy::panic, reason = "the helpers of tests are tests, too")]

use aogauge_scenes::{
    Camera, Light, LightKind, Material, Projection, Scene, Texture,
    gltf::{Imported, import_bytes, write_glb},
    library, views_json,
};
use glam::{Vec2, Vec3};
use std::sync::Arc;

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

/// A scene with all that generated ones lack.
fn rich() -> Scene {
    let mut scene = library::scene("curtain-open").unwrap();
    let texture = Arc::new(Texture { size: [3, 2], texels: (0..6).map(|i| [i * 40, 255 - i, 7, 100 + i]).collect() });
    let ground = &mut scene.objects[0];
    ground.mesh.uvs = ground.mesh.positions.iter().map(|p| Vec2::new(p.x * 0.37, p.z)).collect();
    ground.material = Material {
        base_color: [0.1, 0.2, 0.3],
        texture: Some(texture),
        metallic: 0.25,
        roughness: 0.75,
        emissive: [0.5, 12.5, 3.0],
    };
    scene.objects[1].material.emissive = [0.5, 0.25, 0.0];
    let light = |name: &str, kind| Light {
        name: name.into(),
        kind,
        position: Vec3::new(1.0, 2.0, -3.0),
        direction: Vec3::new(0.6, -0.8, 0.0),
        color: [1.0, 0.5, 0.25],
        intensity: 80.0,
        range: Some(7.5),
    };
    scene.lights = vec![
        light("sun", LightKind::Directional),
        light("bulb", LightKind::Point),
        light("torch", LightKind::Spot { inner: 0.2, outer: 0.7 }),
    ];
    scene.lights[0].range = None;
    scene.cameras = vec![Camera {
        name: "side".into(),
        position: Vec3::ONE,
        forward: Vec3::X,
        up: Vec3::Z,
        projection: Projection::Perspective { fov_y: 1.0, aspect: None, near: 0.5, far: Some(9.0) },
    }];
    scene
}

#[test]
fn materials_textures_lights_and_cameras_come_back() {
    let mut scene = rich();
    let back = round_trip(&scene);
    for (a, b) in back.objects.iter().zip(&scene.objects) {
        assert_eq!((&a.mesh, &a.material.texture), (&b.mesh, &b.material.texture));
        assert_eq!((a.material.metallic, a.material.roughness), (b.material.metallic, b.material.roughness));
        assert_eq!(a.material.base_color, b.material.base_color);
        for (x, y) in a.material.emissive.iter().zip(b.material.emissive) {
            assert!((x - y).abs() < 1e-5);
        }
    }
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
