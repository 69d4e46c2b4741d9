//! Intensity and power of engines, found on scenes that every method should agree on, and
//! undone.

/// A curve that openness was sent through: `gain * openness ^ exponent`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Curve {
    /// Above 0.
    pub gain: f64,
    /// Above 0.
    pub exponent: f64,
    /// Standard error of `exponent`, from the noise of pixels; 0 of a declared curve.
    pub error: f64,
    /// How far images are from their references, root mean square over classes of equal
    /// openness, so that noise averages out; 0 of a declared curve.
    pub before: f64,
    /// The same with the curve undone.
    pub after: f64,
}

/// Exponents that are looked for.
const EXPONENTS: [f64; 2] = [0.1, 10.0];
/// Classes of equal openness.
const CLASSES: usize = 64;
/// A reference must vary so much in openness, and an exponent be known so well, that there is
/// a curve to tell: standard deviation, and relative standard error.
const VARIED: f64 = 0.02;
const KNOWN: f64 = 0.1;

/// Finds the curve by which images, `0`, come from the openness of their references, `1`, over
/// all pixels where both are numbers. Values are openness and not occlusion.
///
/// Of the curves with exponents from 0.1 to 10 the one is taken that, undone, brings the mean
/// of the pixels of equal reference openness nearest to it (least squares). So noise that was in openness before
/// the curve, as engines have it, does not bend the result, and noise that was added after it
/// by little. None where it cannot be told: references that hardly vary (standard deviation
/// below 0.02), images of one ray (0 and 1 are the same to any power), fewer than 64 pixels, or
/// an exponent that stays unsure by more than a tenth.
pub fn fit_curve(pairs: &[(&[f32], &[f32])]) -> Option<Curve> {
    Curve::fit(pairs)
}

/// Pixels of nearly equal reference openness.
struct Class {
    reference: f64,
    values: Vec<f64>,
}

/// What one exponent comes to.
struct Trial {
    /// Gain that suits it best, as a factor of the undone values.
    factor: f64,
    square: f64,
    /// Mean of the undone values of each class, times the factor.
    means: Vec<f64>,
}

impl Curve {
    /// No curve.
    pub const IDENTITY: Curve = Curve { gain: 1.0, exponent: 1.0, error: 0.0, before: 0.0, after: 0.0 };

    /// [`fit_curve`].
    pub(super) fn fit(pairs: &[(&[f32], &[f32])]) -> Option<Curve> {
        let classes = classes(pairs)?;
        let log = nearest(|log| trial(&classes, log.exp(), None).square)?;
        let best = trial(&classes, log.exp(), None);
        let error = error(&classes, log, &best)?;
        let exponent = log.exp();
        let gain = best.factor.powf(-exponent);
        let plain = |c: &Class| c.values.len() as f64 * (mean(&c.values) - c.reference).powi(2);
        let pixels = classes.iter().map(|c| c.values.len() as f64).sum::<f64>();
        let before = (classes.iter().map(plain).sum::<f64>() / pixels).sqrt();
        let known = error <= KNOWN && gain.is_finite() && gain > 0.0;
        known.then_some(Curve { gain, exponent, error: error * exponent, before, after: best.square.sqrt() })
    }

    /// The exponent alone, of a curve without gain, that brings images nearest to their references, as
    /// [`fit_curve`]. None where references hardly vary, or where fewer than 64 pixels are known.
    pub(super) fn power(pairs: &[(&[f32], &[f32])]) -> Option<f64> {
        let classes = classes(pairs)?;
        nearest(|log| trial(&classes, log.exp(), Some(1.0)).square).map(f64::exp)
    }

    /// Openness before the curve. Values below 0 become 0; nothing is clamped above.
    pub fn undo(&self, image: &[f32]) -> Vec<f32> {
        let undone = |v: f32| (f64::from(v).max(0.0) / self.gain).powf(1.0 / self.exponent) as f32;
        image.iter().map(|&v| if v.is_finite() { undone(v) } else { v }).collect()
    }

