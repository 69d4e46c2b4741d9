//! What a lit view shows, on the GPU: the twin of `shade` of
//! `render/composite.rs`.

use super::{
    Gpu,
    loaded::{Bound, LoadedGpu, STOPPED, pieces, stopped},
    params::{Program, places},
};
use crate::render::{
    Estimator, Geometry, Job, RenderError,
    composite::{Lighting, Shaded, mean_radiance},
    materials::{Materials, corner_uvs},
};
use aogauge_scenes::{AoScale, Light, LightKind, Sky, Texture, View, Wrap, srgb};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::{collections::BTreeMap, sync::Arc};

/// The shader of lit views.
pub(super) const SHADER: &str = concat!(
    include_str!("shaders/sampler.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/ao.wgsl"),
    include_str!("shaders/brdf.wgsl"),
    include_str!("shaders/materials.wgsl"),
    include_str!("shaders/lights.wgsl"),
    include_str!("shaders/composite.wgsl")
);

/// Lights that one invocation looks at, at most; see `RAYS_AN_INVOCATION`.
const LIGHTS_AN_INVOCATION: u32 = 64;

/// A lit scene on the GPU.
pub struct Lit<'a> {
    scene: LoadedGpu<'a>,
    /// With the bindings that the shader gives them.
    buffers: Vec<(u32, wgpu::Buffer)>,
    lights: u32,
    /// Of a view of as many pixels.
    image: Option<(usize, wgpu::Buffer, Bound)>,
}

/// `Picture` of materials.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Picture {
    first: u32,
    size: [u32; 2],
    wrap: u32,
}

/// `Material` of materials.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Material {
    base_color: [f32; 3],
    metallic: f32,
    emission: [f32; 3],
    roughness: f32,
    /// Of colour, of metallic and roughness, of emission.
    pictures: [Picture; 3],
}

/// `Skin` of materials.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Skin {
    uvs: [[f32; 2]; 3],
    material: u32,
    mapped: u32,
}

/// `Light` of lights.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Lamp {
    position: [f32; 3],
    kind: u32,
    direction: [f32; 3],
    range: f32,
    intensity: [f32; 3],
    cos_outer: f32,
    scale: f32,
    unused: [u32; 3],
}

/// `Sky` of composite.wgsl.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Backdrop {
    ambient: [f32; 3],
    mean: f32,
    zenith: f32,
    horizon: f32,
    ground: f32,
    unused: u32,
}

/// Texels of all textures, each once.
#[derive(Default)]
struct Texels<'a> {
    textures: Vec<&'a Texture>,
    /// By address, where each begins.
    first: BTreeMap<*const Texture, u64>,
    count: u64,
}

/// How many texels a texture should have.
fn extent(texture: &Texture) -> usize {
    texture.size[0] as usize * texture.size[1] as usize
}

impl<'a> Texels<'a> {
    fn add(&mut self, texture: Option<&'a Arc<Texture>>) -> Picture {
        let Some(texture) = texture else { return Picture::zeroed() };
        let first = *self.first.entry(Arc::as_ptr(texture)).or_insert_with(|| {
            let first = self.count;
            self.textures.push(texture);
            self.count += extent(texture) as u64;
            first
        });
        let wrap = |w| match w {
            Wrap::Repeat => 0,
            Wrap::Clamp => 1,
            Wrap::Mirror => 2,
        };
        let [u, v] = texture.wrap.map(wrap);
        // What does not fit into 32 bits fits into no buffer either.
        Picture { first: first as u32, size: texture.size, wrap: u | v << 2 }
    }
}

impl Lamp {
    fn new(light: &Light) -> Self {
        let (kind, cos_outer, scale) = match light.kind {
            LightKind::Directional => (0, 0.0, 0.0),
            LightKind::Point => (1, 0.0, 0.0),
            LightKind::Spot { inner, outer } => (2, outer.cos(), 1.0 / (inner.cos() - outer.cos()).max(1e-3)),
        };
        Lamp {
            position: light.position.to_array(),
            kind,
            direction: light.direction.to_array(),
            range: light.range.unwrap_or(0.0),
            intensity: (Vec3::from(light.color) * light.intensity).to_array(),
            cos_outer,
            scale,
            unused: [0; 3],
        }
    }
}

impl Backdrop {
    fn new(lighting: &Lighting) -> Self {
        let mean = mean_radiance(lighting.sky);
        let ambient = lighting.ambient.to_array();
        let [mean, zenith, horizon, ground] = match lighting.sky {
            Sky::Gradient { zenith, horizon, ground } if mean > 0.0 => [mean, zenith, horizon, ground],
            _ => [1.0; 4],
        };
        Backdrop { ambient, mean, zenith, horizon, ground, unused: 0 }
    }
}

