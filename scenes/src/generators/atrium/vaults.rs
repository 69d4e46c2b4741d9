//! Cross vaults over the walks, and the arches between them.

use super::{
    plan::{BACK, Plan, Side, Storey, WALL},
    sink::{Sink, circle},
};
use glam::Vec3;

/// How far a vault reaches into the walls it meets.
const TUCK: f32 = 0.02;
/// Middle and half width of a walk, from the centre line of the colonnade.
const MIDDLE: f32 = (BACK + WALL) / 2.0;
const HALF: f32 = (BACK - WALL) / 2.0 + TUCK;
/// How far an arch stands out of the vault.
const RIB: f32 = 0.15;

/// A rectangle of a side under one vault: middle and half extent along s, and
/// how high the vault rises.
struct Bay {
    s: f32,
    half: f32,
    rise: f32,
}

fn corner(plan: &Plan, side: &Side) -> Bay {
    let rise = plan.sides.iter().map(Side::vault).fold(f32::INFINITY, f32::min);
    Bay { s: side.reach + MIDDLE, half: HALF, rise }
}

/// The vaults: a barrel along the walk and one across it in every bay.
pub(super) fn vaults(plan: &Plan, sink: &mut Sink) {
    for (side, storey) in plan.arcades() {
        for k in 0..side.bays {
            let bay = Bay { s: side.bay(k), half: side.pitch() / 2.0, rise: side.vault() };
            cross(plan, sink, &side, storey, &bay);
        }
        cross(plan, sink, &side, storey, &corner(plan, &side));
    }
}

/// The four webs of one cross vault, seen from below.
fn cross(plan: &Plan, sink: &mut Sink, side: &Side, storey: Storey, bay: &Bay) {
    let (around, out) = (plan.even(18.0, 4), plan.cuts(7.0, 1));
    for web in 0..4 {
        let sign = if web < 2 { 1.0 } else { -1.0 };
        sink.leaf([around, out], |i, j| {
            let k = i32::try_from(i).unwrap_or(0) - i32::try_from(around / 2).unwrap_or(0);
            let (cos, sin) = circle(f64::from(k) / f64::from(around) / 2.0);
            let (across, groin) = (sin * sign, sin.abs());
            let t = j as f32 / out as f32;
            let outward = if j == out { sign } else { sign * (groin + (1.0 - groin) * t) };
            // Both ways turn the same way round, so that all webs face down.
            let [s, d] = if web % 2 == 0 { [across, outward] } else { [outward, -across] };
            side.at(bay.s + bay.half * s, storey.spring + bay.rise * cos, MIDDLE + HALF * d)
        });
    }
}

/// The arches across the walks, at every column and at the corners.
pub(super) fn ribs(plan: &Plan, sink: &mut Sink) {
    let around = plan.cuts(19.0, 4);
    for (side, storey) in plan.arcades() {
        let (rise, at_corner) = (side.vault(), corner(plan, &side).rise);
        for k in 0..=side.bays {
            let end = k == 0 || k == side.bays;
            if !end && plan.detail < 0.33 {
                continue;
            }
            let half = if end { 0.34 } else { 0.2 };
            let (low, high) = if end { (rise.min(at_corner), rise.max(at_corner)) } else { (rise, rise) };
            let section: [[f32; 3]; 4] = [
                [-half, HALF + 0.01, high + 0.02],
                [half, HALF + 0.01, high + 0.02],
                [half, HALF - RIB, low - RIB],
                [-half, HALF - RIB, low - RIB],
            ];
            sink.loft(around + 1, 4, |i, j| -> Vec3 {
                let (cos, sin) = circle(0.5 - f64::from(i) / f64::from(around) / 2.0);
                let [s, across, up] = section[j as usize];
                side.at(side.column(k) + s, storey.spring + up * sin, MIDDLE + across * cos)
            });
        }
    }
}
