//! `aogauge flatland` as a user meets it, and its extended method against rays.

use aogauge::{
    flatland::{Estimator, Measure, Model, ReceiverPlane, Slab, Space, Study},
    render::{self, Geometry, ao::Shading, sampler::Sampler},
    scenes::Scene,
    stats::Estimate,
};
use glam::Vec3;
use std::process::{Command, Output};

fn aogauge(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).arg("flatland").args(args).output().unwrap()
}

/// What goes to standard output of a run that passes.
fn passes(args: &[&str]) -> String {
    let output = aogauge(args);
    assert_eq!(output.status.code(), Some(0), "{args:?}\n{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn study(args: &[&str]) -> Study {
    serde_json::from_str(&passes(&[args, &["--format", "json"]].concat())).unwrap()
}

#[test]
fn the_table_shows_the_highlight_and_that_extended_takes_it_away() {
    let text = passes(&["--width", "0.02,0.20", "--gap", "0.10"]);
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
    let contrast = |w: &str, label: &str| -> f64 {
        rows.iter().find(|r| r.first() == Some(&w) && r.contains(&label)).unwrap()[3].parse().unwrap()
    };
    assert!((contrast("2", "classic") - 0.065).abs() < 1.1e-3, "{text}");
    assert!(contrast("2", "extended-clipped") < 0.0 && contrast("2", "extended-counts") < 0.0);
    assert!(contrast("20", "classic") < -0.4);
}

#[test]
fn json_and_plots_lie_in_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("deep/er");
    let args = ["--space", "flat", "--measure", "uniform", "--width", "0.01", "--gap", "0.02,0.05", "--map"];
    let printed = study(&[&args[..], &["--out", out.to_str().unwrap()]].concat());
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    assert_eq!(serde_json::from_str::<Study>(&read("flatland.json")).unwrap(), printed);
    for plot in ["profiles.svg", "map.svg"] {
        let svg = read(plot);
        assert!(svg.starts_with("<svg") && svg.contains("extended-counts") && svg.contains("flatland, uniform"));
    }
    // Over its own, and over nothing of others.
    let again = [&args[..], &["--out", out.to_str().unwrap()]].concat();
    passes(&again);
    for file in ["map.svg", "profiles.svg", "flatland.json"] {
        let kept = read(file);
        std::fs::write(out.join(file), "<svg>mine</svg>").unwrap();
        let refused = aogauge(&again);
        let told = String::from_utf8_lossy(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{told}");
        assert!(told.contains(file) && told.contains("nothing is written"), "{told}");
        assert_eq!(read(file), "<svg>mine</svg>");
        std::fs::write(out.join(file), kept).unwrap();
    }
    let apexes: Vec<_> = printed.profiles.iter().map(|p| p.curves[0].apex).collect();
    assert!(apexes.iter().all(|a| a.height > 0.1 && a.contrast.unwrap() > 0.1), "{apexes:?}");
    assert!(apexes[1].apex > apexes[0].apex, "higher over a larger gap: {apexes:?}");
    for profile in &printed.profiles {
        for curve in &profile.curves {
            let mut mirrored = curve.openness.clone();
            mirrored.reverse();
            assert_eq!(mirrored, curve.openness);
            assert_eq!(curve.openness.len(), printed.t.len());
            let empty = curve.openness[0];
            assert!((empty - if curve.label == "extended-counts" { 0.852_416_382 } else { 1.0 }).abs() < 1e-6);
        }
    }
    let map = printed.map.unwrap();
    let [classic, clipped, _] = &map.curves[..] else { unreachable!() };
    // Beyond sqrt(R^2/4 + R'^2) no secondary ray reaches the box.
    let mut thin_and_bright = 0;
    for (row, gap) in map.gap.iter().enumerate() {
        for column in 0..map.width.len() {
            let (k, own) = (classic.contrast[row][column].unwrap(), clipped.contrast[row][column].unwrap());
            if *gap > 0.56 {
                assert!((k - own).abs() < 1e-9);
                assert!(clipped.removed[row][column].is_none_or(|r| r.abs() < 1e-9));
            }
            thin_and_bright += usize::from(map.width[column] < 0.05 && (0.1..0.5).contains(gap) && k > 0.01);
            assert!(k < 0.0 || map.width[column] < 0.6, "wide boxes darken");
        }
    }
    assert!(thin_and_bright > 100, "{thin_and_bright}");
}

#[test]
fn the_same_bytes_on_one_thread_and_on_many() {
    let run = |threads: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_aogauge"))
            .args(["flatland", "--space", "flat", "--map", "--format", "json"])
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        assert!(output.status.success());
        output.stdout
    };
    assert_eq!(run("1"), run("4"));
}

