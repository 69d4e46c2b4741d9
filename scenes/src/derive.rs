//! Views for scenes that give none: found from the sheet and the receiver.

use crate::{LookView, MeasureView, Object, clip, closest_point};
use glam::{Vec2, Vec3};

/// Points of the sheet that are looked at, at most.
const SAMPLES: usize = 4096;
/// Samples that share a box, so that most triangles are passed over together.
const CLUSTER: usize = 64;
/// A gap below this share of R is too small to look into.
const LEAST_GAP: f32 = 1e-3;
/// A gap below this, metres, is taken for contact.
const CONTACT: f32 = 1e-5;
/// How far round its centre a view is kept clear of the occluder, in R.
const CLEAR: f32 = 2.5;
/// Directions of receivers that are tried, at most.
const MAX_GROUPS: usize = 64;

/// A point of the sheet with the receiver under it.
struct Stand {
    /// Which object of the scene the sheet is.
    sheet: usize,
    base: Vec3,
    normal: Vec3,
    gap: f32,
}

impl Stand {
    /// Whether its receiver faces about this way.
    fn faces(&self, normal: Vec3) -> bool {
        self.normal.dot(normal) > 0.95
    }

    /// Whether its receiver lies about in the plane of another's.
    fn beside(&self, other: &Stand, radius: f32) -> bool {
        self.faces(other.normal) && other.normal.dot(self.base - other.base).abs() < 0.1 * radius
    }
}

/// A measure view under the part of the occluder that comes nearest to a
/// receiver, a floor where there is one: centred below its edge, of many sheets
/// below that of one, the transect across it, the near plane at 0.8 of the least
/// height of the occluder within 2.5 R, 2 R to each side at R/50 a pixel.
///
/// The transect runs across the long direction of the edge. Under a base that
/// is about as wide as long there is none; then it is the first of the axes x, y
/// and z that lies more across the normal than along it.
///
/// # Errors
/// A sentence that says what is missing.
pub(crate) fn measure(objects: &[Object], radius: f32) -> Result<MeasureView, String> {
    if !objects.iter().any(|o| o.occluder) {
        return Err("measure is not given and cannot be found: the scene has no occluder; give [measure], or mark an object with occluder = true".into());
    }
    let all = stands(objects, radius);
    let mut left: Vec<&Stand> = all.iter().filter(|s| s.gap > LEAST_GAP * radius).collect();
    let mut refused = None;
    // Floors first, then the largest group of stands, until one has room: what
    // hangs between pillars comes near many of their sides.
    for _ in 0..MAX_GROUPS {
        let count = |leader: &Stand| left.iter().filter(|s| s.beside(leader, radius)).count();
        let Some(&leader) = left.iter().max_by_key(|s| (s.faces(Vec3::Y), count(s))) else {
            break;
        };
        let group: Vec<&Stand> = left.iter().copied().filter(|s| s.beside(leader, radius)).collect();
        match under(objects, &group, leader.normal, radius) {
            Ok(view) => return Ok(view),
            Err((center, height)) => refused = refused.or_else(|| Some(too_low(&all, center, height, radius))),
        }
        left.retain(|s| !s.beside(leader, radius) && !std::ptr::eq(*s, leader));
    }
    let why = refused.unwrap_or_else(|| no_stand(&all, radius));
    Err(format!("measure is not given and cannot be found: {why}, or give [measure]"))
}

/// The view under the lowest of stands that face one way; its centre and the
/// least height there where that is too low.
fn under(objects: &[Object], group: &[&Stand], normal: Vec3, radius: f32) -> Result<MeasureView, (Vec3, f32)> {
    let lowest = group.iter().map(|s| s.gap).fold(f32::INFINITY, f32::min);
    let low: Vec<&Stand> = group.iter().copied().filter(|s| s.gap <= lowest + 0.1 * radius).collect();
    // Of many curtains one: under all of them together there is no long direction.
    let of = |sheet: usize| low.iter().filter(|s| s.sheet == sheet).count();
    let sheet = low.iter().map(|s| s.sheet).max_by_key(|&sheet| (of(sheet), std::cmp::Reverse(sheet)));
    let edge: Vec<Vec3> = low.iter().filter(|s| Some(s.sheet) == sheet).map(|s| s.base).collect();
    // And of that, where one object is many curtains, a place under one: between
    // them all, or along their row, a view would measure none.
    let (_, place) = middle(&edge);
    let edge: Vec<Vec3> = edge.into_iter().filter(|p| p.distance(place) <= CLEAR * radius).collect();
    let (mean, center) = middle(&edge);
    let transect = transect(&edge, mean, normal);
    let height = least_height(objects, center, normal, transect, radius);
    if height <= LEAST_GAP * radius {
        return Err((center, height));
    }
    Ok(MeasureView { center, normal, transect, clearance: 0.8 * height, pixel: radius / 50.0, resolution: [208, 32] })
}

