//! Screen space: openness from what one camera sees, its depth and its normals,
//! and no ray. `hbao` and `gtao` both look along lines of the image for horizons.
//! Twin: `gpu/shaders/screen_space.wgsl`.

mod gtao;
mod hbao;

pub use gtao::SECTORS;

use super::{
    Falloff, Job, RenderError,
    ao::tangents,
    gbuffer::{GBuffer, Surface},
    sampler::{Sampler, turn},
};
use crate::trace::Tracer;
use aogauge_scenes::{AoScale, View, WorldToImage};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Options of `hbao` and `gtao`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenSpace {
    /// What is made of the horizons.
    pub integral: Integral,
    /// Depth samples along a direction, 1 to [`ScreenSpace::MOST_STEPS`]; a slice
    /// of `gtao` takes as many to each side.
    pub steps: u32,
    /// Sample j of n lies at ((j + jitter) / n) to this power of R: 1 to 4. Above
    /// 1 samples crowd near the point.
    pub sample_power: u32,
    /// How much a sample at a distance lifts the horizon: 1 - mu, and not at all
    /// beyond R. Not [`Falloff::Exponential`], which has no end.
    pub falloff: Falloff,
    /// R in place of the scene's, metres.
    pub radius: Option<f32>,
    /// R is taken this many times.
    pub radius_multiplier: f32,
    /// The image is the mean over slices to this power, as in
    /// [`Openness`](super::Openness::intensity).
    pub intensity: f32,
}

/// What is made of the horizons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Integral {
    /// Uniform in solid angle, by directions (Bavoil, Sainz and Dimitrov 2008).
    Hbao {
        /// Horizons up to this angle over the tangent plane count for nothing;
        /// degrees, 0 to below 90.
        tangent_bias: f32,
    },
    /// Cosine-weighted, by slices (Jimenez et al. 2016).
    Gtao {
        /// What the image shows is taken to be this thick along the line of sight,
        /// metres (with [`Falloff::Step`] only); None for endless.
        thickness: Option<f32>,
    },
}

impl ScreenSpace {
    /// The most depth samples along a direction.
    pub const MOST_STEPS: u32 = 64;

    /// HBAO with the quadratic attenuation of its paper.
    pub const HBAO: ScreenSpace =
        ScreenSpace { integral: Integral::Hbao { tangent_bias: 10.0 }, falloff: Falloff::Quadratic, ..Self::GTAO };

    /// GTAO without falloff: what lies within R counts in full.
    pub const GTAO: ScreenSpace = ScreenSpace {
        integral: Integral::Gtao { thickness: None },
        steps: 8,
        sample_power: 1,
        falloff: Falloff::Step,
        radius: None,
        radius_multiplier: 1.0,
        intensity: 1.0,
    };

    /// R in a scene, metres.
    pub fn radius(&self, scene: AoScale) -> f32 {
        self.radius.unwrap_or(scene.radius) * self.radius_multiplier
    }

    /// How many directions a slice looks along.
    pub fn sides(&self) -> u32 {
        if matches!(self.integral, Integral::Gtao { .. }) { 2 } else { 1 }
    }

    /// Openness from a sum over slices.
    pub fn mean(&self, sum: f64, slices: u32) -> f32 {
        let mean = sum / f64::from(slices);
        if self.intensity == 1.0 { mean as f32 } else { mean.max(0.0).powf(f64::from(self.intensity)) as f32 }
    }
}

/// What says that no pixel of the camera shows a point.
pub const UNSEEN: u32 = u32::MAX;

/// Below this share of its distance over the tangent plane a sample is no
/// horizon. On a plane there is none by theory; this is for rounding, and for the
/// pixel's centre that is taken for the point that was asked for.
const FLAT: f32 = 1e-3;

/// What a camera sees, and which of its pixels a view takes.
#[derive(Clone, Debug)]
pub struct Screen {
    view: View,
    /// The camera.
    pub camera: View,
    /// Where points appear in its image.
    pub to_image: WorldToImage,
    /// What it sees.
    pub gbuffer: GBuffer,
    /// For each pixel of the view, the pixel of the camera that shows its point;
    /// [`UNSEEN`] where there is none.
    pub gathered: Vec<u32>,
}

