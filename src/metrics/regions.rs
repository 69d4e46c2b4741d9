//! Which receiver points lie under the occluder, beside it, and far away, from
//! geometry alone.

use super::Absent;
use crate::{render::gbuffer::GBuffer, render::gbuffer::Surface, trace::Tracer};
use aogauge_scenes::Scene;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fewer pixels than this make a region's metrics null.
pub const MIN_PIXELS: usize = 64;

/// How far the footprint reaches beyond the sheet, in R.
const FOOTPRINT_MARGIN: f32 = 0.02;
/// Where the flanks begin and end, in R from the sheet.
const FLANK: [f32; 2] = [0.15, 0.45];
/// What still counts as the receiver's own plane, in R.
const OWN_PLANE: f32 = 1e-3;
/// Pixel centres that lie on a border by construction must not fall to rounding,
/// in R.
const ROUNDING: f32 = 1e-4;

/// A part of the receiver (DESIGN, "The words").
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Region {
    /// Every pixel that sees a surface.
    All,
    /// Points that the occluder's part within R stands over, widened by 0.02 R.
    Footprint,
    /// Points 0.15 R to 0.45 R beside the occluder, against the transect.
    Left,
    /// The same along the transect.
    Right,
    /// Points with no triangle within R but those of their own tangent plane.
    Far,
}

impl Region {
    /// All regions.
    pub const ALL: [Region; 5] = [Region::All, Region::Footprint, Region::Left, Region::Right, Region::Far];

    /// As it is written in suites and records.
    pub fn label(self) -> &'static str {
        match self {
            Region::All => "all",
            Region::Footprint => "footprint",
            Region::Left => "left",
            Region::Right => "right",
            Region::Far => "far",
        }
    }
}

/// The pixels of each region of one view.
#[derive(Clone, Debug, PartialEq)]
pub struct Regions {
    pixels: [Vec<u32>; 5],
}

impl Regions {
    /// Finds the regions of what the scene's measure view sees.
    pub fn new(scene: &Scene, tracer: &Tracer, gbuffer: &GBuffer) -> Self {
        let occluder: Vec<[Vec3; 3]> =
            scene.triangles().filter(|(o, _)| scene.objects[*o].occluder).map(|(_, t)| t).collect();
        let transect = scene.measure.transect;
        let radius = scene.ao.radius;
        let found: Vec<[bool; 5]> = gbuffer
            .surfaces
            .par_iter()
            .map(|surface| match surface {
                None => [false; 5],
                Some(s) => classify(s, &occluder, transect, radius, tracer),
            })
            .collect();
        let pixels =
            std::array::from_fn(|region| (0..found.len() as u32).filter(|&i| found[i as usize][region]).collect());
        Regions { pixels }
    }

    /// The pixels of a region, in order.
    pub fn pixels(&self, region: Region) -> &[u32] {
        &self.pixels[region as usize]
    }

    /// The region as a mask of 0 and 1.
    pub fn mask(&self, region: Region, pixels: usize) -> Vec<f32> {
        let mut mask = vec![0.0; pixels];
        for &i in self.pixels(region) {
            mask[i as usize] = 1.0;
        }
        mask
    }

    /// The pixels of a region that is large enough to measure.
    ///
    /// # Errors
    /// Why it is not.
    pub fn measurable(&self, region: Region) -> Result<&[u32], Absent> {
        let pixels = self.pixels(region);
        if pixels.len() < MIN_PIXELS {
            return Err(Absent(format!(
                "region '{}' has {} pixels, fewer than {MIN_PIXELS}",
                region.label(),
                pixels.len()
            )));
        }
        Ok(pixels)
    }

    /// Mean of an image over a region.
    ///
    /// # Errors
    /// Where the region is too small.
    pub fn mean(&self, region: Region, image: &[f32]) -> Result<f64, Absent> {
        let pixels = self.measurable(region)?;
        Ok(pixels.iter().map(|&i| f64::from(image[i as usize])).sum::<f64>() / pixels.len() as f64)
    }
}

/// Membership of one receiver point in each region.
fn classify(s: &Surface, occluder: &[[Vec3; 3]], transect: Vec3, radius: f32, tracer: &Tracer) -> [bool; 5] {
    // Axes of the tangent plane: along the transect and across it.
    let x = (transect - s.normal * s.normal.dot(transect)).normalize_or_zero();
    let y = s.normal.cross(x);
    let nearest = occluder
        .iter()
        .filter_map(|t| nearest_shadow(s, t, radius, x, y))
        .min_by(|a, b| a.length().total_cmp(&b.length()));
    let mut member = [false; 5];
    member[Region::All as usize] = true;
    if let Some(to) = nearest {
        let distance = to.length() / radius;
        member[Region::Footprint as usize] = distance <= FOOTPRINT_MARGIN + ROUNDING;
        if (FLANK[0] - ROUNDING..=FLANK[1] + ROUNDING).contains(&distance) {
            let side = if to.x > 0.0 { Region::Left } else { Region::Right };
            member[side as usize] = true;
        }
    }
    member[Region::Far as usize] = tracer
        .nearest(s.point, radius, |t| t.iter().any(|v| s.normal.dot(*v - s.point).abs() > OWN_PLANE * radius))
        .is_none();
    member
}

