//! What surfaces are made of: the part of glTF's metallic-roughness model that
//! light transport here needs.

use std::sync::Arc;

/// An 8-bit sRGB picture, repeated in both directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width and height in texels, above zero.
    pub size: [u32; 2],
    /// Red, green, blue and alpha a texel, row by row from the top; colours are
    /// sRGB encoded, alpha is linear.
    pub texels: Vec<[u8; 4]>,
}

/// A metallic-roughness material.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Linear reflectance a channel, 0 to 1; multiplies the texture.
    pub base_color: [f32; 3],
    /// Picture of the base colour, at the mesh's `uvs`.
    pub texture: Option<Arc<Texture>>,
    /// 0 dielectric to 1 metal.
    pub metallic: f32,
    /// 0 mirror to 1 rough.
    pub roughness: f32,
    /// Radiance it sends out a channel, from both sides, W/(m^2 sr) up to the
    /// environment's factor.
    pub emissive: [f32; 3],
}

impl Default for Material {
    fn default() -> Self {
        Material { base_color: [0.6; 3], texture: None, metallic: 0.0, roughness: 1.0, emissive: [0.0; 3] }
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

    /// Linear diffuse albedo a channel, without the texture, each at most
    /// [`MAX_ALBEDO`].
    pub fn albedo(&self) -> [f32; 3] {
        self.base_color.map(|c| (c * (1.0 - self.metallic)).clamp(0.0, MAX_ALBEDO))
    }
}
