//! One sampler for the CPU and the GPU: Owen-scrambled Sobol points, seeded by
//! pixel and replicate. Twin: `gpu/shaders/sampler.wgsl`.
//!
//! Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020, with the
//! Laine-Karras permutation in the constants that Vegdahl found in 2021. Higher
//! dimensions are padded: each pair of dimensions is the first pair of the Sobol
//! sequence under a shuffle and a scramble of its own. All of it is integer
//! arithmetic, so both sides draw the same samples to the last bit.

/// Wellons' `lowbias32`: a bijection of 32 bits with low bias.
#[inline(always)]
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A hash of two numbers in order.
#[inline(always)]
pub fn combine(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b.wrapping_add(0x9e37_79b9)))
}

/// Nested uniform (Owen) scramble of a 32-bit fraction.
#[inline(always)]
pub fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits();
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// Point `index` of the first two Sobol dimensions, as 32-bit fractions. The
/// second generator matrix is Pascal's triangle modulo 2, so five shifts do what
/// 32 table look-ups would.
#[inline(always)]
pub fn sobol(index: u32) -> [u32; 2] {
    let mut y = index;
    y ^= (y & 0xffff_0000) >> 16;
    y ^= (y & 0xff00_ff00) >> 8;
    y ^= (y & 0xf0f0_f0f0) >> 4;
    y ^= (y & 0xcccc_cccc) >> 2;
    y ^= (y & 0xaaaa_aaaa) >> 1;
    [index.reverse_bits(), y.reverse_bits()]
}

/// What tells the scrambles of a pair's two numbers apart.
const SALTS: [u32; 2] = [0x68bc_21eb, 0x02e5_be93];

/// The random numbers of one pixel in one replicate.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    seed: u32,
}

impl Sampler {
    /// `seed` is the run's, `pixel` counts row by row from the top left.
    pub fn new(seed: u32, pixel: u32, replicate: u32) -> Self {
        Sampler { seed: combine(combine(seed, replicate), pixel) }
    }

    /// Two numbers in [0, 1) for sample `index`, as multiples of 2^-24. Each
    /// `dimension` is a pair of its own.
    #[inline]
    pub fn pair(&self, index: u32, dimension: u32) -> [f32; 2] {
        let seed = combine(self.seed, dimension);
        let shuffled = owen_scramble(index, seed);
        let [x, y] = sobol(shuffled);
        [owen_scramble(x, hash(seed ^ SALTS[0])), owen_scramble(y, hash(seed ^ SALTS[1]))]
            .map(|v| (v >> 8) as f32 * 2.0f32.powi(-24))
    }

    /// [`Self::pair`] of eight samples from `first` on, side by side: for a compiler to
    /// turn into SIMD. The same bits.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // lanes
    pub(super) fn pairs(&self, first: u32, dimension: u32) -> [[f32; 8]; 2] {
        let seed = combine(self.seed, dimension);
        let seeds = SALTS.map(|salt| hash(seed ^ salt));
        let mut pairs = [[0.0; 8]; 2];
        for lane in 0..8 {
            let point = sobol(owen_scramble(first.wrapping_add(lane as u32), seed));
            for axis in 0..2 {
                // Below 2^24, so that it fits a signed number, which is quicker to convert.
                let bits = (owen_scramble(point[axis], seeds[axis]) >> 8) as i32;
                pairs[axis][lane] = bits as f32 * 2.0f32.powi(-24);
            }
        }
        pairs
    }

    /// [`Self::pair`] of the first `count` of many samplers, each at a sample of its own, side
    /// by side like [`Self::pairs`]. The same bits.
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // lanes
    pub(super) fn pairs_of<const N: usize>(
        samplers: &[Sampler; N],
        samples: &[u32; N],
        count: usize,
        dimension: u32,
        [x, y]: &mut [[f32; N]; 2],
    ) {
        let salt = hash(dimension.wrapping_add(0x9e37_79b9));
        for lane in 0..count.min(N) {
            let seed = hash(samplers[lane].seed ^ salt);
            let [a, b] = sobol(owen_scramble(samples[lane], seed));
            x[lane] = (owen_scramble(a, hash(seed ^ SALTS[0])) >> 8) as i32 as f32 * 2.0f32.powi(-24);
            y[lane] = (owen_scramble(b, hash(seed ^ SALTS[1])) >> 8) as i32 as f32 * 2.0f32.powi(-24);
        }
    }
}

