//! Cameras that a glTF file brings along.

use glam::Vec3;

/// A camera as glTF knows it, in world space.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The name of its node, or of the camera.
    pub name: String,
    /// Where it stands, metres.
    pub position: Vec3,
    /// Unit vector it looks along.
    pub forward: Vec3,
    /// Unit vector that is up in the image, perpendicular to `forward`.
    pub up: Vec3,
    /// How it maps space to the image.
    pub projection: Projection,
}

/// How a [`Camera`] maps space to the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Lines of sight meet in the camera.
    Perspective {
        /// Vertical field of view, radians.
        fov_y: f32,
        /// Width over height; the image's own where there is none.
        aspect: Option<f32>,
        /// Distance of the near plane, metres.
        near: f32,
        /// Distance of the far plane, metres; infinite where there is none.
        far: Option<f32>,
    },
    /// Lines of sight are parallel.
    Orthographic {
        /// Half the width and half the height of what is seen, metres.
        half_size: [f32; 2],
        /// Distance of the near plane, metres.
        near: f32,
        /// Distance of the far plane, metres.
        far: f32,
    },
}
