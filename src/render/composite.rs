//! The composite picture of the paper's section 6 (Fig. 8b): direct light by
//! glTF's BRDF, ambient light times openness, and emission. Twin:
//! `gpu/shaders/composite.wgsl`.

use super::{
    Estimator, Geometry, Job, Loaded, RenderError,
    brdf::brdf,
    gbuffer::{GBuffer, Surface},
    lights::arrival,
    materials::Materials,
    sampler::sobol,
};
use crate::trace::{Ray, Tracer};
use aogauge_scenes::{AoScale, Light, LightKind, Sky, View};
use glam::Vec3;
use rayon::prelude::*;

/// What lights the picture.
#[derive(Clone, Debug)]
pub struct Lighting {
    /// Punctual lights, the sun among them.
    pub lights: Vec<Light>,
    /// Ambient radiance a channel: the same from everywhere that is open.
    pub ambient: Vec3,
    /// The sky behind the scene, brought to the ambient radiance on the average.
    pub sky: Sky,
}

/// What to compose.
#[derive(Clone, Copy, Debug)]
pub struct Composition<'a> {
    /// From where.
    pub view: &'a View,
    /// Openness that the ambient light is multiplied by, a picture each; None
    /// for light that nothing keeps off.
    pub methods: &'a [Option<Estimator>],
    /// R and R'.
    pub ao: AoScale,
    /// Primary AO rays a pixel, shared by its samples.
    pub rays: u32,
    /// Points a pixel at which the scene is seen, 1 or more.
    pub samples: u32,
    /// Seed of all randomness.
    pub seed: u32,
}

/// What one point of a pixel shows, before ambient light and its occlusion.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Shaded {
    /// Radiance by punctual lights.
    pub direct: Vec3,
    /// Distance from the eye along the ray, metres; negative for the sky.
    pub depth: f32,
    /// Radiance sent out; that of the sky where there is no surface.
    pub emission: Vec3,
    _pad: f32,
    /// Diffuse albedo.
    pub albedo: Vec3,
    _pad2: f32,
    /// Unit geometric normal, towards the viewer.
    pub normal: Vec3,
    _pad3: f32,
}

/// Parts of a picture, a value a pixel, each the mean over its samples.
#[derive(Clone, Debug)]
pub struct Composite {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Radiance by punctual lights.
    pub direct: Vec<Vec3>,
    /// Radiance sent out, and the sky.
    pub emission: Vec<Vec3>,
    /// Diffuse albedo of what is seen; NaN where only sky is.
    pub albedo: Vec<Vec3>,
    /// Normal of what is seen; NaN where only sky is.
    pub normal: Vec<Vec3>,
    /// Distance of what is seen, metres; NaN where only sky is.
    pub depth: Vec<f32>,
    /// Share of the pixel's samples that see a surface.
    pub coverage: Vec<f32>,
    /// For each method.
    pub methods: Vec<Occluded>,
    /// Time that AO took, seconds.
    pub seconds: f64,
}

/// Ambient light by one method.
#[derive(Clone, Debug)]
pub struct Occluded {
    /// Openness of what is seen; NaN where only sky is.
    pub ao: Vec<f32>,
    /// Radiance by ambient light: albedo times ambient radiance times openness.
    pub ambient: Vec<Vec3>,
}

impl Composite {
    /// The picture by one method: direct, ambient and emission.
    pub fn color(&self, method: usize, pixel: usize) -> Vec3 {
        self.direct[pixel] + self.methods[method].ambient[pixel] + self.emission[pixel]
    }
}

/// The sun as a light: `azimuth` degrees from -Z towards +X (from north towards
/// east where -Z is north), `elevation` degrees above the horizon, irradiance on
/// a surface that faces it.
pub fn sun(azimuth: f32, elevation: f32, irradiance: Vec3) -> Light {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    Light {
        name: "sun".into(),
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: -Vec3::new(sin_a * cos_e, sin_e, -cos_a * cos_e),
        color: irradiance.to_array(),
        intensity: 1.0,
        range: None,
    }
}

/// Radiance of a uniform sky that lights an open floor as this one does.
pub fn mean_radiance(sky: Sky) -> f32 {
    match sky {
        Sky::None => 0.0,
        Sky::Uniform(radiance) => radiance,
        // The cosine-weighted mean of the sine of the elevation is 2/3.
        Sky::Gradient { zenith, horizon, .. } => horizon + (zenith - horizon) * (2.0 / 3.0),
    }
}

impl Lighting {
    /// The sky as the eye sees it.
    fn behind(&self, direction: Vec3) -> Vec3 {
        let mean = mean_radiance(self.sky);
        if mean > 0.0 { self.ambient * (self.sky.radiance(direction) / mean) } else { self.ambient }
    }
}

/// Where in a pixel sample `index` of `count` lies, from its centre: the Sobol
/// sequence, moved so that one sample is the centre.
pub fn place(index: u32, count: u32) -> [f32; 2] {
    sobol(index).map(|v| (f64::from(v) / 2.0f64.powi(32) + 0.5 / f64::from(count) - 0.5) as f32)
}

/// Radiance that punctual lights send to the viewer over a point.
pub fn direct(tracer: &Tracer, materials: &Materials<'_>, surface: &Surface, viewer: Vec3, lights: &[Light]) -> Vec3 {
    let here = materials.at(surface);
    let origin = surface.point + surface.normal * tracer.offset();
    let mut sum = Vec3::ZERO;
    for light in lights {
        let Some(arrival) = arrival(light, origin) else { continue };
        let cosine = surface.normal.dot(arrival.direction);
        if cosine > 0.0 && !tracer.occluded(&Ray::new(origin, arrival.direction, arrival.distance)) {
            sum += brdf(&here, surface.normal, arrival.direction, viewer) * arrival.irradiance * cosine;
        }
    }
    sum
}

