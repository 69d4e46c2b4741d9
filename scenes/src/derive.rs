//! Views for scenes that give none: found from the sheet and the receiver.

use crate::{LookView, MeasureView, Object, closest_point};
use glam::{Mat3, Vec3};

/// Points of the sheet that are looked at, at most.
const SAMPLES: usize = 512;

/// A point of the sheet with the receiver under it.
struct Stand {
    sheet: Vec3,
    base: Vec3,
    normal: Vec3,
    gap: f32,
}

/// A triangle with its bounds.
struct Boxed {
    min: Vec3,
    max: Vec3,
    corners: [Vec3; 3],
}

/// A measure view under the part of the occluder that comes nearest to a
/// receiver: centred below its edge, the transect across it, the near plane at
/// 0.8 of the gap, 2 R to each side at R/50 a pixel.
///
/// # Errors
/// A sentence that says what is missing.
pub(crate) fn measure(objects: &[Object], radius: f32) -> Result<MeasureView, String> {
    let stands = stands(objects, radius);
    let facing = |s: &Stand, n: Vec3| s.normal.dot(n) > 0.95;
    let count = |n: Vec3| stands.iter().filter(|s| facing(s, n)).count();
    let leader = stands.iter().max_by_key(|s| count(s.normal)).ok_or_else(|| {
        format!("measure is not given and cannot be found: no part of an occluder comes within ao.radius = {radius} m of another object")
    })?;
    let normal = leader.normal;
    let group: Vec<&Stand> = stands.iter().filter(|s| facing(s, normal)).collect();
    let lowest = group.iter().map(|s| s.gap).fold(f32::INFINITY, f32::min);
    let edge: Vec<&&Stand> = group.iter().filter(|s| s.gap <= lowest + 0.1 * radius).collect();
    let mean = edge.iter().map(|s| s.base).sum::<Vec3>() / edge.len() as f32;
    let Some(middle) = edge.iter().min_by(|a, b| a.base.distance(mean).total_cmp(&b.base.distance(mean))) else {
        return Err("measure is not given and cannot be found".into());
    };
    let along = longest_axis(edge.iter().map(|s| s.base - mean), normal);
    let across = along.cross(normal).normalize_or_zero();
    let largest = across.to_array().into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0);
    let transect = snapped(if largest < 0.0 { -across } else { across }, normal);
    // Under everything that the view spans, not only under its middle.
    let clear = group
        .iter()
        .filter(|s| s.base.distance(middle.base) < 2.5 * radius)
        .map(|s| normal.dot(s.sheet - middle.base))
        .fold(f32::INFINITY, f32::min);
    Ok(MeasureView {
        center: middle.base,
        normal,
        transect,
        clearance: 0.8 * clear,
        pixel: radius / 50.0,
        resolution: [208, 32],
    })
}

/// The world axis across `normal` within a degree of a direction, or else the
/// direction: sheets are sampled unevenly, and most hang straight.
fn snapped(direction: Vec3, normal: Vec3) -> Vec3 {
    [Vec3::X, Vec3::Y, Vec3::Z]
        .into_iter()
        .map(|axis| (axis - normal * normal.dot(axis)).normalize_or_zero())
        .find(|axis| axis.dot(direction) > 0.999_85)
        .unwrap_or(direction)
}

/// A look view on the middle of a measure view, from the right and above.
pub(crate) fn look(measure: &MeasureView, radius: f32) -> LookView {
    let along = measure.normal.cross(measure.transect);
    let side = if along.y.abs() > 0.9 { measure.normal } else { along };
    LookView {
        eye: measure.center + radius * (3.0 * measure.transect + 1.7 * measure.normal + 4.6 * side),
        target: measure.center + measure.normal * (0.3 * radius),
        fov: 45.0,
        resolution: [288, 192],
    }
}

/// Points of the occluder's edges that have a receiver within `radius`, by
/// brute force: no tree is worth building for so few points.
fn stands(objects: &[Object], radius: f32) -> Vec<Stand> {
    let receiver: Vec<Boxed> = objects
        .iter()
        .filter(|o| !o.occluder)
        .flat_map(|o| o.mesh.corners())
        .map(|c| Boxed { min: c[0].min(c[1]).min(c[2]), max: c[0].max(c[1]).max(c[2]), corners: c })
        .collect();
    let points: Vec<Vec3> = objects
        .iter()
        .filter(|o| o.occluder)
        .flat_map(|o| o.mesh.corners())
        .flat_map(|[a, b, c]| [(a, b), (b, c), (c, a)])
        .flat_map(|(a, b)| {
            let steps = ((b - a).length() / (0.5 * radius)).ceil().clamp(1.0, 64.0) as u32;
            (0..steps).map(move |i| a + (b - a) * (i as f32 / steps as f32))
        })
        .collect();
    let stride = points.len().div_ceil(SAMPLES).max(1);
    points.iter().step_by(stride).filter_map(|&p| stand(p, &receiver, radius)).collect()
}

fn stand(sheet: Vec3, receiver: &[Boxed], radius: f32) -> Option<Stand> {
    let mut best = radius * radius;
    let mut found = None;
    for b in receiver {
        if (sheet.clamp(b.min, b.max) - sheet).length_squared() > best {
            continue;
        }
        let at = closest_point(sheet, &b.corners);
        let d = (at - sheet).length_squared();
        if d < best {
            best = d;
            found = Some((at, &b.corners));
        }
    }
    let (base, [a, b, c]) = found?;
    let normal = (*b - *a).cross(*c - *a).normalize_or_zero();
    let normal = if normal.dot(sheet - base) < 0.0 { -normal } else { normal };
    let gap = normal.dot(sheet - base);
    // A sheet that touches leaves no room for a view; one that stands beside the
    // receiver's rim and not over it is no sheet over a receiver.
    (gap > 1e-3 * radius && gap > 0.99 * best.sqrt()).then_some(Stand { sheet, base, normal, gap })
}

/// The direction in the plane across `normal` in which points spread most, by
/// power iteration on their covariance.
fn longest_axis(points: impl Iterator<Item = Vec3>, normal: Vec3) -> Vec3 {
    let covariance = points.fold(Mat3::ZERO, |m, p| {
        let p = p - normal * normal.dot(p);
        m + Mat3::from_cols(p * p.x, p * p.y, p * p.z)
    });
    let start = normal.any_orthonormal_vector();
    let mut axis = start + 0.5 * normal.cross(start);
    for _ in 0..64 {
        axis = (covariance * axis).try_normalize().unwrap_or(start);
    }
    axis
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library;

    #[test]
    fn the_view_under_a_curtain_is_the_one_a_person_would_give() {
        for name in ["curtain-open", "curtain-room", "thick-box"] {
            let scene = library::scene(name).unwrap();
            let found = measure(&scene.objects, scene.ao.radius).unwrap();
            let given = scene.measure;
            assert!((found.normal - given.normal).length() < 1e-4, "{name}: {found:?}");
            assert!((found.transect - given.transect).length() < 1e-3, "{name}: {found:?}");
            assert!((found.clearance - given.clearance).abs() < 1e-4, "{name}: {found:?}");
            assert_eq!((found.pixel, found.resolution), (given.pixel, given.resolution));
            let off = found.center - given.center;
            assert!(off.x.abs() < 0.11 && off.y.abs() < 1e-5, "{name}: {found:?}");
        }
    }

    #[test]
    fn without_a_sheet_near_a_receiver_there_is_no_view() {
        let scene = library::scene("plane").unwrap();
        assert!(measure(&scene.objects, 0.25).unwrap_err().contains("ao.radius"));
    }
}
