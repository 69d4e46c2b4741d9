// What is near a point, before any of its rays is traced.
//
// Rays of AO are short: of the atrium's eight nodes a primary ray and five a
// secondary ray, the first 1.3 are the same for all rays of a point, and a third of
// the points has nothing near. The CPU has no twin of this: it changes no result.
// What it saves: docs/gpu.md.

// Which of four slots touch the surroundings.
fn four_near(s: Surroundings, p: vec3<f32>, size: vec3<f32>, lo: vec3<u32>, hi: vec3<u32>) -> vec4<bool> {
    let start = p - s.origin;
    let lo_x = planes(lo.x, size.x, start.x);
    let hi_x = planes(hi.x, size.x, start.x);
    let lo_y = planes(lo.y, size.y, start.y);
    let hi_y = planes(hi.y, size.y, start.y);
    let lo_z = planes(lo.z, size.z, start.z);
    let hi_z = planes(hi.z, size.z, start.z);
    let x = max(max(lo_x, -hi_x), vec4<f32>());
    let y = max(max(lo_y, -hi_y), vec4<f32>());
    let z = max(max(lo_z, -hi_z), vec4<f32>());
    let n = s.normal;
    let height = max(lo_x * n.x, hi_x * n.x) + max(lo_y * n.y, hi_y * n.y) + max(lo_z * n.z, hi_z * n.z);
    return (x * x + y * y + z * z <= vec4<f32>(s.radius * s.radius)) & (height >= vec4<f32>(s.floor_height));
}

// As `children_met`, but inner nodes in the order of slots.
fn children_near(at: u32, corner_and_steps: vec4<u32>, metas: vec2<u32>, s: Surroundings) -> u32 {
    let p = bitcast<vec3<f32>>(corner_and_steps.xyz);
    let steps = corner_and_steps.w;
    let size = bitcast<vec3<f32>>((vec3<u32>(steps) >> vec3<u32>(0u, 8u, 16u) & vec3<u32>(0xffu)) << vec3<u32>(23u));
    let a = nodes[at + 2u];
    let b = nodes[at + 3u];
    let c = nodes[at + 4u];
    let first = four_near(s, p, size, vec3<u32>(a.x, a.z, b.x), vec3<u32>(b.z, c.x, c.z));
    let second = four_near(s, p, size, vec3<u32>(a.y, a.w, b.y), vec3<u32>(b.w, c.y, c.w));
    return bits_of(first, metas.x, 0u) | bits_of(second, metas.y, 0u);
}

fn rises(triangle: u32, s: Surroundings) -> bool {
    let a = dot(corner(triangle, 0u) - s.origin, s.normal);
    let b = dot(corner(triangle, 1u) - s.origin, s.normal);
    let c = dot(corner(triangle, 2u) - s.origin, s.normal);
    return max(max(a, b), c) >= s.floor_height;
}

// The root of a subtree that holds all that is near a point: what all rays of the
// point can begin at. Where `whole`, MISS for a point that has nothing near: to know
// that costs as much as some rays.
fn survey(s: Surroundings, whole: bool) -> u32 {
    var root = ROOT;
    var alone = true;
    var height = 0u;
    var group = vec2<u32>(0u, 0x1000000u);
    loop {
        let slot = firstTrailingBit(group.y >> 24u);
        let before = countOneBits(group.y & ((1u << slot) - 1u) & 0xffu);
        group.y &= ~(0x1000000u << slot);
        let node = group.x + before;
        if group.y > 0x00ffffffu {
            stacks[height * 64u + lane] = group;
            height++;
        }
        let at = node * 5u;
        let corner_and_steps = nodes[at];
        let head = nodes[at + 1u];
        let near = children_near(at, corner_and_steps, head.zw, s);
        if alone {
            root = node;
            alone = countOneBits(near) == 1u && near > 0x00ffffffu;
            if !alone && !whole {
                return root;
            }
        }
        var leaves = near & 0x00ffffffu;
        while leaves != 0u {
            if rises(head.y + firstTrailingBit(leaves), s) {
                return root;
            }
            leaves &= leaves - 1u;
        }
        group = vec2<u32>(head.x, (near & 0xff000000u) | (corner_and_steps.w >> 24u));
        if group.y <= 0x00ffffffu {
            if height == 0u {
                return MISS;
            }
            height--;
            group = stacks[height * 64u + lane];
        }
    }
    return root;
}
