//! Columns, corner piers and the pilasters of the back walls.

use super::{
    plan::{BACK, Plan, Side, Storey},
    sink::{Sink, circle},
};
use glam::{Vec2, Vec3};

/// Half the edge of an abacus.
const ABACUS: f32 = 0.45;
/// From the springing down to a column's neck, and to its abacus' underside.
const NECK: f32 = 0.58;
const ABACUS_HEIGHT: f32 = 0.14;
/// How far things reach into what they stand on.
const TUCK: f32 = 0.02;
/// Radius of a shaft under its neck.
pub(super) const SHAFT: f32 = 0.23;

/// Half a box about a point of a side, from one height to another.
fn square(sink: &mut Sink, side: &Side, [s, d]: [f32; 2], [half_s, half_d]: [f32; 2], [low, high]: [f32; 2]) {
    sink.block(side.at(s - half_s, low, d - half_d), side.at(s + half_s, high, d + half_d));
}

/// Every column of the house.
pub(super) fn columns(plan: &Plan, sink: &mut Sink) {
    let segments = plan.cuts(24.0, 6);
    for (side, storey) in plan.arcades() {
        let outline = outline(plan, storey);
        for k in 1..side.bays {
            let at = [side.column(k), 0.0];
            let foot = 0.39 * storey.girth;
            square(sink, &side, at, [foot; 2], [storey.floor - TUCK, storey.floor + 0.14]);
            sink.revolve(side.at(at[0], 0.0, 0.0), segments, &outline);
            square(sink, &side, at, [ABACUS; 2], [storey.spring - ABACUS_HEIGHT, storey.spring + TUCK]);
        }
    }
}

/// Radius and height along a column, from the plinth to the abacus.
fn outline(plan: &Plan, storey: Storey) -> Vec<Vec2> {
    let girth = storey.girth;
    let (foot, neck) = (storey.floor + 0.14, storey.spring - NECK);
    // The base: two tori, down to none where there is no detail for them.
    let mut points = vec![];
    if plan.detail > 0.12 {
        bulge(&mut points, plan.cuts(7.0, 2), [0.30 * girth, foot - 0.01], 0.17, 0.08 * girth);
    } else {
        points.push(Vec2::new(0.36 * girth, foot - 0.01));
    }
    if plan.detail > 0.18 {
        bulge(&mut points, plan.cuts(5.0, 1), [0.28 * girth, foot + 0.19], 0.08, 0.04 * girth);
    }
    // The shaft, with a little entasis.
    let shaft = plan.cuts(8.0, 1);
    let (low, high) = (foot + 0.32, neck - 0.02);
    for i in 0..=shaft {
        let t = i as f32 / shaft as f32;
        points.push(Vec2::new((0.27 - (0.27 - SHAFT) * t * (0.6 + 0.4 * t)) * girth, low + (high - low) * t));
    }
    if plan.detail > 0.4 {
        bulge(&mut points, plan.cuts(5.0, 2), [SHAFT * girth, neck], 0.06, 0.03 * girth);
    }
    // The bell: hollow below, curling out into the abacus.
    let bell = plan.cuts(9.0, 1);
    let (low, high) = (neck + 0.08, storey.spring - ABACUS_HEIGHT + 0.01);
    for i in 0..=bell {
        let (cos, sin) = circle(f64::from(i) / f64::from(bell) / 4.0);
        points.push(Vec2::new((SHAFT + 0.01) * girth + (0.42 - SHAFT * girth) * (1.0 - cos), low + (high - low) * sin));
    }
    points
}

/// Half a circle of tube radius `out` over a cylinder, `height` high.
fn bulge(points: &mut Vec<Vec2>, cuts: u32, [radius, y]: [f32; 2], height: f32, out: f32) {
    for i in 0..=cuts {
        let (cos, sin) = circle(f64::from(i) / f64::from(cuts) / 2.0);
        points.push(Vec2::new(radius + out * sin, y + height * (1.0 - cos) / 2.0));
    }
}

/// The piers at the corners of the courtyard.
pub(super) fn piers(plan: &Plan, sink: &mut Sink) {
    for (side, storey) in plan.arcades() {
        let at = [side.reach, 0.0];
        let mut piece = |half: f32, low: f32, high: f32| square(sink, &side, at, [half; 2], [low, high]);
        piece(0.36, storey.floor - TUCK, storey.top);
        piece(0.45, storey.floor - TUCK, storey.floor + 0.16);
        if plan.detail > 0.15 {
            piece(0.41, storey.floor + 0.1, storey.floor + 0.28);
            piece(0.40, storey.spring - 0.34, storey.spring - 0.26);
            piece(0.41, storey.spring - 0.20, storey.spring - 0.08);
        }
        piece(ABACUS, storey.spring - ABACUS_HEIGHT, storey.spring + TUCK);
    }
}

