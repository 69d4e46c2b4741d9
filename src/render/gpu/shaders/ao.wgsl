// What a view sees, and openness ray by ray. Twins: render/gbuffer.rs and
// render/ao.rs.

struct Params {
    origin: vec3<f32>,
    width: u32,
    origin_dx: vec3<f32>,
    // The first place of this dispatch: see `pixel_of`.
    first_place: u32,
    origin_dy: vec3<f32>,
    // Places of this dispatch.
    places: u32,
    direction: vec3<f32>,
    first_ray: u32,
    direction_dx: vec3<f32>,
    // Rays of this dispatch.
    rays: u32,
    direction_dy: vec3<f32>,
    seed: u32,
    replicate: u32,
    radius: f32,
    secondary_radius: f32,
    offset: f32,
    // How far a primary ray looks.
    reach: f32,
    height: u32,
    // Numbers of the falloff, in order.
    falloff_numbers: vec3<f32>,
}

// STEP, EXPONENTIAL, LINEAR_TAIL, GAUSSIAN or QUADRATIC.
override FALLOFF: u32 = 0u;
// FRONT, CLIPPED, ONE_SIDED, JITTERED, TURNED, a bit each.
override OPTIONS: u32 = 0u;
// 0 for methods without.
override SECONDARY_RAYS: u32 = 0u;

const STEP = 0u;
const EXPONENTIAL = 1u;
const LINEAR_TAIL = 2u;
const GAUSSIAN = 3u;
const QUADRATIC = 4u;

const FRONT = 1u;
const CLIPPED = 2u;
const ONE_SIDED = 4u;
const JITTERED = 8u;
const TURNED = 16u;

// Which of its workgroup this invocation is; `pixel_of` sets it, so every entry point
// that traces calls that first.
var<private> lane: u32;

// The pixel of a place in tile order, MISS for one beyond the image's edge: tiles of
// 8 x 8 pixels, one a workgroup, along a Z curve, so that rays that run together
// start together.
fn pixel_of(invocation: u32) -> u32 {
    lane = invocation % 64u;
    let place = params.first_place + invocation;
    let tile = place / 64u;
    let along = place % 64u;
    let across = (params.width + 7u) / 8u;
    let x = tile % across * 8u + ((along & 1u) | ((along >> 1u) & 2u) | ((along >> 2u) & 4u));
    let y = tile / across * 8u + (((along >> 1u) & 1u) | ((along >> 2u) & 2u) | ((along >> 3u) & 4u));
    let inside = invocation < params.places && x < params.width && y < params.height;
    return select(MISS, y * params.width + x, inside);
}

fn is_set(option: u32) -> bool {
    return (OPTIONS & option) != 0u;
}

