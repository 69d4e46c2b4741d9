//! What a user meets of `aogauge composite`.

use aogauge::{
    layers::Layers,
    picture::split,
    render::{
        Geometry,
        composite::{Lighting, Shaded, shade, sun},
        gpu::Gpu,
        materials::Materials,
    },
    scenes::{Light, LightKind, Material, Scene, Sky, Texture, View, Wrap, gltf, library},
};
use glam::{Vec2, Vec3};
use image::RgbImage;
use serde_json::Value;
use std::{
    fs,
    path::Path,
    process::{Command, Output},
    sync::Arc,
};

fn aogauge(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(folder).args(args).output().unwrap()
}

/// Composes the arcade in the sun.
fn composite(folder: &Path, out: &str, options: &[&str]) -> Value {
    let common = ["composite", "curtain-arcade", "--sun", "80,50", "--rays", "8", "--format", "json", "--out", out];
    let output = aogauge(folder, &[&common, options].concat());
    assert!(output.status.success(), "{options:?}\n{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn layers(folder: &Path, options: &[&str]) -> Layers {
    composite(folder, "a.exr", options);
    Layers::read(&folder.join("a.exr")).unwrap()
}

fn picture(path: &Path) -> RgbImage {
    image::open(path).unwrap().into_rgb8()
}

const EXTENDED: [&str; 4] = ["--estimator", "extended", "--set", "receiver_plane=clipped"];

/// The layers add up, and say what they should.
#[test]
fn layers_hold_the_parts_of_the_picture() {
    let dir = tempfile::tempdir().unwrap();
    let a = layers(dir.path(), &["--ambient", "1,2,3"]);
    let get = |name: &str| a.get(name).unwrap_or_else(|| panic!("{name}"));
    for c in ["R", "G", "B"] {
        let [color, direct, ambient, emission] =
            ["color", "direct", "ambient", "emission"].map(|part| get(&format!("{part}.{c}")));
        for i in 0..color.len() {
            let sum = direct[i] + ambient[i] + emission[i];
            assert!((color[i] - sum).abs() <= 1e-5 * sum, "{c} {i}: {} {sum}", color[i]);
        }
        assert!(direct.iter().any(|v| *v > 0.5) && direct.contains(&0.0), "sun and shade");
    }
    let (red, blue, ao) = (get("ambient.R"), get("ambient.B"), get("ao"));
    for i in 0..ao.len() {
        // One albedo everywhere, so that the product of means is the mean of products.
        let expected = 0.6 * ao[i];
        assert!((red[i] - expected).abs() < 1e-4 && (blue[i] - 3.0 * expected).abs() < 3e-4, "{i}");
        assert!((get("albedo.G")[i] - 0.6).abs() < 1e-5);
        // The reader takes the channel `normal.Y` for a grey layer.
        let normal = ["normal.X", "normal", "normal.Z"].map(|n| get(n)[i]);
        assert!(normal.iter().map(|v| v * v).sum::<f32>() < 1.001 && get("depth")[i] > 0.1);
    }
}

/// Each part of a split is the whole picture there, to the last bit of its
/// values; in the PNG, beside dividers and names.
#[test]
fn a_split_shows_whole_pictures_in_part() {
    let dir = tempfile::tempdir().unwrap();
    let all = layers(dir.path(), &["--split", "--parts"]);
    let alone = [layers(dir.path(), &[]), layers(dir.path(), &EXTENDED)];
    let names = ["no-ao", "classic", "extended"];
    let parts = names.map(|n| Layers::read(&dir.path().join(format!("a.{n}.exr"))).unwrap());
    let [width, height] = all.resolution;
    for name in ["color.R", "color.G", "color.B", "ambient.R", "ao", "direct.B"] {
        assert_eq!(parts[1].get(name), alone[0].get(name), "{name}");
        assert_eq!(parts[2].get(name), alone[1].get(name), "{name}");
        for i in 0..(width * height) as usize {
            let part = split::part(i as u32 % width, 3, width);
            let [a, b] = [&all, &parts[part]].map(|l| l.get(name).unwrap()[i]);
            assert!(a.to_bits() == b.to_bits(), "{name} {i}: {a} {b}");
        }
    }
    assert!(parts[0].get("ao").unwrap().iter().all(|v| *v == 1.0));

    let told = composite(dir.path(), "b.png", &["--split", "--parts"]);
    composite(dir.path(), "classic.png", &[]);
    let whole = picture(&dir.path().join("b.png"));
    let parts = names.map(|n| picture(&dir.path().join(format!("b.{n}.png"))));
    assert_eq!(parts[1], picture(&dir.path().join("classic.png")), "one exposure for all");
    assert_eq!(told["pictures"][2]["image"], "b.extended.png");
    let near_edge = |x: u32| (1..3).any(|i| split::columns(i, 3, width).start.abs_diff(x) <= split::divider(height));
    for (x, y, pixel) in whole.enumerate_pixels() {
        if !near_edge(x) && y < height - split::foot(height) {
            assert_eq!(pixel, parts[split::part(x, 3, width)].get_pixel(x, y), "{x} {y}");
        }
    }
    let means: Vec<f64> = (0..3).map(|i| told["pictures"][i]["mean_openness"].as_f64().unwrap()).collect();
    assert!(means[0] == 1.0 && means[1] < 0.99 && means[2] < means[1], "{means:?}");
}

#[test]
fn pictures_repeat_whatever_the_threads() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = |threads: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_aogauge"))
            .current_dir(dir.path())
            .env("RAYON_NUM_THREADS", threads)
            .args(["composite", "curtain-arcade", "--sun", "80,50", "--split", "--rays", "8", "--out", "t.exr"])
            .output()
            .unwrap();
        assert!(output.status.success());
        fs::read(dir.path().join("t.exr")).unwrap()
    };
    assert!(bytes("1") == bytes("3"));
    let [a, b] = ["1", "2"].map(|seed| layers(dir.path(), &["--seed", seed]));
    assert_ne!(a.get("ao"), b.get("ao"));
    assert_eq!(a.get("direct.R"), b.get("direct.R"), "sun and samples are not random");
}

