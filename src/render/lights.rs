//! Light that a path tracer can aim at: openings and lamps that the scene names
//! as portals, surfaces that glow, and punctual lights.

use super::gbuffer::FAR_AWAY;
use crate::trace::{Hit, Ray, Tracer};
use aogauge_scenes::{Light, LightKind, Portal, Scene, luminance};
use glam::Vec3;
use std::f32::consts::PI;

/// Everything worth aiming at.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    portals: Vec<Portal>,
    emitters: Vec<Emitter>,
    /// Sum of luminance times area up to and with each emitter.
    powers: Vec<f64>,
    punctual: Vec<Light>,
}

/// A triangle that glows.
#[derive(Clone, Copy, Debug)]
struct Emitter {
    /// As numbered in the scene.
    triangle: u32,
    corners: [Vec3; 3],
}

/// A way from a point towards light, chosen at random.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    /// Unit direction.
    pub direction: Vec3,
    /// The triangle that must be the first along it; None takes any light there.
    pub triangle: Option<u32>,
}

/// What a punctual light sends to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// Unit direction towards the light.
    pub direction: Vec3,
    /// Distance to it, metres.
    pub distance: f32,
    /// Irradiance on a surface that faces it: red, green and blue.
    pub irradiance: Vec3,
}

impl Lights {
    /// Collects the lights of a scene, from its triangles and what each sends out.
    pub fn new(scene: &Scene, triangles: &[[Vec3; 3]], emission: &[[f32; 3]]) -> Self {
        let mut emitters = Vec::new();
        let mut powers = Vec::new();
        let mut power = 0.0;
        for (triangle, (corners, &emission)) in triangles.iter().zip(emission).enumerate() {
            let weight = f64::from(luminance(emission)) * f64::from(area(corners));
            if weight > 0.0 {
                power += weight;
                emitters.push(Emitter { triangle: triangle as u32, corners: *corners });
                powers.push(power);
            }
        }
        Lights { portals: scene.environment.portals.clone(), emitters, powers, punctual: scene.lights.clone() }
    }

    /// Punctual lights alone.
    #[cfg(test)]
    pub(super) fn of_punctual(punctual: Vec<Light>) -> Self {
        Lights { punctual, ..Lights::default() }
    }

    /// The openings that can be aimed at.
    pub(super) fn portals(&self) -> &[Portal] {
        &self.portals
    }

    /// Whether any surface glows.
    pub fn has_emitters(&self) -> bool {
        !self.emitters.is_empty()
    }

    /// A random point of a random portal, all portals alike. Twin: `path/portals.rs`.
    pub fn aim_at_portal(&self, origin: Vec3, place: impl FnOnce() -> [f32; 2]) -> Option<Aim> {
        if self.portals.is_empty() {
            return None;
        }
        let [u, v] = place();
        let (portal, u) = pick(&self.portals, u)?;
        let to = portal.corner + portal.u * u + portal.v * v - origin;
        Some(Aim { direction: to.try_normalize()?, triangle: None })
    }

    /// A random point of a glowing surface, by its power.
    pub fn aim_at_emitter(&self, origin: Vec3, place: impl FnOnce() -> [f32; 2]) -> Option<Aim> {
        let total = *self.powers.last()?;
        let [u, v] = place();
        let place = f64::from(u) * total;
        let index = self.powers.partition_point(|&p| p <= place).min(self.emitters.len() - 1);
        let before = if index == 0 { 0.0 } else { self.powers[index - 1] };
        let u = (((place - before) / (self.powers[index] - before)) as f32).clamp(0.0, 1.0);
        let emitter = &self.emitters[index];
        let [a, b, c] = emitter.corners;
        // Uniform over the triangle: the square folded along its diagonal.
        let root = u.sqrt();
        let to = a * (1.0 - root) + b * (root * (1.0 - v)) + c * (root * v) - origin;
        Some(Aim { direction: to.try_normalize()?, triangle: Some(emitter.triangle) })
    }

    /// Density per solid angle with which the two ways of aiming pick a direction
    /// that meets `hit` first: their sum, as the balance heuristic wants it
    /// (Veach 1997, section 9.2).
    pub fn density(&self, origin: Vec3, direction: Vec3, hit: Option<&Hit>, emission: Vec3) -> f32 {
        self.portal_density(origin, direction) + self.emitter_density(direction, hit, emission)
    }

    /// Density per solid angle with which [`Self::aim_at_emitter`] picks a direction
    /// that meets `hit` first.
    pub(super) fn emitter_density(&self, direction: Vec3, hit: Option<&Hit>, emission: Vec3) -> f32 {
        match (hit, self.powers.last()) {
            (Some(hit), Some(&total)) if emission != Vec3::ZERO => {
                let cosine = hit.normal.dot(direction).abs();
                let per_area = f64::from(luminance(emission.to_array())) / total;
                if cosine > 0.0 { (per_area * f64::from(hit.t * hit.t / cosine)) as f32 } else { 0.0 }
            }
            _ => 0.0,
        }
    }

