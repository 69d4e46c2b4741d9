//! Images of other programs: OpenEXR, PNG, JPEG, Radiance HDR and TIFF become
//! planes of numbers with a stated encoding.

use crate::{
    disk::DiskError,
    layers::Layers,
    metrics::image::{Encoding, Image},
};
use image::{DynamicImage, ImageReader, Limits};
use std::{
    fs::File,
    io::{BufReader, Read, Seek},
    path::Path,
};

/// An image may be this wide and high, pixels.
const MAX_SIDE: u32 = 65_536;
/// What decoding may allocate, bytes: two 16-bit RGB images of 16,384 pixels a side.
const MAX_BYTES: u64 = 3 << 30;

/// The first bytes of an OpenEXR file.
const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// An image from a file, and the layer it was found in (empty where formats have
/// none).
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The numbers.
    pub image: Image,
    /// The layer of an OpenEXR file.
    pub layer: String,
}

/// Reads an image; the format is told by its first bytes, then by its extension.
///
/// Of an OpenEXR file `layer` names a channel, or three of them (`NAME.R`, `.G`,
/// `.B`); without it: R, G and B, else Y, else `mean`, else the only channel. 8 and
/// 16 bit values become 0 to 1. An alpha channel is left out. Without `encoding`,
/// integers are sRGB codes and floats are linear.
///
/// # Errors
/// [`DiskError`] naming the file where it cannot be read or decoded, claims more
/// than 65,536 pixels a side or 3 GiB, or has no such layer.
pub fn read(path: &Path, layer: Option<&str>, encoding: Option<Encoding>) -> Result<Found, DiskError> {
    let mut file = File::open(path).map_err(DiskError::io(path, "read the image"))?;
    let mut magic = [0; 4];
    // A file of fewer bytes is no image, as the decoder will say.
    let is_exr = file.read_exact(&mut magic).is_ok() && magic == EXR;
    if is_exr || path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
        return read_exr(path, layer, encoding);
    }
    if layer.is_some() {
        return Err(DiskError::content(path, "only OpenEXR images have layers"));
    }
    file.rewind().map_err(DiskError::io(path, "read the image"))?;
    decode(path, file, encoding)
}

fn decode(path: &Path, file: File, encoding: Option<Encoding>) -> Result<Found, DiskError> {
    let broken = |e: &dyn std::fmt::Display| DiskError::content(path, format!("not a readable image: {e}"));
    let mut reader = ImageReader::new(BufReader::new(file));
    // The extension stands in where the first bytes say nothing.
    if let Ok(format) = image::ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    let mut reader = reader.with_guessed_format().map_err(|e| broken(&e))?;
    let mut limits = Limits::default();
    (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE), Some(MAX_SIDE));
    limits.max_alloc = Some(MAX_BYTES);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|e| broken(&e))?;
    let floats = matches!(decoded, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let encoding = encoding.unwrap_or(if floats { Encoding::Linear } else { Encoding::Srgb });
    let size = [decoded.width() as usize, decoded.height() as usize];
    let planes = if decoded.color().has_color() {
        let pixels = decoded.into_rgb32f().into_raw();
        (0..3).map(|c| pixels.iter().skip(c).step_by(3).copied().collect()).collect()
    } else {
        vec![decoded.to_luma32f().into_raw()]
    };
    let image = Image::new(size, planes, encoding).map_err(|e| broken(&e))?;
    Ok(Found { image, layer: String::new() })
}

fn read_exr(path: &Path, layer: Option<&str>, encoding: Option<Encoding>) -> Result<Found, DiskError> {
    let mut layers = Layers::read(path)?;
    let size = layers.resolution.map(|n| n as usize);
    let names: Vec<String> = layers.layers.keys().cloned().collect();
    let three = |prefix: &str| ["R", "G", "B"].map(|c| format!("{prefix}{c}"));
    let has = |wanted: &[String]| wanted.iter().all(|w| names.contains(w));
    let one = |name: &str| vec![name.to_owned()];
    let wanted = match layer {
        Some(name) if has(&three(&format!("{name}."))) => three(&format!("{name}.")).to_vec(),
        Some(name) => one(name),
        None if has(&three("")) => three("").to_vec(),
        None => match ["Y", "mean"].into_iter().find(|n| has(&one(n))) {
            Some(name) => one(name),
            None if names.len() == 1 => names.clone(),
            None => {
                let why = format!("several layers, name one of them: {}", names.join(", "));
                return Err(DiskError::content(path, why));
            }
        },
    };
    let planes: Vec<Vec<f32>> = wanted.iter().filter_map(|name| layers.layers.remove(name)).collect();
    if planes.len() != wanted.len() {
        let why = format!("no layer '{}'; there are: {}", layer.unwrap_or_default(), names.join(", "));
        return Err(DiskError::content(path, why));
    }
    let image = Image::new(size, planes, encoding.unwrap_or(Encoding::Linear))
        .map_err(|e| DiskError::content(path, e.to_string()))?;
    let layer = if wanted.len() == 1 { wanted[0].clone() } else { wanted[0].trim_end_matches('R').to_owned() + "RGB" };
    Ok(Found { image, layer })
}

#[cfg(test)]
mod tests {
    use super::*;
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
