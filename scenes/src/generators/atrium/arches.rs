//! The walls over the columns with their round arches, and the bands that frame
//! them.

use super::{
    plan::{Plan, Side, Storey, WALL},
    sink::{Sink, circle},
};
use glam::Vec2;

/// How far the wall reaches into the corner piers, from their middle.
const END: f32 = 0.2;
/// A band's width beyond the arch, and how far it stands out of the wall and
/// into the opening.
const BAND: f32 = 0.17;
const RELIEF: f32 = 0.05;

/// The walls over the arches, one body a side and storey.
pub(super) fn walls(plan: &Plan, sink: &mut Sink) {
    let (around, up, through) = (plan.cuts(20.0, 4), plan.cuts(3.0, 1), plan.cuts(3.0, 1));
    for (side, storey) in plan.arcades() {
        // An end, the arches with an impost between each two, and an end.
        let stations = side.bays * (around + 1) + 2;
        let points = 2 * (up + through);
        sink.loft(stations, points, |i, j| {
            let [foot, head] = station(&side, storey, i, around);
            let between = |from: f32, to: f32, k: u32, n: u32| from + (to - from) * (k as f32 / n as f32);
            let (t, d) = match j {
                _ if j < through => (0.0, between(-WALL, WALL, j, through)),
                _ if j < through + up => (between(0.0, 1.0, j - through, up), WALL),
                _ if j < 2 * through + up => (1.0, between(WALL, -WALL, j - through - up, through)),
                _ => (between(1.0, 0.0, j - 2 * through - up, up), -WALL),
            };
            let p = foot + (head - foot) * t;
            side.at(p.x, p.y, d)
        });
    }
}

/// Lower and upper end of the wall's section `i`, along the side and up.
fn station(side: &Side, storey: Storey, i: u32, around: u32) -> [Vec2; 2] {
    let (reach, top) = (side.reach - END, storey.top);
    let last = side.bays * (around + 1) + 1;
    if i == 0 || i == last {
        let s = if i == 0 { -reach } else { reach };
        return [Vec2::new(s, storey.spring), Vec2::new(s, top)];
    }
    let (bay, k) = ((i - 1) / (around + 1), (i - 1) % (around + 1));
    let (radius, middle) = (side.arch(), side.bay(bay));
    let (cos, sin) = circle(0.5 - f64::from(k) / f64::from(around) / 2.0);
    let across = 2.0 * k as f32 / around as f32 - 1.0;
    [Vec2::new(middle + radius * cos, storey.spring + radius * sin), Vec2::new(middle + radius * across, top)]
}

/// The bands round the arches, where there is detail for them.
pub(super) fn bands(plan: &Plan, sink: &mut Sink) {
    if plan.detail < 0.45 {
        return;
    }
    let around = plan.cuts(20.0, 4);
    for (side, storey) in plan.arcades() {
        let radius = side.arch();
        let (inner, outer, deep) = (radius - 0.02, radius + BAND, WALL + RELIEF);
        // A step inward, half way out.
        let (step, shallow) = (radius + BAND * 0.55, WALL + RELIEF * 0.5);
        let section = [
            [inner, deep],
            [step, deep],
            [step, shallow],
            [outer, shallow],
            [outer, -shallow],
            [step, -shallow],
            [step, -deep],
            [inner, -deep],
        ];
        for k in 0..side.bays {
            sink.loft(around + 1, section.len() as u32, |i, j| {
                let (cos, sin) = circle(0.5 - f64::from(i) / f64::from(around) / 2.0);
                let [r, d] = section[j as usize];
                side.at(side.bay(k) + r * cos, storey.spring + r * sin, d)
            });
        }
    }
}