    /// Density per solid angle with which [`Self::aim_at_portal`] picks a
    /// direction. Twin: `path/portals.rs`.
    fn portal_density(&self, origin: Vec3, direction: Vec3) -> f32 {
        let mut density = 0.0;
        for p in &self.portals {
            let cross = p.u.cross(p.v);
            let area = cross.length();
            let plane = cross / area;
            let slope = plane.dot(direction);
            let t = plane.dot(p.corner - origin) / slope;
            if !(t > 0.0 && t.is_finite()) {
                continue;
            }
            let at = origin + direction * t - p.corner;
            // Coordinates in the parallelogram, by Cramer's rule in its plane.
            let a = at.cross(p.v).dot(cross) / (area * area);
            let b = p.u.cross(at).dot(cross) / (area * area);
            if (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b) {
                density += t * t / (slope.abs() * area);
            }
        }
        density / self.portals.len().max(1) as f32
    }

    /// What one punctual light, picked at random, sends to a point, times their
    /// number.
    pub fn punctual(&self, point: Vec3, which: impl FnOnce() -> f32) -> Option<Arrival> {
        if self.punctual.is_empty() {
            return None;
        }
        let (light, _) = pick(&self.punctual, which())?;
        let arrival = arrival(light, point)?;
        Some(Arrival { irradiance: arrival.irradiance * self.punctual.len() as f32, ..arrival })
    }
}

/// One of a list, and the random number that is left over.
fn pick<T>(list: &[T], u: f32) -> Option<(&T, f32)> {
    let stretched = u * list.len() as f32;
    let index = (stretched as usize).min(list.len().checked_sub(1)?);
    Some((&list[index], stretched - index as f32))
}

fn area([a, b, c]: &[Vec3; 3]) -> f32 {
    0.5 * (*b - *a).cross(*c - *a).length()
}

/// What a punctual light sends to a point, without obstacles, as
/// KHR_lights_punctual has it: inverse square, windowed by the range where there
/// is one; a spot falls off between its two angles. Twin: `arrival` of
/// `gpu/shaders/lights.wgsl`.
pub fn arrival(light: &Light, point: Vec3) -> Option<Arrival> {
    let intensity = Vec3::from(light.color) * light.intensity;
    if light.kind == LightKind::Directional {
        return Some(Arrival { direction: -light.direction, distance: FAR_AWAY, irradiance: intensity });
    }
    let to = light.position - point;
    let distance = to.length();
    let direction = to.try_normalize()?;
    let window = light.range.map_or(1.0, |range| (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0));
    let cone = match light.kind {
        LightKind::Spot { inner, outer } => {
            let scale = 1.0 / (inner.cos() - outer.cos()).max(1e-3);
            ((light.direction.dot(-direction) - outer.cos()) * scale).clamp(0.0, 1.0).powi(2)
        }
        _ => 1.0,
    };
    let irradiance = intensity * (window * cone / (distance * distance));
    (irradiance != Vec3::ZERO).then_some(Arrival { direction, distance, irradiance })
}

/// Irradiance over pi that a punctual light gives a surface.
pub fn lambert(arrival: &Arrival, tracer: &Tracer, origin: Vec3, normal: Vec3) -> Vec3 {
    let cosine = normal.dot(arrival.direction);
    if cosine <= 0.0 || tracer.occluded(&Ray::new(origin, arrival.direction, arrival.distance)) {
        return Vec3::ZERO;
    }
    arrival.irradiance * (cosine / PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(kind: LightKind) -> Light {
        Light {
            name: "l".into(),
            kind,
            position: Vec3::new(0.0, 2.0, 0.0),
            direction: Vec3::NEG_Y,
            color: [1.0, 0.5, 0.0],
            intensity: 8.0,
            range: None,
        }
    }

    #[test]
    fn punctual_lights_follow_their_specification() {
        let at = |kind, point| arrival(&light(kind), point).map(|a| a.irradiance);
        assert_eq!(at(LightKind::Directional, Vec3::X), Some(Vec3::new(8.0, 4.0, 0.0)));
        assert_eq!(at(LightKind::Point, Vec3::ZERO), Some(Vec3::new(2.0, 1.0, 0.0)));
        let spot = LightKind::Spot { inner: 0.3, outer: 0.6 };
        assert_eq!(at(spot, Vec3::ZERO), Some(Vec3::new(2.0, 1.0, 0.0)));
        assert_eq!(at(spot, Vec3::new(2.0, 0.0, 0.0)), None, "45 degrees off its axis");
        let between = at(spot, Vec3::new(2.0 * 0.45f32.tan(), 0.0, 0.0)).unwrap().x;
        let share = (0.45f32.cos() - 0.6f32.cos()) / (0.3f32.cos() - 0.6f32.cos());
        let plain = 2.0 * 0.45f32.cos().powi(2);
        assert!((between - plain * share * share).abs() < 1e-4, "{between}");
        let ranged = Light { range: Some(2.0), ..light(LightKind::Point) };
        assert_eq!(arrival(&ranged, Vec3::ZERO), None, "at its range");
    }
}
