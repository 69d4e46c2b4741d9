//! What a user meets of each command but `run`: exit codes, messages, files.
//!
//! One program of several files: each program costs a link of the whole library.

#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod bench;
mod cli;
mod compare;
mod compare_channels;
mod compare_folders;
mod compare_records;
mod composite;
mod external;
mod flatland;
mod hostile_images;
mod init;
mod render;
mod scale;
mod score;
