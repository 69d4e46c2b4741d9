//! Finding regions: the sheet's shadow on the receiver, and how far beside it a
//! point lies.

use super::{Region, Regions, patches::smooth_patches};
use crate::{
    render::gbuffer::{GBuffer, Surface},
    trace::Tracer,
};
use aogauge_scenes::{Scene, clip};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// How far the footprint reaches beyond the sheet, in R.
const FOOTPRINT_MARGIN: f32 = 0.02;
/// Where the flanks begin and end, in R from the sheet.
const FLANK: [f32; 2] = [0.15, 0.45];
/// What still counts as the receiver's own plane, in R.
const OWN_PLANE: f32 = 1e-3;
/// Pixel centres that lie on a border by construction must not fall to rounding,
/// in R.
const ROUNDING: f32 = 1e-4;

/// The regions of one occluder object alone.
#[derive(Clone, Debug, PartialEq)]
pub struct OccluderRegions {
    /// The object's name, unique in its scene.
    pub name: String,
    /// Its footprint and flanks; `all` and `far` are the scene's.
    pub regions: Regions,
}

/// What regions are found with.
#[derive(Debug)]
pub struct Finder<'a> {
    /// All occluders.
    sheet: Tracer,
    /// What is no occluder.
    receiver: Tracer,
    /// The smooth patch of each triangle of `receiver`, in its own order.
    patches: Vec<u32>,
    /// That of each triangle of the scene; None for occluders.
    patch: Vec<Option<u32>>,
    scene: &'a Scene,
    whole: &'a Tracer,
}

impl<'a> Finder<'a> {
    /// Makes the trees of a scene; `whole` holds all its triangles.
    pub fn new(scene: &'a Scene, whole: &'a Tracer) -> Self {
        let part = |occluder: bool| -> Vec<[Vec3; 3]> {
            scene.triangles().filter(|(o, _)| scene.objects[*o].occluder == occluder).map(|(_, t)| t).collect()
        };
        let receiver = part(false);
        // Without a sheet no one asks for patches.
        let found = if scene.has_occluder() { smooth_patches(&receiver) } else { Vec::new() };
        let receiver = Tracer::new(&receiver);
        let mut in_order = found.iter().copied();
        let patch =
            scene.triangles().map(|(o, _)| if scene.objects[o].occluder { None } else { in_order.next() }).collect();
        let patches = receiver.source().iter().filter_map(|&i| found.get(i as usize).copied()).collect();
        Finder { sheet: Tracer::new(&part(true)), receiver, patches, patch, scene, whole }
    }

    /// The regions of what a view sees, the sheet being all occluders together.
    pub fn regions(&self, gbuffer: &GBuffer) -> Regions {
        let found = self.members_beside(&self.sheet, gbuffer, |s, member| {
            member[Region::All as usize] = true;
            member[Region::Far as usize] = self.is_far(s);
        });
        Regions { pixels: std::array::from_fn(|region| members(&found, region)) }
    }

    /// The regions of each occluder object by itself, the sheet being its triangles
    /// alone, in the order of the scene: those that have a pixel of footprint or
    /// flank in view. Empty where fewer than two have, because the scene's regions
    /// say the same then. `regions` are the scene's.
    ///
    /// Where occluders stand side by side, one may stand over the flank of another:
    /// the pixels then belong to both.
    pub fn by_occluder(&self, gbuffer: &GBuffer, regions: &Regions) -> Vec<OccluderRegions> {
        let occluders = || self.scene.objects.iter().filter(|o| o.occluder);
        if occluders().count() < 2 {
            return Vec::new();
        }
        let reach = self.reach();
        let (lo, hi) = bounds(gbuffer.surfaces.iter().flatten().map(|s| s.point));
        let found: Vec<OccluderRegions> = occluders()
            .filter(|o| {
                let (from, to) = bounds(o.mesh.positions.iter().copied());
                from.cmple(hi + reach).all() && to.cmpge(lo - reach).all()
            })
            .filter_map(|object| {
                let own = self.of_sheet(&Tracer::new(&object.mesh.corners().collect::<Vec<_>>()), gbuffer, regions);
                let in_view = SIDES.iter().any(|&region| !own.pixels(region).is_empty());
                in_view.then(|| OccluderRegions { name: object.name.clone(), regions: own })
            })
            .collect();
        if found.len() < 2 { Vec::new() } else { found }
    }

