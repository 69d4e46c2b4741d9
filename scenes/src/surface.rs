//! What light transport needs to know of each triangle.

use crate::{
    MAX_ALBEDO, Object, Texture,
    texture::{linear, points, srgb},
};
use glam::{DVec3, Vec2};

impl Object {
    /// Linear diffuse albedo of each triangle, a channel at most [`MAX_ALBEDO`]:
    /// the mean over the triangle, in linear light, of base colour times
    /// texture, less what is metal.
    ///
    /// # Example
    /// ```
    /// let scene = aogauge_scenes::library::scene("plane")?;
    /// assert!(scene.objects[0].albedos().all(|a| a == [0.6; 3]));
    /// # Ok::<(), aogauge_scenes::SceneError>(())
    /// ```
    pub fn albedos(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        let m = &self.material;
        let (colour, metal) = (m.texture.as_deref(), m.metallic_roughness_texture.as_deref());
        self.means([colour, metal], m.albedo(), move |uv| {
            let colour = times(m.base_color, colour, uv);
            let metallic = f64::from(m.metallic) * metal.map_or(1.0, |t| linear(t.at(uv)[2]));
            colour * (1.0 - metallic)
        })
        .map(|albedo| albedo.map(|a| a.clamp(0.0, MAX_ALBEDO)))
    }

    /// Radiance that each triangle sends out from both sides, a channel: the mean
    /// over the triangle of emission times texture.
    pub fn emissions(&self) -> impl Iterator<Item = [f32; 3]> + '_ {
        let m = &self.material;
        let texture = m.emissive_texture.as_deref();
        self.means([texture, None], m.emissive, move |uv| times(m.emissive, texture, uv))
    }

    /// The mean of `value` over the texture coordinates of each triangle, or
    /// `plain` where there is no texture to tell them apart.
    fn means<'a>(
        &'a self,
        textures: [Option<&Texture>; 2],
        plain: [f32; 3],
        value: impl Fn(Vec2) -> DVec3 + 'a,
    ) -> impl Iterator<Item = [f32; 3]> + 'a {
        let sizes = textures.into_iter().flatten().map(|t| t.size);
        let size = sizes.reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]).filter(|_| !self.mesh.uvs.is_empty());
        self.mesh.triangles.iter().map(move |t| {
            let Some(size) = size else { return plain };
            let uvs = t.map(|i| self.mesh.uvs.get(i as usize).copied().unwrap_or_default());
            let (sum, n) = points(uvs, size).fold((DVec3::ZERO, 0_u32), |(sum, n), uv| (sum + value(uv), n + 1));
            (sum / f64::from(n)).as_vec3().to_array()
        })
    }
}

