//! Grey TIFF of 32-bit floats, which the crate `image` does not read.

use super::read::{Samples, Values, broken};
use crate::{
    claim::{self, MAX_SIDE},
    disk::DiskError,
};
use std::{io::Cursor, path::Path};
use tiff::{
    ColorType,
    decoder::{Decoder, DecodingResult, Limits},
};

/// A grey image of 32 bits a pixel, before it is decoded.
pub(super) struct Grey32<'a> {
    pub(super) size: [usize; 2],
    decoder: Decoder<Cursor<&'a [u8]>>,
}

/// The image, where it is one of 32-bit grey; its lists were held against the file.
pub(super) fn grey32<'a>(path: &Path, bytes: &'a [u8]) -> Result<Option<Grey32<'a>>, DiskError> {
    let most = claim::most(bytes.len());
    let mut limits = Limits::default();
    limits.decoding_buffer_size = usize::try_from(most).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    let Ok(decoder) = Decoder::new(Cursor::new(bytes)) else {
        // The other decoder says what is wrong.
        return Ok(None);
    };
    let mut decoder = decoder.with_limits(limits);
    let (Ok(ColorType::Gray(32)), Ok((width, height))) = (decoder.colortype(), decoder.dimensions()) else {
        return Ok(None);
    };
    let claimed = u64::from(width) * u64::from(height) * 4;
    if width.max(height) > MAX_SIDE || claimed > most {
        let length = bytes.len();
        let why =
            format!("it claims {width} x {height} pixels of 32 bits; a file of {length} bytes may hold {most} bytes");
        return Err(broken(path, &why));
    }
    Ok(Some(Grey32 { size: [width as usize, height as usize], decoder }))
}

impl Grey32<'_> {
    pub(super) fn decode(mut self, path: &Path) -> Result<Samples, DiskError> {
        match self.decoder.read_image().map_err(|e| broken(path, &e))? {
            DecodingResult::F32(values) if values.len() == self.size[0] * self.size[1] => {
                Ok(Samples { size: self.size, channels: 1, values: Values::F32(values) })
            }
            DecodingResult::F32(_) => Err(broken(path, &"it has more or fewer samples than pixels")),
            _ => {
                Err(broken(path, &"grey of 32 bits is read as floats alone: save it as floats, or as 16-bit integers"))
            }
        }
    }
}
