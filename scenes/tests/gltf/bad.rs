//! Broken and hostile files end in one sentence that names the trouble.
//!
//! The corpus lies in `bad-gltf/`, so that other tools and the fuzzer can use it
//! too; `AOGAUGE_WRITE_CORPUS=1 cargo test` writes it again.

use crate::builder::{Builder, everything, floats, glb, triangle};
use aogauge_scenes::gltf::{import, import_bytes};
use serde_json::json;
use std::path::PathBuf;

/// File name, contents, and what the message must say.
type Bad = (&'static str, Vec<u8>, &'static str);

fn changed(mut b: Builder, change: impl FnOnce(&mut Builder)) -> Vec<u8> {
    change(&mut b);
    b.gltf()
}

fn containers() -> Vec<Bad> {
    let good = everything().glb();
    let patched = |at: usize, word: u32| {
        let mut glb = good.clone();
        glb[at..at + 4].copy_from_slice(&word.to_le_bytes());
        glb
    };
    let json_length = u32::from_le_bytes(good[12..16].try_into().unwrap());
    let short = |n: usize| {
        let mut glb = good[..n].to_vec();
        glb[8..12].copy_from_slice(&(n as u32).to_le_bytes());
        glb
    };
    vec![
        ("empty.glb", Vec::new(), "its JSON does not read"),
        ("only-magic.glb", b"glTF".to_vec(), "ends within the GLB header"),
        ("header-only.glb", short(12), "without a JSON chunk"),
        ("version-1.glb", patched(4, 1), "GLB version 1"),
        ("length-too-long.glb", patched(8, u32::MAX), "says 4294967295 bytes"),
        ("cut-in-half.glb", good[..good.len() / 2].to_vec(), "but the file has"),
        ("cut-and-resealed.glb", short(good.len() - 20), "GLB chunk 1 says"),
        ("json-chunk-too-long.glb", patched(12, u32::MAX), "GLB chunk 0 says 4294967295 bytes"),
        ("json-chunk-too-short.glb", patched(12, 20), "GLB chunk 1 says"),
        ("first-chunk-not-json.glb", patched(16, 0x004E_4942), "first GLB chunk is not JSON"),
        ("bin-chunk-too-long.glb", patched(20 + json_length as usize, 1 << 30), "GLB chunk 1 says 1073741824 bytes"),
        ("chunk-header-cut.glb", short(20 + json_length as usize + 3), "ends within the header of GLB chunk 1"),
        (
            "no-bin.glb",
            glb(b"{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":4}]}", &[]),
            "only 0 are there",
        ),
        ("not-json.gltf", b"{ \"asset\": ".to_vec(), "its JSON does not read"),
        ("deep-json.gltf", [b"{\"extras\":".to_vec(), vec![b'['; 100_000]].concat(), "its JSON does not read"),
        ("version-1.gltf", b"{\"asset\":{\"version\":\"1.0\"}}".to_vec(), "glTF version '1.0'"),
        ("nothing-in-it.gltf", b"{\"asset\":{\"version\":\"2.0\"}}".to_vec(), "no triangles"),
        (
            "compressed.gltf",
            b"{\"asset\":{\"version\":\"2.0\"},\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]}".to_vec(),
            "'KHR_draco_mesh_compression', which is not read",
        ),
    ]
}

