//! What image metrics cost on two 4K images: FLIP alone, and the whole set, which
//! must stay below three times that. `cargo bench --bench image_metrics`.
//!
//! The memory of the set, in bytes a pixel, is what divan's allocation profiler
//! prints as "max alloc".

#![allow(missing_docs, clippy::unwrap_used)]

use aogauge::metrics::image::{Encoding, Image, Options, Pair, flip, ms_ssim, pointwise, scores, ssim, summary};
use divan::{AllocProfiler, Bencher, counter::ItemsCount};
use std::sync::LazyLock;

#[global_allocator]
static ALLOC: AllocProfiler = AllocProfiler::system();

const SIZE: [usize; 2] = [3840, 2160];

/// A picture with slopes, edges and noise, so that no branch is always taken.
fn picture(seed: u32) -> Image {
    let mut x = seed;
    let mut noise = move || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (x >> 8) as f32 / 16_777_216.0
    };
    let planes = (0..3)
        .map(|channel| {
            (0..SIZE[0] * SIZE[1])
                .map(|i| {
                    let (u, v) = ((i % SIZE[0]) as f32 / 300.0, (i / SIZE[0]) as f32 / 200.0);
                    let smooth = 0.5 + 0.3 * (u + channel as f32).sin() * v.cos();
                    let edge = if (u.floor() + v.floor()) as i32 % 2 == 0 { 0.1 } else { 0.0 };
                    (smooth + edge + 0.1 * noise()).clamp(0.0, 1.0)
                })
                .collect()
        })
        .collect();
    Image::new(SIZE, planes, Encoding::Srgb).unwrap()
}

static IMAGES: LazyLock<[Image; 2]> = LazyLock::new(|| [picture(1), picture(2)]);

fn over_pair<T>(bencher: Bencher<'_, '_>, f: impl Fn(&Pair<'_>) -> T + Sync) {
    let [reference, test] = &*IMAGES;
    let pair = Pair::new(reference, test, None).unwrap();
    bencher.counter(ItemsCount::new(SIZE[0] * SIZE[1])).bench(|| f(&pair));
}

#[divan::bench(sample_count = 10)]
fn flip_alone(bencher: Bencher<'_, '_>) {
    over_pair(bencher, |pair| flip(pair, 67.0).unwrap());
}

#[divan::bench(sample_count = 10)]
fn whole_set(bencher: Bencher<'_, '_>) {
    over_pair(bencher, |pair| scores(pair, &Options::default()).unwrap());
}

#[divan::bench(sample_count = 10)]
fn ssim_and_ms_ssim(bencher: Bencher<'_, '_>) {
    over_pair(bencher, |pair| {
        let finest = ssim(pair).unwrap();
        ms_ssim(pair, &finest).unwrap()
    });
}

#[divan::bench(sample_count = 10)]
fn one_pixel_at_a_time(bencher: Bencher<'_, '_>) {
    over_pair(bencher, pointwise);
}

#[divan::bench(sample_count = 10)]
fn percentiles(bencher: Bencher<'_, '_>) {
    let map: Vec<f32> = IMAGES[0].planes()[0].clone();
    over_pair(bencher, |pair| summary(pair, &map).unwrap());
}

fn main() {
    divan::main();
}
