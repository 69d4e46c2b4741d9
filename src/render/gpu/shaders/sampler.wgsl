// One sampler for the CPU and the GPU. Twin: render/sampler.rs, which says where
// it comes from.

fn hash(value: u32) -> u32 {
    var x = value;
    x ^= x >> 16u;
    x *= 0x7feb352du;
    x ^= x >> 15u;
    x *= 0x846ca68bu;
    return x ^ (x >> 16u);
}

fn combine(a: u32, b: u32) -> u32 {
    return hash(a ^ hash(b + 0x9e3779b9u));
}

fn owen_scramble(value: u32, seed: u32) -> u32 {
    var x = reverseBits(value);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverseBits(x);
}

fn sobol(index: u32) -> vec2<u32> {
    var y = index;
    y ^= (y & 0xffff0000u) >> 16u;
    y ^= (y & 0xff00ff00u) >> 8u;
    y ^= (y & 0xf0f0f0f0u) >> 4u;
    y ^= (y & 0xccccccccu) >> 2u;
    y ^= (y & 0xaaaaaaaau) >> 1u;
    return vec2<u32>(reverseBits(index), reverseBits(y));
}

fn sampler_seed(seed: u32, pixel: u32, replicate: u32) -> u32 {
    return combine(combine(seed, replicate), pixel);
}

fn pair(sampler: u32, index: u32, dimension: u32) -> vec2<f32> {
    let seed = combine(sampler, dimension);
    let point = sobol(owen_scramble(index, seed));
    let x = owen_scramble(point.x, hash(seed ^ 0x68bc21ebu));
    let y = owen_scramble(point.y, hash(seed ^ 0x02e5be93u));
    return vec2<f32>(f32(x >> 8u), f32(y >> 8u)) * 0x1p-24f;
}

// Cosine and sine of 2 pi v, by the CPU's polynomial.
fn turn(v: f32) -> vec2<f32> {
    let quarters = v * 4.0;
    let quadrant = floor(quarters + 0.5);
    let x = (quarters - quadrant) * 1.57079632679489661923;
    let x2 = x * x;
    let s = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362880.0)))));
    let c = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40320.0))));
    switch u32(quadrant) & 3u {
        case 0u: { return vec2<f32>(c, s); }
        case 1u: { return vec2<f32>(-s, c); }
        case 2u: { return vec2<f32>(-c, -s); }
        default: { return vec2<f32>(s, -c); }
    }
}
