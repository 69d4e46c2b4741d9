//! The image by which a renderer shows that it draws the kit as it is meant; what it cannot show.
use super::*;

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
            "infinity: 1 pixel that sees a surface holds",
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

/// Where the self-check has the right R and the scenes have not, each of them says by how much it is off.
#[test]
fn another_radius_of_the_scenes_alone_is_doubtful() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    images.self_check(|image, _| image.to_vec());
    let (code, text) = images.score(&[]);
    assert!(code == 0 && !text.contains("does not agree"), "{code}: {text}");
    for r in 0..4 {
        fs::remove_file(images.folder.path().join(format!("corner.classic.4.{r:04}.exr"))).unwrap();
    }
    let scene = world().join("kit/scenes/corner/corner.toml").display().to_string();
    let out = images.folder.path().join("corner.classic.4.exr").display().to_string();
    ok(&["render", &scene, "--rays", "4", "--replicates", "4", "--set", "radius=0.35", "--out", &out]);
    let (code, text) = images.score(&[]);
    assert!(code == 0 && text.contains("R or scale may be off"), "{code}: {text}");
}

/// A factor that nobody mistakes is told as it is, or that there is one; strength is no such thing.
#[test]
fn another_radius_does_not_agree() {
    let images = Images::new();
    images.all(|_, image, _| image.to_vec());
    let scene = world().join("kit/scenes/self-check/self-check.toml").display().to_string();
    let out = images.folder.path().join("self-check.classic.16.exr").display().to_string();
    for (radius, factor) in [("0.65", 1.3), ("0.75", 1.5), ("0.35", 0.7)] {
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
        assert!((told / factor - 1.0).abs() < 0.15, "{radius}: {told}: {text}");
    }
    // Too far from any that is known.
    ok(&["render", &scene, "--rays", "16", "--replicates", "2", "--set", "radius=2.5", "--out", &out]);
    let (code, text) = images.score(&[]);
    assert!(code == 2 && text.contains("R is between 3.28 and 10 times what was asked for"), "{code}: {text}");
    images.self_check(|image, _| image.iter().map(|v| 1.0 - 0.7 * (1.0 - v)).collect());
    let (code, text) = images.score(&[]);
    assert!(code == 0 && text.contains("AO of strength 0.7"), "{code}: {text}");
    // Less than a curve is worth the name, and no R.
    images.self_check(|image, _| image.iter().map(|v| 0.9 * v).collect());
    let (code, text) = images.score(&[]);
    assert!(code == 5 && text.contains("all looks like 0.90 times what is expected"), "{code}: {text}");
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
        // Both scenes look the same upside down.
        if options[0] != "--rows" {
            let (code, text) = images.score(&options);
            assert!(code == 5 && text.contains(says), "{options:?}: {code}: {text}");
        }
        images.self_check(|image, _| image.to_vec());
        let (code, text) = images.score(&options);
        assert!(code == 2 && text.contains(says), "{options:?}: {code}: {text}");
    }
}
