//! Each fault on its own, with noise of 4 rays and of 1 ray; and none where there is none.

use super::*;
use crate::{
    intake::SELF_CHECK,
    metrics::regions::Regions,
    render::{Estimator, Falloff, Geometry, Job, Openness, ReceiverPlane, Renderer, cpu::Cpu, gbuffer::GBuffer},
    scenes::{AoScale, Scene, library},
};
use std::sync::LazyLock;

mod meaning;

/// A scene with what images of it are held against.
struct Bench {
    scene: Scene,
    geometry: Geometry,
    reference: Reference,
    size: [usize; 2],
}

impl Bench {
    fn new(scene: Scene, factors: &[f64]) -> Self {
        let geometry = Geometry::new(&scene).unwrap();
        let size = scene.measure.resolution.map(|side| side as usize);
        let mut bench = Bench { scene, geometry, reference: Reference::default(), size };
        let openness = bench.render(Estimator::CLASSIC, 1.0, 256, [0.0; 2]);
        let scaled = |&factor| Scaled { factor, openness: bench.render(Estimator::CLASSIC, factor, 64, [0.0; 2]) };
        let scaled = factors.iter().map(scaled).collect();
        bench.reference = Reference { openness, scaled };
        bench
    }

    fn library(name: &str) -> Self {
        Bench::new(library::scene(name).unwrap(), &[0.5, 2.0])
    }

    fn render(&self, estimator: Estimator, factor: f64, rays: u32, moved: [f32; 2]) -> Vec<f32> {
        let AoScale { radius, secondary_radius } = self.scene.ao;
        let ao = AoScale { radius: radius * factor as f32, secondary_radius: secondary_radius * factor as f32 };
        let view = self.scene.measure.view().moved(moved);
        let job = Job { view: &view, camera: None, estimator, ao, rays, seed: 7, replicate: 0 };
        Cpu.load(&self.geometry).unwrap().render(&job).unwrap().values
    }

    fn classic(&self, rays: u32) -> Vec<f32> {
        self.render(Estimator::CLASSIC, 1.0, rays, [0.0; 2])
    }

    fn diagnose(&self, image: &[f32]) -> Vec<Finding> {
        diagnose(image, &self.reference, self.size)
    }
}

static SELF: LazyLock<Bench> = LazyLock::new(|| Bench::new(self_check(), &FACTORS));

fn self_check() -> Scene {
    Scene::from_toml("self-check", "self-check.toml", SELF_CHECK, None).unwrap()
}

const NOISES: [u32; 3] = [64, 4, 1];

fn estimators() -> Vec<(&'static str, Estimator)> {
    let with = |o: Openness| Estimator::Openness(o);
    vec![
        ("classic", Estimator::CLASSIC),
        ("extended", Estimator::extended(ReceiverPlane::Counts)),
        ("extended-clipped", Estimator::extended(ReceiverPlane::Clipped)),
        ("obscurance", with(Openness::plain(Falloff::Exponential { extinction: 8.0 }))),
        ("quadratic", with(Openness::plain(Falloff::Quadratic))),
    ]
}

#[test]
fn correct_images_have_no_findings() {
    for rays in NOISES {
        assert_eq!(SELF.diagnose(&SELF.classic(rays)), [], "{rays} rays");
    }
    for name in ["curtain-arcade", "corner", "plane", "sphere", "leaves"] {
        let bench = Bench::library(name);
        for rays in NOISES {
            assert_eq!(bench.diagnose(&bench.classic(rays)), [], "{name}, {rays} rays");
        }
    }
}

/// Held against the classic image, when nobody says that they are of another estimator.
#[test]
fn other_estimators_have_no_findings() {
    let benches = [Bench::library("curtain-arcade"), Bench::library("corner")];
    for bench in benches.iter().chain([&*SELF]) {
        for (name, estimator) in estimators() {
            // Of two rays, obscurance that falls off early is nearly AO of less strength.
            let rays: &[u32] = if name.starts_with("extended") { &[64, 4, 2, 1] } else { &NOISES };
            for &rays in rays {
                let image = bench.render(estimator, 1.0, rays, [0.0; 2]);
                assert_eq!(bench.diagnose(&image), [], "{name} of {}, {rays} rays", bench.scene.name);
            }
        }
    }
}

