//! Images of somebody else's renderer, from a kit to a verdict: what a user of `scene export
//! --suite` and `score` sees.
use aogauge::{
    layers::Layers,
    metrics::{Metric, MetricName, regions::Region},
    record::{CaseRecord, Intervals, Record, Shows},
};
use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
    sync::OnceLock,
};

const SUITE: &str = r#"
name = "kit"
description = "A curtain in an arcade, and a control whose openness varies."
scenes = ["curtain-arcade", "corner"]
rays = [4]
replicates = 4
converged_rays = 512
look_rays = 2
judge = { precision = 0.3, paths = 4, replicates = 8, max_replicates = 32 }
[[estimator]]
name = "classic"
kind = "classic"
[[estimator]]
name = "extended"
kind = "extended"
receiver_plane = "clipped"
[[gate]]
name = "artifact"
metric = "contrast-error"
scenes = ["curtain-arcade"]
max = 50.0
[[gate]]
name = "on the CPU"
metric = "bias"
region = "all"
renderers = ["cpu"]
equals = 0.0
within = 0.01
"#;

fn aogauge(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).args(args).env("NO_COLOR", "1").output().unwrap()
}

fn ok(args: &[&str]) {
    let output = aogauge(args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A kit, a run of the same suite, and an image of the self-check, made once.
fn world() -> &'static Path {
    static WORLD: OnceLock<PathBuf> = OnceLock::new();
    WORLD.get_or_init(|| {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("score");
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(&folder).unwrap();
        let at = |name: &str| folder.join(name).display().to_string();
        fs::write(at("kit.toml"), SUITE).unwrap();
        ok(&["scene", "export", "--suite", &at("kit.toml"), "--out", &at("kit"), "--no-cache"]);
        ok(&["run", &at("kit.toml"), "--renderer", "cpu", "--no-cache", "--no-base", "--out", &at("run")]);
        let scene = at("kit/scenes/self-check/self-check.toml");
        ok(&["render", &scene, "--rays", "16", "--replicates", "2", "--out", &at("self-check.exr")]);
        folder
    })
}

/// A folder of images to hand in.
struct Images {
    folder: tempfile::TempDir,
}

impl Images {
    fn new() -> Self {
        Images { folder: tempfile::Builder::new().prefix("mine").tempdir().unwrap() }
    }

    /// The replicates of a case of the run.
    fn of(scene: &str, estimator: &str) -> (Vec<Vec<f32>>, [u32; 2]) {
        let layers = Layers::read(&world().join(format!("run/images/{scene}/{estimator}.cpu.4.exr"))).unwrap();
        let all = (0..4).map(|r| layers.get(&format!("replicate-{r:04}")).unwrap().to_vec()).collect();
        (all, layers.resolution)
    }

    fn exr(&self, name: &str, image: &[f32], size: [u32; 2]) {
        Layers::new(size).with("Y", image.to_vec()).write(&self.folder.path().join(name)).unwrap();
    }

    /// Every case of the run, an image a replicate, changed.
    fn all(&self, change: impl Fn(&str, &[f32], [u32; 2]) -> Vec<f32>) {
        for scene in ["curtain-arcade", "corner"] {
            for estimator in ["classic", "extended"] {
                let (replicates, size) = Self::of(scene, estimator);
                for (r, image) in replicates.iter().enumerate() {
                    self.exr(&format!("{scene}.{estimator}.4.{r:04}.exr"), &change(scene, image, size), size);
                }
            }
        }
    }

    fn self_check(&self, change: impl Fn(&[f32], usize) -> Vec<f32>) {
        let layers = Layers::read(&world().join("self-check.exr")).unwrap();
        let image = layers.get("replicate-0000").unwrap();
        self.exr("self-check.classic.16.exr", &change(image, layers.resolution[0] as usize), layers.resolution);
    }

    fn score(&self, options: &[&str]) -> (i32, String) {
        let kit = world().join("kit").display().to_string();
        let (folder, out) = (self.folder.path().display().to_string(), self.out().display().to_string());
        let output =
            aogauge(&[&["score", &folder, "--kit", &kit, "--out", &out, "--renderer", "mine"], options].concat());
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    }

    fn out(&self) -> PathBuf {
        self.folder.path().with_extension("record")
    }

    fn record(&self) -> Record {
        Record::read(&self.out()).unwrap()
    }
}

impl Drop for Images {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(self.out());
    }
}

