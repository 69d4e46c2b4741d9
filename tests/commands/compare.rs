//! `aogauge compare`, from outside.

use aogauge::layers::Layers;
use image::{Luma, Rgb, RgbImage, Rgba, RgbaImage};
use serde_json::Value;
use std::{
    path::Path,
    process::{Command, Output},
};

fn compare(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(folder).arg("compare").args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn json(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What `--format json` says of the one pair.
fn pair(output: &Output) -> Value {
    json(output)["pairs"][0].take()
}

fn value(pair: &Value, name: &str) -> f64 {
    pair["scores"]["scores"].as_array().unwrap().iter().find(|s| s["name"] == name).unwrap()["value"].as_f64().unwrap()
}

/// Two pictures that differ by 0.2 in the left half.
fn pictures(folder: &Path) {
    let picture = |left: u8| RgbImage::from_fn(40, 30, |x, _| Rgb([if x < 20 { left } else { 102 }; 3]));
    picture(102).save(folder.join("a.png")).unwrap();
    picture(153).save(folder.join("b.png")).unwrap();
}

#[test]
fn every_metric_is_printed_and_masks_weigh() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let out = compare(folder.path(), &["a.png", "b.png"]);
    let table = text(&out.stdout);
    for name in ["mean-error", "mae", "mse", "rmse", "psnr", "relative-mse", "smape", "ssim", "ms-ssim", "flip"] {
        assert!(table.lines().any(|l| l.starts_with(name)), "{name}: {table}");
    }
    assert!(table.contains("40 x 30 pixels, 3 channels, srgb"), "{table}");
    assert!(table.contains("the shorter side is 30, it must be 176 pixels or more for MS-SSIM"), "{table}");
    let scores = pair(&compare(folder.path(), &["a.png", "b.png", "--format", "json"]));
    assert!((value(&scores, "mae") - 0.1).abs() < 1e-7 && (value(&scores, "psnr") - 16.9897).abs() < 1e-4);

    image::GrayImage::from_fn(40, 30, |x, _| Luma([if x < 10 { 255 } else { 0 }]))
        .save(folder.path().join("m.png"))
        .unwrap();
    let masked = pair(&compare(folder.path(), &["a.png", "b.png", "--mask", "m.png", "--format", "json"]));
    assert!((value(&masked, "mae") - 0.2).abs() < 1e-7);
    assert_eq!(masked["scores"]["weight"], 300.0);
}

#[test]
fn what_the_numbers_stand_for_decides_flip_alone() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let codes = pair(&compare(folder.path(), &["a.png", "b.png", "--format", "json"]));
    let linear = pair(&compare(folder.path(), &["a.png", "b.png", "--encoding", "linear", "--format", "json"]));
    assert_eq!(value(&codes, "ssim"), value(&linear, "ssim"));
    assert!((value(&codes, "flip") - value(&linear, "flip")).abs() > 0.01);
    assert_eq!(
        (codes["scores"]["encoding"].as_str(), linear["scores"]["encoding"].as_str()),
        (Some("srgb"), Some("linear"))
    );
}

#[test]
fn regions_are_a_product_and_a_crop_cuts() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    image::GrayImage::from_fn(40, 30, |_, y| Luma([if y < 15 { 255 } else { 0 }]))
        .save(folder.path().join("m.png"))
        .unwrap();
    let found =
        |args: &[&str]| pair(&compare(folder.path(), &[&["a.png", "b.png", "--format", "json"], args].concat()));
    let left = found(&["--only", "0,0,20,30", "--ignore", "0,0,10,30", "--mask", "m.png"]);
    assert_eq!((left["scores"]["weight"].as_f64(), left["exact"]["pixels"].as_u64()), (Some(150.0), Some(150)));
    assert!((value(&left, "mae") - 0.2).abs() < 1e-7);
    let crop = found(&["--crop", "10,5,20,12", "--ignore", "0,0,15,30"]);
    assert_eq!(crop["scores"]["size"], serde_json::json!([20, 12]));
    assert_eq!((crop["exact"]["pixels"].as_u64(), crop["exact"]["share"].as_f64()), (Some(180), Some(1.0 / 3.0)));
    assert_eq!(crop["exact"]["first"], serde_json::json!([15, 5]));
    // Of the whole image, both.
    assert_eq!(crop["scores"]["maps"]["absolute"]["max_at"], serde_json::json!([15, 5]));
    let exact = found(&["--exact", "--crop", "10,5,20,12", "--ignore", "0,0,15,30"]);
    assert_eq!(exact["exact"]["share"], crop["exact"]["share"]);
    assert_eq!(exact["exact"]["first"], crop["exact"]["first"]);
    // A mask is a layer of an OpenEXR file too.
    let weights = (0..1200).map(|i| if i % 40 < 10 { 1.0 } else { 0.0 }).collect();
    Layers::new([40, 30]).with("left", weights).write(&folder.path().join("regions.exr")).unwrap();
    assert_eq!(found(&["--mask", "regions.exr:left"])["scores"]["weight"], 300.0);
}

