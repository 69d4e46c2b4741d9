//! Images of other programs: OpenEXR, PNG, JPEG, Radiance HDR and TIFF become
//! planes of numbers with a stated encoding.

use super::{
    channel::Group,
    read_exr::{self, exr_size},
    read_jpeg, read_png, read_tiff, tiff_lists,
};
use crate::{
    claim::{self, MAX_BYTES, MAX_SIDE},
    disk::DiskError,
    layers::load,
    metrics::image::{Encoding, Image},
};
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::{io::Cursor, path::Path};

/// The first bytes of an OpenEXR file.
const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Extensions of the images that can be read, in lower case.
pub const EXTENSIONS: [&str; 7] = ["exr", "png", "jpg", "jpeg", "hdr", "tif", "tiff"];

/// Which layers of an OpenEXR file to take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayerChoice<'a> {
    /// Of the first part: R, G and B, else Y (not beside X and Z), else `mean`, else the
    /// only layer there is, an alpha beside it not counted.
    #[default]
    Main,
    /// A channel, or three of them: `NAME.R`, `.G`, `.B`.
    Named(&'a str),
    /// Every layer of every part; three channels R, G and B are one.
    All,
}

/// An image from a file, and the layer it was found in (empty where formats have
/// none).
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The numbers.
    pub image: Image,
    /// The layer of an OpenEXR file.
    pub layer: String,
    /// Where the pixels begin: the corner of an OpenEXR data window, else 0, 0.
    pub origin: [i32; 2],
    /// The alpha channel that was left out.
    pub alpha: Alpha,
    /// Channels of the file that were not taken, but for an alpha of 1 everywhere.
    pub others: Vec<String>,
}

/// What an image is by its header, before it is decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Claim {
    /// Width and height, pixels; None where parts of an OpenEXR file differ.
    pub size: Option<[usize; 2]>,
    /// Bytes that its samples take as they are stored.
    pub stored: u64,
    /// Bytes that its colours take as 32-bit floats; of OpenEXR all channels.
    pub floats: u64,
}

/// An alpha channel that is left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Alpha {
    /// There is none.
    #[default]
    None,
    /// It is 1 everywhere.
    One,
    /// It is not.
    Varied,
}

impl Alpha {
    /// By whether each pixel's is 1.
    pub(super) fn of(mut ones: impl Iterator<Item = bool>) -> Self {
        if ones.all(|one| one) { Alpha::One } else { Alpha::Varied }
    }
}

/// The samples of an image as they are stored, channels of a pixel side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Channels a pixel, alpha among them.
    pub channels: usize,
    /// Row by row from the top left.
    pub values: Values,
}

/// Stored numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// 8-bit codes.
    U8(Vec<u8>),
    /// 16-bit codes.
    U16(Vec<u16>),
    /// Floats.
    F32(Vec<f32>),
}

/// Reads an image; the format is told by its first bytes, then by its extension.
///
/// Of an OpenEXR file `layer` names a channel, or three of them (`NAME.R`, `.G`,
/// `.B`), with the name of its part before it where a file has several; without it:
/// [`LayerChoice::Main`]. 8 and 16 bit values become 0 to 1. An alpha channel is left
/// out. Without `encoding`, integers are sRGB codes and floats are linear.
///
/// # Errors
/// [`DiskError`] naming the file where it cannot be read or decoded, claims more
/// than 65,536 pixels a side, 3 GiB or what so many bytes of file may hold, or has no
/// such layer.
pub fn read(path: &Path, layer: Option<&str>, encoding: Option<Encoding>) -> Result<Found, DiskError> {
    let choice = layer.map_or(LayerChoice::Main, LayerChoice::Named);
    let mut found = decode(path, &load(path)?, choice, encoding)?;
    found.pop().ok_or_else(|| DiskError::content(path, "the image has no layer"))
}

