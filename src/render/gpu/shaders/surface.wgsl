// What a pixel sees. Twin: render/gbuffer.rs.

struct Surface {
    point: vec3<f32>,
    // The greatest number where the pixel sees no surface.
    triangle: u32,
    normal: vec3<f32>,
    unused: u32,
}