/// What each pixel of a view shows, one point a pixel.
pub fn shade(geometry: &Geometry, materials: &Materials<'_>, view: &View, lighting: &Lighting) -> Vec<Shaded> {
    let gbuffer = GBuffer::new(&geometry.tracer, view);
    let width = view.resolution[0];
    let shaded = |pixel: usize, surface: &Option<Surface>| {
        let (origin, direction) = view.ray(pixel as u32 % width, pixel as u32 / width);
        let Some(surface) = surface else {
            return Shaded { depth: -1.0, emission: lighting.behind(direction), ..Shaded::default() };
        };
        let here = materials.at(surface);
        Shaded {
            direct: direct(&geometry.tracer, materials, surface, -direction, &lighting.lights),
            depth: (surface.point - origin).length(),
            emission: here.emission,
            albedo: here.albedo(),
            normal: surface.normal,
            ..Shaded::default()
        }
    };
    gbuffer.surfaces.par_iter().enumerate().with_min_len(64).map(|(i, s)| shaded(i, s)).collect()
}

/// Composes a picture, sample by sample: `shade` gives what a view shows, and
/// `loaded`, of the same scene, its openness. Every sample has random numbers of
/// its own.
///
/// # Errors
/// [`RenderError`] where the renderer fails.
pub fn compose(
    loaded: &mut dyn Loaded,
    what: &Composition<'_>,
    ambient: Vec3,
    mut shade: impl FnMut(&View) -> Result<Vec<Shaded>, RenderError>,
) -> Result<Composite, RenderError> {
    let mut sums = Sums::new(what);
    let samples = what.samples.max(1);
    for sample in 0..samples {
        let view = what.view.moved(place(sample, samples));
        let shaded = shade(&view)?;
        sums.see(&shaded);
        for (method, estimator) in what.methods.iter().enumerate() {
            let rays = what.rays.div_ceil(samples);
            let openness = match *estimator {
                None => None,
                Some(estimator) => {
                    let job = Job {
                        view: &view,
                        camera: None,
                        estimator,
                        ao: what.ao,
                        rays,
                        seed: what.seed,
                        replicate: sample,
                    };
                    Some(loaded.render(&job)?)
                }
            };
            sums.seconds += openness.as_ref().map_or(0.0, |f| f.seconds);
            sums.occlude(method, &shaded, ambient, openness.as_ref().map(|f| f.values.as_slice()));
        }
    }
    Ok(sums.mean(samples))
}

/// Sums over samples.
struct Sums {
    resolution: [u32; 2],
    /// Of depth: 0 for the sky.
    shaded: Vec<Shaded>,
    /// How many samples see a surface.
    seen: Vec<u32>,
    /// For each method, radiance and openness.
    methods: Vec<Vec<(Vec3, f32)>>,
    seconds: f64,
}

impl Sums {
    fn new(what: &Composition<'_>) -> Self {
        let pixels = what.view.pixels();
        Sums {
            resolution: what.view.resolution,
            shaded: vec![Shaded::default(); pixels],
            seen: vec![0; pixels],
            methods: vec![vec![(Vec3::ZERO, 0.0); pixels]; what.methods.len()],
            seconds: 0.0,
        }
    }

    fn see(&mut self, shaded: &[Shaded]) {
        for ((sum, seen), new) in self.shaded.iter_mut().zip(&mut self.seen).zip(shaded) {
            sum.direct += new.direct;
            sum.emission += new.emission;
            sum.albedo += new.albedo;
            sum.normal += new.normal;
            if new.depth >= 0.0 {
                sum.depth += new.depth;
                *seen += 1;
            }
        }
    }

    fn occlude(&mut self, method: usize, shaded: &[Shaded], ambient: Vec3, openness: Option<&[f32]>) {
        for (pixel, (sum, new)) in self.methods[method].iter_mut().zip(shaded).enumerate() {
            let open = openness.map_or(1.0, |o| o[pixel]);
            if new.depth >= 0.0 && !open.is_nan() {
                sum.0 += new.albedo * ambient * open;
                sum.1 += open;
            }
        }
    }

    fn mean(self, samples: u32) -> Composite {
        let all = 1.0 / samples as f32;
        let over = |value: fn(&Shaded) -> Vec3| self.shaded.iter().map(|s| value(s) * all).collect();
        let seen: Vec<f32> = self.seen.iter().map(|&n| if n > 0 { 1.0 / n as f32 } else { f32::NAN }).collect();
        let of_seen =
            |value: fn(&Shaded) -> Vec3| self.shaded.iter().zip(&seen).map(|(s, part)| value(s) * *part).collect();
        let methods = self.methods.iter().map(|sums| Occluded {
            ao: sums.iter().zip(&seen).map(|((_, ao), part)| ao * part).collect(),
            ambient: sums.iter().map(|(light, _)| *light * all).collect(),
        });
        Composite {
            resolution: self.resolution,
            direct: over(|s| s.direct),
            emission: over(|s| s.emission),
            albedo: of_seen(|s| s.albedo),
            normal: of_seen(|s| s.normal),
            depth: self.shaded.iter().zip(&seen).map(|(s, part)| s.depth * part).collect(),
            coverage: self.seen.iter().map(|&n| n as f32 * all).collect(),
            methods: methods.collect(),
            seconds: self.seconds,
        }
    }
}

#[cfg(test)]
mod tests;
