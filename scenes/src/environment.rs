//! The light a scene stands in.

use crate::bounded::{Positive, Triple};
use glam::Vec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Distant light, the same from every direction that is not blocked, and where
/// it may come in.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Radiance of the sky, W/(m^2 sr) up to a common factor.
    pub radiance: f32,
    /// Openings worth aiming at: a hint for sampling. They change the noise of a
    /// path tracer, never its mean.
    pub portals: Vec<Portal>,
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

/// `[environment]` of a scene file.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EnvironmentFile {
    /// Radiance of the uniform sky. At zero a scene would hold no light at all.
    radiance: Positive,
    /// Openings through which the sky is seen, for scenes that are mostly closed.
    #[serde(default)]
    portals: Vec<PortalFile>,
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
    /// The environment; the message names a portal without area.
    pub(crate) fn build(&self) -> Result<Environment, String> {
        let portals: Vec<Portal> =
            self.portals.iter().map(|p| Portal { corner: p.corner.vec(), u: p.u.vec(), v: p.v.vec() }).collect();
        if let Some(i) = portals.iter().position(|p| p.area() <= 0.0) {
            return Err(format!("environment.portals[{i}] has no area: u and v must not be parallel"));
        }
        Ok(Environment { radiance: self.radiance.0, portals })
    }
}
