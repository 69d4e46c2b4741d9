//! What glTF may say, and what is made of it.

use crate::builder::{Builder, TRIANGLE, everything, floats, png, shorts, triangle};
use aogauge_scenes::{LightKind, Projection, Scene, Wrap, gltf::import_bytes};
use glam::{Mat4, Quat, Vec3};
use serde_json::{Value, json};

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];

fn modes(mode: u32, indices: Option<(Vec<u8>, u32, usize)>) -> Vec<[u32; 3]> {
    let mut b = Builder::new();
    let positions = b.positions(&SQUARE);
    let mut primitive = json!({ "attributes": { "POSITION": positions }, "mode": mode });
    if let Some((bytes, component, count)) = indices {
        primitive["indices"] = b.accessor(&bytes, component, "SCALAR", count).into();
    }
    let mesh = b.mesh(primitive);
    b.node(json!({ "mesh": mesh }));
    b.import().unwrap().objects[0].mesh.triangles.clone()
}

#[test]
fn strips_and_fans_become_triangles_of_one_winding() {
    assert_eq!(modes(5, None), [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(modes(6, Some((vec![0, 1, 3, 2], 5121, 4))), [[1, 3, 0], [3, 2, 0]]);
}

#[test]
fn indices_of_every_width_are_read() {
    let wanted = [[0, 1, 2], [2, 1, 3]];
    let list: Vec<u32> = wanted.concat();
    let narrow = |f: fn(u32) -> Vec<u8>| list.iter().copied().flat_map(f).collect::<Vec<u8>>();
    assert_eq!(modes(4, Some((narrow(|i| vec![i as u8]), 5121, 6))), wanted);
    assert_eq!(modes(4, Some((narrow(|i| (i as u16).to_le_bytes().into()), 5123, 6))), wanted);
    assert_eq!(modes(4, Some((narrow(|i| i.to_le_bytes().into()), 5125, 6))), wanted);
}

#[test]
fn points_and_lines_are_passed_over() {
    let mut b = triangle();
    let line = b.json["meshes"][0]["primitives"][0].clone();
    for mode in 0..4 {
        let mut line = line.clone();
        line["mode"] = mode.into();
        b.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(line);
    }
    assert_eq!(b.import().unwrap().objects.len(), 1);
}

fn corners(b: &Builder) -> Vec<Vec3> {
    b.import().unwrap().objects[0].mesh.corners().flatten().collect()
}

#[test]
fn nested_transforms_apply_from_the_inside_out() {
    let mut b = triangle();
    let turn = Quat::from_rotation_y(0.7);
    b.json["nodes"][0]["scale"] = json!([2.0, 3.0, 0.5]);
    b.json["nodes"][0]["rotation"] = json!(turn.to_array());
    b.json["nodes"][0]["translation"] = json!([1.0, -2.0, 0.25]);
    let outer = Mat4::from_rotation_translation(Quat::from_rotation_x(-0.4), Vec3::new(0.0, 5.0, 0.0));
    b.node(json!({ "children": [0], "matrix": outer.to_cols_array() }));
    let inner = Mat4::from_scale_rotation_translation(Vec3::new(2.0, 3.0, 0.5), turn, Vec3::new(1.0, -2.0, 0.25));
    for (found, local) in corners(&b).iter().zip(TRIANGLE) {
        assert!((*found - (outer * inner).transform_point3(local.into())).length() < 1e-5);
    }
    let scaled = import_bytes("x", &b.gltf(), None, 0.01).unwrap();
    assert!((scaled.objects[0].mesh.positions[0] - corners(&b)[0] * 0.01).length() < 1e-6);
}

#[test]
fn mirrored_nodes_keep_their_outside() {
    let mut b = triangle();
    b.json["nodes"][0]["scale"] = json!([1, 1, -1]);
    let [a, c, d] = corners(&b)[..] else { panic!() };
    assert!((c - a).cross(d - a).z < 0.0, "the outside, +z, is mirrored to -z");
}

#[test]
fn sparse_values_replace_those_beneath_or_zeros() {
    let mut b = everything();
    b.json["materials"][0]["alphaMode"] = "OPAQUE".into();
    let sparse = b.import().unwrap().objects[0].mesh.bounds().unwrap()[1].y;
    assert!((sparse - 6.0).abs() < 1e-5, "the fourth corner is moved up to 2, scaled by 2, and lifted by 2: {sparse}");
    b = Builder::new();
    let (places, values) = (b.view(&shorts(&[1, 2])), b.view(&floats(&TRIANGLE[1..].concat())));
    b.push("accessors", json!({
        "componentType": 5126, "type": "VEC3", "count": 3,
        "sparse": { "count": 2, "indices": { "bufferView": places, "componentType": 5123 }, "values": { "bufferView": values } },
    }));
    let mesh = b.mesh(json!({ "attributes": { "POSITION": 0 } }));
    b.node(json!({ "mesh": mesh }));
    assert_eq!(corners(&b), TRIANGLE.map(Vec3::from_array));
}

#[test]
fn interleaved_and_quantised_vertices_are_read() {
    let mut b = Builder::new();
    let view = b.view(&[0, 0, 0, 99, 127, 0, 0, 99, 0, 129, 0, 99]);
    b.json["bufferViews"][view]["byteStride"] = 4.into();
    b.push(
        "accessors",
        json!({ "bufferView": view, "componentType": 5120, "normalized": true, "type": "VEC3", "count": 3 }),
    );
    let mesh = b.mesh(json!({ "attributes": { "POSITION": 0 } }));
    b.node(json!({ "mesh": mesh }));
    b.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    assert_eq!(corners(&b), [Vec3::ZERO, Vec3::X, Vec3::NEG_Y]);
}

#[test]
fn materials_are_read_and_a_mask_is_cut_out() {
    let mut b = everything();
    let model = b.import().unwrap();
    let leaf = &model.objects[0];
    assert_eq!((leaf.name.as_str(), leaf.occluder), ("leaf", false));
    assert_eq!(leaf.material.base_color, [0.5, 0.6, 0.7]);
    assert_eq!((leaf.material.metallic, leaf.material.roughness), (1.0, 1.0));
    assert_eq!(leaf.material.emissive, [0.1, 0.2, 0.3]);
    assert_eq!(leaf.material.texture.as_ref().unwrap().texels[3], [10, 200, 10, 255]);
    let area = |m: &aogauge_scenes::gltf::Imported| -> f32 {
        m.objects[0].mesh.corners().map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
    };
    let cut = area(&model);
    assert_eq!(leaf.material.name.as_deref(), Some("leaf"));
    b.json["materials"][0]["alphaMode"] = "BLEND".into();
    assert_eq!(area(&b.import().unwrap()), cut, "what is blended is there where it is half opaque");
    b.json["materials"][0]["alphaMode"] = "OPAQUE".into();
    let whole = area(&b.import().unwrap());
    // Two of four texels are there; what lies under them is not a square any more.
    assert!(cut > 0.4 * whole && cut < 0.6 * whole, "{cut} of {whole}");
    b.json["materials"][0]["extensions"] = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": 10 } });
    assert_eq!(b.import().unwrap().objects[0].material.emissive, [1.0, 2.0, 3.0]);
}

#[test]
fn samplers_say_how_a_texture_goes_on() {
    let mut b = everything();
    b.json["materials"][0]["alphaMode"] = "OPAQUE".into();
    b.json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }, {}]);
    for (sampler, wrap) in [(0, [Wrap::Clamp, Wrap::Mirror]), (1, [Wrap::Repeat; 2])] {
        b.json["textures"][0]["sampler"] = sampler.into();
        assert_eq!(b.import().unwrap().objects[0].material.texture.as_ref().unwrap().wrap, wrap);
    }
}

