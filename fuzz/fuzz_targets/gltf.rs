//! No bytes make the glTF reader panic or take memory without end.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(model) = aogauge_scenes::gltf::import_bytes("fuzz", bytes, None, 1.0) {
        for object in &model.objects {
            assert_eq!(object.mesh.validate(), Ok(()));
        }
    }
});