#[test]
fn exposure_scale_and_view_do_as_told() {
    let dir = tempfile::tempdir().unwrap();
    let told = composite(dir.path(), "a.png", &[]);
    let automatic = told["exposure"].as_f64().unwrap();
    composite(dir.path(), "b.png", &["--exposure", &format!("{automatic}")]);
    composite(dir.path(), "c.png", &["--exposure", &format!("{}", automatic - 1.0)]);
    let [a, b, c] = ["a.png", "b.png", "c.png"].map(|n| picture(&dir.path().join(n)));
    assert_eq!(a, b);
    assert!(c.get_pixel(5, 5)[0] < a.get_pixel(5, 5)[0]);
    let told = composite(dir.path(), "a.png", &["--scale", "2", "--samples", "1"]);
    assert_eq!(told["resolution"], serde_json::json!([576, 384]));
    assert_eq!(told["sun_irradiance"][0].as_f64().unwrap().round(), 16.0, "5 pi times the sky");
    let told = composite(dir.path(), "a.png", &["--view", "measure"]);
    assert_eq!(told["resolution"], serde_json::json!([208, 32]));
    composite(dir.path(), "d.png", &["--eye", "2,1,0", "--target", "0,0.5,-0.2", "--fov", "70"]);
    assert_ne!(picture(&dir.path().join("d.png")), a);
}

#[test]
fn wrong_options_are_named() {
    let dir = tempfile::tempdir().unwrap();
    for (args, says) in [
        (vec!["plane", "--out", "a.jpg"], ".exr or .png"),
        (vec!["plain", "--out", "a.png"], "plain"),
        (vec!["plane", "--out", "a.png", "--sun", "10"], "AZIMUTH,ELEVATION"),
        (vec!["plane", "--out", "a.png", "--sun", "400,10"], "-360 to 360"),
        (vec!["plane", "--out", "a.png", "--sun", "40,0"], "above 0, to 90"),
        (vec!["plane", "--out", "a.png", "--sun", "x,0"], "'x' is no number"),
        (vec!["plane", "--out", "a.png", "--sun-irradiance", "3"], "--sun"),
        (vec!["plane", "--out", "a.png", "--sun", "1,9", "--sun-irradiance", "-3"], "0 to 1000000"),
        (vec!["plane", "--out", "a.png", "--ambient", "1,2"], "R,G,B"),
        (vec!["plane", "--out", "a.png", "--ambient", "0", "--sun", "1,9"], "--sun-irradiance"),
        (vec!["plane", "--out", "a.png", "--exposure", "31"], "-30 to 30"),
        (vec!["plane", "--out", "a.png", "--samples", "65"], "1..=64"),
        (vec!["plane", "--out", "a.png", "--scale", "0"], "1..=16"),
        (vec!["atrium", "--out", "a.png", "--scale", "16"], "16777216"),
        (vec!["plane", "--out", "a.png", "--fov", "170"], "1 to 169"),
        (vec!["plane", "--out", "a.png", "--eye", "0,1"], "X,Y,Z"),
        (vec!["plane", "--out", "a.png", "--eye", "0,1,0", "--target", "0,0,0"], "straight up or down"),
        (vec!["plane", "--out", "a.png", "--estimator", "path-traced"], "method of openness"),
        (vec!["plane", "--out", "a.png", "--split", "--estimator", "classic"], "extended or extended-obscurance"),
        (vec!["plane", "--out", "a.png", "--parts"], "--split"),
        (vec!["plane", "--out", "a.png", "--estimator", "extended"], "receiver_plane"),
        (vec!["ceiling-light", "--out", "a.png"], "--ambient"),
        (vec!["plane", "--out", "/dev/null/a.png"], "/dev/null"),
    ] {
        let output = aogauge(dir.path(), &[vec!["composite"], args.clone()].concat());
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {stderr}");
        assert!(stderr.contains(says), "{args:?}: {stderr}");
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0, "nothing was written");
}