fn case<'a>(record: &'a Record, scene: &str, estimator: &str) -> &'a CaseRecord {
    record.cases.iter().find(|c| c.case.scene == scene && c.case.estimator == estimator).unwrap()
}

/// What both records say of the same cases, side by side.
fn side_by_side(mine: &Record, run: &Record) -> Vec<(Metric, Metric)> {
    let mut both = Vec::new();
    for own in &mine.cases {
        let theirs = case(run, &own.case.scene, &own.case.estimator);
        assert_eq!(own.metrics.len(), theirs.metrics.len(), "{}", own.case.id());
        both.extend(own.metrics.iter().cloned().zip(theirs.metrics.iter().cloned()));
    }
    both
}

#[test]
fn our_own_images_have_the_metrics_of_the_run() {
    let run = Record::read(&world().join("run")).unwrap();
    // As they are: several replicates in one file.
    let whole = Images::new();
    for scene in ["curtain-arcade", "corner"] {
        for estimator in ["classic", "extended"] {
            let from = world().join(format!("run/images/{scene}/{estimator}.cpu.4.exr"));
            fs::copy(from, whole.folder.path().join(format!("{scene}.{estimator}.4.exr"))).unwrap();
        }
    }
    // And an image a replicate.
    let single = Images::new();
    single.all(|_, image, _| image.to_vec());
    for images in [whole, single] {
        let (code, text) = images.score(&[]);
        assert_eq!(code, 0, "{text}");
        let mine = images.record();
        assert_eq!(mine.cases.len(), 4);
        for (own, theirs) in side_by_side(&mine, &run) {
            assert_eq!(own, theirs);
        }
        assert_eq!(
            (&mine.pooled[0].contrast_error, &mine.pooled[1].removed),
            (&run.pooled[0].contrast_error, &run.pooled[1].removed)
        );
        assert_eq!(mine.scenes[0].profiles, run.scenes[0].profiles);
        assert_eq!(mine.scenes[0].convergence.len(), run.scenes[0].convergence.len());
        // A gate on our own renderers is no gate on theirs.
        assert!(mine.idle_gates.len() == 1 && mine.idle_gates[0].excused, "{:?}", mine.idle_gates);
        assert!(mine.verdicts.iter().any(|v| v.gate == "artifact"));
        let report = fs::read_to_string(images.out().join("report.md")).unwrap();
        assert!(report.contains("images of the renderer 'mine'") || report.contains("mine"), "{report}");
        assert!(text.contains("There is no image of self-check"), "{text}");
    }
}

#[test]
fn as_png_they_are_off_by_rounding() {
    let run = Record::read(&world().join("run")).unwrap();
    for (bits, limit) in [(16u32, 1e-4), (8, 3e-3)] {
        let images = Images::new();
        for scene in ["curtain-arcade", "corner"] {
            for estimator in ["classic", "extended"] {
                let (replicates, [w, h]) = Images::of(scene, estimator);
                for (r, image) in replicates.iter().enumerate() {
                    let path = images.folder.path().join(format!("{scene}.{estimator}.4.{r:04}.png"));
                    let at = |x: u32, y: u32| image[(y * w + x) as usize].max(0.0);
                    if bits == 16 {
                        image::ImageBuffer::from_fn(w, h, |x, y| image::Luma([(at(x, y) * 65535.0).round() as u16]))
                            .save(&path)
                            .unwrap();
                    } else {
                        image::ImageBuffer::from_fn(w, h, |x, y| image::Luma([(at(x, y) * 255.0).round() as u8]))
                            .save(&path)
                            .unwrap();
                    }
                }
            }
        }
        let (code, text) = images.score(&["--encoding", "linear"]);
        assert_eq!(code, 0, "{text}");
        let mut compared = 0;
        for (own, theirs) in side_by_side(&images.record(), &run) {
            // Which replicates are alike is no number of brightness.
            if own.name == MetricName::DistinctReplicates {
                continue;
            }
            let (Some(a), Some(b)) = (own.value, theirs.value) else {
                assert_eq!(own.value, theirs.value);
                continue;
            };
            assert!((a - b).abs() <= limit, "{bits} bits, {:?} {:?}: {a}, {b}", own.name, own.region);
            compared += 1;
        }
        assert!(compared > 60, "{compared}");
        // Not declared, the encoding is detected, and that is said.
        let (_, text) = images.score(&[]);
        assert!(text.contains("no encoding is declared"), "{text}");
    }
}

