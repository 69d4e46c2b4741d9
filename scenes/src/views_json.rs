//! The views of a scene as JSON, for programs that render it.

use crate::{Environment, Scene, Sky, View};
use serde_json::{Value, json};

/// The measure and look views, the distant light, R and R' as JSON.
///
/// `environment` is written as in a scene file.
///
/// `rays` gives each camera as two affine maps: the ray through the image point
/// (x, y), in pixels from the top left corner, starts at
/// `origin + x origin_dx + y origin_dy` and points along
/// `direction + x direction_dx + y direction_dy`; pixel centres are at half
/// integers.
///
/// # Example
/// ```
/// let scene = aogauge_scenes::library::scene("plane")?;
/// assert!(aogauge_scenes::views_json(&scene).contains("\"radius\": 0.25"));
/// # Ok::<(), aogauge_scenes::SceneError>(())
/// ```
pub fn views_json(scene: &Scene) -> String {
    let (m, l) = (&scene.measure, &scene.look);
    let half = m.resolution.map(|n| n as f32 * m.pixel / 2.0);
    let value = json!({
        "scene": scene.name,
        "unit": "metre",
        "ao": { "radius": scene.ao.radius, "secondary_radius": scene.ao.secondary_radius },
        "environment": environment(&scene.environment),
        "measure": {
            "camera": "measure",
            "projection": "orthographic",
            "resolution": m.resolution,
            "center": m.center.to_array(),
            "normal": m.normal.to_array(),
            "transect": m.transect.to_array(),
            "up": m.normal.cross(m.transect).to_array(),
            "clearance": m.clearance,
            "pixel": m.pixel,
            "half_size": half,
            "rays": rays(&m.view()),
        },
        "look": {
            "camera": "look",
            "projection": "perspective",
            "resolution": l.resolution,
            "eye": l.eye.to_array(),
            "target": l.target.to_array(),
            "up": [0, 1, 0],
            "fov_y": l.fov.to_radians(),
            "rays": rays(&l.view()),
        },
    });
    format!("{value:#}")
}

fn environment(environment: &Environment) -> Value {
    let portals: Vec<Value> = environment
        .portals
        .iter()
        .map(|p| json!({ "corner": p.corner.to_array(), "u": p.u.to_array(), "v": p.v.to_array() }))
        .collect();
    match environment.sky {
        Sky::None => json!({ "portals": portals }),
        Sky::Uniform(radiance) => json!({ "radiance": radiance, "portals": portals }),
        Sky::Gradient { zenith, horizon, ground } => json!({
            "gradient": { "zenith": zenith, "horizon": horizon, "ground": ground },
            "portals": portals,
        }),
    }
}

fn rays(view: &View) -> Value {
    json!({
        "origin": view.origin.to_array(),
        "origin_dx": view.origin_dx.to_array(),
        "origin_dy": view.origin_dy.to_array(),
        "direction": view.direction.to_array(),
        "direction_dx": view.direction_dx.to_array(),
        "direction_dy": view.direction_dy.to_array(),
    })
}

#[cfg(test)]
mod tests {
    use crate::{library, views_json};
    use serde_json::{Value, json};

    #[test]
    fn the_light_is_told_as_in_the_scene_file() {
        let views =
            |name: &str| -> Value { serde_json::from_str(&views_json(&library::scene(name).unwrap())).unwrap() };
        assert_eq!(
            views("curtain-arcade")["environment"],
            json!({ "radiance": 1.0, "portals": [{ "corner": [0.0, 4.5, -3.0], "u": [4.0, 0.0, 0.0], "v": [0.0, 0.0, 6.0] }] })
        );
        assert_eq!(views("curtain-open")["environment"], json!({ "radiance": 1.0, "portals": [] }));
    }
}
