//! Goldens: accepted images, and what may differ from them.
//!
//! A [`Store`] keeps one golden a scene, estimator and ray count, or several where
//! devices differ. Each is an OpenEXR file with mean, variance over replicates and
//! region masks; its attributes say what it is an image of ([`Identity`]), where it
//! comes from ([`Provenance`]) and why it was accepted. Reading a record is all that
//! approving and verifying do: nothing here renders.
//!
//! [`assert_golden`] is the same for anybody's `#[test]`. docs/goldens.md tells how to
//! work with both.

mod approve;
mod artifact;
mod assert;
mod change;
mod compare;
mod file;
mod limits;
mod picture;
mod prune;
mod rays;
mod rejected;
mod sampled;
mod stale;
mod store;
mod verify;
mod wording;

pub use approve::{Approval, ApproveError, Approved, Selection, sampled};
pub use artifact::Candidates;
pub use assert::{CI_VARIABLES, GoldenError, Goldens, Held, assert_golden, check_golden};
pub use change::{Change, Notice};
pub use compare::{Comparison, MUST_SEE, Method, Moved, RegionShift, Seen, Terms, compare};
pub use file::{Golden, Identity, Provenance, regions};
pub use image::RgbImage;
pub use limits::{Limits, Measured};
pub use picture::{Picture, Tolerance};
pub use prune::{named_by_record, named_by_suite};
pub use rejected::Rejected;
pub use sampled::{Sampled, TileMeans};
pub use stale::{STALE_LEVEL, Stale};
pub use store::{About, Entry, Slot, Snapshot, Store, check_golden_name, golden_cases};
pub use verify::{ALPHA, Against, Checked, Outcome, Unreadable, VERSION, Verdict, Verification};

#[cfg(test)]
mod tests;
