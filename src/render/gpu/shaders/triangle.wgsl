// Rays, triangles, and the watertight test. Twin: trace/triangle.rs. How rays find
// the triangles they meet: trace.wgsl, trace_query.wgsl.

// Three corners a triangle, in the order of the tree's leaves; the first one's w is
// the triangle's number in the scene.
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;

const FAR_AWAY = 1e30;
const MISS = 0xffffffffu;

struct Ray {
    origin: vec3<f32>,
    direction: vec3<f32>,
    inverse: vec3<f32>,
    shear: vec3<f32>,
    tmax: f32,
    // The axis along which the direction is longest.
    axis: u32,
}

struct Meeting {
    met: bool,
    t: f32,
    weights: vec3<f32>,
}

struct Hit {
    // MISS where nothing was hit.
    triangle: u32,
    t: f32,
    weights: vec3<f32>,
}

fn bounded_reciprocal(x: f32) -> f32 {
    return 1.0 / select(x, select(1e-20, -1e-20, x < 0.0), abs(x) < 1e-20);
}

// The axes in the order of the triangle test, the longest last.
fn permute(v: vec3<f32>, axis: u32) -> vec3<f32> {
    return select(select(v.xyz, v.zxy, axis == 1u), v.yzx, axis == 0u);
}

fn new_ray(origin: vec3<f32>, direction: vec3<f32>, tmax: f32) -> Ray {
    let a = abs(direction);
    let axis = select(select(2u, 1u, a.y > a.z), select(2u, 0u, a.x > a.z), a.x > a.y);
    let d = permute(direction, axis);
    let sz = 1.0 / d.z;
    let inverse = vec3<f32>(
        bounded_reciprocal(direction.x),
        bounded_reciprocal(direction.y),
        bounded_reciprocal(direction.z),
    );
    return Ray(origin, direction, inverse, vec3<f32>(d.x * sz, d.y * sz, sz), tmax, axis);
}

fn corner(triangle: u32, k: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(triangles[triangle * 3u + k].xyz);
}

fn number(triangle: u32) -> u32 {
    return triangles[triangle * 3u].w;
}

// a b - c d with the right sign (Kahan; Jeannerod, Louvet, Muller, Mathematics of
// Computation 82, 2013). The CPU has the plain formula: its rounded products are
// compared as they are. Here a driver may fuse one of the two products into the
// subtraction and round only the other; then a ray through an edge could miss both
// triangles at it.
fn difference_of_products(a: f32, b: f32, c: f32, d: f32) -> f32 {
    let cd = c * d;
    return fma(a, b, -cd) + fma(-c, d, cd);
}

// Signed areas opposite to a triangle's corners, as the ray sees them, and how far
// along the ray's longest axis the corners lie.
struct Seen {
    areas: vec3<f32>,
    along: vec3<f32>,
}

fn seen_by(ray: Ray, triangle: u32) -> Seen {
    let a = permute(corner(triangle, 0u) - ray.origin, ray.axis);
    let b = permute(corner(triangle, 1u) - ray.origin, ray.axis);
    let c = permute(corner(triangle, 2u) - ray.origin, ray.axis);
    let ax = a.x - ray.shear.x * a.z;
    let ay = a.y - ray.shear.y * a.z;
    let bx = b.x - ray.shear.x * b.z;
    let by = b.y - ray.shear.y * b.z;
    let cx = c.x - ray.shear.x * c.z;
    let cy = c.y - ray.shear.y * c.z;
    let areas = vec3<f32>(
        difference_of_products(cx, by, cy, bx),
        difference_of_products(ax, cy, ay, cx),
        difference_of_products(bx, ay, by, ax),
    );
    return Seen(areas, vec3<f32>(a.z, b.z, c.z));
}

fn meets(ray: Ray, triangle: u32, tmax: f32) -> Meeting {
    let seen = seen_by(ray, triangle);
    let u = seen.areas.x;
    let v = seen.areas.y;
    let w = seen.areas.z;
    let det = u + v + w;
    if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) || det == 0.0 {
        return Meeting(false, 0.0, vec3<f32>());
    }
    let t = ray.shear.z * (u * seen.along.x + v * seen.along.y + w * seen.along.z) / det;
    return Meeting(t > 0.0 && t <= tmax, t, seen.areas / det);
}

// How far a point on a triangle is moved off it beyond the offset of all ray
// origins: what its shape makes of the rounding of the test above. Twin: lift.
fn lift(a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, offset: f32) -> f32 {
    let ab = b - a;
    let ac = c - a;
    let bc = c - b;
    let longest = max(max(dot(ab, ab), dot(ac, ac)), dot(bc, bc));
    let area = length(cross(ab, ac));
    if area <= 0.0 {
        return 0.0;
    }
    return clamp(0x1p-24 * longest * sqrt(longest) / area - offset, 0.0, 256.0 * offset);
}

// Whether a triangle turns its front against a ray of this direction.
fn faces(triangle: u32, direction: vec3<f32>) -> bool {
    let a = corner(triangle, 0u);
    return dot(cross(corner(triangle, 1u) - a, corner(triangle, 2u) - a), direction) < 0.0;
}
