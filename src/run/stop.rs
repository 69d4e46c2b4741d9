//! Ending early.

use crate::render::RenderError;
use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::{Duration, Instant},
};

/// Asks a run to end: on the CPU within an image, elsewhere after the one it is at. Clones
/// ask the same run.
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

impl From<RenderError> for Halt {
    fn from(e: RenderError) -> Self {
        Halt::Failed(e.to_string())
    }
}

/// How long a unit may go on.
pub(super) struct Clock<'a> {
    pub stop: &'a Stop,
    /// When it began.
    pub start: Instant,
    /// How long it may take.
    pub limit: Option<Duration>,
}

impl Clock<'_> {
    /// Whether the unit may go on.
    pub fn may_go_on(&self) -> bool {
        !self.stop.is_asked() && self.limit.is_none_or(|limit| self.start.elapsed() <= limit)
    }

    /// Why it may not, with so many of so many `what` done.
    pub fn halt(&self, what: &str, done: u32, of: u32) -> Halt {
        match self.limit {
            Some(limit) if !self.stop.is_asked() => Halt::Failed(format!(
                "it took longer than {} s (--case-timeout): {done} of {of} {what} were done by then",
                limit.as_secs_f64()
            )),
            _ => Halt::Stopped,
        }
    }
}
