// Local indirect light. Twin: render/indirect.rs.

// Albedo, then emission, of each triangle in leaf order.
@group(0) @binding(6) var<storage, read> materials: array<f32>;

const ROULETTE = 0x40000000u;

fn albedo(triangle: u32) -> vec3<f32> {
    let at = triangle * 6u;
    return vec3<f32>(materials[at], materials[at + 1u], materials[at + 2u]);
}

fn emitted(triangle: u32) -> vec3<f32> {
    let at = triangle * 6u + 3u;
    return vec3<f32>(materials[at], materials[at + 1u], materials[at + 2u]);
}

struct Path {
    light: vec3<f32>,
    // Whether it came to its end by itself.
    ended: bool,
}

fn follow(surface: Surface, index: u32, sampler: u32) -> Path {
    var here = surface;
    var throughput = vec3<f32>(1.0);
    var light = vec3<f32>();
    for (var bounce = 0u; bounce < ROULETTE; bounce++) {
        let place = pair(sampler, index, bounce);
        let phi = turn(place.y);
        let frame = tangents(here.normal);
        let direction = (frame[0] * phi.x + frame[1] * phi.y) * sqrt(place.x) + here.normal * sqrt(1.0 - place.x);
        let hit = walk(new_ray(here.point + here.normal * params.offset, direction, params.reach), false, false);
        if hit.triangle == MISS {
            return Path(light + throughput, true);
        }
        let open = mu(hit.t);
        light += throughput * open;
        throughput *= 1.0 - open;
        light += throughput * emitted(hit.triangle);
        throughput *= albedo(hit.triangle);
        let survival = min(max(throughput.x, max(throughput.y, throughput.z)), 0.95);
        if pair(sampler, index, ROULETTE + bounce).x >= survival {
            return Path(light, true);
        }
        throughput /= survival;
        here = met(hit, direction);
    }
    return Path(light, false);
}

@compute @workgroup_size(64)
fn indirect(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = pixel_of(id.x);
    if pixel == MISS {
        return;
    }
    let surface = surfaces[pixel];
    let at = pixel * 3u;
    if surface.triangle == MISS {
        // What a job before may have left.
        sums[at] = 0.0;
        return;
    }
    let sampler = sampler_seed(params.seed, pixel, params.replicate);
    var sum = vec3<f32>();
    var done = 0u;
    for (var i = params.first_ray; i < params.first_ray + params.rays; i++) {
        let path = follow(surface, i, sampler);
        sum += path.light;
        done += select(0u, 1u, path.ended);
    }
    // The first dispatch of a job finds what the job before left.
    let first = params.first_ray == 0u;
    // As in openness: a driver that stops loops must not pass.
    if done != params.rays || (!first && sums[at] == STOPPED) {
        sums[at] = STOPPED;
        return;
    }
    sums[at] = select(sums[at], 0.0, first) + sum.x;
    sums[at + 1u] = select(sums[at + 1u], 0.0, first) + sum.y;
    sums[at + 2u] = select(sums[at + 2u], 0.0, first) + sum.z;
}