impl Screen {
    /// Sees through the camera; where there is none, through the view itself.
    /// `points` is what the view sees.
    ///
    /// # Errors
    /// [`RenderError::Camera`] where the camera is neither perspective nor
    /// orthographic.
    pub fn new(tracer: &Tracer, points: &GBuffer, view: &View, camera: Option<&View>) -> Result<Self, RenderError> {
        let camera = *camera.unwrap_or(view);
        let to_image = camera.world_to_image().ok_or(RenderError::Camera)?;
        let (gbuffer, gathered) = if camera == *view {
            let own = |(i, s): (usize, &Option<Surface>)| s.map_or(UNSEEN, |_| i as u32);
            (points.clone(), points.surfaces.iter().enumerate().map(own).collect())
        } else {
            let gbuffer = GBuffer::new(tracer, &camera);
            let gathered = gather(points, view, &gbuffer, &to_image);
            (gbuffer, gathered)
        };
        Ok(Screen { view: *view, camera, to_image, gbuffer, gathered })
    }

    /// The same for a job, taken from `last` where that fits: replicates share it.
    ///
    /// # Errors
    /// As [`Screen::new`].
    pub fn again<'a>(
        last: &'a mut Option<Screen>,
        tracer: &Tracer,
        points: &GBuffer,
        job: &Job<'_>,
    ) -> Result<&'a Screen, RenderError> {
        let screen = match last.take() {
            Some(screen) if screen.suits(job) => screen,
            _ => Screen::new(tracer, points, job.view, job.camera)?,
        };
        Ok(last.insert(screen))
    }

    /// Whether it is that of a job.
    pub fn suits(&self, job: &Job<'_>) -> bool {
        self.view == *job.view && self.camera == *job.camera.unwrap_or(job.view)
    }

    /// Openness at each pixel of the view, NaN where the camera does not show its
    /// point; `job.rays` is the number of slices, or directions, a pixel. A pixel
    /// of the camera has one value, whoever takes it: random numbers are those of
    /// the camera's pixel.
    pub fn openness(&self, job: &Job<'_>, method: &ScreenSpace) -> Vec<f32> {
        let radius = method.radius(job.ao);
        let value = |&pixel: &u32| {
            let Some(point) = Point::new(self, pixel, radius) else {
                return f32::NAN;
            };
            let sampler = Sampler::new(job.seed, pixel, job.replicate);
            let slice = |i: u32| {
                let place = sampler.pair(i, 0);
                match method.integral {
                    Integral::Hbao { tangent_bias } => hbao::direction(&point, method, bias(tangent_bias), place),
                    Integral::Gtao { thickness } => gtao::slice(&point, method, thickness, place),
                }
            };
            method.mean((0..job.rays).map(|i| f64::from(slice(i))).sum(), job.rays)
        };
        self.gathered.par_iter().with_min_len(64).map(value).collect()
    }
}

/// Cosine and sine of an angle in degrees.
pub(in crate::render) fn bias(degrees: f32) -> [f32; 2] {
    let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
    [cos as f32, sin as f32]
}

/// The pixels of a camera that show the points of a view.
fn gather(points: &GBuffer, view: &View, camera: &GBuffer, to_image: &WorldToImage) -> Vec<u32> {
    let of_view = view.world_to_image();
    let shown = |surface: &Option<Surface>| {
        let s = surface.as_ref()?;
        let at = to_image.at(s.point)?;
        let pixel = pixel_at(at.truncate(), camera.resolution)?;
        let there = camera.surfaces[pixel as usize].as_ref()?;
        // As far as the view's own next pixel is the same point to the view.
        let depth = of_view.and_then(|v| v.at(s.point)).map_or(0.0, |at| at.z);
        let same = (view.origin_dx + view.direction_dx * depth).length();
        let near = there.point.distance(s.point) <= same && there.normal.dot(s.normal) > 0.9;
        near.then_some(pixel)
    };
    points.surfaces.par_iter().map(|s| shown(s).unwrap_or(UNSEEN)).collect()
}

/// The pixel at a place of an image; None beside it.
fn pixel_at(place: Vec2, [width, height]: [u32; 2]) -> Option<u32> {
    let inside = place.x >= 0.0 && place.y >= 0.0 && place.x < width as f32 && place.y < height as f32;
    inside.then(|| place.y as u32 * width + place.x as u32)
}

