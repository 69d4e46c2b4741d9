// What a surface is made of at a point. Twin: render/materials.rs, and
// Texture::color of the crate aogauge-scenes.

struct Picture {
    // Where its texels begin.
    first: u32,
    // Both 0 where there is no picture.
    width: u32,
    height: u32,
    // REPEAT, CLAMP or MIRROR along u, and times four along v.
    wrap: u32,
}

struct Material {
    base_color: vec3<f32>,
    metallic: f32,
    emission: vec3<f32>,
    roughness: f32,
    color_picture: Picture,
    metal_rough_picture: Picture,
    emission_picture: Picture,
}

// What a triangle wears.
struct Skin {
    // Texture coordinates of its corners.
    a: vec2<f32>,
    b: vec2<f32>,
    c: vec2<f32>,
    material: u32,
    // 0 where it has no texture coordinates.
    mapped: u32,
}

// A triangle each, as `corner` numbers them.
@group(0) @binding(10) var<storage, read> skins: array<Skin>;
@group(0) @binding(11) var<storage, read> materials: array<Material>;
// Red in the lowest byte.
@group(0) @binding(12) var<storage, read> texels: array<u32>;
// Linear light of the sRGB bytes.
@group(0) @binding(13) var<uniform> srgb: array<vec4<f32>, 64>;

const REPEAT = 0u;
const CLAMP = 1u;

// The texel, of n, that stands at a place on the endless row of texels.
fn texel_at(place: f32, n: u32, wrap: u32) -> u32 {
    let at = i32(clamp(place, -1e9, 1e9));
    let count = i32(n);
    if wrap == CLAMP {
        return u32(clamp(at, 0, count - 1));
    }
    let period = select(2 * count, count, wrap == REPEAT);
    let inside = (at % period + period) % period;
    return u32(select(2 * count - 1 - inside, inside, inside < count));
}

fn decoded(texel: u32, linear: bool) -> vec3<f32> {
    let bytes = vec3<u32>(texel, texel >> 8u, texel >> 16u) & vec3<u32>(255u);
    if linear {
        return vec3<f32>(bytes) / 255.0;
    }
    return vec3<f32>(
        srgb[bytes.x >> 2u][bytes.x & 3u],
        srgb[bytes.y >> 2u][bytes.y & 3u],
        srgb[bytes.z >> 2u][bytes.z & 3u],
    );
}

// A picture at texture coordinates; one where there is no picture.
fn between(picture: Picture, uv: vec2<f32>, linear: bool) -> vec3<f32> {
    if picture.width == 0u {
        return vec3<f32>(1.0);
    }
    let at = uv * vec2<f32>(f32(picture.width), f32(picture.height)) - 0.5;
    let low = floor(at);
    let part = at - low;
    let left = texel_at(low.x, picture.width, picture.wrap & 3u);
    let right = texel_at(low.x + 1.0, picture.width, picture.wrap & 3u);
    let upper = picture.first + picture.width * texel_at(low.y, picture.height, picture.wrap >> 2u);
    let lower = picture.first + picture.width * texel_at(low.y + 1.0, picture.height, picture.wrap >> 2u);
    return mix(
        mix(decoded(texels[upper + left], linear), decoded(texels[upper + right], linear), part.x),
        mix(decoded(texels[lower + left], linear), decoded(texels[lower + right], linear), part.x),
        part.y,
    );
}

fn is_finite(x: f32) -> bool {
    return (bitcast<u32>(x) & 0x7f800000u) != 0x7f800000u;
}

fn material_at(surface: Surface) -> Here {
    let skin = skins[surface.triangle];
    let m = materials[skin.material];
    let a = corner(surface.triangle, 0u);
    let b = corner(surface.triangle, 1u) - a;
    let c = corner(surface.triangle, 2u) - a;
    let n = cross(b, c);
    let p = surface.point - a;
    let v = dot(cross(p, c), n);
    let w = dot(cross(b, p), n);
    let uv = skin.a + ((skin.b - skin.a) * v + (skin.c - skin.a) * w) / dot(n, n);
    if skin.mapped == 0u || !is_finite(uv.x) || !is_finite(uv.y) {
        return Here(m.base_color, m.metallic, m.emission, m.roughness);
    }
    let metal_rough = between(m.metal_rough_picture, uv, true);
    return Here(
        m.base_color * between(m.color_picture, uv, false),
        m.metallic * metal_rough.z,
        m.emission * between(m.emission_picture, uv, false),
        m.roughness * metal_rough.y,
    );
}