#[test]
fn the_exact_mode_counts_codes() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let found = |args: &[&str]| pair(&compare(folder.path(), &[args, &["--exact", "--format", "json"]].concat()));
    let all = found(&["a.png", "b.png"]);
    assert_eq!((all["outcome"].as_str(), all["exact"]["differing"].as_u64()), (Some("measured"), Some(600)));
    assert_eq!(all["exact"]["largest"], 51.0 / 255.0);
    assert_eq!(found(&["a.png", "b.png", "--tolerance", "51/255"])["exact"]["differing"], 0);
    assert_eq!(found(&["a.png", "b.png", "--tolerance", "50/255"])["exact"]["differing"], 600);
    // The metrics see the same.
    let floats = pair(&compare(folder.path(), &["a.png", "b.png", "--tolerance", "51/255", "--format", "json"]));
    assert_eq!(floats["exact"]["differing"], 0);
    std::fs::copy(folder.path().join("a.png"), folder.path().join("c.png")).unwrap();
    assert_eq!(found(&["a.png", "c.png"])["exact"]["identical_files"], true);
    let table = text(&compare(folder.path(), &["a.png", "c.png", "--exact"]).stdout);
    assert_eq!(table, "identical files: 40 x 30 pixels, none differs\n");
    // A tolerance of floats is no rounding of codes.
    for (name, value) in [("small", 1e-6), ("other", 1.2e-6)] {
        Layers::new([40, 30])
            .with("mean", vec![value; 1200])
            .write(&folder.path().join(format!("{name}.exr")))
            .unwrap();
    }
    let floats =
        |tolerance: &str| found(&["small.exr", "other.exr", "--tolerance", tolerance])["exact"]["differing"].clone();
    assert_eq!([floats("1e-8"), floats("1.9e-7"), floats("2.1e-7")], [1200, 1200, 0]);
    // Other bytes, the same pixels, 16 bits.
    image::open(folder.path().join("a.png")).unwrap().to_rgb16().save(folder.path().join("wide.png")).unwrap();
    let wide = found(&["a.png", "wide.png"]);
    assert_eq!(
        (wide["exact"]["identical_files"].as_bool(), wide["exact"]["differing"].as_u64()),
        (Some(false), Some(0))
    );
}

#[test]
fn every_layer_is_a_row() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, depth: f32, extra: &str| {
        let layers = ["R", "G", "B", "depth", extra]
            .iter()
            .fold(Layers::new([20, 20]), |l, n| l.with(n, vec![if *n == "depth" { depth } else { 0.5 }; 400]));
        layers.write(&folder.path().join(name)).unwrap();
    };
    file("a.exr", 0.25, "old");
    file("b.exr", 0.75, "fresh");
    let out = compare(folder.path(), &["a.exr", "b.exr", "--all-layers", "--format", "json", "--fail", "mae<=0.1"]);
    assert_eq!(out.status.code(), Some(2), "a layer in one file only is an error");
    let found: Value = serde_json::from_slice(&out.stdout).unwrap();
    let rows: Vec<_> = found["pairs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| (p["layer"].as_str().unwrap(), p["outcome"].as_str().unwrap()))
        .collect();
    assert_eq!(rows, [("RGB", "pass"), ("depth", "fail"), ("old", "error"), ("fresh", "error")]);
    assert!(found["pairs"][2]["reason"].as_str().unwrap().contains("the layer is in a.exr alone"));
    let exact = compare(folder.path(), &["a.exr", "b.exr", "--all-layers", "--exact", "--maps", "m"]);
    assert_eq!(exact.status.code(), Some(2));
    let exact = compare(folder.path(), &["a.exr", "b.exr", "--layer", "depth", "--exact", "--format", "json"]);
    assert_eq!(pair(&exact)["exact"]["differing"], 400);
}

