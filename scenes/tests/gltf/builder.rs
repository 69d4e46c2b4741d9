//! Small glTF files for tests, put together by hand.
#![allow(clippy::unwrap_used, clippy::needless_pass_by_value, reason = "short calls count for more in tests")]
#![allow(dead_code, reason = "every test file uses its own part")]

use aogauge_scenes::{
    Camera, Light, LightKind, Material, Projection, Scene, Texture, Wrap,
    gltf::{GltfError, Imported, import_bytes},
    library,
};
use base64::{Engine, engine::general_purpose::STANDARD};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};
use std::sync::Arc;

/// A glTF document that grows a buffer.
pub struct Builder {
    pub json: Value,
    pub bin: Vec<u8>,
}

pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

pub fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

impl Builder {
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" }, "nodes": [], "meshes": [], "accessors": [], "bufferViews": [],
        });
        Builder { json, bin: Vec::new() }
    }

    pub fn push(&mut self, list: &str, value: Value) -> usize {
        let list = &mut self.json[list];
        if list.is_null() {
            *list = json!([]);
        }
        let list = list.as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let start = self.bin.len();
        self.bin.extend(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() }))
    }

    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }))
    }

    pub fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        self.accessor(&floats(positions.as_flattened()), 5126, "VEC3", positions.len())
    }

    pub fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({ "name": "mesh", "primitives": [primitive] }))
    }

    pub fn node(&mut self, node: Value) -> usize {
        self.push("nodes", node)
    }

    /// The JSON with its buffer as a data URI.
    pub fn gltf(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        if json["buffers"].is_null() {
            let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.bin));
            json["buffers"] = json!([{ "byteLength": self.bin.len(), "uri": uri }]);
        }
        serde_json::to_vec_pretty(&json).unwrap()
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bin.len() }]);
        glb(&serde_json::to_vec(&json).unwrap(), &self.bin)
    }

    pub fn import(&self) -> Result<Imported, GltfError> {
        import_bytes("test.gltf", &self.gltf(), None, 1.0)
    }
}

pub fn glb(json: &[u8], bin: &[u8]) -> Vec<u8> {
    let pad = |b: &[u8], with: u8| {
        let mut b = b.to_vec();
        b.resize(b.len().next_multiple_of(4), with);
        b
    };
    let (json, bin) = (pad(json, b' '), pad(bin, 0));
    let mut out = b"glTF".to_vec();
    for word in [2, 28 + json.len() + bin.len(), json.len()] {
        out.extend((word as u32).to_le_bytes());
    }
    out.extend(b"JSON");
    out.extend(&json);
    out.extend((bin.len() as u32).to_le_bytes());
    out.extend(b"BIN\0");
    out.extend(&bin);
    out
}

pub const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// One node with one triangle.
pub fn triangle() -> Builder {
    let mut b = Builder::new();
    let positions = b.positions(&TRIANGLE);
    let mesh = b.mesh(json!({ "attributes": { "POSITION": positions } }));
    b.node(json!({ "name": "node", "mesh": mesh }));
    b
}

/// A PNG of 2 x 2 texels: opaque, clear, clear, opaque.
pub fn png() -> Vec<u8> {
    use image::ImageEncoder;
    let texels = [[200, 10, 10, 255], [0; 4], [0; 4], [10, 200, 10, 255]];
    let mut out = Vec::new();
    image::codecs::png::PngEncoder::new(&mut out)
        .write_image(texels.as_flattened(), 2, 2, image::ExtendedColorType::Rgba8)
        .unwrap();
    out
}

/// A file with something of everything: indices, a mask, a sparse accessor, a
/// camera, a light, nested nodes.
pub fn everything() -> Builder {
    let mut b = Builder::new();
    let positions = b.positions(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    let uvs = b.accessor(&[0, 0, 255, 0, 255, 255, 0, 255], 5121, "VEC2", 4);
    b.json["accessors"][uvs]["normalized"] = json!(true);
    let indices = b.accessor(&shorts(&[0, 1, 2, 0, 2, 3]), 5123, "SCALAR", 6);
    let (places, values) = (b.view(&[3]), b.view(&floats(&[0.0, 2.0, 0.0])));
    b.json["accessors"][positions]["sparse"] = json!({
        "count": 1, "indices": { "bufferView": places, "componentType": 5121 }, "values": { "bufferView": values },
    });
    let image = b.view(&png());
    b.push("images", json!({ "bufferView": image, "mimeType": "image/png" }));
    b.push("textures", json!({ "source": 0 }));
    let material = b.push(
        "materials",
        json!({
            "name": "leaf", "alphaMode": "MASK", "emissiveFactor": [0.1, 0.2, 0.3],
            "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 }, "baseColorFactor": [0.5, 0.6, 0.7, 1.0] },
        }),
    );
    let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
    let mesh = b.mesh(json!({ "attributes": attributes, "indices": indices, "material": material }));
    b.push("cameras", json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }));
    b.json["extensions"] =
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "intensity": 5.0, "range": 3.0 }] } });
    b.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    b.node(json!({ "name": "root", "children": [1, 2], "translation": [1, 2, 3], "rotation": [0, 0.6, 0, 0.8] }));
    b.node(json!({ "name": "leaf", "mesh": mesh, "scale": [1, 2, 1] }));
    b.node(json!({ "name": "eye", "camera": 0, "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    b
}

/// A scene with all that generated ones lack.
pub fn rich() -> Scene {
    let mut scene = library::scene("curtain-open").unwrap();
    let texture = |seed: u8, wrap| {
        let texels = (0..6).map(|i| [i * 40 + seed, 255 - i, 7, 100 + i]).collect();
        Some(Arc::new(Texture { size: [3, 2], wrap, texels }))
    };
    let ground = &mut scene.objects[0];
    ground.mesh.uvs = ground.mesh.positions.iter().map(|p| Vec2::new(p.x * 0.37, p.z)).collect();
    ground.material = Material {
        name: Some("ground".into()),
        base_color: [0.1, 0.2, 0.3],
        texture: texture(0, [Wrap::Clamp, Wrap::Mirror]),
        metallic: 0.25,
        roughness: 0.75,
        metallic_roughness_texture: texture(1, [Wrap::Repeat; 2]),
        emissive: [0.5, 12.3, 3.1],
        emissive_texture: texture(2, [Wrap::Repeat, Wrap::Clamp]),
    };
    scene.objects[1].material.name = Some("red cloth".into());
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
