//! Ending an image before it is done.

use std::sync::atomic::{AtomicBool, Ordering};

/// Pixels between two questions; a power of two.
const PIXELS: usize = 32;

/// Samples of one pixel between two questions.
const SAMPLES: u32 = 256;

/// Asks now and then whether to go on. Once the answer is no, it is not asked again, and
/// all threads skip what is left of the image.
pub(crate) struct Patience<'a> {
    go_on: &'a (dyn Fn() -> bool + Sync),
    over: AtomicBool,
}

impl<'a> Patience<'a> {
    pub fn new(go_on: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Patience { go_on, over: AtomicBool::new(false) }
    }

    /// Whether a pixel is to be skipped. It asks at every 32nd.
    pub fn skips(&self, pixel: usize) -> bool {
        if pixel.is_multiple_of(PIXELS) {
            self.ask();
        }
        self.is_over()
    }

    /// Whether the samples of a pixel are to be left at that. It asks at every 256th.
    pub fn leaves(&self, sample: u32) -> bool {
        if sample % SAMPLES != SAMPLES - 1 {
            return false;
        }
        self.ask();
        self.is_over()
    }

    /// Whether something was skipped.
    pub fn is_over(&self) -> bool {
        self.over.load(Ordering::Relaxed)
    }

    fn ask(&self) {
        if !self.is_over() && !(self.go_on)() {
            self.over.store(true, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicU32;

    #[test]
    fn after_one_no_all_is_skipped_and_nobody_asked() {
        let asked = AtomicU32::new(0);
        let go_on = || asked.fetch_add(1, Ordering::Relaxed) < 2;
        let patience = Patience::new(&go_on);
        assert!(!patience.skips(0) && !patience.skips(31) && !patience.leaves(254) && !patience.skips(32));
        assert_eq!(asked.load(Ordering::Relaxed), 2);
        assert!(!patience.is_over() && patience.leaves(255) && patience.is_over());
        assert!(patience.skips(33) && patience.skips(64));
        assert_eq!(asked.load(Ordering::Relaxed), 3);
    }
}
