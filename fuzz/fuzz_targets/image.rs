//! No bytes make the image readers panic or take memory without end. The first byte
//! says which extension the file has.
#![no_main]

use aogauge::picture::read::{EXTENSIONS, LayerChoice, channels, check_whole, claim, decode, decode_samples, size};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;

fuzz_target!(|bytes: &[u8]| {
    let path = PathBuf::from(format!("fuzz.{}", EXTENSIONS[bytes.first().map_or(0, |b| usize::from(*b) % EXTENSIONS.len())]));
    let _ = size(&path, bytes);
    for found in decode(&path, bytes, LayerChoice::All, None).unwrap_or_default() {
        assert!(found.image.planes().iter().all(|p| p.len() == found.image.pixels()));
    }
    let _ = decode_samples(&path, bytes);
    let (claimed, whole) = (claim(&path, bytes), check_whole(&path, bytes));
    assert!(claimed.is_ok() || whole.is_err());
    let _ = channels(&path, bytes, None);
});
