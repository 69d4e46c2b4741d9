//! Every legal parameter set of every family gives a scene that renders.

#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

#[path = "../scenes/tests/legal/mod.rs"]
mod legal;

use aogauge::render::{Estimator, Geometry, Job, ReceiverPlane, Renderer, cpu::Cpu};
use legal::{FAMILIES, legal, parameters, scene};
use proptest::test_runner::{Config, TestRunner};

#[test]
fn every_legal_parameter_set_gives_a_scene_that_renders() {
    for (family, declared) in FAMILIES {
        let config = Config { cases: 24, failure_persistence: None, ..Config::default() };
        let mut runner =
            TestRunner::new_with_rng(config, proptest::test_runner::TestRng::deterministic_rng(Default::default()));
        runner
            .run(&legal(&parameters(declared)), |text| {
                // Values that do not go together are refused; the meshes' own test
                // holds them to their message.
                let Ok(mut scene) = scene(family, &text) else {
                    return Ok(());
                };
                // Shapes may be 100 m large and 100 m off, planes and blocks 100 km,
                // which asks for a larger R than a curtain's.
                scene.ao.radius = if ["plane", "block"].contains(&family) { 1000.0 } else { 1.0 };
                scene.ao.secondary_radius = scene.ao.radius / 4.0;
                let geometry = Geometry::new(&scene).unwrap_or_else(|e| panic!("{family}: {text}: {e}"));
                let view = scene.look.view();
                let estimator = Estimator::extended(ReceiverPlane::Clipped);
                let job = Job { view: &view, camera: None, estimator, ao: scene.ao, rays: 2, seed: 1, replicate: 0 };
                let frame = Cpu.load(&geometry).unwrap().render(&job).unwrap();
                let sound =
                    |(v, seen): (&f32, &u32)| if *seen == u32::MAX { v.is_nan() } else { (0.0..=1.0).contains(v) };
                assert!(frame.values.iter().zip(&frame.seen).all(sound), "{family}: {text}");
                assert!(frame.values.iter().any(|v| !v.is_nan()), "{family}: {text}: nothing is seen");
                Ok(())
            })
            .unwrap_or_else(|e| panic!("{family}: {e}"));
    }
}