#[test]
fn mirrored_and_turned_images_are_told() {
    for rays in NOISES {
        for turn in [Turn::FlippedY, Turn::FlippedX, Turn::Half] {
            let image = turn.of(&SELF.classic(rays), SELF.size);
            assert_eq!(SELF.diagnose(&image), [Finding::Turned(turn)], "{rays} rays");
        }
    }
    // Quarters have a view of their own size only where it is square.
    let mut scene = self_check();
    scene.measure.resolution = [120, 120];
    let square = Bench::new(scene, &[]);
    for rays in NOISES {
        for turn in [Turn::Quarter, Turn::ThreeQuarters, Turn::Transposed, Turn::Antitransposed] {
            let image = turn.of(&square.classic(rays), square.size);
            assert_eq!(square.diagnose(&image), [Finding::Turned(turn)], "{rays} rays");
        }
    }
}

#[test]
fn turns_are_what_they_say() {
    // 0 1
    // 2 3, turned clockwise: 2 0 over 3 1.
    let picture = [0.0, 1.0, 2.0, 3.0];
    for (turn, expected) in [
        (Turn::FlippedY, [2.0, 3.0, 0.0, 1.0]),
        (Turn::FlippedX, [1.0, 0.0, 3.0, 2.0]),
        (Turn::Half, [3.0, 2.0, 1.0, 0.0]),
        (Turn::Quarter, [2.0, 0.0, 3.0, 1.0]),
        (Turn::ThreeQuarters, [1.0, 3.0, 0.0, 2.0]),
        (Turn::Transposed, [0.0, 2.0, 1.0, 3.0]),
        (Turn::Antitransposed, [3.0, 1.0, 2.0, 0.0]),
    ] {
        assert_eq!(turn.of(&picture, [2, 2]), expected, "{turn:?}");
        assert_eq!(turn.undone(&expected, [2, 2]), picture, "{turn:?}");
    }
}

#[test]
fn inverted_images_are_told() {
    let flat = Bench::library("plane");
    for bench in [&*SELF, &Bench::library("corner"), &flat] {
        for rays in NOISES {
            let image: Vec<f32> = bench.classic(rays).iter().map(|v| 1.0 - v).collect();
            // Of an open plane it is black, as a cleared buffer is.
            let is_black = image.iter().all(|v| *v == 0.0);
            let expected = if is_black { Finding::Constant { value: 0.0 } } else { Finding::Inverted };
            assert_eq!(bench.diagnose(&image), [expected], "{}, {rays} rays", bench.scene.name);
        }
    }
}

/// What a finding holds for as likely, the nearest first.
fn explanations(found: &Finding) -> Vec<Finding> {
    if let Finding::Either(all) = found { all.clone() } else { vec![found.clone()] }
}

fn encode(v: f32) -> f32 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

#[test]
fn scaled_scenes_are_told_with_their_factor() {
    for rays in NOISES {
        // Twice R is nearest to R: the noise of one ray hides it.
        for factor in FACTORS.into_iter().filter(|f| rays > 1 || *f != 2.0) {
            let found = SELF.diagnose(&SELF.render(Estimator::CLASSIC, factor, rays, [0.0; 2]));
            let [Finding::Scaled { factors }] = &found[..] else { panic!("{factor}, {rays} rays: {found:?}") };
            assert!(factors.contains(&factor), "{factor}, {rays} rays: {found:?}");
            // All that lies beyond ten times R is the sky.
            let alone = if factor < 5.0 { factors.len() == 1 } else { factors.iter().all(|f| *f > 5.0) };
            assert!(alone, "{factor}, {rays} rays: {found:?}");
        }
    }
}

#[test]
fn shifted_images_are_told_by_how_much() {
    for rays in NOISES {
        let moved = |by: [f32; 2]| SELF.render(Estimator::CLASSIC, 1.0, rays, by);
        // What the view is moved by, the image moves the other way.
        for by in [[0.5, 0.0], [0.0, -0.5], [1.0, 0.0], [-1.0, 1.0], [0.5, 0.5], [0.0, 2.0]] {
            let expected = by.map(|v| -f64::from(v) + 0.0);
            assert_eq!(SELF.diagnose(&moved(by)), [Finding::Shifted { pixels: expected }], "{rays} rays");
        }
        for by in [[0.1, 0.0], [0.0, 0.1]] {
            assert_eq!(SELF.diagnose(&moved(by)), [], "a tenth of a pixel, {rays} rays");
        }
    }
}

