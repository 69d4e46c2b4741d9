//! Which receiver points lie under the occluder, beside it, and far away, from
//! geometry alone.

mod cut;
mod finder;
mod patches;

pub use cut::cut_flank;
pub use finder::{Finder, OccluderRegions};

use super::Absent;
use crate::counted::counted;
use crate::{render::gbuffer::GBuffer, trace::Tracer};
use aogauge_scenes::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Fewer pixels than this make a region's metrics null.
pub const MIN_PIXELS: usize = 64;

/// A part of the receiver (docs/metrics.md, regions).
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
    /// Finds the regions of what the scene's measure view sees; `tracer` holds the
    /// whole scene.
    pub fn new(scene: &Scene, tracer: &Tracer, gbuffer: &GBuffer) -> Self {
        Finder::new(scene, tracer).regions(gbuffer)
    }

    /// Regions from masks, as [`Regions::mask`] makes them: what is above 0 belongs to them.
    pub fn of_masks<'m>(mask: impl Fn(Region) -> &'m [f32]) -> Self {
        let pixels = |region| (0..).zip(mask(region)).filter(|(_, v)| **v > 0.0).map(|(i, _)| i).collect();
        Regions { pixels: Region::ALL.map(pixels) }
    }

    /// Regions of these pixels, in the order of [`Region::ALL`]; a pixel may come several
    /// times, and counts as often.
    pub(super) fn of_pixels(pixels: [Vec<u32>; 5]) -> Self {
        Regions { pixels }
    }

    /// The same regions without the pixels that `keep` refuses.
    #[must_use]
    pub fn only(&self, keep: impl Fn(u32) -> bool) -> Regions {
        Regions { pixels: self.pixels.each_ref().map(|p| p.iter().copied().filter(|&i| keep(i)).collect()) }
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
                "region '{}' has {}, fewer than {MIN_PIXELS}",
                region.label(),
                counted(pixels.len(), "pixel", "pixels")
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Geometry;
    use aogauge_scenes::library;
    use glam::{Vec2, Vec3};

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

    /// A round pillar of radius 0.3 m and 256 sides, and a radial sheet of no
    /// thickness 5 cm off it: along the pillar, flanks are bands of arc length; with
    /// a wall along the sheet, nearer to it than the pillar, too.
    #[test]
    fn round_a_pillar_flanks_are_bands_of_arc_length() {
        let wall = r#"
[[object]]
name = "wall"
shape = { plane = { center = [0.02, 0.5, 0.65], u = [0, 1, 0], v = [0, 0, 0.6] } }
"#;
        for beside in ["", wall] {
            are_bands_of_arc_length(beside);
        }
    }

    fn are_bands_of_arc_length(beside: &str) {
        let (sides, radius) = (256, 0.3f32);
        let ring = |y: f32| {
            (0..sides).map(move |i| {
                let a = std::f32::consts::TAU * (i as f32 + 0.5) / sides as f32;
                format!("[{}, {y}, {}]", radius * a.sin(), radius * a.cos())
            })
        };
        let positions: Vec<String> = ring(0.0).chain(ring(1.0)).collect();
        let triangles: Vec<String> = (0..sides)
            .flat_map(|i| {
                let j = (i + 1) % sides;
                [format!("[{i}, {j}, {}]", sides + j), format!("[{i}, {}, {}]", sides + j, sides + i)]
            })
            .collect();
        let text = format!(
            r#"
description = "x"
ao = {{ radius = 0.25 }}
environment = {{ radiance = 1.0 }}
measure = {{ center = [0, 0.5, 0.3], normal = [0, 0, 1], transect = [1, 0, 0], clearance = 0.04, resolution = [112, 32] }}
look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}
[[object]]
name = "pillar"
shape = {{ polygons = {{ positions = [{}], triangles = [{}] }} }}
[[object]]
name = "sheet"
occluder = true
shape = {{ polygons = {{ positions = [[0, 0, 0.35], [0, 1, 0.35], [0, 1, 0.9], [0, 0, 0.9]], triangles = [[0, 1, 2], [0, 2, 3]] }} }}
{beside}"#,
            positions.join(", "),
            triangles.join(", ")
        );
        let scene = Scene::from_toml("x", "x.toml", &text, None).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
        let mut checked = 0;
        for (i, s) in gbuffer.surfaces.iter().enumerate() {
            let Some(s) = s else { continue };
            let arc = radius * s.point.x.atan2(s.point.z) / 0.25;
            // The sides are flat, which moves an edge by up to half a side.
            if [0.02, 0.15, 0.45].iter().any(|edge| (arc.abs() - edge).abs() < 0.016) {
                continue;
            }
            let is = |region| regions.pixels(region).contains(&(i as u32));
            assert_eq!(is(Region::Footprint), arc.abs() < 0.02, "{arc}");
            assert_eq!(is(Region::Right), arc > 0.15 && arc < 0.45, "{arc}");
            assert_eq!(is(Region::Left), arc < -0.15 && arc > -0.45, "{arc}");
            checked += 1;
        }
        assert!(checked > 2_000 && regions.pixels(Region::Left).len() > 300, "{checked}");
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

    /// A short curtain: points beyond its ends are no flank.
    #[test]
    fn beyond_the_end_of_a_sheet_there_is_no_flank() {
        let mut scene = library::scene("curtain-open").unwrap();
        for v in &mut scene.objects[1].mesh.positions {
            v.z *= 0.2 / 3.0;
        }
        scene.measure.resolution = [96, 208];
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
        for region in [Region::Left, Region::Right] {
            let inside = |z: f32, x: f32| z.abs() <= 0.2 || z.abs() - 0.2 < x.abs() - 0.01;
            for &i in regions.pixels(region) {
                let p = gbuffer.surfaces[i as usize].unwrap().point;
                assert!(inside(p.z, p.x), "{p}");
            }
        }
        // Corners, where the test is a tie, may fall either way.
        let [left, right] = [Region::Left, Region::Right].map(|r| regions.pixels(r).len());
        assert!(left.abs_diff(right) <= 8 && left > 1200, "{left}, {right}");
    }

    /// A folded sheet of no thickness: the footprint is what lies within 0.02 R of
    /// the line of its hem, flanks what lies 0.15 R to 0.45 R from it.
    #[test]
    fn under_folds_the_regions_follow_the_hem() {
        for folds in ["pleated", "wavy"] {
            follows_the_hem(folds);
        }
    }

    /// What hangs over a floor stands beside a wall just as well: the same scene,
    /// turned by a quarter, has the same regions.
    #[test]
    fn a_wall_has_the_regions_of_a_floor() {
        let floor = folded("wavy");
        let mut wall = floor.clone();
        let turn = |v: Vec3| Vec3::new(v.y, -v.x, v.z);
        wall.objects.iter_mut().flat_map(|o| &mut o.mesh.positions).for_each(|p| *p = turn(*p));
        let m = &mut wall.measure;
        (m.center, m.normal, m.transect) = (turn(m.center), turn(m.normal), turn(m.transect));
        let of = |scene: &Scene| {
            let geometry = Geometry::new(scene).unwrap();
            let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
            Regions::new(scene, &geometry.tracer, &gbuffer)
        };
        let (a, b) = (of(&floor), of(&wall));
        for region in Region::ALL {
            let both = a.pixels(region).iter().filter(|i| b.pixels(region).contains(i)).count();
            // An edge of a region may lie on a pixel's centre but for rounding.
            let least = (a.pixels(region).len().max(b.pixels(region).len()) as f64 * 0.995) as usize;
            assert!(
                both >= least && (both > 100 || region == Region::Far),
                "{region:?}: {both} of {}",
                a.pixels(region).len()
            );
        }
    }

    /// A folded sheet over a floor.
    fn folded(folds: &str) -> Scene {
        let text = r#"
description = "x"
ao = { radius = 0.25 }
environment = { radiance = 1.0 }
measure = { center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.04, resolution = [96, 96] }
look = { eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }
[[object]]
name = "floor"
shape = { plane = { center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] } }
[[object]]
name = "sheet"
occluder = true
shape = { curtain = { thickness = 0, gap = 0.05, height = 1.0, length = 2.0, folds = "FOLDS", pleat_width = 0.1, pleat_depth = 0.06 } }
"#;
        Scene::from_toml("x", "x.toml", &text.replace("FOLDS", folds), None).unwrap()
    }

    /// On a flat floor nothing that stands beside a hem counts: a plinth with a
    /// sloping side, nearer to the hem than the floor is. Nor does it matter of how
    /// many pieces the floor is made.
    #[test]
    fn on_a_floor_what_stands_beside_a_hem_changes_nothing() {
        let alone = folded("wavy");
        let regions = |scene: &Scene| {
            let geometry = Geometry::new(scene).unwrap();
            let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
            let regions = Regions::new(scene, &geometry.tracer, &gbuffer);
            (gbuffer, regions)
        };
        let (_, expected) = regions(&alone);
        let mut pieces = alone.clone();
        let mut right = pieces.objects[0].clone();
        right.name = "right".into();
        pieces.objects[0].mesh.positions.iter_mut().for_each(|v| v.x = v.x.min(0.012));
        right.mesh.positions.iter_mut().for_each(|v| v.x = v.x.max(0.012));
        pieces.objects.push(right);
        let mut plinth = alone.clone();
        let mut slope = plinth.objects[0].clone();
        slope.name = "plinth".into();
        // From x = 0.05 on the floor to 0.08 at 0.1 m above it; 10 cm long.
        slope.mesh.positions.iter_mut().for_each(|v| {
            let top = v.x > 0.0;
            *v = Vec3::new(if top { 0.08 } else { 0.05 }, if top { 0.1 } else { 0.0 }, v.z / 60.0);
        });
        plinth.objects.push(slope);
        for scene in [pieces, plinth] {
            let (gbuffer, found) = regions(&scene);
            let floor = |i: &u32| gbuffer.surfaces[*i as usize].is_some_and(|s| s.normal.y > 0.999);
            assert!((0..gbuffer.surfaces.len() as u32).filter(floor).count() > 9000);
            for region in [Region::Footprint, Region::Left, Region::Right] {
                let of = |r: &Regions| r.pixels(region).iter().copied().filter(floor).collect::<Vec<u32>>();
                assert_eq!(of(&found), of(&expected), "{region:?} with {}", scene.objects[2].name);
            }
        }
    }

    fn follows_the_hem(folds: &str) {
        let scene = folded(folds);
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
        let hem: Vec<[Vec2; 2]> = scene.objects[1]
            .mesh
            .corners()
            .flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]])
            .filter(|edge| edge.iter().all(|v| (v.y - 0.05).abs() < 1e-6))
            .map(|edge| edge.map(|v| Vec2::new(v.x, v.z)))
            .collect();
        assert!(hem.len() >= 20, "{}", hem.len());
        let mut checked = [0; 2];
        for (i, s) in gbuffer.surfaces.iter().enumerate() {
            let p = s.map(|s| Vec2::new(s.point.x, s.point.z)).unwrap();
            let distance = hem
                .iter()
                .map(|[a, b]| {
                    let t = ((p - *a).dot(*b - *a) / (*b - *a).length_squared()).clamp(0.0, 1.0);
                    (*a + (*b - *a) * t).distance(p) / 0.25
                })
                .fold(f32::INFINITY, f32::min);
            let is = |region| regions.pixels(region).contains(&(i as u32));
            if (distance - 0.02).abs() > 1e-3 {
                assert_eq!(is(Region::Footprint), distance < 0.02, "{p}: {distance}");
                checked[0] += usize::from(distance < 0.02);
            }
            for (region, side) in [(Region::Left, p.x < 0.0), (Region::Right, p.x > 0.0)] {
                if is(region) {
                    assert!(side && (0.149..0.451).contains(&distance), "{p}: {distance}");
                    checked[1] += 1;
                }
            }
        }
        assert!(checked[0] > 200 && checked[1] > 2000, "{checked:?}");
    }

    #[test]
    fn without_an_occluder_there_is_no_footprint() {
        let (_, gbuffer, regions) = regions("plane");
        assert!(regions.pixels(Region::Footprint).is_empty());
        assert_eq!(regions.pixels(Region::Far).len(), gbuffer.surfaces.len());
        assert!(regions.measurable(Region::Left).unwrap_err().0.contains("left"));
    }
}
