//! Openness, ray by ray: `classic`, `obscurance`, `extended`,
//! `extended-obscurance`. Twin: `gpu/shaders/ao.wgsl`.

mod group;
mod traced;

pub use traced::Traced;

use super::{
    Extension, Faces, Falloff, Openness, ReceiverPlane, SecondaryOrigin, Sides,
    sampler::{Sampler, turn},
};
use crate::trace::{Ray, Tracer};
use aogauge_scenes::AoScale;
use glam::Vec3;

/// How the first 32 primary rays of a pixel were decided, a bit a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Decisions {
    /// The primary ray meets something within reach.
    pub primary: u32,
    /// The first secondary ray is closed.
    pub first: u32,
    /// The second secondary ray is closed.
    pub second: u32,
}

/// What became of one primary ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decided {
    /// Whether it meets something within reach.
    pub hit: bool,
    /// mu of its first hit; 1 without one.
    pub mu: f32,
    /// Which secondary rays are closed, a bit each.
    pub closed: u32,
    /// How many secondary rays the method casts; 0 without extension.
    pub secondary_rays: u32,
}

impl Decided {
    /// Nothing is known yet.
    const NONE: Decided = Decided { hit: false, mu: 0.0, closed: 0, secondary_rays: 0 };

    /// mu times the open secondary rays, or mu where there are none: summed in
    /// these units, openness without falloff is exact.
    pub fn units(self) -> f32 {
        match self.secondary_rays {
            0 => self.mu,
            n => self.mu * (n - self.closed.count_ones()) as f32,
        }
    }

    /// What the ray counts, in [0, 1]: mu (1 - closed / secondary rays).
    pub fn weight(self) -> f32 {
        self.units() / self.secondary_rays.max(1) as f32
    }
}

/// Two unit tangents that make a right-handed frame with a unit normal (Duff et
/// al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017).
#[inline(always)]
pub fn tangents(n: Vec3) -> [Vec3; 2] {
    let sign = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), Vec3::new(b, sign + n.y * n.y * a, -n.y)]
}

/// The cosine-distributed direction about a unit normal that two numbers in [0, 1)
/// choose, and its cosine.
#[inline(always)]
pub fn cosine_distributed(normal: Vec3, [u, v]: [f32; 2]) -> (Vec3, f32) {
    let [cos_phi, sin_phi] = turn(v);
    let [t, b] = tangents(normal);
    let cosine = (1.0 - u).sqrt();
    ((t * cos_phi + b * sin_phi) * u.sqrt() + normal * cosine, cosine)
}

/// A shaded point with what its rays share.
#[derive(Clone, Copy, Debug)]
pub struct Shading<'a> {
    tracer: &'a Tracer,
    /// Pushed off the surface by the rounding error.
    origin: Vec3,
    normal: Vec3,
    frame: [Vec3; 2],
    ao: AoScale,
    method: Openness,
    /// Where on the circle from d1 to d2 secondary rays go, where that is not left to
    /// chance: cosine and sine.
    circle: [[f32; 2]; Extension::MOST as usize],
}

impl<'a> Shading<'a> {
    /// A point on a surface with its unit normal. `ao` is the scene's; a method
    /// with a scale of its own overrides it.
    pub fn new(tracer: &'a Tracer, point: Vec3, normal: Vec3, ao: AoScale, method: Openness) -> Self {
        let origin = point + normal * tracer.offset();
        let mut circle = [[0.0; 2]; Extension::MOST as usize];
        if let Some(extension) = method.extension.filter(|e| !e.is_turned()) {
            for (i, place) in circle.iter_mut().enumerate().take(extension.secondary_rays as usize) {
                *place = on_circle(i as u32, 0.0, extension);
            }
        }
        Shading { tracer, origin, normal, frame: tangents(normal), ao: method.scale.on(ao), method, circle }
    }

