//! `aogauge compare` from outside: which channels of which file are compared, as what,
//! and that broken files are no images that are equal.

use aogauge::layers::Layers;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage};
use image::{DynamicImage, GrayImage, Rgb, Rgb32FImage, RgbImage, Rgba, RgbaImage};
use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

const SIZE: [usize; 2] = [20, 12];
const PIXELS: usize = SIZE[0] * SIZE[1];

fn compare(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(folder).arg("compare").args(args).output().unwrap()
}

/// Compares, checks the exit code and returns all that is printed.
fn expect(folder: &Path, code: i32, args: &[&str]) -> String {
    let out = compare(folder, args);
    let printed = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    assert_eq!(out.status.code(), Some(code), "{args:?}: {printed}");
    printed
}

/// What `--format json` says of the one pair.
fn pair(folder: &Path, args: &[&str]) -> Value {
    let out = compare(folder, &[args, &["--format", "json"]].concat());
    let found: Value = serde_json::from_slice(&out.stdout)
        .unwrap_or_else(|_| panic!("{args:?}: {}", String::from_utf8_lossy(&out.stderr)));
    found["pairs"][0].clone()
}

fn value(pair: &Value, name: &str) -> f64 {
    pair["scores"]["scores"].as_array().unwrap().iter().find(|s| s["name"] == name).unwrap()["value"].as_f64().unwrap()
}

/// An OpenEXR file of parts with channels, each of one value but for the last pixel.
type Part<'a> = (&'a str, &'a [(&'a str, Value)]);

