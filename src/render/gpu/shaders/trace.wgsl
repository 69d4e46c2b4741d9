// The tree and the watertight triangle test. Twin: trace/mod.rs and
// trace/triangle.rs.

struct Node {
    min: vec3<f32>,
    first: u32,
    max: vec3<f32>,
    count: u32,
}

@group(0) @binding(1) var<storage, read> nodes: array<Node>;
// Nine floats a triangle, in leaf order.
@group(0) @binding(2) var<storage, read> triangles: array<f32>;

const STACK = 64u;
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
    return 1.0 / select(x, select(1e-30, -1e-30, x < 0.0), abs(x) < 1e-30);
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
    let at = triangle * 9u + k * 3u;
    return vec3<f32>(triangles[at], triangles[at + 1u], triangles[at + 2u]);
}

fn meets(ray: Ray, triangle: u32, tmax: f32) -> Meeting {
    let a = permute(corner(triangle, 0u) - ray.origin, ray.axis);
    let b = permute(corner(triangle, 1u) - ray.origin, ray.axis);
    let c = permute(corner(triangle, 2u) - ray.origin, ray.axis);
    let ax = a.x - ray.shear.x * a.z;
    let ay = a.y - ray.shear.y * a.z;
    let bx = b.x - ray.shear.x * b.z;
    let by = b.y - ray.shear.y * b.z;
    let cx = c.x - ray.shear.x * c.z;
    let cy = c.y - ray.shear.y * c.z;
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let det = u + v + w;
    if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) || det == 0.0 {
        return Meeting(false, 0.0, vec3<f32>());
    }
    let t = ray.shear.z * (u * a.z + v * b.z + w * c.z) / det;
    return Meeting(t > 0.0 && t <= tmax, t, vec3<f32>(u, v, w) / det);
}

// Entry distance into a node's box, FAR_AWAY * 2 for a miss.
fn enter(node: u32, ray: Ray, tmax: f32) -> f32 {
    let lo = (nodes[node].min - ray.origin) * ray.inverse;
    let hi = (nodes[node].max - ray.origin) * ray.inverse;
    let close = min(lo, hi);
    let open = max(lo, hi);
    let near = max(max(close.x, close.y), max(close.z, 0.0));
    let far = min(min(open.x, open.y), min(open.z, tmax));
    return select(2.0 * FAR_AWAY, near, near <= far * 1.0000004);
}

// Whether a triangle turns its front against the ray.
fn faces(triangle: u32, direction: vec3<f32>) -> bool {
    let a = corner(triangle, 0u);
    return dot(cross(corner(triangle, 1u) - a, corner(triangle, 2u) - a), direction) < 0.0;
}

// The nearest triangle on the ray, or with `any` the first one found; with
// `front` only of those that face it.
fn walk(ray: Ray, any: bool, front: bool) -> Hit {
    var best = Hit(MISS, ray.tmax, vec3<f32>());
    var stack: array<u32, STACK>;
    var height = 0u;
    var node = 0u;
    if enter(0u, ray, best.t) > FAR_AWAY {
        return best;
    }
    loop {
        let first = nodes[node].first;
        let count = nodes[node].count;
        if count > 0u {
            for (var triangle = first; triangle < first + count; triangle++) {
                let meeting = meets(ray, triangle, best.t);
                if meeting.met && (!front || faces(triangle, ray.direction)) {
                    best = Hit(triangle, meeting.t, meeting.weights);
                    if any {
                        return best;
                    }
                }
            }
        } else {
            let left = enter(first, ray, best.t);
            let right = enter(first + 1u, ray, best.t);
            let swapped = right < left;
            if max(left, right) <= FAR_AWAY {
                stack[height] = select(first + 1u, first, swapped);
                height++;
            }
            if min(left, right) <= FAR_AWAY {
                node = select(first, first + 1u, swapped);
                continue;
            }
        }
        if height == 0u {
            return best;
        }
        height--;
        node = stack[height];
    }
    return best;
}

fn occluded(ray: Ray, front: bool) -> bool {
    return walk(ray, true, front).triangle != MISS;
}
