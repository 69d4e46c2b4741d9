// What the stages that smooth openness share. Twin: render/smoothing/mod.rs.

struct Camera {
    // Takes a point, from `origin`, to (x, y, depth), x and y times depth where the
    // view is perspective.
    to_image: mat3x3<f32>,
    origin: vec3<f32>,
    perspective: u32,
    // The longer edge of a pixel.
    pixel: f32,
}

struct Params {
    now: Camera,
    past: Camera,
    resolution: vec2<i32>,
    first_pixel: u32,
    // Pixels of this dispatch.
    pixels: u32,
    // 0 in the first frame.
    has_past: u32,
    blend: f32,
    // What the sum over a pixel's rays is divided by.
    units: f32,
    // Of the filter: the distance between its taps, and where its weights fall.
    step: i32,
    normal: f32,
    plane: f32,
    openness: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> surfaces: array<Surface>;

const UNSEEN = 0xffffffffu;
// Of a pixel whose loops the driver stopped: it and what it is blended into stay
// below 0, where no openness is.
const STOPPED = -1e30;

fn is_inside(at: vec2<i32>) -> bool {
    return all(at >= vec2<i32>()) && all(at < params.resolution);
}

fn index_of(at: vec2<i32>) -> u32 {
    return u32(at.y * params.resolution.x + at.x);
}

fn footprint(point: vec3<f32>) -> f32 {
    let depth = (params.now.to_image * (point - params.now.origin)).z;
    return params.now.pixel * select(1.0, depth, params.now.perspective != 0u);
}
