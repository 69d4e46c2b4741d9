//! Adaptive Gauss-Kronrod quadrature in one dimension.

use std::{cmp::Ordering, collections::BinaryHeap};

/// Kronrod's 15 nodes (the half that is not negative) with their weights, and
/// Gauss's weights at every other of them.
const NODES: [[f64; 3]; 8] = [
    [0.991_455_371_120_812_6, 0.022_935_322_010_529_224, 0.0],
    [0.949_107_912_342_758_5, 0.063_092_092_629_978_56, 0.129_484_966_168_869_7],
    [0.864_864_423_359_769_1, 0.104_790_010_322_250_18, 0.0],
    [0.741_531_185_599_394_4, 0.140_653_259_715_525_92, 0.279_705_391_489_276_64],
    [0.586_087_235_467_691_1, 0.169_004_726_639_267_9, 0.0],
    [0.405_845_151_377_397_2, 0.190_350_578_064_785_4, 0.381_830_050_505_118_9],
    [0.207_784_955_007_898_47, 0.204_432_940_075_298_89, 0.0],
    [0.0, 0.209_482_141_084_727_82, 0.417_959_183_673_469_4],
];

/// Panels at most: a bound on time where the integrand is rough.
const PANELS: usize = 4000;

struct Panel {
    from: f64,
    to: f64,
    value: f64,
    error: f64,
}

impl Panel {
    fn new(f: &impl Fn(f64) -> f64, from: f64, to: f64) -> Self {
        let (middle, half) = ((from + to) / 2.0, (to - from) / 2.0);
        let (mut kronrod, mut gauss) = (0.0, 0.0);
        for [x, k, g] in NODES {
            let both = if x == 0.0 { f(middle) } else { f(middle - half * x) + f(middle + half * x) };
            kronrod += k * both;
            gauss += g * both;
        }
        Panel { from, to, value: half * kronrod, error: half * (kronrod - gauss).abs() }
    }
}

impl PartialEq for Panel {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Panel {}
impl PartialOrd for Panel {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Panel {
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(self.from.total_cmp(&other.from))
    }
}

/// Integral of `f` over [from, to] by one rule of 15 points.
pub fn panel(f: impl Fn(f64) -> f64, from: f64, to: f64) -> f64 {
    Panel::new(&f, from, to).value
}

/// Integral of `f` over [from, to], halved again and again where it is least
/// certain, until `tolerance` is met over all.
///
/// A panel's error is taken as the difference of its two rules, but as no less
/// than a quarter of what its parent was off by: at a kink the rules may agree by
/// accident, seldom twice.
pub fn integrate(f: impl Fn(f64) -> f64, from: f64, to: f64, tolerance: f64) -> f64 {
    if to <= from {
        return 0.0;
    }
    let mut heap = BinaryHeap::from([Panel { error: f64::INFINITY, ..Panel::new(&f, from, to) }]);
    while heap.len() < PANELS {
        // Summed anew: a running sum would keep the rounding of large errors gone.
        if heap.iter().map(|p| p.error).sum::<f64>() <= tolerance {
            break;
        }
        let Some(worst) = heap.pop() else { break };
        let middle = (worst.from + worst.to) / 2.0;
        let mut halves = [Panel::new(&f, worst.from, middle), Panel::new(&f, middle, worst.to)];
        let off = (halves[0].value + halves[1].value - worst.value).abs();
        for half in &mut halves {
            half.error = half.error.max(off / 4.0);
        }
        heap.extend(halves);
    }
    heap.iter().map(|p| p.value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_integrals() {
        let near = |value: f64, expected: f64, off: f64| assert!((value - expected).abs() < off, "{value}, {expected}");
        near(integrate(f64::exp, 0.0, 1.0, 1e-12), 1f64.exp() - 1.0, 1e-14);
        near(integrate(f64::sqrt, 0.0, 1.0, 1e-8), 2.0 / 3.0, 1e-8);
        near(integrate(|x| (x - 0.3).abs(), 0.0, 1.0, 1e-8), 0.045 + 0.245, 1e-8);
        near(integrate(|x| f64::from(u8::from(x > 0.3)), 0.0, 1.0, 1e-8), 0.7, 1e-8);
        near(integrate(|x| x, 1.0, 0.0, 1e-8), 0.0, 1e-15);
    }
}
