//! Smaller images brought to the size of the view.

use super::Upsample;

/// An image of `size` at the size of a view. Pixels of both cover the same rectangle; where
/// the nearest pixel holds no number, there is none, and others without one have no weight.
pub(super) fn upsample(image: &[f32], size: [usize; 2], view: [usize; 2], how: Upsample) -> Vec<f32> {
    let columns: Vec<Between> = (0..view[0]).map(|x| Between::new(x, size[0], view[0])).collect();
    let mut out = Vec::with_capacity(view[0] * view[1]);
    for y in 0..view[1] {
        let row = Between::new(y, size[1], view[1]);
        for column in &columns {
            let nearest = image[row.nearest * size[0] + column.nearest];
            let known = how == Upsample::Bilinear && nearest.is_finite();
            out.push(if known { bilinear(image, size[0], column, &row) } else { nearest });
        }
    }
    out
}

/// Where the centre of a pixel of the view lies among those of the image, along one axis.
struct Between {
    nearest: usize,
    low: usize,
    high: usize,
    /// Weight of `high`; the rest is `low`'s.
    share: f32,
}

impl Between {
    fn new(at: usize, from: usize, to: usize) -> Self {
        let center = (at as f64 + 0.5) * from as f64 / to as f64;
        let last = from - 1;
        let place = (center - 0.5).clamp(0.0, last as f64);
        let low = (place as usize).min(last);
        Between { nearest: (center as usize).min(last), low, high: (low + 1).min(last), share: place.fract() as f32 }
    }
}

fn bilinear(image: &[f32], width: usize, column: &Between, row: &Between) -> f32 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (y, wy) in [(row.low, 1.0 - row.share), (row.high, row.share)] {
        for (x, wx) in [(column.low, 1.0 - column.share), (column.high, column.share)] {
            let value = image[y * width + x];
            if value.is_finite() {
                sum += value * wx * wy;
                weights += wx * wy;
            }
        }
    }
    sum / weights
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_repeats_pixels() {
        let up = upsample(&[1.0, 2.0, 3.0, 4.0], [2, 2], [4, 4], Upsample::Nearest);
        assert_eq!(up, [1., 1., 2., 2., 1., 1., 2., 2., 3., 3., 4., 4., 3., 3., 4., 4.]);
        // Five columns of three pixels: centres at 0.3, 0.9, 1.5, 2.1 and 2.7 pixels.
        assert_eq!(upsample(&[1.0, 2.0, 3.0], [3, 1], [5, 1], Upsample::Nearest), [1., 1., 2., 3., 3.]);
    }

    /// A ramp stays the ramp, but for the ends, which lie beyond the outermost centres.
    #[test]
    fn bilinear_keeps_ramps() {
        let (size, view) = ([6, 5], [12, 20]);
        let ramp = |x: f32, y: f32| 0.1 * x - 0.03 * y;
        let image: Vec<f32> = (0..30).map(|i| ramp((i % 6) as f32 + 0.5, (i / 6) as f32 + 0.5)).collect();
        let up = upsample(&image, size, view, Upsample::Bilinear);
        let mut checked = 0;
        for (i, value) in up.iter().enumerate() {
            let [x, y] = [((i % 12) as f32 + 0.5) / 2.0, ((i / 12) as f32 + 0.5) / 4.0];
            if (0.5..5.5).contains(&x) && (0.5..4.5).contains(&y) {
                assert!((value - ramp(x, y)).abs() < 1e-6, "{x}, {y}");
                checked += 1;
            }
        }
        assert_eq!(checked, 160);
        assert_eq!(up[0], image[0]);
    }

    #[test]
    fn holes_stay_holes_and_do_not_spread() {
        for how in [Upsample::Nearest, Upsample::Bilinear] {
            let up = upsample(&[1.0, f32::NAN, 1.0], [3, 1], [6, 1], how);
            assert_eq!(up.iter().map(|v| v.is_nan()).collect::<Vec<_>>(), [false, false, true, true, false, false]);
            assert_eq!([up[0], up[1], up[4], up[5]], [1.0; 4]);
        }
    }
}