fn buffers() -> Vec<Bad> {
    let buffer = |uri: &str| changed(triangle(), |b| b.json["buffers"] = json!([{ "byteLength": 36, "uri": uri }]));
    let view = |key: &str, value: u64| changed(triangle(), |b| b.json["bufferViews"][0][key] = value.into());
    vec![
        ("buffer-missing.gltf", buffer("not-there.bin"), "'not-there.bin', which cannot be read"),
        ("buffer-parent.gltf", buffer("../secret.bin"), "buffer 0 names '../secret.bin'"),
        ("buffer-parent-encoded.gltf", buffer("a/%2e%2e/%2e%2e/secret.bin"), "'..'"),
        ("buffer-absolute.gltf", buffer("/etc/passwd"), "only relative paths"),
        ("buffer-windows.gltf", buffer("C:\\secret.bin"), "only relative paths"),
        ("buffer-backslash.gltf", buffer("..\\secret.bin"), "forward slashes"),
        ("buffer-http.gltf", buffer("http://example.com/a.bin"), "only relative paths and data URIs"),
        ("buffer-folder.gltf", buffer("."), "cannot be read"),
        ("buffer-data-broken.gltf", buffer("data:;base64,@@@"), "not base64"),
        ("buffer-data-plain.gltf", buffer("data:text/plain,hello"), "not base64"),
        ("buffer-short.gltf", buffer("data:;base64,AAAA"), "buffer 0 says 36 bytes, but only 3 are there"),
        (
            "buffer-4gb.gltf",
            changed(triangle(), |b| {
                b.json["buffers"] = json!([{ "byteLength": 1_u64 << 32, "uri": "data:;base64,AAAA" }]);
            }),
            "says 4294967296 bytes",
        ),
        (
            "buffer-without-uri.gltf",
            changed(triangle(), |b| b.json["buffers"] = json!([{ "byteLength": 36 }])),
            "buffer 0 has no uri",
        ),
        ("view-of-no-buffer.gltf", view("buffer", 7), "bufferView 0 names buffer 7"),
        ("view-too-long.gltf", view("byteLength", 37), "bufferView 0 takes 37 bytes"),
        ("view-far-out.gltf", view("byteOffset", u64::MAX), "bufferView 0 takes 36 bytes"),
        ("stride-too-small.gltf", view("byteStride", 8), "byteStride of 8"),
        ("stride-zero.gltf", view("byteStride", 0), "byteStride of 0"),
        ("stride-huge.gltf", view("byteStride", u64::MAX), "accessor 0 says 3 elements"),
    ]
}

fn accessors() -> Vec<Bad> {
    let accessor = |key: &str, value: serde_json::Value| changed(triangle(), |b| b.json["accessors"][0][key] = value);
    let indices = |list: &[u8]| {
        changed(triangle(), |b| {
            let a = b.accessor(list, 5121, "SCALAR", list.len());
            b.json["meshes"][0]["primitives"][0]["indices"] = a.into();
        })
    };
    let position = |v: f32| changed(triangle(), |b| b.bin[16..20].copy_from_slice(&v.to_le_bytes()));
    vec![
        ("count-4g.gltf", accessor("count", json!(u32::MAX)), "accessor 0 says 4294967295 elements of 12 bytes"),
        ("count-huge.gltf", accessor("count", json!(u64::MAX)), "accessor 0 says 18446744073709551615 elements"),
        ("count-zero.gltf", accessor("count", json!(0)), "accessor 0 has no elements"),
        ("count-negative.gltf", accessor("count", json!(-1)), "its JSON does not read"),
        ("offset-huge.gltf", accessor("byteOffset", json!(u64::MAX)), "accessor 0 says 3 elements"),
        ("offset-out.gltf", accessor("byteOffset", json!(4)), "from 4 on"),
        ("component-unknown.gltf", accessor("componentType", json!(5124)), "unknown componentType 5124"),
        ("component-integer.gltf", accessor("componentType", json!(5125)), "32-bit integers"),
        ("type-wrong.gltf", accessor("type", json!("MAT4")), "is of type 'MAT4', but must be VEC3"),
        ("view-missing.gltf", accessor("bufferView", json!(9)), "accessor 0 names bufferView 9"),
        ("accessor-without-view.gltf", accessor("bufferView", json!(null)), "neither a bufferView nor sparse"),
        ("index-out-of-range.gltf", indices(&[0, 1, 3]), "names vertex 3"),
        ("index-count.gltf", indices(&[0, 1, 2, 0]), "4 indices do not make whole triangles"),
        ("position-nan.gltf", position(f32::NAN), "vertex 1"),
        ("position-infinite.gltf", position(f32::NEG_INFINITY), "coordinates must be finite"),
    ]
}

