//! What keeps the light out: foundation, back walls and roof as one body without
//! a seam, the floor between the storeys, and the paving.

use super::{
    plan::{BACK, BOTTOM, COURT, HALF, Plan, TOP},
    sink::Sink,
};
use glam::Vec3;

/// Height of what lies under the paving.
const BED: f32 = -0.006;
/// Width and depth of a flag's bevel; two of them make a joint.
const BEVEL: [f32; 2] = [0.012, 0.004];

/// A section of the shell: how far out from the centre line of the colonnade,
/// and how high. From under the foundation up the outer face, over the roof,
/// round the eaves and down the back wall to the bed of the floor.
const SHELL: [[f32; 2]; 13] = [
    [HALF[0] - COURT[0], BOTTOM],
    [HALF[0] - COURT[0], TOP],
    [BACK + 0.2, TOP],
    [BACK + 0.2, TOP - 0.2],
    [-0.72, 11.62],
    [-0.72, 11.52],
    [-0.68, 11.50],
    [-0.62, 11.38],
    [-0.50, 11.28],
    [-0.46, 11.26],
    [-0.44, 11.10],
    [BACK, 11.10],
    [BACK, BED],
];

/// A section of the floor between the storeys, with its cornice.
const SLAB: [[f32; 2]; 11] = [
    [BACK + 0.1, 5.75],
    [BACK + 0.1, 6.2],
    [-0.60, 6.2],
    [-0.60, 6.10],
    [-0.56, 6.09],
    [-0.53, 6.03],
    [-0.47, 5.96],
    [-0.42, 5.93],
    [-0.42, 5.89],
    [-0.38, 5.88],
    [-0.36, 5.75],
];

/// Point `j` of a rectangle `out` from the centre line of the colonnade, each
/// edge cut in `cuts`.
fn rectangle(out: f32, y: f32, j: u32, cuts: u32) -> Vec3 {
    let [x, z] = [COURT[0] + out, COURT[1] + out];
    let corner = [[x, z], [-x, z], [-x, -z], [x, -z]];
    let [a, b] = [corner[(j / cuts) as usize % 4], corner[(j / cuts + 1) as usize % 4]];
    let t = (j % cuts) as f32 / cuts as f32;
    Vec3::new(a[0] * (1.0 - t) + b[0] * t, y, a[1] * (1.0 - t) + b[1] * t)
}

/// Foundation, back walls and roof.
pub(super) fn shell(plan: &Plan, sink: &mut Sink) {
    let cuts = plan.cuts(8.0, 1);
    sink.loft(SHELL.len() as u32, 4 * cuts, |i, j| {
        let [out, y] = SHELL[i as usize];
        rectangle(out, y, j, cuts)
    });
}

/// The floor between the storeys.
pub(super) fn slab(plan: &Plan, sink: &mut Sink) {
    let cuts = plan.cuts(8.0, 1);
    sink.torus(SLAB.len() as u32, 4 * cuts, |i, j| {
        let [out, y] = SLAB[i as usize];
        rectangle(out, y, j, cuts)
    });
}

/// Flags with bevelled edges, edge to edge, open below, over their bed.
pub(super) fn paving(plan: &Plan, sink: &mut Sink) {
    let tuck = 0.02;
    let half = [COURT[0] + BACK + tuck, COURT[1] + BACK + tuck];
    let across = plan.cuts(25.0, 3).min(25);
    let flags = [(f64::from(across) * 29.0 / 17.0).round() as u32, across];
    let cuts = plan.cuts(3.0, 3) - 2;
    for k in 0..flags[0] {
        for l in 0..flags[1] {
            sink.grid([cuts + 2, cuts + 2], |i, j| {
                let (z, low_z) = station(i, cuts, l, flags[1], half[1]);
                let (x, low_x) = station(j, cuts, k, flags[0], half[0]);
                Vec3::new(x, if low_x || low_z { -BEVEL[1] } else { 0.0 }, z)
            });
        }
    }
}

/// Coordinate of cut `i` of flag `k` of `flags`, and whether it is its edge.
fn station(i: u32, cuts: u32, k: u32, flags: u32, half: f32) -> (f32, bool) {
    let border = |k: u32| half * (2.0 * k as f32 / flags as f32 - 1.0);
    let (from, to) = (border(k), border(k + 1));
    match i {
        0 => (from, true),
        _ if i == cuts + 2 => (to, true),
        _ => {
            let t = (i - 1) as f32 / cuts as f32;
            ((from + BEVEL[0]) * (1.0 - t) + (to - BEVEL[0]) * t, false)
        }
    }
}
