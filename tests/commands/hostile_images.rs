//! No image file makes the readers panic, or take memory out of proportion to its
//! size: hand-made liars, and honest files with every byte of their header changed.

use aogauge::{
    compare::{Mask, Mode, Settings, compare},
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

/// What reading a file of at most 1500 bytes may take in every way, bytes.
fn most(path: &Path) -> usize {
    match path.extension().and_then(|e| e.to_str()).unwrap() {
        "hdr" => 16 << 10,
        "png" => 1 << 19,
        "exr" => 8 << 20,
        "jpg" | "tiff" => 10 << 20,
        other => panic!("{other}"),
    }
}

/// What any file may claim: 7680 x 4320 pixels of 4 channels of 32 bits.
const ALWAYS: usize = 7680 * 4320 * 4 * 4;

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
fn liars_take_no_memory_and_honest_images_are_read() {
    liars_are_errors();
    honest_images_may_change();
    for (name, bytes) in bombs() {
        let (any, took) = read_all_ways(Path::new(name), &bytes);
        assert!(any && took < 2 * bytes.len() + (1 << 20), "{name}: {took} of {} bytes", bytes.len());
    }
    for (name, bytes) in flat() {
        let before = NOW.load(Relaxed);
        PEAK.store(before, Relaxed);
        let found = read::decode(Path::new(name), &bytes, LayerChoice::Main, None).unwrap().remove(0);
        let took = PEAK.load(Relaxed) - before;
        println!("{name}: {} bytes of 7680 x 4320 pixels took {took} bytes", bytes.len());
        assert_eq!(found.image.size(), [7680, 4320], "{name}");
        assert!(found.image.planes().iter().all(|p| p.iter().all(|v| *v == p[0])), "{name}");
        // As stored, and as floats.
        assert!(bytes.len() < 1 << 19 && took < 2 * ALWAYS, "{name} took {took}");
        drop(found);
        let (any, took) = read_all_ways(Path::new(name), &bytes[..bytes.len() / 2]);
        assert!(!any && took < ALWAYS, "{name}, half of it, took {took}");
    }
    pairs_are_refused_by_their_headers();
}

/// Sizes that differ, and images that are too large together, before any is decoded.
fn pairs_are_refused_by_their_headers() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (name, bytes) in flat() {
        std::fs::write(at(name), bytes).unwrap();
    }
    // Each alone may be read: 2.3 GB as floats.
    for (name, color) in [("one.png", 0), ("other.png", 255)] {
        let mut encoder = png::Encoder::new(std::fs::File::create(at(name)).unwrap(), 24_000, 24_000);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::One);
        encoder.set_compression(png::Compression::High);
        encoder.write_header().unwrap().write_image_data(&vec![color; 3000 * 24_000]).unwrap();
    }
    image::GrayImage::new(8, 6).save(at("small.png")).unwrap();
    let mut masked = Settings { mode: Mode::Exact, ..Settings::default() };
    masked.mask = Some(Mask { path: at("rgb.png"), layer: None });
    for (reference, test, settings, says) in [
        ("rgb.png", "small.png", Settings::default(), "7680 x 4320 pixels, the test image 8 x 6"),
        ("small.png", "zip.exr", Settings::default(), "8 x 6 pixels, the test image 7680 x 4320"),
        ("small.png", "old.hdr", Settings { mode: Mode::Exact, ..Settings::default() }, "8 x 6 pixels"),
        ("one.png", "other.png", Settings::default(), "both images together take 4608000000 bytes"),
        ("small.png", "small.png", masked, "the mask has 7680 x 4320 pixels, the images have 8 x 6"),
    ] {
        let before = NOW.load(Relaxed);
        PEAK.store(before, Relaxed);
        let found = compare(&at(reference), &at(test), &settings, &|_, _, _| (), &mut |_, _| Ok(()));
        let took = PEAK.load(Relaxed).saturating_sub(before);
        let error = found.unwrap_err().to_string();
        assert!(error.contains(says), "{reference} {test}: {error}");
        assert!(took < 4 << 20, "{reference} {test} took {took} bytes");
    }
}

fn liars_are_errors() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad-images");
    let mut files = 0;
    for entry in std::fs::read_dir(corpus).unwrap() {
        let path = entry.unwrap().path();
        let (any, took) = read_all_ways(&path, &std::fs::read(&path).unwrap());
        assert!(!any, "{} is no image", path.display());
        assert!(took < most(&path), "{} took {took} bytes", path.display());
        assert!(read::read(&path, None, None).unwrap_err().to_string().contains("bad-images"), "{}", path.display());
        files += 1;
    }
    assert!(files >= 25, "{files}");
}