#[test]
fn one_picture_shows_both_images_and_the_map() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let out = compare(folder.path(), &["a.png", "b.png", "--diff", "out/d.png"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let picture = image::open(folder.path().join("out/d.png")).unwrap().to_rgb8();
    assert!(picture.width() > 1500 && picture.height() > 390);
    for code in [102u8, 153] {
        assert!(picture.pixels().any(|p| p.0 == [code; 3]), "{code}");
    }
}

#[test]
fn the_difference_is_written_as_numbers() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let signed = |args: &[&str]| {
        let out = compare(folder.path(), &[args, &["--diff", "d.EXR"]].concat());
        assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
        Layers::read(&folder.path().join("d.EXR")).unwrap()
    };
    for exact in [&[][..], &["--exact"]] {
        let found = signed(&[&["b.png", "a.png", "--crop", "15,2,10,3"], exact].concat());
        assert_eq!(found.resolution, [10, 3]);
        assert_eq!(found.layers.keys().collect::<Vec<_>>(), ["signed.B", "signed.G", "signed.R"]);
        for values in found.layers.values() {
            assert!(values.iter().zip(0..).all(|(v, i)| (v + if i % 10 < 5 { 0.2 } else { 0.0 }).abs() < 1e-6));
        }
    }
    let write = |name: &str, value| {
        let mut values = vec![value; 12];
        values[7] = f32::NAN;
        Layers::new([4, 3]).with("mean", values).write(&folder.path().join(name)).unwrap();
    };
    write("a.exr", 0.75);
    write("b.exr", 2.0);
    for exact in [&[][..], &["--exact"]] {
        let found = signed(&[&["a.exr", "b.exr"], exact].concat());
        let values = found.get("signed").unwrap();
        assert!(values[7].is_nan() && values[6] == 1.25, "{values:?}");
    }
}

#[test]
fn exact_shows_which_pixels_differ() {
    let folder = tempfile::tempdir().unwrap();
    let picture =
        |seen: u8| RgbaImage::from_fn(6, 4, |x, y| Rgba([x as u8 * 40, 0, 0, if y == 1 { seen } else { 255 }]));
    picture(255).save(folder.path().join("a.png")).unwrap();
    picture(250).save(folder.path().join("b.png")).unwrap();
    let marked = |args: &[&str]| {
        let out = compare(folder.path(), &[args, &["--exact", "--diff", "out/d.png", "--format", "json"]].concat());
        let found = pair(&out);
        let picture = image::open(folder.path().join("out/d.png")).unwrap().to_rgb8();
        let red = picture.enumerate_pixels().filter(|(.., p)| p.0 == [255, 0, 0]);
        let red: Vec<_> = red.map(|(x, y, _)| [x, y]).collect();
        assert_eq!(found["exact"]["differing"], red.len());
        // The rest is a faded picture of the reference.
        assert!(picture.pixels().all(|p| p.0 == [255, 0, 0] || p.0[0] == p.0[1] && p.0[1] == p.0[2] && p.0[0] > 190));
        (found, red)
    };
    // In alpha alone, of pixels that count.
    let (_, red) = marked(&["a.png", "b.png", "--ignore", "0,0,4,4"]);
    assert_eq!(red, [[4, 1], [5, 1]]);
    assert_eq!(marked(&["a.png", "b.png", "--tolerance", "5/255"]).1.len(), 0);
    std::fs::copy(folder.path().join("a.png"), folder.path().join("same.png")).unwrap();
    let (found, red) = marked(&["a.png", "same.png"]);
    assert_eq!((found["exact"]["identical_files"].as_bool(), red.len()), (Some(true), 0));
}

