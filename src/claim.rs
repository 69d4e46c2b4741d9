//! What the header of an image file may claim, before memory is taken for it.

use crate::disk::DiskError;
use exr::{meta::header::Header, prelude::MetaData};
use std::{io::Cursor, path::Path};

/// What a file and what decoding it may take, bytes: two 16-bit RGB images of
/// 16,384 pixels a side.
pub(crate) const MAX_BYTES: u64 = 3 << 30;
/// An image may be this wide and high, pixels.
pub(crate) const MAX_SIDE: u32 = 65_536;
/// What any file may decode to, however small it is: 7680 x 4320 pixels of 4 channels as
/// 32-bit floats. An image of one colour of that size takes some thousand bytes by DWA or
/// by the run lengths of fax machines.
const ALWAYS: u64 = 7680 * 4320 * 4 * 4;
/// Beyond that, more bytes of pixels than this for a byte of file is no honest
/// compression: deflate ends at 1032.
pub(crate) const MAX_RATIO: u64 = 2000;

/// How many bytes a file of so many may decode to.
pub(crate) fn most(length: usize) -> u64 {
    (length as u64).saturating_mul(MAX_RATIO).clamp(ALWAYS, MAX_BYTES)
}

/// Bytes that decoding a part takes, as floats of 32 bits. In 128 bits: sides and
/// channels come from the file.
fn bytes_of(header: &Header) -> u128 {
    let [width, height] = [header.layer_size.0 as u128, header.layer_size.1 as u128];
    // Samples of 16 bits become 32.
    let pixel = header.channels.bytes_per_pixel.max(4 * header.channels.list.len());
    (width * height).saturating_mul(pixel as u128)
}

/// Bytes that decoding a file takes whose headers are these.
pub(crate) fn of_exr(meta: &MetaData) -> u128 {
    meta.headers.iter().fold(0u128, |sum, header| sum.saturating_add(bytes_of(header)))
}

/// Reads the headers of an OpenEXR file, and refuses what decoding would take too much
/// memory for, as floats of 32 bits, and what cannot be read.
pub(crate) fn exr(path: &Path, bytes: &[u8]) -> Result<MetaData, DiskError> {
    let broken = |e| DiskError::content(path, format!("not a readable OpenEXR image: {e}"));
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        if header.deep {
            return Err(DiskError::content(path, "deep OpenEXR images cannot be read: flatten them"));
        }
        let [width, height] = [header.layer_size.0, header.layer_size.1];
        if width.max(height) > MAX_SIDE as usize {
            let why = format!("the header claims {width} x {height} pixels, at most {MAX_SIDE} a side can be read");
            return Err(DiskError::content(path, why));
        }
    }
    let claimed = of_exr(&meta);
    let most = most(bytes.len());
    if claimed > u128::from(most) {
        let length = bytes.len();
        let why = format!("the header claims {claimed} bytes of pixels, a file of {length} bytes may hold {most}");
        return Err(DiskError::content(path, why));
    }
    Ok(meta)
}
