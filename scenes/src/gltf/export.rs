//! A scene as GLB: one node an object, cameras for the two views, lights.

use super::{GltfError, container, export_views, texture};
use crate::{Material, Object, Scene, Texture, Wrap};
use serde_json::{Map, Value, json};
use std::{io::Write, sync::Arc};

/// Kinds of buffer views in glTF's numbers.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;

/// Writes a scene as GLB 2.0.
///
/// Every object is a node of its own, in world space; occluders carry
/// `{"aogauge":{"occluder":true}}` in their extras. The measure view is the
/// orthographic camera `measure`, the look view the perspective camera `look`;
/// both hold their numbers in `extras.aogauge`, as a scene file would.
/// The environment, which glTF does not know, is left out.
///
/// # Errors
/// [`GltfError::Export`] for what glTF cannot say, [`GltfError::Write`] where
/// `out` does not take the bytes.
///
/// # Example
/// ```
/// let scene = aogauge_scenes::library::scene("curtain-open")?;
/// let mut glb = Vec::new();
/// aogauge_scenes::gltf::write_glb(&scene, &mut glb)?;
/// let back = aogauge_scenes::gltf::import_bytes("curtain-open.glb", &glb, None, 1.0)?;
/// assert_eq!(back.objects, scene.objects);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_glb(scene: &Scene, mut out: impl Write) -> Result<(), GltfError> {
    let glb = pack(scene).map_err(|message| GltfError::Export { scene: scene.name.clone(), message })?;
    out.write_all(&glb)
        .and_then(|()| out.flush())
        .map_err(|source| GltfError::Write { scene: scene.name.clone(), source })
}

fn pack(scene: &Scene) -> Result<Vec<u8>, String> {
    let mut writer = Writer::default();
    for object in &scene.objects {
        writer.object(object).map_err(|e| format!("object '{}': {e}", object.name))?;
    }
    let lights = export_views::lights(&scene.lights);
    let (cameras, views) = export_views::nodes(scene);
    writer.nodes.extend(views);
    let Writer { bin, views, accessors, meshes, materials, textures, samplers, images, nodes, strong, .. } = writer;
    let mut used = Vec::new();
    if strong {
        used.push("KHR_materials_emissive_strength");
    }
    if !lights.is_empty() {
        used.push("KHR_lights_punctual");
    }
    let mut root = Map::new();
    // glTF forbids lists without elements.
    let mut list = |key: &str, list: Vec<Value>| {
        if !list.is_empty() {
            root.insert(key.into(), list.into());
        }
    };
    list("scenes", vec![json!({ "name": scene.name, "nodes": (0..nodes.len()).collect::<Vec<_>>() })]);
    list("nodes", nodes);
    list("meshes", meshes);
    list("materials", materials);
    list("textures", textures);
    list("samplers", samplers);
    list("images", images);
    list("cameras", cameras);
    list("accessors", accessors);
    list("bufferViews", views);
    list("buffers", vec![json!({ "byteLength": bin.len() })]);
    list("extensionsUsed", used.into_iter().map(Value::from).collect());
    root.insert("asset".into(), json!({ "version": "2.0", "generator": "aogauge" }));
    root.insert("scene".into(), json!(0));
    if !lights.is_empty() {
        root.insert("extensions".into(), json!({ "KHR_lights_punctual": { "lights": lights } }));
    }
    container::pack(Value::Object(root).to_string().into_bytes(), bin)
}

/// Collects the lists of a glTF file.
#[derive(Default)]
struct Writer {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    samplers: Vec<Value>,
    images: Vec<Value>,
    /// Whether any emission is above one.
    strong: bool,
    known_materials: Vec<Material>,
    known_textures: Vec<Arc<Texture>>,
}

impl Writer {
    fn object(&mut self, object: &Object) -> Result<(), String> {
        let mesh = &object.mesh;
        mesh.validate().map_err(|e| e.to_string())?;
        if mesh.uvs.iter().any(|uv| !uv.is_finite()) {
            return Err("its texture coordinates must be finite numbers".into());
        }
        if u32::try_from(mesh.positions.len()).is_err() {
            return Err(format!("it has {} vertices, more than an index can tell apart", mesh.positions.len()));
        }
        let mut attributes = Map::new();
        attributes.insert("POSITION".into(), self.positions(object).into());
        if !mesh.uvs.is_empty() {
            let view =
                self.view(mesh.uvs.iter().flat_map(glam::Vec2::to_array).flat_map(f32::to_le_bytes), Some(VERTICES));
            let uvs = self.accessor(
                json!({ "bufferView": view, "componentType": FLOAT, "count": mesh.uvs.len(), "type": "VEC2" }),
            );
            attributes.insert("TEXCOORD_0".into(), uvs.into());
        }
        let view = self.view(mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()), Some(INDICES));
        let count = 3 * mesh.triangles.len();
        let indices = self
            .accessor(json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": count, "type": "SCALAR" }));
        // A texture needs coordinates; without them it shows nowhere.
        let mut material = object.material.clone();
        if mesh.uvs.is_empty() {
            (material.texture, material.metallic_roughness_texture, material.emissive_texture) = (None, None, None);
        }
        let material = self.material(&material)?;
        let mut node = json!({ "name": object.name, "mesh": self.meshes.len() });
        if object.occluder {
            node["extras"] = json!({ "aogauge": { "occluder": true } });
        }
        self.nodes.push(node);
        let primitive = json!({ "attributes": attributes, "indices": indices, "material": material });
        self.meshes.push(json!({ "name": object.name, "primitives": [primitive] }));
        Ok(())
    }

