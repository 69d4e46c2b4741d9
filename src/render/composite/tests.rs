use super::*;
use crate::{
    render::{Renderer, cpu::Cpu},
    scenes::{Scene, luminance},
};
use std::f32::consts::{FRAC_1_PI, PI};

/// A grey, rough floor seen from above, and what else there is.
fn scene(more: &str) -> Scene {
    let text = format!(
        "description = 'x'\nao = {{ radius = 1 }}\nenvironment = {{ radiance = 1 }}\n\
         measure = {{ center = [0, 0, 0], normal = [0, 1, 0], transect = [1, 0, 0], clearance = 3, resolution = [64, 64] }}\n\
         look = {{ eye = [0, 4, 2], target = [0, 0, 0], resolution = [32, 32] }}\n\
         [[object]]\nname = 'floor'\nalbedo = 0.5\nshape = {{ plane = {{ center = [0, 0, 0], u = [0, 0, 9], v = [9, 0, 0] }} }}\n{more}"
    );
    Scene::from_toml("x", "x", &text, None).unwrap()
}

/// A quad a metre above the floor, over its half of positive x.
const SHEET: &str =
    "[[object]]\nname = 'sheet'\nshape = { plane = { center = [4.5, 1, 0], u = [0, 0, 9], v = [9, 0, 0] } }\n";

fn lamp(kind: LightKind, position: Vec3, direction: Vec3) -> Light {
    Light { name: "l".into(), kind, position, direction, color: [1.0, 0.5, 0.25], intensity: 8.0, range: None }
}

/// A point of the floor and what it shows to a viewer straight above.
fn floor(scene: &Scene, x: f32, light: Light) -> Vec3 {
    let geometry = Geometry::new(scene).unwrap();
    let surface = Surface { point: Vec3::new(x, 0.0, 0.0), normal: Vec3::Y, triangle: 0 };
    direct(&geometry.tracer, &Materials::new(scene), &surface, Vec3::Y, &[light])
}

/// The floor's BRDF for a viewer along the normal and light aslant by `cosine`.
fn floor_brdf(scene: &Scene, cosine: f32) -> f32 {
    let surface = Surface { point: Vec3::ZERO, normal: Vec3::Y, triangle: 0 };
    let light = Vec3::new((1.0 - cosine * cosine).sqrt(), cosine, 0.0);
    brdf(&Materials::new(scene).at(&surface), Vec3::Y, light, Vec3::Y).x
}

#[test]
fn a_lamp_over_a_floor_gives_the_cosine_over_the_squared_distance() {
    let scene = scene("");
    for x in [0.0, 1.0, 2.5] {
        let found = floor(&scene, x, lamp(LightKind::Point, Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y));
        let d = (x * x + 4.0f32).sqrt();
        let expected = Vec3::new(8.0, 4.0, 2.0) * (2.0 / d / (d * d)) * floor_brdf(&scene, 2.0 / d);
        assert!((found - expected).length() < 1e-4 * expected.length(), "{x}: {found} {expected}");
    }
}

#[test]
fn the_sun_gives_its_irradiance_times_the_cosine_from_where_it_stands() {
    let scene = scene("");
    for elevation in [10.0f32, 45.0, 90.0] {
        let sine = elevation.to_radians().sin();
        let found = floor(&scene, 0.0, sun(30.0, elevation, Vec3::new(PI, 1.0, 0.0)));
        let expected = Vec3::new(PI, 1.0, 0.0) * sine * floor_brdf(&scene, sine);
        assert!((found - expected).length() < 1e-4 * expected.length(), "{elevation}: {found} {expected}");
    }
    let towards = |azimuth: f32| -sun(azimuth, 30.0, Vec3::ONE).direction;
    let (c, s) = (30f32.to_radians().cos(), 0.5);
    for (azimuth, expected) in
        [(0.0, Vec3::new(0.0, s, -c)), (90.0, Vec3::new(c, s, 0.0)), (180.0, Vec3::new(0.0, s, c))]
    {
        assert!((towards(azimuth) - expected).length() < 1e-6, "{azimuth}: {}", towards(azimuth));
    }
    // Mostly Lambert's: 0.5 / pi.
    assert!((floor_brdf(&scene, 1.0) / (0.5 * FRAC_1_PI) - 1.0).abs() < 0.05);
}