/// A linear colour times that of a texture.
fn times(factor: [f32; 3], texture: Option<&Texture>, uv: Vec2) -> DVec3 {
    let texel = texture.map_or([1.0; 3], |t| {
        let [r, g, b, _] = t.at(uv);
        [r, g, b].map(srgb)
    });
    DVec3::from_array([0, 1, 2].map(|k| f64::from(factor[k]) * texel[k]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Material, Mesh, Wrap};
    use glam::Vec3;
    use std::sync::Arc;

    /// A square whose texture coordinates run from `from` to `to`.
    fn square(material: Material, from: f32, to: f32) -> Object {
        let mut mesh = Mesh::default();
        mesh.push_quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        mesh.uvs = vec![Vec2::splat(from), Vec2::new(to, from), Vec2::splat(to), Vec2::new(from, to)];
        Object { name: "square".into(), occluder: false, material, mesh }
    }

    /// A picture of fields of one colour, each of 8 x 8 texels.
    fn picture(wrap: Wrap, [w, h]: [u32; 2], fields: &[[u8; 4]]) -> Option<Arc<Texture>> {
        let texels = (0..64 * w * h).map(|i| fields[(i / (8 * w) / 8 * w + i % (8 * w) / 8) as usize]).collect();
        Some(Arc::new(Texture { size: [8 * w, 8 * h], wrap: [wrap; 2], texels }))
    }

    const WHITE: [u8; 4] = [255; 4];
    const BLACK: [u8; 4] = [0, 0, 0, 255];

    /// Two greys.
    fn near(found: impl Iterator<Item = [f32; 3]>, wanted: [f32; 2], within: f32) {
        let found: Vec<f32> = found
            .map(|[r, g, b]| {
                assert!((r - g).abs() < 1e-6 && (g - b).abs() < 1e-6);
                g
            })
            .collect();
        assert_eq!(found.len(), 2);
        for (f, w) in found.iter().zip(wanted) {
            assert!((f - w).abs() <= within, "{found:?}, not {wanted:?}");
        }
    }

    #[test]
    fn a_picture_of_one_colour_is_that_colour_in_linear_light() {
        let grey = picture(Wrap::Repeat, [1, 1], &[[188, 188, 188, 255]]);
        let material = Material { texture: grey, base_color: [0.5; 3], ..Material::default() };
        // sRGB 188 is linear 0.5029.
        near(square(material, 0.0, 1.0).albedos(), [0.2514; 2], 1e-4);
    }

    #[test]
    fn the_mean_is_taken_in_linear_light_however_often_it_repeats() {
        for (repeats, within) in [(1.0, 0.01), (3.0, 0.02), (16.0, 0.03), (64.0, 0.03)] {
            let checker = picture(Wrap::Repeat, [2, 2], &[WHITE, BLACK, BLACK, WHITE]);
            let material = Material { texture: checker, base_color: [0.9; 3], ..Material::default() };
            near(square(material, 0.0, repeats).albedos(), [0.45; 2], within);
        }
    }

    #[test]
    fn colours_keep_their_channels() {
        let texture = picture(Wrap::Repeat, [1, 1], &[[255, 188, 0, 255]]);
        let material = Material { texture, base_color: [0.5, 0.8, 0.9], ..Material::default() };
        for albedo in square(material, 0.0, 1.0).albedos() {
            for (found, wanted) in albedo.into_iter().zip([0.5, 0.8 * 0.5029, 0.0]) {
                assert!((found - wanted).abs() < 1e-4, "{albedo:?}");
            }
        }
    }

    #[test]
    fn each_triangle_sees_its_own_part_of_the_picture() {
        // The upper triangle, rows from the top, lies where v is above u.
        let fields: Vec<_> = (0..16 * 16).map(|i| if i / 16 > i % 16 { WHITE } else { BLACK }).collect();
        let texture = picture(Wrap::Repeat, [16, 16], &fields);
        let material = Material { texture, base_color: [0.5; 3], ..Material::default() };
        near(square(material, 0.0, 1.0).albedos(), [0.0, 0.5], 0.04);
    }

    #[test]
    fn wraps_are_honoured() {
        for (wrap, wanted) in [(Wrap::Clamp, [1.0; 2]), (Wrap::Repeat, [0.625, 0.375]), (Wrap::Mirror, [0.5; 2])] {
            let texture = picture(wrap, [2, 1], &[BLACK, WHITE]);
            let material = Material { texture, base_color: [0.9; 3], ..Material::default() };
            near(square(material, 1.0, 3.0).albedos(), wanted.map(|w| 0.9 * w), 0.02);
        }
    }

    #[test]
    fn metal_reflects_no_diffuse_light_and_lamps_may_have_a_picture() {
        let metal = picture(Wrap::Repeat, [1, 1], &[[0, 255, 51, 255]]);
        let lamp = picture(Wrap::Repeat, [2, 1], &[WHITE, BLACK]);
        let material = Material {
            metallic: 1.0,
            metallic_roughness_texture: metal,
            emissive: [4.0; 3],
            emissive_texture: lamp,
            ..Material::default()
        };
        let mut square = square(material, 0.0, 1.0);
        near(square.albedos(), [0.6 * 0.8; 2], 1e-6);
        let [a, b] = square.emissions().map(|e| e[0]).collect::<Vec<_>>()[..] else { panic!() };
        assert!((a + b - 4.0).abs() < 0.05 && (b - 3.0).abs() < 0.05, "{a} {b}");
        square.mesh.uvs.clear();
        near(square.emissions(), [4.0; 2], 1e-6);
    }
}
