//! How many rays a second the CPU traces, by kind, scene and number of threads; beside
//! Embree's by the feature `embree`.

#[cfg(feature = "embree")]
mod embree;
mod race;

use crate::{
    render::{
        ao::cosine_distributed,
        gbuffer::{FAR_AWAY, GBuffer, Surface},
        sampler::Sampler,
    },
    scenes::{Scene, View},
    trace::{Faces, Fan, Packet, Ray, Segments, Tracer},
};
use glam::Vec3;
use race::{Course, Side, race};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Version of the format.
pub const VERSION: u32 = 1;

/// Secondary rays of a point whose kind is [`Kind::Segments`]: two of each of eight.
const SEGMENTS: usize = 16;

/// What was measured on one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CpuBench {
    /// Version of this format.
    pub version: u32,
    /// Version of the tool.
    pub tool: String,
    /// The processor, as the system names it; null where it does not.
    pub processor: Option<String>,
    /// Whether it has AVX2.
    pub has_avx2: bool,
    /// Whether Embree is raced against.
    pub has_embree: bool,
    /// Rounds; rates are by medians over them, chunk by chunk.
    pub rounds: usize,
    /// Scene by scene.
    pub scenes: Vec<CpuScene>,
}

/// Rates in one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CpuScene {
    /// Its name.
    pub name: String,
    /// Triangles.
    pub triangles: usize,
    /// Points that rays leave: what is seen in six directions from the eye of the look view.
    pub points: usize,
    /// Races.
    pub races: Vec<CpuRace>,
}

/// What kind of rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Primary rays of AO: cosine distributed, from one point, any hit within R.
    AnyHit,
    /// Secondary rays: across the middles of primary ones, R/2 long, any hit.
    Segments,
    /// Cosine distributed rays without end, the closest hit: a path's bounces.
    Closest,
}

/// The same rays by several ways.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CpuRace {
    /// What kind of rays.
    pub kind: Kind,
    /// Rays a point.
    pub rays: usize,
    /// R, metres; null for rays without end.
    pub radius: Option<f32>,
    /// Threads at once.
    pub threads: usize,
    /// Share of rays that meet something, by the first way.
    pub hit: f64,
    /// The ways.
    pub ways: Vec<CpuWay>,
    /// Our rate over Embree's best, by medians and by least times; null without Embree.
    pub over_embree: Option<[f64; 2]>,
}

/// One way to trace rays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CpuWay {
    /// `AVX2`, `portable`, `scalar`, or Embree's.
    pub name: String,
    /// Rays a second of all threads by medians over rounds, millions of CPU time.
    pub million_rays_a_second: f64,
    /// The same by the least times.
    pub at_best: f64,
    /// Rays more than the first way's that meet something.
    pub more_hits: i64,
}

/// What to measure.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Pixels along the side of each of the six pictures that give the points.
    pub size: u32,
    /// R, metres.
    pub radii: Vec<f32>,
    /// Rays a point: 8, 16 or 32.
    pub rays: Vec<usize>,
    /// Numbers of threads.
    pub threads: Vec<usize>,
    /// How often.
    pub rounds: usize,
    /// Seed of all randomness.
    pub seed: u32,
}

/// The rays that leave a scene's points.
struct Rays {
    points: Vec<Surface>,
    origins: Vec<Vec3>,
    /// Point by point.
    packets: Vec<Packet>,
    a_point: usize,
}

impl Rays {
    fn new(tracer: &Tracer, points: Vec<Surface>, a_point: usize, seed: u32) -> Self {
        let origins = points.iter().map(|s| s.point + s.normal * tracer.offset()).collect();
        let mut packets = vec![Packet::splat(Vec3::ZERO); points.len() * a_point / 8];
        for (point, (packets, s)) in packets.chunks_mut(a_point / 8).zip(&points).enumerate() {
            let sampler = Sampler::new(seed, point as u32, 0);
            for i in 0..a_point {
                packets[i / 8].set(i % 8, cosine_distributed(s.normal, sampler.pair(i as u32, 0)).0);
            }
        }
        Rays { points, origins, packets, a_point }
    }