fn rows_upside_down(image: &[f32], width: usize) -> Vec<f32> {
    image.chunks(width).rev().flatten().copied().collect()
}

/// Whether the message names what is wrong, each on its own.
#[test]
fn a_wrong_self_check_ends_it_at_once() {
    type Change = fn(&[f32], usize) -> Vec<f32>;
    let cases: [(Change, &str); 8] = [
        (|i, w| rows_upside_down(i, w), "rows = \"bottom\""),
        (|i, w| i.chunks(w).flat_map(|row| row.iter().rev().copied()).collect(), "mirror"),
        (|i, _| i.iter().map(|v| 1.0 - v).collect(), "inverted"),
        (|i, _| i.iter().map(|v| v.max(0.0).powf(1.0 / 2.2)).collect(), "gamma-encoded"),
        (|i, _| i.iter().map(|v| v * 255.0).collect(), "where openness is 0 to 1; divide by 255"),
        (|i, _| i.iter().map(|v| 2.0 * v - 1.0).collect(), "negative openness"),
        (
            |i, _| i.iter().enumerate().map(|(k, v)| if k == 777 { f32::INFINITY } else { *v }).collect(),
            "infinity: 1 pixels",
        ),
        (|i, _| i.iter().enumerate().map(|(k, v)| if k == 777 { f32::NAN } else { *v }).collect(), "NaN"),
    ];
    for (change, says) in cases {
        let images = Images::new();
        images.all(|_, image, _| image.to_vec());
        images.self_check(change);
        let (code, text) = images.score(&[]);
        assert_eq!(code, 2, "{says}: {text}");
        assert!(text.contains("self-check") && text.contains(says), "{says}: {text}");
        assert!(!images.out().exists());
    }
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    images.self_check(|image, _| image.to_vec());
    let (code, text) = images.score(&[]);
    assert!(code == 0 && !text.contains("self-check"), "{text}");
    // What is declared is undone.
    let images = Images::new();
    images.all(|_, image, [w, _]| rows_upside_down(&image.iter().map(|v| 1.0 - v).collect::<Vec<_>>(), w as usize));
    images.self_check(|image, w| rows_upside_down(&image.iter().map(|v| 1.0 - v).collect::<Vec<_>>(), w));
    let (code, text) = images.score(&["--means", "occlusion", "--rows", "bottom"]);
    assert_eq!(code, 0, "{text}");
    fs::write(images.folder.path().join("score.toml"), "means = \"occlusion\"\nrows = \"bottom\"\n").unwrap();
    assert_eq!(images.score(&[]).0, 0);
}

/// A scene in centimetres has 1/100 of its R.
#[test]
fn a_scaled_scene_is_told() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    let scene = world().join("kit/scenes/self-check/self-check.toml").display().to_string();
    let out = images.folder.path().join("self-check.classic.16.exr").display().to_string();
    ok(&["render", &scene, "--rays", "16", "--replicates", "2", "--set", "radius=0.05", "--out", &out]);
    let (code, text) = images.score(&[]);
    assert!(code == 2 && text.contains("scaled scene") && text.contains("1/10"), "{code}: {text}");
}

/// A factor that nobody mistakes is told as it is, or that there is one; strength is no such thing.
#[test]
fn another_radius_does_not_agree() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    let scene = world().join("kit/scenes/self-check/self-check.toml").display().to_string();
    let out = images.folder.path().join("self-check.classic.16.exr").display().to_string();
    for (radius, factor) in [("0.65", 1.3), ("0.75", 1.5), ("0.35", 0.7), ("2.5", 5.0)] {
        ok(&[
            "render",
            &scene,
            "--rays",
            "16",
            "--replicates",
            "2",
            "--set",
            &format!("radius={radius}"),
            "--out",
            &out,
        ]);
        let (code, text) = images.score(&[]);
        assert!(code == 2 || code == 5, "{radius}: {code}: {text}");
        let told = text.split(" times what was asked for").next().unwrap().rsplit(' ').next().unwrap();
        let told = match told.split_once('/') {
            Some((_, below)) => 1.0 / below.parse::<f64>().unwrap_or(f64::NAN),
            None => told.parse().unwrap_or(f64::NAN),
        };
        // With R five times too long hardly a ray is open: the image tells less of how long it was.
        let within = if factor > 2.0 { 0.35 } else { 0.15 };
        assert!((told / factor - 1.0).abs() < within, "{radius}: {told}: {text}");
    }
    images.self_check(|image, _| image.iter().map(|v| 1.0 - 0.7 * (1.0 - v)).collect());
    let (code, text) = images.score(&[]);
    assert!(code == 0 && text.contains("AO of strength 0.7"), "{code}: {text}");
}

