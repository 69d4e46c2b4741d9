//! Ending early.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// Asks a run to end after the image it is at. Clones ask the same run.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Asks.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked for.
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Why a unit has no images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Halt {
    /// The run ends early; the unit may be finished later.
    Stopped,
    /// It failed, in one sentence.
    Failed(String),
}