    /// Decides one primary ray. `place` chooses its direction; `shift`, in
    /// [0, 1), the origin of secondary rays along it and how their fan is turned,
    /// where the method leaves that to chance.
    #[inline]
    pub fn decide(&self, place: [f32; 2], shift: [f32; 2]) -> Decided {
        let primary = self.primary_at(place);
        let (hit, mu, length) = self.primary(primary.direction);
        let Some(extension) = self.method.extension else {
            return Decided { hit, mu, closed: 0, secondary_rays: 0 };
        };
        let mut decided = Decided { hit, mu, closed: 0, secondary_rays: extension.secondary_rays };
        if mu > 0.0 {
            let fan = self.fan(primary, length, shift, extension);
            for i in 0..extension.secondary_rays {
                let segment = fan.segment(self, i, shift[1], extension);
                decided.closed |= u32::from(self.closed(&segment)) << i;
            }
        }
        decided
    }

    /// The primary ray that two numbers in [0, 1) choose.
    #[inline]
    fn primary_at(&self, [u, v]: [f32; 2]) -> Primary {
        let turn = turn(v);
        let tilt = [u.sqrt(), (1.0 - u).sqrt()];
        let [t, b] = self.frame;
        let along = t * turn[0] + b * turn[1];
        Primary { turn, tilt, along, direction: along * tilt[0] + self.normal * tilt[1] }
    }

    /// The secondary rays of a primary one, which has `length` before its hit.
    #[inline]
    fn fan(&self, primary: Primary, length: f32, shift: [f32; 2], extension: Extension) -> Fan {
        let Primary { turn: [cos_phi, sin_phi], tilt: [sin_theta, cos_theta], along, direction: w } = primary;
        let [t, b] = self.frame;
        // d1 = w x n / |w x n| and d2 = w x d1, written out in the frame of the surface:
        // there d1 has no singularity where w is parallel to n.
        let d1 = t * sin_phi - b * cos_phi;
        let d2 = along * cos_theta - self.normal * sin_theta;
        let share = if extension.origin == SecondaryOrigin::Jittered { shift[0] } else { 0.5 };
        Fan {
            middle: self.origin + w * (share * length),
            height: share * length * cos_theta,
            sin_theta,
            directions: [d1, d2],
        }
    }

    /// Whether a primary ray meets something, its mu, and how much of R it has
    /// before that.
    #[inline]
    fn primary(&self, w: Vec3) -> (bool, f32, f32) {
        let radius = self.ao.radius;
        let falloff = self.method.falloff;
        let ray = Ray::new(self.origin, w, self.method.reach(radius));
        if falloff == Falloff::Step {
            let hit = self.tracer.occluded_by(&ray, self.method.faces);
            return (hit, f32::from(u8::from(!hit)), radius);
        }
        let distance = self.tracer.distance(&ray, self.method.faces);
        distance.map_or((false, 1.0, radius), |d| (true, falloff.mu(d, radius), d.min(radius)))
    }

    /// Whether a secondary ray is closed.
    #[inline]
    fn closed(&self, segment: &Segment) -> bool {
        let faces = self.method.faces;
        let mut closed = false;
        segment.rays(faces, |origin, direction, length| {
            closed = closed || self.tracer.occluded_by(&Ray::new(origin, direction, length), faces);
        });
        closed
    }

    /// Openness over `rays` rays, and how each was decided.
    pub fn openness(&self, rays: u32, sampler: &Sampler) -> (f32, Decisions) {
        let mut sum = 0.0;
        let mut decisions = Decisions::default();
        let mut decided = [Decided::NONE; group::MOST];
        for first in (0..rays).step_by(group::MOST) {
            let decided = &mut decided[..((rays - first) as usize).min(group::MOST)];
            self.decide_all(first, sampler, decided);
            for (i, decided) in decided.iter().enumerate() {
                sum += f64::from(decided.units());
                if first == 0 {
                    decisions.primary |= u32::from(decided.hit) << i;
                    decisions.first |= (decided.closed & 1) << i;
                    decisions.second |= (decided.closed >> 1 & 1) << i;
                }
            }
        }
        (self.method.mean(sum, rays), decisions)
    }

    /// Decides samples `first` and following.
    fn decide_all(&self, first: u32, sampler: &Sampler, decided: &mut [Decided]) {
        if self.method.falloff == Falloff::Step {
            return self.decide_together(first, sampler, decided);
        }
        for (i, decided) in decided.iter_mut().enumerate() {
            let index = first + i as u32;
            let shift = if self.has_chance() { sampler.pair(index, 1) } else { [0.0; 2] };
            *decided = self.decide(sampler.pair(index, 0), shift);
        }
    }

