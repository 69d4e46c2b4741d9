//! Pictures: decoded under limits that follow from the bytes that are there.

use crate::{Texture, Wrap};
use image::{ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;

/// Longest side of a picture, texels.
const LONGEST: u32 = 16384;

/// Most texels a byte can stand for: deflate at its best (1032 to 1) over pixels
/// of one bit. A header that claims more is lying.
const TEXELS_A_BYTE: u64 = 1032 * 8;

/// glTF's number of the wrap mode that repeats.
pub(super) const REPEAT: u32 = 10497;

/// glTF's numbers of the wrap modes.
const WRAPS: [(u32, Wrap); 3] = [(REPEAT, Wrap::Repeat), (33071, Wrap::Clamp), (33648, Wrap::Mirror)];

/// The wrap mode of a sampler's field.
pub(super) fn wrap(code: u32, field: &str) -> Result<Wrap, String> {
    let known = WRAPS.iter().find(|(c, _)| *c == code).map(|(_, wrap)| *wrap);
    known.ok_or_else(|| format!("its {field} is {code}: {} are known", WRAPS.map(|(c, _)| c.to_string()).join(", ")))
}

/// The number of a wrap mode.
pub(super) fn wrap_code(wrap: Wrap) -> u32 {
    WRAPS.iter().find(|(_, w)| *w == wrap).map_or(REPEAT, |(code, _)| *code)
}

/// Decodes PNG or JPEG, taking its texels out of `left`.
pub(super) fn decode(bytes: &[u8], wrap: [Wrap; 2], left: &mut u64) -> Result<Texture, String> {
    let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    if !matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        return Err("it is neither PNG nor JPEG".into());
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(LONGEST);
    limits.max_image_height = Some(LONGEST);
    limits.max_alloc = Some(1 << 30);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| one_line(&e))?;
    let (width, height) = decoder.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 || texels / TEXELS_A_BYTE > bytes.len() as u64 {
        return Err(format!("it claims {width} x {height} texels in {} bytes", bytes.len()));
    }
    *left = left.checked_sub(texels).ok_or("with it, the textures have too many texels in all: use smaller ones")?;
    let image = image::DynamicImage::from_decoder(decoder).map_err(|e| one_line(&e))?.into_rgba8();
    Ok(Texture { size: [width, height], wrap, texels: image.pixels().map(|p| p.0).collect() })
}

fn one_line(e: &image::ImageError) -> String {
    format!("it does not decode: {}", e.to_string().replace('\n', " "))
}

/// The picture as PNG.
pub(super) fn encode(texture: &Texture) -> Result<Vec<u8>, String> {
    let [width, height] = texture.size;
    if texture.texels.is_empty() || texture.texels.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(format!("its texture has {} texels for {width} x {height}", texture.texels.len()));
    }
    let mut png = Vec::new();
    image::codecs::png::PngEncoder::new(&mut png)
        .write_image(texture.texels.as_flattened(), width, height, ExtendedColorType::Rgba8)
        .map_err(|e| one_line(&e))?;
    Ok(png)
}