#[test]
fn textures_of_metal_and_emission_are_read() {
    let mut b = everything();
    b.json["materials"][0]["alphaMode"] = "OPAQUE".into();
    b.json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({ "index": 0 });
    b.json["materials"][0]["emissiveTexture"] = json!({ "index": 0 });
    let material = b.import().unwrap().objects[0].material.clone();
    assert_eq!(material.metallic_roughness_texture, material.texture);
    assert_eq!(material.emissive_texture, material.texture);
    // Laid on by other coordinates than the base colour, they count by their mean.
    let moved = json!({ "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0.0] } } });
    b.json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = moved.clone();
    b.json["materials"][0]["emissiveTexture"] = moved;
    let material = b.import().unwrap().objects[0].material.clone();
    assert_eq!((&material.metallic_roughness_texture, &material.emissive_texture), (&None, &None));
    assert!((material.metallic - 20.0 / 4.0 / 255.0).abs() < 1e-6, "{}", material.metallic);
    assert!((material.roughness - 210.0 / 4.0 / 255.0).abs() < 1e-6);
    // Red is 200 of 255 and 10 of 255 in sRGB: 0.578 and 0.003 in linear light.
    assert!((material.emissive[0] - 0.1 * (0.578 + 0.003) / 4.0).abs() < 1e-4, "{:?}", material.emissive);
}

#[test]
fn texture_coordinates_of_every_kind_and_their_transform_are_read() {
    let uvs = |component: u32, bytes: Vec<u8>| {
        let mut b = everything();
        b.json["materials"][0]["alphaMode"] = "OPAQUE".into();
        let accessor = b.accessor(&bytes, component, "VEC2", 4);
        b.json["accessors"][accessor]["normalized"] = (component != 5126).into();
        b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = accessor.into();
        b
    };
    let unit = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
    let read = |b: &Builder| -> Vec<f32> {
        b.import().unwrap().objects[0].mesh.uvs.iter().flat_map(glam::Vec2::to_array).collect()
    };
    let mut float = uvs(5126, floats(&unit));
    assert_eq!(read(&float), unit);
    assert_eq!(read(&uvs(5123, shorts(&unit.map(|v| v as u16 * 65535)))), unit);
    assert_eq!(read(&uvs(5121, unit.map(|v| v as u8 * 255).to_vec())), unit);
    float.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
        json!({ "KHR_texture_transform": { "offset": [0.0, 1.0], "rotation": std::f32::consts::FRAC_PI_2 } });
    // The extension's own example: a quarter turn about (0, 1).
    let turned = read(&float);
    for (found, wanted) in turned.iter().zip([0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0]) {
        assert!((found - wanted).abs() < 1e-6, "{turned:?}");
    }
}

#[test]
fn cameras_and_lights_stand_where_their_nodes_are() {
    let model = everything().import().unwrap();
    let turn = Quat::from_xyzw(0.0, 0.6, 0.0, 0.8);
    let (camera, light) = (&model.cameras[0], &model.lights[0]);
    assert_eq!(camera.name, "eye");
    assert_eq!(camera.position, Vec3::new(1.0, 2.0, 3.0));
    assert!((camera.forward - turn * Vec3::NEG_Z).length() < 1e-6 && (camera.up - Vec3::Y).length() < 1e-6);
    assert_eq!(camera.projection, Projection::Perspective { fov_y: 0.8, aspect: None, near: 0.1, far: None });
    assert!((light.direction - camera.forward).length() < 1e-6);
    assert_eq!((light.intensity, light.range, light.color), (5.0, Some(3.0), [1.0; 3]));
    assert_eq!(light.kind, LightKind::Spot { inner: 0.0, outer: std::f32::consts::FRAC_PI_4 });
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let mut b = Builder::new();
    let positions = b.positions(&SQUARE);
    let indices = b.accessor(&[0, 1, 2, 0, 0, 1, 3, 3, 3], 5121, "SCALAR", 9);
    let mesh = b.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
    b.node(json!({ "mesh": mesh }));
    let model = b.import().unwrap();
    assert_eq!((model.degenerate, model.objects[0].mesh.triangles.len()), (2, 1));
}

#[test]
fn files_beside_it_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let mut b = everything();
    b.json["buffers"] = json!([{ "byteLength": b.bin.len(), "uri": "my%20data.bin" }]);
    b.json["images"][0] = json!({ "uri": "leaf.png" });
    std::fs::write(folder.path().join("my data.bin"), &b.bin).unwrap();
    std::fs::write(folder.path().join("leaf.png"), png()).unwrap();
    std::fs::write(folder.path().join("model.gltf"), b.gltf()).unwrap();
    let outside = aogauge_scenes::gltf::import(&folder.path().join("model.gltf"), 1.0).unwrap();
    assert_eq!(outside, everything().import().unwrap());
    assert_eq!(outside, import_bytes("x.glb", &everything().glb(), None, 1.0).unwrap());
}

const SCENE: &str = r#"
description = "A model."
ao = { radius = 0.25 }
environment = { radiance = 1.0 }
measure = { center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.1, resolution = [96, 64] }
look = { eye = [1, 1, 1], target = [0, 0, 0], resolution = [96, 64] }
"#;

fn scene(table: &str) -> Result<Scene, String> {
    scene_of(&everything(), &format!("{SCENE}{table}"))
}

fn scene_of(model: &Builder, text: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("model.glb"), model.glb()).unwrap();
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, text).unwrap();
    Scene::from_file(&file).map_err(|e| e.to_string())
}

