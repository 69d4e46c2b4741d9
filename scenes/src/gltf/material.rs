//! Materials in.

use super::{
    bytes::{Buffers, Files},
    document::{AlphaMode, Document, MaterialDef, TextureRef, get, label},
    mask::{AlphaSums, Mask},
    texture,
};
use crate::{Material, Texture};
use glam::{Affine2, Vec2};
use std::{collections::HashMap, rc::Rc, sync::Arc};

/// Most texels of all textures together: 1 GiB.
const MOST_TEXELS: u64 = 1 << 28;

/// A material, and what a mesh needs to know to wear it.
pub(super) struct Prepared {
    pub material: Material,
    pub name: Option<Arc<str>>,
    /// Where its texture coordinates come from; None without a texture.
    pub coordinates: Option<Coordinates>,
    /// What is to be cut out.
    pub mask: Option<Mask>,
}

/// Which texture coordinates, and how they are moved.
pub(super) struct Coordinates {
    pub attribute: String,
    pub map: Option<Affine2>,
}

/// Makes materials as they are asked for, so that what no mesh wears is not decoded.
pub(super) struct Wardrobe<'a> {
    document: &'a Document,
    buffers: &'a Buffers<'a>,
    files: &'a Files<'a>,
    materials: HashMap<Option<usize>, Rc<Prepared>>,
    textures: HashMap<usize, Arc<Texture>>,
    sums: HashMap<usize, Rc<AlphaSums>>,
    texels_left: u64,
}

impl<'a> Wardrobe<'a> {
    pub(super) fn new(document: &'a Document, buffers: &'a Buffers<'a>, files: &'a Files<'a>) -> Self {
        Wardrobe {
            document,
            buffers,
            files,
            materials: HashMap::new(),
            textures: HashMap::new(),
            sums: HashMap::new(),
            texels_left: MOST_TEXELS,
        }
    }

    /// The material of this index. A mesh without one is grey: glTF's own default
    /// is a white metal, which reflects no diffuse light at all.
    pub(super) fn get(&mut self, index: Option<usize>, asker: &str) -> Result<Rc<Prepared>, String> {
        if let Some(known) = self.materials.get(&index) {
            return Ok(known.clone());
        }
        let prepared = Rc::new(match index {
            None => Prepared { material: Material::default(), name: None, coordinates: None, mask: None },
            Some(i) => {
                let def = get(&self.document.materials, i, "material", asker)?;
                self.prepare(def).map_err(|e| format!("{}: {e}", label("material", i, def.name.as_deref())))?
            }
        });
        self.materials.insert(index, prepared.clone());
        Ok(prepared)
    }

    fn prepare(&mut self, def: &MaterialDef) -> Result<Prepared, String> {
        let pbr = &def.pbr_metallic_roughness;
        let [r, g, b, alpha] = pbr.base_color_factor;
        within(&pbr.base_color_factor, "baseColorFactor")?;
        within(&[pbr.metallic_factor], "metallicFactor")?;
        within(&[pbr.roughness_factor], "roughnessFactor")?;
        within(&def.emissive_factor, "emissiveFactor")?;
        let strength = def.extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength).unwrap_or(1.0);
        let emissive = def.emissive_factor.map(|e| e * strength);
        if !(strength >= 0.0 && emissive.iter().all(|e| e.is_finite())) {
            return Err(format!("its emissiveStrength is {strength}: it must be 0 or more"));
        }
        let image = pbr.base_color_texture.as_ref().map(|t| self.image_of(t)).transpose()?;
        let texture = image.map(|i| self.texture(i)).transpose()?;
        let mask = if def.alpha_mode == AlphaMode::Mask {
            let cutoff = def.alpha_cutoff.unwrap_or(0.5);
            if !(cutoff >= 0.0 && cutoff.is_finite()) {
                return Err(format!("its alphaCutoff is {cutoff}: it must be 0 or more"));
            }
            Some(Mask { cutoff, alpha, texture: image.zip(texture.as_ref()).map(|(i, t)| self.sums(i, t)) })
        } else {
            None
        };
        Ok(Prepared {
            material: Material {
                base_color: [r, g, b],
                texture,
                metallic: pbr.metallic_factor,
                roughness: pbr.roughness_factor,
                emissive,
            },
            name: def.name.as_deref().map(Into::into),
            coordinates: pbr.base_color_texture.as_ref().map(coordinates).transpose()?,
            mask,
        })
    }

    fn image_of(&self, reference: &TextureRef) -> Result<usize, String> {
        let this = label("texture", reference.index, None);
        let texture = get(&self.document.textures, reference.index, "texture", "its baseColorTexture")?;
        texture.source.ok_or_else(|| format!("{this} has no PNG or JPEG source"))
    }

    fn texture(&mut self, image: usize) -> Result<Arc<Texture>, String> {
        if let Some(known) = self.textures.get(&image) {
            return Ok(known.clone());
        }
        let bytes = self.buffers.image(image, self.files, "its baseColorTexture")?;
        let texture = texture::decode(&bytes, &mut self.texels_left).map_err(|e| format!("image {image}: {e}"))?;
        let texture = Arc::new(texture);
        self.textures.insert(image, texture.clone());
        Ok(texture)
    }

    fn sums(&mut self, image: usize, texture: &Texture) -> Rc<AlphaSums> {
        self.sums.entry(image).or_insert_with(|| Rc::new(AlphaSums::new(texture))).clone()
    }
}

fn coordinates(reference: &TextureRef) -> Result<Coordinates, String> {
    let transform = reference.extensions.transform.as_ref();
    let set = transform.and_then(|t| t.tex_coord).unwrap_or(reference.tex_coord);
    let map = transform.map(|t| {
        // KHR_texture_transform turns against glam's sense, as v points down.
        let (scale, offset) = (Vec2::from_array(t.scale), Vec2::from_array(t.offset));
        Affine2::from_scale_angle_translation(scale, -t.rotation, offset)
    });
    if map.is_some_and(|m| !m.is_finite()) {
        return Err("its KHR_texture_transform is not finite".into());
    }
    Ok(Coordinates { attribute: format!("TEXCOORD_{set}"), map })
}

fn within(values: &[f32], field: &str) -> Result<(), String> {
    match values.iter().find(|v| !(0.0..=1.0).contains(*v)) {
        Some(v) => Err(format!("its {field} holds {v}: it must be from 0 to 1")),
        None => Ok(()),
    }
}
