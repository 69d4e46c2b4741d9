//! Whole frames: with AO and without, and alone.
use super::*;

/// A frame with AO over one without is openness; alone it has a contrast and no more.
#[test]
fn whole_frames_give_what_they_can() {
    let (replicates, size) = Images::of("curtain-arcade", "classic");
    let images = Images::new();
    for (r, image) in replicates.iter().enumerate() {
        let light = |i: usize| 0.3 + 0.2 * (i % size[0] as usize) as f32 / size[0] as f32;
        let with: Vec<f32> = image.iter().enumerate().map(|(i, v)| v * light(i)).collect();
        let without: Vec<f32> = (0..image.len()).map(light).collect();
        images.exr(&format!("curtain-arcade.classic.4.{r:04}.with.exr"), &with, size);
        images.exr(&format!("curtain-arcade.classic.4.{r:04}.without.exr"), &without, size);
    }
    let (code, text) = images.score(&["--partial"]);
    assert_eq!(code, 0, "{text}");
    let run = Record::read(&world().join("run")).unwrap();
    let record = images.record();
    let (own, theirs) = (case(&record, "curtain-arcade", "classic"), case(&run, "curtain-arcade", "classic"));
    assert_eq!(own.source.as_ref().unwrap().shows, Shows::Ratio);
    let profile = |r: &Record| r.scenes[0].profiles.iter().find(|c| c.label == "classic").unwrap().value.clone();
    let apart =
        profile(&record).iter().zip(&profile(&run)).map(|(a, b)| (a.unwrap() - b.unwrap()).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-5, "{apart}");
    for (name, region) in
        [(MetricName::Contrast, None), (MetricName::ContrastError, None), (MetricName::Openness, Some(Region::All))]
    {
        let value = |c: &CaseRecord| c.metric(name, region).unwrap().value.unwrap();
        assert!((value(own) - value(theirs)).abs() < 1e-5, "{name:?}");
    }
    // A curve of the openness in such frames is undone as in any other image.
    let curved = Images::new();
    for (r, image) in replicates.iter().enumerate() {
        let squared: Vec<f32> = image.iter().map(|v| 0.5 * v * v).collect();
        curved.exr(&format!("curtain-arcade.classic.4.{r:04}.with.exr"), &squared, size);
        curved.exr(&format!("curtain-arcade.classic.4.{r:04}.without.exr"), &vec![0.5; image.len()], size);
    }
    let (code, text) = curved.score(&["--partial", "--curve", "1,2"]);
    assert_eq!(code, 0, "{text}");
    let apart = profile(&curved.record())
        .iter()
        .zip(&profile(&run))
        .map(|(a, b)| (a.unwrap() - b.unwrap()).abs())
        .fold(0.0, f64::max);
    assert!(apart < 1e-5, "{apart}");
    let lone = Images::new();
    for (r, image) in replicates.iter().enumerate() {
        lone.exr(&format!("curtain-arcade.classic.4.{r:04}.frame.exr"), image, size);
    }
    // The gates of the suite are on dK, and a gate on the judge is none on the renderer.
    let (code, text) = lone.score(&["--partial"]);
    assert!(code == 4 && text.contains("nothing of the renderer was judged"), "{code}: {text}");
    let gates = lone.out().with_extension("toml");
    let of = |metric: &str| format!("[[gate]]\nname = '{metric}'\nmetric = '{metric}'\nmin = -50.0\n");
    for (text, expected) in [(of("judge-contrast"), 4), (of("judge-contrast") + &of("contrast"), 0)] {
        fs::write(&gates, text).unwrap();
        let (code, text) = lone.score(&["--partial", "--gates", gates.to_str().unwrap(), "--report", "markdown,junit"]);
        assert_eq!(code, expected, "{text}");
        let junit = fs::read_to_string(lone.out().join("junit.xml")).unwrap();
        assert_eq!(junit.contains("no gate speaks of the images"), expected == 4, "{junit}");
        let told = aogauge(&["report", lone.out().to_str().unwrap(), "--format", "github"]).stdout;
        let told = String::from_utf8(told).unwrap();
        assert_eq!(told.contains("::warning title=Inconclusive%3A nothing judged"), expected == 4, "{told}");
    }
    fs::remove_file(&gates).unwrap();
    let record = lone.record();
    let own = case(&record, "curtain-arcade", "classic");
    assert_eq!(own.source.as_ref().unwrap().shows, Shows::Frame);
    let names: Vec<MetricName> = own.metrics.iter().map(|m| m.name).collect();
    assert_eq!(names, [MetricName::Contrast, MetricName::Michelson]);
    // Its light is drawn along the transect, with 1 on the brighter flank.
    let curve = &record.scenes[0].profiles[0];
    let [least, most] = [f64::min, f64::max].map(|f| curve.value.iter().flatten().copied().reduce(f).unwrap());
    assert!(curve.light && curve.label == "classic" && least < 1.0 && most > 1.1, "{least} {most}");
    let drawn = lone.out().join(aogauge::record::pictures::profile("curtain-arcade"));
    assert!(fs::read_to_string(&drawn).unwrap().contains("light / flank"), "{}", drawn.display());
    // A frame without a number is none, and one of black is none.
    for (value, says) in [(f32::NAN, "hold NaN or infinity"), (0.0, "black: no pixel")] {
        let nothing = Images::new();
        nothing.exr("curtain-arcade.classic.4.0000.frame.exr", &vec![value; replicates[0].len()], size);
        let (code, text) = nothing.score(&["--partial"]);
        assert!(code == 5 && text.contains(says), "{code}: {text}");
    }
    let report = fs::read_to_string(lone.out().join("report.md")).unwrap();
    assert!(report.contains("cannot be known"), "{report}");
}