#[test]
fn a_light_of_the_model_is_light_enough() {
    let text = format!("{}[gltf]\nfile = 'model.glb'\n", SCENE.replace("environment = { radiance = 1.0 }\n", ""));
    let mut b = everything();
    b.json["materials"][0]["emissiveFactor"] = json!([0, 0, 0]);
    let lit = scene_of(&b, &text).unwrap();
    assert_eq!((lit.lights.len(), lit.environment.sky), (1, aogauge_scenes::Sky::None));
    b.json["extensions"]["KHR_lights_punctual"]["lights"][0]["intensity"] = json!(0);
    let message = scene_of(&b, &text).unwrap_err();
    assert!(message.contains("no light") && message.contains("a model with lights"), "{message}");
}

#[test]
fn a_scene_file_may_name_a_model() {
    let floor =
        "[[object]]\nname = 'floor'\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 4], v = [4, 0, 0] } }\n";
    for pattern in ["leaf", "l?af", "root", "mes*"] {
        let scene =
            scene(&format!("[gltf]\nfile = 'model.glb'\noccluders = ['{pattern}']\nscale = 0.5\n{floor}")).unwrap();
        let flags: Vec<(&str, bool)> = scene.objects.iter().map(|o| (o.name.as_str(), o.occluder)).collect();
        assert_eq!(flags, [("floor", false), ("leaf", true)], "{pattern}");
        assert_eq!((scene.lights.len(), scene.cameras[0].position), (1, Vec3::new(0.5, 1.0, 1.5)));
    }
    let alone = scene("[gltf]\nfile = 'model.glb'\n").unwrap();
    assert_eq!(alone.objects.len(), 1);
    let mut moved = alone.clone();
    moved.lights[0].intensity = 6.0;
    assert_ne!(moved.hash(), alone.hash(), "a light counts");
}