/// A pixel by the CPU and by the GPU, the same to a thousandth.
fn alike(a: &Shaded, b: &Shaded) -> bool {
    let near = |a: Vec3, b: Vec3| (a - b).length() <= 1e-3 * a.length().max(b.length());
    near(a.direct, b.direct)
        && near(a.emission, b.emission)
        && near(a.albedo, b.albedo)
        && near(a.normal, b.normal)
        && (a.depth - b.depth).abs() <= 1e-3 * a.depth.abs()
}

/// The GPU shades a view as the CPU does: at most 1 pixel in 10,000 differs.
/// Returns what the CPU found.
fn compare(gpu: &Gpu, what: &str, scene: &Scene, view: &View, lighting: &Lighting) -> Vec<Shaded> {
    let geometry = Geometry::new(scene).unwrap();
    let materials = Materials::new(scene);
    let cpu = shade(&geometry, &materials, view, lighting);
    let mut lit = gpu.lit(&geometry, &materials, lighting).unwrap();
    let other = lit.shade(&View { resolution: [8, 8], ..*view }).unwrap();
    assert_eq!(other.len(), 64);
    let found = lit.shade(view).unwrap();
    let parts = |s: &Shaded| (s.direct, s.depth, s.emission, s.albedo, s.normal);
    assert!(found.iter().map(parts).eq(lit.shade(view).unwrap().iter().map(parts)), "{what}: once more, the same");
    let differ = cpu.iter().zip(&found).filter(|(a, b)| !alike(a, b)).count();
    println!("{what}: {differ} of {} pixels differ", cpu.len());
    assert!(differ * 10_000 <= cpu.len(), "{what}: {differ} of {} pixels differ", cpu.len());
    cpu
}

/// Sun, bulb and torch, and a sky of a gradient.
fn lighting(at: Vec3, sky: Sky) -> Lighting {
    let light = |kind, color, range| Light {
        name: "l".into(),
        kind,
        position: at,
        direction: Vec3::new(-0.48, -0.8, -0.36),
        color,
        intensity: 6.0,
        range,
    };
    let spot = LightKind::Spot { inner: 0.3, outer: 0.7 };
    let lights = vec![
        light(LightKind::Point, [1.0, 0.6, 0.2], Some(2.5)),
        light(spot, [0.3, 0.5, 1.0], None),
        sun(97.0, 58.0, Vec3::new(5.0, 4.5, 4.0)),
    ];
    Lighting { lights, ambient: Vec3::new(0.5, 0.7, 1.0), sky }
}

#[test]
fn the_gpu_lights_scenes_as_the_cpu_does() {
    let gpu = Gpu::open().unwrap();
    let gradient = Sky::Gradient { zenith: 1.0, horizon: 0.4, ground: 0.1 };
    for (name, at) in [("curtain-arcade", Vec3::new(0.6, 0.9, 0.7)), ("pillar", Vec3::new(0.4, 0.6, 0.5))] {
        let mut scene = library::scene(name).unwrap();
        // All corners of the material model.
        for (i, object) in scene.objects.iter_mut().enumerate() {
            object.material = Material {
                base_color: [0.9, 0.6, 0.3],
                metallic: [0.0, 1.0, 0.4][i % 3],
                roughness: [1.0, 0.3, 0.1][i % 3],
                ..object.material.clone()
            };
        }
        let view = scene.look.view();
        let shaded = compare(&gpu, name, &scene, &view, &lighting(at, gradient));
        let lit = shaded.iter().filter(|s| s.direct.x > 0.0).count();
        assert!(lit * 5 > shaded.len() && shaded.iter().any(|s| s.depth > 0.0 && s.direct == Vec3::ZERO), "{name}");
        let none = Lighting { lights: vec![], ..lighting(at, Sky::Uniform(2.0)) };
        let small = View { resolution: [64, 64], ..view };
        let dark = compare(&gpu, name, &scene, &small, &none);
        assert!(dark.iter().all(|s| s.direct == Vec3::ZERO));
        // More lights than one dispatch looks at.
        let many = Lighting { lights: (0..30).flat_map(|_| lighting(at, gradient).lights).collect(), ..none };
        let bright = compare(&gpu, name, &scene, &small, &many);
        assert!(bright.iter().any(|s| s.direct.x > 1.0));
    }
}

