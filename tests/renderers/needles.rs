//! Points on long narrow triangles, whose distances along a ray are rounded more than those of others.

use aogauge::{
    render::{Estimator, Geometry, Job, ReceiverPlane, Renderer, cpu::Cpu, gpu::Gpu},
    scenes::Scene,
    trace::lift,
};
use glam::Vec3;

/// The side of a pillar: convex, so nothing is in the way.
fn pillar(sides: u32, height: f32) -> Scene {
    let middle = height / 2.0;
    let text = format!(
        "description = 'a tall pillar'\nao = {{ radius = 0.25 }}\nenvironment = {{ radiance = 1.0 }}\n\
         measure = {{ center = [0.11471529, {middle}, 0.16383041], normal = [0.573576436, 0, 0.819152044], \
         transect = [0.819152044, 0, -0.573576436], clearance = 0.1, pixel = 0.002, resolution = [48, 48] }}\n\
         look = {{ eye = [2, 2, 2], target = [0, {middle}, 0], resolution = [16, 16] }}\n\
         [[object]]\nname = 'pillar'\n\
         shape = {{ pillar = {{ sides = {sides}, radius = 0.2, height = {height:.1} }} }}\n"
    );
    Scene::from_toml("needles", "needles.toml", &text, None).unwrap()
}

/// No ray meets the triangle that it leaves, nor the one beside it, by any estimator: every pixel reads 1. Before points
/// were lifted off such triangles these pillars read .9986, .981, .951, .986, .936 and .922, and on the GPU 1 from 16 rays on.
#[test]
fn needles_do_not_meet_themselves() {
    let gpu = Gpu::open().unwrap_or_else(|e| panic!("{e}"));
    for (sides, height) in [(48, 6.0), (48, 10.0), (48, 30.0), (256, 3.0), (256, 10.0), (48, 100.0)] {
        let scene = pillar(sides, height);
        let geometry = Geometry::new(&scene).unwrap();
        let view = scene.measure.view();
        let (mut on_cpu, mut on_gpu) = (Cpu.load(&geometry).unwrap(), gpu.load(&geometry).unwrap());
        for (estimator, rays) in [
            (Estimator::CLASSIC, 8),
            (Estimator::CLASSIC, 32),
            (Estimator::extended(ReceiverPlane::Clipped), 8),
            (Estimator::PathTraced, 8),
        ] {
            let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays, seed: 5, replicate: 0 };
            let mut read = vec![("cpu", on_cpu.render(&job).unwrap())];
            if estimator != Estimator::PathTraced {
                read.push(("gpu", on_gpu.render(&job).unwrap()));
            }
            for (renderer, frame) in read {
                let closed = frame.values.iter().filter(|v| **v != 1.0).count();
                assert_eq!(closed, 0, "{sides} sides, {height} m, {estimator:?}, {rays} rays, {renderer}");
            }
        }
    }
}

/// A triangle that is no needle is where it is.
#[test]
fn only_needles_are_lifted() {
    let offset = 10.0 * 2.0f32.powi(-19);
    let triangle = |width: f32| [Vec3::ZERO, Vec3::new(10.0, 0.0, 0.0), Vec3::new(0.0, width, 0.0)];
    assert_eq!(lift(triangle(0.7), offset), 0.0);
    // 2^-24 L^3 / 2A, L^2 = 100 m^2, less the offset.
    let expected = 2.0f32.powi(-24) * 100.0 / 0.026 - offset;
    assert!((lift(triangle(0.026), offset) / expected - 1.0).abs() < 1e-3);
    assert_eq!(lift(triangle(1e-6), offset), 256.0 * offset);
    assert_eq!(lift(triangle(0.0), offset), 0.0);
    assert_eq!(lift([Vec3::ONE; 3], offset), 0.0);
}