struct Decisions {
    primary: u32,
    first: u32,
    second: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(3) var<storage, read_write> surfaces: array<Surface>;
@group(0) @binding(4) var<storage, read_write> sums: array<f32>;
@group(0) @binding(5) var<storage, read_write> decisions: array<Decisions>;

const STOPPED = -1.0;

// Rays of all kinds from which on it pays to look whether a point has anything near:
// measured at 4 rays, where it does not, and at 32.
const MANY = 16u;

// The surface that a ray of this direction hit, its normal against the ray.
fn met(hit: Hit, direction: vec3<f32>) -> Surface {
    let a = corner(hit.triangle, 0u);
    let b = corner(hit.triangle, 1u);
    let c = corner(hit.triangle, 2u);
    let front = unit(cross(b - a, c - a));
    let normal = select(front, -front, dot(front, direction) > 0.0);
    let point = a * hit.weights.x + b * hit.weights.y + c * hit.weights.z;
    // A triangle without area has no normal.
    let up = lift(a, b, c, params.offset);
    return Surface(select(point, point + normal * up, up > 0.0), hit.triangle, normal, 0u);
}

// The ray of an image point: column and row, in pixels from the top left corner.
// Twin: View::ray.
fn view_ray(x: f32, y: f32) -> Ray {
    let origin = params.origin + params.origin_dx * x + params.origin_dy * y;
    let direction = unit(params.direction + params.direction_dx * x + params.direction_dy * y);
    return new_ray(origin, direction, FAR_AWAY);
}

// What a pixel sees where its ray has this hit; nothing else is known of it yet.
fn begin(pixel: u32, hit: Hit, direction: vec3<f32>) {
    var surface = Surface(vec3<f32>(), MISS, vec3<f32>(), 0u);
    if hit.triangle != MISS {
        surface = met(hit, direction);
    }
    surfaces[pixel] = surface;
    sums[pixel] = 0.0;
    decisions[pixel] = Decisions(0u, 0u, 0u);
}

@compute @workgroup_size(64)
fn see(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = pixel_of(id.x);
    if pixel == MISS {
        return;
    }
    let ray = view_ray(f32(pixel % params.width) + 0.5, f32(pixel / params.width) + 0.5);
    begin(pixel, walk(ray, false, false), ray.direction);
}

// mu of a hit at distance d.
fn mu(d: f32) -> f32 {
    let n = params.falloff_numbers;
    switch FALLOFF {
        case EXPONENTIAL: {
            // 1 - exp(-x) cancels where x is small; the series is right to the last bits there.
            let x = n.x * d;
            return select(1.0 - exp(-x), x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x / 24.0))), x < 0.03);
        }
        case QUADRATIC: { return (d / params.radius) * (d / params.radius); }
        case LINEAR_TAIL: { return clamp(1.0 - (1.0 - d / params.radius) / n.x, 0.0, 1.0); }
        case GAUSSIAN: {
            let x = d / params.radius;
            let open = 1.0 - (1.0 - n.y) * exp(-n.x * x * x);
            return open / (1.0 - n.z * (1.0 - open));
        }
        default: { return 0.0; }
    }
}

struct Primary {
    hit: bool,
    mu: f32,
    // How much of R the ray has before its hit.
    length: f32,
}

fn primary(root: u32, origin: vec3<f32>, w: vec3<f32>) -> Primary {
    let ray = new_ray(origin, w, params.reach);
    let hit = walk_from(root, ray, FALLOFF == STEP, is_set(FRONT));
    if hit.triangle == MISS {
        return Primary(false, 1.0, params.radius);
    }
    return Primary(true, mu(hit.t), min(hit.t, params.radius));
}

// The secondary rays of one primary ray.
struct Fan {
    middle: vec3<f32>,
    height: f32,
    d1: vec3<f32>,
    sin_theta: f32,
    d2: vec3<f32>,
}

fn closed(root: u32, fan: Fan, i: u32, turned: f32) -> bool {
    let period = select(0.5, 1.0, is_set(ONE_SIDED));
    let shift = select(0.0, turned, is_set(TURNED));
    let at = turn((f32(i) + shift) * period / f32(SECONDARY_RAYS));
    let d = fan.d1 * at.x + fan.d2 * at.y;
    let slope = at.y * fan.sin_theta;
    let reach = params.secondary_radius;
    var forth = reach;
    if is_set(CLIPPED) && reach * slope > fan.height {
        forth = fan.height / slope;
    }
    let back = select(reach, 0.0, is_set(ONE_SIDED));
    if is_set(FRONT) {
        return occluded(root, new_ray(fan.middle, d, forth), true)
            || (back > 0.0 && occluded(root, new_ray(fan.middle, -d, back), true));
    }
    return occluded(root, new_ray(fan.middle - d * back, d, back + forth), false);
}

struct Decided {
    hit: bool,
    mu: f32,
    closed: u32,
}

