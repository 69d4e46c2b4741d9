//! The views of a scene in its cameras.
//!
//! A glTF camera has no resolution, and a node's matrix does not give a view back
//! to the last bit. So the cameras `measure` and `look` carry the tables
//! `[measure]` and `[look]` of a scene file in `extras.aogauge`. A camera that
//! has been moved or changed since then counts itself; only its resolution is
//! taken from there.

use super::{
    Imported,
    document::{CameraDef, label},
};
use crate::{
    Camera, LookView, MeasureView, View,
    view::{LookFile, MeasureFile},
};
use serde::Deserialize;
use serde_json::{Value, json};

/// Names of the cameras that a scene's own views are written as.
pub(crate) const CAMERAS: [&str; 2] = ["measure", "look"];

/// The extras of the camera `measure`.
pub(super) fn of_measure(view: &MeasureView) -> Value {
    json!({ "aogauge": { "measure": MeasureFile::from(view) } })
}

/// The extras of the camera `look`.
pub(super) fn of_look(view: &LookView) -> Value {
    json!({ "aogauge": { "look": LookFile::from(view) } })
}

/// Takes the views out of a camera's extras, where it has any.
pub(super) fn read(def: &CameraDef, index: usize, camera: &Camera, out: &mut Imported) -> Result<(), String> {
    let of = |key: &str| def.extras.as_ref().and_then(|e| e.pointer(&format!("/aogauge/{key}")));
    let twice = |key: &str| format!("two cameras hold the {key} view in their extras");
    let wrong = |key: &str, e: String| {
        let this = label("camera", index, def.name.as_deref());
        format!("{this} holds the {key} view in its extras, but {}", e.replace('\n', " "))
    };
    if let Some(table) = of("measure") {
        let view = measure(table, camera).map_err(|e| wrong("measure", e))?;
        if out.measure.replace(view).is_some() {
            return Err(twice("measure"));
        }
    }
    if let Some(table) = of("look") {
        let view = look(table, camera).map_err(|e| wrong("look", e))?;
        if out.look.replace(view).is_some() {
            return Err(twice("look"));
        }
    }
    Ok(())
}

fn measure(table: &Value, camera: &Camera) -> Result<MeasureView, String> {
    let exact = parsed::<MeasureFile>(table)?.exact()?;
    let now = camera.measure_view(exact.resolution, None)?;
    let same = alike(&exact.view(), &now.view()) && (exact.clearance - now.clearance).abs() <= 1e-3 * exact.clearance;
    Ok(if same { exact } else { now })
}

fn look(table: &Value, camera: &Camera) -> Result<LookView, String> {
    let exact = parsed::<LookFile>(table)?.build()?;
    let now = camera.look_view(exact.resolution)?;
    Ok(if alike(&exact.view(), &now.view()) { exact } else { now })
}

/// A table; the message names the field.
fn parsed<'de, T: Deserialize<'de>>(table: &'de Value) -> Result<T, String> {
    serde_path_to_error::deserialize(table).map_err(|e| match e.path().iter().next() {
        Some(_) => format!("{}: {}", e.path(), e.inner()),
        None => e.into_inner().to_string(),
    })
}

/// Whether two views show the same but for rounding.
fn alike(a: &View, b: &View) -> bool {
    let [w, h] = a.resolution;
    [(0, 0), (w - 1, h - 1)].into_iter().all(|(x, y)| {
        let ((from_a, to_a), (from_b, to_b)) = (a.ray(x, y), b.ray(x, y));
        from_a.distance(from_b) <= 1e-5 * (1.0 + from_a.length()) && to_a.distance(to_b) <= 1e-4
    })
}
