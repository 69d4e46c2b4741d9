//! JPEG, whole or not at all: what is cut short, or codes that mean nothing, is an error,
//! where other readers make up the rest in grey.

use super::read::{Samples, Values, broken};
use crate::{
    claim::{MAX_BYTES, MAX_RATIO},
    disk::DiskError,
};
use std::path::Path;
use zune_jpeg::{
    JpegDecoder,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

/// What a JPEG may decode to, bytes, however small it is. It needs no more: a block of
/// 8 x 8 samples takes a bit or more, so RGB of one colour is 1536 bytes for a byte of file.
const JPEG_BYTES: u64 = 4 << 20;

/// What a header says.
pub(super) struct Header<'a> {
    pub(super) size: [usize; 2],
    /// 1 or 3.
    pub(super) channels: usize,
    decoder: JpegDecoder<ZCursor<&'a [u8]>>,
}

/// Reads the header, and holds what it claims against the size of the file.
pub(super) fn header<'a>(path: &Path, bytes: &'a [u8]) -> Result<Header<'a>, DiskError> {
    let sides = usize::from(u16::MAX);
    let options = DecoderOptions::default().set_strict_mode(true).set_max_width(sides).set_max_height(sides);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|e| broken(path, &e))?;
    let (Some((width, height)), Some(stored)) = (decoder.dimensions(), decoder.input_colorspace()) else {
        return Err(broken(path, &"it has no header"));
    };
    let (channels, color) = if stored == ColorSpace::Luma { (1, ColorSpace::Luma) } else { (3, ColorSpace::RGB) };
    decoder.set_options(decoder.options().jpeg_set_out_colorspace(color));
    let claimed = width as u64 * height as u64 * channels as u64;
    let most = (bytes.len() as u64).saturating_mul(MAX_RATIO).clamp(JPEG_BYTES, MAX_BYTES);
    if claimed > most {
        let length = bytes.len();
        let why =
            format!("it claims {width} x {height} pixels, {claimed} bytes; a file of {length} bytes may hold {most}");
        return Err(broken(path, &why));
    }
    Ok(Header { size: [width, height], channels, decoder })
}

/// The samples.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Samples, DiskError> {
    let Header { size, channels, mut decoder } = header(path, bytes)?;
    if !has_end(bytes) {
        return Err(broken(path, &"it breaks off before the marker of its end"));
    }
    let mut codes = vec![0; size[0] * size[1] * channels];
    decoder.decode_into(&mut codes).map_err(|e| broken(path, &e))?;
    Ok(Samples { size, channels, values: Values::U8(codes) })
}

/// Whether the marker of the end stands where one of the image's segments ends: one
/// within a segment, of a preview above all, is none.
fn has_end(bytes: &[u8]) -> bool {
    const END: u8 = 0xd9;
    const SCAN: u8 = 0xda;
    let mut at = 2;
    let mut in_scan = false;
    while let Some(&[marker, code]) = bytes.get(at..at + 2).and_then(|two| two.first_chunk::<2>()) {
        if marker != 0xff {
            // Samples of a scan, or what some writers leave between segments.
            at += 1;
            continue;
        }
        match code {
            END => return true,
            // Fill bytes.
            0xff => at += 1,
            // A stuffed byte, restarts, and markers without a segment.
            0 | 0x01 | 0xd0..=0xd8 => at += 2,
            // Within a scan what is no marker of a segment belongs to its samples.
            _ if in_scan && code < 0xc0 => at += 2,
            _ => {
                in_scan = code == SCAN;
                let Some(length) = bytes.get(at + 2..at + 4) else { return false };
                at += 2 + usize::from(length[0]) * 256 + usize::from(length[1]);
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageFormat, RgbImage};
    use std::io::Cursor;

    #[test]
    fn the_end_is_the_image_s_own() {
        let mut bytes = Cursor::new(Vec::new());
        let picture = RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * 37 + y * 11) as u8, (x * y) as u8, 7]));
        DynamicImage::ImageRgb8(picture).write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        let whole = bytes.into_inner();
        assert!(has_end(&whole) && decode(Path::new("a.jpg"), &whole).is_ok());
        for end in 0..whole.len() {
            assert!(!has_end(&whole[..end]) && decode(Path::new("a.jpg"), &whole[..end]).is_err(), "{end}");
        }
        // A preview in a segment has an end of its own.
        let preview = [&whole[..2], &[0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9], &whole[2..]].concat();
        assert!(has_end(&preview) && !has_end(&preview[..preview.len() - 2]));
    }
}
