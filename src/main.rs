//! The aogauge program: parse, dispatch, exit code.

use aogauge::cli::{Cli, Exit};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let exit = match Cli::parse().execute() {
        Ok(exit) => exit,
        Err(failure) => {
            #[allow(clippy::print_stderr)] // errors are for people
            {
                eprintln!("aogauge: {}", failure.message);
            }
            failure.exit
        }
    };
    ExitCode::from(exit as u8)
}

// clap exits with 2 on wrong usage by itself.
const _: () = assert!(Exit::Usage as u8 == 2);
