//! What surfaces are made of: the part of glTF's metallic-roughness model that
//! light transport here needs.

use crate::Texture;
use std::sync::Arc;

/// A metallic-roughness material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// What a model calls it; changes nothing that is measured.
    pub name: Option<String>,
    /// Linear reflectance a channel, 0 to 1; multiplies the texture.
    pub base_color: [f32; 3],
    /// Picture of the base colour, sRGB, at the mesh's `uvs` as all pictures are.
    pub texture: Option<Arc<Texture>>,
    /// 0 dielectric to 1 metal; multiplies the texture's.
    pub metallic: f32,
    /// 0 mirror to 1 rough; multiplies the texture's.
    pub roughness: f32,
    /// Picture of roughness (green) and metallic (blue), linear.
    pub metallic_roughness_texture: Option<Arc<Texture>>,
    /// Radiance it sends out a channel, from both sides, W/(m^2 sr) up to the
    /// environment's factor; multiplies the texture.
    pub emissive: [f32; 3],
    /// Picture of the emission, sRGB.
    pub emissive_texture: Option<Arc<Texture>>,
}

impl Default for Material {
    fn default() -> Self {
        Material {
            name: None,
            base_color: [0.6; 3],
            texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            emissive: [0.0; 3],
            emissive_texture: None,
        }
    }
}

/// Luminance of a linear sRGB colour (Rec. 709 weights).
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Highest albedo a surface is traced with: at 1 a closed room would never give
/// up a path.
pub const MAX_ALBEDO: f32 = 0.98;

impl Material {
    /// A grey, rough dielectric.
    pub fn grey(albedo: f32) -> Self {
        Material { base_color: [albedo; 3], ..Material::default() }
    }

    /// A coloured, rough dielectric.
    pub fn colored(base_color: [f32; 3]) -> Self {
        Material { base_color, ..Material::default() }
    }

    /// The textures of base colour, of metallic and roughness, and of emission.
    pub fn textures(&self) -> [Option<&Arc<Texture>>; 3] {
        [self.texture.as_ref(), self.metallic_roughness_texture.as_ref(), self.emissive_texture.as_ref()]
    }

    /// Linear diffuse albedo a channel, without textures, each at most
    /// [`MAX_ALBEDO`]; [`Object::albedos`](crate::Object::albedos) counts them.
    pub fn albedo(&self) -> [f32; 3] {
        self.base_color.map(|c| (c * (1.0 - self.metallic)).clamp(0.0, MAX_ALBEDO))
    }
}
