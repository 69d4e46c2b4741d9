//! Images on disk: named layers of 32-bit floats in OpenEXR, and PNG for looking
//! at.

use crate::{
    claim::{self, MAX_BYTES},
    disk::{DiskError, write_whole},
};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, Text,
    Vec2, WritableImage, attribute::AttributeValue,
};
use sha2::{Digest, Sha256};
use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read},
    path::Path,
};

/// Named layers of one resolution, with text attributes.
///
/// In the file, layer `name` is the channel `name.Y`, as OpenEXR viewers expect
/// of grey layers; the attributes are one JSON object in the text attribute
/// `aogauge` (OpenEXR text is not Unicode, and the order of several attributes
/// would make bytes differ from one write to the next).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layers {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Values row by row from the top left.
    pub layers: BTreeMap<String, Vec<f32>>,
    /// Text by name.
    pub attributes: BTreeMap<String, String>,
}

/// Our attribute in the file.
const ATTRIBUTE: &str = "aogauge";

impl Layers {
    /// No layers yet.
    pub fn new(resolution: [u32; 2]) -> Self {
        Layers { resolution, ..Self::default() }
    }

    /// Adds a layer.
    #[must_use]
    pub fn with(mut self, name: &str, values: Vec<f32>) -> Self {
        self.layers.insert(name.to_owned(), values);
        self
    }

    /// A layer by name.
    pub fn get(&self, name: &str) -> Option<&[f32]> {
        self.layers.get(name).map(Vec::as_slice)
    }

    /// Writes an OpenEXR file, ZIP compressed, 32-bit floats. The bytes depend on
    /// the content alone.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), DiskError> {
        let bytes = self.to_bytes().map_err(DiskError::io(path, "write the file"))?;
        write_whole(path, |buffer| io::Write::write_all(buffer, &bytes))
    }

    /// The bytes of the file that [`Layers::write`] writes.
    ///
    /// # Errors
    /// Where they are no image: no layers, or values that do not fit the resolution.
    pub fn to_bytes(&self) -> io::Result<Vec<u8>> {
        let size = Vec2(self.resolution[0] as usize, self.resolution[1] as usize);
        let channels = self
            .layers
            .iter()
            .map(|(name, values)| {
                let channel = if name.contains('.') { name.clone() } else { format!("{name}.Y") };
                AnyChannel::new(channel.as_str(), FlatSamples::F32(values.clone()))
            })
            .collect();
        let mut attributes = LayerAttributes::default();
        if !self.attributes.is_empty() {
            let text = Text::from(ascii_json(&self.attributes).as_str());
            attributes.other.insert(Text::from(ATTRIBUTE), AttributeValue::Text(text));
        }
        let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels));
        let mut bytes = io::Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).map_err(io::Error::other)?;
        Ok(bytes.into_inner())
    }

    /// Reads a file that [`Layers::write`] wrote.
    ///
    /// # Errors
    /// Where the file is missing, truncated, no OpenEXR, or claims more pixels
    /// than its size can hold.
    pub fn read(path: &Path) -> Result<Self, DiskError> {
        Self::decode(path, &load(path)?)
    }

    /// The same from a file's bytes; errors name `path`.
    ///
    /// # Errors
    /// As [`Layers::read`].
    pub fn decode(path: &Path, bytes: &[u8]) -> Result<Self, DiskError> {
        claim::exr(path, bytes)?;
        let broken = |e: exr::error::Error| DiskError::content(path, format!("not a readable OpenEXR image: {e}"));
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(io::Cursor::new(bytes))
            .map_err(broken)?;
        let layer = image.layer_data;
        let mut layers = Layers::new([layer.size.0 as u32, layer.size.1 as u32]);
        for channel in layer.channel_data.list {
            let name = channel.name.to_string();
            let name = name.strip_suffix(".Y").unwrap_or(&name).to_owned();
            layers.layers.insert(name, channel.sample_data.values_as_f32().collect());
        }
        for (name, value) in layer.attributes.other {
            if let (ATTRIBUTE, AttributeValue::Text(text)) = (name.to_string().as_str(), value) {
                layers.attributes = serde_json::from_str(&text.to_string())
                    .map_err(|e| DiskError::content(path, format!("the attribute '{ATTRIBUTE}' is broken: {e}")))?;
            }
        }
        Ok(layers)
    }
}

/// How the file begins that Git LFS leaves in an image's place.
const POINTER: &[u8] = b"version https://git-lfs";

/// Whether Git LFS has left a pointer in a file's place.
pub fn is_pointer(path: &Path) -> bool {
    let mut begin = [0; POINTER.len()];
    File::open(path).and_then(|mut f| f.read_exact(&mut begin)).is_ok() && begin == POINTER
}