    fn direction(&self, point: usize, i: usize) -> Vec3 {
        self.packets[point * self.a_point / 8 + i / 8].get(i % 8)
    }

    /// Free segments across the middles of the first eight rays of each point.
    fn segments(&self, radius: f32) -> Vec<Segments> {
        let mut segments = vec![Segments::EMPTY; self.points.len() * SEGMENTS / 8];
        for (i, (s, &origin)) in self.points.iter().zip(&self.origins).enumerate() {
            for k in 0..SEGMENTS {
                let w = self.direction(i, k / 2);
                let d1 = w.cross(s.normal).normalize_or(w.any_orthonormal_vector());
                let d = if k % 2 == 0 { d1 } else { w.cross(d1) };
                let start = origin + w * (radius * 0.5) - d * (radius * 0.25);
                segments[(i * SEGMENTS + k) / 8].set(k % 8, start, d, radius * 0.5);
            }
        }
        segments
    }
}

/// Races in a scene. `tell` is called before each, with its number and how many there are.
pub fn scene(scene: &Scene, settings: &Settings, mut tell: impl FnMut(usize, usize)) -> CpuScene {
    let scene = scene.near_origin();
    let triangles: Vec<_> = scene.triangles().map(|t| t.1).collect();
    let tracer = Tracer::new(&triangles);
    let machine = Machine::new(&tracer, &triangles);
    let points = points(&scene, &tracer, settings.size);
    let mut races = Vec::new();
    let kinds = settings.radii.len() * (settings.rays.len() + 1) + 1;
    let all = settings.threads.len() * kinds;
    for &threads in &settings.threads {
        let mut run = |rays: &Rays, kind, radius| {
            tell(races.len(), all);
            races.push(machine.race(rays, kind, radius, threads, settings.rounds));
        };
        for &a_point in &settings.rays {
            let rays = Rays::new(&tracer, points.clone(), a_point, settings.seed);
            settings.radii.iter().for_each(|&radius| run(&rays, Kind::AnyHit, Some(radius)));
        }
        let rays = Rays::new(&tracer, points.clone(), 8, settings.seed);
        settings.radii.iter().for_each(|&radius| run(&rays, Kind::Segments, Some(radius)));
        run(&rays, Kind::Closest, None);
    }
    CpuScene { name: scene.name.clone(), triangles: triangles.len(), points: points.len(), races }
}

/// What is seen in six directions from the eye of the look view.
fn points(scene: &Scene, tracer: &Tracer, size: u32) -> Vec<Surface> {
    let eye = scene.look.eye;
    let axes = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z];
    let up = |d: Vec3| if d.y == 0.0 { Vec3::Y } else { Vec3::X };
    let views = axes.map(|d| View::perspective(eye, eye + d, up(d), 90f32.to_radians(), [size; 2]));
    views.iter().flat_map(|view| GBuffer::new(tracer, view).surfaces).flatten().collect()
}

/// All ways to trace on this machine.
struct Machine<'a> {
    tracer: &'a Tracer,
    portable: Tracer,
    #[cfg(feature = "embree")]
    embree: [embree::Embree; 2],
}

impl<'a> Machine<'a> {
    #[cfg_attr(not(feature = "embree"), allow(unused_variables))]
    fn new(tracer: &'a Tracer, triangles: &[[Vec3; 3]]) -> Self {
        Machine {
            tracer,
            portable: tracer.clone().portable(),
            #[cfg(feature = "embree")]
            embree: [false, true].map(|robust| embree::Embree::new(triangles, robust)),
        }
    }

    /// Our own, by name.
    fn own(&self) -> impl Iterator<Item = (&'static str, &Tracer)> {
        let fast = self.tracer.is_fast().then_some(("AVX2", self.tracer));
        fast.into_iter().chain([("portable", &self.portable)])
    }