#[test]
fn holes_constants_sizes_and_other_pictures_are_told() {
    for rays in NOISES {
        let mut image = SELF.classic(rays);
        (image[163], image[500]) = (f32::NAN, f32::NEG_INFINITY);
        assert_eq!(SELF.diagnose(&image), [Finding::Holes { count: 2, infinite: 1, first: [3, 1] }]);
        let noise = Bench::library("leaves").classic(rays);
        let other: Vec<f32> = (0..image.len()).map(|i| noise[i % noise.len()]).collect();
        let found = SELF.diagnose(&other);
        assert!(matches!(found[..], [Finding::Unlike { .. }]), "{rays} rays: {found:?}");
    }
    let pixels = SELF.reference.openness.len();
    for value in [0.0, 0.5, 1.0] {
        assert_eq!(SELF.diagnose(&vec![value; pixels]), [Finding::Constant { value }]);
    }
    let holes = vec![f32::NAN; pixels];
    assert_eq!(SELF.diagnose(&holes), [Finding::Holes { count: pixels, infinite: 0, first: [0, 0] }]);
    assert_eq!(SELF.diagnose(&holes[1..]), [Finding::Size { found: pixels - 1, expected: pixels }]);
    assert_eq!(diagnose(&[], &Reference::default(), [0, 0]), [Finding::Size { found: 0, expected: 0 }]);
    let odd = Reference { scaled: vec![Scaled { factor: 2.0, openness: vec![0.5] }], ..SELF.reference.clone() };
    assert_eq!(diagnose(&SELF.classic(16), &odd, SELF.size), []);
    assert_eq!(diagnose(&SELF.classic(16), &SELF.reference, [usize::MAX, 2]).len(), 1);
}

/// Two faults at once are both told, and each has a remedy.
#[test]
fn faults_are_told_together() {
    let image: Vec<f32> = Turn::FlippedY.of(&SELF.classic(4), SELF.size).iter().map(|v| 1.0 - v).collect();
    let found = SELF.diagnose(&image);
    assert_eq!(found, [Finding::Turned(Turn::FlippedY), Finding::Inverted]);
    let text = found[0].to_string();
    assert!(text.starts_with("flipped in y") && text.ends_with("save the rows from the top"), "{text}");
    let image: Vec<f32> = SELF.classic(16).into_iter().map(encode).collect();
    let found = SELF.diagnose(&Turn::FlippedX.of(&image, SELF.size));
    assert_eq!(found, [Finding::Turned(Turn::FlippedX), Finding::Encoded { gamma: None }]);
    let inches = Finding::Scaled { factors: vec![1.0 / 39.37] };
    assert!(inches.to_string().contains("R is 1/39.37 times") && inches.to_string().contains("by 39.37"), "{inches}");
}

#[test]
fn a_symmetrical_scene_says_what_it_cannot_tell() {
    assert_eq!(alike(&SELF.reference, SELF.size), []);
    let corner = Bench::library("corner");
    assert_eq!(alike(&corner.reference, corner.size), [Turn::FlippedY]);
    let plane = Bench::library("plane");
    assert_eq!(alike(&plane.reference, plane.size).len(), 3);
    let image = Turn::FlippedY.of(&corner.classic(4), corner.size);
    assert_eq!(corner.diagnose(&image), [], "a floor before a wall looks the same");
    // Mirrored and turned by half are one then, and both are named.
    let both = Finding::Either(vec![Finding::Turned(Turn::FlippedX), Finding::Turned(Turn::Half)]);
    for turn in [Turn::FlippedX, Turn::Half] {
        for rays in NOISES {
            let found = corner.diagnose(&turn.of(&corner.classic(rays), corner.size));
            let [Finding::Either(all)] = &found[..] else { panic!("{turn:?}, {rays} rays: {found:?}") };
            let has = |t: Turn| all.contains(&Finding::Turned(t));
            assert!(all.len() == 2 && has(Turn::FlippedX) && has(Turn::Half), "{turn:?}, {rays} rays: {found:?}");
        }
    }
    let text = both.to_string();
    assert!(text.contains("left and right are exchanged, or turned by 180 degrees; which of them"), "{text}");
    assert!(!both.is_doubt() && !both.is_meaning());
}