    /// Openness through the curve.
    pub fn apply(&self, openness: &[f32]) -> Vec<f32> {
        let through = |v: f32| (self.gain * f64::from(v).max(0.0).powf(self.exponent)) as f32;
        openness.iter().map(|&v| if v.is_finite() { through(v) } else { v }).collect()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn classes(pairs: &[(&[f32], &[f32])]) -> Option<Vec<Class>> {
    let known = || {
        let all = pairs.iter().flat_map(|(image, reference)| image.iter().zip(*reference));
        all.filter(|(a, b)| a.is_finite() && b.is_finite()).map(|(a, b)| (f64::from(*a), f64::from(*b)))
    };
    let (n, sum, squares) = known().fold((0.0, 0.0, 0.0), |(n, s, q), (_, b)| (n + 1.0, s + b, q + b * b));
    if n < CLASSES as f64 || (squares / n - (sum / n).powi(2)).max(0.0).sqrt() < VARIED {
        return None;
    }
    let (low, high) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (_, b)| (l.min(b), h.max(b)));
    let mut found: Vec<(f64, Vec<f64>)> = (0..CLASSES).map(|_| (0.0, Vec::new())).collect();
    for (a, b) in known() {
        let class = ((b - low) / (high - low) * CLASSES as f64) as usize;
        let class = &mut found[class.min(CLASSES - 1)];
        class.0 += b;
        class.1.push(a);
    }
    let filled = found.into_iter().filter(|(_, values)| !values.is_empty());
    Some(filled.map(|(sum, values)| Class { reference: sum / values.len() as f64, values }).collect())
}

/// The logarithm of the exponent that leaves least.
fn nearest(left: impl Fn(f64) -> f64) -> Option<f64> {
    let [low, high] = EXPONENTS.map(f64::ln);
    let step = (high - low) / 40.0;
    let grid = (0..=40).map(|i| low + step * f64::from(i));
    let start = grid.map(|log| (log, left(log))).reduce(|a, b| if b.1 < a.1 { b } else { a })?.0;
    Some(smallest([(start - step).max(low), (start + step).min(high)], left))
}

/// `known` is the factor where it is not looked for.
fn trial(classes: &[Class], exponent: f64, known: Option<f64>) -> Trial {
    let undone =
        |c: &Class| c.values.iter().map(|v| v.max(0.0).powf(1.0 / exponent)).sum::<f64>() / c.values.len() as f64;
    let mut means: Vec<f64> = classes.iter().map(undone).collect();
    let weigh = |f: &dyn Fn(f64, f64) -> f64| {
        classes.iter().zip(&means).map(|(c, m)| c.values.len() as f64 * f(*m, c.reference)).sum::<f64>()
    };
    let factor = known.unwrap_or_else(|| weigh(&|m, r| m * r) / weigh(&|m, _| m * m));
    let square = weigh(&|m, r| (factor * m - r).powi(2)) / weigh(&|_, _| 1.0);
    means.iter_mut().for_each(|m| *m *= factor);
    Trial { factor, square: if square.is_finite() { square } else { f64::INFINITY }, means }
}

/// Golden section search.
fn smallest([mut low, mut high]: [f64; 2], f: impl Fn(f64) -> f64) -> f64 {
    let golden = (5.0f64.sqrt() - 1.0) / 2.0;
    for _ in 0..24 {
        let [a, b] = [high - golden * (high - low), low + golden * (high - low)];
        if f(a) < f(b) {
            high = b;
        } else {
            low = a;
        }
    }
    (low + high) / 2.0
}

/// Standard error of the exponent's logarithm, by how much it moves the means of the classes,
/// against the noise of their pixels.
fn error(classes: &[Class], log: f64, best: &Trial) -> Option<f64> {
    const STEP: f64 = 0.02;
    let [less, more] = [-STEP, STEP].map(|d| trial(classes, (log + d).exp(), None));
    let slope = |i: usize| (more.means[i] - less.means[i]) / (2.0 * STEP);
    let exponent = log.exp();
    let (mut information, mut noise) = (0.0, 0.0);
    for (i, class) in classes.iter().enumerate() {
        let n = class.values.len() as f64;
        let apart = |v: &f64| (best.factor * v.max(0.0).powf(1.0 / exponent) - best.means[i]).powi(2);
        information += n * slope(i).powi(2);
        noise += slope(i).powi(2) * n * (class.values.iter().map(apart).sum::<f64>() / n + best.square);
    }
    let error = noise.sqrt() / information;
    error.is_finite().then_some(error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        render::{Estimator, Geometry, Job, Renderer, cpu::Cpu},
        scenes::library,
    };

    /// Images of the control scenes with `rays` rays, and their references.
    fn controls(rays: u32) -> Vec<[Vec<f32>; 2]> {
        let of = |name: &str| {
            let scene = library::scene(name).unwrap();
            let geometry = Geometry::new(&scene).unwrap();
            let view = scene.measure.view();
            let mut loaded = Cpu.load(&geometry).unwrap();
            let mut render = |rays, replicate| {
                let estimator = Estimator::CLASSIC;
                let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays, seed: 3, replicate };
                loaded.render(&job).unwrap().values
            };
            [render(rays, 1), render(256, 0)]
        };
        ["corner", "crevice", "sphere", "plane"].map(of).into()
    }