fn sparse() -> Vec<Bad> {
    let sparse = |count: u64, place: u8| {
        changed(triangle(), |b| {
            let (places, values) = (b.view(&[place]), b.view(&floats(&[1.0; 3])));
            b.json["accessors"][0]["sparse"] = json!({
                "count": count, "indices": { "bufferView": places, "componentType": 5121 }, "values": { "bufferView": values },
            });
        })
    };
    let unbacked = |count: u64| {
        changed(triangle(), |b| {
            let (places, values) = (b.view(&[0]), b.view(&floats(&[1.0; 3])));
            b.json["accessors"][0] = json!({
                "componentType": 5126, "type": "VEC3", "count": count, "sparse": {
                    "count": 1, "indices": { "bufferView": places, "componentType": 5121 }, "values": { "bufferView": values },
                },
            });
        })
    };
    vec![
        ("unbacked-4g.gltf", unbacked(u64::from(u32::MAX)), "4294967295 elements without a bufferView"),
        ("sparse-count.gltf", sparse(1 << 40, 0), "the sparse part of accessor 0 says 1099511627776"),
        ("sparse-place.gltf", sparse(1, 3), "names element 3, but there are only 3"),
    ]
}

fn nodes() -> Vec<Bad> {
    let node = |key: &str, value: serde_json::Value| changed(triangle(), |b| b.json["nodes"][0][key] = value);
    let primitive = |key: &str, value: serde_json::Value| {
        changed(triangle(), |b| b.json["meshes"][0]["primitives"][0][key] = value)
    };
    vec![
        ("node-own-child.gltf", node("children", json!([0])), "node 0 'node' is its own ancestor"),
        (
            "node-circle.gltf",
            changed(triangle(), |b| {
                b.node(json!({ "children": [2] }));
                b.node(json!({ "children": [1] }));
            }),
            "node 1 is its own ancestor",
        ),
        (
            "node-two-parents.gltf",
            changed(triangle(), |b| {
                b.node(json!({ "children": [0] }));
                b.node(json!({ "children": [0] }));
            }),
            "node 0 'node' is a child of node 1 and of node 2",
        ),
        (
            "node-deep.gltf",
            changed(triangle(), |b| {
                for i in 0..300 {
                    b.node(json!({ "children": [i] }));
                }
            }),
            "nested more than 128 deep",
        ),
        ("node-child-missing.gltf", node("children", json!([5])), "node 0 'node' names child node 5"),
        ("node-mesh-missing.gltf", node("mesh", json!(5)), "names mesh 5, but there are only 1"),
        ("node-camera-missing.gltf", node("camera", json!(0)), "names camera 0, but there are none"),
        (
            "node-matrix-and-scale.gltf",
            changed(triangle(), |b| {
                b.json["nodes"][0]["matrix"] = json!(glam::Mat4::IDENTITY.to_cols_array());
                b.json["nodes"][0]["scale"] = json!([1, 1, 1]);
            }),
            "a matrix and also",
        ),
        ("node-matrix-projective.gltf", node("matrix", json!(vec![1.0; 16])), "end in the row 0 0 0 1"),
        ("node-rotation-zero.gltf", node("rotation", json!([0, 0, 0, 0])), "no quaternion"),
        ("node-scale-infinite.gltf", node("scale", json!([1e39, 1, 1])), "number out of range"),
        ("node-scale-overflow.gltf", node("scale", json!([1e38, 1, 1])), "no triangles"),
        ("scene-missing.gltf", changed(triangle(), |b| b.json["scene"] = 3.into()), "names scene 3"),
        (
            "scene-root-child.gltf",
            changed(triangle(), |b| {
                b.node(json!({ "children": [0] }));
                b.json["scenes"] = json!([{ "nodes": [0] }]);
            }),
            "a root of the scene and also a child",
        ),
        ("mode-unknown.gltf", primitive("mode", json!(7)), "mode is 7"),
        ("position-missing.gltf", primitive("attributes", json!({})), "mesh 0 'mesh' has no attribute POSITION"),
        ("position-accessor-missing.gltf", primitive("attributes", json!({ "POSITION": 4 })), "names accessor 4"),
        ("material-missing.gltf", primitive("material", json!(2)), "names material 2"),
    ]
}