fn decide(root: u32, origin: vec3<f32>, normal: vec3<f32>, t: vec3<f32>, b: vec3<f32>, place: vec2<f32>, shift: vec2<f32>) -> Decided {
    let phi = turn(place.y);
    let sin_theta = sqrt(place.x);
    let cos_theta = sqrt(1.0 - place.x);
    let along = t * phi.x + b * phi.y;
    let w = along * sin_theta + normal * cos_theta;
    let first = primary(root, origin, w);
    var decided = Decided(first.hit, first.mu, 0u);
    if first.mu > 0.0 && SECONDARY_RAYS > 0u {
        let share = select(0.5, shift.x, is_set(JITTERED));
        let fan = Fan(
            origin + w * (share * first.length),
            share * first.length * cos_theta,
            t * phi.y - b * phi.x,
            sin_theta,
            along * cos_theta - normal * sin_theta,
        );
        for (var i = 0u; i < SECONDARY_RAYS; i++) {
            decided.closed |= select(0u, 1u << i, closed(root, fan, i, shift.y));
        }
    }
    return decided;
}

// Where all rays of a point stay: in a ball, and over its tangent plane no lower
// than `floor_height`.
struct Surroundings {
    origin: vec3<f32>,
    radius: f32,
    normal: vec3<f32>,
    floor_height: f32,
}

// A secondary ray lies within R' of the middle of
// its primary, and at right angles to it. What lies lower than its origin by a
// quarter of the offset lies in truth under it, and upward rays meet none of that;
// secondary rays that the receiver closes do.
fn surroundings(origin: vec3<f32>, normal: vec3<f32>) -> Surroundings {
    let has_secondary = SECONDARY_RAYS > 0u;
    let share = select(0.5, 1.0, is_set(JITTERED));
    let around = select(0.0, length(vec2<f32>(share * params.radius, params.secondary_radius)), has_secondary);
    let radius = max(params.reach, around) * 1.00001;
    let downward = has_secondary && !is_set(CLIPPED);
    return Surroundings(origin, radius, normal, select(-0.25 * params.offset, -FAR_AWAY, downward));
}

@compute @workgroup_size(64)
fn openness(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = pixel_of(id.x);
    if pixel == MISS {
        return;
    }
    let surface = surfaces[pixel];
    if surface.triangle == MISS {
        return;
    }
    let origin = surface.point + surface.normal * params.offset;
    let frame = tangents(surface.normal);
    let root = survey(surroundings(origin, surface.normal), params.rays * (1u + SECONDARY_RAYS) >= MANY);
    if root == MISS {
        sums[pixel] += f32(params.rays) * f32(max(SECONDARY_RAYS, 1u));
        return;
    }
    let sampler = sampler_seed(params.seed, pixel, params.replicate);
    let chance = (OPTIONS & (JITTERED | TURNED)) != 0u;
    var sum = 0.0;
    var done = 0u;
    var decisions_here = decisions[pixel];
    for (var i = params.first_ray; i < params.first_ray + params.rays; i++) {
        var shift = vec2<f32>();
        if chance {
            shift = pair(sampler, i, 1u);
        }
        let decided = decide(root, origin, surface.normal, frame[0], frame[1], pair(sampler, i, 0u), shift);
        // In units of one secondary ray, so that without falloff the sum is exact.
        let units = select(1.0, f32(SECONDARY_RAYS - countOneBits(decided.closed)), SECONDARY_RAYS > 0u);
        sum += decided.mu * units;
        if i < 32u {
            decisions_here.primary |= select(0u, 1u << i, decided.hit);
            decisions_here.first |= (decided.closed & 1u) << i;
            decisions_here.second |= ((decided.closed >> 1u) & 1u) << i;
        }
        done++;
    }
    // Mesa's software driver stops all loops of an invocation after 65,535
    // iterations; what it has then is wrong and must not pass.
    if done != params.rays || sums[pixel] == STOPPED {
        sums[pixel] = STOPPED;
        return;
    }
    sums[pixel] += sum;
    decisions[pixel] = decisions_here;
}