    fn positions(&mut self, object: &Object) -> usize {
        let mesh = &object.mesh;
        let [min, max] = mesh.bounds().unwrap_or_default().map(|v| v.to_array());
        let view =
            self.view(mesh.positions.iter().flat_map(glam::Vec3::to_array).flat_map(f32::to_le_bytes), Some(VERTICES));
        self.accessor(json!({
            "bufferView": view, "componentType": FLOAT, "count": mesh.positions.len(), "type": "VEC3",
            "min": min, "max": max,
        }))
    }

    /// Adds bytes on a boundary of four, as the format asks.
    fn view(&mut self, bytes: impl IntoIterator<Item = u8>, target: Option<u32>) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let start = self.bin.len();
        self.bin.extend(bytes);
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": self.bin.len() - start });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// The index of a material; equal ones are written once.
    fn material(&mut self, material: &Material) -> Result<usize, String> {
        if let Some(i) = self.known_materials.iter().position(|m| m == material) {
            return Ok(i);
        }
        let [r, g, b] = material.base_color;
        let factors = [r, g, b, material.metallic, material.roughness];
        if !factors.iter().all(|f| (0.0..=1.0).contains(f)) {
            return Err("its base colour, metallic and roughness must be from 0 to 1".into());
        }
        if !material.emissive.iter().all(|e| (0.0..=1e38).contains(e)) {
            return Err("its emission must be from 0 to 1e38".into());
        }
        let mut pbr = json!({
            "baseColorFactor": [r, g, b, 1.0],
            "metallicFactor": material.metallic, "roughnessFactor": material.roughness,
        });
        if let Some(texture) = &material.texture {
            pbr["baseColorTexture"] = json!({ "index": self.texture(texture)? });
        }
        if let Some(texture) = &material.metallic_roughness_texture {
            pbr["metallicRoughnessTexture"] = json!({ "index": self.texture(texture)? });
        }
        // Sheets are lit on both sides.
        let mut json = json!({ "pbrMetallicRoughness": pbr, "doubleSided": true });
        if let Some(name) = &material.name {
            json["name"] = name.as_str().into();
        }
        if let Some(texture) = &material.emissive_texture {
            json["emissiveTexture"] = json!({ "index": self.texture(texture)? });
        }
        let brightest = material.emissive.into_iter().fold(0.0, f32::max);
        if brightest > 1.0 {
            // Above one, the factor holds the colour and the extension the rest: a
            // power of two, which divides without rounding.
            let strength = std::iter::successors(Some(2.0), |s| Some(s * 2.0)).find(|s| *s >= brightest).unwrap_or(1.0);
            json["emissiveFactor"] = json!(material.emissive.map(|e| e / strength));
            json["extensions"] = json!({ "KHR_materials_emissive_strength": { "emissiveStrength": strength } });
            self.strong = true;
        } else if brightest > 0.0 {
            json["emissiveFactor"] = json!(material.emissive);
        }
        self.materials.push(json);
        self.known_materials.push(material.clone());
        Ok(self.materials.len() - 1)
    }

    fn texture(&mut self, texture: &Arc<Texture>) -> Result<usize, String> {
        if let Some(i) = self.known_textures.iter().position(|t| Arc::ptr_eq(t, texture) || t == texture) {
            return Ok(i);
        }
        let view = self.view(texture::encode(texture)?, None);
        self.images.push(json!({ "bufferView": view, "mimeType": "image/png" }));
        let mut json = json!({ "source": self.images.len() - 1 });
        // Without a sampler a texture repeats.
        if texture.wrap != [Wrap::Repeat; 2] {
            json["sampler"] = self.sampler(texture.wrap).into();
        }
        self.textures.push(json);
        self.known_textures.push(texture.clone());
        Ok(self.textures.len() - 1)
    }

    fn sampler(&mut self, wrap: [Wrap; 2]) -> usize {
        let [s, t] = wrap.map(texture::wrap_code);
        let sampler = json!({ "wrapS": s, "wrapT": t });
        self.samplers.iter().position(|known| *known == sampler).unwrap_or_else(|| {
            self.samplers.push(sampler);
            self.samplers.len() - 1
        })
    }
}