fn exr(path: &Path, parts: &[Part<'_>]) {
    let layers = parts.iter().map(|(part, channels)| {
        let channel = |(name, last): &(&str, Value)| {
            let samples = match last.as_u64() {
                Some(id) => FlatSamples::U32([vec![7; PIXELS - 1], vec![id as u32]].concat()),
                None => FlatSamples::F32([vec![0.5; PIXELS - 1], vec![last.as_f64().unwrap() as f32]].concat()),
            };
            AnyChannel::new(*name, samples)
        };
        let mut attributes = LayerAttributes::default();
        if !part.is_empty() {
            attributes = LayerAttributes::named(*part);
        }
        let channels = AnyChannels::sort(channels.iter().map(channel).collect());
        Layer::new((SIZE[0], SIZE[1]), attributes, Encoding::SMALL_LOSSLESS, channels)
    });
    let layers: Vec<_> = layers.collect();
    if let [one] = &layers[..] {
        Image::from_layer(one.clone()).write().to_file(path).unwrap();
    } else {
        let window = exr::prelude::IntegerBounds::from_dimensions((SIZE[0], SIZE[1]));
        let attributes = exr::prelude::ImageAttributes::new(window);
        Image::from_layers(attributes, layers).write().to_file(path).unwrap();
    }
}

fn rgb(more: &[(&'static str, Value)]) -> Vec<(&'static str, Value)> {
    [&["R", "G", "B"].map(|n| (n, 0.5.into()))[..], more].concat()
}

/// A picture that no encoder makes trivial.
fn picture() -> RgbImage {
    RgbImage::from_fn(96, 64, |x, y| Rgb([(x * 37 + y * 11) as u8, (x * y) as u8, (x ^ y) as u8]))
}

#[test]
fn files_that_are_broken_alike_are_no_equal_images() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for side in ["a", "b"] {
        fs::create_dir(at(side)).unwrap();
    }
    DynamicImage::ImageRgb8(picture()).save(at("whole.png")).unwrap();
    DynamicImage::ImageRgb8(picture()).save(at("whole.jpg")).unwrap();
    DynamicImage::ImageRgb8(picture()).save(at("whole.tif")).unwrap();
    DynamicImage::ImageRgb32F(DynamicImage::ImageRgb8(picture()).to_rgb32f()).save(at("whole.hdr")).unwrap();
    exr(&at("whole.exr"), &[("", &rgb(&[]))]);
    for format in ["png", "jpg", "tif", "hdr", "exr"] {
        let whole = fs::read(at(&format!("whole.{format}"))).unwrap();
        let name = format!("x.{format}");
        let both = |bytes: &[u8]| {
            for side in ["a", "b"] {
                fs::write(at(side).join(&name), bytes).unwrap();
            }
        };
        let files = [format!("a/{name}"), format!("b/{name}")];
        let args = [&files[0], &files[1], "--exact", "--fail", "differing<=0"];
        both(&whole);
        assert!(expect(folder.path(), 0, &args).contains("identical files: "), "{format}");
        // The last byte of a TIFF file may be one of padding.
        let last = if format == "tif" { whole.len() / 4 } else { whole.len() - 1 };
        for end in [whole.len() / 2, whole.len() * 9 / 10, last] {
            both(&whole[..end]);
            let printed = expect(folder.path(), 2, &args);
            assert!(printed.contains(&name) && printed.contains("not a readable"), "{format} at {end}: {printed}");
        }
    }
    // The checksum of a PNG; and folders.
    let mut bytes = fs::read(at("whole.png")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 4;
    for side in ["a", "b"] {
        fs::write(at(side).join("x.png"), &bytes).unwrap();
    }
    let printed = expect(folder.path(), 2, &["a", "b", "--exact", "--fail", "differing<=0"]);
    let errors = printed.lines().filter(|l| l.starts_with("ERROR")).count();
    assert_eq!(errors, 5, "{printed}");
}

#[test]
fn a_jpeg_that_breaks_off_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    DynamicImage::ImageRgb8(picture()).save(folder.path().join("a.jpg")).unwrap();
    let whole = fs::read(folder.path().join("a.jpg")).unwrap();
    for end in [whole.len() / 2, whole.len() * 9 / 10, whole.len() - 2] {
        fs::write(folder.path().join("cut.jpg"), &whole[..end]).unwrap();
        for more in [&[][..], &["--exact"]] {
            let printed = expect(folder.path(), 2, &[&["a.jpg", "cut.jpg"], more].concat());
            assert!(printed.contains("cut.jpg: not a readable image"), "{end}: {printed}");
        }
    }
}

#[test]
fn exact_tells_integers_apart_that_floats_cannot() {
    let folder = tempfile::tempdir().unwrap();
    for (name, id) in [("a.exr", 16_777_216u32), ("b.exr", 16_777_217), ("c.exr", u32::MAX), ("d.exr", u32::MAX - 1)] {
        exr(&folder.path().join(name), &[("", &[("id", id.into())])]);
    }
    for (a, b) in [("a.exr", "b.exr"), ("c.exr", "d.exr")] {
        for more in [&[][..], &["--layer", "id"], &["--all-layers"]] {
            let found = pair(folder.path(), &[&[a, b, "--exact"], more].concat());
            assert_eq!(
                (found["exact"]["differing"].as_u64(), found["exact"]["largest"].as_f64()),
                (Some(1), Some(1.0))
            );
            assert_eq!(found["exact"]["first"], serde_json::json!([SIZE[0] - 1, SIZE[1] - 1]));
        }
        expect(folder.path(), 1, &[a, b, "--exact", "--fail", "differing<=0"]);
        expect(folder.path(), 0, &[a, a, "--exact", "--fail", "differing<=0"]);
    }
}

#[test]
fn exact_compares_every_channel_of_every_part() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let alpha = |a: f64| rgb(&[("A", a.into()), ("Z", 0.5.into())]);
    exr(&at("a.exr"), &[("", &alpha(1.0))]);
    exr(&at("glass.exr"), &[("", &alpha(0.25))]);
    exr(&at("far.exr"), &[("", &rgb(&[("A", 1.0.into()), ("Z", 9.5.into())]))]);
    exr(&at("plain.exr"), &[("", &rgb(&[]))]);
    let exact = |test: &str| pair(folder.path(), &["a.exr", test, "--exact"])["exact"]["differing"].clone();
    assert_eq!([exact("a.exr"), exact("glass.exr"), exact("far.exr")], [0, 1, 1]);
    expect(folder.path(), 1, &["a.exr", "glass.exr", "--exact", "--fail", "differing<=0"]);
    let printed = expect(folder.path(), 2, &["a.exr", "plain.exr", "--exact"]);
    assert!(printed.contains("the reference has the channels A, B, G, R, Z and the test image B, G, R"), "{printed}");
    // One layer is one layer, where it is asked for.
    let depth = ["a.exr", "glass.exr", "--exact", "--layer", "Z", "--fail", "differing<=0"];
    expect(folder.path(), 0, &depth);
    // A second part.
    let (ours, near, far) = (rgb(&[]), [("depth", 0.5.into())], [("depth", 8.5.into())]);
    exr(&at("near-part.exr"), &[("beauty", &ours), ("aux", &near)]);
    exr(&at("far-part.exr"), &[("beauty", &ours), ("aux", &far)]);
    let found = pair(folder.path(), &["near-part.exr", "far-part.exr", "--exact"]);
    assert_eq!((found["exact"]["differing"].as_u64(), found["exact"]["largest"].as_f64()), (Some(1), Some(8.0)));
    // The difference has every channel.
    expect(folder.path(), 0, &["a.exr", "far.exr", "--exact", "--diff", "d.exr"]);
    let layers = Layers::read(&at("d.exr")).unwrap().layers;
    assert_eq!(layers.keys().collect::<Vec<_>>(), ["signed.A", "signed.B", "signed.G", "signed.R", "signed.Z"]);
    assert_eq!(layers["signed.Z"][PIXELS - 1], 9.0);
    expect(folder.path(), 0, &["a.exr", "far.exr", "--exact", "--diff", "d.png"]);
    let red = image::open(at("d.png")).unwrap().to_rgb8();
    assert_eq!(red.pixels().filter(|p| p.0 == [255, 0, 0]).count(), 1);
}

#[test]
fn what_is_not_compared_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    exr(&at("a.exr"), &[("", &rgb(&[("A", 1.0.into()), ("Z", 0.5.into())]))]);
    exr(&at("glass.exr"), &[("", &rgb(&[("A", 0.25.into()), ("id", 4.into())]))]);
    let note = |args: &[&str]| pair(folder.path(), args)["note"].as_str().map(str::to_owned);
    let told = "not compared: A of both; Z of the reference alone; id of the test image alone";
    assert_eq!(note(&["a.exr", "glass.exr"]).as_deref(), Some(told));
    assert!(expect(folder.path(), 0, &["a.exr", "glass.exr"]).contains(&format!("note: {told}\n")));
    assert_eq!(note(&["a.exr", "a.exr"]).as_deref(), Some("not compared: A, Z of both"));
    let many: Vec<String> = (0..12).map(|i| format!("light-{i:02}")).collect();
    let many: Vec<(&str, Value)> = many.iter().map(|n| (n.as_str(), 0.5.into())).collect();
    let mut all: Vec<(&str, Value)> = rgb(&[]);
    all.extend(many);
    exr(&at("many.exr"), &[("", &all)]);
    let told = note(&["many.exr", "many.exr"]).unwrap();
    assert!(told.ends_with("light-06, light-07 and 4 more of both"), "{told}");
    assert_eq!(note(&["many.exr", "many.exr", "--exact"]), None);
    let glass = RgbaImage::from_fn(20, 12, |x, _| Rgba([9, 9, 9, x as u8]));
    glass.save(at("glass.png")).unwrap();
    assert_eq!(note(&["glass.png", "glass.png"]).as_deref(), Some("not compared: A of both"));
}

