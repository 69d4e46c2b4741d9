// What each pixel of a lit view shows, before ambient light and its occlusion.
// Twin: `shade` of render/composite.rs. A dispatch is told its lights as rays.

struct Sky {
    // Ambient radiance.
    ambient: vec3<f32>,
    // The uniform sky that lights an open floor as this one does; above 0.
    mean: f32,
    zenith: f32,
    horizon: f32,
    ground: f32,
}

struct Shaded {
    direct: vec3<f32>,
    // Negative for the sky.
    depth: f32,
    emission: vec3<f32>,
    albedo: vec3<f32>,
    normal: vec3<f32>,
}

@group(0) @binding(15) var<uniform> sky: Sky;
@group(0) @binding(16) var<storage, read_write> shaded: array<Shaded>;

// The sky as the eye sees it.
fn behind(direction: vec3<f32>) -> vec3<f32> {
    var radiance = sky.horizon + (sky.zenith - sky.horizon) * min(direction.y, 1.0);
    if direction.y < 0.0 {
        radiance = sky.ground;
    }
    return sky.ambient * (radiance / sky.mean);
}

struct Direct {
    light: vec3<f32>,
    // How many lights were counted.
    done: u32,
}

fn direct(here: Here, surface: Surface, viewer: vec3<f32>) -> Direct {
    let origin = surface.point + surface.normal * params.offset;
    var sum = Direct(vec3<f32>(), 0u);
    for (var i = params.first_ray; i < params.first_ray + params.rays; i++) {
        let arrives = arrival(lights[i], origin);
        let cosine = dot(surface.normal, arrives.direction);
        if any(arrives.irradiance != vec3<f32>()) && cosine > 0.0
            && !occluded(ROOT, new_ray(origin, arrives.direction, arrives.distance), false) {
            sum.light += brdf(here, surface.normal, arrives.direction, viewer) * arrives.irradiance * cosine;
        }
        sum.done++;
    }
    return sum;
}

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = pixel_of(id.x);
    if pixel == MISS {
        return;
    }
    let ray = view_ray(f32(pixel % params.width) + 0.5, f32(pixel / params.width) + 0.5);
    let hit = walk(ray, false, false);
    if hit.triangle == MISS {
        shaded[pixel] = Shaded(vec3<f32>(), -1.0, behind(ray.direction), vec3<f32>(), vec3<f32>());
        return;
    }
    let surface = met(hit, ray.direction);
    let here = material_at(surface);
    let found = direct(here, surface, -ray.direction);
    var before = vec3<f32>();
    // The first dispatch of a view finds what the view before left.
    if params.first_ray > 0u {
        before = shaded[pixel].direct;
    }
    // As in openness: a driver that stops loops must not pass.
    let stopped = found.done != params.rays || before.x == STOPPED;
    shaded[pixel] = Shaded(
        select(before + found.light, vec3<f32>(STOPPED), stopped),
        length(surface.point - ray.origin),
        here.emission,
        diffuse_albedo(here),
        surface.normal,
    );
}