/// What is declared and is wrong is not told to be declared.
#[test]
fn what_is_wrongly_declared_is_named() {
    for (options, says) in [
        (
            ["--means", "occlusion"],
            "declared as occlusion, but it looks like openness: take `means = \"occlusion\"` away",
        ),
        (["--rows", "bottom"], "looks like the top of the view: take `rows = \"bottom\"` away"),
        (["--encoding", "srgb"], "declared as sRGB codes, but its numbers are linear: take `encoding = \"srgb\"` away"),
    ] {
        let images = Images::new();
        images.all(|_, image, _| image.to_vec());
        let (code, text) = images.score(&options);
        // The scenes of this kit look alike upside down: there the self-check alone tells.
        assert!(options[0] == "--rows" || code == 5 && text.contains(says), "{options:?}: {code}: {text}");
        images.self_check(|image, _| image.to_vec());
        let (code, text) = images.score(&options);
        assert!(code == 2 && text.contains(says), "{options:?}: {code}: {text}");
    }
}

/// All files of a method have one encoding, whatever a single one of them looks like.
#[test]
fn the_encoding_is_that_of_the_folder() {
    for is_srgb in [true, false] {
        let images = Images::new();
        let mut read_as = Vec::new();
        for scene in ["curtain-arcade", "corner"] {
            let (replicates, [w, h]) = Images::of(scene, "classic");
            for (r, image) in replicates.iter().enumerate() {
                let code = |v: f32| if is_srgb { aogauge::layers::srgb(v) } else { (v * 255.0).round() as u8 };
                let at = |x: u32, y: u32| image::Luma([code(image[(y * w + x) as usize])]);
                let path = images.folder.path().join(format!("{scene}.classic.4.{r:04}.png"));
                image::ImageBuffer::from_fn(w, h, at).save(path).unwrap();
            }
        }
        images.score(&[]);
        for own in &images.record().cases {
            read_as.push(own.source.as_ref().unwrap().read_as.clone());
        }
        let word = if is_srgb { "srgb" } else { "linear" };
        assert!(read_as.len() >= 2 && read_as.iter().all(|r| r.contains(word)), "{word}: {read_as:?}");
    }
}

/// One wrong case ends that case alone, with its reason in the record.
#[test]
fn what_is_wrong_with_a_case_is_named() {
    let check = |says: &str, hand_in: &dyn Fn(&Images)| {
        let images = Images::new();
        images.all(|_, image, _| image.to_vec());
        hand_in(&images);
        let (code, text) = images.score(&[]);
        assert_eq!(code, 5, "{says}: {text}");
        let record = images.record();
        let failed: Vec<_> = record.cases.iter().filter_map(|c| c.error.clone()).collect();
        assert!(failed.len() == 1 && failed[0].contains(says), "{says}: {failed:?}");
    };
    let (replicates, size) = Images::of("corner", "classic");
    let first = &replicates[0];
    let name = "corner.classic.4.0000.exr";
    check("a view of", &|images| images.exr(name, &first[..first.len() / 2], [size[0], size[1] / 2]));
    check("inverted", &|images| images.exr(name, &first.iter().map(|v| 1.0 - v).collect::<Vec<_>>(), size));
    // One of several is enough.
    let last = "corner.classic.4.0003.exr";
    check("image 3: inverted", &|images| images.exr(last, &first.iter().map(|v| 1.0 - v).collect::<Vec<_>>(), size));
    check("constant: 1 everywhere", &|images| images.exr(name, &vec![1.0; first.len()], size));
    check("the farthest at column 3, row 1", &|images| {
        let mut far = first.clone();
        far[size[0] as usize + 3] = 1e6;
        images.exr(name, &far, size);
    });
    check("black", &|images| images.exr(name, &vec![0.0; first.len()], size));
    check("infinity", &|images| {
        let mut hole = first.clone();
        hole[size[0] as usize + 3] = f32::INFINITY;
        images.exr(name, &hole, size);
    });
    check("NaN", &|images| {
        let mut hole = first.clone();
        hole[size[0] as usize + 3] = f32::NAN;
        images.exr(name, &hole, size);
    });
    check("no image was handed in", &|images| {
        for r in 0..4 {
            fs::remove_file(images.folder.path().join(format!("corner.classic.4.{r:04}.exr"))).unwrap();
        }
    });
}