/// Decodes the bytes of an image; `path` has the extension, and errors name it. One
/// image, or with [`LayerChoice::All`] as many as there are layers.
///
/// # Errors
/// As [`read`].
pub fn decode(
    path: &Path,
    bytes: &[u8],
    choice: LayerChoice<'_>,
    encoding: Option<Encoding>,
) -> Result<Vec<Found>, DiskError> {
    if is_exr(path, bytes) {
        return read_exr::decode(path, bytes, choice, encoding.unwrap_or(Encoding::Linear));
    }
    if matches!(choice, LayerChoice::Named(_)) {
        return Err(DiskError::content(path, "only OpenEXR images have layers"));
    }
    let claimed = claim(path, bytes)?.floats;
    if claimed > MAX_BYTES {
        let why = format!("as 32-bit floats it takes {claimed} bytes, at most {MAX_BYTES} can be taken");
        return Err(broken(path, &why));
    }
    let samples = decode_samples(path, bytes)?;
    let floats = matches!(samples.values, Values::F32(_));
    let encoding = encoding.unwrap_or(if floats { Encoding::Linear } else { Encoding::Srgb });
    let (planes, alpha) = (samples.planes(), samples.alpha());
    let image = Image::new(samples.size, planes, encoding).map_err(|e| DiskError::content(path, e.to_string()))?;
    let mut others = if alpha == Alpha::Varied { vec!["A".to_owned()] } else { Vec::new() };
    others.extend(further(path, bytes)?.map(str::to_owned));
    Ok(vec![Found { image, layer: String::new(), origin: [0, 0], alpha, others }])
}

/// The channels of an OpenEXR file as they are stored: those of the layers asked for, or
/// without `choice` all of the file together.
///
/// # Errors
/// As [`read`], and for other formats.
pub fn channels(path: &Path, bytes: &[u8], choice: Option<LayerChoice<'_>>) -> Result<Vec<Group>, DiskError> {
    if is_exr(path, bytes) {
        return read_exr::stored(path, bytes, choice);
    }
    Err(DiskError::content(path, "only OpenEXR images have layers"))
}

/// What an image claims to be, by its header alone: for deciding whether to decode it.
///
/// # Errors
/// Where the header cannot be read, or claims more than so many bytes of file may hold.
pub fn claim(path: &Path, bytes: &[u8]) -> Result<Claim, DiskError> {
    if is_exr(path, bytes) {
        let meta = claim::exr(path, bytes)?;
        let mut sizes = meta.headers.iter().map(|h| [h.layer_size.0, h.layer_size.1]);
        let size = sizes.next().filter(|first| sizes.all(|size| size == *first));
        let bytes = u64::try_from(claim::of_exr(&meta)).unwrap_or(u64::MAX);
        return Ok(Claim { size, stored: bytes, floats: bytes });
    }
    let of = |[width, height]: [usize; 2], channels: usize, bytes: usize| {
        let pixels = width as u64 * height as u64;
        let colors = if channels < 3 { 1 } else { 3 };
        let (stored, floats) = (pixels * (channels * bytes) as u64, pixels * colors * 4);
        Claim { size: Some([width, height]), stored, floats }
    };
    let reader = reader(path, bytes)?;
    match reader.format() {
        Some(ImageFormat::Png) => {
            let (size, channels, bytes) = read_png::shape(path, bytes)?;
            return Ok(of(size, channels, bytes));
        }
        Some(ImageFormat::Jpeg) => {
            let header = read_jpeg::header(path, bytes)?;
            return Ok(of(header.size, header.channels, 1));
        }
        Some(ImageFormat::Tiff) => {
            if let Some(grey) = read_tiff::grey32(path, bytes)? {
                return Ok(of(grey.size, 1, 4));
            }
        }
        _ => {}
    }
    let decoder = reader.into_decoder().map_err(|e| broken(path, &e))?;
    let ((width, height), color) = (decoder.dimensions(), decoder.color_type());
    let channels = usize::from(color.channel_count());
    let size = with_pixels(path, [width as usize, height as usize])?;
    Ok(of(size, channels, usize::from(color.bytes_per_pixel()) / channels.max(1)))
}