impl Gpu {
    /// Makes a lit scene ready; `materials` are those of the scene that
    /// `geometry` was built from.
    ///
    /// # Errors
    /// [`RenderError::TooLarge`] where its triangles or its textures do not fit
    /// into one binding, [`RenderError::Device`] where the device fails.
    pub fn lit<'a>(
        &'a self,
        geometry: &'a Geometry,
        materials: &Materials<'_>,
        lighting: &Lighting,
    ) -> Result<Lit<'a>, RenderError> {
        let scene = LoadedGpu::new(self, geometry)?;
        let mut texels = Texels::default();
        let materials_here: Vec<Material> = materials
            .objects()
            .iter()
            .map(|o| Material {
                base_color: o.material.base_color,
                metallic: o.material.metallic,
                emission: o.material.emissive,
                roughness: o.material.roughness,
                pictures: o.material.textures().map(|t| texels.add(t)),
            })
            .collect();
        let skins: Vec<Skin> = scene.source.iter().map(|&t| skin(materials, t)).collect();
        let dark = [Lamp::zeroed()];
        let lamps: Vec<Lamp> = lighting.lights.iter().map(Lamp::new).collect();
        let lamps = if lamps.is_empty() { &dark[..] } else { &lamps };
        let table: [f32; 256] = std::array::from_fn(|byte| srgb(byte as u8) as f32);
        let device = &self.device;
        let buffers = device.guarded(|| {
            device.fits("textures", texels.count * size_of::<u32>() as u64)?;
            let mut all: Vec<[u8; 4]> = Vec::with_capacity(texels.count as usize);
            for texture in &texels.textures {
                let end = all.len() + extent(texture);
                all.extend(&texture.texels);
                all.resize(end, [0; 4]);
            }
            // A binding has at least one element.
            all.resize(all.len().max(1), [0; 4]);
            Ok(vec![
                (10, device.upload("texture coordinates", bytemuck::cast_slice(&skins))?),
                (11, device.upload("materials", bytemuck::cast_slice(&materials_here))?),
                (12, device.upload("textures", bytemuck::cast_slice(&all))?),
                (13, device.uniform("srgb", &table)?),
                (14, device.upload("lights", bytemuck::cast_slice(lamps))?),
                (15, device.uniform("sky", &Backdrop::new(lighting))?),
            ])
        })?;
        Ok(Lit { scene, buffers, lights: lamps.len() as u32, image: None })
    }
}

/// What a triangle of the scene wears.
fn skin(materials: &Materials<'_>, triangle: u32) -> Skin {
    let (object, triangle) = materials.place(triangle);
    let uvs = materials.objects().get(object).and_then(|o| corner_uvs(o, triangle));
    Skin {
        uvs: uvs.map_or([[0.0; 2]; 3], |corners| corners.map(|uv| uv.to_array())),
        material: object as u32,
        mapped: uvs.is_some().into(),
    }
}

impl Lit<'_> {
    /// What each pixel of a view shows, one point a pixel.
    ///
    /// # Errors
    /// [`RenderError`] where the image does not fit or the device fails.
    pub fn shade(&mut self, view: &View) -> Result<Vec<Shaded>, RenderError> {
        let pixels = view.pixels();
        let image = match self.image.take() {
            Some(image) if image.0 == pixels => image,
            _ => self.image(pixels)?,
        };
        let device = &self.scene.gpu.device;
        let shaded: Vec<Shaded> = device.guarded(|| {
            let (_, buffer, bound) = &image;
            // Of the job only the view is asked for; its rays are the lights.
            let ao = AoScale { radius: 1.0, secondary_radius: 1.0 };
            let job =
                Job { view, camera: None, estimator: Estimator::CLASSIC, ao, rays: self.lights, seed: 0, replicate: 0 };
            let pieces = pieces(places(view.resolution), self.lights, LIGHTS_AN_INVOCATION, self.scene.budget());
            self.scene.dispatch(&job, &Program::new(&job.estimator)?, bound, pieces, None);
            device.read(buffer)
        })?;
        self.image = Some(image);
        if shaded.iter().any(|s| s.direct.x == STOPPED) {
            return Err(stopped());
        }
        Ok(shaded)
    }

    fn image(&self, pixels: usize) -> Result<(usize, wgpu::Buffer, Bound), RenderError> {
        let gpu = self.scene.gpu;
        gpu.device.guarded(|| {
            let shaded = gpu.device.storage("pixels", pixels as u64 * size_of::<Shaded>() as u64)?;
            let kernel = self.scene.tracing_kernel(SHADER, "shade", vec![])?;
            let own = self.buffers.iter().map(|(binding, buffer)| (*binding, buffer.as_entire_binding()));
            let all: Vec<_> = [self.scene.told()]
                .into_iter()
                .chain(self.scene.tracing())
                .chain(own)
                .chain([(16, shaded.as_entire_binding())])
                .collect();
            let group = gpu.device.bind(&kernel, &all);
            Ok((pixels, shaded, Bound { kernel, group }))
        })
    }
}