/// What the scene is made for.
#[test]
fn the_self_check_shows_what_it_must() {
    assert!(!SELF.scene.has_occluder());
    let openness = &SELF.reference.openness;
    assert!(openness.iter().all(|v| v.is_finite()));
    let share = |low: f32, high: f32| {
        openness.iter().filter(|v| (low..high).contains(*v)).count() as f64 / openness.len() as f64
    };
    let shares = [(0.0, 0.2), (0.2, 0.4), (0.4, 0.7), (0.7, 0.9), (0.9, 1.1)].map(|(low, high)| share(low, high));
    assert!(shares.iter().all(|s| *s > 0.03), "{shares:?}");
    let gbuffer = GBuffer::new(&SELF.geometry.tracer, &SELF.scene.measure.view());
    let regions = Regions::new(&SELF.scene, &SELF.geometry.tracer, &gbuffer);
    assert!(regions.pixels(Region::Footprint).is_empty());
}

#[test]
fn other_scales_and_values_below_zero_are_told() {
    for bench in [&*SELF, &Bench::library("corner"), &Bench::library("curtain-arcade")] {
        for rays in NOISES {
            let plain = bench.classic(rays);
            for scale in [100.0, 255.0, 65_535.0] {
                let told = |image: &[f32], size, also: &[Finding]| {
                    let found = diagnose(image, &bench.reference, size);
                    let is = matches!(found[0], Finding::Range { scale: Some(s), .. } if s == f64::from(scale));
                    assert!(is && found[1..] == *also, "{scale}, {rays} rays, {}: {found:?}", bench.scene.name);
                };
                let times = |image: &[f32]| image.iter().map(|v| v * scale).collect::<Vec<f32>>();
                told(&times(&plain), bench.size, &[]);
                let inverted: Vec<f32> = plain.iter().map(|v| 1.0 - v).collect();
                told(&times(&inverted), bench.size, &[Finding::Inverted]);
                // As it is read where it was declared to be occlusion.
                told(&times(&inverted).iter().map(|v| 1.0 - v).collect::<Vec<_>>(), bench.size, &[]);
            }
            let signed: Vec<f32> = plain.iter().map(|v| 2.0 * v - 1.0).collect();
            let found = bench.diagnose(&signed);
            // Where openness is above a half everywhere there is nothing below 0.
            let is_open = bench.scene.name != "self-check";
            let is = matches!(found[..], [Finding::Negative { is_signed: true, .. }]);
            assert!(is || is_open, "{rays} rays, {}: {found:?}", bench.scene.name);
        }
    }
    let text = SELF.diagnose(&SELF.classic(64).iter().map(|v| v * 255.0).collect::<Vec<_>>())[0].to_string();
    assert!(text.starts_with("out of range: values run from 3.98"), "{text}");
    assert!(text.ends_with("divide by 255"), "{text}");
    // Light is no openness of another scale.
    let light: Vec<f32> = SELF.classic(64).iter().enumerate().map(|(i, v)| v * (1 + i % 7) as f32).collect();
    let found = SELF.diagnose(&light);
    assert!(matches!(found[0], Finding::Range { scale: None, .. }), "{found:?}");
    // So far out of range, few or many: no filter leaves them.
    for every in [6000, 200, 33, 12] {
        let far: Vec<f32> =
            SELF.classic(64).iter().enumerate().map(|(i, v)| if i % every == 7 { -2.0 } else { *v }).collect();
        let found = SELF.diagnose(&far);
        assert!(found.iter().any(|f| !f.is_doubt()), "every {every}th: {found:?}");
    }
    let text = Finding::Negative { count: 9, least: -0.2, is_signed: false, is_doubt: true }.to_string();
    assert!(text.starts_with("negative openness: 9 pixels are below 0, the least is -0.200;"), "{text}");
}

