//! glTF: what is written and read back, what it may say, and what ends in an error.

#![allow(clippy::unwrap_used, clippy::panic, reason = "the helpers of tests are tests, too")]

mod bad;
mod builder;
mod import;
mod oracle;
mod round_trip;