/// A pixel of the camera with what its slices share.
struct Point<'a> {
    screen: &'a Screen,
    pixel: u32,
    point: Vec3,
    normal: Vec3,
    /// Unit vector towards the eye.
    to_eye: Vec3,
    /// Across it.
    frame: [Vec3; 2],
    /// Of the pixel in the image.
    centre: Vec2,
    /// In multiples of the camera's ray direction; 1 where that is the same for
    /// all pixels.
    depth: f32,
    radius: f32,
}

/// A way from a point across its line of sight, and what it is in the image: at
/// distance r from the point, `step` r / (depth + `recede` r) from its pixel.
struct Way {
    step: Vec2,
    recede: f32,
}

/// A horizon: where it lies from the point, the cosine of its angle to the line of
/// sight, and how much it counts.
struct Horizon {
    there: Vec3,
    cosine: f32,
    weight: f32,
}

impl<'a> Point<'a> {
    fn new(screen: &'a Screen, pixel: u32, radius: f32) -> Option<Self> {
        let surface = screen.gbuffer.surfaces.get(pixel as usize)?.as_ref()?;
        let width = screen.gbuffer.resolution[0];
        let perspective = screen.to_image.perspective;
        let to_eye = if perspective { screen.camera.origin - surface.point } else { -screen.camera.direction };
        let to_eye = to_eye.normalize();
        Some(Point {
            screen,
            pixel,
            point: surface.point,
            normal: surface.normal,
            to_eye,
            frame: tangents(to_eye),
            centre: Vec2::new((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5),
            depth: if perspective { depth(&screen.to_image, surface.point - screen.to_image.origin) } else { 1.0 },
            radius,
        })
    }

    /// The unit vector across the line of sight at this part of a turn.
    fn across(&self, turns: f32) -> Vec3 {
        let [cos, sin] = turn(turns);
        self.frame[0] * cos + self.frame[1] * sin
    }

    /// The way in this direction.
    fn way(&self, direction: Vec3) -> Way {
        let moved = self.screen.to_image.to_image * direction;
        let recede = if self.screen.to_image.perspective { moved.z } else { 0.0 };
        Way { step: moved.truncate() - self.centre * recede, recede }
    }

    /// The horizon that the image shows at distance `r` along a way: None where
    /// it shows nothing, the pixel itself, or what does not rise above the
    /// tangent plane.
    fn horizon(&self, way: &Way, r: f32, falloff: Falloff) -> Option<Horizon> {
        let depth = self.depth + way.recede * r;
        if depth <= 0.0 {
            return None;
        }
        let pixel = pixel_at(self.centre + way.step * (r / depth), self.screen.gbuffer.resolution)?;
        if pixel == self.pixel {
            return None;
        }
        let there = self.screen.gbuffer.surfaces[pixel as usize].as_ref()?.point - self.point;
        let distance = there.length();
        if distance > self.radius || self.normal.dot(there) <= FLAT * distance {
            return None;
        }
        Some(Horizon { there, cosine: self.cosine(there), weight: 1.0 - falloff.mu(distance, self.radius) })
    }

    /// Of the angle between a vector and the line of sight.
    fn cosine(&self, there: Vec3) -> f32 {
        (self.to_eye.dot(there) / there.length()).clamp(-1.0, 1.0)
    }

    /// The same vector, this much further from the eye, metres.
    fn behind(&self, there: Vec3, thickness: f32) -> Vec3 {
        let screen = self.screen;
        let away = if screen.to_image.perspective {
            self.point + there - screen.camera.origin
        } else {
            screen.camera.direction
        };
        there + away.normalize() * thickness
    }

    /// Where sample `j` lies on its way, metres.
    fn place(&self, method: &ScreenSpace, j: u32, jitter: f32) -> f32 {
        let share = (j as f32 + jitter) / method.steps as f32;
        let mut place = self.radius;
        for _ in 0..method.sample_power {
            place *= share;
        }
        place
    }
}

/// Depth of a vector from the camera, in multiples of its ray direction.
fn depth(to_image: &WorldToImage, from: Vec3) -> f32 {
    let m = to_image.to_image;
    Vec3::new(m.x_axis.z, m.y_axis.z, m.z_axis.z).dot(from)
}
