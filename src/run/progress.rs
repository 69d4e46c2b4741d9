//! How far a run is.

use std::sync::{Mutex, PoisonError};

/// What a run tells about itself on the way.
pub trait Observer: Sync {
    /// `done` of `total` is done, and `what` comes next. The unit is the cost of
    /// [`Prepared::cost`](super::Prepared::cost), so that equal parts take about as long.
    /// Where a run goes on until it is sure, `total` grows.
    fn step(&self, done: u64, total: u64, what: &str);
}

/// Counts for an observer.
pub(super) struct Progress<'a> {
    observer: &'a dyn Observer,
    /// Done, and total.
    count: Mutex<[u64; 2]>,
}

impl<'a> Progress<'a> {
    pub fn new(observer: &'a dyn Observer, total: u64) -> Self {
        Progress { observer, count: Mutex::new([0, total]) }
    }

    pub fn begin(&self, what: &str) {
        let [done, total] = *self.count.lock().unwrap_or_else(PoisonError::into_inner);
        self.observer.step(done, total, what);
    }

    pub fn end(&self, cost: u64) {
        let mut count = self.count.lock().unwrap_or_else(PoisonError::into_inner);
        count[0] += cost;
        count[1] = count[1].max(count[0]);
    }
}