/// With one value replaced.
fn bad(path: &str, value: serde_json::Value) -> Vec<u8> {
    changed(everything(), |b| *b.json.pointer_mut(path).unwrap() = value)
}

fn cameras_and_lights() -> Vec<Bad> {
    vec![
        ("camera-flat.gltf", bad("/cameras/0/perspective/yfov", json!(0)), "camera 0: its yfov is 0"),
        (
            "camera-view.gltf",
            changed(everything(), |b| {
                b.json["cameras"][0]["extras"] = json!({ "aogauge": { "look": { "eye": [0, 0, 0], "target": [0, 0, 1],
                    "resolution": [4294967295_u32, 4294967295_u32] } } });
            }),
            "camera 0 holds the look view in its extras, but resolution[0]: 4294967295 is out of range",
        ),
        ("camera-of-no-kind.gltf", bad("/cameras/0", json!({})), "either perspective or orthographic"),
        ("light-missing.gltf", bad("/nodes/2/extensions/KHR_lights_punctual/light", json!(9)), "names light 9"),
        ("light-kind.gltf", bad("/extensions/KHR_lights_punctual/lights/0/type", json!("area")), "its type is 'area'"),
        ("light-dark.gltf", bad("/extensions/KHR_lights_punctual/lights/0/intensity", json!(-1)), "must be 0 or more"),
        (
            "light-cone.gltf",
            bad(
                "/extensions/KHR_lights_punctual/lights/0",
                json!({ "type": "spot", "spot": { "innerConeAngle": 1.0 } }),
            ),
            "cone angles",
        ),
    ]
}

fn materials() -> Vec<Bad> {
    let mut bomb = crate::builder::png();
    // The size stands in the header, with a checksum after it.
    bomb[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let crc = crc32(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&crc.to_be_bytes());
    let image = |bytes: &[u8]| {
        changed(everything(), |b| {
            let view = b.view(bytes);
            b.json["images"][0]["bufferView"] = view.into();
        })
    };
    let colour = "/materials/0/pbrMetallicRoughness/baseColorFactor";
    vec![
        ("colour-above-one.gltf", bad(colour, json!([2, 1, 1, 1])), "material 0 'leaf': its baseColorFactor holds 2"),
        ("colour-short.gltf", bad(colour, json!([1, 1])), "its JSON does not read"),
        ("emission-negative.gltf", bad("/materials/0/emissiveFactor", json!([-1, 0, 0])), "emissiveFactor holds -1"),
        ("alpha-mode.gltf", bad("/materials/0/alphaMode", json!("CUT")), "its JSON does not read"),
        (
            "texture-missing.gltf",
            bad("/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 3 })),
            "names texture 3",
        ),
        ("texture-sourceless.gltf", bad("/textures/0", json!({})), "texture 0 has no PNG or JPEG source"),
        (
            "sampler-missing.gltf",
            bad("/textures/0", json!({ "source": 0, "sampler": 0 })),
            "texture 0 names sampler 0, but there are none",
        ),
        (
            "sampler-wrap.gltf",
            changed(everything(), |b| {
                b.json["samplers"] = json!([{ "wrapT": 5 }]);
                b.json["textures"][0]["sampler"] = json!(0);
            }),
            "sampler 0: its wrapT is 5: 10497, 33071, 33648 are known",
        ),
        (
            "emissive-texture-missing.gltf",
            changed(everything(), |b| b.json["materials"][0]["emissiveTexture"] = json!({ "index": 7 })),
            "its emissiveTexture names texture 7",
        ),
        ("image-missing.gltf", bad("/images/0", json!({ "uri": "no.png" })), "image 0 names 'no.png'"),
        ("image-parent.gltf", bad("/images/0", json!({ "uri": "../no.png" })), "image 0 names '../no.png'"),
        ("image-nowhere.gltf", bad("/images/0", json!({})), "image 0 must have a uri or a bufferView"),
        ("image-no-picture.gltf", image(b"GIF89a not a picture"), "image 0: it is neither PNG nor JPEG"),
        ("image-cut.gltf", image(&crate::builder::png()[..40]), "image 0: it does not decode"),
        ("image-bomb.gltf", image(&bomb), "image 0: it claims 16384 x 16384 texels"),
        (
            "coordinates-missing.gltf",
            bad("/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": 0, "texCoord": 1 })),
            "no attribute TEXCOORD_1",
        ),
        ("coordinates-few.gltf", bad("/accessors/1/count", json!(2)), "2 texture coordinates for 4 vertices"),
        (
            "coordinates-nan.gltf",
            changed(everything(), |b| {
                let uvs = b.accessor(&floats(&[f32::NAN; 8]), 5126, "VEC2", 4);
                b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uvs.into();
            }),
            "texture coordinate 0 is not a finite number",
        ),
    ]
}

