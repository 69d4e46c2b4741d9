// GTAO, slice by slice. Twin: render/screen_space/gtao.rs.

fn arc_cosine(x: f32) -> f32 {
    let a = abs(x);
    var p = 0.00667009 + a * -0.0012624911;
    p = 0.03089188 + a * (-0.017088126 + a * p);
    p = 0.08897899 + a * (-0.050174303 + a * p);
    p = 1.57079632679489661923 + a * (-0.2145988 + a * p);
    let angle = sqrt(max(1.0 - a, 0.0)) * p;
    return select(angle, 3.14159265358979323846 - angle, x < 0.0);
}

fn gtao_horizon(point: Point, direction: vec3<f32>, jitter: f32, lowest: f32) -> f32 {
    let on = way(point, direction);
    var highest = lowest;
    for (var j = 0u; j < params.steps; j++) {
        let seen = horizon(point, on, sample_place(j, jitter));
        if seen.seen {
            highest = max(highest, lowest + (seen.cosine - lowest) * seen.weight);
        }
    }
    return highest;
}

fn arc(cosine: f32, side: f32, cos_g: f32, sin_g: f32) -> f32 {
    let h = side * arc_cosine(cosine);
    let sine = side * sqrt(max(1.0 - cosine * cosine, 0.0));
    let cos_2h = 2.0 * cosine * cosine - 1.0;
    let sin_2h = 2.0 * sine * cosine;
    return 0.25 * (cos_g - (cos_2h * cos_g + sin_2h * sin_g) + 2.0 * h * sin_g);
}

const SECTORS = 32u;

// Where the angle of this cosine lies, in sectors.
fn sector(cosine: f32, side: f32, g: f32) -> f32 {
    let share = (side * arc_cosine(cosine) - g) * 0.318309886183790671538 + 0.5;
    return clamp(share, 0.0, 1.0) * f32(SECTORS);
}

fn below(n: u32) -> u32 {
    if n >= SECTORS {
        return 0xffffffffu;
    }
    return (1u << n) - 1u;
}

// The sectors whose middles lie between two places.
fn between(a: f32, b: f32) -> u32 {
    let start = u32(max(ceil(min(a, b) - 0.5), 0.0));
    let end = u32(floor(max(a, b) + 0.5));
    return select(0u, below(end) & ~below(start), end > start);
}

fn sectors(point: Point, direction: vec3<f32>, side: f32, g: f32, jitter: f32) -> u32 {
    let on = way(point, direction);
    var closed = 0u;
    for (var j = 0u; j < params.steps; j++) {
        let seen = horizon(point, on, sample_place(j, jitter));
        if seen.seen {
            let back = cosine_of(point, behind(point, seen.there, params.thickness));
            closed |= between(sector(seen.cosine, side, g), sector(back, side, g));
        }
    }
    return closed;
}

fn integral(k: u32, g: f32, cos_g: f32, sin_g: f32) -> f32 {
    let share = f32(k) / f32(SECTORS);
    let h = g + (share - 0.5) * 3.14159265358979323846;
    let at = turn(share);
    let half = 0.25 * (cos_g + (cos_g * at.x - sin_g * at.y) + 2.0 * h * sin_g);
    return select(abs(half), -abs(half), h < 0.0);
}

// How open the sectors are that nothing closes.
fn open(closed: u32, g: f32, cos_g: f32, sin_g: f32) -> f32 {
    var sum = 0.0;
    var start = integral(0u, g, cos_g, sin_g);
    for (var k = 0u; k < SECTORS; k++) {
        let end = integral(k + 1u, g, cos_g, sin_g);
        if ((closed >> k) & 1u) == 0u {
            sum += end - start;
        }
        start = end;
    }
    return sum;
}

fn gtao_slice(point: Point, place: vec2<f32>) -> f32 {
    let direction = across(point, 0.5 * place.x);
    let along = dot(point.normal, direction);
    let towards = dot(point.normal, point.to_eye);
    let length = sqrt(along * along + towards * towards);
    if length < 1e-6 {
        return 0.0;
    }
    let cos_g = towards / length;
    let sin_g = along / length;
    if params.thickness > 0.0 {
        let angle = arc_cosine(cos_g);
        let g = select(angle, -angle, sin_g < 0.0);
        let closed = sectors(point, direction, 1.0, g, place.y) | sectors(point, -direction, -1.0, g, place.y);
        return length * open(closed, g, cos_g, sin_g);
    }
    let forth = gtao_horizon(point, direction, place.y, -sin_g);
    let back = gtao_horizon(point, -direction, place.y, sin_g);
    return length * (arc(forth, 1.0, cos_g, sin_g) + arc(back, -1.0, cos_g, sin_g));
}

@compute @workgroup_size(64)
fn gtao(@builtin(global_invocation_id) id: vec3<u32>) {
    let pixel = params.first_pixel + id.x;
    if id.x >= params.pixels || gathered[pixel] == UNSEEN {
        return;
    }
    let point = new_point(gathered[pixel]);
    let sampler = sampler_seed(params.seed, point.pixel, params.replicate);
    var sum = 0.0;
    var done = 0u;
    for (var i = params.first_slice; i < params.first_slice + params.slices; i++) {
        sum += gtao_slice(point, pair(sampler, i, 0u));
        done++;
    }
    add(pixel, sum, done);
}