#[test]
fn a_part_may_be_scored_and_nothing_is_not() {
    let images = Images::new();
    let (replicates, size) = Images::of("curtain-arcade", "classic");
    for (r, image) in replicates.iter().enumerate() {
        images.exr(&format!("curtain-arcade.classic.4.{r:04}.exr"), image, size);
    }
    assert_eq!(images.score(&[]).0, 5);
    let (code, text) = images.score(&["--partial"]);
    assert_eq!(code, 0, "{text}");
    // A slip in a name is not passed over.
    let slip = Images::new();
    slip.all(|_, image, _| image.to_vec());
    slip.exr("corner.extendet.4.0000.exr", &replicates[0], size);
    let (code, text) = slip.score(&[]);
    assert!(code == 2 && text.contains("extendet") && text.contains("--partial"), "{code}: {text}");
    let empty = Images::new();
    let (code, text) = empty.score(&[]);
    assert!(code == 4 && text.contains("SCENE.ESTIMATOR.RAYS.REPLICATE.exr"), "{text}");
    let (code, text) = images.score(&["--means", "light"]);
    assert!(code == 2 && text.contains("openness"), "{text}");
    let output = aogauge(&["score", ".", "--kit", "src"]);
    assert!(output.status.code() == Some(2) && String::from_utf8_lossy(&output.stderr).contains("scoring.json"));
}

/// Of one frame the intervals are those of its tiles, and the report says so.
#[test]
fn one_frame_has_intervals_over_tiles() {
    let images = Images::new();
    for estimator in ["classic", "extended"] {
        let (replicates, size) = Images::of("curtain-arcade", estimator);
        images.exr(&format!("curtain-arcade.{estimator}.4.exr"), &replicates[0], size);
    }
    let (code, text) = images.score(&["--partial"]);
    assert!(code == 0 || code == 6, "{text}");
    let record = images.record();
    for own in &record.cases {
        let source = own.source.as_ref().unwrap();
        assert_eq!((source.intervals, source.shows), (Intervals::Tiles, Shows::Openness));
        let k = own.metric(MetricName::ContrastError, None).unwrap();
        assert!(k.value.is_some() && k.se.is_some_and(|se| se > 0.0), "{k:?}");
    }
    let report = fs::read_to_string(images.out().join("report.md")).unwrap();
    assert!(report.contains("block bootstrap"), "{report}");
}

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
    for (name, region) in
        [(MetricName::Contrast, None), (MetricName::ContrastError, None), (MetricName::Openness, Some(Region::All))]
    {
        let value = |c: &CaseRecord| c.metric(name, region).unwrap().value.unwrap();
        assert!((value(own) - value(theirs)).abs() < 1e-5, "{name:?}");
    }
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
        let (code, text) = lone.score(&["--partial", "--gates", gates.to_str().unwrap()]);
        assert_eq!(code, expected, "{text}");
    }
    fs::remove_file(&gates).unwrap();
    let record = lone.record();
    let own = case(&record, "curtain-arcade", "classic");
    assert_eq!(own.source.as_ref().unwrap().shows, Shows::Frame);
    let names: Vec<MetricName> = own.metrics.iter().map(|m| m.name).collect();
    assert_eq!(names, [MetricName::Contrast, MetricName::Michelson]);
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