    fn of_sheet(&self, sheet: &Tracer, gbuffer: &GBuffer, regions: &Regions) -> Regions {
        let found = self.members_beside(sheet, gbuffer, |_, _| {});
        let mut own = regions.clone();
        for region in SIDES {
            own.pixels[region as usize] = members(&found, region as usize);
        }
        own
    }

    /// Membership of each pixel, row by row: what lies under a sheet or beside it, and
    /// what `more` adds.
    fn members_beside(
        &self,
        sheet: &Tracer,
        gbuffer: &GBuffer,
        more: impl Fn(&Surface, &mut [bool; 5]) + Sync,
    ) -> Vec<[bool; 5]> {
        let of = |surface: &Option<Surface>| {
            let mut member = [false; 5];
            if let Some(s) = surface {
                self.beside(sheet, s, &mut member);
                more(s, &mut member);
            }
            member
        };
        gbuffer.surfaces.par_iter().map(of).collect()
    }

    fn radius(&self) -> f32 {
        self.scene.ao.radius
    }

    /// How far from a point the sheet still matters, metres.
    fn reach(&self) -> f32 {
        self.radius() * (1.0 + FLANK[1])
    }

    /// Whether a point lies under a sheet or beside it.
    fn beside(&self, sheet: &Tracer, s: &Surface, member: &mut [bool; 5]) {
        let Some(to) = self.to_shadow(sheet, s) else { return };
        let distance = to.length() / self.radius();
        member[Region::Footprint as usize] = distance <= FOOTPRINT_MARGIN + ROUNDING;
        // Beside the sheet, not beyond its end.
        let beside = to.x.abs() > to.y.abs();
        if beside && (FLANK[0] - ROUNDING..=FLANK[1] + ROUNDING).contains(&distance) {
            let side = if to.x > 0.0 { Region::Left } else { Region::Right };
            member[side as usize] = true;
        }
    }

    fn is_far(&self, s: &Surface) -> bool {
        self.whole.nearest(s.point, self.radius(), |t| !self.is_in_plane(s, t)).is_none()
    }

    /// Whether a triangle lies in the tangent plane of `s`.
    fn is_in_plane(&self, s: &Surface, triangle: &[Vec3; 3]) -> bool {
        triangle.iter().all(|v| s.normal.dot(*v - s.point).abs() <= OWN_PLANE * self.radius())
    }

    /// The vector, measured along the receiver, from `s` to the nearest point of
    /// the sheet's shadow: zero where the sheet stands over `s`, None where none
    /// of it is near. x is along the transect.
    ///
    /// The shadow is taken in the tangent plane of the receiver under the sheet's
    /// nearest point, and `s` is unrolled into that plane by its arc length. On a
    /// flat receiver that changes nothing; on a cylinder it is exact.
    fn to_shadow(&self, sheet: &Tracer, s: &Surface) -> Option<Vec2> {
        let (reach, transect) = (self.reach(), self.scene.measure.transect);
        let base = self.base(s, sheet.nearest(s.point, reach, |_| true)?.point);
        let x = (transect - base.normal * base.normal.dot(transect)).normalize_or_zero();
        let plane = Plane { origin: base.point, x, y: base.normal.cross(x), normal: base.normal };
        let from = plane.unroll(s);
        let mut nearest: Option<Vec2> = None;
        sheet.near(s.point, reach, |triangle| {
            if let Some(to) = plane.nearest_shadow(from, triangle, self.radius())
                && nearest.is_none_or(|n| to.length_squared() < n.length_squared())
            {
                nearest = Some(to);
            }
        });
        nearest
    }

