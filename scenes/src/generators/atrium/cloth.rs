//! Curtains in the arches of the lower storey, and banners before the upper one.

use super::{
    Atrium,
    columns::{SHAFT, rod},
    plan::{Plan, STOREYS, Side, hash},
    sink::{Sink, circle},
};
use glam::{Vec2, Vec3};

/// Height of the rods the curtains hang from: under the capitals.
const ROD: f32 = 2.96;
/// Pleats of a curtain that is shut, and of one tied back.
const PLEATS: [u32; 2] = [12, 8];
/// Banners: half width, top, lower corners, tip, and how far before the colonnade.
const BANNER: [f32; 5] = [0.48, 7.02, 4.35, 4.0, -0.70];

/// How a curtain hangs in its opening.
#[derive(Clone, Copy, PartialEq)]
enum Drawn {
    /// From pillar to pillar.
    Shut,
    /// Tied back to the pillar before, or after, the opening.
    Back(f32),
}

/// A curtain: where, how, and which.
#[derive(Clone, Copy)]
pub(super) struct Hanging {
    side: Side,
    s: f32,
    drawn: Drawn,
    number: u32,
}

impl Hanging {
    /// Counted from 1, along the house.
    pub(super) fn number(&self) -> u32 {
        self.number
    }
}

/// Every curtain of the house. The middle one of the long sides is shut.
pub(super) fn curtains(plan: &Plan) -> Vec<Hanging> {
    let mut hangings: Vec<Hanging> = vec![];
    for side in plan.sides {
        for k in 0..side.bays {
            let before = if k < side.bays / 2 { -1.0 } else { 1.0 };
            let drawn = match (k + side.bays / 2) % 2 {
                0 if side.is_long() => Drawn::Shut,
                0 => continue,
                _ => Drawn::Back(before),
            };
            hangings.push(Hanging { side, s: side.bay(k), drawn, number: hangings.len() as u32 + 1 });
        }
    }
    hangings
}

/// The rods of curtains and banners.
pub(super) fn rods(plan: &Plan, sink: &mut Sink) {
    for h in curtains(plan) {
        let half = h.side.pitch() / 2.0 - SHAFT + 0.05;
        rod(plan, sink, &h.side, [h.s - half, h.s + half], [ROD, 0.0], 0.02);
    }
    for h in banners(plan) {
        let half = BANNER[0] + 0.08;
        rod(plan, sink, &h.side, [h.s - half, h.s + half], [BANNER[1], BANNER[4]], 0.018);
        // Two arms carry it out from the rail.
        for s in [-0.3, 0.3].into_iter().filter(|_| plan.detail > 0.26) {
            let (low, high) = (BANNER[1] - 0.012, BANNER[1] + 0.012);
            sink.block(h.side.at(h.s + s - 0.012, low, BANNER[4]), h.side.at(h.s + s + 0.012, high, -0.1));
        }
    }
}

/// Places of the banners: before every second column of the long sides.
pub(super) fn banners(plan: &Plan) -> Vec<Hanging> {
    let mut hangings: Vec<Hanging> = vec![];
    for side in plan.sides.into_iter().filter(Side::is_long) {
        for k in (1..side.bays).step_by(2) {
            let number = hangings.len() as u32 + 1;
            hangings.push(Hanging { side, s: side.column(k), drawn: Drawn::Shut, number });
        }
    }
    hangings
}

/// A smooth step from 0 to 1.
fn ease(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How far the cloth stands out at pleat `u` (its whole part counts half
/// pleats), -1 to 1.
fn pleat(u: f64, number: u32) -> f32 {
    let k = u.floor();
    let crest = |k: f64| {
        let k = k as u32;
        let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * (0.62 + 0.38 * hash(k, number))
    };
    let t = (1.0 - circle((u - k) / 2.0).0) / 2.0;
    crest(k) * (1.0 - t) + crest(k + 1.0) * t
}

/// A curtain's cloth.
pub(super) fn curtain(plan: &Plan, atrium: &Atrium, h: &Hanging, sink: &mut Sink) {
    let half = h.side.pitch() / 2.0 - SHAFT - 0.05;
    let deep = atrium.pleat_depth.0 / 2.0;
    let hem = atrium.hem_gap.0;
    // Half of them where there is no detail for more.
    let pleats = PLEATS[usize::from(h.drawn != Drawn::Shut)] / if plan.cloth < 0.07 { 2 } else { 1 };
    // Where the point u, v of the cloth is seen from above; v runs down.
    let place = |u: f64, v: f32| {
        let mut out = deep * pleat(u * f64::from(2 * pleats), h.number) * (0.55 + 0.45 * ease(v * 1.5));
        let s = match h.drawn {
            Drawn::Shut => half * (2.0 * u as f32 - 1.0),
            Drawn::Back(way) => {
                // Wide at the rod, narrow at the tie, a little wider at the hem.
                let width = 0.58 - 0.36 * ease(v / 0.60) + 0.12 * ease((v - 0.60) / 0.40);
                out *= 1.0 - 0.5 * ease(1.0 - (v - 0.60).abs() / 0.25);
                way * half * (1.0 - 2.0 * width * u as f32)
            }
        };
        Vec2::new(h.s + s, out)
    };
    let cells = [count(plan, 8.0, 2) * pleats, count(plan, 18.0, 1)];
    cloth(sink, atrium, &h.side, cells, |u, v| (place(u, v), ROD * (1.0 - v) + hem * v));
}

/// A banner's cloth.
pub(super) fn banner(plan: &Plan, atrium: &Atrium, h: &Hanging, sink: &mut Sink) {
    let [half, top, corner, tip, before] = BANNER;
    let place = |u: f64, v: f32| {
        let x = 2.0 * u as f32 - 1.0;
        let fold = circle(u * 2.5 + f64::from(hash(h.number, 7))).0 * 0.025 * (0.3 + v);
        let low = tip + (corner - tip) * x.abs();
        (Vec2::new(h.s + half * x, before + fold), top * (1.0 - v) + low * v)
    };
    cloth(sink, atrium, &h.side, [2 * count(plan, 12.0, 1), count(plan, 24.0, 1)], place);
}

fn count(plan: &Plan, at_one: f64, least: u32) -> u32 {
    ((at_one * plan.cloth).round() as u32).max(least)
}

/// A sheet, or a thin body, of cloth. `at` gives the plan and the height of the
/// point u, v.
fn cloth(sink: &mut Sink, atrium: &Atrium, side: &Side, cells: [u32; 2], at: impl Fn(f64, f32) -> (Vec2, f32)) {
    let half = atrium.cloth_thickness.0 / 2.0;
    let point = |i: u32, j: u32, offset: f32| -> Vec3 {
        let (u, v) = (f64::from(i) / f64::from(cells[0]), j as f32 / cells[1] as f32);
        let (mut p, y) = at(u, v);
        if offset != 0.0 {
            let step = 1e-3;
            let along = at((u + step).min(1.0), v).0 - at((u - step).max(0.0), v).0;
            p += along.perp().normalize_or(Vec2::Y) * offset;
        }
        side.at(p.x, y, p.y)
    };
    if half > 0.0 {
        sink.plate(cells, |i, j| point(i, j, -half), |i, j| point(i, j, half));
    } else {
        sink.grid(cells, |i, j| point(i, j, 0.0));
    }
}

/// The height a curtain's top hangs at stays under the springing.
const _: () = assert!(ROD < STOREYS[0].spring);