    fn fitted(images: &[[Vec<f32>; 2]], through: impl Fn(&[f32]) -> Vec<f32>) -> Option<Curve> {
        let images: Vec<[Vec<f32>; 2]> = images.iter().map(|[a, b]| [through(a), b.clone()]).collect();
        fit_curve(&images.iter().map(|[a, b]| (a.as_slice(), b.as_slice())).collect::<Vec<_>>())
    }

    #[test]
    fn known_curves_come_back() {
        for (rays, percent) in [(64, 0.5), (8, 1.5), (4, 2.0)] {
            let images = controls(rays);
            for (gain, exponent) in [(1.0, 1.0), (1.0, 2.2), (0.8, 1.5), (1.0, 0.4545), (1.3, 3.0)] {
                let known = Curve { gain, exponent, ..Curve::IDENTITY };
                let found = fitted(&images, |image| known.apply(image)).unwrap();
                let off = [found.gain / gain - 1.0, found.exponent / exponent - 1.0].map(|v| 100.0 * v.abs());
                assert!(off.iter().all(|o| *o < percent), "{rays} rays, {known:?}: {found:?}");
                assert!((found.exponent - exponent).abs() < 5.0 * found.error, "{rays} rays, {known:?}: {found:?}");
                assert!(found.after < 0.01 && found.before >= found.after, "{found:?}");
                let undone = found.undo(&known.apply(&images[0][0]));
                let off: f32 = undone.iter().zip(&images[0][0]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(off < 0.03, "{off}");
            }
        }
    }

    /// Noise that is added after the curve.
    #[test]
    fn noise_of_the_buffer_bends_it_by_little() {
        let images = controls(64);
        let mut random = crate::stats::SplitMix64(9);
        let mut noisy = |image: &[f32]| -> Vec<f32> {
            image.iter().map(|v| v.powi(2) + 0.1 * (random.uniform() as f32 - 0.5)).collect()
        };
        let images: Vec<[Vec<f32>; 2]> = images.iter().map(|[a, b]| [noisy(a), b.clone()]).collect();
        let found = fitted(&images, <[f32]>::to_vec).unwrap();
        assert!((found.exponent - 2.0).abs() < 0.06 && (found.gain - 1.0).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn what_cannot_be_told_is_not() {
        let images = controls(1);
        assert_eq!(fitted(&images, |image| image.iter().map(|v| v.powi(2)).collect()), None, "0 and 1 to any power");
        let plane = &controls(4)[3..];
        assert_eq!(fitted(plane, <[f32]>::to_vec), None, "one openness alone");
        assert_eq!(fit_curve(&[]), None);
        assert_eq!(fit_curve(&[(&[f32::NAN; 100], &[0.5; 100])]), None);
        assert_eq!(fit_curve(&[(&[0.0; 4096], &[0.5; 4096])]), None);
        let ramp: Vec<f32> = (0..4096).map(|i| i as f32 / 4096.0).collect();
        assert_eq!(fit_curve(&[(&[0.0; 4096], &ramp)]), None, "black");
    }

    #[test]
    fn curves_are_undone() {
        let curve = Curve { gain: 0.5, exponent: 2.0, ..Curve::IDENTITY };
        assert_eq!(curve.apply(&[0.5, 1.0]), [0.125, 0.5]);
        let undone = curve.undo(&[0.125, 0.5, -0.1, f32::NAN]);
        assert_eq!(undone[..3], [0.5, 1.0, 0.0]);
        assert!(undone[3].is_nan());
        assert_eq!(Curve::IDENTITY.undo(&[0.3, 1.7]), [0.3, 1.7]);
    }
}
