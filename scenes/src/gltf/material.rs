//! Materials in.

use super::{
    bytes::{Buffers, Files},
    document::{AlphaMode, Document, MaterialDef, TextureRef, get, label},
    mask::{AlphaSums, Mask},
    texture,
};
use crate::{
    Material, Texture, Wrap,
    texture::{linear, srgb},
};
use glam::{Affine2, Vec2};
use std::{collections::HashMap, rc::Rc, sync::Arc};

/// Most texels of all textures together: 1 GiB.
const MOST_TEXELS: u64 = 1 << 28;

/// A material, and what a mesh needs to know to wear it.
pub(super) struct Prepared {
    pub material: Material,
    /// Where its texture coordinates come from; None without a texture.
    pub coordinates: Option<Coordinates>,
    /// What is to be cut out.
    pub mask: Option<Mask>,
}

/// Which texture coordinates, and how they are moved.
#[derive(Clone, PartialEq)]
pub(super) struct Coordinates {
    pub attribute: String,
    pub map: Option<Affine2>,
}

/// An image and how it goes on beyond its edges.
type Picture = (usize, [Wrap; 2]);

/// Makes materials as they are asked for, so that what no mesh wears is not decoded.
pub(super) struct Wardrobe<'a> {
    document: &'a Document,
    buffers: &'a Buffers<'a>,
    files: &'a Files<'a>,
    materials: HashMap<Option<usize>, Rc<Prepared>>,
    textures: HashMap<Picture, Arc<Texture>>,
    sums: HashMap<Picture, Rc<AlphaSums>>,
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
            None => Prepared { material: Material::default(), coordinates: None, mask: None },
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
        let mut prepared = Prepared {
            material: Material {
                name: def.name.clone(),
                base_color: [r, g, b],
                metallic: pbr.metallic_factor,
                roughness: pbr.roughness_factor,
                emissive,
                ..Material::default()
            },
            coordinates: None,
            mask: None,
        };
        self.dress(def, &mut prepared)?;
        if let Some(cutoff) = cutoff(def)? {
            let sums = pbr.base_color_texture.as_ref().map(|t| self.sums(t)).transpose()?;
            prepared.mask = Some(Mask { cutoff, alpha, texture: sums });
        }
        Ok(prepared)
    }

    /// Hangs up the textures. A mesh has one set of texture coordinates here: a
    /// texture that is laid on by another than the first one's counts by its mean.
    fn dress(&mut self, def: &MaterialDef, prepared: &mut Prepared) -> Result<(), String> {
        let pbr = &def.pbr_metallic_roughness;
        let mut fits = |reference: &TextureRef| {
            let these = coordinates(reference)?;
            let first = prepared.coordinates.get_or_insert_with(|| these.clone());
            Ok::<bool, String>(*first == these)
        };
        let m = &mut prepared.material;
        if let Some(reference) = &pbr.base_color_texture {
            fits(reference)?;
            m.texture = Some(self.texture(reference, "baseColorTexture")?);
        }
        if let Some(reference) = &pbr.metallic_roughness_texture {
            let texture = self.texture(reference, "metallicRoughnessTexture")?;
            if fits(reference)? {
                m.metallic_roughness_texture = Some(texture);
            } else {
                let [_, roughness, metallic] = texture.mean(linear);
                m.roughness *= roughness as f32;
                m.metallic *= metallic as f32;
            }
        }
        // What does not shine needs no picture of it.
        let shines = m.emissive != [0.0; 3];
        if let Some(reference) = def.emissive_texture.as_ref().filter(|_| shines) {
            let texture = self.texture(reference, "emissiveTexture")?;
            if fits(reference)? {
                m.emissive_texture = Some(texture);
            } else {
                let mean = texture.mean(srgb);
                m.emissive = std::array::from_fn(|k| m.emissive[k] * mean[k] as f32);
            }
        }
        Ok(())
    }

    fn picture(&self, reference: &TextureRef, asker: &str) -> Result<Picture, String> {
        let this = label("texture", reference.index, None);
        let texture = get(&self.document.textures, reference.index, "texture", asker)?;
        let image = texture.source.ok_or_else(|| format!("{this} has no PNG or JPEG source"))?;
        let Some(index) = texture.sampler else {
            return Ok((image, [Wrap::Repeat; 2]));
        };
        let sampler = get(&self.document.samplers, index, "sampler", &this)?;
        let wrap = |code, field| texture::wrap(code, field).map_err(|e| format!("sampler {index}: {e}"));
        Ok((image, [wrap(sampler.wrap_s, "wrapS")?, wrap(sampler.wrap_t, "wrapT")?]))
    }

    fn texture(&mut self, reference: &TextureRef, field: &str) -> Result<Arc<Texture>, String> {
        let asker = format!("its {field}");
        let picture = self.picture(reference, &asker)?;
        if let Some(known) = self.textures.get(&picture) {
            return Ok(known.clone());
        }
        let (image, wrap) = picture;
        let bytes = self.buffers.image(image, self.files, &asker)?;
        let texture =
            texture::decode(&bytes, wrap, &mut self.texels_left).map_err(|e| format!("image {image}: {e}"))?;
        let texture = Arc::new(texture);
        self.textures.insert(picture, texture.clone());
        Ok(texture)
    }

    fn sums(&mut self, reference: &TextureRef) -> Result<Rc<AlphaSums>, String> {
        let texture = self.texture(reference, "baseColorTexture")?;
        let picture = self.picture(reference, "its baseColorTexture")?;
        Ok(self.sums.entry(picture).or_insert_with(|| Rc::new(AlphaSums::new(&texture))).clone())
    }
}

/// Alpha from which on a surface is there, where it is not everywhere. A
/// renderer here knows no half-clear surface: what is blended is there where it
/// is at least half opaque.
fn cutoff(def: &MaterialDef) -> Result<Option<f32>, String> {
    let cutoff = match def.alpha_mode {
        AlphaMode::Opaque => return Ok(None),
        AlphaMode::Blend => 0.5,
        AlphaMode::Mask => def.alpha_cutoff.unwrap_or(0.5),
    };
    if !(cutoff >= 0.0 && cutoff.is_finite()) {
        return Err(format!("its alphaCutoff is {cutoff}: it must be 0 or more"));
    }
    Ok(Some(cutoff))
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