#[test]
fn alpha_in_one_image_is_told() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    image::open(folder.path().join("b.png")).unwrap().to_rgba8().save(folder.path().join("solid.png")).unwrap();
    let told =
        "the reference has the channels R, G, B and the test image R, G, B, A: alpha is 1 everywhere and left out";
    assert_eq!(pair(&compare(folder.path(), &["a.png", "solid.png", "--format", "json"]))["note"], told);
    assert!(text(&compare(folder.path(), &["a.png", "solid.png"]).stdout).contains(&format!("note: {told}\n")));
    assert!(pair(&compare(folder.path(), &["solid.png", "solid.png", "--format", "json"]))["note"].is_null());
    // OpenEXR too.
    let file = |name: &str, alpha: Option<f32>| {
        let colors = ["R", "G", "B"].iter().fold(Layers::new([4, 1]), |l, n| l.with(&format!("c.{n}"), vec![0.5; 4]));
        let all = alpha.map_or(colors.clone(), |a| colors.with("c.A", vec![1.0, 1.0, 1.0, a]));
        all.write(&folder.path().join(name)).unwrap();
    };
    file("a.exr", None);
    file("solid.exr", Some(1.0));
    file("glass.exr", Some(0.5));
    let args = ["solid.exr", "a.exr", "--layer", "c", "--format", "json"];
    assert!(pair(&compare(folder.path(), &args))["note"].as_str().unwrap().contains("alpha is 1 everywhere"));
    let out = compare(folder.path(), &["glass.exr", "a.exr", "--layer", "c"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(
        text(&out.stderr).contains("channels R, G, B, A and the test image R, G, B, and alpha is not 1 everywhere")
    );
}

#[test]
fn maps_are_pictures_and_numbers() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let out = compare(folder.path(), &["a.png", "b.png", "--maps", "maps", "--encoding", "linear", "--hdr"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    for name in ["absolute", "signed", "ssim", "flip", "hdr-flip"] {
        let picture = image::open(folder.path().join(format!("maps/{name}.png"))).unwrap();
        assert!(picture.width() >= 480 && picture.height() > 300, "{name}");
    }
    let maps = Layers::read(&folder.path().join("maps/maps.exr")).unwrap();
    assert_eq!(maps.layers.keys().collect::<Vec<_>>(), ["absolute", "flip", "hdr-flip", "signed", "ssim"]);
    let signed = maps.get("signed").unwrap();
    assert!((signed[0] - 0.2).abs() < 1e-6 && signed[39] == 0.0);
    assert!(maps.get("ssim").unwrap()[0].is_nan());
    assert_eq!(maps.attributes["signed.to"], "0.25");
}

/// However the file is spelled, and whichever of the inputs it is.
#[test]
fn nothing_that_is_read_is_written_over() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    pictures(folder);
    image::GrayImage::from_pixel(40, 30, Luma([255])).save(folder.join("m.png")).unwrap();
    let files = || ["a.png", "b.png", "m.png"].map(|f| std::fs::read(folder.join(f)).unwrap());
    let before = files();
    let absolute = folder.join("a.png");
    let ways = ["a.png", "./b.png", "m.png", "nosuch/../a.png", absolute.to_str().unwrap()];
    #[cfg(unix)]
    let by_links = {
        std::os::unix::fs::symlink("a.png", folder.join("link.png")).unwrap();
        std::os::unix::fs::symlink(".", folder.join("here")).unwrap();
        ["link.png", "here/b.png"]
    };
    #[cfg(not(unix))]
    let by_links: [&str; 0] = [];
    for diff in ways.into_iter().chain(by_links) {
        for more in [&[][..], &["--exact"]] {
            let out = compare(folder, &[&["a.png", "b.png", "--mask", "m.png", "--diff", diff], more].concat());
            assert_eq!(out.status.code(), Some(2), "{diff}");
            assert!(text(&out.stderr).contains("--diff would write over"), "{diff}: {}", text(&out.stderr));
            assert!(files() == before && !folder.join("nosuch").exists(), "{diff}");
        }
    }

    // Every file that maps are written to may be an input.
    record_image(&folder.join("a.exr"), 1, 0.0);
    record_image(&folder.join("b.exr"), 2, 0.0);
    let out = compare(folder, &["a.exr", "b.exr", "--hdr", "--maps", "m"]);
    assert_eq!(out.status.code(), Some(0), "{}", text(&out.stderr));
    let names = || -> Vec<_> { std::fs::read_dir(folder.join("m")).unwrap().map(|e| e.unwrap().path()).collect() };
    let maps: Vec<_> = names().iter().map(|path| std::fs::read(path).unwrap()).collect();
    assert_eq!(maps.len(), 8, "{:?}", names());
    for file in names() {
        let file = file.to_str().unwrap();
        for pair in [[file, "a.exr"], ["a.exr", file]] {
            let out = compare(folder, &[&pair[..], &["--maps", "./m"]].concat());
            assert_eq!(out.status.code(), Some(2), "{file}");
            assert!(text(&out.stderr).contains("--maps would write over ./m/"), "{}", text(&out.stderr));
        }
    }
    assert!(names().iter().map(|path| std::fs::read(path).unwrap()).eq(maps));
}

#[test]
fn nan_is_counted_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, values: Vec<f32>| {
        Layers::new([4, 1]).with("mean", values).write(&folder.path().join(name)).unwrap();
    };
    write("a.exr", vec![0.5, f32::NAN, 0.5, f32::NAN]);
    write("b.exr", vec![0.5, f32::NAN, f32::INFINITY, 0.25]);
    let out = compare(folder.path(), &["a.exr", "b.exr", "--format", "json", "--maps", "maps"]);
    let maps = Layers::read(&folder.path().join("maps/maps.exr")).unwrap();
    for map in ["absolute", "signed", "flip"] {
        let is_known: Vec<bool> = maps.get(map).unwrap().iter().map(|v| v.is_finite()).collect();
        assert_eq!(is_known, [true, false, false, false], "{map}");
    }
    // A number against none is a fault, with and without limits.
    assert_eq!(out.status.code(), Some(1));
    let scores: Value = serde_json::from_slice(&out.stdout).unwrap();
    let scores = scores["pairs"][0].clone();
    assert_eq!(scores["scores"]["non_finite"], serde_json::json!({ "reference": 1, "test": 1, "both": 1 }));
    assert_eq!((value(&scores, "mae"), scores["scores"]["weight"].as_f64()), (0.0, Some(1.0)));
    assert!(text(&out.stderr).contains("1 pixel of the reference alone, 1 of the test image alone and 1 of both"));
}

