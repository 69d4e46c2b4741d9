//! Pairs of pixels of an image and a reference, and what they have in common.

/// Sums over the pixels where both hold a number.
pub(super) struct Samples {
    n: f64,
    means: [f64; 2],
    /// Variance of the image, of the reference, and their covariance.
    moments: [f64; 3],
    range: [f32; 2],
    first: f32,
}

impl Samples {
    pub(super) fn new(image: &[f32], reference: &[f32]) -> Self {
        Samples::of(image.iter().copied().zip(reference.iter().copied()))
    }

    pub(super) fn of(pairs: impl Iterator<Item = (f32, f32)> + Clone) -> Self {
        let known = pairs.filter(|(a, b)| a.is_finite() && b.is_finite());
        let (mut n, mut sums) = (0.0, [0.0; 2]);
        let (mut range, mut first) = ([f32::INFINITY, f32::NEG_INFINITY], f32::NAN);
        for (a, b) in known.clone() {
            (n, sums) = (n + 1.0, [sums[0] + f64::from(a), sums[1] + f64::from(b)]);
            range = [range[0].min(a), range[1].max(a)];
            if first.is_nan() {
                first = a;
            }
        }
        let means = sums.map(|s| s / f64::max(n, 1.0));
        let mut moments = [0.0; 3];
        for (a, b) in known {
            let [a, b] = [f64::from(a) - means[0], f64::from(b) - means[1]];
            moments = [moments[0] + a * a, moments[1] + b * b, moments[2] + a * b];
        }
        Samples { n, means, moments: moments.map(|m| m / f64::max(n, 1.0)), range, first }
    }

    pub(super) fn pairs(&self) -> usize {
        self.n as usize
    }

    /// The image's value where its range is below 1e-4 though the reference deviates by more
    /// than 0.01.
    pub(super) fn constant(&self) -> Option<f32> {
        let flat = f64::from(self.range[1] - self.range[0]) < 1e-4;
        (flat && self.moments[1].sqrt() > VARIED).then_some(self.first)
    }

    /// Pearson's, 0 where one of them does not vary.
    pub(super) fn correlation(&self) -> f64 {
        let [a, b, both] = self.moments;
        let both = both / (a * b).sqrt();
        if both.is_finite() { both } else { 0.0 }
    }

    /// Covariance of image and reference.
    pub(super) fn covariance(&self) -> f64 {
        self.moments[2]
    }

    /// Standard deviation of the reference.
    pub(super) fn deviation(&self) -> f64 {
        self.moments[1].sqrt()
    }

    /// Mean of the reference.
    pub(super) fn reference_mean(&self) -> f64 {
        self.means[1]
    }

    /// What is added to the reference on average.
    pub(super) fn offset(&self) -> f64 {
        self.means[0] - self.means[1]
    }

    /// Mean of the image.
    pub(super) fn mean(&self) -> f64 {
        self.means[0]
    }
}

/// A reference whose deviation is below this has nothing to be compared by.
pub(super) const VARIED: f64 = 0.01;

/// Neighbours whose noise is independent: right, below, and both diagonals.
const NEIGHBOURS: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [-1, 1]];

/// The mean square of what an image differs by, without its noise, and the standard error that
/// noise leaves it: mean products of neighbouring pixels. The noise of two pixels is
/// independent, so that on average products have none of it; what differs over more than a
/// pixel stays.
pub(super) fn square(difference: &[f32], width: usize) -> [f64; 2] {
    let rows = (difference.len() / width.max(1)) as isize;
    let at = |x: isize, y: isize| {
        let inside = x >= 0 && (x as usize) < width && y < rows;
        if inside { f64::from(difference[y as usize * width + x as usize]) } else { f64::NAN }
    };
    let ([mut products, mut squares], [mut n, mut pixels]) = ([0.0; 2], [0.0; 2]);
    for y in 0..rows {
        for x in 0..width as isize {
            let own = at(x, y);
            if !own.is_finite() {
                continue;
            }
            (squares, pixels) = (squares + own * own, pixels + 1.0);
            for product in NEIGHBOURS.map(|[dx, dy]| own * at(x + dx, y + dy)).into_iter().filter(|p| p.is_finite()) {
                (products, n) = (products + product, n + 1.0);
            }
        }
    }
    if n == 0.0 {
        return [0.0, f64::INFINITY];
    }
    let (signal, all) = (products / n, squares / pixels);
    // The product of two independent values of this variance.
    [signal, (all - signal).max(0.0) / n.sqrt()]
}