/// Cosine and sine of 2 pi v for v in [0, 1), by one polynomial on both sides:
/// the sine and cosine of GPUs are too loose. Error below 2e-7.
#[inline(always)]
pub fn turn(v: f32) -> [f32; 2] {
    let quarters = v * 4.0;
    // Not `floor`, which is a call on machines without SSE 4.1.
    let quadrant = (quarters + 0.5) as i32;
    let x = (quarters - quadrant as f32) * std::f32::consts::FRAC_PI_2;
    let x2 = x * x;
    let s = x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362_880.0)))));
    let c = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40_320.0))));
    // [c, s], [-s, c], [-c, -s], [s, -c], without a branch.
    let (cosine, sine) = if quadrant & 1 == 1 { (s, c) } else { (c, s) };
    let sign = |v: f32, turned: i32| f32::from_bits(v.to_bits() ^ (turned as u32 & 2) << 30);
    [sign(cosine, quadrant + 1), sign(sine, quadrant)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ChiSquared, ContinuousCDF};

    #[test]
    fn sobol_matches_its_direction_numbers() {
        // Second dimension: v_1 = 1/2, v_k = v_{k-1} xor (v_{k-1} >> 1).
        let mut v = vec![1u32 << 31];
        for k in 1..32 {
            v.push(v[k - 1] ^ (v[k - 1] >> 1));
        }
        for index in (0..2000u32).chain([0xdead_beef, u32::MAX]) {
            let y = (0..32).filter(|k| index >> k & 1 == 1).fold(0, |y, k| y ^ v[k as usize]);
            assert_eq!(sobol(index), [index.reverse_bits(), y], "{index}");
        }
    }

    #[test]
    fn the_first_2_to_the_k_points_fill_every_elementary_interval() {
        for k in [4u32, 6, 8] {
            let n = 1u32 << k;
            let sampler = Sampler::new(3, 17, 5);
            for split in 0..=k {
                let mut seen = vec![false; n as usize];
                for i in 0..n {
                    let [x, y] = sampler.pair(i, 2);
                    let cell = ((x * (1u32 << split) as f32) as u32) << (k - split)
                        | (y * (1u32 << (k - split)) as f32) as u32;
                    assert!(!std::mem::replace(&mut seen[cell as usize], true), "k {k}, split {split}");
                }
            }
        }
    }

    /// Chi-square test over 256 cells at alpha = 1e-4 with fixed seeds: pixels,
    /// replicates and dimensions are each uniform.
    #[test]
    fn pixels_replicates_and_dimensions_are_uniform_and_apart() {
        type Draw = fn(u32) -> [f32; 2];
        let draws: [Draw; 4] = [
            |i| Sampler::new(1, i, 0).pair(0, 0),
            |i| Sampler::new(1, 0, i).pair(0, 0),
            |i| Sampler::new(1, 0, 0).pair(0, i),
            |i| [Sampler::new(1, i, 0).pair(3, 0)[0], Sampler::new(1, i, 1).pair(3, 0)[0]],
        ];
        for (which, draw) in draws.iter().enumerate() {
            let n = 65_536u32;
            let mut cells = [0u32; 256];
            for i in 0..n {
                let [x, y] = draw(i);
                cells[(x * 16.0) as usize * 16 + (y * 16.0) as usize] += 1;
            }
            let expected = f64::from(n) / 256.0;
            let chi2: f64 = cells.iter().map(|&c| (f64::from(c) - expected).powi(2) / expected).sum();
            let p = ChiSquared::new(255.0).unwrap().sf(chi2);
            assert!(p > 1e-4, "draw {which}: chi2 {chi2}, p {p}");
        }
    }

    #[test]
    fn turn_is_cosine_and_sine() {
        for i in 0..10_000 {
            let v = i as f32 / 10_000.0;
            let [c, s] = turn(v);
            let angle = std::f64::consts::TAU * f64::from(v);
            assert!((f64::from(c) - angle.cos()).abs() < 3e-7, "{v}");
            assert!((f64::from(s) - angle.sin()).abs() < 3e-7, "{v}");
        }
    }
}