/// The vector, in the tangent plane of `s`, from `s` to the nearest point of the
/// triangle's shadow: its part between 0 and `radius` above the plane, projected
/// along the normal. None where it has no such part; zero where it stands over `s`.
fn nearest_shadow(s: &Surface, triangle: &[Vec3; 3], radius: f32, x: Vec3, y: Vec3) -> Option<Vec2> {
    let local = triangle.map(|v| {
        let d = v - s.point;
        Vec3::new(d.dot(x), d.dot(y), s.normal.dot(d))
    });
    let above = clip(&local, |v| v.z);
    let slab = clip(&above, |v| radius - v.z);
    let polygon: Vec<Vec2> = slab.iter().map(|v| v.truncate()).collect();
    let n = polygon.len();
    if n == 0 {
        return None;
    }
    let edge = |i: usize| (polygon[i], polygon[(i + 1) % n] - polygon[i]);
    let turns: Vec<f32> = (0..n)
        .map(|i| {
            let (a, e) = edge(i);
            e.perp_dot(-a)
        })
        .collect();
    if turns.iter().all(|&t| t > 0.0) || turns.iter().all(|&t| t < 0.0) {
        return Some(Vec2::ZERO);
    }
    (0..n)
        .map(|i| {
            let (a, e) = edge(i);
            let along = e.length_squared();
            let t = if along > 0.0 { (-a.dot(e) / along).clamp(0.0, 1.0) } else { 0.0 };
            a + e * t
        })
        .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
}

/// The part of a convex polygon where `inside` is 0 or more (Sutherland-Hodgman).
fn clip(polygon: &[Vec3], inside: impl Fn(Vec3) -> f32) -> Vec<Vec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (inside(a), inside(b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da < 0.0) != (db < 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Geometry;
    use aogauge_scenes::library;

    fn regions(name: &str) -> (Scene, GBuffer, Regions) {
        let scene = library::scene(name).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
        (scene, gbuffer, regions)
    }

    /// |t| <= w/2 + 0.02 R, and 0.15 R to 0.45 R beyond w/2, for every pixel.
    #[test]
    fn under_a_long_curtain_the_regions_are_bands() {
        let (scene, gbuffer, regions) = regions("curtain-open");
        let (r, half) = (scene.ao.radius, 0.01f32);
        let expected = |region: Region| -> Vec<u32> {
            (0..gbuffer.surfaces.len() as u32)
                .filter(|i| {
                    let t = scene.measure.transect_at(i % scene.measure.resolution[0]);
                    let beside = t.abs() - half;
                    match region {
                        Region::Footprint => beside <= 0.02 * r + 1e-5,
                        Region::Left => t < 0.0 && beside >= 0.15 * r - 1e-5 && beside <= 0.45 * r + 1e-5,
                        Region::Right => t > 0.0 && beside >= 0.15 * r - 1e-5 && beside <= 0.45 * r + 1e-5,
                        Region::Far => beside.max(0.0).hypot(0.1) > r,
                        Region::All => true,
                    }
                })
                .collect()
        };
        for region in Region::ALL {
            assert_eq!(regions.pixels(region), expected(region), "{region:?}");
            assert!(regions.measurable(region).is_ok());
        }
    }

    #[test]
    fn on_the_pillar_the_regions_stand_upright() {
        let (scene, _, regions) = regions("pillar");
        let width = scene.measure.resolution[0];
        for (region, columns) in [(Region::Footprint, 6), (Region::Left, 16), (Region::Right, 16)] {
            let pixels = regions.pixels(region);
            assert_eq!(pixels.len(), columns * scene.measure.resolution[1] as usize, "{region:?}");
        }
        assert!(regions.pixels(Region::Left).iter().all(|i| i % width < width / 2));
        assert!(regions.pixels(Region::Far).is_empty(), "the pillar's own edges are within R");
    }

    #[test]
    fn without_an_occluder_there_is_no_footprint() {
        let (_, gbuffer, regions) = regions("plane");
        assert!(regions.pixels(Region::Footprint).is_empty());
        assert_eq!(regions.pixels(Region::Far).len(), gbuffer.surfaces.len());
        assert!(regions.measurable(Region::Left).unwrap_err().0.contains("left"));
    }
}