    /// Whether secondary rays leave something to chance.
    fn has_chance(&self) -> bool {
        self.method.extension.is_some_and(|e| e.is_turned() || e.origin == SecondaryOrigin::Jittered)
    }
}

/// A primary ray in the frame of its surface.
#[derive(Clone, Copy)]
struct Primary {
    /// Cosine and sine of its angle about the normal.
    turn: [f32; 2],
    /// Sine and cosine of its angle against the normal.
    tilt: [f32; 2],
    /// Its unit direction in the plane of the surface.
    along: Vec3,
    /// Its unit direction.
    direction: Vec3,
}

/// The secondary rays of one primary ray.
struct Fan {
    /// Where they start.
    middle: Vec3,
    /// Of that over the receiver's tangent plane.
    height: f32,
    /// Of the primary ray against the normal.
    sin_theta: f32,
    /// d1 and d2.
    directions: [Vec3; 2],
}

/// A secondary ray: from `back` behind its origin to `forth` beyond it.
struct Segment {
    middle: Vec3,
    direction: Vec3,
    back: f32,
    forth: f32,
}

impl Segment {
    /// The rays that close it: their origins, directions and lengths. Where back faces are
    /// culled there are two, each away from the primary one: what faces a point is its
    /// front whichever way the segment is walked.
    #[inline(always)]
    fn rays(&self, faces: Faces, mut each: impl FnMut(Vec3, Vec3, f32)) {
        let Segment { middle, direction, back, forth } = *self;
        match faces {
            Faces::Both => each(middle - direction * back, direction, back + forth),
            Faces::Front => {
                each(middle, direction, forth);
                if back > 0.0 {
                    each(middle, -direction, back);
                }
            }
        }
    }
}

impl Fan {
    /// Secondary ray `i`.
    #[inline]
    fn segment(&self, shading: &Shading<'_>, i: u32, turned: f32, extension: Extension) -> Segment {
        let [c, s] = if extension.is_turned() {
            on_circle(i, turned, extension)
        } else {
            shading.circle[i as usize % shading.circle.len()]
        };
        let [d1, d2] = self.directions;
        let d = d1 * c + d2 * s;
        let reach = shading.ao.secondary_radius;
        // d2 goes down, against the normal, by sin(theta) a unit length.
        let slope = s * self.sin_theta;
        let forth = match extension.receiver_plane {
            ReceiverPlane::Clipped if reach * slope > self.height => self.height / slope,
            _ => reach,
        };
        let back = if extension.sides == Sides::Two { reach } else { 0.0 };
        Segment { middle: self.middle, direction: d, back, forth }
    }
}

