enable wgpu_ray_query;

// Rays are traced by the driver, on hardware that can. The functions are those of
// trace.wgsl; the driver's boxes and triangle test are its own.

@group(0) @binding(1) var tree: acceleration_structure;

const ROOT = 0u;

// A driver's structure has no subtrees to begin at, and does not say what is near.
fn survey(s: Surroundings, whole: bool) -> u32 {
    return ROOT;
}

// The nearest triangle on the ray, or with `any` the first one found; with
// `front` only of those that face it.
fn walk(ray: Ray, any: bool, front: bool) -> Hit {
    // At the top of a function, where naga gives it no value: within a loop it
    // writes one that loses the device.
    var query: ray_query;
    // What is not opaque is asked about below: so a front is what it is in
    // `faces`, and not by a driver's sense of winding.
    let sides = select(RAY_FLAG_FORCE_OPAQUE, RAY_FLAG_FORCE_NO_OPAQUE, front);
    let flags = sides | select(RAY_FLAG_NONE, RAY_FLAG_TERMINATE_ON_FIRST_HIT, any);
    rayQueryInitialize(&query, tree, RayDesc(flags, 0xffu, 0.0, ray.tmax, ray.origin, ray.direction));
    while rayQueryProceed(&query) {
        if faces(rayQueryGetCandidateIntersection(&query).primitive_index, ray.direction) {
            rayQueryConfirmIntersection(&query);
        }
    }
    let found = rayQueryGetCommittedIntersection(&query);
    if found.kind == RAY_QUERY_INTERSECTION_NONE {
        return Hit(MISS, ray.tmax, vec3<f32>());
    }
    // The same triangle gives the same point as on the CPU, unless its own test
    // would have missed it by a hair.
    let meeting = meets(ray, found.primitive_index, ray.tmax);
    if meeting.met {
        return Hit(found.primitive_index, meeting.t, meeting.weights);
    }
    let b = found.barycentrics;
    return Hit(found.primitive_index, found.t, vec3<f32>(1.0 - b.x - b.y, b));
}

fn walk_from(root: u32, ray: Ray, any: bool, front: bool) -> Hit {
    return walk(ray, any, front);
}

fn occluded(root: u32, ray: Ray, front: bool) -> bool {
    return walk(ray, true, front).triangle != MISS;
}
