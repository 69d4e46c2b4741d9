//! The G-buffer by rasterisation against that by rays. Needs a Vulkan, Metal or
//! DirectX 12 adapter; a software one will do.

use aogauge::{
    layers::Layers,
    render::{
        Estimator, Falloff, Frame, Geometry, Job, LocalIndirect, Openness, RenderError, Renderer, Scale,
        gpu::{GBufferBy, Gpu, Options},
    },
    scenes::{LookView, MeasureView, Mesh, Object, Scene, View, library},
    trace::Ray,
};
use glam::Vec3;
use std::{path::Path, process::Command};

fn gpu(g_buffer: GBufferBy) -> Gpu {
    Gpu::with(Options { g_buffer, ..Options::default() }).unwrap_or_else(|e| panic!("{e}"))
}

/// Its value depends on every bit of the point that is shaded.
const SENSITIVE: Estimator = Estimator::Openness(Openness::plain(Falloff::Exponential { extinction: 8.0 }));

#[derive(Default, Debug)]
struct Tally {
    pixels: usize,
    seen: usize,
    elsewhere: usize,
    coincident: usize,
    unequal: usize,
}

/// Whether the image of triangles is not of one piece about a pixel.
fn at_an_edge(seen: &[u32], [width, height]: [u32; 2], pixel: usize) -> bool {
    let (x, y) = (pixel as u32 % width, pixel as u32 / width);
    let near = |v: u32, most: u32| v.saturating_sub(1)..(v + 2).min(most);
    near(y, height).any(|y| near(x, width).any(|x| seen[(y * width + x) as usize] != seen[pixel]))
}

/// Distances at which a pixel's ray meets two triangles; None for one that it
/// passes.
fn distances(view: &View, corners: &[[Vec3; 3]], pixel: usize, triangles: [u32; 2]) -> [Option<f32>; 2] {
    let width = view.resolution[0];
    let (origin, direction) = view.ray(pixel as u32 % width, pixel as u32 / width);
    let ray = Ray::new(origin, direction, 1e30);
    triangles.map(|t| corners.get(t as usize).and_then(|c| ray.meets(c, 1e30)).map(|(t, _)| t))
}

/// By rays, and by rasterisation.
fn both(scene: &Scene, view: &View, estimator: Estimator) -> [Frame; 2] {
    let geometry = Geometry::new(scene).unwrap();
    let job = Job { view, camera: None, estimator, ao: scene.ao, rays: 4, seed: 5, replicate: 0 };
    [GBufferBy::Rays, GBufferBy::Raster].map(|by| {
        let gpu = gpu(by);
        gpu.load(&geometry).unwrap().render(&job).unwrap()
    })
}

/// Where both see the same triangle, openness is equal to the bit, and so are the
/// points it is of. Where they do not, two triangles are at the same distance (the
/// ray meets both, on their common edge or everywhere), or, on less than .5 % of the
/// pixels, an edge is within a pixel.
fn compare(scene: &Scene, view: &View) -> Tally {
    let corners: Vec<[Vec3; 3]> = scene.triangles().map(|(_, corners)| corners).collect();
    let [rays, raster] = both(scene, view, SENSITIVE);
    let mut tally = Tally::default();
    for pixel in 0..view.pixels() {
        let [a, b] = [&rays, &raster].map(|f| f.seen[pixel]);
        tally.pixels += 1;
        tally.seen += usize::from(a != u32::MAX);
        if a == b {
            let same = |f: fn(&Frame) -> &Vec<f32>| f(&rays)[pixel].to_bits() == f(&raster)[pixel].to_bits();
            tally.unequal += usize::from(!same(|f| &f.values));
        } else if let [Some(a), Some(b)] = distances(view, &corners, pixel, [a, b])
            && (a - b).abs() <= 1e-6 * a
        {
            tally.coincident += 1;
        } else {
            tally.elsewhere += 1;
            assert!(
                at_an_edge(&rays.seen, view.resolution, pixel) || at_an_edge(&raster.seen, view.resolution, pixel),
                "{}: pixel {pixel} sees triangle {b} and not {a}, within a surface",
                scene.name
            );
        }
    }
    println!("{}, {:?}: {tally:?}", scene.name, view.resolution);
    assert!(tally.seen * 20 > tally.pixels, "{}: there must be something to see: {tally:?}", scene.name);
    assert!(tally.elsewhere * 200 < tally.pixels, "{}: {tally:?}", scene.name);
    assert_eq!(tally.unequal, 0, "{}: {tally:?}", scene.name);
    tally
}