    fn race(&self, rays: &Rays, kind: Kind, radius: Option<f32>, threads: usize, rounds: usize) -> CpuRace {
        let reach = radius.unwrap_or(FAR_AWAY);
        let segments = if kind == Kind::Segments { rays.segments(reach) } else { vec![] };
        let free = Free::new(&segments, kind, rays);
        let sides = match kind {
            Kind::AnyHit => self.any_hit(rays, reach),
            Kind::Segments => self.segments(&segments, &free),
            Kind::Closest => self.closest(rays, &free),
        };
        let a_point = if kind == Kind::Segments { SEGMENTS } else { rays.a_point };
        let raced = race(Course { points: rays.points.len(), rays: a_point, rounds, threads }, &sides);
        let all = (rays.points.len() * a_point) as f64;
        let rate = |seconds: f64| if seconds > 0.0 { all * threads as f64 / seconds * 1e-6 } else { 0.0 };
        let first = raced.first().map_or(0, |r| r.hits);
        let ways: Vec<CpuWay> = sides
            .iter()
            .zip(&raced)
            .map(|(side, r)| CpuWay {
                name: side.name.clone(),
                million_rays_a_second: rate(r.median),
                at_best: rate(r.least),
                more_hits: r.hits as i64 - first as i64,
            })
            .collect();
        // Robust Embree is shown, not raced against.
        let best = |of: fn(&CpuWay) -> f64, theirs: bool| {
            let of_side = ways.iter().filter(|w| w.name.starts_with("Embree") == theirs && !w.name.contains("robust"));
            of_side.map(of).fold(0.0, f64::max)
        };
        let over =
            [|w: &CpuWay| w.million_rays_a_second, |w: &CpuWay| w.at_best].map(|of| best(of, false) / best(of, true));
        CpuRace {
            kind,
            rays: a_point,
            radius,
            threads,
            hit: first as f64 / all.max(1.0),
            over_embree: cfg!(feature = "embree").then_some(over),
            ways,
        }
    }

    fn any_hit<'s>(&'s self, rays: &'s Rays, tmax: f32) -> Vec<Side<'s>> {
        let packs = rays.a_point / 8;
        let mut sides = Vec::new();
        for (name, tracer) in self.own() {
            let run = move |points: Range<usize>, out: &mut [u8]| {
                for (i, out) in points.zip(out.chunks_mut(packs)) {
                    let (origin, normal) = (rays.origins[i], rays.points[i].normal);
                    let fan = Fan { origin, normal, tmax, faces: Faces::Both };
                    let packets = &rays.packets[i * packs..];
                    let met = match packs {
                        1 => tracer.occluded_from(&fan, &[packets[0]], 0xff),
                        2 => tracer.occluded_from(&fan, &[packets[0], packets[1]], 0xffff),
                        _ => packets.first_chunk().map_or(0, |p| tracer.occluded_from::<4>(&fan, p, u32::MAX)),
                    };
                    out.copy_from_slice(&met.to_le_bytes()[..packs]);
                }
            };
            sides.push(Side { name: name.into(), run: Box::new(run) });
        }
        sides.push(one_by_one("scalar", rays.a_point, move |point, i| {
            self.tracer.scalar().occluded(&Ray::new(rays.origins[point], rays.direction(point, i), tmax))
        }));
        #[cfg(feature = "embree")]
        for call in embree::Call::ALL {
            let run = move |p: Range<usize>, out: &mut [u8]| {
                let packets = &rays.packets[p.start * packs..p.end * packs];
                self.embree[0].occluded_from(call, &rays.origins[p], packets, tmax, out);
            };
            sides.push(Side { name: call.name(), run: Box::new(run) });
        }
        sides
    }

