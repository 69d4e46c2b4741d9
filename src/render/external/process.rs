//! A command as a process with all that it starts: they end together.

use super::capture::{Capped, Stream};
use std::{
    io,
    process::{Child, Command, ExitStatus, Stdio},
    thread,
    time::{Duration, Instant},
};

/// Of each stream, so many bytes are kept of its beginning and of its end.
const MOST: usize = 256 << 10;

/// A command that is asked to end has so long to do it in good order.
const GRACE: Duration = Duration::from_secs(1);

/// What is said after the end is waited for so long.
const PATIENCE: Duration = Duration::from_secs(2);

/// How a command ended.
#[derive(Clone, Copy, Debug)]
pub(super) enum End {
    /// By itself.
    Exited(ExitStatus),
    /// It was ended after the time it had.
    TimedOut,
    /// It was ended because who started it was asked to stop.
    Asked,
}

/// What came of a command.
pub(super) struct Ran {
    pub end: End,
    pub stdout: Capped,
    pub stderr: Capped,
    pub seconds: f64,
}

/// Runs a command without input, for so long at most, and while `go_on` says so. When this
/// returns, what it started has ended too, but for what left its process group.
///
/// # Errors
/// Where it cannot be started.
pub(super) fn run(command: &mut Command, limit: Duration, go_on: &dyn Fn() -> bool) -> io::Result<Ran> {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    apart(command);
    let start = Instant::now();
    let mut child = command.spawn()?;
    let streams = listen(&mut child);
    let end = match &streams {
        Ok(_) => watch(&mut child, start, limit, go_on),
        Err(_) => Ok(End::Asked),
    };
    if !matches!(end, Ok(End::Exited(_))) {
        ask(&child);
        let until = Instant::now() + GRACE;
        while Instant::now() < until && matches!(child.try_wait(), Ok(None)) {
            thread::sleep(Duration::from_millis(5));
        }
    }
    // Also after an end in good order: what it left running would go on for ever.
    kill(&mut child);
    child.wait()?;
    let seconds = start.elapsed().as_secs_f64();
    let [stdout, stderr] = streams?.map(|s| s.heard(PATIENCE));
    Ok(Ran { end: end?, stdout, stderr, seconds })
}

fn listen(child: &mut Child) -> io::Result<[Stream; 2]> {
    let none = || io::Error::other("its output is not there");
    let stdout = Stream::listen(child.stdout.take().ok_or_else(none)?, MOST)?;
    Ok([stdout, Stream::listen(child.stderr.take().ok_or_else(none)?, MOST)?])
}

fn watch(child: &mut Child, start: Instant, limit: Duration, go_on: &dyn Fn() -> bool) -> io::Result<End> {
    let mut pause = Duration::from_millis(1);
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(End::Exited(status));
        }
        if start.elapsed() >= limit {
            return Ok(End::TimedOut);
        }
        if !go_on() {
            return Ok(End::Asked);
        }
        thread::sleep(pause);
        pause = (pause * 2).min(Duration::from_millis(20));
    }
}

/// In a process group of its own: it can be ended whole, and Ctrl-C on the terminal does
/// not reach it before us.
#[cfg(unix)]
fn apart(command: &mut Command) {
    std::os::unix::process::CommandExt::process_group(command, 0);
}

#[cfg(windows)]
fn apart(command: &mut Command) {
    const CREATE_NEW_PROCESS_GROUP: u32 = 0x200;
    std::os::windows::process::CommandExt::creation_flags(command, CREATE_NEW_PROCESS_GROUP);
}

#[cfg(not(any(unix, windows)))]
fn apart(_: &mut Command) {}

/// Signals the group. While one of it is there, its number is given to nobody else.
#[cfg(unix)]
fn signal(child: &Child, signal: nix::sys::signal::Signal) {
    if let Ok(group) = i32::try_from(child.id()) {
        // Where the whole group has ended there is nobody to tell.
        let _ = nix::sys::signal::killpg(nix::unistd::Pid::from_raw(group), signal);
    }
}

/// Asks it to end.
#[cfg(unix)]
fn ask(child: &Child) {
    signal(child, nix::sys::signal::Signal::SIGTERM);
}

#[cfg(not(unix))]
fn ask(_: &Child) {}

/// Ends it.
#[cfg(unix)]
fn kill(child: &mut Child) {
    signal(child, nix::sys::signal::Signal::SIGKILL);
}

/// Ends it with all that it started and that has not lost its parent.
#[cfg(windows)]
fn kill(child: &mut Child) {
    if matches!(child.try_wait(), Ok(None)) {
        let mut tree = Command::new("taskkill");
        tree.args(["/T", "/F", "/PID", &child.id().to_string()]);
        let _ = tree.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
        let _ = child.kill();
    }
}

#[cfg(not(any(unix, windows)))]
fn kill(child: &mut Child) {
    let _ = child.kill();
}
