// Accumulation over frames with reprojection. Twin: render/smoothing/temporal.rs,
// which says how it works.

@group(0) @binding(2) var<storage, read> sums: array<f32>;
@group(0) @binding(3) var<storage, read> past_surfaces: array<Surface>;
@group(0) @binding(4) var<storage, read> past_values: array<f32>;
@group(0) @binding(5) var<storage, read> past_lengths: array<f32>;
@group(0) @binding(6) var<storage, read_write> values: array<f32>;
@group(0) @binding(7) var<storage, read_write> lengths: array<f32>;

const SUBPIXELS = 256.0;
const SAME_WAY = 0.9;
const LEAST_WEIGHT = 0.01;

// Column and row of a point, and its depth.
fn place(camera: Camera, point: vec3<f32>) -> vec3<f32> {
    let seen = camera.to_image * (point - camera.origin);
    if camera.perspective != 0u {
        return vec3<f32>(seen.xy / seen.z, seen.z);
    }
    return seen;
}

fn is_same(surface: Surface, texel: Surface, size: f32) -> bool {
    return abs(dot(surface.normal, texel.point - surface.point)) <= size
        && dot(surface.normal, texel.normal) >= SAME_WAY;
}

struct Fetched {
    value: f32,
    // 0 where the surface was not seen.
    length: f32,
}

// History of a surface and its length.
fn fetch(pixel: vec2<i32>, surface: Surface) -> Fetched {
    let there = place(params.past, surface.point);
    let here = place(params.now, surface.point);
    if there.z <= 0.0 || here.z <= 0.0 {
        return Fetched(0.0, 0.0);
    }
    let way = floor((there.xy - here.xy) * SUBPIXELS + 0.5) / SUBPIXELS;
    let base = floor(way);
    let part = way - base;
    let size = footprint(surface.point);
    var weights = 0.0;
    var value = 0.0;
    var length = 0.0;
    for (var i = 0; i < 4; i++) {
        let shift = vec2<i32>(i & 1, i >> 1u);
        let at = pixel + vec2<i32>(base) + shift;
        if !is_inside(at) {
            continue;
        }
        let index = index_of(at);
        let texel = past_surfaces[index];
        if texel.triangle == UNSEEN || !is_same(surface, texel, size) {
            continue;
        }
        let shares = select(1.0 - part, part, shift == vec2<i32>(1));
        let weight = shares.x * shares.y;
        weights += weight;
        value += weight * past_values[index];
        length += weight * past_lengths[index];
    }
    if weights < LEAST_WEIGHT {
        return Fetched(0.0, 0.0);
    }
    return Fetched(value / weights, length / weights);
}

@compute @workgroup_size(64)
fn temporal(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let surface = surfaces[pixel];
    values[pixel] = 0.0;
    lengths[pixel] = 0.0;
    if surface.triangle == UNSEEN {
        return;
    }
    let sum = sums[pixel];
    let openness = select(sum / params.units, STOPPED, sum < 0.0);
    var before = Fetched(openness, 0.0);
    if params.has_past != 0u {
        let width = u32(params.resolution.x);
        let fetched = fetch(vec2<i32>(i32(pixel % width), i32(pixel / width)), surface);
        if fetched.length > 0.0 {
            before = fetched;
        }
    }
    let n = before.length + 1.0;
    values[pixel] = before.value + max(1.0 / n, params.blend) * (openness - before.value);
    lengths[pixel] = n;
}
