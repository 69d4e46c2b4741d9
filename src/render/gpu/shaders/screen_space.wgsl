// Horizons that the image of one camera shows. Twin: render/screen_space/mod.rs.

struct Params {
    to_image_x: vec4<f32>,
    to_image_y: vec4<f32>,
    to_image_z: vec4<f32>,
    eye: vec3<f32>,
    perspective: u32,
    // Towards an orthographic camera.
    backwards: vec3<f32>,
    radius: f32,
    // Of the camera.
    resolution: vec2<u32>,
    // Pixels and slices of this dispatch.
    first_pixel: u32,
    pixels: u32,
    first_slice: u32,
    slices: u32,
    seed: u32,
    replicate: u32,
    steps: u32,
    sample_power: u32,
    // STEP, QUADRATIC or LINEAR_TAIL.
    falloff: u32,
    tail: f32,
    // Cosine and sine of the tangent bias.
    bias: vec2<f32>,
    // Of what the image shows, along the line of sight; 0 for endless.
    thickness: f32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// What the camera sees.
@group(0) @binding(1) var<storage, read> surfaces: array<Surface>;
// For each pixel of the view, the camera's pixel that shows its point.
@group(0) @binding(2) var<storage, read> gathered: array<u32>;
@group(0) @binding(3) var<storage, read_write> sums: array<f32>;

const UNSEEN = 0xffffffffu;
const QUADRATIC = 1u;
const LINEAR_TAIL = 2u;
const FLAT = 1e-3;
const STOPPED = -1e30;

struct Point {
    point: vec3<f32>,
    pixel: u32,
    normal: vec3<f32>,
    depth: f32,
    to_eye: vec3<f32>,
    t: vec3<f32>,
    b: vec3<f32>,
    centre: vec2<f32>,
}

fn new_point(pixel: u32) -> Point {
    let surface = surfaces[pixel];
    let perspective = params.perspective != 0u;
    let from_eye = surface.point - params.eye;
    let to_eye = unit(select(params.backwards, -from_eye, perspective));
    let frame = tangents(to_eye);
    let width = params.resolution.x;
    let row = vec3<f32>(params.to_image_x.z, params.to_image_y.z, params.to_image_z.z);
    return Point(
        surface.point,
        pixel,
        surface.normal,
        select(1.0, dot(row, from_eye), perspective),
        to_eye,
        frame[0],
        frame[1],
        vec2<f32>(f32(pixel % width), f32(pixel / width)) + 0.5,
    );
}

fn across(point: Point, turns: f32) -> vec3<f32> {
    let at = turn(turns);
    return point.t * at.x + point.b * at.y;
}

struct Way {
    step: vec2<f32>,
    recede: f32,
}

fn way(point: Point, direction: vec3<f32>) -> Way {
    let moved = params.to_image_x.xyz * direction.x + params.to_image_y.xyz * direction.y
        + params.to_image_z.xyz * direction.z;
    let recede = select(0.0, moved.z, params.perspective != 0u);
    return Way(moved.xy - point.centre * recede, recede);
}

// 1 - mu of a sample at distance d.
fn weight(d: f32) -> f32 {
    let share = d / params.radius;
    switch params.falloff {
        case QUADRATIC: { return 1.0 - share * share; }
        case LINEAR_TAIL: { return 1.0 - clamp(1.0 - (1.0 - share) / params.tail, 0.0, 1.0); }
        default: { return 1.0; }
    }
}

struct Horizon {
    there: vec3<f32>,
    seen: bool,
    cosine: f32,
    weight: f32,
}

fn cosine_of(point: Point, there: vec3<f32>) -> f32 {
    return clamp(dot(point.to_eye, there) / length(there), -1.0, 1.0);
}

fn behind(point: Point, there: vec3<f32>, thickness: f32) -> vec3<f32> {
    let away = select(-params.backwards, point.point + there - params.eye, params.perspective != 0u);
    return there + unit(away) * thickness;
}

fn horizon(point: Point, on: Way, r: f32) -> Horizon {
    let none = Horizon(vec3<f32>(), false, 0.0, 0.0);
    let depth = point.depth + on.recede * r;
    if depth <= 0.0 {
        return none;
    }
    let place = point.centre + on.step * (r / depth);
    let size = vec2<f32>(params.resolution);
    if !(place.x >= 0.0 && place.y >= 0.0 && place.x < size.x && place.y < size.y) {
        return none;
    }
    let pixel = u32(place.y) * params.resolution.x + u32(place.x);
    let surface = surfaces[pixel];
    if pixel == point.pixel || surface.triangle == UNSEEN {
        return none;
    }
    let there = surface.point - point.point;
    let distance = length(there);
    if distance > params.radius || dot(point.normal, there) <= FLAT * distance {
        return none;
    }
    return Horizon(there, true, cosine_of(point, there), weight(distance));
}

fn sample_place(j: u32, jitter: f32) -> f32 {
    let share = (f32(j) + jitter) / f32(params.steps);
    var place = params.radius;
    for (var i = 0u; i < params.sample_power; i++) {
        place *= share;
    }
    return place;
}

// Adds what the slices of this dispatch came to. Mesa's software driver stops all
// loops of an invocation after 65,535 iterations; what it has then is wrong and
// must not pass.
fn add(pixel: u32, sum: f32, done: u32) {
    let first = params.first_slice == 0u;
    if done != params.slices || (!first && sums[pixel] == STOPPED) {
        sums[pixel] = STOPPED;
        return;
    }
    sums[pixel] = select(sums[pixel], 0.0, first) + sum;
}
