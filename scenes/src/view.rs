//! Where a scene is measured from, and where its pictures are taken.

use crate::bounded::{Angle, Count, Direction, Fine, Triple};
use glam::{Mat3, Vec3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A camera as two affine maps: the ray of the image point (x, y), in pixels
/// from the top left corner, starts at `origin + x origin_dx + y origin_dy` and
/// points along `direction + x direction_dx + y direction_dy` (not normalised).
///
/// One form serves orthographic and perspective views, on the CPU and the GPU.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Ray origin at the top left corner.
    pub origin: Vec3,
    /// Its change from one column to the next.
    pub origin_dx: Vec3,
    /// Its change from one row to the next.
    pub origin_dy: Vec3,
    /// Ray direction at the top left corner.
    pub direction: Vec3,
    /// Its change from one column to the next.
    pub direction_dx: Vec3,
    /// Its change from one row to the next.
    pub direction_dy: Vec3,
}

impl View {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.resolution[0] as usize * self.resolution[1] as usize
    }

    /// Origin and unit direction of the ray through the centre of a pixel.
    pub fn ray(&self, x: u32, y: u32) -> (Vec3, Vec3) {
        let (x, y) = (x as f32 + 0.5, y as f32 + 0.5);
        (
            self.origin + self.origin_dx * x + self.origin_dy * y,
            (self.direction + self.direction_dx * x + self.direction_dy * y).normalize(),
        )
    }

    /// A perspective camera. `target` is the point at the centre of the image,
    /// `up` points up in it and must not point along the line of sight, `fov` is
    /// the vertical field of view, radians.
    pub fn perspective(eye: Vec3, target: Vec3, up: Vec3, fov: f32, resolution: [u32; 2]) -> View {
        let forward = (target - eye).normalize();
        let right = forward.cross(up).normalize();
        let up = right.cross(forward);
        let [w, h] = resolution;
        let pixel = 2.0 * (fov / 2.0).tan() / h as f32;
        let (dx, dy) = (right * pixel, -up * pixel);
        View {
            resolution,
            origin: eye,
            origin_dx: Vec3::ZERO,
            origin_dy: Vec3::ZERO,
            direction: forward - dx * (w as f32 / 2.0) - dy * (h as f32 / 2.0),
            direction_dx: dx,
            direction_dy: dy,
        }
    }

    /// The same view with `times` the pixels, each way.
    #[must_use]
    pub fn finer(&self, times: u32) -> View {
        let part = 1.0 / times as f32;
        View {
            resolution: self.resolution.map(|n| n * times),
            origin_dx: self.origin_dx * part,
            origin_dy: self.origin_dy * part,
            direction_dx: self.direction_dx * part,
            direction_dy: self.direction_dy * part,
            ..*self
        }
    }

    /// The same view with its rays through other points of the pixels: moved by
    /// this part of a pixel from the centre, along columns and rows.
    #[must_use]
    pub fn moved(&self, [x, y]: [f32; 2]) -> View {
        View {
            origin: self.origin + self.origin_dx * x + self.origin_dy * y,
            direction: self.direction + self.direction_dx * x + self.direction_dy * y,
            ..*self
        }
    }

    /// The way back from points to the image; None for a view that is neither
    /// orthographic nor perspective, or has no extent.
    pub fn world_to_image(&self) -> Option<WorldToImage> {
        let perspective = [self.origin_dx, self.origin_dy] == [Vec3::ZERO; 2];
        let orthographic = [self.direction_dx, self.direction_dy] == [Vec3::ZERO; 2];
        let [dx, dy] = match (perspective, orthographic) {
            (true, false) => [self.direction_dx, self.direction_dy],
            (false, true) => [self.origin_dx, self.origin_dy],
            _ => return None,
        };
        let to_image = Mat3::from_cols(dx, dy, self.direction).inverse();
        to_image.is_finite().then_some(WorldToImage { origin: self.origin, to_image, perspective })
    }
}

/// Where points appear in the image of a [`View`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldToImage {
    /// The view's ray origin at the top left corner.
    pub origin: Vec3,
    /// Takes a point, from [`Self::origin`], to (x, y, depth), or to (x depth,
    /// y depth, depth) where the view is perspective.
    pub to_image: Mat3,
    /// Whether all rays start in one point.
    pub perspective: bool,
}

