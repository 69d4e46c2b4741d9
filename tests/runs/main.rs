//! Runs from outside, and what is made of them: shards, ends, gates, goldens, reports.
//!
//! One program of several files: each program costs a link of the whole library.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod gates;
mod golden;
mod golden_assert;
mod printed;
mod report;
mod report_formats;
mod report_html;
mod review;
mod run;
mod run_ends;
mod run_folders;
mod shards;
mod until_sure;