/// The mean of some points, and the one of them that is nearest to it.
fn middle(points: &[Vec3]) -> (Vec3, Vec3) {
    let mean = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    (mean, points.iter().copied().min_by(|a, b| a.distance(mean).total_cmp(&b.distance(mean))).unwrap_or(mean))
}

/// Why no part of the occluder stands over a receiver.
fn no_stand(all: &[Stand], radius: f32) -> String {
    let gap = all.iter().map(|s| s.gap).fold(0.0, f32::max);
    if all.is_empty() {
        format!(
            "no part of an occluder stands over another object within ao.radius = {radius} m; give a larger ao.radius, up to 1000 m"
        )
    } else if gap > CONTACT {
        too_small(gap, radius)
    } else {
        "the occluder touches what it stands on and leaves no gap to look into; raise it".into()
    }
}

/// Why a view centred here would see the occluder.
fn too_low(all: &[Stand], center: Vec3, height: f32, radius: f32) -> String {
    if height > CONTACT {
        too_small(height, radius)
    } else {
        let contact = all
            .iter()
            .filter(|s| s.gap <= CONTACT)
            .map(|s| s.base)
            .min_by(|a, b| a.distance(center).total_cmp(&b.distance(center)))
            .unwrap_or(center);
        format!(
            "the occluder touches or crosses what it stands on near {contact} and leaves no gap to look into; raise it"
        )
    }
}

fn too_small(gap: f32, radius: f32) -> String {
    format!(
        "the occluder stands only {gap} m over another object, less than 1/1000 of ao.radius = {radius} m; give a smaller ao.radius, down to 0.001 m"
    )
}

/// The direction across the edge's long one, as [`measure`] says.
fn transect(edge: &[Vec3], mean: Vec3, normal: Vec3) -> Vec3 {
    let x = normal.any_orthonormal_vector();
    let y = normal.cross(x);
    let (xx, xy, yy) = edge.iter().map(|p| Vec2::new((*p - mean).dot(x), (*p - mean).dot(y))).fold(
        (0.0f64, 0.0f64, 0.0f64),
        |(xx, xy, yy), p| {
            let (a, b) = (f64::from(p.x), f64::from(p.y));
            (xx + a * a, xy + a * b, yy + b * b)
        },
    );
    let (middle, half) = ((xx + yy) / 2.0, ((xx - yy) / 2.0).hypot(xy));
    // Less than three times as long as wide, by standard deviation.
    if middle - half > (middle + half) / 9.0 {
        return axis_across(normal);
    }
    // The eigenvector of the smaller eigenvalue: a quarter turn off the larger's.
    let angle = 0.5 * (2.0 * xy).atan2(xx - yy) + std::f64::consts::FRAC_PI_2;
    let across = x * angle.cos() as f32 + y * angle.sin() as f32;
    let largest = across.to_array().into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(1.0);
    snapped(if largest < 0.0 { -across } else { across }, normal)
}