#[test]
fn one_of_three_is_not_taken_for_grey_and_the_one_layer_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    exr(&at("xyz.exr"), &[("", &["X", "Y", "Z"].map(|n| (n, 0.5.into())))]);
    let printed = expect(folder.path(), 2, &["xyz.exr", "xyz.exr"]);
    assert!(printed.contains("several layers, name one of them: X, Y, Z"), "{printed}");
    expect(folder.path(), 0, &["xyz.exr", "xyz.exr", "--layer", "Y"]);
    // Grey with its depth is grey.
    exr(&at("depth.exr"), &[("", &["Y", "Z"].map(|n| (n, 0.5.into())))]);
    expect(folder.path(), 0, &["depth.exr", "depth.exr"]);

    let beauty = ["beauty.R", "beauty.G", "beauty.B", "beauty.A"].map(|n| (n, 0.5.into()));
    exr(&at("beauty.exr"), &[("", &beauty)]);
    assert_eq!(pair(folder.path(), &["beauty.exr", "beauty.exr"])["layer"], "beauty.RGB");
    let two = [&beauty[..3], &["spec.R", "spec.G", "spec.B"].map(|n| (n, 0.5.into()))].concat();
    exr(&at("two.exr"), &[("", &two)]);
    let printed = expect(folder.path(), 2, &["two.exr", "two.exr"]);
    assert!(printed.contains("name one of them: beauty, spec"), "{printed}");

    // A layer of one file against the plain channels of another, and against one of
    // another name.
    exr(&at("plain.exr"), &[("", &rgb(&[]))]);
    for more in [&[][..], &["--exact"]] {
        for files in
            [["two.exr:beauty", "plain.exr"], ["plain.exr", "two.exr:beauty"], ["two.exr:beauty", "two.exr:spec"]]
        {
            let found = pair(folder.path(), &[&files[..], more].concat());
            assert_eq!(found["exact"]["differing"], 0, "{files:?} {more:?}: {found}");
        }
    }
    let printed = expect(folder.path(), 2, &["two.exr:beauty", "plain.exr", "--all-layers"]);
    assert!(printed.contains("--all-layers takes all of both"), "{printed}");
    let printed = expect(folder.path(), 2, &["two.exr:none", "plain.exr"]);
    assert!(printed.contains("no layer 'none'; there are: beauty, spec"), "{printed}");
}