/// An engine's intensity, found on the control and undone.
#[test]
fn a_curve_is_fitted_on_controls_and_undone() {
    let images = Images::new();
    images.all(|_, image, _| image.iter().map(|v| v.max(0.0).powf(2.0)).collect());
    let (code, text) = images.score(&["--curve", "fit"]);
    assert_eq!(code, 0, "{text}");
    let record = images.record();
    let curve = record.handed_in.as_ref().unwrap().curve.clone().unwrap();
    assert!((curve.exponent - 2.0).abs() < 0.1 && (curve.gain - 1.0).abs() < 0.02, "{curve:?}");
    assert_eq!(curve.scenes, ["corner"]);
    let run = Record::read(&world().join("run")).unwrap();
    let value =
        |r: &Record| case(r, "curtain-arcade", "classic").metric(MetricName::Contrast, None).unwrap().value.unwrap();
    assert!((value(&record) - value(&run)).abs() < 0.05);
    let (code, _) = images.score(&["--curve", "1,2"]);
    assert_eq!(code, 0);
    assert!((value(&images.record()) - value(&run)).abs() < 1e-4);
}

/// Gates of one's own, and an estimator that the suite does not have.
#[test]
fn own_gates_and_own_estimators() {
    let images = Images::new();
    for scene in ["curtain-arcade", "corner"] {
        let (replicates, size) = Images::of(scene, "classic");
        for (r, image) in replicates.iter().enumerate() {
            images.exr(&format!("{scene}.{r:04}.exr"), image, size);
        }
    }
    let gates = images.out().with_extension("gates.toml");
    fs::write(&gates, "[[gate]]\nname = 'mine'\nmetric = 'contrast-error'\nscenes = ['curtain-arcade']\nmax = -0.9\nestimators = ['my-ao']\n").unwrap();
    let options = ["--estimator", "my-ao", "--rays", "16", "--gates", gates.to_str().unwrap()];
    let (code, text) = images.score(&options);
    assert_eq!(code, 1, "{text}");
    let record = images.record();
    let own = case(&record, "curtain-arcade", "my-ao");
    assert_eq!(own.case.rays, 16);
    let bias = own.metric(MetricName::Bias, Some(Region::All)).unwrap();
    assert!(bias.value.is_none() && bias.note.as_ref().unwrap().contains("no estimator 'my-ao'"), "{bias:?}");
    assert!(!record.suite.methods.contains_key("my-ao"));
    fs::remove_file(gates).unwrap();
}

/// What is declared and no image is of is a slip, wherever it is declared.
#[test]
fn a_slip_in_what_is_declared_is_an_error() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    for (options, says) in [
        (
            ["--estimator", "clasic"],
            "estimator is 'clasic', but no image is of it: the files' names say classic (8 files), extended (8 files)",
        ),
        (["--rays", "16"], "rays is 16, but no image is of it: the files' names say 4 (16 files)"),
    ] {
        let (code, text) = images.score(&options);
        assert!(code == 2 && text.contains(says), "{code}: {text}");
        assert!(!images.out().exists());
    }
    assert_eq!(images.score(&["--estimator", "classic", "--rays", "4"]).0, 0);
    fs::write(images.folder.path().join("score.toml"), "estimator = 'clasic'").unwrap();
    let (code, text) = images.score(&[]);
    assert!(code == 2 && text.contains("'clasic'"), "{code}: {text}");
    // The self-check needs neither.
    fs::remove_file(images.folder.path().join("score.toml")).unwrap();
    images.self_check(|image, _| image.to_vec());
    let at = |name: &str| images.folder.path().join(name);
    fs::rename(at("self-check.classic.16.exr"), at("self-check.exr")).unwrap();
    let (code, text) = images.score(&[]);
    assert!(code == 0 && !text.contains("self-check"), "{code}: {text}");
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

fn mirrored(image: &[f32], width: u32) -> Vec<f32> {
    image.chunks(width as usize).flat_map(|row| row.iter().rev().copied()).collect()
}

