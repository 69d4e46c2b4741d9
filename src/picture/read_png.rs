//! PNG, with nothing but its pixels: profiles and texts, which may inflate to a thousand
//! times their size, are skipped.

use super::read::{Samples, Values, broken};
use crate::{
    claim::{MAX_BYTES, MAX_SIDE},
    disk::DiskError,
};
use png::{BitDepth, ColorType, Decoder, Info, Limits, Transformations};
use std::{io::Cursor, path::Path};

/// Deflate makes at most so many bytes of one: a length and a distance of a bit each are
/// 258 bytes.
const DEFLATE: u64 = 1032;

/// The decoder, after its header was held against the size of the file: however few the
/// colours are, deflate cannot hold more rows.
fn decoder<'a>(path: &Path, bytes: &'a [u8]) -> Result<Decoder<Cursor<&'a [u8]>>, DiskError> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: MAX_BYTES as usize });
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(|e| broken(path, &e))?;
    let (width, height) = (info.width, info.height);
    if width.max(height) > MAX_SIDE {
        return Err(broken(
            path,
            &format!("it claims {width} x {height} pixels, at most {MAX_SIDE} a side can be read"),
        ));
    }
    let (length, raw) = (bytes.len(), raw_bytes(info));
    if raw > length as u64 * DEFLATE {
        let why = format!("the header claims {width} x {height} pixels, more than {length} bytes of file can hold");
        return Err(broken(path, &why));
    }
    decoder.set_transformations(Transformations::EXPAND);
    Ok(decoder)
}

/// Bytes of the rows before deflate, without those of filters.
fn raw_bytes(info: &Info<'_>) -> u64 {
    let bits = info.color_type.samples() as u64 * info.bit_depth as u64;
    (u64::from(info.width) * bits).div_ceil(8) * u64::from(info.height)
}

/// Width and height, channels and bytes of a sample as they are decoded, by what stands
/// before the pixels.
pub(super) fn shape(path: &Path, bytes: &[u8]) -> Result<([usize; 2], usize, usize), DiskError> {
    let reader = decoder(path, bytes)?.read_info().map_err(|e| broken(path, &e))?;
    let (color, depth) = reader.output_color_type();
    let size = [reader.info().width as usize, reader.info().height as usize];
    Ok((size, color.samples(), if depth == BitDepth::Sixteen { 2 } else { 1 }))
}

/// Frames of an animation, 1 of a plain image.
pub(super) fn frames(path: &Path, bytes: &[u8]) -> Result<u32, DiskError> {
    let reader = decoder(path, bytes)?.read_info().map_err(|e| broken(path, &e))?;
    Ok(reader.info().animation_control.map_or(1, |a| a.num_frames))
}

/// Width and height of a file that is whole: its rows are decoded one by one, and dropped.
pub(super) fn check_whole(path: &Path, bytes: &[u8]) -> Result<[usize; 2], DiskError> {
    let mut reader = decoder(path, bytes)?.read_info().map_err(|e| broken(path, &e))?;
    let size = [reader.info().width as usize, reader.info().height as usize];
    while reader.next_row().map_err(|e| broken(path, &e))?.is_some() {}
    // To the end of the file: a checksum stands behind the last row.
    reader.finish().map_err(|e| broken(path, &e))?;
    Ok(size)
}

/// The samples, of fewer than 8 bits as codes of 8.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Samples, DiskError> {
    let mut reader = decoder(path, bytes)?.read_info().map_err(|e| broken(path, &e))?;
    let size = [reader.info().width as usize, reader.info().height as usize];
    let length = reader.output_buffer_size().filter(|&n| n as u64 <= MAX_BYTES);
    let length = length.ok_or_else(|| broken(path, &format!("it decodes to more than {MAX_BYTES} bytes")))?;
    let (color, depth) = reader.output_color_type();
    let channels = match color {
        ColorType::Indexed => return Err(broken(path, &"it has no palette")),
        color => color.samples(),
    };
    let mut read = |buffer: &mut [u8]| {
        let all = reader.next_frame(buffer).and_then(|_| reader.finish());
        all.map_err(|e| broken(path, &e))
    };
    let values = if depth == BitDepth::Sixteen {
        let mut codes = vec![0u16; length / 2];
        read(bytemuck::cast_slice_mut(&mut codes))?;
        codes.iter_mut().for_each(|code| *code = u16::from_be(*code));
        Values::U16(codes)
    } else {
        let mut codes = vec![0; length];
        read(&mut codes)?;
        Values::U8(codes)
    };
    Ok(Samples { size, channels, values })
}