/// The checksum of PNG, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    })
}

fn corpus() -> Vec<Bad> {
    [containers(), buffers(), accessors(), sparse(), nodes(), materials(), cameras_and_lights()].concat()
}

fn folder() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/bad-gltf"))
}

#[test]
fn every_bad_file_is_refused_in_one_sentence() {
    let mut wrong = Vec::new();
    for (name, bytes, wanted) in corpus() {
        let path = folder().join(name);
        if std::env::var_os("AOGAUGE_WRITE_CORPUS").is_some() {
            std::fs::write(&path, &bytes).unwrap();
        }
        assert!(std::fs::read(&path).is_ok_and(|b| b == bytes), "{name} is not as this test makes it: write it again");
        match import(&path, 1.0) {
            Err(e) => {
                let message = e.to_string();
                let one_sentence = !message.contains('\n') && message.len() < 500;
                if !(message.contains(wanted) && message.contains(name) && one_sentence) {
                    wrong.push(format!("{name}: wanted '{wanted}': {message}"));
                }
            }
            Ok(_) => wrong.push(format!("{name} was read")),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_corpus_holds_nothing_else() {
    let known: Vec<&str> = corpus().iter().map(|b| b.0).collect();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(known.contains(&name.as_str()), "{name}");
    }
}

/// Reading may fail, but must not panic, and says in one line why it failed.
fn survives(bytes: &[u8]) -> bool {
    match import_bytes("mutant.glb", bytes, None, 1.0) {
        Ok(model) => {
            model.objects.iter().for_each(|o| o.mesh.validate().unwrap());
            true
        }
        Err(e) => {
            let message = e.to_string();
            assert!(message.starts_with("mutant.glb: ") && !message.contains('\n'), "{message}");
            false
        }
    }
}

#[test]
fn no_change_of_one_byte_makes_it_panic() {
    let good = everything().glb();
    assert!(survives(&good));
    let (mut read, mut refused) = (0, 0);
    for at in 0..good.len() {
        let mut mutant = good.clone();
        for value in [good[at] ^ 1, good[at] ^ 0x80, good[at].wrapping_add(1), 0, 0xFF, b'9', b'-', b'"'] {
            mutant[at] = value;
            if survives(&mutant) { read += 1 } else { refused += 1 }
        }
    }
    assert!(read > 1000 && refused > 1000, "{read} read, {refused} refused");
}

#[test]
fn no_cut_makes_it_panic() {
    let good = everything();
    for end in 0..good.glb().len() {
        assert!(!survives(&good.glb()[..end]), "{end}");
    }
    for end in 0..good.bin.len() {
        survives(&glb(&serde_json::to_vec(&good.json).unwrap(), &good.bin[..end]));
    }
}

#[test]
fn no_change_of_several_bytes_makes_it_panic() {
    let good = everything().glb();
    // A generator of Knuth's; the sequence is the same on every run.
    let mut state = 1_u64;
    let mut random = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..20_000 {
        let mut mutant = good.clone();
        for _ in 0..2 + random(6) {
            let at = random(good.len());
            mutant[at] = random(256) as u8;
        }
        survives(&mutant);
    }
}
