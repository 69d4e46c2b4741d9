//! No image file makes the readers panic, or take memory out of proportion to its
//! size: hand-made liars, and honest files with every byte of their header changed.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use aogauge::{
    layers::Layers,
    picture::read::{self, LayerChoice},
};
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageFormat};
use std::{
    alloc::{GlobalAlloc, Layout, System},
    io::Cursor,
    path::Path,
    sync::atomic::{AtomicUsize, Ordering::Relaxed},
};

/// Counts what is allocated, and the most there was at a time.
struct Counting;

static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator as it came; counters alone are added.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(NOW.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        // SAFETY: the caller's promises are those of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        PEAK.fetch_max(NOW.fetch_add(layout.size(), Relaxed) + layout.size(), Relaxed);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What reading a file of a few kilobytes may take. 4 MiB of samples that the decoder may
/// believe in, as 32-bit floats, beside each other and as planes, come to less; but the
/// TIFF decoder reads a tag's list of up to 256 MiB before it can be given a limit.
const MOST: usize = 272 << 20;

/// Reads it in every way. Whether any way gave an image, and the memory it took.
fn read_all_ways(path: &Path, bytes: &[u8]) -> (bool, usize) {
    let before = NOW.load(Relaxed);
    PEAK.store(before, Relaxed);
    let size = read::size(path, bytes);
    let all = read::decode(path, bytes, LayerChoice::All, None);
    let samples = read::decode_samples(path, bytes);
    let whole = |n: usize, [w, h]: [usize; 2], channels: usize| n == w * h * channels;
    if let Ok(samples) = &samples {
        let n = match &samples.values {
            read::Values::U8(v) => v.len(),
            read::Values::U16(v) => v.len(),
            read::Values::F32(v) => v.len(),
        };
        assert!(whole(n, samples.size, samples.channels), "{}", path.display());
    }
    let any = size.is_ok() && (all.is_ok_and(|all| !all.is_empty()) || samples.is_ok());
    (any, PEAK.load(Relaxed).saturating_sub(before))
}

fn encode(format: ImageFormat, image: &DynamicImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// Several parts, tiles, 16-bit floats, a data window away from the origin.
fn rich_exr() -> Vec<u8> {
    use exr::prelude::*;
    let part = |name: &str, blocks: Blocks| {
        let values = FlatSamples::F16((0..48).map(|i| f16::from_f32(i as f32 / 48.0)).collect());
        let channels = AnyChannels::sort(
            [AnyChannel::new("R", values), AnyChannel::new("Z", FlatSamples::U32((0..48).collect()))]
                .into_iter()
                .collect(),
        );
        let mut attributes = LayerAttributes::named(name);
        attributes.layer_position = Vec2(-3, 5);
        let encoding = Encoding { compression: Compression::RLE, blocks, line_order: LineOrder::Increasing };
        Layer::new((8, 6), attributes, encoding, channels)
    };
    let window = IntegerBounds::new((-3, 5), (8, 6));
    let layers = vec![part("scan", Blocks::ScanLines), part("tiles", Blocks::Tiles(Vec2(4, 4)))];
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layers(ImageAttributes::new(window), layers).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn honest() -> Vec<(&'static str, Vec<u8>)> {
    let rgb = DynamicImage::ImageRgb8(image::RgbImage::from_fn(8, 6, |x, y| image::Rgb([x as u8 * 30, y as u8, 7])));
    let folder = tempfile::tempdir().unwrap();
    let exr = folder.path().join("a.exr");
    Layers::new([8, 6]).with("mean", vec![0.5; 48]).with("color.R", vec![0.25; 48]).write(&exr).unwrap();
    let mut deflated = Cursor::new(Vec::new());
    image::codecs::tiff::TiffEncoder::new(&mut deflated)
        .write_image(rgb.as_bytes(), 8, 6, ExtendedColorType::Rgb8)
        .unwrap();
    vec![
        ("a.exr", std::fs::read(&exr).unwrap()),
        ("parts.exr", rich_exr()),
        ("a.png", encode(ImageFormat::Png, &rgb)),
        ("wide.png", encode(ImageFormat::Png, &DynamicImage::ImageRgba16(rgb.to_rgba16()))),
        ("a.jpg", encode(ImageFormat::Jpeg, &rgb)),
        ("a.hdr", encode(ImageFormat::Hdr, &DynamicImage::ImageRgb32F(rgb.to_rgb32f()))),
        ("a.tiff", deflated.into_inner()),
        ("float.tiff", encode(ImageFormat::Tiff, &DynamicImage::ImageRgb32F(rgb.to_rgb32f()))),
    ]
}

/// The checksum of PNG (CRC-32, ISO 3309), bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |crc, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 })
    })
}

/// Makes the checksums of a PNG right again, or what is changed would never be read.
fn mend(bytes: &mut [u8]) {
    let mut at = 8;
    while let Some(length) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes(length.try_into().unwrap()) as usize;
        let end = at.saturating_add(8).saturating_add(length);
        let Some(sum) = bytes.get(at + 4..end).map(crc) else { return };
        let Some(place) = bytes.get_mut(end..end + 4) else { return };
        place.copy_from_slice(&sum.to_be_bytes());
        at = end + 4;
    }
}

/// One test, so that nothing else allocates meanwhile.
#[test]
fn liars_are_errors_and_take_no_memory() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad-images");
    let mut files = 0;
    for entry in std::fs::read_dir(corpus).unwrap() {
        let path = entry.unwrap().path();
        let (any, took) = read_all_ways(&path, &std::fs::read(&path).unwrap());
        assert!(!any, "{} is no image", path.display());
        assert!(took < MOST, "{} took {took} bytes", path.display());
        assert!(read::read(&path, None, None).unwrap_err().to_string().contains("bad-images"), "{}", path.display());
        files += 1;
    }
    assert!(files >= 25, "{files}");
    for (name, whole) in honest() {
        let path = Path::new(name);
        assert!(read_all_ways(path, &whole).0, "{name} is honest");
        let (mut images, mut most) = (0, 0);
        for i in 0..whole.len().min(1400) {
            let flipped = (0..8).map(|bit| whole[i] ^ (1 << bit));
            for value in flipped.chain([0, 0x7f, 0xff]) {
                let mut bytes = whole.clone();
                bytes[i] = value;
                if name.ends_with(".png") {
                    mend(&mut bytes);
                }
                let (any, took) = read_all_ways(path, &bytes);
                images += usize::from(any);
                most = most.max(took);
                assert!(took < MOST, "{name} with {value} at {i} took {took} bytes");
            }
            let (_, took) = read_all_ways(path, &whole[..i]);
            assert!(took < MOST, "{name} cut at {i} took {took} bytes");
        }
        assert!(images > 0, "{name}: some bytes may change");
        println!("{name}: {} bytes, {images} changes leave an image, at most {most} bytes were taken", whole.len());
    }
}