#[test]
fn a_scene_file_that_names_a_model_wrongly_is_told_so() {
    for (table, wanted) in [
        (
            "[gltf]\nfile = 'model.glb'\noccluders = ['curtain_*']\n",
            "'curtain_*'; there are, for example: 'root', 'leaf', 'mesh'",
        ),
        ("[gltf]\nfile = 'other.glb'\n", "other.glb: cannot read the glTF file"),
        ("[gltf]\nfile = 'model.glb'\nscale = 0\n", "out of range"),
        ("[gltf]\nfile = 'model.glb'\noccluders = ['leaf']\n", "no receiver"),
        ("", "no receiver"),
        (
            "[gltf]\nfile = 'model.glb'\n[[object]]\nname = 'leaf'\nshape = { plane = { center = [0, 0, 0], u = [0, 0, 4], v = [4, 0, 0] } }\n",
            "both called 'leaf'",
        ),
    ] {
        let message = scene(table).unwrap_err();
        assert!(message.contains(wanted), "{table}: {message}");
    }
    let message =
        Scene::from_toml("x", "x.toml", &format!("{SCENE}[gltf]\nfile = 'a.glb'"), None).unwrap_err().to_string();
    assert!(message.contains("no folder"), "{message}");
}

#[test]
fn an_occluder_may_be_marked_in_extras() {
    let mut b = triangle();
    for (extras, wanted) in [
        (json!({ "aogauge": { "occluder": true } }), true),
        (json!({ "aogauge": { "occluder": false } }), false),
        (json!({ "aogauge": 3 }), false),
        (json!("text"), false),
        (Value::Null, false),
    ] {
        b.json["nodes"][0]["extras"] = extras;
        assert_eq!(b.import().unwrap().objects[0].occluder, wanted);
    }
}

