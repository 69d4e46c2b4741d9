//! What a surface is made of at a point: factors times textures, as glTF has it.
//! Twin: `gpu/shaders/materials.wgsl`.

use super::gbuffer::Surface;
use aogauge_scenes::{Object, Scene};
use glam::{Vec2, Vec3};

/// The materials of a scene, found by triangle.
#[derive(Clone, Debug)]
pub struct Materials<'a> {
    objects: &'a [Object],
    /// Of each object, the number of its first triangle.
    first: Vec<usize>,
}

/// A metallic-roughness material at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Here {
    /// Linear reflectance a channel, 0 to 1.
    pub base_color: Vec3,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 0 mirror to 1 rough.
    pub roughness: f32,
    /// Radiance sent out from both sides.
    pub emission: Vec3,
}

impl Here {
    /// Diffuse albedo: base colour, less what is metal.
    pub fn albedo(&self) -> Vec3 {
        self.base_color * (1.0 - self.metallic)
    }
}

impl<'a> Materials<'a> {
    /// The materials of a scene whose triangles are numbered in object order.
    pub fn new(scene: &'a Scene) -> Self {
        let first = scene
            .objects
            .iter()
            .scan(0, |next, o| {
                let first = *next;
                *next += o.mesh.triangles.len();
                Some(first)
            })
            .collect();
        Materials { objects: &scene.objects, first }
    }

    /// The objects of the scene.
    pub(super) fn objects(&self) -> &'a [Object] {
        self.objects
    }

    /// Which object a triangle of the scene belongs to, and its number there.
    pub(super) fn place(&self, triangle: u32) -> (usize, usize) {
        let triangle = triangle as usize;
        let object = self.first.partition_point(|&f| f <= triangle).saturating_sub(1);
        (object, triangle - self.first[object])
    }

    /// The material at a point that a view of the scene sees.
    pub fn at(&self, surface: &Surface) -> Here {
        let (object, triangle) = self.place(surface.triangle);
        let object = &self.objects[object];
        let m = &object.material;
        let textured = m.textures().iter().any(Option::is_some);
        let uv = textured.then(|| uv(object, triangle, surface.point)).flatten();
        let [color, metal_rough, emission] = m.textures().map(|t| t.zip(uv));
        let [_, roughness, metallic] = metal_rough.map_or([1.0; 3], |(t, uv)| t.shares(uv).to_array());
        Here {
            base_color: Vec3::from(m.base_color) * color.map_or(Vec3::ONE, |(t, uv)| t.color(uv)),
            metallic: m.metallic * metallic,
            roughness: m.roughness * roughness,
            emission: Vec3::from(m.emissive) * emission.map_or(Vec3::ONE, |(t, uv)| t.color(uv)),
        }
    }
}

/// Texture coordinates at a point of a triangle; None where the triangle has no
/// area or the mesh no coordinates.
fn uv(object: &Object, triangle: usize, point: Vec3) -> Option<Vec2> {
    let corners = object.mesh.triangles.get(triangle)?.map(|i| i as usize);
    let [a, b, c] = corners.map(|i| object.mesh.positions[i]);
    let (n, p) = ((b - a).cross(c - a), point - a);
    let (v, w) = (p.cross(c - a).dot(n), (b - a).cross(p).dot(n));
    let [ta, tb, tc] = corner_uvs(object, triangle)?;
    let uv = ta + ((tb - ta) * v + (tc - ta) * w) / n.length_squared();
    uv.is_finite().then_some(uv)
}

/// Texture coordinates at the corners of a triangle.
pub(super) fn corner_uvs(object: &Object, triangle: usize) -> Option<[Vec2; 3]> {
    let [a, b, c] = object.mesh.triangles.get(triangle)?.map(|i| object.mesh.uvs.get(i as usize));
    Some([*a?, *b?, *c?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::{Material, Mesh, Texture, Wrap};
    use std::sync::Arc;

    fn square(material: Material) -> Scene {
        let mut scene = crate::scenes::library::scene("plane").unwrap();
        let mut mesh = Mesh::default();
        mesh.push_quad(Vec3::ZERO, Vec3::X * 4.0, Vec3::Y * 4.0);
        mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        scene.objects.push(Object { name: "square".into(), occluder: false, material, mesh });
        scene
    }

    #[test]
    fn textures_are_read_where_they_lie() {
        let texels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255, 255, 255, 255]];
        let texture = Arc::new(Texture { size: [2, 2], wrap: [Wrap::Repeat; 2], texels });
        let material = Material {
            base_color: [0.5, 1.0, 1.0],
            texture: Some(texture.clone()),
            metallic: 0.5,
            roughness: 0.8,
            metallic_roughness_texture: Some(texture.clone()),
            emissive: [3.0; 3],
            emissive_texture: Some(texture),
            ..Material::default()
        };
        let scene = square(material);
        let first = scene.objects[0].mesh.triangles.len() as u32;
        let materials = Materials::new(&scene);
        let at = |x: f32, y: f32, triangle| {
            let point = Vec3::new(x, y, 0.0);
            materials.at(&Surface { point, normal: Vec3::Z, triangle: first + triangle })
        };
        for (x, y, triangle, texel) in
            [(3.0, 1.0, 0, Vec3::Y), (1.0, 1.0, 0, Vec3::X), (1.0, 3.0, 1, Vec3::Z), (3.0, 3.0, 0, Vec3::ONE)]
        {
            let here = at(x, y, triangle);
            assert!((here.base_color - texel * Vec3::new(0.5, 1.0, 1.0)).length() < 1e-5, "{here:?}");
            assert!((here.roughness - 0.8 * texel.y).abs() < 1e-5 && (here.metallic - 0.5 * texel.z).abs() < 1e-5);
            assert!((here.emission - texel * 3.0).length() < 1e-5, "{here:?}");
        }
        // Midway between red and green, in linear light.
        assert!((at(2.0, 1.0, 0).base_color - Vec3::new(0.25, 0.5, 0.0)).length() < 1e-5);
        // Another object is not dressed alike.
        let plain = materials.at(&Surface { point: Vec3::ZERO, normal: Vec3::Y, triangle: 0 });
        assert_eq!((plain.base_color, plain.emission), (Vec3::splat(0.6), Vec3::ZERO));
    }
}