/// What a file that is no OpenEXR image holds beside the one image that is read.
///
/// # Errors
/// As [`claim`].
pub fn further(path: &Path, bytes: &[u8]) -> Result<Option<&'static str>, DiskError> {
    Ok(match reader(path, bytes)?.format() {
        Some(ImageFormat::Png) if read_png::frames(path, bytes)? > 1 => Some("further frames"),
        Some(ImageFormat::Tiff) if tiff_lists::has_further_pages(bytes) => Some("further pages"),
        _ => None,
    })
}

/// Width and height of an image that is whole, from its first byte to its last: it is
/// decoded, and its pixels are dropped.
///
/// # Errors
/// As [`read`].
pub fn check_whole(path: &Path, bytes: &[u8]) -> Result<[usize; 2], DiskError> {
    if is_exr(path, bytes) {
        return read_exr::stored(path, bytes, None).and_then(|_| exr_size(path, bytes));
    }
    if reader(path, bytes)?.format() == Some(ImageFormat::Png) {
        return read_png::check_whole(path, bytes);
    }
    decode_samples(path, bytes).map(|samples| samples.size)
}

impl Samples {
    /// Channels but for alpha: 1 or 3.
    fn colors(&self) -> usize {
        if self.channels < 3 { 1 } else { 3 }
    }

    /// The colours as planes, integers as shares of their range.
    fn planes(&self) -> Vec<Vec<f32>> {
        fn plane<T: Copy>(values: &[T], channels: usize, channel: usize, float: impl Fn(T) -> f32) -> Vec<f32> {
            values.chunks_exact(channels).map(|pixel| float(pixel[channel])).collect()
        }
        let n = self.channels;
        let one = |c| match &self.values {
            Values::U8(v) => plane(v, n, c, |code| f32::from(code) / 255.0),
            Values::U16(v) => plane(v, n, c, |code| f32::from(code) / 65_535.0),
            Values::F32(v) => plane(v, n, c, |value| value),
        };
        (0..self.colors()).map(one).collect()
    }

    fn alpha(&self) -> Alpha {
        let n = self.channels;
        if self.colors() == n {
            return Alpha::None;
        }
        match &self.values {
            Values::U8(v) => Alpha::of(v.chunks_exact(n).map(|p| p[n - 1] == u8::MAX)),
            Values::U16(v) => Alpha::of(v.chunks_exact(n).map(|p| p[n - 1] == u16::MAX)),
            Values::F32(v) => Alpha::of(v.chunks_exact(n).map(|p| p[n - 1] == 1.0)),
        }
    }
}

/// Decodes the bytes of an image as they are stored. OpenEXR has layers, which
/// [`decode`] knows.
///
/// # Errors
/// As [`read`], and for OpenEXR.
pub fn decode_samples(path: &Path, bytes: &[u8]) -> Result<Samples, DiskError> {
    if is_exr(path, bytes) {
        return Err(DiskError::content(path, "an OpenEXR image has layers, not samples"));
    }
    let reader = reader(path, bytes)?;
    match reader.format() {
        Some(ImageFormat::Png) => return read_png::decode(path, bytes),
        Some(ImageFormat::Jpeg) => return read_jpeg::decode(path, bytes),
        Some(ImageFormat::Tiff) => {
            if let Some(grey) = read_tiff::grey32(path, bytes)? {
                return grey.decode(path);
            }
        }
        _ => {}
    }
    let decoded = decode_dynamic(path, reader)?;
    let size = [decoded.width() as usize, decoded.height() as usize];
    let channels = usize::from(decoded.color().channel_count());
    let values = match decoded {
        DynamicImage::ImageLuma8(b) => Values::U8(b.into_raw()),
        DynamicImage::ImageLumaA8(b) => Values::U8(b.into_raw()),
        DynamicImage::ImageRgb8(b) => Values::U8(b.into_raw()),
        DynamicImage::ImageRgba8(b) => Values::U8(b.into_raw()),
        DynamicImage::ImageLuma16(b) => Values::U16(b.into_raw()),
        DynamicImage::ImageLumaA16(b) => Values::U16(b.into_raw()),
        DynamicImage::ImageRgb16(b) => Values::U16(b.into_raw()),
        DynamicImage::ImageRgba16(b) => Values::U16(b.into_raw()),
        DynamicImage::ImageRgb32F(b) => Values::F32(b.into_raw()),
        DynamicImage::ImageRgba32F(b) => Values::F32(b.into_raw()),
        other => {
            let why = format!("samples of the kind {:?} cannot be compared", other.color());
            return Err(DiskError::content(path, why));
        }
    };
    Ok(Samples { size, channels, values })
}