#[test]
fn the_exponential_darkens_less_with_more_extinction() {
    let centre = |sigma: &str| {
        let args = ["--falloff", "exponential", "--sigma", sigma, "--width", "0.02", "--gap", "0.05"];
        study(&args).profiles[0].curves[0].apex.centre
    };
    assert!(centre("3") < centre("12") && centre("12") < centre("48"));
}

#[test]
fn bad_values_are_refused_in_one_sentence() {
    for (args, words) in [
        (&["--width", "-0.1"][..], &["--width", "-0.1", "metres"][..]),
        (&["--gap", "0"], &["--gap", "0", "1000000"]),
        (&["--radius", "nan"], &["--radius", "NaN", "metres"]),
        (&["--height", "inf"], &["--height", "inf", "metres"]),
        (&["--secondary-radius", "1e9"], &["--secondary-radius", "1000000000"]),
        (&["--width", "1,2,3,4,5,6,7,8,9"], &["--width", "9", "1 to 8"]),
        (&["--sigma", "3"], &["--sigma", "--falloff exponential"]),
        (&["--falloff", "exponential", "--sigma", "-1"], &["--sigma", "-1", "from 0"]),
        (&["--falloff", "exponential", "--receiver-plane", "counts"], &["--receiver-plane", "--falloff step"]),
    ] {
        let output = aogauge(args);
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {message}");
        assert_eq!(message.lines().count(), 1, "{message}");
        assert!(output.stdout.is_empty());
        for word in words {
            assert!(message.contains(word), "{args:?}: '{message}' lacks '{word}'");
        }
    }
    assert_eq!(aogauge(&["--space", "curved"]).status.code(), Some(2));
}

/// The ray tracer's extended estimator on a box that no reference has, over 64
/// replicates: within 4.5 standard errors at each of 10 points.
#[test]
fn extended_agrees_with_rays() {
    let (width, gap, ratio) = (0.03, 0.07, 0.35);
    let text = format!(
        r#"
description = "box"
ao = {{ radius = 0.25, secondary_radius = {} }}
environment = {{ radiance = 1.0 }}
measure = {{ center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 0.05, resolution = [16, 16] }}
look = {{ eye = [1, 1, 1], target = [0, 0, 0], resolution = [16, 16] }}
[[object]]
name = "ground"
shape = {{ plane = {{ center = [0, 0, 0], u = [0, 0, 6], v = [6, 0, 0] }} }}
[[object]]
name = "box"
occluder = true
shape = {{ curtain = {{ thickness = {width}, gap = {gap}, height = 1.0, length = 6.0 }} }}
"#,
        0.25 * ratio
    );
    let scene = Scene::from_toml("box", "box.toml", &text, None).unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let slab = Slab { width, gap, height: 1.0 };
    for receiver_plane in [ReceiverPlane::Clipped, ReceiverPlane::Counts] {
        let estimator = Estimator::Extended { secondary_radius: 0.25 * ratio, receiver_plane };
        let model = Model { radius: 0.25, space: Space::Extruded, measure: Measure::Cosine, estimator };
        let extension = Some(render::Extension::of_the_paper(receiver_plane));
        let by_rays = render::Openness { extension, ..render::Openness::plain(render::Falloff::Step) };
        for (salt, t) in [0.0, 0.02, 0.05, 0.1, 0.18].into_iter().enumerate() {
            let point = Vec3::new(t, 0.0, 0.1);
            let shading = Shading::new(&geometry.tracer, point, Vec3::Y, scene.ao, by_rays);
            let values: Vec<f64> = (0..64)
                .map(|replicate| f64::from(shading.openness(512, &Sampler::new(3, salt as u32, replicate)).0))
                .collect();
            let rays = Estimate::of_mean(&values);
            let exact = model.openness(&slab, f64::from(t), 1e-6);
            assert!((rays.value - exact).abs() < 4.5 * rays.se + 1e-4, "{t}: {rays:?}, expected {exact}");
            assert!(rays.se < 2e-3);
        }
    }
}