/// Whole frames can be as wrong as images of AO.
#[test]
fn what_is_wrong_with_whole_frames_is_named() {
    type Change = fn([Vec<f32>; 2], [u32; 2]) -> [Vec<f32>; 2];
    let cases: [(Change, &str); 5] = [
        (|[with, without], _| [without, with], "are exchanged: "),
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
            "1 pixels that see a surface hold NaN or infinity",
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
    let record = |dark: bool| {
        let images = Images::new();
        for (r, image) in replicates.iter().enumerate() {
            let light = |i: usize| if dark && (i / size[0] as usize).is_multiple_of(2) { 0.0 } else { 0.5 };
            let with: Vec<f32> = image.iter().enumerate().map(|(i, v)| v * light(i)).collect();
            let without: Vec<f32> = (0..image.len()).map(light).collect();
            images.exr(&format!("curtain-arcade.classic.4.{r:04}.with.exr"), &with, size);
            images.exr(&format!("curtain-arcade.classic.4.{r:04}.without.exr"), &without, size);
        }
        let (code, text) = images.score(&["--partial"]);
        assert!(code == 0, "{text}");
        assert_eq!(text.contains("pixels are too dark") && text.contains("all 4 files"), dark, "{text}");
        images.record()
    };
    // K less dK is K(Q): over half of the rows another number, and near it.
    let of = |record: &Record| {
        let own = case(record, "curtain-arcade", "classic");
        let value = |name| own.metric(name, None).unwrap().value.unwrap();
        value(MetricName::Contrast) - value(MetricName::ContrastError)
    };
    let (whole, half) = (record(false), record(true));
    assert!(of(&whole) != of(&half) && (of(&whole) - of(&half)).abs() < 0.2, "{} {}", of(&whole), of(&half));
    let judge = whole.scenes[0].judge.as_ref().unwrap().contrast.value.unwrap();
    assert!((of(&whole) - judge).abs() < 1e-9, "{} {judge}", of(&whole));
}

/// All that is read for a score is what the kit was written with.
#[test]
fn a_damaged_kit_is_exit_code_2_whatever_is_damaged() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    images.self_check(|image, _| image.to_vec());
    let folder = tempfile::tempdir().unwrap();
    let kit = folder.path().join("scoring");
    let fresh = || {
        let _ = fs::remove_dir_all(&kit);
        copy_all(&world().join("kit/scoring"), &kit);
    };
    let score = || {
        let [own, kit, out] = [images.folder.path(), &kit, &images.out()].map(|p| p.display().to_string());
        let output = aogauge(&["score", &own, "--kit", &kit, "--out", &out, "--renderer", "mine"]);
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let edit = |file: &str, from: &str, to: &str| {
        let text = fs::read_to_string(kit.join(file)).unwrap();
        assert!(text.contains(from), "{file} lacks {from}");
        fs::write(kit.join(file), text.replacen(from, to, 1)).unwrap();
    };
    fresh();
    assert_eq!(score().0, 0);
    // Gates may be edited.
    edit("suite.toml", "max = 50.0", "max = 49.0");
    assert_eq!(score().0, 0);
    for file in [
        "scoring.json",
        "suite.toml",
        "self-check.exr",
        "corner/regions.exr",
        "corner/converged-classic.exr",
        "curtain-arcade/judge.exr",
        "corner/look.exr",
    ] {
        for is_there in [true, false] {
            fresh();
            if is_there {
                let mut bytes = fs::read(kit.join(file)).unwrap();
                let at = bytes.len() / 2;
                bytes[at] ^= 1;
                fs::write(kit.join(file), bytes).unwrap();
            } else {
                fs::remove_file(kit.join(file)).unwrap();
            }
            let (code, text) = score();
            let name = file.rsplit('/').next().unwrap();
            assert!(code == 2 && text.contains(name), "{file}, {is_there}: {code}: {text}");
        }
    }
    for (file, from, to) in [
        ("suite.toml", "precision = 0.3", "precision = 0.4"),
        ("suite.toml", "receiver_plane = \"clipped\"", "receiver_plane = \"counts\""),
        ("scoring.json", "\"seed\": ", "\"seed\": 1"),
        ("scoring.json", "\"control\": true", "\"control\": false"),
        ("scoring.json", "\"radius\": ", "\"radius\": 1"),
    ] {
        fresh();
        edit(file, from, to);
        let (code, text) = score();
        assert!(code == 2 && text.contains(file), "{file}: {code}: {text}");
    }
}

fn copy_all(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(|e| e.unwrap().path()) {
        let beside = to.join(entry.file_name().unwrap());
        if entry.is_dir() {
            copy_all(&entry, &beside);
        } else {
            fs::copy(&entry, &beside).unwrap();
        }
    }
}

/// A gate that no scene of the kit could ever be held against is a mistake.
#[test]
fn gates_that_can_never_apply_are_named() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    let gates = images.out().with_extension("toml");
    for (gate, says) in [
        (
            "metric = 'contrast-error'\nscenes = ['corner']",
            "gate 'mine': contrast-error is taken under an occluder, and none of its scenes has one: corner",
        ),
        ("metric = 'bias'\nregion = 'footprint'\nscenes = ['corner']", "bias of footprint is taken under an occluder"),
        ("metric = 'judge-contrast'\nscenes = ['corner']", "judge-contrast is taken under an occluder"),
    ] {
        fs::write(&gates, format!("[[gate]]\nname = 'mine'\nmax = 5.0\n{gate}\n")).unwrap();
        let (code, text) = images.score(&["--gates", gates.to_str().unwrap()]);
        assert!(code == 2 && text.contains(says) && text.contains(".toml"), "{code}: {text}");
    }
    fs::remove_file(gates).unwrap();
}