#[test]
fn jpeg_textures_are_decoded() {
    let mut b = everything();
    let mut jpeg = Vec::new();
    let pixels = [128_u8; 8 * 8 * 3];
    image::codecs::jpeg::JpegEncoder::new(&mut jpeg).encode(&pixels, 8, 8, image::ExtendedColorType::Rgb8).unwrap();
    let view = b.view(&jpeg);
    b.json["images"][0] = json!({ "bufferView": view, "mimeType": "image/jpeg" });
    let model = b.import().unwrap();
    let texture = model.objects[0].material.texture.as_ref().unwrap();
    assert_eq!(texture.size, [8, 8]);
    assert!(texture.texels.iter().all(|t| t[3] == 255 && t[0].abs_diff(128) < 3));
}

/// A receiver, and a mesh `cloth` of which nothing is left.
fn with_cloth(change: impl Fn(&mut Builder)) -> Builder {
    let mut b = triangle();
    let positions = b.positions(&SQUARE);
    let cloth = json!({ "name": "cloth", "primitives": [{ "attributes": { "POSITION": positions }, "mode": 5 }] });
    let mesh = b.push("meshes", cloth);
    b.node(json!({ "name": "hanging", "mesh": mesh }));
    change(&mut b);
    b
}

#[test]
fn what_has_no_triangles_left_is_told_of() {
    let flat = with_cloth(|b| b.json["nodes"][1]["scale"] = json!([0, 0, 0]));
    let clear = with_cloth(|b| {
        let color = json!({ "baseColorFactor": [1, 1, 1, 0.1] });
        b.push("materials", json!({ "name": "silk", "alphaMode": "MASK", "pbrMetallicRoughness": color }));
        b.json["meshes"][1]["primitives"][0]["material"] = json!(0);
    });
    let lines = with_cloth(|b| b.json["meshes"][1]["primitives"][0]["mode"] = json!(1));
    let left = "mesh 1 'cloth' has no triangles left (2 were cut away or degenerate)";
    for (model, pattern, told) in [
        (&flat, "cloth", left),
        (&flat, "hang*", left),
        (&clear, "silk", left),
        (&lines, "cloth", "mesh 1 'cloth' has only points or lines"),
    ] {
        let told = &format!("no node, mesh or material has a name like '{pattern}' and triangles; {told}");
        let mut read = model.import().unwrap();
        assert_eq!(&read.mark_occluders(&[pattern]).unwrap_err(), told);
        assert!(read.mark_occluders(&["curtain"]).unwrap_err().contains("there are, for example: 'node'"));
    }
    let text = format!("{SCENE}[gltf]\nfile = 'model.glb'\noccluders = ['node']\n");
    let message = scene_of(&flat, &text).unwrap_err();
    assert!(message.contains("no receiver") && message.ends_with(left), "{message}");
    let all =
        with_cloth(|b| b.json["nodes"].as_array_mut().unwrap().iter_mut().for_each(|n| n["scale"] = json!([0, 0, 0])));
    let message = all.import().unwrap_err().to_string();
    assert!(message.contains("it has no triangles; mesh 0 'mesh' has no triangles left (1 was"), "{message}");
}

#[test]
fn cameras_of_one_name_are_ambiguous() {
    let mut b = everything();
    b.node(json!({ "name": "eye", "camera": 0 }));
    let floor = "[gltf]\nfile = 'model.glb'\n";
    let text = SCENE.replace("eye = [1, 1, 1], target = [0, 0, 0]", "camera = 'eye'") + floor;
    let message = scene_of(&b, &text).unwrap_err();
    assert!(message.contains("look.camera is 'eye', but 2 cameras of the model have this name"), "{message}");
    assert!(scene_of(&everything(), &text).is_ok());
}
