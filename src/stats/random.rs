//! A small generator of random numbers for resampling and simulation.

/// SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number
/// Generators", OOPSLA 2014): a counter of odd steps through a mixer. 64-bit numbers
/// of period 2^64, alike on every machine. For statistics, not for secrets.
///
/// ```
/// # use aogauge::stats::SplitMix64;
/// let mut random = SplitMix64(1_234_567);
/// assert_eq!(random.bits(), 6_457_827_717_110_365_317);
/// ```
#[derive(Clone, Debug)]
pub struct SplitMix64(
    /// The state: any seed will do.
    pub u64,
);

impl SplitMix64 {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in (0, 1), both ends left out.
    pub fn uniform(&mut self) -> f64 {
        ((self.bits() >> 12) as f64 + 0.5) / (1u64 << 52) as f64
    }

    /// One of 0 to n - 1, each with a chance of 1/n to within 2^-64; 0 for n of 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sequence of the seed 1234567, which implementations agree on.
    #[test]
    fn the_sequence_is_the_known_one() {
        let mut random = SplitMix64(1_234_567);
        let known = [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423];
        assert_eq!(known.map(|_| random.bits()), known);
    }

    #[test]
    fn numbers_stay_in_range() {
        let mut random = SplitMix64(1);
        assert!((0..1000).map(|_| random.uniform()).all(|u| 0.0 < u && u < 1.0));
        let mut seen = [0; 3];
        (0..3000).for_each(|_| seen[random.below(3)] += 1);
        // 4 standard errors of a binomial count are 103.
        assert!(seen.iter().all(|n| (897..=1103).contains(n)), "{seen:?}");
        assert_eq!(random.below(0), 0);
    }
}