#[test]
fn mistakes_end_with_2_and_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    RgbImage::new(8, 9).save(folder.path().join("small.png")).unwrap();
    image::GrayImage::new(40, 30).save(folder.path().join("grey.png")).unwrap();
    std::fs::write(folder.path().join("words.png"), "words").unwrap();
    image::Rgb32FImage::new(40, 30).save(folder.path().join("floats.hdr")).unwrap();
    ["R", "G", "B"]
        .iter()
        .fold(Layers::new([40, 30]), |l, n| l.with(n, vec![0.5; 1200]))
        .write(&folder.path().join("floats.exr"))
        .unwrap();
    RgbaImage::from_fn(40, 30, |x, _| Rgba([102, 102, 102, x as u8])).save(folder.path().join("glass.png")).unwrap();
    for (args, message) in [
        (&["a.png", "none.png"][..], "none.png: cannot read the image"),
        (&["a.png", "words.png"], "words.png: not a readable image"),
        (&["a.png", "small.png"], "40 x 30 pixels, the test image 8 x 9"),
        (&["a.png", "grey.png"], "the reference has 3, the test image 1"),
        (&["a.png", "b.png", "--mask", "small.png"], "the mask has 8 x 9 pixels, the images have 40 x 30"),
        (&["a.png", "b.png", "--mask", "grey.png"], "1200 are masked"),
        (&["a.png", "b.png", "--ppd", "0"], "pixels per degree is 0, it must be 1 to 1000"),
        (&["a.png", "b.png", "--layer", "mean"], "only OpenEXR images have layers"),
        (&["a.png", "b.png", "--maps", "m", "--scale=-1"], "scale"),
        (&["a.png", "b.png", "--fail", "flap<=1"], "there is no 'flap'"),
        (&["a.png", "b.png", "--fail", "ssimulacra2>=90"], "reported and has no limit"),
        (
            &["a.png", "b.png", "--exact", "--fail", "flip<=1"],
            "--exact computes differing and largest-difference alone",
        ),
        (&["a.png", "b.png", "--exact", "--maps", "m"], "cannot be used with"),
        (&["none.png", "b.png", "--diff", "d.jpg"], "must end in .png, for a picture, or in .exr, for the signed"),
        (&["none.png", "b.png", "--diff", "d"], "must end in .png, for a picture, or in .exr, for the signed"),
        (&["a.png", "floats.exr"], "the test image holds floats (as OpenEXR does), which are taken for linear light"),
        (&["a.png", "floats.exr", "--exact"], "one image holds integers (8 or 16 bits a channel) and the other floats"),
        (&["a.png", "floats.hdr", "--exact"], "one image holds integers (8 or 16 bits a channel) and the other floats"),
        (
            &["a.png", "glass.png"],
            "has the channels R, G, B and the test image R, G, B, A, and alpha is not 1 everywhere",
        ),
        (&["a.png", "b.png", "--exact", "--fail", "welch.tiles<=0"], "--exact computes differing"),
        (&["a.png", "b.png", "--tolerance", "2"], "not within 0 to 1"),
        (&["a.png", "b.png", "--ignore", "1,2,3"], "is no rectangle"),
        (&["a.png", "b.png", "--ignore", "30,0,11,1"], "--ignore 30,0,11,1 reaches beyond the image of 40 x 30 pixels"),
        (&["a.png", "a.png", "--exact", "--crop", "0,0,1,31"], "--crop 0,0,1,31 reaches beyond"),
        (&["a.png", "b.png", "--limits", "none.toml"], "none.toml: cannot read the file"),
        (&["a.png", "small.png", "--exact"], "40 x 30 pixels, the test image 8 x 9"),
        (&["a.png", "grey.png", "--exact"], "the reference has 3, the test image 1"),
        (&["words.png", "words.png", "--exact"], "words.png: not a readable image"),
        (&["a.png", "."], ". is a folder and a.png is none"),
    ] {
        let out = compare(folder.path(), args);
        assert_eq!(out.status.code(), Some(2), "{args:?}");
        assert!(text(&out.stderr).contains(message), "{args:?}: {}", text(&out.stderr));
    }
}