/// Width and height by the header alone; of an OpenEXR file those of its first part.
///
/// # Errors
/// Where the header cannot be read.
pub fn size(path: &Path, bytes: &[u8]) -> Result<[usize; 2], DiskError> {
    match claim(path, bytes)?.size {
        Some(size) => Ok(size),
        None => exr_size(path, bytes),
    }
}

/// The size again, where there is any pixel.
fn with_pixels(path: &Path, [width, height]: [usize; 2]) -> Result<[usize; 2], DiskError> {
    if width == 0 || height == 0 {
        return Err(broken(path, &format!("it has {width} x {height} pixels")));
    }
    Ok([width, height])
}

/// Whether the extension is one of an image that can be read.
pub fn has_image_extension(path: &Path) -> bool {
    path.extension().is_some_and(|e| EXTENSIONS.iter().any(|known| e.eq_ignore_ascii_case(known)))
}

/// Names of the channels of an OpenEXR file, as layers are called; none of others.
///
/// # Errors
/// Where the header cannot be read.
pub fn layer_names(path: &Path, bytes: &[u8]) -> Result<Vec<String>, DiskError> {
    if is_exr(path, bytes) { read_exr::names(path, bytes) } else { Ok(Vec::new()) }
}

/// Whether one layer of an image stands for it: R, G and B, else Y, else `mean`, else the only one there is.
///
/// # Errors
/// Where it is OpenEXR whose header cannot be read.
pub fn has_main(path: &Path, bytes: &[u8]) -> Result<bool, DiskError> {
    if is_exr(path, bytes) { read_exr::has_main(path, bytes) } else { Ok(true) }
}

/// Whether the bytes are OpenEXR, or no format is known by them and the extension
/// says so.
pub fn is_exr(path: &Path, bytes: &[u8]) -> bool {
    bytes.starts_with(&EXR)
        || path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) && image::guess_format(bytes).is_err()
}

pub(super) fn broken(path: &Path, e: &dyn std::fmt::Display) -> DiskError {
    DiskError::content(path, format!("not a readable image: {e}"))
}

/// The decoder of what the bytes are, with its limits; [`read_png`] has its own.
fn reader<'a>(path: &Path, bytes: &'a [u8]) -> Result<ImageReader<Cursor<&'a [u8]>>, DiskError> {
    let mut reader = ImageReader::new(Cursor::new(bytes));
    // The extension stands in where the first bytes say nothing.
    if let Ok(format) = ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    let mut reader = reader.with_guessed_format().map_err(|e| broken(path, &e))?;
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(claim::most(bytes.len()));
    reader.limits(limits);
    // Before the decoder sees them: it reads lists before it knows its limits.
    match tiff_lists::beyond_the_end(bytes).filter(|_| reader.format() == Some(ImageFormat::Tiff)) {
        Some(tag) => Err(broken(path, &format!("the list of the tag {tag} reaches beyond the end of the file"))),
        None => Ok(reader),
    }
}