/// Frames with and without AO of the control, changed.
fn pairs(images: &Images, change: impl Fn([Vec<f32>; 2], [u32; 2]) -> [Vec<f32>; 2]) {
    let (replicates, size) = Images::of("corner", "classic");
    for (r, image) in replicates.iter().enumerate() {
        let without: Vec<f32> = (0..image.len()).map(|i| 0.3 + 0.1 * (i % 7) as f32).collect();
        let with = image.iter().zip(&without).map(|(v, l)| v * l).collect();
        let [with, without] = change([with, without], size);
        images.exr(&format!("corner.classic.4.{r:04}.with.exr"), &with, size);
        images.exr(&format!("corner.classic.4.{r:04}.without.exr"), &without, size);
    }
}

/// Whole frames can be as wrong as images of AO.
#[test]
fn what_is_wrong_with_whole_frames_is_named() {
    type Change = fn([Vec<f32>; 2], [u32; 2]) -> [Vec<f32>; 2];
    let cases: [(Change, &str); 6] = [
        (|[with, without], _| [without, with], "are exchanged: "),
        (
            |[with, without], _| [with.iter().map(|v| v * 0.7).collect(), without],
            "the frame with AO is 0.70 times as bright as the one without it; save both with the same exposure",
        ),
        (|[with, _], _| [with.clone(), with], "the two are identical"),
        (|[a, b], [w, _]| [mirrored(&a, w), mirrored(&b, w)], "flipped in x"),
        (
            |[with, without], _| {
                let codes = with.iter().zip(&without).map(|(a, b)| b * (a / b).max(0.0).powf(1.0 / 2.2));
                [codes.collect(), without]
            },
            "gamma-encoded",
        ),
        (
            |[mut with, without], _| {
                with[700] = f32::NAN;
                [with, without]
            },
            "1 pixel that sees a surface holds NaN or infinity",
        ),
    ];
    for (change, says) in cases {
        let images = Images::new();
        pairs(&images, change);
        let (code, text) = images.score(&["--partial"]);
        assert!(code == 5 && text.contains(says), "{says}: {code}: {text}");
    }
    let images = Images::new();
    pairs(&images, |both, _| both);
    // The kit has no gate on the control.
    let (code, text) = images.score(&["--partial"]);
    assert!(code == 4 && !text.contains("wrong"), "{code}: {text}");
}