/// 8 replicates of 40 x 30 pixels of noise, and `bias` in one tile.
fn record_image(path: &Path, seed: u32, bias: f32) {
    let mut x = seed;
    let mut layers = Layers::new([40, 30]);
    let mut mean = vec![0.0; 1200];
    for replicate in 0..8 {
        let image: Vec<f32> = (0..1200)
            .map(|i| {
                x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let noise = (x >> 8) as f32 / 16_777_216.0 * 0.2;
                0.5 + noise + if i % 40 < 16 && i / 40 < 16 { bias } else { 0.0 }
            })
            .collect();
        mean.iter_mut().zip(&image).for_each(|(m, v)| *m += v / 8.0);
        layers = layers.with(&format!("replicate-{replicate:04}"), image);
    }
    layers.with("mean", mean).write(path).unwrap();
}

#[test]
fn replicates_are_tested_at_three_scales() {
    let folder = tempfile::tempdir().unwrap();
    record_image(&folder.path().join("a.exr"), 1, 0.0);
    record_image(&folder.path().join("same.exr"), 2, 0.0);
    record_image(&folder.path().join("brighter.exr"), 3, 0.05);
    let rejected = |test: &str| -> Vec<usize> {
        let found = pair(&compare(folder.path(), &["a.exr", test, "--format", "json", "--maps", "maps"]));
        found["welch"]["scales"].as_array().unwrap().iter().map(|s| s["rejected"].as_array().unwrap().len()).collect()
    };
    assert_eq!(rejected("same.exr"), [0, 0, 0]);
    let [_, tiles, image] = rejected("brighter.exr")[..] else { panic!("three scales") };
    assert_eq!((tiles, image), (1, 1));
    let maps = Layers::read(&folder.path().join("maps/maps.exr")).unwrap();
    assert!(maps.get("p-value").unwrap().iter().all(|p| (0.0..=1.0).contains(p)));
    let table = text(&compare(folder.path(), &["a.exr", "brighter.exr"]).stdout);
    assert!(table.contains("surest at 0, 0 (16 x 16): bias +0.0"), "{table}");
    assert!(table.contains("would have been found") && table.contains("95 % interval +0.0"), "{table}");
}

