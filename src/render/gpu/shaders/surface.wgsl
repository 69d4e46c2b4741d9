// What a pixel sees. Twin: render/gbuffer.rs.

struct Surface {
    point: vec3<f32>,
    // The greatest number where the pixel sees no surface.
    triangle: u32,
    normal: vec3<f32>,
    unused: u32,
}

// Twin: `tangents` of render/ao.rs.
fn tangents(n: vec3<f32>) -> array<vec3<f32>, 2> {
    let s = select(-1.0, 1.0, n.z >= 0.0);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    return array<vec3<f32>, 2>(
        vec3<f32>(1.0 + s * n.x * n.x * a, s * b, -s * n.x),
        vec3<f32>(b, s + n.y * n.y * a, -n.y),
    );
}

// A vector of length 1 as the CPU makes it: `normalize` may be looser, and rays that
// start or point elsewhere by a hair meet other triangles at thin edges.
fn unit(v: vec3<f32>) -> vec3<f32> {
    return v * (1.0 / sqrt(v.x * v.x + v.y * v.y + v.z * v.z));
}
