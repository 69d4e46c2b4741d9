// What a view sees, and openness ray by ray. Twins: render/gbuffer.rs and
// render/ao.rs.

struct Params {
    origin: vec3<f32>,
    width: u32,
    origin_dx: vec3<f32>,
    first_pixel: u32,
    origin_dy: vec3<f32>,
    // Pixels of this dispatch.
    pixels: u32,
    direction: vec3<f32>,
    first_ray: u32,
    direction_dx: vec3<f32>,
    // Rays of this dispatch.
    rays: u32,
    direction_dy: vec3<f32>,
    seed: u32,
    replicate: u32,
    // 0 classic, 1 extended where the plane counts, 2 extended and clipped.
    estimator: u32,
    radius: f32,
    secondary_radius: f32,
    offset: f32,
}

struct Surface {
    point: vec3<f32>,
    triangle: u32,
    normal: vec3<f32>,
    unused: u32,
}

struct Decisions {
    primary: u32,
    first: u32,
    second: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(3) var<storage, read_write> surfaces: array<Surface>;
@group(0) @binding(4) var<storage, read_write> halves: array<u32>;
@group(0) @binding(5) var<storage, read_write> decisions: array<Decisions>;

const STOPPED = 0xffffffffu;

@compute @workgroup_size(64)
fn see(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let x = f32(pixel % params.width) + 0.5;
    let y = f32(pixel / params.width) + 0.5;
    let origin = params.origin + params.origin_dx * x + params.origin_dy * y;
    let direction = normalize(params.direction + params.direction_dx * x + params.direction_dy * y);
    let hit = walk(new_ray(origin, direction, FAR_AWAY), false);
    var surface = Surface(vec3<f32>(), MISS, vec3<f32>(), 0u);
    if hit.triangle != MISS {
        let a = corner(hit.triangle, 0u);
        let b = corner(hit.triangle, 1u);
        let c = corner(hit.triangle, 2u);
        let normal = normalize(cross(b - a, c - a));
        surface.point = a * hit.weights.x + b * hit.weights.y + c * hit.weights.z;
        surface.normal = select(normal, -normal, dot(normal, direction) > 0.0);
        surface.triangle = hit.triangle;
    }
    surfaces[pixel] = surface;
    halves[pixel] = 0u;
    decisions[pixel] = Decisions(0u, 0u, 0u);
}

fn tangents(n: vec3<f32>) -> array<vec3<f32>, 2> {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return array<vec3<f32>, 2>(
        vec3<f32>(1.0 + s * n.x * n.x * a, s * b, -s * n.x),
        vec3<f32>(b, s + n.y * n.y * a, -n.y),
    );
}

// Bits: 1 primary closed, 2 first secondary closed, 4 second secondary closed.
fn decide(origin: vec3<f32>, normal: vec3<f32>, t: vec3<f32>, b: vec3<f32>, point: vec2<f32>) -> u32 {
    let phi = turn(point.y);
    let sin_theta = sqrt(point.x);
    let cos_theta = sqrt(1.0 - point.x);
    let along = t * phi.x + b * phi.y;
    let w = along * sin_theta + normal * cos_theta;
    if occluded(new_ray(origin, w, params.radius)) {
        return 1u;
    }
    if params.estimator == 0u {
        return 0u;
    }
    let d1 = t * phi.y - b * phi.x;
    let d2 = along * cos_theta - normal * sin_theta;
    let reach = params.secondary_radius;
    let middle = origin + w * (0.5 * params.radius);
    let height = 0.5 * params.radius * cos_theta;
    var down = reach;
    if params.estimator == 2u && reach * sin_theta > height {
        down = height / sin_theta;
    }
    let first = occluded(new_ray(middle - d1 * reach, d1, 2.0 * reach));
    let second = occluded(new_ray(middle - d2 * reach, d2, reach + down));
    return select(0u, 2u, first) | select(0u, 4u, second);
}

@compute @workgroup_size(64)
fn open_halves(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let surface = surfaces[pixel];
    if surface.triangle == MISS {
        return;
    }
    let origin = surface.point + surface.normal * params.offset;
    let frame = tangents(surface.normal);
    let sampler = sampler_seed(params.seed, pixel, params.replicate);
    var open = 0u;
    var done = 0u;
    var decided = decisions[pixel];
    for (var i = params.first_ray; i < params.first_ray + params.rays; i++) {
        let closed = decide(origin, surface.normal, frame[0], frame[1], pair(sampler, i, 0u));
        if (closed & 1u) == 0u {
            open += 2u - countOneBits(closed);
        }
        if i < 32u {
            decided.primary |= (closed & 1u) << i;
            decided.first |= ((closed >> 1u) & 1u) << i;
            decided.second |= ((closed >> 2u) & 1u) << i;
        }
        done++;
    }
    // Mesa's software driver stops all loops of an invocation after 65,535
    // iterations; what it has then is wrong and must not pass.
    if done != params.rays || halves[pixel] == STOPPED {
        halves[pixel] = STOPPED;
        return;
    }
    halves[pixel] += open;
    decisions[pixel] = decided;
}
