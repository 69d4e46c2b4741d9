//! Image metrics against scikit-image and FLIP: the values of
//! `.ci/against-python.py`, which `tests/reference/python.json` holds. The images
//! are made here by the same recipe.

use aogauge::{
    metrics::image::{
        Encoding, Exposures, Image, MS_SSIM_SIDE, Pair, SSIM_SIDE, flip, hdr_flip, ms_ssim, pointwise, ssim, summary,
    },
    picture::read::read,
};
use serde_json::Value;
use std::{cell::Cell, fmt::Display};

const PPD: f64 = 67.0;

fn cases() -> Vec<Value> {
    let mut all: Value = serde_json::from_str(include_str!("../reference/python.json")).unwrap();
    let Value::Array(cases) = all["images"].take() else { panic!("no images") };
    assert!(cases.len() > 20);
    cases
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("{v} is no number"))
}

/// Asserts agreement and keeps the largest difference that it saw.
#[derive(Default)]
struct Held(Cell<f64>);

impl Held {
    fn close(&self, ours: f64, theirs: f64, tolerance: f64, what: impl Display) {
        let off = (ours - theirs).abs();
        assert!(off <= tolerance, "{what}: {ours:.9}, theirs {theirs:.9}, to {tolerance:.1e}");
        self.0.set(self.0.get().max(off));
    }

    /// For the report of the peers.
    fn tell(&self, what: &str) {
        println!("held: {what}, largest difference {:.1e}", self.0.get());
    }
}

/// The generator of the recipe.
struct Draws(u32);

impl Draws {
    fn state(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0
    }

    fn unit(&mut self) -> f32 {
        unit(self.state())
    }
}

fn unit(state: u32) -> f32 {
    (state >> 8) as f32 / 16_777_216.0
}

fn bright(state: u32) -> f32 {
    unit(state) * (1u32 << ((state & 255) % 9)) as f32
}

/// Reference and test image of a case, made by the fixture's recipe.
fn pair(case: &Value, encoding: Encoding) -> [Image; 2] {
    if let Some(files) = case["files"].as_array() {
        let file = |name: &Value| {
            let path =
                concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/images/").to_owned() + name.as_str().unwrap();
            read(path.as_ref(), None, Some(encoding)).unwrap().image
        };
        return [file(&files[0]), file(&files[1])];
    }
    let [width, height, channels] = ["width", "height", "channels"].map(|k| case[k].as_u64().unwrap() as usize);
    let kind = case["kind"].as_str().unwrap();
    let mut draws = Draws(case["seed"].as_u64().unwrap_or(0) as u32);
    let constant = |image: usize| number(&case["values"][image]) as f32;
    let bar = |x: usize, c: usize| if (x + 2 * c) / 4 % 2 == 1 { 0.9 } else { 0.1 };
    let mut reference = vec![Vec::new(); channels];
    for y in 0..height {
        for x in 0..width {
            for (c, plane) in reference.iter_mut().enumerate() {
                let triangle = || ((((c + 1) * x + (3 - c) * y) % 128) as f32 - 64.0).abs() / 64.0;
                plane.push(match kind {
                    "random" | "near" => draws.unit(),
                    "noise" => triangle(),
                    "constant" => constant(0),
                    "bars" => bar(x, c),
                    "hdr" | "hdr-noise" => bright(draws.state()),
                    "hdr-dark" => bright(draws.state()) * if 2 * y < height { 0.0 } else { 1.0 },
                    other => panic!("{other}"),
                });
            }
        }
    }
    let mut test = vec![Vec::new(); channels];
    for i in 0..width * height {
        for (c, (plane, reference)) in test.iter_mut().zip(&reference).enumerate() {
            let r = reference[i];
            plane.push(match kind {
                "random" => draws.unit(),
                "near" => 0.999 * r,
                "noise" => 0.8 * r + 0.2 * draws.unit(),
                "constant" => constant(1),
                "bars" => bar(i % width + 1, c),
                "hdr" => bright(draws.state()),
                _ => r * (0.75 + 0.5 * draws.unit()),
            });
        }
    }
    [reference, test].map(|planes| Image::new([width, height], planes, encoding).unwrap())
}

/// Column, row and value of each sample.
fn samples(v: &Value) -> Vec<(usize, usize, f64)> {
    let samples = v.as_array().unwrap();
    assert!(!samples.is_empty());
    samples.iter().map(|s| (s[0].as_u64().unwrap() as usize, s[1].as_u64().unwrap() as usize, number(&s[2]))).collect()
}

#[test]
fn errors_of_single_pixels() {
    let held = Held::default();
    for case in cases() {
        let (name, theirs) = (&case["name"], &case["error"]);
        let [r, t] = pair(&case, Encoding::Linear);
        let ours = pointwise(&Pair::new(&r, &t, None).unwrap());
        // Relative, the signed mean to the absolute one.
        let size = |v: f64| if v > 0.0 { v } else { 1.0 };
        for (key, value, size) in [
            ("bias", ours.mean_error, size(ours.mae)),
            ("mae", ours.mae, size(ours.mae)),
            ("mse", ours.mse, size(ours.mse)),
            ("rmse", ours.rmse(), size(ours.rmse())),
            ("rel_mse", ours.relative_mse, size(ours.relative_mse)),
            ("smape", ours.smape, size(ours.smape)),
        ] {
            held.close(value / size, number(&theirs[key]) / size, 1e-9, format_args!("{key} of {name}"));
        }
        match theirs["psnr"].as_f64() {
            Some(theirs) => held.close(ours.psnr(1.0), theirs, 1e-8, format_args!("psnr of {name}")),
            None => assert_eq!(ours.psnr(1.0), f64::INFINITY, "{name}"),
        }
    }
    held.tell("MAE, MSE, RMSE, PSNR, relMSE, SMAPE, mean error (relative)");
}

