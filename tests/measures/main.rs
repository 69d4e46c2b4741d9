//! Metrics and statistics against other programs, and how often they err.
//!
//! One program of several files: each program costs a link of the whole library.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod golden_statistics;
mod python_metrics;
mod python_statistics;
mod statistics;
