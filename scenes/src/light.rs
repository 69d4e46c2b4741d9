//! Punctual lights that a glTF file brings along.

use glam::Vec3;

/// A light without extent, as in KHR_lights_punctual, in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// The name of its node, or of the light.
    pub name: String,
    /// Which way it shines.
    pub kind: LightKind,
    /// Where it stands, metres; means nothing for a directional light.
    pub position: Vec3,
    /// Unit vector that its light travels along; means nothing for a point light.
    pub direction: Vec3,
    /// Linear colour.
    pub color: [f32; 3],
    /// Candela (lumen a steradian) for point and spot lights, lux for directional ones.
    pub intensity: f32,
    /// Distance beyond which it may be left out, metres.
    pub range: Option<f32>,
}

/// Which way a [`Light`] shines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// From infinitely far away.
    Directional,
    /// Everywhere.
    Point,
    /// Into a cone.
    Spot {
        /// Angle from the axis where the light begins to fall off, radians.
        inner: f32,
        /// Angle from the axis where it ends, radians.
        outer: f32,
    },
}