/// The first world axis that lies more across `normal` than along it, laid into
/// the plane across it.
fn axis_across(normal: Vec3) -> Vec3 {
    let axis = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().find(|a| a.dot(normal).abs() < 0.7).unwrap_or(Vec3::X);
    (axis - normal * normal.dot(axis)).normalize_or_zero()
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

/// The least height over the receiver's plane at which any part of the occluder
/// is met within 2.5 R of the centre, to each side and upwards; R where there is
/// none. What lies wholly under the receiver does not count.
fn least_height(objects: &[Object], center: Vec3, normal: Vec3, transect: Vec3, radius: f32) -> f32 {
    let (reach, floor) = (CLEAR * radius, -LEAST_GAP * radius);
    let along = normal.cross(transect);
    let sphere = Vec3::splat(reach * 3.0f32.sqrt());
    let (low, high) = (center - sphere, center + sphere);
    let mut least = radius;
    for [a, b, c] in objects.iter().filter(|o| o.occluder).flat_map(|o| o.mesh.corners()) {
        if a.min(b).min(c).cmpgt(high).any() || a.max(b).max(c).cmplt(low).any() {
            continue;
        }
        let local = [a, b, c].map(|p| {
            let d = p - center;
            Vec3::new(d.dot(transect), d.dot(along), d.dot(normal))
        });
        let mut part = local.to_vec();
        for side in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y] {
            part = clip(&part, |p| reach - p.dot(side));
        }
        part = clip(&part, |p| p.z - floor);
        least = part.iter().map(|p| p.z).fold(least, f32::min);
    }
    least
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

/// Points along the occluder's edges, no further than R/2 apart on edges up to
/// 32 R long, triangle by triangle.
fn edge_points(objects: &[Object], radius: f32) -> impl Iterator<Item = (usize, Vec3)> + '_ {
    objects
        .iter()
        .enumerate()
        .filter(|(_, o)| o.occluder)
        .flat_map(|(sheet, o)| o.mesh.corners().map(move |corners| (sheet, corners)))
        .flat_map(|(sheet, [a, b, c])| [(a, b), (b, c), (c, a)].map(|edge| (sheet, edge)))
        .flat_map(move |(sheet, (a, b))| {
            let steps = ((b - a).length() / (0.5 * radius)).ceil().clamp(1.0, 64.0) as u32;
            (0..steps).map(move |i| (sheet, a + (b - a) * (i as f32 / steps as f32)))
        })
}

/// A place in a stretch of `stride`, another for each stretch: with equal steps
/// through the triangles of a grid, the hem might never be met.
fn somewhere(stretch: usize, stride: usize) -> usize {
    let mixed = (stretch as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed >> 32) % stride as u64) as usize
}

/// A sample of the sheet and the nearest point of a receiver found so far.
struct Sample {
    sheet: usize,
    point: Vec3,
    distance2: f32,
    nearest: Option<(Vec3, [Vec3; 3])>,
}

/// Points of the occluder's edges that have a receiver within `radius`, in one
/// pass over the receivers' triangles: each is held against boxes of samples.
fn stands(objects: &[Object], radius: f32) -> Vec<Stand> {
    let stride = edge_points(objects, radius).count().div_ceil(SAMPLES).max(1);
    let mut samples: Vec<Sample> = edge_points(objects, radius)
        .enumerate()
        .filter(|(i, _)| i % stride == somewhere(i / stride, stride))
        .map(|(_, (sheet, point))| Sample { sheet, point, distance2: radius * radius, nearest: None })
        .collect();
    let mut clusters: Vec<(Vec3, Vec3, &mut [Sample])> = samples
        .chunks_mut(CLUSTER)
        .map(|c| {
            let low = c.iter().map(|s| s.point).fold(Vec3::INFINITY, Vec3::min);
            (low - radius, c.iter().map(|s| s.point).fold(Vec3::NEG_INFINITY, Vec3::max) + radius, c)
        })
        .collect();
    for corners in objects.iter().filter(|o| !o.occluder).flat_map(|o| o.mesh.corners()) {
        let [a, b, c] = corners;
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        for (from, to, cluster) in &mut clusters {
            if low.cmple(*to).all() && high.cmpge(*from).all() {
                for sample in cluster.iter_mut() {
                    sample.meet(low, high, &corners);
                }
            }
        }
    }
    samples.iter().filter_map(Sample::stand).collect()
}

impl Sample {
    fn meet(&mut self, low: Vec3, high: Vec3, corners: &[Vec3; 3]) {
        if (self.point.clamp(low, high) - self.point).length_squared() > self.distance2 {
            return;
        }
        let at = closest_point(self.point, corners);
        let distance2 = (at - self.point).length_squared();
        if distance2 < self.distance2 {
            (self.distance2, self.nearest) = (distance2, Some((at, *corners)));
        }
    }

    /// None beside the receiver's rim: such a point does not stand over it.
    fn stand(&self) -> Option<Stand> {
        let (base, [a, b, c]) = self.nearest?;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let normal = if normal.dot(self.point - base) < 0.0 { -normal } else { normal };
        let gap = normal.dot(self.point - base);
        (gap >= 0.99 * self.distance2.sqrt()).then_some(Stand { sheet: self.sheet, base, normal, gap })
    }
}

#[cfg(test)]
mod tests;
