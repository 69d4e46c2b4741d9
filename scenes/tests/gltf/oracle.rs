//! What is written, as the `gltf` crate reads it: a reader that shares no code
//! with ours. Beside it, why that crate is not our reader.

use aogauge_scenes::{
    Camera, Light, LightKind, Object, Projection, Scene, Texture, Wrap,
    gltf::{import_bytes, write_glb},
    library,
};
use glam::{Mat4, Vec2, Vec3};
use gltf::{buffer::Data, camera, khr_lights_punctual::Kind, texture::WrappingMode};
use std::{collections::HashMap, sync::Arc};

/// A file as the crate has it.
struct Oracle {
    document: gltf::Document,
    buffers: Vec<Data>,
    images: Vec<gltf::image::Data>,
}

impl Oracle {
    fn read(glb: &[u8]) -> Self {
        let (document, buffers, images) = gltf::import_slice(glb).unwrap();
        Oracle { document, buffers, images }
    }

    /// The nodes of the scene by name; none is below another in what we write.
    fn nodes(&self) -> HashMap<String, gltf::Node<'_>> {
        let scene = self.document.default_scene().unwrap();
        scene.nodes().map(|n| (n.name().unwrap().to_owned(), n)).collect()
    }

    fn same_object(&self, node: &gltf::Node<'_>, object: &Object) {
        assert_eq!(Mat4::from_cols_array_2d(&node.transform().matrix()), Mat4::IDENTITY);
        let mesh = node.mesh().unwrap();
        let [primitive] = &mesh.primitives().collect::<Vec<_>>()[..] else { panic!("{}: one primitive", object.name) };
        let reader = primitive.reader(|b| self.buffers.get(b.index()).map(|d| &d[..]));
        let positions: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from_array).collect();
        assert_eq!(positions, object.mesh.positions, "{}", object.name);
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(indices, object.mesh.triangles.as_flattened(), "{}", object.name);
        let uvs: Vec<Vec2> =
            reader.read_tex_coords(0).map(|c| c.into_f32().map(Vec2::from_array).collect()).unwrap_or_default();
        assert_eq!(uvs, object.mesh.uvs, "{}", object.name);
        let extras = node.extras().as_ref().map_or("", |e| e.get());
        assert_eq!(extras == r#"{"aogauge":{"occluder":true}}"#, object.occluder, "{}: {extras}", object.name);
        self.same_material(&primitive.material(), object);
    }

    fn same_material(&self, found: &gltf::Material<'_>, object: &Object) {
        let wanted = &object.material;
        let pbr = found.pbr_metallic_roughness();
        let [r, g, b] = wanted.base_color;
        assert_eq!(found.name(), wanted.name.as_deref());
        assert_eq!(pbr.base_color_factor(), [r, g, b, 1.0]);
        assert_eq!((pbr.metallic_factor(), pbr.roughness_factor()), (wanted.metallic, wanted.roughness));
        let strength = found.emissive_strength().unwrap_or(1.0);
        assert_eq!(found.emissive_factor().map(|e| e * strength), wanted.emissive);
        let textures = [pbr.base_color_texture(), pbr.metallic_roughness_texture(), found.emissive_texture()];
        for (found, wanted) in textures.into_iter().zip(wanted.textures()) {
            self.same_texture(found.map(|t| t.texture()).as_ref(), wanted);
        }
    }

    fn same_texture(&self, found: Option<&gltf::Texture<'_>>, wanted: Option<&Arc<Texture>>) {
        let (Some(found), Some(wanted)) = (found, wanted) else {
            return assert_eq!(found.is_some(), wanted.is_some());
        };
        let image = &self.images[found.source().index()];
        assert_eq!(([image.width, image.height], &image.pixels[..]), (wanted.size, wanted.texels.as_flattened()));
        let sampler = found.sampler();
        let wrap = [sampler.wrap_s(), sampler.wrap_t()].map(|w| match w {
            WrappingMode::Repeat => Wrap::Repeat,
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
        });
        assert_eq!(wrap, wanted.wrap);
    }
}

fn same_camera(node: &gltf::Node<'_>, wanted: &Camera) {
    let pose = Mat4::from_cols_array_2d(&node.transform().matrix());
    let close = |a: Vec3, b: Vec3| assert!(a.distance(b) < 1e-5, "{}: {a} is not {b}", wanted.name);
    close(pose.w_axis.truncate(), wanted.position);
    close(-pose.z_axis.truncate(), wanted.forward);
    close(pose.y_axis.truncate(), wanted.up);
    let found = match node.camera().unwrap().projection() {
        camera::Projection::Perspective(p) => {
            Projection::Perspective { fov_y: p.yfov(), aspect: p.aspect_ratio(), near: p.znear(), far: p.zfar() }
        }
        camera::Projection::Orthographic(o) => {
            Projection::Orthographic { half_size: [o.xmag(), o.ymag()], near: o.znear(), far: o.zfar() }
        }
    };
    assert_eq!(found, wanted.projection, "{}", wanted.name);
}