impl WorldToImage {
    /// Column and row of a point, in pixels from the top left corner, and its
    /// depth in multiples of the view's ray direction before that is normalised.
    /// None for a point behind the camera.
    ///
    /// ```
    /// # use aogauge_scenes::library;
    /// let view = library::scene("curtain-open").unwrap().look.view();
    /// let (eye, towards) = view.ray(3, 5);
    /// let seen = view.world_to_image().unwrap().at(eye + towards * 2.0).unwrap();
    /// assert!((seen.x - 3.5).abs() < 1e-3 && (seen.y - 5.5).abs() < 1e-3);
    /// ```
    pub fn at(&self, point: Vec3) -> Option<Vec3> {
        let seen = self.to_image * (point - self.origin);
        if seen.z <= 0.0 {
            return None;
        }
        Some(if self.perspective { Vec3::new(seen.x / seen.z, seen.y / seen.z, seen.z) } else { seen })
    }
}

/// The view that metrics and goldens are taken from: orthographic, between the
/// receiver and the occluder, looking along the receiver's inward normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasureView {
    /// The point of the receiver at the centre of the image.
    pub center: Vec3,
    /// Unit normal of the receiver.
    pub normal: Vec3,
    /// Unit direction of the transect; the image's x axis. Its negative side is
    /// the left flank.
    pub transect: Vec3,
    /// Height of the near plane over the receiver, metres: under the occluder.
    pub clearance: f32,
    /// Edge of a square pixel, metres.
    pub pixel: f32,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
}

impl MeasureView {
    /// As a camera.
    pub fn view(&self) -> View {
        let up = self.normal.cross(self.transect);
        let [w, h] = self.resolution;
        let (dx, dy) = (self.transect * self.pixel, -up * self.pixel);
        View {
            resolution: self.resolution,
            origin: self.center + self.normal * self.clearance - dx * (w as f32 / 2.0) - dy * (h as f32 / 2.0),
            origin_dx: dx,
            origin_dy: dy,
            direction: -self.normal,
            direction_dx: Vec3::ZERO,
            direction_dy: Vec3::ZERO,
        }
    }

    /// Checks that details of the size of R can be seen.
    pub(crate) fn fine_enough(&self, radius: f32) -> Result<(), String> {
        let (pixel, largest) = (self.pixel, radius / 50.0);
        if pixel > largest * 1.0001 {
            return Err(format!("measure.pixel is {pixel} m: it must be no larger than ao.radius / 50 = {largest} m"));
        }
        Ok(())
    }

    /// Coordinate of column `x`'s pixel centres along the transect, metres from
    /// the centre of the image.
    pub fn transect_at(&self, x: u32) -> f32 {
        (x as f32 + 0.5 - self.resolution[0] as f32 / 2.0) * self.pixel
    }
}

/// The view that pictures are taken from: a perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LookView {
    /// Position of the camera.
    pub eye: Vec3,
    /// The point at the centre of the image.
    pub target: Vec3,
    /// Vertical field of view, degrees.
    pub fov: f32,
    /// Width and height in pixels.
    pub resolution: [u32; 2],
}

impl LookView {
    /// As a camera, +Y up.
    pub fn view(&self) -> View {
        View::perspective(self.eye, self.target, Vec3::Y, self.fov.to_radians(), self.resolution)
    }
}

/// Width and height in pixels.
pub(crate) type Resolution = [Count<16, 4096>; 2];

/// A length of a view: from a micrometre to a kilometre.
pub(crate) type Extent = Fine<1, 1_000_000_000>;

/// Vertical field of view, degrees.
pub(crate) type FieldOfView = Angle<1, 169>;

/// `[measure]` of a scene file.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeasureFile {
    /// The point of the receiver at the centre of the image, metres.
    pub center: Triple,
    /// Normal of the receiver, towards the occluder.
    pub normal: Direction,
    /// Direction across the occluder, along the receiver.
    pub transect: Direction,
    /// Height of the near plane over the receiver, metres: under the occluder.
    pub clearance: Extent,
    /// Edge of a pixel, metres; R/50 unless given, and no larger.
    pub pixel: Option<Extent>,
    /// Width and height in pixels.
    pub resolution: Resolution,
}

impl MeasureFile {
    pub(crate) fn build(&self, radius: f32) -> Result<MeasureView, String> {
        let view = self.with_pixel(self.pixel.map_or(radius / 50.0, |p| p.0))?;
        view.fine_enough(radius)?;
        Ok(view)
    }

    /// Where no R is known, which the pixel could follow from.
    pub(crate) fn exact(&self) -> Result<MeasureView, String> {
        self.with_pixel(self.pixel.ok_or("pixel is missing")?.0)
    }

    fn with_pixel(&self, pixel: f32) -> Result<MeasureView, String> {
        let normal = unit(self.normal.vec(), "measure.normal")?;
        let transect = unit(self.transect.vec(), "measure.transect")?;
        if normal.dot(transect).abs() > 1e-4 {
            return Err("measure.transect must be perpendicular to measure.normal".into());
        }
        Ok(MeasureView {
            center: self.center.vec(),
            normal,
            transect,
            clearance: self.clearance.0,
            pixel,
            resolution: self.resolution.map(|n| n.0),
        })
    }
}

