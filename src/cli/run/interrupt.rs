//! Ctrl-C, and the signals that schedulers end a job with.

use crate::{
    cli::{Exit, tell},
    run::Stop,
};

/// The first one ends the run in good order, the second at once. What is done is kept either
/// way.
pub(in crate::cli) fn listen(stop: &Stop) {
    let stop = stop.clone();
    let handler = move || {
        if stop.is_asked() {
            std::process::exit(Exit::Incomplete as i32);
        }
        stop.ask();
        tell("aogauge: ending; press Ctrl-C again to end at once");
    };
    // Also where Ctrl-C was ignored: scripts start programs in the background that way, and
    // must be able to end them. In one process only the first run can listen; without it
    // Ctrl-C kills, and what is done is kept on disk anyway.
    let set = || drop(ctrlc::set_handler(handler));
    #[cfg(unix)]
    keep_ignoring_hang_ups(set);
    #[cfg(not(unix))]
    set();
}

/// Who says `nohup` wants no end at a hang-up.
#[cfg(unix)]
fn keep_ignoring_hang_ups(set: impl FnOnce()) {
    use nix::sys::signal::{SigHandler, Signal, signal};
    // SAFETY: to ignore a signal installs no code that could run in it.
    let before = unsafe { signal(Signal::SIGHUP, SigHandler::SigIgn) };
    set();
    if matches!(before, Ok(SigHandler::SigIgn)) {
        // SAFETY: as above.
        let _ = unsafe { signal(Signal::SIGHUP, SigHandler::SigIgn) };
    }
}