fn same_light(node: &gltf::Node<'_>, wanted: &Light) {
    let found = node.light().unwrap();
    let kind = match found.kind() {
        Kind::Directional => LightKind::Directional,
        Kind::Point => LightKind::Point,
        Kind::Spot { inner_cone_angle: inner, outer_cone_angle: outer } => LightKind::Spot { inner, outer },
    };
    assert_eq!(kind, wanted.kind);
    assert_eq!((found.color(), found.intensity(), found.range()), (wanted.color, wanted.intensity, wanted.range));
    let pose = Mat4::from_cols_array_2d(&node.transform().matrix());
    assert_eq!((pose.w_axis.truncate(), -pose.z_axis.truncate()), (wanted.position, wanted.direction));
}

fn same(scene: &Scene) {
    let mut glb = Vec::new();
    write_glb(scene, &mut glb).unwrap();
    let oracle = Oracle::read(&glb);
    let ours = import_bytes(&scene.name, &glb, None, 1.0).unwrap();
    let nodes = oracle.nodes();
    assert_eq!(nodes.len(), scene.objects.len() + 2 + scene.cameras.len() + scene.lights.len(), "{}", scene.name);
    scene.objects.iter().for_each(|o| oracle.same_object(&nodes[&o.name], o));
    ours.objects.iter().for_each(|o| oracle.same_object(&nodes[&o.name], o));
    ours.cameras.iter().for_each(|c| same_camera(&nodes[&c.name], c));
    ours.lights.iter().chain(&scene.lights).for_each(|l| same_light(&nodes[&l.name], l));
}

#[test]
fn another_reader_finds_the_same_in_every_built_in_scene() {
    for (name, _) in library::SCENES {
        same(&library::scene(name).unwrap());
    }
}

#[test]
fn another_reader_finds_the_same_in_a_rich_scene() {
    same(&crate::builder::rich());
}

/// Facts that keep the `gltf` crate from being our reader. Should one of these
/// fail, it is time to look at the crate again.
#[test]
fn the_crate_takes_wrong_numbers_for_right_ones_and_refuses_what_is_allowed() {
    let root = |json: serde_json::Value| gltf::json::Root::from_str(&json.to_string());
    let mut b = crate::builder::triangle();
    // An index and a component type are cut to 32 bits: out of range becomes in range.
    b.json["nodes"][0]["mesh"] = (1_u64 << 32).into();
    b.json["accessors"][0]["componentType"] = ((1_u64 << 32) + 5126).into();
    let read = root(b.json.clone()).unwrap();
    assert_eq!(read.nodes[0].mesh.unwrap().value(), 0);
    assert!(format!("{:?}", read.accessors[0].component_type).contains("F32"));
    assert!(b.import().is_err());
    // Elements that are wider than their stride are found out by a panic.
    let mut b = crate::builder::triangle();
    b.json["bufferViews"][0]["byteStride"] = 4.into();
    let narrow = gltf::Gltf::from_slice_without_validation(&b.glb()).unwrap();
    let blob = narrow.blob.as_deref();
    let positions = std::panic::AssertUnwindSafe(|| {
        let primitive = narrow.meshes().next().unwrap().primitives().next().unwrap();
        primitive.reader(|_| blob).read_positions().map(Iterator::collect::<Vec<_>>)
    });
    assert!(std::panic::catch_unwind(positions).is_err());
    assert!(b.import().is_err());
    // A scene may have no nodes.
    let mut b = crate::builder::triangle();
    b.json["scenes"] = serde_json::json!([{ "nodes": [0] }, {}]);
    assert!(root(b.json.clone()).is_err());
    assert!(b.import().is_ok());
    // A GLB may have chunks of kinds to come, and may not have more bytes than it says.
    let mut long = crate::builder::triangle().glb();
    long.extend([0; 4]);
    assert!(gltf::Glb::from_slice(&long).is_ok());
    assert!(import_bytes("long.glb", &long, None, 1.0).is_err());
    long.splice(long.len() - 4.., [4_u32.to_le_bytes(), *b"TEST", [0; 4]].concat());
    let end = long.len() as u32;
    long[8..12].copy_from_slice(&end.to_le_bytes());
    // The same chunk where the crate looks for the bytes.
    let json = serde_json::to_vec(&crate::builder::triangle().json).unwrap();
    let mut odd = crate::builder::glb(&json, &[0; 4]);
    let at = odd.len() - 8;
    odd[at..at + 4].copy_from_slice(b"TEST");
    assert!(gltf::Glb::from_slice(&odd).is_err());
    assert!(import_bytes("chunks.glb", &long, None, 1.0).is_ok());
}