/// What decoding a PNG of 7680 x 4320 RGB takes, 19 MB, milliseconds: `image` 88 to 102, the
/// crate `png` without checksums 90 to 100, row by row into no image 55 to 61 (the rest
/// is fresh memory), `zune-png` 172 to 256, `zlib-rs` without undoing filters 94 to 102.
/// So checksums stay on, and there is no decoder beside those that `image` has.
fn decode_dynamic(path: &Path, reader: ImageReader<Cursor<&[u8]>>) -> Result<DynamicImage, DiskError> {
    let decoded = reader.decode().map_err(|e| broken(path, &e))?;
    with_pixels(path, [decoded.width() as usize, decoded.height() as usize])?;
    Ok(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layers::Layers;
    use image::{ImageBuffer, Luma, Rgb, Rgba};

    #[test]
    fn formats_are_told_by_their_bytes_and_become_planes() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        ImageBuffer::from_fn(3, 2, |x, y| Rgb([x as u8 * 100, y as u8, 255])).save(at("a.png")).unwrap();
        let found = read(&at("a.png"), None, None).unwrap().image;
        assert_eq!((found.size(), found.encoding(), found.planes().len()), ([3, 2], Encoding::Srgb, 3));
        assert_eq!(found.planes()[0][2], 200.0 / 255.0);
        assert_eq!(found.planes()[2][5], 1.0);

        let grey = ImageBuffer::from_fn(3, 2, |x, _| Luma([x as u16 * 30_000]));
        grey.save(at("b.png")).unwrap();
        std::fs::rename(at("b.png"), at("b.jpg")).unwrap();
        let found = read(&at("b.jpg"), None, Some(Encoding::Linear)).unwrap().image;
        assert_eq!((found.planes().len(), found.encoding()), (1, Encoding::Linear));
        assert_eq!(found.planes()[0][1], 30_000.0 / 65_535.0);

        ImageBuffer::from_fn(2, 2, |_, _| Rgba([255u8, 0, 0, 7])).save(at("c.tiff")).unwrap();
        assert_eq!(read(&at("c.tiff"), None, None).unwrap().image.planes()[0], [1.0; 4]);
        ImageBuffer::from_fn(2, 2, |_, _| Rgb([8.0f32, 0.5, 0.0])).save(at("d.hdr")).unwrap();
        let found = read(&at("d.hdr"), None, None).unwrap().image;
        assert_eq!((found.encoding(), found.planes()[0][0]), (Encoding::Linear, 8.0));
    }

    #[test]
    fn layers_are_found_or_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let layers = |names: &[&str]| {
            names.iter().enumerate().fold(Layers::new([2, 1]), |l, (i, n)| l.with(n, vec![i as f32; 2]))
        };
        let first = |names: &[&str], layer: Option<&str>| {
            layers(names).write(&path).unwrap();
            read(&path, layer, None).map(|f| (f.layer, f.image.planes().iter().map(|p| p[0]).collect::<Vec<_>>()))
        };
        assert_eq!(first(&["R", "G", "B", "A"], None).unwrap(), ("RGB".into(), vec![0.0, 1.0, 2.0]));
        assert_eq!(first(&["mean", "variance"], None).unwrap(), ("mean".into(), vec![0.0]));
        assert_eq!(first(&["mean", "variance"], Some("variance")).unwrap(), ("variance".into(), vec![1.0]));
        assert_eq!(first(&["ao"], None).unwrap(), ("ao".into(), vec![0.0]));
        let color = ["color.R", "color.G", "color.B", "mean"];
        assert_eq!(first(&color, Some("color")).unwrap(), ("color.RGB".into(), vec![0.0, 1.0, 2.0]));
        assert!(first(&["p", "q"], None).unwrap_err().to_string().contains("name one of them: p, q"));
        assert!(first(&["p", "q"], Some("r")).unwrap_err().to_string().contains("no layer 'r'; there are: p, q"));
    }

    #[test]
    fn what_is_no_image_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in
            [("a.png", &b"no"[..]), ("b.png", b"\x89PNG\r\n\x1a\n0000"), ("c.exr", b""), ("d", b"words")]
        {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let error = read(&path, None, None).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        // A PNG that claims 4 billion pixels a side in 57 bytes.
        let mut bytes = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\x7f\xff\xff\xff\x7f\xff\xff\xff\x08\x02\0\0\0".to_vec();
        bytes.extend([0; 24]);
        let path = folder.path().join("bomb.png");
        std::fs::write(&path, bytes).unwrap();
        assert!(read(&path, None, None).is_err());
    }
}