#[test]
fn the_test_of_replicates_has_limits() {
    let folder = tempfile::tempdir().unwrap();
    record_image(&folder.path().join("a.exr"), 1, 0.0);
    record_image(&folder.path().join("same.exr"), 2, 0.0);
    record_image(&folder.path().join("brighter.exr"), 3, 0.05);
    Layers::new([40, 30]).with("mean", vec![0.6; 1200]).write(&folder.path().join("plain.exr")).unwrap();
    let held = |test: &str, limit: &str| {
        let out = compare(folder.path(), &["a.exr", test, "--format", "json", "--fail", limit]);
        let found: Value = serde_json::from_slice(&out.stdout).unwrap();
        (out.status.code().unwrap(), found["pairs"][0]["limits"][0].clone())
    };
    for limit in ["welch.rejected<=0", "welch.tiles<=0", "welch.image<=0"] {
        assert_eq!(held("same.exr", limit).0, 0, "{limit}");
        assert_eq!(held("brighter.exr", limit).0, 1, "{limit}");
    }
    assert_eq!(held("brighter.exr", "welch.rejected<=0").1["value"], 2.0);
    assert_eq!(held("brighter.exr", "welch.tiles<=1").0, 0);
    // Of 1200 pixels 256 by 0.05.
    let (code, bias) = held("brighter.exr", "welch.bias<=0.02");
    assert!(code == 0 && (bias["value"].as_f64().unwrap() - 0.05 * 256.0 / 1200.0).abs() < 0.003, "{bias}");
    // Where no replicate differs from another there is nothing to test with, whatever a ray is worth.
    let still = |name: &str, last: f32| {
        let image = || [vec![0.5; 1199], vec![last]].concat();
        let mut layers = Layers::new([40, 30]).with("mean", image());
        layers.attributes.insert("rays".to_owned(), "4".to_owned());
        (0..4)
            .fold(layers, |l, r| l.with(&format!("replicate-{r:04}"), image()))
            .write(&folder.path().join(name))
            .unwrap();
    };
    still("still.exr", 0.5);
    still("moved.exr", 0.7);
    for limit in ["welch.rejected<=0", "welch.pixels<=0"] {
        let out = compare(folder.path(), &["still.exr", "moved.exr", "--fail", limit]);
        assert_eq!(out.status.code(), Some(6), "{limit}: {}", text(&out.stdout));
    }
    let (code, none) = held("plain.exr", "welch.rejected<=0");
    assert_eq!((code, none["state"].as_str()), (6, Some("no-value")));
    assert!(none["note"].as_str().unwrap().contains("two replicates or more"));
}

/// Openness of binary rays, near 1, with 4 rays on one side and 32 on the other: no
/// more rejections than the family error allows. Seeds are fixed.
#[test]
fn unequal_rays_do_not_reject() {
    let folder = tempfile::tempdir().unwrap();
    let openness = |name: &str, seed: u32, rays: u32, told: bool| {
        let mut x = seed;
        let mut layers = Layers::new([48, 48]);
        for replicate in 0..16 {
            let mut pixel = || {
                let open = (0..rays).filter(|_| {
                    x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    f64::from(x >> 8) / 16_777_216.0 < 0.97
                });
                open.count() as f32 / rays as f32
            };
            layers = layers.with(&format!("replicate-{replicate:04}"), (0..48 * 48).map(|_| pixel()).collect());
        }
        let mean = vec![0.97; 48 * 48];
        layers = layers.with("mean", mean);
        if told {
            layers.attributes.insert("rays".into(), rays.to_string());
        }
        layers.write(&folder.path().join(name)).unwrap();
    };
    for (told, seed) in [(true, 1), (false, 2), (true, 3), (false, 4)] {
        openness("few.exr", seed, 4, told);
        openness("many.exr", seed + 10, 32, told);
        let found = pair(&compare(folder.path(), &["few.exr", "many.exr", "--format", "json"]));
        for scale in found["welch"]["scales"].as_array().unwrap() {
            assert_eq!(scale["rejected"].as_array().unwrap().len(), 0, "seed {seed}: {scale}");
            assert!(scale["detectable"].as_f64().unwrap() > 0.0);
        }
    }
}
