//! What is done to openness, and whether it is told as one thing of all images of a method.
use super::*;

fn squared(image: &[f32]) -> Vec<f32> {
    image.iter().map(|v| v * v).collect()
}

/// Smooth scenes do not tell a power from a strength: both are named and no remedy is that is right for one alone.
/// The self-check tells them apart, for the other images too.
#[test]
fn what_scenes_cannot_tell_is_left_to_the_self_check() {
    let images = Images::new();
    images.all(|_, image, _| squared(image));
    let (code, text) = images.score(&[]);
    let told: Vec<&str> = text.lines().filter(|l| l.contains("of strength")).collect();
    assert!(code == 0 && !told.is_empty(), "{code}: {text}");
    for line in told {
        let says = [
            "times openness to the power",
            "which of them, these images cannot tell; hand in the image of the self-check",
        ];
        assert!(says.iter().all(|s| line.contains(s)) && !line.contains("declare") && !line.contains("set "), "{line}");
    }
    images.self_check(|image, _| squared(image));
    let (code, text) = images.score(&[]);
    assert!(code == 0 && text.contains("a curve: 1.00 times openness to the power 2.0"), "{code}: {text}");
    assert!(!text.contains("strength ") && !text.contains("cannot tell"), "{text}");
}

/// Images of one method are wrong in one way.
#[test]
fn a_method_is_told_one_thing() {
    for make in [|v: f32| v.max(0.0).powf(1.0 / 2.2), |v: f32| 1.0 - 0.5 * (1.0 - v), |v: f32| v.max(0.0).sqrt()] {
        let images = Images::new();
        images.all(|_, image, _| image.iter().map(|v| make(*v)).collect());
        images.score(&[]);
        let record = images.record();
        for estimator in ["classic", "extended"] {
            let of = |scene: &str| {
                let own = case(&record, scene, estimator);
                let doubts = own.source.iter().flat_map(|s| s.warnings.clone());
                let wrong = own.error.iter().map(|e| e.replace("its images are wrong: image 0: ", ""));
                doubts.chain(wrong).filter(|w| w.contains("encoded") || w.contains("of strength")).collect::<Vec<_>>()
            };
            let [one, other] = ["curtain-arcade", "corner"].map(of);
            assert!(one.len() == 1 && one == other, "{one:?} {other:?}");
        }
    }
}

/// Nothing is advised that is declared.
#[test]
fn a_fitted_curve_is_told_of_the_self_check() {
    let images = Images::new();
    images.all(|_, image, _| squared(image));
    images.self_check(|image, _| squared(image));
    let (code, text) = images.score(&["--curve", "fit"]);
    let told = "self-check: the curve that was fitted on the control scenes, 1.0";
    assert!(code == 0 && text.contains(told) && text.contains("it is as expected then"), "{code}: {text}");
    assert!(!text.contains("declare `curve"), "{text}");
    // Where something else was done to it, that is said.
    images.self_check(|image, _| image.to_vec());
    let (code, text) = images.score(&["--curve", "fit"]);
    assert!(code == 0 && text.contains(told) && !text.contains("as expected then"), "{code}: {text}");
    assert!(!text.contains("declare `curve"), "{text}");
    // And a known one that is another.
    images.self_check(|image, _| image.to_vec());
    let (_, text) = images.score(&["--curve", "1,2"]);
    assert!(text.contains("with the declared curve undone: correct `curve`"), "{text}");
}

/// Codes that are declared to be none end the run where the self-check shows them.
#[test]
fn codes_that_are_declared_linear_end_it_by_the_self_check() {
    let images = Images::new();
    let codes = |image: &[f32]| image.iter().map(|v| aogauge::layers::code(*v)).collect::<Vec<f32>>();
    images.all(|_, image, _| codes(image));
    let (code, text) = images.score(&["--encoding", "linear"]);
    assert!(code == 0 && text.contains("gamma-encoded"), "{code}: {text}");
    images.self_check(|image, _| codes(image));
    let (code, text) = images.score(&["--encoding", "linear"]);
    assert!(code == 2 && text.contains("self-check") && text.contains("gamma-encoded"), "{code}: {text}");
}

/// One rule for both sides: farther than 1 out of range ends the case, less is a warning; both name the pixel.
#[test]
fn a_single_pixel_out_of_range_is_named() {
    for (value, is_wrong) in
        [(50.0, true), (1e30, true), (-50.0, true), (-1.5, true), (2.5, true), (-1.0, false), (1.9, false)]
    {
        let images = Images::new();
        images.all(|_, image, _| image.to_vec());
        let (replicates, size) = Images::of("corner", "classic");
        let mut far = replicates[2].clone();
        far[size[0] as usize + 3] = value;
        images.exr("corner.classic.4.0002.exr", &far, size);
        let (code, text) = images.score(&[]);
        assert_eq!(code, if is_wrong { 5 } else { 0 }, "{value}: {text}");
        let warns = "openness lies outside 0 to 1 at 1 pixel: ";
        assert!(text.contains(warns) && text.contains("farthest at column 3, row 1"), "{value}: {text}");
        assert!(text.lines().all(|l| !l.contains("00000000")), "{value}: {text}");
        let error = case(&images.record(), "corner", "classic").error.clone();
        let told = error.is_some_and(|e| e.contains("image 2: ") && e.contains("the farthest at column 3, row 1"));
        assert_eq!(told, is_wrong, "{value}: {text}");
    }
}