#[test]
fn structural_similarity() {
    let (mut single, mut multiple) = (0, 0);
    let [means, maps, scales] = [0; 3].map(|_| Held::default());
    for case in cases().iter().filter(|c| c["hdr"] == false) {
        let name = &case["name"];
        let [r, t] = pair(case, Encoding::Linear);
        let images = Pair::new(&r, &t, None).unwrap();
        let [width, height] = r.size();
        let theirs = &case["ssim"];
        if theirs.is_null() {
            assert!(width.min(height) < SSIM_SIDE && ssim(&images).is_err(), "{name}");
            continue;
        }
        single += 1;
        let ours = ssim(&images).unwrap();
        means.close(ours.mean, number(&theirs["luma"]), 1e-8, format_args!("SSIM of {name}"));
        for (x, y, value) in samples(&theirs["samples"]) {
            maps.close(f64::from(ours.map[y * width + x]), value, 1e-6, format_args!("SSIM of {name} at {x}, {y}"));
        }
        // The mean over channels is that of the planes taken one by one.
        let planes = r.planes().iter().zip(t.planes());
        let channels: Vec<f64> = planes
            .map(|(r, t)| {
                let [r, t] = [r, t].map(|p| Image::new([width, height], vec![p.clone()], Encoding::Linear).unwrap());
                ssim(&Pair::new(&r, &t, None).unwrap()).unwrap().mean
            })
            .collect();
        let mean = channels.iter().sum::<f64>() / channels.len() as f64;
        means.close(mean, number(&theirs["channels"]), 1e-8, format_args!("SSIM of the channels of {name}"));
        if case["ms_ssim"].is_null() {
            assert!(width.min(height) < MS_SSIM_SIDE && ms_ssim(&images, &ours).is_err(), "{name}");
        } else {
            multiple += 1;
            scales.close(
                ms_ssim(&images, &ours).unwrap(),
                number(&case["ms_ssim"]),
                1e-6,
                format_args!("MS-SSIM of {name}"),
            );
        }
    }
    assert!(single > 10 && multiple > 3);
    means.tell("SSIM");
    maps.tell("map of SSIM");
    scales.tell("MS-SSIM");
}

/// Holds a FLIP map to the peer's: means within 1e-5, single pixels within 2e-5,
/// both of f32. What the peer's own f32 is off (where an image is flat, its filters
/// leave a rest whose root counts) comes on top; against FLIP in f64 our mean lies
/// within 1e-5 everywhere.
fn same_flip(images: &Pair<'_>, map: &[f32], theirs: &Value, name: &str, [means, exact, maps]: &[Held; 3]) {
    let [mean, at] = ["tolerance_mean", "tolerance_map"].map(|k| number(&theirs[k]));
    let ours = summary(images, map).unwrap();
    means.close(ours.mean, number(&theirs["mean"]), mean, format_args!("mean of {name}"));
    exact.close(ours.mean, number(&theirs["mean_f64"]), 1e-5, format_args!("mean of {name}, in f64"));
    for (key, value) in [("least", ours.min), ("greatest", ours.max)] {
        maps.close(value, number(&theirs[key]), at, format_args!("{key} of {name}"));
    }
    for (key, value) in [("0.5", ours.median), ("0.95", ours.p95), ("0.99", ours.p99)] {
        maps.close(value, number(&theirs["quantiles"][key]), at, format_args!("quantile {key} of {name}"));
    }
    let width = images.reference().size()[0];
    for (x, y, value) in samples(&theirs["samples"]) {
        maps.close(f64::from(map[y * width + x]), value, at, format_args!("{name} at {x}, {y}"));
    }
}

fn tell([means, exact, maps]: &[Held; 3], what: &str) {
    means.tell(&format!("mean of {what} (what the peer rounds away included)"));
    exact.tell(&format!("mean of {what} against f64"));
    maps.tell(&format!("map of {what} (what the peer rounds away included)"));
}

#[test]
fn flip_of_srgb_and_of_linear_images() {
    let held = [0; 3].map(|_| Held::default());
    for case in cases().iter().filter(|c| c["hdr"] == false) {
        for (key, encoding) in [("srgb", Encoding::Srgb), ("linear", Encoding::Linear)] {
            let [r, t] = pair(case, encoding);
            let images = Pair::new(&r, &t, None).unwrap();
            let map = flip(&images, PPD).unwrap();
            same_flip(&images, &map, &case["flip"][key], &format!("FLIP of {} {key}", case["name"]), &held);
        }
    }
    tell(&held, "FLIP");
}

#[test]
fn flip_of_high_dynamic_range() {
    let mut n = 0;
    let (held, exposed) = ([0; 3].map(|_| Held::default()), Held::default());
    for case in cases().iter().filter(|c| c["hdr"] == true) {
        n += 1;
        let name = format!("HDR-FLIP of {}", case["name"]);
        let theirs = &case["flip"]["hdr"];
        let [r, t] = pair(case, Encoding::Linear);
        let images = Pair::new(&r, &t, None).unwrap();
        let exposures = Exposures::of(&images).unwrap();
        exposed.close(exposures.start, number(&theirs["start"]), 1e-5, format_args!("start of {name}"));
        exposed.close(exposures.stop, number(&theirs["stop"]), 1e-5, format_args!("stop of {name}"));
        assert_eq!(u64::from(exposures.count), theirs["exposures"].as_u64().unwrap(), "{name}");
        same_flip(&images, &hdr_flip(&images, PPD, exposures).unwrap().map, theirs, &name, &held);
    }
    assert!(n > 3);
    tell(&held, "HDR-FLIP");
    exposed.tell("exposures, stops");
}