#[test]
fn measure_views_see_the_same() {
    for name in ["curtain-open", "curtain-room", "pillar", "corner", "leaves"] {
        let scene = library::scene(name).unwrap();
        compare(&scene, &scene.measure.view());
    }
}

/// The camera stands in the scenes: triangles reach behind it.
#[test]
fn look_views_see_the_same() {
    for name in ["curtain-arcade", "pillar", "leaves", "cables", "shelf", "atrium"] {
        let scene = library::scene(name).unwrap();
        compare(&scene, &View { resolution: [181, 119], ..scene.look.view() });
        compare(&scene, &scene.look.view());
    }
}

/// The near plane of an orthographic view cuts what stands on the receiver, and a
/// camera may stand next to a wall.
#[test]
fn what_a_near_plane_cuts_is_the_same() {
    let scene = library::scene("thick-box").unwrap();
    let [low, high] = scene.objects.iter().find(|o| o.occluder).unwrap().mesh.bounds().unwrap();
    let clearance = (low.y + high.y) / 2.0 - scene.measure.center.y;
    compare(&scene, &MeasureView { clearance, ..scene.measure }.view());
    let scene = library::scene("curtain-room").unwrap();
    let eye = scene.measure.center + scene.measure.normal * 0.003;
    let target = eye + scene.measure.transect + scene.measure.normal * 0.1;
    compare(&scene, &LookView { eye, target, fov: 100.0, resolution: [200, 150] }.view());
}

/// A scene of one object.
fn made_of(mesh: Mesh) -> Scene {
    let mut scene = library::scene("plane").unwrap();
    let object = Object { mesh, ..scene.objects.swap_remove(0) };
    Scene { objects: vec![object], ..scene }
}

/// More triangles than are drawn at once.
#[test]
fn many_triangles_are_drawn_in_pieces() {
    let n = 730u32;
    let mut mesh = Mesh::default();
    for i in 0..=n * n + 2 * n {
        let (x, z) = ((i % (n + 1)) as f32 / n as f32 - 0.5, (i / (n + 1)) as f32 / n as f32 - 0.5);
        mesh.push_vertex(Vec3::new(x * 2.0, 0.05 * (x * 40.0).sin() * (z * 30.0).cos(), z * 2.0));
    }
    for i in 0..n * n {
        let a = i / n * (n + 1) + i % n;
        mesh.triangles.extend([[a, a + n + 1, a + 1], [a + 1, a + n + 1, a + n + 2]]);
    }
    assert!(mesh.triangles.len() > 1 << 20);
    let scene = made_of(mesh);
    let look = LookView { eye: Vec3::new(0.0, 0.7, 1.1), target: Vec3::ZERO, fov: 50.0, resolution: [128, 96] };
    let [rays, raster] = both(&scene, &look.view(), SENSITIVE);
    let count = |of: fn(u32, u32) -> bool| rays.seen.iter().zip(&raster.seen).filter(|(a, b)| of(**a, **b)).count();
    let (seen, sky) = (count(|a, _| a != u32::MAX), count(|a, b| (a == u32::MAX) != (b == u32::MAX)));
    // A hundred triangles a pixel have many edges.
    let differ = count(|a, b| a != b);
    assert!(
        seen > 5000 && sky * 1000 < seen && differ * 40 < seen,
        "{seen} pixels, {sky} see the sky, {differ} differ"
    );
}