/// A slip in the name of the first image leaves it out, and that is said of the case.
#[test]
fn the_first_replicate_is_missed() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    let at = |name: &str| images.folder.path().join(name);
    fs::rename(at("corner.classic.4.0000.exr"), at("Corner.classic.4.0000.exr")).unwrap();
    let (code, text) = images.score(&["--partial"]);
    let says = "corner, classic, 4 rays: 1 of the replicates 0 to 3 are missing, the first is 0";
    assert!(code == 0 && text.contains(says) && text.contains("'Corner.classic.4.0000.exr'"), "{code}: {text}");
}

/// A kit is known by its name, and another one is none that images were rendered for.
#[test]
fn the_kit_is_named_and_another_is_refused() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    let manifest = fs::read_to_string(world().join("kit/kit.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let id = manifest["id"].as_str().unwrap().to_owned();
    assert!(fs::read_to_string(world().join("kit/README.md")).unwrap().contains(&format!("`kit = \"{id}\"`")));
    for (declared, expected) in [(id.as_str(), 0), ("0123456789ab", 2)] {
        fs::write(images.folder.path().join("score.toml"), format!("kit = \"{declared}\"\n")).unwrap();
        let (code, text) = images.score(&[]);
        assert_eq!(code, expected, "{text}");
        if code == 2 {
            assert!(text.contains(declared) && text.contains(&id) && text.contains("score.toml"), "{text}");
        } else {
            assert!(images.record().handed_in.unwrap().kit.contains(&id));
        }
    }
}

/// What is wrong with pairs of frames is named by the self-check, which has all levels of openness, and what was taken of them
/// beside it.
#[test]
fn the_self_check_tells_what_is_wrong_with_frames() {
    type Make = fn(f32, f32) -> [f32; 2];
    let cases: [(Make, i32, &str); 6] = [
        (|a, l| [0.97 * a * l, l], 5, "the frame with AO is 0.970 times as bright as the one without it"),
        (|a, l| [0.92 * a * l, l], 5, "the frame with AO is 0.920 times as bright as the one without it"),
        (|a, l| [(2.0 * a * l).min(0.95), (2.0 * l).min(0.95)], 5, "light cut off at 0.950"),
        (|a, l| [a * l / (a * l + 0.5), l / (l + 0.5)], 5, "a tone curve"),
        (|a, l| [0.3 + a * l, 0.3 + l], 5, "light that AO does not dim, 0.300 in both frames"),
        (
            |a, l| if l > 0.45 { [a * l, l] } else { [0.6 * a * l, l] },
            5,
            "what it is, the frames do not tell: exposure",
        ),
    ];
    let layers = Layers::read(&world().join("self-check.exr")).unwrap();
    let (image, size) = (layers.get("replicate-0000").unwrap(), layers.resolution);
    let light = |i: usize| {
        0.4 + 0.2 * ((i as u32 % size[0]) as f32 / 9.0).sin() + 0.1 * ((i as u32 / size[0]) as f32 / 7.0).cos()
    };
    for (make, code, says) in cases {
        let images = Images::new();
        images.all(|_, image, _| image.to_vec());
        let both: Vec<[f32; 2]> = image.iter().enumerate().map(|(i, a)| make(*a, light(i))).collect();
        for (k, name) in ["with", "without"].iter().enumerate() {
            let frame: Vec<f32> = both.iter().map(|p| p[k]).collect();
            images.exr(&format!("self-check.classic.16.{name}.exr"), &frame, size);
        }
        let (found, text) = images.score(&[]);
        assert!(found == code && text.contains(says), "{says}: {found}: {text}");
        assert!(!text.contains("R or scale") && !text.contains("R looks like"), "{text}");
    }
    // Frames of integers are read as codes, which is said even where that ends it.
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    for name in ["with", "without"] {
        let value = |i: usize| if name == "with" { image[i] * light(i) } else { light(i) };
        let at = |x: u32, y: u32| image::Luma([(value((y * size[0] + x) as usize).max(0.0) * 65535.0).round() as u16]);
        let path = images.folder.path().join(format!("self-check.classic.16.{name}.png"));
        image::ImageBuffer::from_fn(size[0], size[1], at).save(path).unwrap();
    }
    let (code, text) = images.score(&[]);
    let says = ["linear frames, taken for sRGB codes; declare `encoding = \"linear\"`", "taken as sRGB codes (2 files"];
    assert!(code == 2 && says.iter().all(|s| text.contains(s)), "{code}: {text}");
}
