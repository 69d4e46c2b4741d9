//! Cameras and lights out.

use super::views;
use crate::{Light, LightKind, Projection, Scene};
use glam::{Mat4, Vec3};
use serde_json::{Value, json};

/// Distance of the look camera's near plane, metres.
const NEAR: f32 = 0.01;

/// The cameras, and the nodes of cameras and lights.
pub(super) fn nodes(scene: &Scene) -> (Vec<Value>, Vec<Value>) {
    let (mut cameras, mut nodes) = (Vec::new(), Vec::new());
    let mut add = |name: &str, pose: Mat4, camera: Value| {
        nodes.push(json!({ "name": name, "matrix": pose.to_cols_array(), "camera": cameras.len() }));
        cameras.push(camera);
    };
    let measure = &scene.measure;
    let up = measure.normal.cross(measure.transect);
    let half = measure.resolution.map(|n| n as f32 * measure.pixel / 2.0);
    add(
        "measure",
        pose(measure.center + measure.normal * measure.clearance, -measure.normal, up),
        // From the near plane of the measure view to as far below the receiver.
        with_extras(orthographic("measure", half, 0.0, 2.0 * measure.clearance), views::of_measure(measure)),
    );
    let look = &scene.look;
    let [w, h] = look.resolution;
    add(
        "look",
        pose(look.eye, look.target - look.eye, Vec3::Y),
        with_extras(
            perspective("look", look.fov.to_radians(), Some(w as f32 / h as f32), NEAR, None),
            views::of_look(look),
        ),
    );
    for c in &scene.cameras {
        // Those two of an exported scene have just been written.
        if views::CAMERAS.contains(&c.name.as_str()) {
            continue;
        }
        let camera = match c.projection {
            Projection::Perspective { fov_y, aspect, near, far } => perspective(&c.name, fov_y, aspect, near, far),
            Projection::Orthographic { half_size, near, far } => orthographic(&c.name, half_size, near, far),
        };
        add(&c.name, pose(c.position, c.forward, c.up), camera);
    }
    for (i, light) in scene.lights.iter().enumerate() {
        // A light's turn about its own direction means nothing.
        let pose = pose(light.position, light.direction, light.direction.any_orthogonal_vector());
        nodes.push(json!({
            "name": light.name, "matrix": pose.to_cols_array(),
            "extensions": { "KHR_lights_punctual": { "light": i } },
        }));
    }
    (cameras, nodes)
}

/// The matrix of a node that looks along `forward`, its -Z axis.
fn pose(position: Vec3, forward: Vec3, up: Vec3) -> Mat4 {
    let is_unit = (forward.length_squared() - 1.0).abs() < 1e-6;
    let back = if is_unit { -forward } else { -forward.normalize_or(Vec3::NEG_Z) };
    let right = up.cross(back).normalize_or(Vec3::X);
    Mat4::from_cols(right.extend(0.0), back.cross(right).extend(0.0), back.extend(0.0), position.extend(1.0))
}

fn with_extras(mut camera: Value, extras: Value) -> Value {
    camera["extras"] = extras;
    camera
}

fn perspective(name: &str, yfov: f32, aspect: Option<f32>, znear: f32, zfar: Option<f32>) -> Value {
    let mut perspective = json!({ "yfov": yfov, "znear": znear });
    if let Some(aspect) = aspect {
        perspective["aspectRatio"] = aspect.into();
    }
    if let Some(far) = zfar {
        perspective["zfar"] = far.into();
    }
    json!({ "name": name, "type": "perspective", "perspective": perspective })
}

fn orthographic(name: &str, [xmag, ymag]: [f32; 2], znear: f32, zfar: f32) -> Value {
    let orthographic = json!({ "xmag": xmag, "ymag": ymag, "znear": znear, "zfar": zfar });
    json!({ "name": name, "type": "orthographic", "orthographic": orthographic })
}

/// The list of KHR_lights_punctual.
pub(super) fn lights(lights: &[Light]) -> Vec<Value> {
    lights.iter().map(light).collect()
}

fn light(light: &Light) -> Value {
    let kind = match light.kind {
        LightKind::Directional => "directional",
        LightKind::Point => "point",
        LightKind::Spot { .. } => "spot",
    };
    let mut json = json!({ "name": light.name, "type": kind, "color": light.color, "intensity": light.intensity });
    if let Some(range) = light.range {
        json["range"] = range.into();
    }
    if let LightKind::Spot { inner, outer } = light.kind {
        json["spot"] = json!({ "innerConeAngle": inner, "outerConeAngle": outer });
    }
    json
}
