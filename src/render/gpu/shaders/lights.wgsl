// Punctual lights. Twin: `arrival` of render/lights.rs.

struct Light {
    position: vec3<f32>,
    // DIRECTIONAL, POINT or SPOT.
    kind: u32,
    // That its light travels along.
    direction: vec3<f32>,
    // 0 for none.
    range: f32,
    // Colour times intensity.
    intensity: vec3<f32>,
    // Cosine of a spot's outer angle.
    cos_outer: f32,
    // Of a spot: 1 / (cosine of its inner angle - cosine of its outer angle).
    scale: f32,
}

const DIRECTIONAL = 0u;
const SPOT = 2u;

// One at least.
@group(0) @binding(14) var<storage, read> lights: array<Light>;

struct Arrival {
    direction: vec3<f32>,
    distance: f32,
    // 0 where nothing arrives.
    irradiance: vec3<f32>,
}

fn arrival(light: Light, point: vec3<f32>) -> Arrival {
    if light.kind == DIRECTIONAL {
        return Arrival(-light.direction, FAR_AWAY, light.intensity);
    }
    let to = light.position - point;
    let distance = length(to);
    if distance == 0.0 {
        return Arrival(vec3<f32>(), 0.0, vec3<f32>());
    }
    let direction = to / distance;
    var window = 1.0;
    if light.range > 0.0 {
        let share = distance / light.range;
        window = clamp(1.0 - (share * share) * (share * share), 0.0, 1.0);
    }
    var cone = 1.0;
    if light.kind == SPOT {
        let part = clamp((dot(light.direction, -direction) - light.cos_outer) * light.scale, 0.0, 1.0);
        cone = part * part;
    }
    return Arrival(direction, distance, light.intensity * (window * cone / (distance * distance)));
}
