//! From light to a picture for the eye: exposure, tone mapping, and several
//! pictures side by side in one.

pub mod lettering;
pub mod read;
pub mod split;
pub mod tone;
