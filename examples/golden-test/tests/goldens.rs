//! The toy renderer's images against their goldens in `tests/goldens`.
//!
//! `AOGAUGE_BLESS=1 cargo test -p golden-test` accepts what it draws now.

use aogauge::golden::{Limits, RgbImage, Sampled, Tolerance, assert_golden};
use golden_test::{SIDE, openness, shaded};

const SIZE: u32 = SIDE as u32;

/// Colours: another compiler may round a code or two otherwise, which nobody sees.
#[test]
fn the_ball_looks_as_it_did() {
    let bytes = shaded().concat();
    let image = RgbImage::from_raw(SIZE, SIZE, bytes).expect("a colour a pixel");
    assert_golden("ball", image, Limits { flip: 0.001, ..Limits::default() });
}

/// A sample: any seed will do, because the tolerance is a test of statistics that
/// refuses 1 in 1,000 good images.
#[test]
fn the_floor_is_as_open_as_it_was() {
    let replicates: Vec<Vec<f32>> = (100..116).map(|seed| openness(seed, 32)).collect();
    let images: Vec<&[f32]> = replicates.iter().map(Vec::as_slice).collect();
    let image = Sampled::of_replicates([SIZE, SIZE], &images);
    assert_golden("openness", image, Tolerance::Sampled { alpha: 0.001 });
}
