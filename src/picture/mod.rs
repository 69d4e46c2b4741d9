//! From light to a picture for the eye: exposure, tone mapping, several pictures side
//! by side in one, and errors as colours with their scale; and back: pictures read as
//! numbers.

pub mod channel;
pub mod color_bar;
pub mod error_map;
pub mod lettering;
pub mod read;
mod read_exr;
mod read_jpeg;
mod read_png;
mod read_tiff;
pub mod scale;
pub mod side_by_side;
pub mod split;
mod tiff_lists;
pub mod tone;