    fn segments<'s>(&'s self, segments: &'s [Segments], free: &'s Free) -> Vec<Side<'s>> {
        let mut sides = Vec::new();
        for (name, tracer) in self.own() {
            let run = move |points: Range<usize>, out: &mut [u8]| {
                for (i, out) in points.zip(out.chunks_mut(2)) {
                    let met = tracer.occluded_segments(&[segments[2 * i], segments[2 * i + 1]], 0xffff, Faces::Both);
                    out.copy_from_slice(&met.to_le_bytes()[..2]);
                }
            };
            sides.push(Side { name: name.into(), run: Box::new(run) });
        }
        sides.push(one_by_one("scalar", SEGMENTS, move |point, i| {
            let i = point * SEGMENTS + i;
            self.tracer.scalar().occluded(&Ray::new(free.origins[i], free.directions[i], free.lengths[i]))
        }));
        #[cfg(feature = "embree")]
        for call in embree::Call::ALL {
            let run = move |p: Range<usize>, out: &mut [u8]| {
                let r = p.start * SEGMENTS..p.end * SEGMENTS;
                let (origins, directions) = (&free.origins[r.clone()], &free.directions[r.clone()]);
                self.embree[0].occluded(call, origins, directions, &free.lengths[r], out);
            };
            sides.push(Side { name: call.name(), run: Box::new(run) });
        }
        sides
    }

    fn closest<'s>(&'s self, rays: &'s Rays, free: &'s Free) -> Vec<Side<'s>> {
        let ray = move |point: usize, i: usize| Ray::new(rays.origins[point], free.directions[point * 8 + i], FAR_AWAY);
        let mut sides = Vec::new();
        for (name, tracer) in self.own() {
            sides.push(one_by_one(name, 8, move |point, i| tracer.closest(&ray(point, i)).is_some()));
        }
        sides.push(one_by_one("scalar", 8, move |point, i| self.tracer.scalar().closest(&ray(point, i)).is_some()));
        #[cfg(feature = "embree")]
        for (name, embree) in ["Embree 1", "Embree 1, robust"].iter().zip(&self.embree) {
            let run = move |p: Range<usize>, out: &mut [u8]| {
                let r = p.start * 8..p.end * 8;
                let mut t = vec![0.0; r.len()];
                embree.closest(&free.origins[r.clone()], &free.directions[r], &mut t);
                for (out, t) in out.iter_mut().zip(t.chunks(8)) {
                    *out = t.iter().enumerate().fold(0, |m, (i, t)| m | u8::from(t.is_finite()) << i);
                }
            };
            sides.push(Side { name: (*name).into(), run: Box::new(run) });
        }
        sides
    }
}

/// A side that takes rays one by one: eight make a byte.
fn one_by_one<'s>(name: &str, a_point: usize, meets: impl Fn(usize, usize) -> bool + Sync + 's) -> Side<'s> {
    let run = move |points: Range<usize>, out: &mut [u8]| {
        for (byte, out) in (points.start * a_point / 8..).zip(out) {
            let (point, first) = (byte * 8 / a_point, byte * 8 % a_point);
            *out = (0..8).fold(0, |m, i| m | u8::from(meets(point, first + i)) << i);
        }
    };
    Side { name: name.into(), run: Box::new(run) }
}

/// Rays one after another.
struct Free {
    origins: Vec<Vec3>,
    directions: Vec<Vec3>,
    lengths: Vec<f32>,
}

impl Free {
    /// Of segments, or of the first eight rays of each point.
    fn new(segments: &[Segments], kind: Kind, rays: &Rays) -> Self {
        let mut free = Free { origins: vec![], directions: vec![], lengths: vec![] };
        for (s, lane) in segments.iter().flat_map(|s| (0..8).map(move |lane| (s, lane))) {
            free.origins.push(s.origins.get(lane));
            free.directions.push(s.directions.get(lane));
            free.lengths.push(s.tmax[lane]);
        }
        if kind == Kind::Closest {
            for (point, &origin) in rays.origins.iter().enumerate() {
                free.origins.extend([origin; 8]);
                free.directions.extend((0..8).map(|i| rays.direction(point, i)));
            }
        }
        free
    }
}

/// What the system calls its processor.
pub fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|l| l.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