/// Of triangles in one place each way of seeing takes one; the points are those of
/// one surface.
#[test]
fn coincident_triangles_give_the_same_points() {
    let mut mesh = Mesh::default();
    for _ in 0..3 {
        mesh.push_quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    }
    let scene = made_of(mesh);
    let look = LookView { eye: Vec3::new(0.2, 0.5, 0.6), target: Vec3::ZERO, fov: 60.0, resolution: [64, 48] };
    let [rays, raster] = both(&scene, &look.view(), SENSITIVE);
    let seen = |f: &Frame| f.seen.iter().filter(|&&t| t != u32::MAX).count();
    assert!(seen(&rays) > 1000);
    assert_eq!(seen(&rays), seen(&raster));
    let differ = |a: &f32, b: &f32| (a - b).abs() > 1e-6 || a.is_nan() != b.is_nan();
    assert!(!rays.values.iter().zip(&raster.values).any(|(a, b)| differ(a, b)));
}

#[test]
fn local_indirect_light_is_the_same() {
    let scene = library::scene("curtain-room").unwrap();
    let method = LocalIndirect { falloff: Falloff::Exponential { extinction: 6.0 }, scale: Scale::default() };
    let [rays, raster] = both(&scene, &scene.measure.view(), Estimator::LocalIndirect(method));
    let equal = rays.colors.unwrap().iter().zip(&raster.colors.unwrap()).filter(|(a, b)| a == b).count();
    assert!(equal * 1000 > rays.values.len() * 998, "{equal} of {}", rays.values.len());
}

#[test]
fn what_cannot_be_drawn_is_refused() {
    let scene = library::scene("plane").unwrap();
    let geometry = Geometry::new(&scene).unwrap();
    let gpu = gpu(GBufferBy::Raster);
    assert!(gpu.describe().contains("rasterisation"), "{}", gpu.describe());
    let mut loaded = gpu.load(&geometry).unwrap();
    let mut render = |view: &View| {
        let job =
            Job { view, camera: None, estimator: Estimator::CLASSIC, ao: scene.ao, rays: 1, seed: 1, replicate: 0 };
        loaded.render(&job).map(|f| f.values.len())
    };
    let view = scene.measure.view();
    let error = |r: Result<usize, RenderError>| r.unwrap_err().to_string();
    let wide = error(render(&View { resolution: [65_536, 2], ..view }));
    assert!(wide.contains("65536 x 2") && wide.contains("--g-buffer rays"), "{wide}");
    let curved = error(render(&View { direction_dx: Vec3::X, ..view }));
    assert!(curved.contains("neither orthographic nor perspective"), "{curved}");
    assert_eq!(render(&view).unwrap(), view.pixels(), "and then it goes on");
}

fn aogauge(folder: &Path, args: &[&str]) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(folder).args(args).output().unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn it_is_chosen_on_the_command_line_and_refused_on_the_cpu() {
    let dir = tempfile::tempdir().unwrap();
    let image = |name: &str, by: &str| {
        let args = ["render", "curtain-arcade", "--rays", "4", "--renderer", "gpu", "--g-buffer", by, "--out", name];
        let (code, stderr) = aogauge(dir.path(), &args);
        assert_eq!(code, Some(0), "{stderr}");
        Layers::read(&dir.path().join(name)).unwrap().get("mean").unwrap().to_vec()
    };
    let (rays, raster) = (image("rays.exr", "rays"), image("raster.exr", "raster"));
    let differ = rays.iter().zip(&raster).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
    assert!(differ * 200 < rays.len(), "{differ} of {}", rays.len());
    for verb in [["render", "plane"], ["composite", "plane"], ["run", "thin-occluders"]] {
        let options = ["--renderer", "cpu", "--g-buffer", "raster", "--out", "x.png"];
        let (code, stderr) = aogauge(dir.path(), &[&verb[..], &options].concat());
        assert_eq!(code, Some(2), "{stderr}");
        assert!(stderr.contains("--g-buffer is for the GPU"), "{stderr}");
        assert!(!dir.path().join("x.png").exists());
    }
}

/// Light and AO of a composite fall on one surface, which rays find.
#[test]
fn a_composite_is_not_drawn() {
    let args = ["composite", "plane", "--renderer", "gpu", "--g-buffer", "raster", "--out", "x.png"];
    let dir = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_aogauge")).current_dir(dir.path()).args(args).output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{stderr}");
    assert!(stderr.contains("by rays") && !dir.path().join("x.png").exists(), "{stderr}");
}
