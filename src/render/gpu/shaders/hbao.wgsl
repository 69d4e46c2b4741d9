// HBAO, direction by direction. Twin: render/screen_space/hbao.rs.

fn hbao_direction(point: Point, place: vec2<f32>) -> f32 {
    let towards_there = across(point, place.x);
    let along = dot(point.normal, towards_there);
    let towards = dot(point.normal, point.to_eye);
    let length = sqrt(along * along + towards * towards);
    if length < 1e-6 {
        return 1.0;
    }
    let cos_t = towards / length;
    let sin_t = -along / length;
    let below = cos_t * params.bias.x - sin_t * params.bias.y > 0.0;
    var highest = select(1.0, sin_t * params.bias.x + cos_t * params.bias.y, below);
    var closed = 0.0;
    let on = way(point, towards_there);
    for (var j = 0u; j < params.steps; j++) {
        let seen = horizon(point, on, sample_place(j, place.y));
        if seen.seen && seen.cosine > highest {
            closed += (seen.cosine - highest) * seen.weight;
            highest = seen.cosine;
        }
    }
    return 1.0 - closed;
}

@compute @workgroup_size(64)
fn hbao(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = params.first_pixel + id.x;
    if id.x >= params.pixels || gathered[pixel] == UNSEEN {
        return;
    }
    let point = new_point(gathered[pixel]);
    let sampler = sampler_seed(params.seed, point.pixel, params.replicate);
    var sum = 0.0;
    var done = 0u;
    for (var i = params.first_slice; i < params.first_slice + params.slices; i++) {
        sum += hbao_direction(point, pair(sampler, i, 0u));
        done++;
    }
    add(pixel, sum, done);
}