/// The pilasters the vaults stand on at the back walls.
pub(super) fn pilasters(plan: &Plan, sink: &mut Sink) {
    for (side, storey) in plan.arcades() {
        for k in 0..=side.bays {
            let half = if k == 0 || k == side.bays { 0.33 } else { 0.22 };
            let at = [side.column(k), BACK];
            let mut piece = |wide: f32, deep: f32, low: f32, high: f32| {
                square(sink, &side, at, [half + wide, deep], [low, high]);
            };
            piece(0.0, 0.15, storey.floor - TUCK, storey.spring - 0.05);
            piece(0.06, 0.21, storey.spring - ABACUS_HEIGHT, storey.spring + TUCK);
            if plan.detail > 0.36 {
                piece(0.05, 0.20, storey.floor - TUCK, storey.floor + 0.16);
                piece(0.025, 0.175, storey.spring - 0.30, storey.spring - 0.24);
            }
        }
    }
}

/// The balustrade of the upper storey; a plain parapet where there is no detail
/// for balusters.
pub(super) fn balustrade(plan: &Plan, storey: Storey, sink: &mut Sink) {
    const SHAPE: [[f32; 2]; 8] = [
        [0.065, 0.0],
        [0.065, 0.07],
        [0.04, 0.10],
        [0.085, 0.30],
        [0.05, 0.58],
        [0.038, 0.78],
        [0.06, 0.86],
        [0.06, 1.0],
    ];
    let (low, high) = (storey.floor + 0.13, storey.floor + 0.94);
    let each = plan.cuts(9.0, 0).min(9);
    let segments = plan.cuts(10.0, 5);
    let outline = baluster(&SHAPE, plan.cuts(2.0, 1), high - low);
    for side in &plan.sides {
        for k in 0..side.bays {
            let (s, half) = (side.bay(k), side.pitch() / 2.0 - 0.15);
            square(sink, side, [s, 0.0], [half, 0.18], [storey.floor + 0.92, storey.floor + 1.06]);
            if plan.detail > 0.21 {
                square(sink, side, [s, 0.0], [half, 0.15], [storey.floor - TUCK, storey.floor + 0.14]);
            }
            if each < 3 {
                square(sink, side, [s, 0.0], [half, 0.09], [storey.floor - TUCK, high]);
                continue;
            }
            for b in 0..each {
                let t = (b as f32 + 0.5) / each as f32 * 2.0 - 1.0;
                sink.revolve(side.at(s + t * (side.pitch() / 2.0 - 0.28), low, 0.0), segments, &outline);
            }
        }
    }
}

/// A baluster's outline: `cuts` pieces between two points of its shape.
fn baluster(shape: &[[f32; 2]], cuts: u32, height: f32) -> Vec<Vec2> {
    let mut points: Vec<Vec2> = vec![];
    for pair in shape.windows(2) {
        for i in 0..cuts {
            let t = f64::from(i) / f64::from(cuts);
            let ease = (1.0 - circle(t / 2.0).0) / 2.0;
            let [a, b] = [pair[0], pair[1]];
            points.push(Vec2::new(a[0] + (b[0] - a[0]) * ease, (a[1] + (b[1] - a[1]) * t as f32) * height));
        }
    }
    points.extend(shape.last().map(|p| Vec2::new(p[0], p[1] * height)));
    points
}

/// A bar along a side: a curtain rod.
pub(super) fn rod(plan: &Plan, sink: &mut Sink, side: &Side, s: [f32; 2], [y, d]: [f32; 2], radius: f32) {
    let segments = plan.cuts(8.0, 4);
    sink.loft(2, segments, |i, j| {
        let (cos, sin) = circle(f64::from(j) / f64::from(segments));
        side.at(s[i as usize], y - radius * sin, d - radius * cos)
    });
}

/// Doors in the back walls of the lower walk: leaves here, frames in stone.
pub(super) fn doors(plan: &Plan, sink: &mut Sink, frames: bool) {
    for side in plan.sides.iter().filter(|_| plan.detail > 0.39) {
        for k in (1..side.bays).step_by(2) {
            let s = side.bay(k);
            let mut piece = |from: [f32; 2], to: [f32; 2], out: f32| {
                let (a, b): (Vec3, Vec3) = (side.at(from[0], from[1], BACK - out), side.at(to[0], to[1], BACK + 0.1));
                sink.block(a, b);
            };
            if frames {
                piece([s - 0.82, -TUCK], [s - 0.6, 2.5], 0.10);
                piece([s + 0.6, -TUCK], [s + 0.82, 2.5], 0.10);
                piece([s - 0.9, 2.45], [s + 0.9, 2.72], 0.14);
            } else {
                piece([s - 0.62, -TUCK], [s - 0.01, 2.46], 0.03);
                piece([s + 0.01, -TUCK], [s + 0.62, 2.46], 0.03);
            }
        }
    }
}