impl From<&MeasureView> for MeasureFile {
    fn from(view: &MeasureView) -> Self {
        MeasureFile {
            center: view.center.into(),
            normal: view.normal.into(),
            transect: view.transect.into(),
            clearance: Fine(view.clearance),
            pixel: Some(Fine(view.pixel)),
            resolution: view.resolution.map(Count),
        }
    }
}

/// `[look]` of a scene file.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LookFile {
    /// Position of the camera, metres.
    pub eye: Triple,
    /// The point at the centre of the image, metres.
    pub target: Triple,
    /// Vertical field of view, degrees; 45 unless given.
    pub fov: Option<FieldOfView>,
    /// Width and height in pixels.
    pub resolution: Resolution,
}

impl LookFile {
    pub(crate) fn build(&self) -> Result<LookView, String> {
        let (eye, target) = (self.eye.vec(), self.target.vec());
        let forward = unit(target - eye, "look.target - look.eye")?;
        if forward.cross(Vec3::Y).length() < 1e-3 {
            return Err("look: the camera must not look straight up or down".into());
        }
        let fov = self.fov.map_or(45.0, |f| f.0);
        Ok(LookView { eye, target, fov, resolution: self.resolution.map(|n| n.0) })
    }
}

impl From<&LookView> for LookFile {
    fn from(view: &LookView) -> Self {
        LookFile {
            eye: view.eye.into(),
            target: view.target.into(),
            fov: Some(Angle(view.fov)),
            resolution: view.resolution.map(Count),
        }
    }
}

fn unit(v: Vec3, field: &str) -> Result<Vec3, String> {
    // A view that is written and read again stays the same to the bit.
    if (v.length_squared() - 1.0).abs() < 1e-6 {
        return Ok(v);
    }
    v.try_normalize().ok_or_else(|| format!("{field} is the zero vector: it must have a direction"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_appear_where_their_rays_start() {
        let measure = MeasureView {
            center: Vec3::new(1.0, 0.0, 2.0),
            normal: Vec3::Y,
            transect: Vec3::X,
            clearance: 0.05,
            pixel: 0.01,
            resolution: [32, 16],
        };
        let look = LookView {
            eye: Vec3::new(2.0, 3.0, 4.0),
            target: Vec3::new(0.3, 0.2, 0.1),
            fov: 50.0,
            resolution: [64, 48],
        };
        for view in [measure.view(), look.view()] {
            let to_image = view.world_to_image().unwrap();
            for (x, y) in [(0, 0), (31, 7), (5, 15)] {
                let (origin, direction) = view.ray(x, y);
                let seen = to_image.at(origin + direction * 1.5).unwrap();
                assert!((seen.x - x as f32 - 0.5).abs() < 1e-3 && (seen.y - y as f32 - 0.5).abs() < 1e-3, "{seen}");
                assert!(to_image.at(origin - direction).is_none());
            }
        }
        let neither = View { origin_dx: Vec3::X, ..look.view() };
        assert_eq!(neither.world_to_image(), None);
    }

    #[test]
    fn the_measure_view_looks_down_at_its_centre() {
        let measure = MeasureView {
            center: Vec3::new(1.0, 0.0, 2.0),
            normal: Vec3::Y,
            transect: Vec3::X,
            clearance: 0.05,
            pixel: 0.01,
            resolution: [32, 16],
        };
        let view = measure.view();
        let (a, d) = view.ray(0, 0);
        let (b, _) = view.ray(31, 15);
        assert!(((a + b) / 2.0 - Vec3::new(1.0, 0.05, 2.0)).length() < 1e-6);
        assert_eq!(d, Vec3::NEG_Y);
        assert!((a.x - 1.0 - measure.transect_at(0)).abs() < 1e-6);
        assert!(measure.transect_at(0) < 0.0);
    }

    #[test]
    fn the_look_view_meets_its_target_at_the_image_centre() {
        let look = LookView {
            eye: Vec3::new(0.0, 1.0, 3.0),
            target: Vec3::new(0.5, 0.2, -1.0),
            fov: 40.0,
            resolution: [64, 48],
        };
        let view = look.view();
        let (_, a) = view.ray(31, 23);
        let (_, b) = view.ray(32, 24);
        let forward = (look.target - look.eye).normalize();
        assert!(((a + b).normalize() - forward).length() < 1e-6);
        let (_, top) = view.ray(32, 0);
        assert!(top.y > b.y, "the first row is the top one");
    }
}
