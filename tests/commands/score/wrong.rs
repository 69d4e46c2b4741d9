//! What is wrong with images, with what is declared of them, or with the kit.
use super::*;

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
