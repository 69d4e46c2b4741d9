//! Each cause on its own, told by the frames of a scene with all levels of openness.

use super::*;
use crate::{
    intake::{SELF_CHECK, Scaled},
    layers::{code, linear},
    render::{Estimator, Geometry, Job, Renderer, cpu::Cpu},
    scenes::{AoScale, Scene, library},
};
use std::{collections::BTreeMap, sync::LazyLock};

const SIZE: [usize; 2] = [160, 120];

fn render(factor: f32, rays: u32) -> Vec<f32> {
    let scene = Scene::from_toml("self-check", "self-check.toml", SELF_CHECK, None).unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let ao = AoScale { radius: scene.ao.radius * factor, ..scene.ao };
    let view = scene.measure.view();
    let job = Job { view: &view, camera: None, estimator: Estimator::CLASSIC, ao, rays, seed: 5, replicate: 0 };
    Cpu.load(&geometry).unwrap().render(&job).unwrap().values
}

static REFERENCE: LazyLock<Reference> = LazyLock::new(|| {
    let scaled = [0.5, 2.0].map(|factor| Scaled { factor, openness: render(factor as f32, 64) });
    Reference { openness: render(1.0, 256), scaled: scaled.into() }
});

/// Light that varies over the view.
fn light(i: usize) -> f32 {
    let [x, y] = [i % SIZE[0], i / SIZE[0]].map(|v| v as f32);
    0.4 + 0.2 * (x / 9.0).sin() + 0.1 * (y / 7.0).cos()
}

/// What is told of frames that are made of openness and light, and stored so.
fn told(openness: &[f32], encoding: Encoding, make: impl Fn(f32, f32) -> [f32; 2]) -> Option<Vec<PairCause>> {
    let both: Vec<[f32; 2]> = openness.iter().enumerate().map(|(i, a)| make(*a, light(i))).collect();
    let [with, without] = [0, 1].map(|k| both.iter().map(|p| p[k]).collect::<Vec<f32>>());
    let ratio: Vec<f32> = with.iter().zip(&without).map(|(a, b)| a / b).collect();
    pair_causes(&Pair { with: &with, without: &without, ratio: &ratio, encoding }, &REFERENCE, SIZE)
}

#[test]
fn frames_whose_ratio_is_openness_have_no_cause() {
    for rays in [64, 16, 4] {
        let image = render(1.0, rays);
        assert_eq!(told(&image, Encoding::Linear, |a, l| [a * l, l]), None, "{rays} rays");
        // A lamp that does not reach white is no level at which light is cut off.
        assert_eq!(told(&image, Encoding::Linear, |a, _| [a * 0.5, 0.5]), None, "{rays} rays");
    }
}

#[test]
fn each_cause_is_told_alone() {
    type Make = fn(f32, f32) -> [f32; 2];
    type Is = fn(&PairCause) -> bool;
    let cases: [(&str, Encoding, Make, Is); 9] = [
        (
            "0.97",
            Encoding::Linear,
            |a, l| [0.97 * a * l, l],
            |c| matches!(c, PairCause::Exposure(g) if (g - 0.97).abs() < 2e-3),
        ),
        (
            "1.3",
            Encoding::Linear,
            |a, l| [1.3 * a * l, l],
            |c| matches!(c, PairCause::Exposure(g) if (g - 1.3).abs() < 2e-3),
        ),
        (
            "power",
            Encoding::Linear,
            |a, l| [(a * l).max(0.0).powf(1.0 / 1.8), l.powf(1.0 / 1.8)],
            |c| matches!(c, PairCause::Power(p) if (p * 1.8 - 1.0).abs() < 0.05) && c.is_wrong(),
        ),
        ("codes", Encoding::Linear, |a, l| [code(a * l), code(l)], |c| matches!(c, PairCause::Codes)),
        ("decoded", Encoding::Srgb, |a, l| [linear(a * l), linear(l)], |c| matches!(c, PairCause::Decoded)),
        ("tone", Encoding::Linear, |a, l| [a * l / (a * l + 0.5), l / (l + 0.5)], |c| matches!(c, PairCause::Toned)),
        (
            "added",
            Encoding::Linear,
            |a, l| [0.3 + a * l, 0.3 + l],
            |c| matches!(c, PairCause::Added(e) if (e - 0.3).abs() < 0.01),
        ),
        (
            "share",
            Encoding::Linear,
            |a, l| [(0.4 + 0.6 * a) * l, l],
            |c| matches!(c, PairCause::Share(s) if (s - 0.6).abs() < 0.01),
        ),
        (
            "cut",
            Encoding::Linear,
            |a, l| [(2.0 * a * l).min(0.95), (2.0 * l).min(0.95)],
            |c| matches!(c, PairCause::Cut { level, count } if *level == 0.95 && *count > 3000),
        ),
    ];
    for (name, encoding, make, is) in cases {
        for rays in [64, 16] {
            let found = told(&render(1.0, rays), encoding, make).unwrap();
            assert!(found.len() == 1 && is(&found[0]), "{name}, {rays} rays: {found:?}");
        }
    }
}

struct OpenScene {
    reference: Reference,
    size: [usize; 2],
    /// Openness by rays.
    images: BTreeMap<u32, Vec<f32>>,
}

