//! Channels as they are stored, each by its name: what the pixel-exact metric compares.

/// The numbers of a channel, row by row from the top left.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers {
    /// Floats; of 16 bits as 32, which changes no value.
    Float(Vec<f32>),
    /// Unsigned integers of 32 bits, which floats could not tell apart above 2^24.
    Unsigned(Vec<u32>),
}

impl Numbers {
    /// How many there are.
    pub fn count(&self) -> usize {
        match self {
            Numbers::Float(v) => v.len(),
            Numbers::Unsigned(v) => v.len(),
        }
    }

    /// One of them, exactly; NaN beyond the end.
    pub fn at(&self, pixel: usize) -> f64 {
        match self {
            Numbers::Float(v) => v.get(pixel).map_or(f64::NAN, |&v| v.into()),
            Numbers::Unsigned(v) => v.get(pixel).map_or(f64::NAN, |&v| v.into()),
        }
    }

    /// As floats of 32 bits; integers above 2^24 are rounded.
    pub fn into_floats(self) -> Vec<f32> {
        match self {
            Numbers::Float(v) => v,
            Numbers::Unsigned(v) => v.into_iter().map(|v| v as f32).collect(),
        }
    }

    /// Whether all are 1.
    pub(super) fn are_one(&self) -> bool {
        match self {
            Numbers::Float(v) => v.iter().all(|&v| v == 1.0),
            Numbers::Unsigned(v) => v.iter().all(|&v| v == 1),
        }
    }
}

/// A channel of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name: of an OpenEXR file with several parts with the part's before it.
    pub name: String,
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Where its pixels begin: the corner of an OpenEXR data window, else 0, 0.
    pub origin: [i32; 2],
    /// Its numbers.
    pub numbers: Numbers,
}

/// Channels that belong together: a layer, or a whole file.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// What it is called; nothing of a whole file.
    pub layer: String,
    /// Its channels, in the order of their names; of one layer named R, G and B, or Y.
    pub channels: Vec<Channel>,
}
