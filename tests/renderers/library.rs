//! Every built-in scene can be measured: its view sees the receiver under the
//! occluder, and the regions that metrics are taken over are there.

use aogauge::{
    metrics::regions::{Region, Regions},
    render::{Geometry, gbuffer::GBuffer, path},
    scenes::library,
};

#[test]
fn every_built_in_scene_can_be_measured() {
    for (name, _) in library::SCENES {
        let scene = library::scene(name).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        let objects: Vec<usize> = scene.triangles().map(|(object, _)| object).collect();
        for s in gbuffer.surfaces.iter().flatten() {
            let object = &scene.objects[objects[s.triangle as usize]];
            assert!(!object.occluder, "{name}: the measure view sees '{}'", object.name);
        }
        assert!(gbuffer.surfaces.iter().all(Option::is_some), "{name}: the measure view sees past the scene");
        let regions = Regions::new(&scene, &geometry.tracer, &gbuffer);
        if scene.has_occluder() {
            for region in [Region::Footprint, Region::Left, Region::Right] {
                assert!(regions.measurable(region).is_ok(), "{name}: {} has too few pixels", region.label());
            }
        } else {
            assert!(scene.control, "{name}: a scene without an occluder is a control");
        }
    }
}

/// Light reaches the receiver of every built-in scene, with the occluder and
/// without it.
#[test]
fn every_built_in_scene_is_lit() {
    for (name, _) in library::SCENES {
        let scene = library::scene(name).unwrap();
        let geometry = Geometry::new(&scene).unwrap();
        let twin = Geometry::new(&scene.twin()).unwrap();
        let gbuffer = GBuffer::new(&geometry.tracer, &scene.measure.view());
        for g in [&geometry, &twin] {
            let light = path::irradiance(g, &gbuffer, 4, 1, 0);
            let mean = light.iter().sum::<f32>() / light.len() as f32;
            assert!(mean > 1e-4 && mean < 10.0, "{name}: {mean}");
            assert!(light.iter().all(|l| l.is_finite() && *l >= 0.0), "{name}: light that is no number");
        }
    }
}