/// The images of the self-check are read for what their names say.
#[test]
fn whole_frames_of_the_self_check_are_whole_frames() {
    let images = Images::new();
    pairs(&images, |both, _| both);
    let layers = Layers::read(&world().join("self-check.exr")).unwrap();
    let (image, size) = (layers.get("replicate-0000").unwrap(), layers.resolution);
    let (times, light) = (|by: f32| image.iter().map(|v| by * v).collect::<Vec<f32>>(), vec![0.5; image.len()]);
    let turned = |image: &[f32]| rows_upside_down(image, size[0] as usize);
    for (with, without, code, says) in [
        (times(0.5), light.clone(), 4, ""),
        (light.clone(), times(0.5), 2, "are exchanged"),
        (turned(&times(0.5)), light.clone(), 2, "rows = \"bottom\""),
    ] {
        images.exr("self-check.with.exr", &with, size);
        images.exr("self-check.without.exr", &without, size);
        let (found, text) = images.score(&["--partial"]);
        assert!(found == code && text.contains(says), "{says}: {found}: {text}");
        assert_eq!(text.contains("self-check image is wrong"), code == 2, "{text}");
    }
    for file in ["self-check.with.exr", "self-check.without.exr"] {
        fs::remove_file(images.folder.path().join(file)).unwrap();
    }
    for (frame, code, says) in [
        (times(3.0), 4, "A whole frame holds light"),
        (turned(&times(3.0)), 4, "it looks flipped in y"),
        (times(0.0), 2, "black"),
    ] {
        images.exr("self-check.frame.exr", &frame, size);
        let (found, text) = images.score(&["--partial"]);
        assert!(found == code && text.contains(says), "{says}: {found}: {text}");
    }
}

/// The judge is taken over the pixels that the frames are known in.
#[test]
fn what_is_masked_is_masked_in_the_judge_too() {
    let (replicates, size) = Images::of("curtain-arcade", "classic");
    // Every so many-th row is dark.
    let record = |dark: usize| {
        let images = Images::new();
        for (r, image) in replicates.iter().enumerate() {
            let light = |i: usize| if dark > 0 && (i / size[0] as usize).is_multiple_of(dark) { 0.0 } else { 0.5 };
            let with: Vec<f32> = image.iter().enumerate().map(|(i, v)| v * light(i)).collect();
            let without: Vec<f32> = (0..image.len()).map(light).collect();
            images.exr(&format!("curtain-arcade.classic.4.{r:04}.with.exr"), &with, size);
            images.exr(&format!("curtain-arcade.classic.4.{r:04}.without.exr"), &without, size);
        }
        let (code, text) = images.score(&["--partial"]);
        // Of every other row, the rest stands for nothing.
        assert!(code == if dark == 2 { 6 } else { 0 }, "{text}");
        assert_eq!(text.contains("pixels are too dark") && text.contains("all 4 files"), dark > 0, "{text}");
        images.record()
    };
    // K less dK is K(Q): without some of the rows another number, and near it.
    let of = |record: &Record| {
        let own = case(record, "curtain-arcade", "classic");
        let value = |name| own.metric(name, None).unwrap().value.unwrap();
        value(MetricName::Contrast) - value(MetricName::ContrastError)
    };
    let (whole, most) = (record(0), record(20));
    assert!(of(&whole) != of(&most) && (of(&whole) - of(&most)).abs() < 0.1, "{} {}", of(&whole), of(&most));
    let judge = whole.scenes[0].judge.as_ref().unwrap().contrast.value.unwrap();
    assert!((of(&whole) - judge).abs() < 1e-9, "{} {judge}", of(&whole));
    let half = record(2);
    let own = case(&half, "curtain-arcade", "classic").metric(MetricName::ContrastError, None).unwrap();
    let note = own.note.as_deref().unwrap_or_default();
    assert!(own.value.is_none() && note.contains(" % of the pixels of ") && note.contains("are left out"), "{own:?}");
}
