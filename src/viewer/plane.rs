//! Images as text that a page can decode: the bytes of little-endian 32-bit floats,
//! all first bytes before all second ones and so on, as zlib data in base64.

use base64::{Engine, engine::general_purpose::STANDARD};
use flate2::{Compression, write::ZlibEncoder};
use serde::Serialize;
use std::{collections::HashMap, io::Write};

/// How much of a number is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Every bit.
    Exact,
    /// 11 bits of the mantissa, three digits: for maps that nobody computes with.
    Rounded,
}

/// An image as it stands on the page.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Plane {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// The numbers as text; it stands in an element of its own, so that it is decoded
    /// only when it is looked at.
    #[serde(skip)]
    pub text: String,
}

/// An image by its place among all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(transparent)]
pub struct PlaneId(usize);

/// All images of a page; one that comes twice is kept once.
#[derive(Debug, Default)]
pub struct Planes {
    all: Vec<Plane>,
    by_text: HashMap<String, usize>,
}

impl Planes {
    /// Keeps an image, row by row from the top left, NaN where there is no number.
    pub fn add(&mut self, resolution: [u32; 2], values: &[f32], detail: Detail) -> PlaneId {
        let [width, height] = resolution;
        let plane = Plane { width, height, text: encode(values, detail) };
        let next = self.all.len();
        let place = *self.by_text.entry(format!("{width} {}", plane.text)).or_insert(next);
        if place == next {
            self.all.push(plane);
        }
        PlaneId(place)
    }

    /// All, in the order of their ids.
    pub fn all(&self) -> &[Plane] {
        &self.all
    }
}

fn encode(values: &[f32], detail: Detail) -> String {
    let bits = |v: &f32| match detail {
        _ if v.is_nan() => f32::NAN.to_bits(),
        Detail::Exact => v.to_bits(),
        Detail::Rounded if !v.is_finite() => v.to_bits(),
        // Half of the last kept bit, so that it rounds to the nearest.
        Detail::Rounded => v.to_bits().saturating_add(1 << 11) & !0xfff,
    };
    let mut bytes = Vec::with_capacity(values.len() * 4);
    for byte in 0..4 {
        bytes.extend(values.iter().map(|v| bits(v).to_le_bytes()[byte]));
    }
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
    // A vector takes whatever is written to it.
    let packed = packed.write_all(&bytes).and_then(|()| packed.finish()).unwrap_or_default();
    STANDARD.encode(packed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::ZlibDecoder;
    use std::io::Read;

    fn decode(text: &str) -> Vec<f32> {
        let mut bytes = Vec::new();
        ZlibDecoder::new(STANDARD.decode(text).unwrap().as_slice()).read_to_end(&mut bytes).unwrap();
        let n = bytes.len() / 4;
        (0..n).map(|i| f32::from_le_bytes([0, 1, 2, 3].map(|b| bytes[b * n + i]))).collect()
    }

    #[test]
    fn numbers_come_back() {
        let values = [0.0, 0.1, 1.0, -3.25, 1e-30, f32::INFINITY, f32::NAN];
        let exact = decode(&encode(&values, Detail::Exact));
        assert_eq!(exact[..6], values[..6]);
        assert!(exact[6].is_nan());
        for (rounded, value) in decode(&encode(&values, Detail::Rounded)).iter().zip(&values) {
            assert!(rounded.is_nan() == value.is_nan());
            assert!(!value.is_finite() || (rounded - value).abs() <= value.abs() / 4096.0, "{rounded} {value}");
        }
        assert!(decode(&encode(&[f32::MAX], Detail::Rounded))[0] > 3e38);
    }

    #[test]
    fn equal_images_are_kept_once() {
        let mut planes = Planes::default();
        let a = planes.add([2, 1], &[0.0, 1.0], Detail::Exact);
        let b = planes.add([2, 1], &[0.0, 1.5], Detail::Exact);
        assert_eq!(planes.add([2, 1], &[0.0, 1.0], Detail::Exact), a);
        assert_ne!(planes.add([1, 2], &[0.0, 1.0], Detail::Exact), a);
        assert_ne!(a, b);
        assert_eq!(planes.all().len(), 3);
    }
}
