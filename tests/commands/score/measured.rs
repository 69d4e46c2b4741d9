//! What is measured of images, and which gates speak of them.
use super::*;

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
    assert!(report.contains("block bootstrap") && report.contains("over the tiles of one image a case"), "{report}");
    // That replicates differ is asked of replicates.
    let gates = images.out().with_extension("toml");
    let distinct = "[[gate]]\nname = 'distinct'\nmetric = 'distinct-replicates'\nmin = 1.0\n";
    let open = "[[gate]]\nname = 'open'\nmetric = 'openness'\nregion = 'all'\nmin = 0.01\n";
    fs::write(&gates, [distinct, open].concat()).unwrap();
    let (code, text) = images.score(&["--partial", "--gates", gates.to_str().unwrap()]);
    fs::remove_file(&gates).unwrap();
    let idle = &images.record().idle_gates;
    assert!(code == 0 && idle.len() == 1 && idle[0].excused, "{code}: {idle:?}: {text}");
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
    // A gate on what can never be known of it waits for nothing.
    let bias = "[[gate]]\nname = 'bias'\nmetric = 'bias'\nregion = 'all'\nequals = 0.0\nwithin = 0.1\n";
    let open = "[[gate]]\nname = 'open'\nmetric = 'openness'\nregion = 'all'\nmin = 0.01\n";
    fs::write(&gates, [bias, open].concat()).unwrap();
    let (code, text) = images.score(&options);
    assert!(code == 0 && text.contains("no estimator 'my-ao'"), "{code}: {text}");
    fs::remove_file(gates).unwrap();
    // The name that is not taken is what is wrong.
    let (replicates, size) = Images::of("corner", "classic");
    let other = Images::new();
    other.exr("corner.my-ao.4.0000.exr", &replicates[0], size);
    let (code, text) = other.score(&[]);
    assert!(code == 4 && text.contains("the one image is not taken") && text.contains("--estimator"), "{code}: {text}");
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
    assert!(code == 4 && text.contains("one image alone"), "{code}: {text}");
    fs::remove_file(gates).unwrap();
    for (curve, says) in
        [("-1,1", "curve.gain is -1: it must be 0.000001 to 1000"), ("1", "give fit, or gain (0.000001 to 1000)")]
    {
        let (code, text) = one.score(&["--partial", "--curve", curve]);
        assert!(code == 2 && text.contains(says), "{code}: {text}");
    }
}
