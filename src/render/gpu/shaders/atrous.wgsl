// One pass of the edge-avoiding a-trous wavelet. Twin: render/smoothing/atrous.rs,
// which says how it works.

@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read_write> results: array<f32>;

// The cubic B-spline at -2 to 2. Not an array: a GPU keeps what is indexed at run time
// in memory.
fn spline(at: i32) -> f32 {
    return select(select(0.0625, 0.25, abs(at) == 1), 0.375, at == 0);
}

@compute @workgroup_size(64)
fn atrous(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.pixels {
        return;
    }
    let pixel = params.first_pixel + id.x;
    let surface = surfaces[pixel];
    let here = values[pixel];
    results[pixel] = here;
    if surface.triangle == UNSEEN || here < 0.0 {
        return;
    }
    let width = u32(params.resolution.x);
    let center = vec2<i32>(i32(pixel % width), i32(pixel / width));
    let plane = params.plane * footprint(surface.point);
    var weights = 0.0;
    var sum = 0.0;
    for (var row = 0; row < 5; row++) {
        for (var column = 0; column < 5; column++) {
            let at = center + vec2<i32>(column - 2, row - 2) * params.step;
            if !is_inside(at) {
                continue;
            }
            let index = index_of(at);
            let other = surfaces[index];
            let there = values[index];
            if other.triangle == UNSEEN || there < 0.0 {
                continue;
            }
            let turned = (other.normal - surface.normal) / params.normal;
            let away = dot(surface.normal, other.point - surface.point) / plane;
            let apart = (there - here) / params.openness;
            let weight = spline(row - 2) * spline(column - 2) * exp(-(dot(turned, turned) + away * away + apart * apart));
            weights += weight;
            sum += weight * there;
        }
    }
    results[pixel] = sum / weights;
}
