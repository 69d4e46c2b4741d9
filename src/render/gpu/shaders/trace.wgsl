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

// The bits of four slots, those that are met: for an inner node one of the highest
// eight, which a ray takes in the order of slot xor octant; for a leaf one a triangle.
// A byte of `metas` has bits 16 and 8 both set for an inner node alone.
fn bits_of(met: vec4<bool>, metas: u32, octant: u32) -> u32 {
    let inner = ((metas & (metas << 1u)) >> 4u) & 0x01010101u;
    let places = unpack4xU8((metas ^ (inner * octant)) & 0x1f1f1f1fu);
    let ones = unpack4xU8((metas >> 5u) & 0x07070707u);
    let bits = select(vec4<u32>(), ones << places, met);
    return bits.x | bits.y | bits.z | bits.w;
}

// A ray in the grid of a node's boxes.
struct Gridded {
    scale: vec3<f32>,
    start: vec3<f32>,
    tmax: f32,
}

// Which of four slots the ray meets: where it enters and leaves their boxes, axis by
// axis, a byte a slot.
fn four_met(g: Gridded, enters: vec3<u32>, leaves: vec3<u32>) -> vec4<bool> {
    let near_x = planes(enters.x, g.scale.x, g.start.x);
    let near_y = planes(enters.y, g.scale.y, g.start.y);
    let near_z = planes(enters.z, g.scale.z, g.start.z);
    let far_x = planes(leaves.x, g.scale.x, g.start.x);
    let far_y = planes(leaves.y, g.scale.y, g.start.y);
    let far_z = planes(leaves.z, g.scale.z, g.start.z);
    let near = max(max(near_x, near_y), max(near_z, vec4<f32>()));
    let far = min(min(far_x, far_y), min(far_z, vec4<f32>(g.tmax)));
    return near <= far * 1.0000004;
}

// Which children of a node the ray meets, as `bits_of` has them.
//
// With q steps of size s from p, a plane lies at p + q s; (p - o) / d + q (s / d) is
// one operation less for each of 48 planes than (p + q s - o) / d, but rounds at
// the size of p and o: boxes are padded for that. The ray's signs tell a box's near
// planes from its far ones before they are unpacked, four at once.
fn children_met(at: u32, corner_and_steps: vec4<u32>, metas: vec2<u32>, ray: Ray, octant: u32, tmax: f32) -> u32 {
    let p = bitcast<vec3<f32>>(corner_and_steps.xyz);
    let steps = corner_and_steps.w;
    let size = bitcast<vec3<f32>>((vec3<u32>(steps) >> vec3<u32>(0u, 8u, 16u) & vec3<u32>(0xffu)) << vec3<u32>(23u));
    let g = Gridded(size * ray.inverse, (p - ray.origin) * ray.inverse, tmax);
    let a = nodes[at + 2u];
    let b = nodes[at + 3u];
    let c = nodes[at + 4u];
    let lo_a = vec3<u32>(a.x, a.z, b.x);
    let lo_b = vec3<u32>(a.y, a.w, b.y);
    let hi_a = vec3<u32>(b.z, c.x, c.z);
    let hi_b = vec3<u32>(b.w, c.y, c.w);
    let backwards = ray.direction < vec3<f32>();
    let first = four_met(g, select(lo_a, hi_a, backwards), select(hi_a, lo_a, backwards));
    let second = four_met(g, select(lo_b, hi_b, backwards), select(hi_b, lo_b, backwards));
    return bits_of(first, metas.x, octant) | bits_of(second, metas.y, octant);
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
