//! The camera that screen-space methods are measured from.
//!
//! The measure view will not do: its near plane lies under the occluder, so its
//! depth buffer does not hold it. This camera sees the receiver and the occluder
//! as a player does, and what it computes is gathered to the measured points.

use crate::{
    metrics::regions::{Region, Regions},
    render::gbuffer::{GBuffer, Surface},
    scenes::{Scene, View},
    trace::{Ray, Tracer},
};
use glam::Vec3;

/// Of each region, the share that is enough to see.
const ENOUGH: f32 = 0.98;

/// How far the image reaches beyond the measured regions, in R: the samples of
/// their points must fall into it.
const MARGIN: f32 = 1.5;

/// Edges of the square image, pixels.
const EDGES: [f32; 2] = [64.0, 1024.0];

/// Points that stand for a scene without regions, about.
const SAMPLES: usize = 1024;

/// Angles over the receiver and about its normal, from across the occluder, that
/// are tried in this order; degrees.
const ELEVATIONS: [f32; 5] = [30.0, 20.0, 40.0, 50.0, 12.0];
const AZIMUTHS: [f32; 5] = [0.0, 30.0, -30.0, 60.0, -60.0];

/// The camera of a scene: the first that sees 98 % of footprint and both
/// flanks, else the one that sees the most of the region it sees least of. Tried
/// are the eye of the look view, then places on the side of the left and of the
/// right flank. All look at the middle of the regions, with 1.5 R around them in
/// the image and pixels no larger on the receiver than those of the measure view
/// (but at most 1024 x 1024 of them). `gbuffer` and `regions` are those of the
/// measure view.
pub fn screen_camera(scene: &Scene, tracer: &Tracer, gbuffer: &GBuffer, regions: &Regions) -> View {
    let targets = Targets::new(scene, gbuffer, regions);
    let mut best: Option<(f32, View)> = None;
    for eye in targets.eyes(scene) {
        let Some(view) = targets.frame(eye) else {
            continue;
        };
        let score = targets.seen_from(eye, tracer);
        if best.is_none_or(|(s, _)| score > s) {
            best = Some((score, view));
        }
        if score >= ENOUGH {
            break;
        }
    }
    best.map_or_else(|| scene.look.view(), |(_, view)| view)
}

/// What the camera must see.
struct Targets {
    /// Points, region by region.
    regions: Vec<Vec<Surface>>,
    middle: Vec3,
    normal: Vec3,
    /// Of the sphere about the middle that the image must hold, metres.
    reach: f32,
    /// The largest pixel on the receiver, metres.
    pixel: f32,
}

impl Targets {
    fn new(scene: &Scene, gbuffer: &GBuffer, regions: &Regions) -> Self {
        let points = |region| -> Vec<Surface> {
            regions.pixels(region).iter().filter_map(|&i| gbuffer.surfaces[i as usize]).collect()
        };
        let mut found: Vec<Vec<Surface>> = [Region::Footprint, Region::Left, Region::Right].map(points).into();
        found.retain(|r| !r.is_empty());
        if found.is_empty() {
            let all = points(Region::All);
            found.push(all.iter().step_by(all.len().div_ceil(SAMPLES).max(1)).copied().collect());
        }
        let all = || found.iter().flatten().map(|s| s.point);
        let low = all().fold(Vec3::INFINITY, Vec3::min);
        let high = all().fold(Vec3::NEG_INFINITY, Vec3::max);
        let middle = if low.x <= high.x { (low + high) / 2.0 } else { scene.measure.center };
        let reach = all().fold(0.0f32, |m, p| m.max(p.distance(middle))) + MARGIN * scene.ao.radius;
        Targets { middle, reach, normal: scene.measure.normal, pixel: scene.measure.pixel, regions: found }
    }

    /// Where the camera may stand, best first.
    fn eyes(&self, scene: &Scene) -> Vec<Vec3> {
        let (across, along) = (scene.measure.transect, self.normal.cross(scene.measure.transect));
        let mut eyes = vec![scene.look.eye];
        for elevation in ELEVATIONS.map(f32::to_radians) {
            for side in [-1.0, 1.0] {
                for azimuth in AZIMUTHS.map(f32::to_radians) {
                    let level = across * (side * azimuth.cos()) + along * azimuth.sin();
                    let towards = level * elevation.cos() + self.normal * elevation.sin();
                    eyes.push(self.middle + towards * (2.0 * self.reach));
                }
            }
        }
        eyes
    }

    /// The view from an eye; None from within what it must hold, or from under
    /// the receiver.
    fn frame(&self, eye: Vec3) -> Option<View> {
        let distance = eye.distance(self.middle);
        let forward = (self.middle - eye) / distance;
        let facing = -forward.dot(self.normal);
        if distance < 1.2 * self.reach || !(0.05..0.999).contains(&facing) {
            return None;
        }
        let half = (self.reach / distance).asin();
        let largest = |s: &Surface| {
            let to = s.point - eye;
            let slant = to.normalize().dot(s.normal).abs().max(0.05);
            to.dot(forward) / slant
        };
        let largest = self.regions.iter().flatten().map(largest).fold(0.0f32, f32::max);
        let edge = (2.0 * half.tan() * largest / self.pixel).ceil().clamp(EDGES[0], EDGES[1]) as u32;
        Some(View::perspective(eye, self.middle, self.normal, 2.0 * half, [edge; 2]))
    }

    /// The smallest share of a region that nothing hides from an eye.
    fn seen_from(&self, eye: Vec3, tracer: &Tracer) -> f32 {
        let seen = |s: &&Surface| {
            let to = eye - s.point;
            let ray = Ray::new(s.point + s.normal * tracer.offset(), to.normalize(), to.length());
            s.normal.dot(to) > 0.0 && !tracer.occluded(&ray)
        };
        let share = |region: &Vec<Surface>| region.iter().filter(seen).count() as f32 / region.len() as f32;
        self.regions.iter().map(share).fold(1.0, f32::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{
        Geometry,
        screen_space::{Screen, UNSEEN},
    };
    use aogauge_scenes::library;

    /// In every scene of the library that has regions, but for those named, the
    /// camera sees nearly all of each region, and the occluder.
    #[test]
    fn it_sees_footprint_flanks_and_occluder() {
        for name in ["curtain-open", "curtain-arcade", "curtain-room", "pillar"] {
            let scene = library::scene(name).unwrap();
            let geometry = Geometry::new(&scene).unwrap();
            let view = scene.measure.view();
            let gbuffer = GBuffer::new(&geometry.tracer, &view);
            let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
            let camera = screen_camera(&scene, &geometry.tracer, &gbuffer, &regions);
            let screen = Screen::new(&geometry.tracer, &gbuffer, &view, Some(&camera)).unwrap();
            for region in [Region::Footprint, Region::Left, Region::Right] {
                let pixels = regions.pixels(region);
                let seen = pixels.iter().filter(|&&i| screen.gathered[i as usize] != UNSEEN).count();
                println!("{name}: {region:?} {seen} of {}, {:?}", pixels.len(), camera.resolution);
                assert!(seen as f32 >= 0.9 * pixels.len() as f32, "{name}: {region:?} {seen} of {}", pixels.len());
            }
            let owner: Vec<usize> = scene.triangles().map(|(object, _)| object).collect();
            let of_occluder = |s: &&Surface| scene.objects[owner[s.triangle as usize]].occluder;
            assert!(screen.gbuffer.surfaces.iter().flatten().filter(of_occluder).count() > 1000, "{name}");
        }
    }
}
