//! Cameras and punctual lights in.

use super::{
    document::{CameraDef, LightDef, label},
    graph::Placed,
};
use crate::{Camera, Light, LightKind, Projection};
use glam::{DMat3, DVec3, Vec3};
use std::f32::consts::FRAC_PI_2;

/// Where something at a node is, and its unit axes forward and up. glTF looks
/// along -Z, and takes no account of scale.
fn pose(placed: &Placed<'_>) -> Result<(Vec3, Vec3, Vec3), String> {
    let axes = DMat3::from_mat4(placed.world);
    let none = || format!("{}: its transform leaves its camera or light no direction", placed.label());
    let forward = unit(-axes.z_axis).ok_or_else(none)?;
    let up = (axes.y_axis - forward * forward.dot(axes.y_axis)).try_normalize().ok_or_else(none)?;
    let position = placed.world.w_axis.truncate();
    Ok((position.as_vec3(), forward.as_vec3(), up.as_vec3()))
}

/// The unit vector along `v`. One that is a unit vector already stays as it is,
/// so that what is read, written and read again is the same to the bit.
fn unit(v: DVec3) -> Option<DVec3> {
    if (v.length_squared() - 1.0).abs() < 1e-6 { Some(v) } else { v.try_normalize() }
}

fn above_zero(value: f32, field: &str) -> Result<f32, String> {
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("its {field} is {value}: it must be above 0"))
    }
}

/// The camera of a node; lengths come at `scale` metres per unit.
pub(super) fn camera(def: &CameraDef, index: usize, placed: &Placed<'_>, scale: f32) -> Result<Camera, String> {
    let this = label("camera", index, def.name.as_deref());
    let projection = projection(def, scale).map_err(|e| format!("{this}: {e}"))?;
    let (position, forward, up) = pose(placed)?;
    Ok(Camera { name: name_of(placed, def.name.as_ref(), "camera"), position, forward, up, projection })
}

fn projection(def: &CameraDef, scale: f32) -> Result<Projection, String> {
    let beyond = |near: f32, far: f32| {
        let fits = far > near && far.is_finite();
        if fits { Ok(far * scale) } else { Err(format!("its zfar is {far}: it must be above its znear, {near}")) }
    };
    match (&def.perspective, &def.orthographic) {
        (Some(p), None) => {
            let fov_y = above_zero(p.yfov, "yfov")?;
            if fov_y >= std::f32::consts::PI {
                return Err(format!("its yfov is {fov_y}: it must be below pi"));
            }
            Ok(Projection::Perspective {
                fov_y,
                aspect: p.aspect_ratio.map(|a| above_zero(a, "aspectRatio")).transpose()?,
                near: above_zero(p.znear, "znear")? * scale,
                far: p.zfar.map(|far| beyond(p.znear, far)).transpose()?,
            })
        }
        (None, Some(o)) => {
            if o.znear < 0.0 {
                return Err(format!("its znear is {}: it must be 0 or more", o.znear));
            }
            Ok(Projection::Orthographic {
                half_size: [above_zero(o.xmag, "xmag")? * scale, above_zero(o.ymag, "ymag")? * scale],
                near: o.znear * scale,
                far: beyond(o.znear, o.zfar)?,
            })
        }
        _ => Err("it must be either perspective or orthographic".into()),
    }
}

/// The light of a node.
pub(super) fn light(def: &LightDef, index: usize, placed: &Placed<'_>, scale: f32) -> Result<Light, String> {
    let this = label("light", index, def.name.as_deref());
    let (position, direction, _) = pose(placed)?;
    let named = |e| format!("{this}: {e}");
    let color = def.color.unwrap_or([1.0; 3]);
    let intensity = def.intensity.unwrap_or(1.0);
    if !color.iter().chain([&intensity]).all(|v| *v >= 0.0 && v.is_finite()) {
        return Err(named("its color and intensity must be 0 or more".into()));
    }
    let range = def.range.map(|r| above_zero(r, "range").map(|r| r * scale)).transpose().map_err(named)?;
    Ok(Light {
        name: name_of(placed, def.name.as_ref(), "light"),
        kind: kind(def).map_err(named)?,
        position,
        direction,
        color,
        intensity,
        range,
    })
}

fn kind(def: &LightDef) -> Result<LightKind, String> {
    match def.kind.as_str() {
        "directional" => Ok(LightKind::Directional),
        "point" => Ok(LightKind::Point),
        "spot" => {
            let inner = def.spot.and_then(|s| s.inner_cone_angle).unwrap_or(0.0);
            let outer = def.spot.and_then(|s| s.outer_cone_angle).unwrap_or(FRAC_PI_2 / 2.0);
            if !(inner >= 0.0 && inner < outer && outer <= FRAC_PI_2 * 1.000_001) {
                return Err(format!("its cone angles are {inner} and {outer}: they must rise from 0 to pi/2"));
            }
            Ok(LightKind::Spot { inner, outer })
        }
        other => Err(format!("its type is {}: directional, point and spot are known", super::document::quoted(other))),
    }
}

fn name_of(placed: &Placed<'_>, own: Option<&String>, kind: &str) -> String {
    placed
        .node
        .name
        .as_ref()
        .or(own)
        .map_or_else(|| format!("{kind}{}", placed.index), |n| n.chars().take(120).collect())
}
