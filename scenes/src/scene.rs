//! A scene: objects, light, scale and views.

use crate::{Camera, Environment, Light, LightKind, LookView, Material, MeasureView, Mesh, Sky};
use glam::Vec3;
use sha2::{Digest, Sha256};
use std::borrow::Cow;

/// The scale on which ambient occlusion looks at a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AoScale {
    /// R: length of a primary ray, metres.
    pub radius: f32,
    /// R': half length of a secondary ray, metres.
    pub secondary_radius: f32,
}

/// A named mesh with its material.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Unique in its scene.
    pub name: String,
    /// Whether this is (part of) the occluder under judgement.
    pub occluder: bool,
    /// What it is made of.
    pub material: Material,
    /// The triangles.
    pub mesh: Mesh,
}

/// Everything a renderer needs to know.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Unique in a suite.
    pub name: String,
    /// What it is for.
    pub description: String,
    /// Whether it is a control, where the methods under test should agree.
    pub control: bool,
    /// R and R'.
    pub ao: AoScale,
    /// The light.
    pub environment: Environment,
    /// Where metrics and goldens are taken.
    pub measure: MeasureView,
    /// Where pictures are taken.
    pub look: LookView,
    /// The geometry; at least one object is no occluder.
    pub objects: Vec<Object>,
    /// Punctual lights beside the environment; none of generated scenes.
    pub lights: Vec<Light>,
    /// Cameras that a model brought along; none of generated scenes.
    pub cameras: Vec<Camera>,
}

impl Scene {
    /// Whether there is an occluder to judge.
    pub fn has_occluder(&self) -> bool {
        self.objects.iter().any(|o| o.occluder)
    }

    /// The same scene with the occluder under judgement taken away.
    #[must_use]
    pub fn twin(&self) -> Scene {
        let mut twin = self.clone();
        twin.objects.retain(|o| !o.occluder);
        twin
    }

    /// The same scene with the centre of its measure view in the origin, where
    /// that at least halves the largest coordinate; else itself. Traced there, a
    /// scene far from the origin reads as it would near it: rounding grows with
    /// coordinates.
    pub fn near_origin(&self) -> Cow<'_, Scene> {
        let center = self.measure.center;
        let largest = |from: Vec3| {
            let points = self.objects.iter().flat_map(|o| &o.mesh.positions);
            points.fold(0.0f32, |m, p| m.max((*p - from).abs().max_element()))
        };
        if largest(center) * 2.0 > largest(Vec3::ZERO) {
            return Cow::Borrowed(self);
        }
        let mut near = self.clone();
        near.objects.iter_mut().flat_map(|o| &mut o.mesh.positions).for_each(|p| *p -= center);
        near.environment.portals.iter_mut().for_each(|p| p.corner -= center);
        near.lights.iter_mut().for_each(|l| l.position -= center);
        near.cameras.iter_mut().for_each(|c| c.position -= center);
        near.measure.center = Vec3::ZERO;
        near.look.eye -= center;
        near.look.target -= center;
        Cow::Owned(near)
    }

    /// All triangles in object order, each with the index of its object.
    pub fn triangles(&self) -> impl Iterator<Item = (usize, [Vec3; 3])> + '_ {
        self.objects.iter().enumerate().flat_map(|(i, o)| o.mesh.corners().map(move |t| (i, t)))
    }

    /// Content hash (SHA-256, hex) of everything that can change a measurement:
    /// geometry, materials, light, scale, measure view. Names, descriptions, the
    /// look view and other cameras do not count.
    pub fn hash(&self) -> String {
        let mut digest = Digester(Sha256::new());
        digest.floats(&[self.ao.radius, self.ao.secondary_radius]);
        match self.environment.sky {
            Sky::None => digest.floats(&[]),
            Sky::Uniform(radiance) => digest.floats(&[radiance]),
            Sky::Gradient { zenith, horizon, ground } => digest.floats(&[zenith, horizon, ground]),
        }
        digest.count(self.environment.portals.len());
        for p in &self.environment.portals {
            digest.vectors(&[p.corner, p.u, p.v]);
        }
        let m = &self.measure;
        digest.vectors(&[m.center, m.normal, m.transect]);
        digest.floats(&[m.clearance, m.pixel]);
        m.resolution.iter().for_each(|&n| digest.count(n as usize));
        digest.count(self.lights.len());
        for light in &self.lights {
            digest.floats(&light_numbers(light));
        }
        digest.count(self.objects.len());
        for object in &self.objects {
            digest.object(object);
        }
        digest.0.finalize().iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// Takes everything in with its length, so that no two scenes sound alike.
struct Digester(Sha256);

impl Digester {
    fn count(&mut self, n: usize) {
        self.0.update((n as u64).to_le_bytes());
    }

    fn floats(&mut self, values: &[f32]) {
        self.count(values.len());
        for v in values {
            self.0.update(v.to_bits().to_le_bytes());
        }
    }

    fn vectors(&mut self, vectors: &[Vec3]) {
        self.count(vectors.len());
        for v in vectors {
            v.to_array().iter().for_each(|c| self.0.update(c.to_bits().to_le_bytes()));
        }
    }

    fn object(&mut self, o: &Object) {
        let m = &o.material;
        self.floats(&[f32::from(u8::from(o.occluder)), m.metallic]);
        self.floats(&m.base_color);
        self.floats(&m.emissive);
        let textures = m.textures();
        for texture in textures {
            let Some(texture) = texture else {
                self.count(0);
                continue;
            };
            self.count(1);
            texture.size.iter().for_each(|&n| self.count(n as usize));
            self.0.update(texture.wrap.map(|w| w as u8));
            texture.texels.iter().for_each(|texel| self.0.update(texel));
        }
        if textures.iter().any(Option::is_some) {
            self.count(o.mesh.uvs.len());
            o.mesh.uvs.iter().for_each(|uv| self.floats(&uv.to_array()));
        }
        self.count(o.mesh.triangles.len());
        o.mesh.corners().for_each(|corners| self.vectors(&corners));
    }
}

/// Everything about a light that can change a measurement.
fn light_numbers(light: &Light) -> Vec<f32> {
    let (kind, inner, outer) = match light.kind {
        LightKind::Directional => (0.0, 0.0, 0.0),
        LightKind::Point => (1.0, 0.0, 0.0),
        LightKind::Spot { inner, outer } => (2.0, inner, outer),
    };
    let mut numbers = vec![kind, inner, outer, light.intensity, light.range.unwrap_or(f32::INFINITY)];
    numbers.extend(light.position.to_array().into_iter().chain(light.direction.to_array()).chain(light.color));
    numbers
}