#[test]
fn a_thin_sheet_casts_a_shadow_with_an_edge_where_geometry_has_it() {
    let scene = scene(SHEET);
    // The sheet's edge, x = 0, y = 1, under a sun at 45 degrees in the east: its
    // shadow begins at x = -1.
    let noon = || sun(90.0, 45.0, Vec3::ONE);
    assert!(floor(&scene, -1.01, noon()).x > 0.05);
    assert_eq!(floor(&scene, -0.99, noon()), Vec3::ZERO);
    // A lamp under the sheet is not behind it.
    let under = |x| lamp(LightKind::Point, Vec3::new(x, 0.9, 0.0), Vec3::NEG_Y);
    assert!(floor(&scene, 2.0, under(2.0)).x > 0.0);
    let over = lamp(LightKind::Point, Vec3::new(2.0, 1.1, 0.0), Vec3::NEG_Y);
    assert_eq!(floor(&scene, 2.0, over), Vec3::ZERO);
}

fn composed(scene: &Scene, methods: &[Option<Estimator>], samples: u32, lighting: &Lighting) -> Composite {
    let geometry = Geometry::new(scene).unwrap();
    let materials = Materials::new(scene);
    let view = scene.look.view();
    let what = Composition { view: &view, methods, ao: scene.ao, rays: 16, samples, seed: 1 };
    let mut loaded = Cpu.load(&geometry).unwrap();
    compose(&mut *loaded, &what, lighting.ambient, |view| Ok(shade(&geometry, &materials, view, lighting))).unwrap()
}

fn sunny(scene: &Scene) -> Lighting {
    Lighting {
        lights: vec![sun(90.0, 50.0, Vec3::splat(4.0))],
        ambient: Vec3::new(1.0, 2.0, 3.0),
        sky: scene.environment.sky,
    }
}

#[test]
fn openness_dims_ambient_light_alone() {
    let scene = scene(&SHEET.replace("[4.5, 1, 0]", "[4.5, 0.6, 0]"));
    let methods = [None, Some(Estimator::CLASSIC)];
    let picture = composed(&scene, &methods, 4, &sunny(&scene));
    let [plain, classic] = &picture.methods[..] else { panic!() };
    let mut dimmed = 0;
    for i in 0..picture.direct.len() {
        let ambient = plain.ambient[i];
        assert!((ambient - picture.albedo[i] * Vec3::new(1.0, 2.0, 3.0)).length() < 1e-5);
        let (more, less) = (picture.color(0, i), picture.color(1, i));
        assert!((more - less - (ambient - classic.ambient[i])).length() < 1e-5);
        if picture.albedo[i] == Vec3::splat(0.5) {
            assert!((classic.ambient[i] - ambient * classic.ao[i]).length() < 1e-5, "one albedo: the product of means");
        }
        dimmed += u32::from(classic.ao[i] < 0.8);
    }
    assert!(dimmed > 30, "the sheet's edge dims the floor: {dimmed}");
}

#[test]
fn the_sky_is_seen_at_its_ambient_radiance() {
    let mut scene = scene("");
    scene.look.target = Vec3::new(0.0, 4.0, 1.0);
    scene.environment.sky = Sky::Gradient { zenith: 1.0, horizon: 0.4, ground: 0.1 };
    let picture = composed(&scene, &[None], 1, &sunny(&scene));
    let top = picture.color(0, 16);
    assert!(picture.depth[16].is_nan() && picture.methods[0].ao[16].is_nan());
    assert!(luminance(top.to_array()) > 1.0 && (top.z / top.x - 3.0).abs() < 1e-4, "{top}");
    assert!((mean_radiance(scene.environment.sky) - 0.8).abs() < 1e-6);
}

#[test]
fn samples_lie_evenly_about_the_centre() {
    assert_eq!(place(0, 1), [0.0; 2]);
    for n in [4, 16, 64] {
        let places: Vec<[f32; 2]> = (0..n).map(|i| place(i, n)).collect();
        for axis in 0..2 {
            let mut strata: Vec<u32> = places.iter().map(|p| ((p[axis] + 0.5) * n as f32) as u32).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..n).collect::<Vec<_>>(), "one in each of {n} strips");
        }
    }
}

#[test]
fn lamps_and_their_pictures_glow() {
    let mut scene = scene(
        "[[object]]\nname = 'lamp'\nemission = [4.0, 2.0, 1.0]\nshape = { plane = { center = [0, 0.5, 0], u = [0, 0, 0.3], v = [0.3, 0, 0] } }\n",
    );
    scene.look.target = Vec3::new(0.0, 0.5, 0.0);
    let picture = composed(&scene, &[None], 1, &Lighting { lights: vec![], ..sunny(&scene) });
    let middle = 16 * 32 + 16;
    assert_eq!(picture.emission[middle], Vec3::new(4.0, 2.0, 1.0));
    assert_eq!(picture.direct[middle], Vec3::ZERO);
    assert!((picture.depth[middle] - 4.03).abs() < 0.1 && picture.normal[middle].y > 0.99);
}
