// The G-buffer by rasterisation: all triangles are drawn into an image of which
// triangle a pixel sees, and then the pixel's own ray meets that triangle. What a
// view sees by rays: `see` in ao.wgsl.

struct Projection {
    // Takes a point, from the view's origin, to (x, y, depth), or to (x depth,
    // y depth, depth) where the view is perspective; x and y in pixels.
    x: vec3<f32>,
    perspective: u32,
    y: vec3<f32>,
    width: f32,
    depth: vec3<f32>,
    height: f32,
    origin: vec3<f32>,
    // Perspective: what is nearer than this is not drawn.
    near: f32,
}

@group(0) @binding(12) var<uniform> projection: Projection;
// 0 where no triangle is, else the triangle + 1.
@group(0) @binding(13) var visible: texture_2d<u32>;

// Takes distances to depths. A power of two, so that none is rounded.
const DEPTH = 0x1p-64f;
// Takes distances before the near plane of orthographic views into clip space.
const CLIP = 0x1p-32f;

struct Drawn {
    @builtin(position) at: vec4<f32>,
    @location(0) @interpolate(flat) triangle: u32,
}

// Corners are pulled from the triangles that rays are traced against. The depth
// here only serves to cut what is behind the camera; `show` gives the real one.
@vertex
fn project(@builtin(vertex_index) index: u32) -> Drawn {
    let triangle = index / 3u;
    let towards = corner(triangle, index % 3u) - projection.origin;
    let x = dot(projection.x, towards);
    let y = dot(projection.y, towards);
    let depth = dot(projection.depth, towards);
    var at = vec4<f32>(2.0 * x / projection.width - 1.0, 1.0 - 2.0 * y / projection.height, depth * CLIP, 1.0);
    if projection.perspective != 0u {
        at = vec4<f32>(
            2.0 * x / projection.width - depth,
            depth - 2.0 * y / projection.height,
            depth - projection.near,
            depth,
        );
    }
    return Drawn(at, triangle);
}

// Where a ray meets a triangle. Rasterisation moves corners to a grid, so that a
// pixel may see a triangle which its ray passes by a hair; it then sees the point
// that weights cut to [0, 1] give: beside the ray by less than a pixel, and still
// on the triangle, so that rays from there start on a surface.
fn meets_near(ray: Ray, triangle: u32) -> Hit {
    let meeting = meets(ray, triangle, FAR_AWAY);
    if meeting.met {
        return Hit(triangle, meeting.t, meeting.weights);
    }
    let seen = seen_by(ray, triangle);
    let det = seen.areas.x + seen.areas.y + seen.areas.z;
    let inside = max(seen.areas * select(1.0, -1.0, det < 0.0), vec3<f32>());
    let sum = inside.x + inside.y + inside.z;
    if sum == 0.0 {
        // Seen edge-on: no point is nearer than another.
        return Hit(MISS, 0.0, vec3<f32>());
    }
    let weights = inside / sum;
    let t = ray.shear.z * (weights.x * seen.along.x + weights.y * seen.along.y + weights.z * seen.along.z);
    return Hit(select(MISS, triangle, t > 0.0), t, weights);
}

struct Shown {
    @location(0) visible: u32,
    @builtin(frag_depth) depth: f32,
}

// The depth is the distance along the pixel's ray, as `see` compares it: so both
// choose the same triangle wherever one is nearer by the last bit.
@fragment
fn show(drawn: Drawn) -> Shown {
    let hit = meets_near(view_ray(drawn.at.x, drawn.at.y), drawn.triangle);
    if hit.triangle == MISS {
        discard;
    }
    return Shown(drawn.triangle + 1u, hit.t * DEPTH);
}

// The points to shade.
@compute @workgroup_size(64)
fn resolve(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = pixel_of(id.x);
    if pixel == MISS {
        return;
    }
    let at = vec2<u32>(pixel % params.width, pixel / params.width);
    let shown = textureLoad(visible, at, 0).x;
    let ray = view_ray(f32(at.x) + 0.5, f32(at.y) + 0.5);
    var hit = Hit(MISS, 0.0, vec3<f32>());
    if shown != 0u {
        hit = meets_near(ray, shown - 1u);
    }
    begin(pixel, hit, ray.direction);
}
