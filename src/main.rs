//! The aogauge program: parse, dispatch, exit code.

use aogauge::cli::{Cli, Exit};
use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_mesa();
    let exit = match Cli::parse().execute() {
        Ok(exit) => exit,
        Err(failure) => {
            #[allow(clippy::print_stderr)] // errors are for people
            {
                eprintln!("aogauge: {failure}");
            }
            failure.exit
        }
    };
    ExitCode::from(exit as u8)
}

// clap exits with 2 on wrong usage by itself.
const _: () = assert!(Exit::Usage as u8 == 2);

/// Mesa's device-select layer looks for a desktop and prints an error where there
/// is none; aogauge picks its adapter itself and opens no window.
fn quiet_mesa() {
    if std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: the first thing main does, so no other thread can be reading or
        // writing the environment. Tested by `tests/commands/cli.rs`, which runs the
        // program and finds standard error free of it.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}
