//! A real model, where it is at hand.

use std::path::Path;

#[test]
fn sponza_loads_and_its_curtains_are_found() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/assets/sponza/sponza.glb"));
    if !path.is_file() {
        println!("skipped: {} is not there", path.display());
        return;
    }
    let mut model = aogauge_scenes::gltf::import(path, 1.0).unwrap_or_else(|e| panic!("{e}"));
    model.mark_occluders(&["curtain_*"]).unwrap();
    let curtains: Vec<&str> = model.objects.iter().filter(|o| o.occluder).map(|o| o.name.as_str()).collect();
    assert_eq!(curtains, ["curtain_red", "curtain_green", "curtain_blue"]);
    let triangles: usize = model.objects.iter().map(|o| o.mesh.triangles.len()).sum();
    assert_eq!(triangles + model.degenerate, 262_267);
    assert!((1..2000).contains(&model.degenerate), "{}", model.degenerate);
    for o in &model.objects {
        o.mesh.validate().unwrap();
    }
}
