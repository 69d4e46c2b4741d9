//! `[measure]` and `[look]` of a scene file: a view in numbers, or the name of a
//! camera that the model brings along.

use crate::{
    Camera, LookView, MeasureView,
    bounded::{Direction, Triple},
    view::{Extent, FieldOfView, LookFile, MeasureFile, Resolution},
};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, de::Error};

/// `[measure]` of a scene file.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum MeasureTable {
    /// By a camera.
    Camera(MeasureCamera),
    /// In numbers.
    Numbers(MeasureFile),
}

/// `[measure]` by an orthographic camera of the model. Its near plane is the
/// view's; its image's x axis is the transect.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeasureCamera {
    /// The name of the camera's node, or of the camera where that has none.
    camera: String,
    /// Distance from the near plane to the receiver, metres; half the way to the
    /// far plane unless given.
    clearance: Option<Extent>,
    /// Width and height in pixels, as wide to high as the camera sees.
    resolution: Resolution,
}

/// `[look]` of a scene file.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum LookTable {
    /// By a camera.
    Camera(LookCamera),
    /// In numbers.
    Numbers(LookFile),
}

/// `[look]` by a perspective camera of the model, held upright.
#[derive(Clone, Debug, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LookCamera {
    /// The name of the camera's node, or of the camera where that has none.
    camera: String,
    /// Width and height in pixels.
    resolution: Resolution,
}

impl From<&MeasureView> for MeasureTable {
    fn from(view: &MeasureView) -> Self {
        MeasureTable::Numbers(view.into())
    }
}

impl From<&LookView> for LookTable {
    fn from(view: &LookView) -> Self {
        LookTable::Numbers(view.into())
    }
}

impl MeasureTable {
    pub(crate) fn build(&self, cameras: &[Camera], radius: f32) -> Result<MeasureView, String> {
        match self {
            MeasureTable::Numbers(numbers) => numbers.build(radius),
            MeasureTable::Camera(c) => {
                let view = named(cameras, &c.camera)
                    .and_then(|found| found.measure_view(c.resolution.map(|n| n.0), c.clearance.map(|v| v.0)))
                    .map_err(|e| format!("measure.camera is '{}', but {e}", c.camera))?;
                view.fine_enough(radius)?;
                Ok(view)
            }
        }
    }
}

impl LookTable {
    pub(crate) fn build(&self, cameras: &[Camera]) -> Result<LookView, String> {
        match self {
            LookTable::Numbers(numbers) => numbers.build(),
            LookTable::Camera(c) => named(cameras, &c.camera)
                .and_then(|found| found.look_view(c.resolution.map(|n| n.0)))
                .map_err(|e| format!("look.camera is '{}', but {e}", c.camera)),
        }
    }
}

fn named<'a>(cameras: &'a [Camera], name: &str) -> Result<&'a Camera, String> {
    let found: Vec<&Camera> = cameras.iter().filter(|c| c.name == name).collect();
    match (found.as_slice(), cameras) {
        ([one], _) => Ok(one),
        ([], []) => Err("there is no model with cameras".into()),
        ([], _) => {
            let names: Vec<&str> = cameras.iter().take(12).map(|c| c.name.as_str()).collect();
            Err(format!("no camera of the model has this name; there are: {}", names.join(", ")))
        }
        (many, _) => Err(format!("{} cameras of the model have this name: give each a name of its own", many.len())),
    }
}

/// All that `[measure]` may hold. Sorted out after reading, as errors then say
/// what is missing and not only that neither form fits.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AnyMeasure {
    camera: Option<String>,
    center: Option<Triple>,
    normal: Option<Direction>,
    transect: Option<Direction>,
    clearance: Option<Extent>,
    pixel: Option<Extent>,
    resolution: Resolution,
}

impl<'de> Deserialize<'de> for MeasureTable {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let AnyMeasure { camera, center, normal, transect, clearance, pixel, resolution } = AnyMeasure::deserialize(d)?;
        let Some(camera) = camera else {
            return Ok(MeasureTable::Numbers(MeasureFile {
                center: required(center, "center")?,
                normal: required(normal, "normal")?,
                transect: required(transect, "transect")?,
                clearance: required(clearance, "clearance")?,
                pixel,
                resolution,
            }));
        };
        if center.is_some() || normal.or(transect).is_some() || pixel.is_some() {
            return Err(D::Error::custom("give a camera, or center, normal, transect and pixel, not both"));
        }
        Ok(MeasureTable::Camera(MeasureCamera { camera, clearance, resolution }))
    }
}

/// All that `[look]` may hold.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AnyLook {
    camera: Option<String>,
    eye: Option<Triple>,
    target: Option<Triple>,
    fov: Option<FieldOfView>,
    resolution: Resolution,
}

impl<'de> Deserialize<'de> for LookTable {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let AnyLook { camera, eye, target, fov, resolution } = AnyLook::deserialize(d)?;
        let Some(camera) = camera else {
            return Ok(LookTable::Numbers(LookFile {
                eye: required(eye, "eye")?,
                target: required(target, "target")?,
                fov,
                resolution,
            }));
        };
        if eye.or(target).is_some() || fov.is_some() {
            return Err(D::Error::custom("give a camera, or eye, target and fov, not both"));
        }
        Ok(LookTable::Camera(LookCamera { camera, resolution }))
    }
}

fn required<T, E: Error>(value: Option<T>, field: &'static str) -> Result<T, E> {
    value.ok_or_else(|| E::missing_field(field))
}
