//! The light a scene stands in.

use crate::bounded::{Radiance, Triple};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Distant light that is not blocked, and where light may come in.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// The distant light.
    pub sky: Sky,
    /// Openings and lamps worth aiming at: a hint for sampling. They change the
    /// noise of a path tracer, never its mean.
    pub portals: Vec<Portal>,
}

/// Light from infinitely far away, W/(m^2 sr) up to a common factor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Sky {
    /// None: what light there is, objects send out.
    #[default]
    None,
    /// The same radiance from every direction.
    Uniform(f32),
    /// Radiance by elevation.
    Gradient {
        /// From straight above.
        zenith: f32,
        /// From just above the horizon; between, it is linear in the sine of the
        /// elevation.
        horizon: f32,
        /// From everywhere below the horizon.
        ground: f32,
    },
}

impl Sky {
    /// Radiance that arrives along `-direction`, a unit vector towards the sky.
    pub fn radiance(self, direction: Vec3) -> f32 {
        match self {
            Sky::None => 0.0,
            Sky::Uniform(radiance) => radiance,
            Sky::Gradient { ground, .. } if direction.y < 0.0 => ground,
            Sky::Gradient { zenith, horizon, .. } => horizon + (zenith - horizon) * direction.y.min(1.0),
        }
    }

    /// Whether no light comes from any direction.
    pub fn is_dark(self) -> bool {
        match self {
            Sky::None => true,
            Sky::Uniform(radiance) => radiance <= 0.0,
            Sky::Gradient { zenith, horizon, ground } => zenith.max(horizon).max(ground) <= 0.0,
        }
    }
}

/// A parallelogram through which light enters a dark place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Portal {
    /// One corner.
    pub corner: Vec3,
    /// Edge from the corner to its first neighbour.
    pub u: Vec3,
    /// Edge from the corner to its second neighbour.
    pub v: Vec3,
}

impl Portal {
    /// Area, m^2.
    pub fn area(&self) -> f32 {
        self.u.cross(self.v).length()
    }
}

/// `[environment]` of a scene file. `radiance` or `gradient`, or neither where
/// objects with `emission` light the scene.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EnvironmentFile {
    /// Radiance of a uniform sky.
    radiance: Option<Radiance<1, 1_000_000_000>>,
    /// A sky whose radiance changes with elevation.
    gradient: Option<GradientFile>,
    /// Openings and lamps worth aiming at, for scenes that are mostly closed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    portals: Vec<PortalFile>,
}

#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GradientFile {
    /// Radiance from straight above.
    zenith: Radiance<0, 1_000_000_000>,
    /// Radiance from just above the horizon.
    horizon: Radiance<0, 1_000_000_000>,
    /// Radiance from below the horizon.
    ground: Radiance<0, 1_000_000_000>,
}

#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct PortalFile {
    /// One corner, metres.
    corner: Triple,
    /// Edge vector to its first neighbour, metres.
    u: Triple,
    /// Edge vector to its second neighbour, metres.
    v: Triple,
}

impl EnvironmentFile {
    /// As a scene file says it.
    pub(crate) fn of(environment: &Environment) -> Self {
        let (radiance, gradient) = match environment.sky {
            Sky::None => (None, None),
            Sky::Uniform(radiance) => (Some(Radiance(radiance)), None),
            Sky::Gradient { zenith, horizon, ground } => {
                let [zenith, horizon, ground] = [zenith, horizon, ground].map(Radiance);
                (None, Some(GradientFile { zenith, horizon, ground }))
            }
        };
        let portal = |p: &Portal| {
            let [corner, u, v] = [p.corner, p.u, p.v].map(Triple::from);
            PortalFile { corner, u, v }
        };
        EnvironmentFile { radiance, gradient, portals: environment.portals.iter().map(portal).collect() }
    }

    /// The environment of a scene that has lamps or has none; the message says
    /// how to give light, or names a portal without area.
    pub(crate) fn build(&self, lamps: bool) -> Result<Environment, String> {
        let sky = match (self.radiance, self.gradient) {
            (Some(_), Some(_)) => return Err("environment: give radiance or gradient, not both".into()),
            (Some(r), None) => Sky::Uniform(r.0),
            (None, Some(g)) => Sky::Gradient { zenith: g.zenith.0, horizon: g.horizon.0, ground: g.ground.0 },
            (None, None) => Sky::None,
        };
        if sky.is_dark() && !lamps {
            return Err(
                "the scene has no light: give environment.radiance, environment.gradient with a value above 0, \
                 emission to an object that is not an occluder, or a model with lights"
                    .into(),
            );
        }
        let portals: Vec<Portal> =
            self.portals.iter().map(|p| Portal { corner: p.corner.vec(), u: p.u.vec(), v: p.v.vec() }).collect();
        if let Some(i) = portals.iter().position(|p| p.area() <= 0.0) {
            return Err(format!("environment.portals[{i}] has no area: u and v must not be parallel"));
        }
        Ok(Environment { sky, portals })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gradient_is_linear_in_the_sine_of_the_elevation() {
        let sky = Sky::Gradient { zenith: 1.0, horizon: 0.4, ground: 0.1 };
        let at = |degrees: f32| {
            let (s, c) = degrees.to_radians().sin_cos();
            sky.radiance(Vec3::new(c, s, 0.0))
        };
        for (degrees, expected) in [(90.0, 1.0), (30.0, 0.7), (0.0, 0.4), (-1.0, 0.1), (-90.0, 0.1)] {
            assert!((at(degrees) - expected).abs() < 1e-6, "{degrees}: {}", at(degrees));
        }
    }

    fn build(text: &str, lamps: bool) -> Result<Environment, String> {
        toml::from_str::<EnvironmentFile>(text).unwrap().build(lamps)
    }

    #[test]
    fn a_scene_is_lit_in_exactly_one_way_or_by_its_lamps() {
        let gradient = "gradient = { zenith = 1.0, horizon = 0.4, ground = 0.1 }";
        assert_eq!(build("radiance = 2.0", false).unwrap().sky, Sky::Uniform(2.0));
        assert!(matches!(build(gradient, false).unwrap().sky, Sky::Gradient { .. }));
        assert_eq!(build("", true).unwrap().sky, Sky::None);
        assert!(build(&format!("radiance = 1.0\n{gradient}"), true).unwrap_err().contains("not both"));
        for dark in ["", "gradient = { zenith = 0, horizon = 0, ground = 0 }"] {
            let message = build(dark, false).unwrap_err();
            assert!(message.contains("environment.radiance") && message.contains("emission"), "{message}");
        }
    }
}