#[test]
fn codes_and_light_are_compared_where_it_is_said_which_is_which() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let code = |x: u32| (x * 12) as u8;
    let light = |x: u32| {
        let v = f32::from(code(x)) / 255.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    RgbImage::from_fn(20, 12, |x, _| Rgb([code(x); 3])).save(at("codes.png")).unwrap();
    DynamicImage::ImageRgb32F(Rgb32FImage::from_fn(20, 12, |x, _| Rgb([light(x); 3]))).save(at("light.tiff")).unwrap();
    let plane = |f: &dyn Fn(u32) -> f32| (0..PIXELS as u32).map(|i| f(i % 20)).collect::<Vec<f32>>();
    let write = |name: &str, f: &dyn Fn(u32) -> f32| {
        ["R", "G", "B"].iter().fold(Layers::new([20, 12]), |l, n| l.with(n, plane(f))).write(&at(name)).unwrap();
    };
    write("light.exr", &light);
    write("codes.exr", &|x| f32::from(code(x)) / 255.0);

    let printed = expect(folder.path(), 2, &["codes.png", "light.exr"]);
    assert!(printed.contains("--reference-encoding or --test-encoding"), "{printed}");
    for (files, options) in [
        (["codes.png", "light.exr"], &["--reference-encoding", "srgb"][..]),
        (["codes.png", "light.exr"], &["--test-encoding", "linear"]),
        (["light.tiff", "codes.png"], &["--test-encoding", "srgb"]),
        (["codes.exr", "light.exr"], &["--reference-encoding", "srgb"]),
        (["codes.exr", "light.exr"], &["--encoding", "linear", "--reference-encoding", "srgb"]),
    ] {
        let found = pair(folder.path(), &[&files[..], options].concat());
        assert!(value(&found, "mae") < 1e-6, "{files:?} {options:?}: {found}");
        assert_eq!(found["scores"]["encoding"], "linear");
    }
    // Taken for the same, they are not.
    let found = pair(folder.path(), &["codes.png", "light.exr", "--encoding", "linear"]);
    assert!(value(&found, "mae") > 0.1, "{found}");
    let both = ["codes.png", "codes.exr", "--reference-encoding", "srgb", "--test-encoding", "srgb"];
    let found = pair(folder.path(), &both);
    assert!(value(&found, "mae") < 1e-6 && found["scores"]["encoding"] == "srgb", "{found}");
    expect(folder.path(), 2, &["codes.png", "codes.png", "--exact", "--test-encoding", "srgb"]);
}