/// Cosine and sine of the angle of secondary ray `i` from d1 towards d2: (i +
/// turned)/n of a half turn, of a whole turn where rays go one way.
#[inline]
fn on_circle(i: u32, turned: f32, extension: Extension) -> [f32; 2] {
    let period = if extension.sides == Sides::Two { 0.5 } else { 1.0 };
    turn((i as f32 + turned) * period / extension.secondary_rays as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3Swizzles;

    #[test]
    fn tangents_make_a_right_handed_frame() {
        for i in 0..2000 {
            let [a, b] = Sampler::new(5, i, 0).pair(0, 0);
            let [c, s] = turn(a);
            let z = 1.0 - 2.0 * b;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3::new(r * c, r * s, z).normalize();
            let [t, u] = tangents(n);
            assert!((t.cross(u) - n).length() < 1e-5);
            assert!((t.length() - 1.0).abs() < 1e-5 && t.dot(u).abs() < 1e-5);
        }
    }

    /// One sample of each of 20,000 seeds, dimensions and indices in turn, about
    /// several normals; 16 x 16 cells. Two-sided at 1e-3 with fixed seeds.
    #[test]
    fn directions_are_cosine_distributed_and_defects_are_found() {
        use crate::stats::DirectionHistogram;
        let fit = |normal: Vec3, direction: &dyn Fn(u32) -> Vec3| {
            let mut histogram = DirectionHistogram::new(normal, 16, 16);
            (0..20_000).for_each(|i| histogram.add(direction(i)));
            histogram.test().unwrap().p_two
        };
        let place = |i: u32| Sampler::new(i, 31, 7).pair(i % 64, i % 3);
        for normal in [Vec3::Z, Vec3::NEG_Z, Vec3::Y, Vec3::new(0.3, -0.8, 0.5).normalize()] {
            let p = fit(normal, &|i| cosine_distributed(normal, place(i)).0);
            assert!(p > 1e-3, "{normal}: p {p}");
            // No cosine: uniform over the hemisphere.
            let uniform = |i| {
                let [u, v] = place(i);
                let ([c, s], [t, b]) = (turn(v), tangents(normal));
                (t * c + b * s) * (1.0 - u * u).sqrt() + normal * u
            };
            assert!(fit(normal, &uniform) < 1e-9);
            // Axes in another order, which puts the normal elsewhere.
            let swapped = |i| cosine_distributed(normal, place(i)).0;
            assert!(fit(normal.zxy() + normal.yzx() * 0.5, &swapped) < 1e-9);
            // The turn from the number that also chose the angle.
            assert!(fit(normal, &|i| cosine_distributed(normal, [place(i)[0]; 2]).0) < 1e-9);
        }
        // Samples of one seed fit too well.
        let stratified = Sampler::new(1, 2, 3);
        let mut histogram = DirectionHistogram::new(Vec3::Z, 16, 16);
        (0..1 << 14).for_each(|i| histogram.add(cosine_distributed(Vec3::Z, stratified.pair(i, 0)).0));
        let test = histogram.test().unwrap();
        assert!(test.p > 0.999 && test.p_two < 1e-3, "{test:?}");
    }

    fn plane(half: f32) -> Tracer {
        let mut mesh = aogauge_scenes::Mesh::default();
        mesh.push_quad(Vec3::new(-half, 0.0, -half), Vec3::Z * 2.0 * half, Vec3::X * 2.0 * half);
        Tracer::new(&mesh.corners().collect::<Vec<_>>())
    }

    /// 1 - (k^2/2)/(1 + k^2), k = 2R'/R, where the plane counts; 1 where clipped.
    #[test]
    fn an_empty_plane_reads_what_the_closed_form_says() {
        let tracer = plane(3.0);
        for (ratio, expected) in [(0.25f32, 0.9f32), (0.125, 1.0 - 0.03125 / 1.0625)] {
            let ao = AoScale { radius: 0.25, secondary_radius: 0.25 * ratio };
            let read = |extension: Option<Extension>| {
                let method = Openness { extension, ..Openness::plain(Falloff::Step) };
                let shading = Shading::new(&tracer, Vec3::new(0.1, 0.0, 0.2), Vec3::Y, ao, method);
                shading.openness(65_536, &Sampler::new(1, 2, 3)).0
            };
            assert_eq!(read(None), 1.0);
            for sides in [Sides::Two, Sides::One] {
                for secondary_rays in [1, 2, 3, 8] {
                    for origin in [SecondaryOrigin::Middle, SecondaryOrigin::Jittered] {
                        let receiver_plane = ReceiverPlane::Clipped;
                        let clipped = Extension { receiver_plane, secondary_rays, sides, origin };
                        assert_eq!(read(Some(clipped)), 1.0, "{clipped:?}");
                    }
                }
            }
            let counts = read(Some(Extension::of_the_paper(ReceiverPlane::Counts)));
            assert!((counts - expected).abs() < 2e-3, "{counts}");
        }
    }

    #[test]
    fn secondary_directions_are_those_of_the_paper() {
        let n = Vec3::new(0.3, 0.8, -0.5).normalize();
        let [t, b] = tangents(n);
        for v in [0.03, 0.31, 0.77] {
            let [c, s] = turn(v);
            let (st, ct) = (0.36f32.sqrt(), 0.64f32.sqrt());
            let w = (t * c + b * s) * st + n * ct;
            let d1 = t * s - b * c;
            assert!((d1 - w.cross(n).normalize()).length() < 1e-5);
            assert!(((t * c + b * s) * ct - n * st - w.cross(d1)).length() < 1e-5);
        }
    }
}