/// A scene most of which is open, as those are that have thin occluders.
static OPEN_SCENE: LazyLock<OpenScene> = LazyLock::new(|| {
    let scene = library::scene("curtain-open").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let view = scene.measure.view();
    let render = |factor: f32, rays, seed| {
        let ao = AoScale { radius: scene.ao.radius * factor, ..scene.ao };
        let job = Job { view: &view, camera: None, estimator: Estimator::CLASSIC, ao, rays, seed, replicate: 0 };
        Cpu.load(&geometry).unwrap().render(&job).unwrap().values
    };
    let reference = Reference { openness: render(1.0, 512, 5), scaled: Vec::new() };
    let size = view.resolution.map(|side| side as usize);
    OpenScene { reference, size, images: [64, 16, 4].into_iter().map(|rays| (rays, render(1.0, rays, 9))).collect() }
});

/// Frames with noise of their own, `far` pixels wide after a box filter, with a deviation of `deviation` of the light before it;
/// rounded to 8 bits where that is asked for.
fn noisy(seed: u64, rays: u32, gain: f32, deviation: f32, far: usize, is_rounded: bool) -> Option<Vec<PairCause>> {
    let OpenScene { reference, size, images } = &*OPEN_SCENE;
    let (openness, [width, height]) = (&images[&rays], *size);
    let mut random = crate::stats::SplitMix64(seed);
    let mut noise = || {
        let mut uniform = || random.uniform() as f32;
        let white: Vec<f32> = (0..width * height).map(|_| 2.0 * (uniform() + uniform() + uniform()) - 3.0).collect();
        let at = |x: usize, y: usize| white[(y % height) * width + x % width];
        let mean = |i: usize| -> f32 {
            let near = (0..far * far).map(|k| at(i % width + k % far, i / width + k / far));
            near.sum::<f32>() / (far * far) as f32
        };
        (0..white.len()).map(mean).collect::<Vec<f32>>()
    };
    let noises = [noise(), noise()];
    let stored = |v: f32| if is_rounded { linear((code(v) * 255.0).round() / 255.0) } else { v };
    let light = |i: usize| 0.4 + 0.2 * ((i % width) as f32 / 9.0).sin() + 0.1 * ((i / width) as f32 / 7.0).cos();
    let frame = |k: usize, of: &dyn Fn(usize) -> f32| -> Vec<f32> {
        (0..openness.len()).map(|i| stored(of(i) * light(i) * (1.0 + deviation * noises[k][i]))).collect()
    };
    let (with, without) = (frame(0, &|i| gain * openness[i]), frame(1, &|_| 1.0));
    let ratio: Vec<f32> = with.iter().zip(&without).map(|(a, b)| a / b).collect();
    pair_causes(&Pair { with: &with, without: &without, ratio: &ratio, encoding: Encoding::Linear }, reference, *size)
}

/// Where a scene is open exposure is told from 0.7 % on, of frames with noise from 1.5 % on, and of good frames nothing is said: none of 1,800 pairs, whatever noise their
/// light has, how far it reaches and whether they are rounded to 8 bits.
#[test]
fn little_exposure_is_told_and_noise_is_not() {
    let is = |gain: f32, found: &Option<Vec<PairCause>>| matches!(found.as_deref(), Some([PairCause::Exposure(g)]) if (g - f64::from(gain)).abs() < 2e-3);
    for rays in [64, 16, 4] {
        for gain in [0.993, 1.007, 0.985, 0.98, 0.975, 1.025] {
            for (deviation, is_rounded) in [(0.0, false), (0.0, true), (0.02, false)] {
                if deviation > 0.0 && (gain - 1.0f32).abs() < 0.01 {
                    continue;
                }
                let found = noisy(1, rays, gain, deviation, 1, is_rounded);
                assert!(is(gain, &found), "{gain}, {rays} rays, noise {deviation}, rounded {is_rounded}: {found:?}");
            }
        }
    }
    let mut alarms = Vec::new();
    for (deviation, far) in [(0.02, 1), (0.1, 1), (0.3, 1), (0.1, 5), (0.3, 5), (0.3, 9)] {
        for rays in [64, 16, 4] {
            for is_rounded in [false, true] {
                let told =
                    |seed: &u64| noisy(*seed, rays, 1.0, deviation, far, is_rounded).is_some_and(|c| !c.is_empty());
                let n = (0..50).filter(told).count();
                if n > 0 {
                    alarms.push((deviation, far, rays, is_rounded, n));
                }
            }
        }
    }
    assert!(alarms.is_empty(), "{alarms:?}");
}

/// R is named where it is R, and nothing where it is nothing of this.
#[test]
fn other_radii_and_what_nobody_knows_are_told() {
    let found = told(&render(1.3, 64), Encoding::Linear, |a, l| [a * l, l]).unwrap();
    let is = |c: &PairCause| matches!(c, PairCause::Radius(f) if (f / 1.3 - 1.0).abs() < 0.15);
    assert!(found.len() == 1 && is(&found[0]), "{found:?}");
    let stripes = |a: f32, l: f32| if l > 0.45 { [a * l, l] } else { [0.6 * a * l, l] };
    assert_eq!(told(&render(1.0, 64), Encoding::Linear, stripes), Some(Vec::new()));
    let short = Pair { with: &[0.5], without: &[0.5], ratio: &[1.0], encoding: Encoding::Linear };
    assert_eq!(pair_causes(&short, &REFERENCE, SIZE), None);
}