/// What is the same of many files is said once.
#[test]
fn warnings_of_many_files_are_one_line() {
    let images = Images::new();
    for scene in ["curtain-arcade", "corner"] {
        let (replicates, [w, h]) = Images::of(scene, "classic");
        for (r, image) in replicates.iter().enumerate() {
            let at = |x: u32, y: u32| image::Luma([(image[(y * w + x) as usize] * 255.0).round() as u8]);
            let path = images.folder.path().join(format!("{scene}.classic.4.{r:04}.png"));
            image::ImageBuffer::from_fn(w, h, at).save(path).unwrap();
        }
    }
    let (_, text) = images.score(&[]);
    let lines: Vec<&str> = text.lines().filter(|l| l.contains("no encoding is declared")).collect();
    assert!(lines.len() == 1 && lines[0].contains(".png files of classic store integers: all are taken"), "{text}");
}

/// Notes stand on lines of their own.
#[test]
fn what_is_not_taken_is_a_line_each() {
    let (replicates, size) = Images::of("corner", "classic");
    let none = Images::new();
    none.exr("corner.clasic.4.0000.exr", &replicates[0], size);
    none.exr("room.classic.4.0000.exr", &replicates[0], size);
    let (code, text) = none.score(&[]);
    let lines: Vec<&str> = text.lines().collect();
    assert!(code == 4 && lines.len() == 3 && lines[1..].iter().all(|l| l.starts_with("  ")), "{code}: {text}");
    // What a folder is called that no renderer may be.
    let odd = tempfile::Builder::new().prefix("my_ao no 1").tempdir().unwrap();
    Layers::new(size).with("Y", replicates[0].clone()).write(&odd.path().join("corner.classic.4.exr")).unwrap();
    let [kit, folder, out] = [&world().join("kit"), odd.path(), &none.out()].map(|p| p.display().to_string());
    let output = aogauge(&["score", &folder, "--kit", &kit, "--out", &out, "--partial"]);
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("The renderer is called 'my_ao-no-1"), "{text}");
}

/// How many images there are is said where it matters.
#[test]
fn counts_of_images_are_told() {
    let fewer = Images::new();
    fewer.all(|_, image, _| image.to_vec());
    for scene in ["curtain-arcade", "corner"] {
        for r in [2, 3] {
            fs::remove_file(fewer.folder.path().join(format!("{scene}.classic.4.{r:04}.exr"))).unwrap();
        }
    }
    fewer.score(&[]);
    let record = fewer.record();
    let removed = case(&record, "curtain-arcade", "extended").metric(MetricName::Removed, None).unwrap();
    let note = removed.note.clone().unwrap();
    assert!(note.contains("there are 4 images of this case and 2 images of classic AO ('classic')"), "{note}");
    // One image cannot show that seeds differ.
    let (replicates, size) = Images::of("curtain-arcade", "classic");
    let one = Images::new();
    one.exr("curtain-arcade.classic.4.exr", &replicates[0], size);
    let gates = one.out().with_extension("toml");
    fs::write(&gates, "[[gate]]\nname = 'seeds'\nmetric = 'distinct-replicates'\nmin = 1.0\n").unwrap();
    let (code, text) = one.score(&["--partial", "--gates", gates.to_str().unwrap()]);
    assert!(code == 6 && text.contains("one image alone"), "{code}: {text}");
    fs::remove_file(gates).unwrap();
    for (curve, says) in
        [("-1,1", "curve.gain is -1: it must be 0.000001 to 1000"), ("1", "give fit, or gain (0.000001 to 1000)")]
    {
        let (code, text) = one.score(&["--partial", "--curve", curve]);
        assert!(code == 2 && text.contains(says), "{code}: {text}");
    }
}