/// The bytes of an image file.
///
/// # Errors
/// Where it cannot be read, is a Git LFS pointer or has more than 3 GiB.
pub fn load(path: &Path) -> Result<Vec<u8>, DiskError> {
    let file = File::open(path).map_err(DiskError::io(path, "read the image"))?;
    let mut bytes = Vec::new();
    if let Ok(length) = file.metadata().map(|m| m.len()) {
        bytes.reserve(length.min(MAX_BYTES) as usize + 1);
    }
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(DiskError::io(path, "read the image"))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(DiskError::content(
            path,
            format!("more than {MAX_BYTES} bytes, which is the most an image may have"),
        ));
    }
    if bytes.starts_with(POINTER) {
        return Err(DiskError::content(path, "this is a Git LFS pointer, not the image: run `git lfs pull`"));
    }
    Ok(bytes)
}

/// A JSON object in ASCII: everything else as `\u` escapes.
fn ascii_json(attributes: &BTreeMap<String, String>) -> String {
    let json = serde_json::json!(attributes).to_string();
    let mut ascii = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            ascii.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                ascii += &format!("\\u{unit:04x}");
            }
        }
    }
    ascii
}

/// SHA-256 over the bits of every value: the same for the same picture, whatever
/// the file looks like.
pub fn pixel_hash(values: &[f32]) -> String {
    let mut sha = Sha256::new();
    for v in values {
        sha.update(v.to_bits().to_le_bytes());
    }
    hex(&sha.finalize())
}

/// The first twelve digits of a hash, which tell it from others to people.
pub fn short_hash(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// The sRGB code of linear light, 1 for white; what is brighter is white too.
pub fn srgb(v: f32) -> u8 {
    (code(v.clamp(0.0, 1.0)) * 255.0).round() as u8
}

/// The sRGB code, from 0 to 1, of linear light: the inverse of [`linear`].
pub fn code(light: f32) -> f32 {
    let v = light.abs();
    let code = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    code.copysign(light)
}

/// The linear light of an sRGB code from 0 to 1, by IEC 61966-2-1; beyond that range by
/// the same curve, of negative codes mirrored.
pub fn linear(code: f32) -> f32 {
    let v = code.abs();
    let linear = if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    linear.copysign(code)
}

/// Writes an 8-bit RGB PNG.
///
/// # Errors
/// Where the file cannot be written.
pub fn write_png(path: &Path, picture: &image::RgbImage) -> Result<(), DiskError> {
    write_whole(path, |buffer| {
        let mut bytes = io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).map_err(io::Error::other)?;
        io::Write::write_all(buffer, bytes.get_ref())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn sample() -> Layers {
        let mut layers = Layers::new([3, 2])
            .with("mean", vec![0.0, 0.25, 1.0, f32::NAN, -2.5, 1e-30])
            .with("variance", vec![0.5; 6]);
        layers.attributes.insert("reason".into(), "größer Ω → 🙂 \"ok\"\n".into());
        layers
    }

    #[test]
    fn what_is_written_is_read_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.exr");
        sample().write(&path).unwrap();
        let back = Layers::read(&path).unwrap();
        assert_eq!(back.resolution, [3, 2]);
        assert_eq!(back.attributes, sample().attributes);
        assert_eq!(pixel_hash(&back.layers["mean"]), pixel_hash(&sample().layers["mean"]));
        assert_eq!(fs::read_dir(folder.path().join("a")).unwrap().count(), 1, "no temporary file stays");
    }

    #[test]
    fn broken_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        sample().write(&path).unwrap();
        let whole = fs::read(&path).unwrap();
        for end in [0, 3, 40, whole.len() / 2, whole.len() - 1] {
            fs::write(&path, &whole[..end]).unwrap();
            assert!(Layers::read(&path).is_err(), "cut at {end}");
        }
        fs::write(&path, "version https://git-lfs.github.com/spec/v1\n").unwrap();
        assert!(Layers::read(&path).unwrap_err().to_string().contains("LFS"));
        assert!(Layers::read(&folder.path().join("none.exr")).unwrap_err().to_string().contains("none.exr"));
    }

    /// Images that lie, as whoever compares may meet them: the claim of one wraps to
    /// nothing in 64 bits.
    #[test]
    fn hostile_images_are_errors_here_too() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad-images");
        let images = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
        let mut tried = 0;
        for path in images.filter(|p| p.extension().is_some_and(|e| e == "exr")) {
            assert!(Layers::read(&path).is_err(), "{}", path.display());
            tried += 1;
        }
        assert!(tried > 8);
    }

    /// Every byte of the header, one by one, set to its extremes: an error or an
    /// image, never a panic.
    #[test]
    fn a_lying_header_does_not_panic() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        sample().write(&path).unwrap();
        let whole = fs::read(&path).unwrap();
        for i in 0..whole.len() {
            for value in [0u8, 0x7f, 0xff] {
                let mut bytes = whole.clone();
                bytes[i] = value;
                fs::write(&path, &bytes).unwrap();
                let _ = Layers::read(&path);
            }
        }
    }
}