/// Where there is no edge, a shift is told by what it explains.
#[test]
fn shifts_of_smooth_pictures_are_told() {
    for name in ["crevice", "corner"] {
        let bench = Bench::library(name);
        let image = bench.classic(256);
        let [width, _] = bench.size;
        for by in [4isize, -6] {
            let at = |i: usize| {
                let x = (i % width) as isize - by;
                image[i - i % width + x.clamp(0, width as isize - 1) as usize]
            };
            let moved: Vec<f32> = (0..image.len()).map(at).collect();
            let found = bench.diagnose(&moved);
            let is =
                matches!(found[..], [Finding::Shifted { pixels: [x, y] }] if (x - by as f64).abs() <= 1.0 && y == 0.0);
            assert!(is, "{name} by {by}: {found:?}");
        }
    }
}

#[test]
fn another_scene_of_the_kit_is_told() {
    let [corner, crevice] = ["corner", "crevice"].map(Bench::library);
    for rays in NOISES {
        let image = corner.classic(rays);
        let [own, other] = [&corner, &crevice].map(|b| b.reference.openness.as_slice());
        if own.len() == other.len() {
            assert!(is_rather(&image, other, own, corner.size[0]), "{rays} rays");
            assert!(!is_rather(&image, own, other, corner.size[0]), "{rays} rays");
        }
        let open = vec![1.0; own.len()];
        assert!(is_rather(&image, &open, own, corner.size[0]) && is_rather(&open, own, &open, corner.size[0]));
        for (name, estimator) in estimators() {
            let image = corner.render(estimator, 1.0, rays, [0.0; 2]);
            assert!(!is_rather(&image, own, &open, corner.size[0]), "{name}, {rays} rays");
        }
    }
}

#[test]
fn how_a_frame_lies_is_told_where_it_is_plain() {
    for rays in NOISES {
        let light: Vec<f32> = SELF.classic(rays).iter().map(|v| 3.0 * v + 0.4).collect();
        let reference: &[f32] = &SELF.reference.openness;
        assert_eq!(frame_turn(&light, &[reference], SELF.size), None);
        let turned = Turn::FlippedY.of(&light, SELF.size);
        let found = frame_turn(&turned, &[reference], SELF.size);
        // Of one ray most of the variance is noise.
        assert_eq!(found, (rays > 1).then_some(Turn::FlippedY), "{rays} rays");
        assert_eq!(frame_turn(&light, &[], SELF.size), None);
        assert_eq!(frame_turn(&light[1..], &[reference], SELF.size), None);
    }
    let lamp: Vec<f32> = (0..SELF.reference.openness.len()).map(|i| (i % 160) as f32).collect();
    assert_eq!(frame_turn(&lamp, &[&SELF.reference.openness], SELF.size), None);
}

/// One pixel that a division left is named, and says nothing of the rest.
#[test]
fn outliers_and_black_images_are_told() {
    for value in [1e30, 1e6, 50.0, 2.01, -1e6, -1.01] {
        let mut image = SELF.classic(64);
        image[2 * SELF.size[0] + 5] = value;
        let found = SELF.diagnose(&image);
        let is = matches!(found[..], [Finding::Range { scale: None, count: 1, farthest: [5, 2], .. }]);
        assert!(is && !found[0].is_doubt(), "{value}: {found:?}");
        let text = found[0].to_string();
        assert!(text.contains("1 pixel is more than 1 beyond that, the farthest at column 5, row 2"), "{text}");
        assert!(text.len() < 250, "{text}");
    }
    // As far on both sides it is no more than a warning, by whoever reads the file.
    for value in [2.0, -1.0] {
        let mut image = SELF.classic(64);
        image[2 * SELF.size[0] + 5] = value;
        assert_eq!(SELF.diagnose(&image), [], "{value}");
    }
    let open = Reference { openness: vec![1.0; 12], scaled: Vec::new() };
    let found = diagnose(&[0.0; 12], &open, [4, 3]);
    assert_eq!(found, [Finding::Constant { value: 0.0 }]);
    assert!(found[0].to_string().starts_with("black: "), "{}", found[0]);
}