fn honest_images_may_change() {
    for (name, whole) in honest() {
        let path = Path::new(name);
        assert!(read_all_ways(path, &whole).0, "{name} is honest");
        let (mut images, mut peak) = (0, 0);
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
                peak = peak.max(took);
                assert!(took < most(path), "{name} with {value} at {i} took {took} bytes");
            }
            let (_, took) = read_all_ways(path, &whole[..i]);
            assert!(took < most(path), "{name} cut at {i} took {took} bytes");
        }
        assert!(images > 0, "{name}: some bytes may change");
        println!("{name}: {} bytes, {images} changes leave an image, at most {peak} bytes were taken", whole.len());
    }
}

/// 8K images of one colour, which take a few bytes.
fn flat() -> Vec<(&'static str, Vec<u8>)> {
    const SIDES: [u32; 2] = [7680, 4320];
    let png = |color: png::ColorType, depth: png::BitDepth, row: usize| {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, SIDES[0], SIDES[1]);
        encoder.set_color(color);
        encoder.set_depth(depth);
        encoder.set_compression(png::Compression::High);
        if color == png::ColorType::Indexed {
            encoder.set_palette([9u8, 8, 7].as_slice());
        }
        encoder.write_header().unwrap().write_image_data(&vec![0; row * SIDES[1] as usize]).unwrap();
        bytes
    };
    let exr = |compression, planes: &[exr::prelude::FlatSamples]| {
        use exr::prelude::*;
        let channels = ["R", "G", "B", "A"].iter().zip(planes).map(|(n, v)| AnyChannel::new(*n, v.clone())).collect();
        let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let size = Vec2(SIDES[0] as usize, SIDES[1] as usize);
        let layer = Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(channels));
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    };
    let floats = exr::prelude::FlatSamples::F32(vec![0.5; (SIDES[0] * SIDES[1]) as usize]);
    let grey = DynamicImage::new_luma8(SIDES[0], SIDES[1]);
    vec![
        ("bit.png", png(png::ColorType::Grayscale, png::BitDepth::One, 960)),
        ("palette.png", png(png::ColorType::Indexed, png::BitDepth::One, 960)),
        ("rgb.png", png(png::ColorType::Rgb, png::BitDepth::Eight, 7680 * 3)),
        ("fax.tiff", fax(SIDES)),
        ("zip.exr", exr(exr::prelude::Compression::ZIP16, std::slice::from_ref(&floats))),
        ("dwa.exr", exr(exr::prelude::Compression::DWAB(None), std::slice::from_ref(&floats))),
        ("grey.jpg", encode(ImageFormat::Jpeg, &grey)),
        ("old.hdr", old_hdr(SIDES)),
    ]
}

/// Lines of one colour by the run lengths that Radiance had before 1991.
fn old_hdr([width, height]: [u32; 2]) -> Vec<u8> {
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    let rest = width - 1;
    let line = [64, 64, 64, 128, 1, 1, 1, (rest & 255) as u8, 1, 1, 1, (rest >> 8) as u8];
    bytes.extend(line.repeat(height as usize));
    bytes
}

/// A TIFF file of white lines as fax machines of group 4 send them: a bit each.
fn fax([width, height]: [u32; 2]) -> Vec<u8> {
    let mut strip = vec![255u8; height as usize / 8];
    strip.extend([0, 16, 1]);
    let entries: [(u16, u32); 9] = [
        (256, width),
        (257, height),
        (258, 1),
        (259, 4),
        (262, 0),
        (273, 8),
        (277, 1),
        (278, height),
        (279, strip.len() as u32),
    ];
    let mut bytes = b"II*\0".to_vec();
    bytes.extend((8 + strip.len() as u32).to_le_bytes());
    bytes.extend(strip);
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend([4, 0, 1, 0, 0, 0]);
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend([0; 4]);
    bytes
}

/// Chunks beside the pixels that inflate to 64 MiB.
fn bombs() -> Vec<(&'static str, Vec<u8>)> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
    encoder.add_ztxt_chunk("words".into(), "a".repeat(64 << 20)).unwrap();
    encoder.write_header().unwrap().write_image_data(&[7; 48]).unwrap();
    let at = bytes.windows(4).position(|w| w == b"zTXt").unwrap();
    let end = at + 4 + u32::from_be_bytes(bytes[at - 4..at].try_into().unwrap()) as usize;
    let deflated = bytes[at + 4 + b"words\0\0".len()..end].to_vec();
    assert!(deflated.len() < 1 << 20);
    let with = |kind: &[u8; 4], head: &[u8]| {
        let body = [kind, head, &deflated].concat();
        let chunk = [&((body.len() - 4) as u32).to_be_bytes(), body.as_slice(), &crc(&body).to_be_bytes()].concat();
        [&bytes[..at - 4], &chunk, &bytes[end + 4..]].concat()
    };
    let (profile, text) = (with(b"iCCP", b"profile\0\0"), with(b"iTXt", b"words\0\x01\0\0\0"));
    vec![("text.png", bytes), ("profile.png", profile), ("utf8.png", text)]
}
