//! Cloths, slats and cards: a sheet over two parameters, as one open layer or as
//! a closed solid.

use crate::Mesh;
use glam::Vec3;

/// Adds a sheet of `columns` x `rows` quadrilaterals through the points
/// `at(u, v)`, u and v from 0 to 1.
///
/// With `across` zero it is one open layer that faces along du x dv; else a
/// closed solid, `across` thick, centred on those points. `across` must point
/// against du x dv.
pub(crate) fn push_sheet(mesh: &mut Mesh, [columns, rows]: [u32; 2], at: impl Fn(f32, f32) -> Vec3, across: Vec3) {
    let base = mesh.positions.len() as u32;
    let vertex = |layer: u32, i: u32, j: u32| base + (layer * (rows + 1) + j) * (columns + 1) + i;
    let layers = if across == Vec3::ZERO { 1 } else { 2 };
    for layer in 0..layers {
        let offset = if layers == 1 { Vec3::ZERO } else { across * (layer as f32 - 0.5) };
        for j in 0..=rows {
            for i in 0..=columns {
                mesh.positions.push(at(i as f32 / columns as f32, j as f32 / rows as f32) + offset);
            }
        }
    }
    let mut quad = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for layer in 0..layers {
        for j in 0..rows {
            for i in 0..columns {
                let v = |i, j| vertex(layer, i, j);
                let [a, b, c, d] = [v(i, j), v(i + 1, j), v(i + 1, j + 1), v(i, j + 1)];
                quad(if layer == 0 { [a, b, c, d] } else { [d, c, b, a] });
            }
        }
    }
    if layers == 1 {
        return;
    }
    // The rim joins the two layers; it walks each border edge against the first.
    let mut rim = |a: [u32; 2], b: [u32; 2]| {
        quad([vertex(0, b[0], b[1]), vertex(0, a[0], a[1]), vertex(1, a[0], a[1]), vertex(1, b[0], b[1])]);
    };
    for i in 0..columns {
        rim([i, 0], [i + 1, 0]);
        rim([i + 1, rows], [i, rows]);
    }
    for j in 0..rows {
        rim([columns, j], [columns, j + 1]);
        rim([0, j + 1], [0, j]);
    }
}
