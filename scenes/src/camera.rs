//! Cameras that a glTF file brings along.

use crate::{LookView, MeasureView};
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

impl Camera {
    /// What an orthographic camera sees, as a measure view: its near plane is the
    /// view's, and the receiver lies `clearance` metres behind that, or halfway to
    /// the far plane.
    pub(crate) fn measure_view(&self, resolution: [u32; 2], clearance: Option<f32>) -> Result<MeasureView, String> {
        let Projection::Orthographic { half_size, near, far } = self.projection else {
            return Err("that camera is perspective: a measure view must be orthographic".into());
        };
        let [pixel, high] = [0, 1].map(|k| 2.0 * half_size[k] / resolution[k] as f32);
        if (pixel - high).abs() > 1e-3 * pixel {
            let [w, h] = resolution;
            return Err(format!("its pixels are {pixel} m wide and {high} m high at {w} x {h}: they must be square"));
        }
        let clearance = clearance.unwrap_or((far - near) / 2.0);
        Ok(MeasureView {
            center: self.position + self.forward * (near + clearance),
            normal: -self.forward,
            transect: self.forward.cross(self.up),
            clearance,
            pixel,
            resolution,
        })
    }

    /// What a perspective camera sees, as a look view.
    pub(crate) fn look_view(&self, resolution: [u32; 2]) -> Result<LookView, String> {
        let Projection::Perspective { fov_y, .. } = self.projection else {
            return Err("that camera is orthographic: a look view must be perspective".into());
        };
        if self.forward.cross(Vec3::Y).length() < 1e-3 {
            return Err("that camera looks straight up or down".into());
        }
        if self.forward.cross(self.up).y.abs() > 0.01 || self.up.y < 0.0 {
            return Err("that camera is tilted sideways: a look view is upright".into());
        }
        let fov = fov_y.to_degrees();
        if fov >= 170.0 {
            return Err(format!("its field of view is {fov} degrees: it must be below 170"));
        }
        Ok(LookView { eye: self.position, target: self.position + self.forward, fov, resolution })
    }
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