    /// The receiver under a point of the sheet, as `s` sees it.
    ///
    /// Where the receiver in the tangent plane of `s` reaches under the point, it is
    /// flat between the two, and that plane decides: `s` itself, whatever else stands
    /// beside the sheet. Otherwise it is the point of the smooth patch of `s` that is
    /// nearest to the sheet, to which an arc leads; and `s` itself again where the
    /// patch is not near, or looks another way there (round a corner arc length
    /// means nothing). Other surfaces never count: not the column beside a hem.
    fn base(&self, s: &Surface, sheet: Vec3) -> Surface {
        let foot = sheet - s.normal * s.normal.dot(sheet - s.point);
        if self.receiver.nearest(foot, OWN_PLANE * self.radius(), |t| self.is_in_plane(s, t)).is_some() {
            return *s;
        }
        let Some(patch) = self.patch.get(s.triangle as usize).copied().flatten() else { return *s };
        let own = |leaf: u32| self.patches.get(leaf as usize) == Some(&patch);
        let Some(at) = self.receiver.nearest_of(sheet, self.radius(), own) else { return *s };
        let [a, b, c] = self.receiver.triangles()[at.triangle as usize];
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(sheet - at.point) < 0.0 { -normal } else { normal };
        if normal.dot(s.normal) <= 0.0 {
            return *s;
        }
        Surface { point: at.point, normal, triangle: at.triangle }
    }
}

/// The regions that belong to a sheet.
const SIDES: [Region; 3] = [Region::Footprint, Region::Left, Region::Right];

/// The pixels that are members of a region, in order.
fn members(found: &[[bool; 5]], region: usize) -> Vec<u32> {
    (0..found.len() as u32).filter(|&i| found[i as usize][region]).collect()
}

/// The box around some points; turned inside out where there are none.
fn bounds(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)))
}

/// A tangent plane of the receiver.
struct Plane {
    origin: Vec3,
    x: Vec3,
    y: Vec3,
    normal: Vec3,
}

impl Plane {
    /// A point of the receiver laid into the plane at its arc length from the
    /// origin, taken for that of a circle: chord (a/2) / sin(a/2), a the angle
    /// between the normals.
    fn unroll(&self, s: &Surface) -> Vec2 {
        let d = s.point - self.origin;
        let flat = Vec2::new(d.dot(self.x), d.dot(self.y));
        let half = 0.5 * self.normal.cross(s.normal).length().atan2(self.normal.dot(s.normal));
        if half < 1e-3 {
            return flat;
        }
        flat.normalize_or_zero() * (d.length() * half / half.sin())
    }

    /// The vector in the plane from `from` to the nearest point of a triangle's
    /// shadow: its part between 0 and `radius` above the plane, projected along
    /// the normal. None where it has no such part; zero where it holds `from`.
    fn nearest_shadow(&self, from: Vec2, triangle: &[Vec3; 3], radius: f32) -> Option<Vec2> {
        let local = triangle.map(|v| {
            let d = v - self.origin;
            Vec3::new(d.dot(self.x) - from.x, d.dot(self.y) - from.y, self.normal.dot(d))
        });
        let above = clip(&local, |v| v.z);
        let slab = clip(&above, |v| radius - v.z);
        let polygon: Vec<Vec2> = slab.iter().map(|v| v.truncate()).collect();
        nearest_of_polygon(&polygon)
    }
}

/// The point of a convex polygon that is nearest to the origin.
fn nearest_of_polygon(polygon: &[Vec2]) -> Option<Vec2> {
    let n = polygon.len();
    let edge = |i: usize| (polygon[i], polygon[(i + 1) % n] - polygon[i]);
    let side = |i: usize| {
        let (a, e) = edge(i);
        e.perp_dot(-a)
    };
    if n > 0 && ((0..n).all(|i| side(i) > 0.0) || (0..n).all(|i| side(i) < 0.0)) {
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