#[test]
fn grey_tiff_of_floats_is_read() {
    use tiff::encoder::{TiffEncoder, colortype};
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let write = |name: &str, last: f32| {
        let values = [vec![0.5f32; PIXELS - 1], vec![last]].concat();
        let mut encoder = TiffEncoder::new(fs::File::create(at(name)).unwrap()).unwrap();
        encoder.write_image::<colortype::Gray32Float>(20, 12, &values).unwrap();
    };
    write("a.tiff", 0.5);
    write("b.tiff", 1.5);
    let exact = pair(folder.path(), &["a.tiff", "b.tiff", "--exact"]);
    assert_eq!((exact["exact"]["differing"].as_u64(), exact["exact"]["largest"].as_f64()), (Some(1), Some(1.0)));
    let found = pair(folder.path(), &["a.tiff", "b.tiff"]);
    assert!((value(&found, "mae") - 1.0 / PIXELS as f64).abs() < 1e-9, "{found}");
    assert_eq!((found["scores"]["encoding"].as_str(), found["scores"]["channels"].as_u64()), (Some("linear"), Some(1)));
    Layers::new([20, 12]).with("Y", vec![0.5; PIXELS]).write(&at("a.exr")).unwrap();
    assert_eq!(pair(folder.path(), &["a.tiff", "a.exr"])["exact"]["differing"], 0);
    // Integers of 32 bits are refused by a sentence.
    let mut encoder = TiffEncoder::new(fs::File::create(at("ids.tiff")).unwrap()).unwrap();
    encoder.write_image::<colortype::Gray32>(20, 12, &[7; PIXELS]).unwrap();
    let printed = expect(folder.path(), 2, &["ids.tiff", "a.tiff"]);
    assert!(printed.contains("save it as floats, or as 16-bit integers"), "{printed}");
    GrayImage::new(20, 12).save(at("grey.tiff")).unwrap();
    assert_eq!(pair(folder.path(), &["grey.tiff", "grey.tiff", "--exact"])["exact"]["differing"], 0);
}

/// Positions and normals have a Y, too.
#[test]
fn the_y_of_a_vector_is_no_grey_layer() {
    let folder = tempfile::tempdir().unwrap();
    let normals = |x: f64| {
        ["Normal.X", "Normal.Y", "Normal.Z", "ao.Y"].map(|n| (n, if n == "Normal.X" { x } else { 0.5 }.into()))
    };
    exr(&folder.path().join("a.exr"), &[("", &normals(0.5))]);
    exr(&folder.path().join("b.exr"), &[("", &normals(0.9))]);
    let says = expect(folder.path(), 2, &["a.exr", "b.exr", "--layer", "Normal"]);
    assert!(says.contains("no layer 'Normal'") && says.contains("Normal.X, Normal.Y, Normal.Z, ao"), "{says}");
    let mae = |layer: &str| value(&pair(folder.path(), &["a.exr", "b.exr", "--layer", layer]), "mae");
    assert!(mae("Normal.X") > 0.0 && mae("Normal.Y") == 0.0);
    // By its name in the file, as well.
    assert_eq!((mae("ao"), mae("ao.Y")), (0.0, 0.0));
}

/// What is not looked at is told: pages and frames behind the first.
#[test]
fn further_pages_and_frames_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let frames = |name: &str, second: u8| {
        let mut encoder = png::Encoder::new(fs::File::create(at(name)).unwrap(), 4, 4);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_animated(2, 0).unwrap();
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&[7; 16]).unwrap();
        writer.write_image_data(&[second; 16]).unwrap();
        writer.finish().unwrap();
    };
    frames("a.png", 1);
    frames("b.png", 200);
    DynamicImage::ImageRgb8(picture()).save(at("a.tif")).unwrap();
    let mut tiff = fs::read(at("a.tif")).unwrap();
    let first = u32::from_le_bytes(tiff[4..8].try_into().unwrap()) as usize;
    let entries = u16::from_le_bytes(tiff[first..first + 2].try_into().unwrap()) as usize;
    let next = first + 2 + 12 * entries;
    let page = tiff[first..next + 4].to_vec();
    let second = tiff.len() as u32;
    tiff[next..next + 4].copy_from_slice(&second.to_le_bytes());
    tiff.extend(page);
    fs::write(at("b.tif"), &tiff).unwrap();
    for (a, b, note) in [
        ("a.png", "b.png", "further frames of the reference; further frames of the test image"),
        ("a.tif", "b.tif", "further pages of the test image"),
    ] {
        let exact = pair(folder.path(), &[a, b, "--exact"]);
        assert_eq!(exact["note"].as_str(), Some(&*format!("not compared: {note}")), "{exact}");
        let measured = pair(folder.path(), &[a, b]);
        assert!(measured["note"].as_str().unwrap().contains("further "), "{measured}");
    }
}