/// A curtain over open ground, each with a picture for every part of its
/// material, every wrap among them, as a model in a glTF file.
fn textured(folder: &Path) -> Scene {
    let mut scene = library::scene("curtain-open").unwrap();
    let texture = |size: [u32; 2], wrap: [Wrap; 2], seed: u32| {
        let texel = |i: u32| [i * 37 + seed, i * i * 11 + seed, i * 101, 255].map(|v| 64 + (v % 192) as u8);
        Some(Arc::new(Texture { size, wrap, texels: (0..size[0] * size[1]).map(texel).collect() }))
    };
    for (i, object) in scene.objects.iter_mut().enumerate() {
        let place = |p: &Vec3| Vec2::new(p.x * 1.3 + p.y * 0.2, p.z * 0.9 + p.y * 0.7);
        object.mesh.uvs = object.mesh.positions.iter().map(place).collect();
        object.material = Material {
            base_color: [0.9, 0.8, 0.7],
            texture: texture([16, 8], [[Wrap::Repeat, Wrap::Mirror], [Wrap::Clamp, Wrap::Repeat]][i % 2], 3),
            metallic: 0.5,
            roughness: 0.9,
            metallic_roughness_texture: texture([5, 7], [Wrap::Mirror, Wrap::Clamp], 50),
            emissive: [0.2, 0.1, 0.3],
            emissive_texture: texture([4, 4], [Wrap::Repeat; 2], 90 + i as u32),
            ..object.material.clone()
        };
    }
    let mut file = fs::File::create(folder.join("curtain.glb")).unwrap();
    gltf::write_glb(&scene, &mut file).unwrap();
    fs::write(folder.join("curtain.toml"), scene.model_toml("curtain.glb").unwrap()).unwrap();
    Scene::from_file(&folder.join("curtain.toml")).unwrap()
}

#[test]
fn the_gpu_reads_textures_as_the_cpu_does() {
    let dir = tempfile::tempdir().unwrap();
    let scene = textured(dir.path());
    let gpu = Gpu::open().unwrap();
    let lighting = lighting(Vec3::new(0.5, 0.8, 0.6), scene.environment.sky);
    let shaded = compare(&gpu, "textured", &scene, &scene.look.view(), &lighting);
    for value in [|s: &Shaded| s.albedo.x, |s: &Shaded| s.emission.y, |s: &Shaded| s.direct.z] {
        let values: Vec<f32> = shaded.iter().filter(|s| s.depth > 0.0).map(value).collect();
        let (least, most) = values.iter().fold((f32::MAX, f32::MIN), |(a, b), &v| (a.min(v), b.max(v)));
        assert!(most > 1.5 * least && most > 0.01, "textures must show: {least} {most}");
    }
}

/// From outside: the same picture whoever renders it.
#[test]
fn the_gpu_composes_the_same_picture() {
    let dir = tempfile::tempdir().unwrap();
    let options = ["--sun-irradiance", "8", "--exposure", "0"];
    let cpu = layers(dir.path(), &options);
    let gpu = layers(dir.path(), &[&options[..], &["--renderer", "gpu"]].concat());
    for name in ["color.R", "direct.G", "ambient.B", "emission.R", "ao", "albedo.G", "depth"] {
        let (a, b) = (cpu.get(name).unwrap(), gpu.get(name).unwrap());
        let differ = a.iter().zip(b).filter(|(a, b)| (*a - *b).abs() > 1e-3 * a.abs()).count();
        // A pixel has four samples, each of which may decide otherwise.
        assert!(differ * 2_500 <= a.len(), "{name}: {differ} of {} pixels differ", a.len());
    }
}
