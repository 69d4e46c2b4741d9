// The tree, eight children a node. Twin: trace/wide.rs with its tests.

// Five words of four a node: see `WideNode`.
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;

// Entries of the stacks of a workgroup, 64 a level. (As 64u * LEVELS in the type, naga
// 30 panics.)
override STACKS: u32 = 1536u;
const ROOT = 0u;

// Nodes to come back to, for each invocation of the workgroup an entry a level, the
// invocations side by side: see `lane`. In memory of the invocation's own, methods
// with secondary rays took 1.2 times as long.
var<workgroup> stacks: array<vec2<u32>, STACKS>;

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
                stacks[height * 64u + lane] = group;
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
            group = stacks[height * 64u + lane];
        }
    }
    return best;
}

fn occluded(root: u32, ray: Ray, front: bool) -> bool {
    return walk_from(root, ray, true, front).triangle != MISS;
}
