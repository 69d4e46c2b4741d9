// The tree, eight children a node, and the watertight triangle test. Twins:
// trace/wide.rs with its tests, trace/triangle.rs.

// Five words of four a node: see `WideNode`.
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
// Three corners a triangle, in the order of the tree's leaves; the first one's w is
// the triangle's number in the scene. Nine floats a triangle took longer to load.
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;

const STACK = 24u;
const FAR_AWAY = 1e30;
const MISS = 0xffffffffu;
const ROOT = 0u;

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

// Entry or exit distances along one axis, of four slots.
fn planes(bytes: u32, scale: f32, start: f32) -> vec4<f32> {
    return vec4<f32>(unpack4xU8(bytes)) * scale + start;
}

// A ray in the grid of a node's boxes.
struct Gridded {
    scale: vec3<f32>,
    start: vec3<f32>,
    tmax: f32,
    octant: u32,
}

// Which of four slots, from `first` on, the ray meets: see `children_met`.
fn four_met(g: Gridded, lo: vec3<u32>, hi: vec3<u32>, meta_bytes: u32, inner: u32, first: u32) -> u32 {
    let lo_x = planes(lo.x, g.scale.x, g.start.x);
    let hi_x = planes(hi.x, g.scale.x, g.start.x);
    let lo_y = planes(lo.y, g.scale.y, g.start.y);
    let hi_y = planes(hi.y, g.scale.y, g.start.y);
    let lo_z = planes(lo.z, g.scale.z, g.start.z);
    let hi_z = planes(hi.z, g.scale.z, g.start.z);
    let near = max(max(min(lo_x, hi_x), min(lo_y, hi_y)), max(min(lo_z, hi_z), vec4<f32>()));
    let far = min(min(max(lo_x, hi_x), max(lo_y, hi_y)), min(max(lo_z, hi_z), vec4<f32>(g.tmax)));
    let slots = vec4<u32>(0u, 1u, 2u, 3u) + first;
    let metas = unpack4xU8(meta_bytes);
    let of_leaf = (metas >> vec4<u32>(5u)) << (metas & vec4<u32>(31u));
    let of_inner = vec4<u32>(1u) << (24u + (slots ^ vec4<u32>(g.octant)));
    let is_inner = ((vec4<u32>(inner) >> slots) & vec4<u32>(1u)) == vec4<u32>(1u);
    let bits = select(vec4<u32>(), select(of_leaf, of_inner, is_inner), near <= far * 1.0000004);
    return bits.x | bits.y | bits.z | bits.w;
}

// Which children of a node the ray meets: for an inner node, a bit of the highest
// eight in the order in which the ray takes them; for a leaf, a bit each triangle.
//
// With q steps of size s from p, a plane lies at p + q s; (p - o) / d + q (s / d) is
// one operation less for each of 48 planes than (p + q s - o) / d, but rounds at
// the size of p and o: boxes are padded for that.
fn children_met(at: u32, corner_and_steps: vec4<u32>, metas: vec2<u32>, ray: Ray, octant: u32, tmax: f32) -> u32 {
    let p = bitcast<vec3<f32>>(corner_and_steps.xyz);
    let steps = corner_and_steps.w;
    let size = bitcast<vec3<f32>>((vec3<u32>(steps) >> vec3<u32>(0u, 8u, 16u) & vec3<u32>(0xffu)) << vec3<u32>(23u));
    let g = Gridded(size * ray.inverse, (p - ray.origin) * ray.inverse, tmax, octant);
    let a = nodes[at + 2u];
    let b = nodes[at + 3u];
    let c = nodes[at + 4u];
    let inner = steps >> 24u;
    return four_met(g, vec3<u32>(a.x, a.z, b.x), vec3<u32>(b.z, c.x, c.z), metas.x, inner, 0u)
        | four_met(g, vec3<u32>(a.y, a.w, b.y), vec3<u32>(b.w, c.y, c.w), metas.y, inner, 4u);
}

// Whether a triangle turns its front against a ray of this direction.
fn faces(triangle: u32, direction: vec3<f32>) -> bool {
    let a = corner(triangle, 0u);
    return dot(cross(corner(triangle, 1u) - a, corner(triangle, 2u) - a), direction) < 0.0;
}

// Of two triangles at one distance, the closest hit is the first in the scene,
// whatever the order of the walk. Twin: Tracer::closest.
fn is_closer(meeting: Meeting, triangle: u32, best: Hit) -> bool {
    return meeting.t < best.t || best.triangle == MISS || number(triangle) < number(best.triangle);
}

// The nearest triangle on the ray, or with `any` the first one found; with
// `front` only of those that face it.
fn walk(ray: Ray, any: bool, front: bool) -> Hit {
    return walk_from(ROOT, ray, any, front);
}

// The same for a ray that meets nothing outside a subtree.
fn walk_from(root: u32, ray: Ray, any: bool, front: bool) -> Hit {
    var best = Hit(MISS, ray.tmax, vec3<f32>());
    var stack: array<vec2<u32>, STACK>;
    var height = 0u;
    let signs = select(vec3<u32>(), vec3<u32>(1u, 2u, 4u), ray.direction < vec3<f32>());
    let octant = 7u - (signs.x + signs.y + signs.z);
    // The first of some inner nodes, and which of their slots are left to visit.
    var group = vec2<u32>(root, 0x80000000u);
    loop {
        if group.y > 0x00ffffffu {
            let bit = firstLeadingBit(group.y);
            let slot = (bit - 24u) ^ octant;
            let before = countOneBits(group.y & ((1u << slot) - 1u) & 0xffu);
            group.y &= ~(1u << bit);
            if group.y > 0x00ffffffu {
                stack[height] = group;
                height++;
            }
            let at = (group.x + before) * 5u;
            let corner_and_steps = nodes[at];
            let head = nodes[at + 1u];
            let met = children_met(at, corner_and_steps, head.zw, ray, octant, best.t);
            group = vec2<u32>(head.x, (met & 0xff000000u) | (corner_and_steps.w >> 24u));
            var leaves = met & 0x00ffffffu;
            while leaves != 0u {
                let triangle = head.y + firstTrailingBit(leaves);
                leaves &= leaves - 1u;
                let meeting = meets(ray, triangle, best.t);
                if meeting.met && (!front || faces(triangle, ray.direction)) && (any || is_closer(meeting, triangle, best)) {
                    best = Hit(triangle, meeting.t, meeting.weights);
                    if any {
                        return best;
                    }
                }
            }
        }
        if group.y <= 0x00ffffffu {
            if height == 0u {
                return best;
            }
            height--;
            group = stack[height];
        }
    }
    return best;
}

fn occluded(root: u32, ray: Ray, front: bool) -> bool {
    return walk_from(root, ray, true, front).triangle != MISS;
}
