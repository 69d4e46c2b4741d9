//! Eight floats side by side: AVX2, or arrays that any compiler vectorises as far
//! as its target goes.
//!
//! All methods but `mul_add` and `mul_sub` round each operation, so both kinds give
//! the same bits. Those two are fused where the machine can: they may only stand
//! where rounding cannot change a decision (see `fan`).
//!
//! Everything is `inline(always)`, and no closure or `array::map` stands between a
//! walk and its lanes: those may be compiled on their own, without AVX2, and then
//! are called for each operation.

/// Lanes of eight floats.
pub trait Lanes: Copy {
    /// All lanes the same.
    fn splat(v: f32) -> Self;
    /// From memory.
    fn load(v: &[f32; 8]) -> Self;
    /// To memory.
    fn store(self, to: &mut [f32; 8]);
    /// `self + b`.
    fn add(self, b: Self) -> Self;
    /// `self - b`.
    fn sub(self, b: Self) -> Self;
    /// `self * b`.
    fn mul(self, b: Self) -> Self;
    /// `self / b`.
    fn div(self, b: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// `self * b + c`, fused or not.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// `self * b - c`, fused or not.
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// The smaller; `b` where either is NaN.
    fn min(self, b: Self) -> Self;
    /// The larger; `b` where either is NaN.
    fn max(self, b: Self) -> Self;
    /// Without sign.
    fn abs(self) -> Self;
    /// The sign bits alone.
    fn signs(self) -> Self;
    /// Bitwise exclusive or.
    fn xor(self, b: Self) -> Self;
    /// A bit a lane: `self <= b`; false for NaN.
    fn le(self, b: Self) -> u32;
    /// A bit a lane: both `a <= b` and `c <= d`.
    fn le2(a: Self, b: Self, c: Self, d: Self) -> u32;
    /// The smallest of all lanes, everywhere.
    #[inline(always)]
    fn least(self) -> Self {
        let mut v = [0.0; 8];
        self.store(&mut v);
        Self::splat(v.into_iter().fold(f32::INFINITY, f32::min))
    }
    /// The largest of all lanes, everywhere.
    #[inline(always)]
    fn greatest(self) -> Self {
        let mut v = [0.0; 8];
        self.store(&mut v);
        Self::splat(v.into_iter().fold(f32::NEG_INFINITY, f32::max))
    }
    /// Eight bits, each the lowest of a byte.
    #[inline(always)]
    fn spread(bits: u32) -> u64 {
        let b = u64::from(bits);
        (0..8).fold(0, |m, i| m | (b >> i & 1) << (8 * i))
    }
}

/// The portable kind.
#[derive(Clone, Copy)]
#[repr(align(32))]
pub struct Plain([f32; 8]);

impl Plain {
    #[inline(always)]
    #[allow(clippy::needless_range_loop)] // lanes
    fn zip(self, b: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = [0.0; 8];
        for i in 0..8 {
            out[i] = f(self.0[i], b.0[i]);
        }
        Plain(out)
    }
}

impl Lanes for Plain {
    #[inline(always)]
    fn splat(v: f32) -> Self {
        Plain([v; 8])
    }
    #[inline(always)]
    fn load(v: &[f32; 8]) -> Self {
        Plain(*v)
    }
    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self.zip(b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self.zip(b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self.zip(b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        self.zip(b, |a, b| a / b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.zip(self, |a, _| a.sqrt())
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self.mul(b).add(c)
    }
    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self.mul(b).sub(c)
    }
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        self.zip(b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        self.zip(b, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.zip(self, |a, _| a.abs())
    }
    #[inline(always)]
    fn signs(self) -> Self {
        self.zip(self, |a, _| f32::from_bits(a.to_bits() & 0x8000_0000))
    }
    #[inline(always)]
    fn xor(self, b: Self) -> Self {
        self.zip(b, |a, b| f32::from_bits(a.to_bits() ^ b.to_bits()))
    }
    #[inline(always)]
    fn le(self, b: Self) -> u32 {
        (0..8).fold(0, |m, i| m | u32::from(self.0[i] <= b.0[i]) << i)
    }
    #[inline(always)]
    fn le2(a: Self, b: Self, c: Self, d: Self) -> u32 {
        (0..8).fold(0, |m, i| m | u32::from((a.0[i] <= b.0[i]) & (c.0[i] <= d.0[i])) << i)
    }
}

/// Whether this machine has what the fast walks are compiled for.
pub fn has_avx2() -> bool {
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("popcnt");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

#[cfg(target_arch = "x86_64")]
pub use x86::Avx2;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::Lanes;
    use std::arch::x86_64::{
        __m256, _CMP_LE_OQ, _mm256_add_ps, _mm256_and_ps, _mm256_andnot_ps, _mm256_cmp_ps, _mm256_div_ps,
        _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_loadu_ps, _mm256_max_ps, _mm256_min_ps, _mm256_movemask_ps,
        _mm256_mul_ps, _mm256_set1_ps, _mm256_sqrt_ps, _mm256_storeu_ps, _mm256_sub_ps, _mm256_xor_ps, _pdep_u64,
    };

    /// AVX2 with FMA and BMI2. Its methods may only be called where the machine has
    /// all three: the walks are entered after [`super::has_avx2`] alone.
    #[derive(Clone, Copy)]
    pub struct Avx2(__m256);

    macro_rules! intrinsic {
        ($call:expr) => {
            // SAFETY: the machine has the instruction, or no `Avx2` would be used; what
            // is read and written is an array of eight floats, at any alignment. Tested
            // by `both_kinds_of_lanes_give_the_same_bits`.
            unsafe { $call }
        };
    }

    impl Lanes for Avx2 {
        #[inline(always)]
        fn splat(v: f32) -> Self {
            Avx2(intrinsic!(_mm256_set1_ps(v)))
        }
        #[inline(always)]
        fn load(v: &[f32; 8]) -> Self {
            Avx2(intrinsic!(_mm256_loadu_ps(v.as_ptr())))
        }
        #[inline(always)]
        fn store(self, to: &mut [f32; 8]) {
            intrinsic!(_mm256_storeu_ps(to.as_mut_ptr(), self.0));
        }
        #[inline(always)]
        fn add(self, b: Self) -> Self {
            Avx2(intrinsic!(_mm256_add_ps(self.0, b.0)))
        }
        #[inline(always)]
        fn sub(self, b: Self) -> Self {
            Avx2(intrinsic!(_mm256_sub_ps(self.0, b.0)))
        }
        #[inline(always)]
        fn mul(self, b: Self) -> Self {
            Avx2(intrinsic!(_mm256_mul_ps(self.0, b.0)))
        }
        #[inline(always)]
        fn div(self, b: Self) -> Self {
            Avx2(intrinsic!(_mm256_div_ps(self.0, b.0)))
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            Avx2(intrinsic!(_mm256_sqrt_ps(self.0)))
        }
        #[inline(always)]
        fn mul_add(self, b: Self, c: Self) -> Self {
            Avx2(intrinsic!(_mm256_fmadd_ps(self.0, b.0, c.0)))
        }
        #[inline(always)]
        fn mul_sub(self, b: Self, c: Self) -> Self {
            Avx2(intrinsic!(_mm256_fmsub_ps(self.0, b.0, c.0)))
        }
        #[inline(always)]
        fn min(self, b: Self) -> Self {
            Avx2(intrinsic!(_mm256_min_ps(self.0, b.0)))
        }
        #[inline(always)]
        fn max(self, b: Self) -> Self {
            Avx2(intrinsic!(_mm256_max_ps(self.0, b.0)))
        }
        #[inline(always)]
        fn abs(self) -> Self {
            Avx2(intrinsic!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
        }
        #[inline(always)]
        fn signs(self) -> Self {
            Avx2(intrinsic!(_mm256_and_ps(_mm256_set1_ps(-0.0), self.0)))
        }
        #[inline(always)]
        fn xor(self, b: Self) -> Self {
            Avx2(intrinsic!(_mm256_xor_ps(self.0, b.0)))
        }
        #[inline(always)]
        fn le(self, b: Self) -> u32 {
            intrinsic!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, b.0)) as u32)
        }
        #[inline(always)]
        fn le2(a: Self, b: Self, c: Self, d: Self) -> u32 {
            intrinsic!({
                let x = _mm256_cmp_ps::<_CMP_LE_OQ>(a.0, b.0);
                let y = _mm256_cmp_ps::<_CMP_LE_OQ>(c.0, d.0);
                _mm256_movemask_ps(_mm256_and_ps(x, y)) as u32
            })
        }
        #[inline(always)]
        fn spread(bits: u32) -> u64 {
            intrinsic!(_pdep_u64(u64::from(bits), 0x0101_0101_0101_0101))
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_of_lanes_give_the_same_bits() {
        /// What each operation makes of two vectors, bits and masks.
        #[inline(always)]
        fn all<L: Lanes>(a: &[f32; 8], b: &[f32; 8]) -> Vec<u64> {
            let (x, y) = (L::load(a), L::load(b));
            let made = [
                x.add(y),
                x.sub(y),
                x.mul(y),
                x.div(y),
                x.sqrt(),
                x.min(y),
                x.max(y),
                x.abs(),
                x.signs(),
                x.xor(y),
                x.least(),
                x.greatest(),
                L::splat(a[3]),
            ];
            let mut bits = vec![u64::from(x.le(y)), u64::from(L::le2(x, y, y, x)), L::spread(x.le(y))];
            for lanes in made {
                let mut v = [0.0; 8];
                lanes.store(&mut v);
                // Which NaN it is nobody asks.
                bits.extend(v.map(|v| if v.is_nan() { u64::MAX } else { u64::from(v.to_bits()) }));
            }
            bits
        }
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt")]
        fn wide(a: &[f32; 8], b: &[f32; 8]) -> Vec<u64> {
            all::<Avx2>(a, b)
        }
        if !has_avx2() {
            return;
        }
        let odd = [0.0, -0.0, 1.0, -1.5, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MIN_POSITIVE, 1e-41, 3e38];
        for i in 0..10_000usize {
            let at = |k: usize| {
                let n = crate::render::sampler::hash((16 * i + k) as u32);
                if n.is_multiple_of(3) { odd[n as usize / 3 % odd.len()] } else { f32::from_bits(n.rotate_left(7)) }
            };
            let (a, b) = (std::array::from_fn(at), std::array::from_fn(|k| at(k + 8)));
            // SAFETY: the machine has what `wide` is compiled for.
            assert_eq!(unsafe { wide(&a, &b) }, all::<Plain>(&a, &b), "{a:?} {b:?}");
        }
    }
}
