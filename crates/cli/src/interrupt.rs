//! Ctrl-C and its like: to stop in good order.

use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use crate::output::standard_output;
use mapper_session::{RunStop, Signalled};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that Ctrl-C raises. The second one ends the process at once: for commands that touch no rig.
pub fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = flag.clone();
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::SeqCst) {
            std::process::exit(Code::Interrupted as i32);
        }
    })
    .map_err(failed)?;
    Ok(flag)
}

/// Does what a signal asks of a run.
fn obey(stop: &RunStop, gentle: bool) {
    match stop.signalled(gentle) {
        Signalled::Raised => {}
        Signalled::Answered => standard_output::warn(
            "The rig is safe and the recording is whole; its results are being written. Ask again to end without them: `mapper \
             identify` makes them from the run's directory.\n",
        ),
        Signalled::Ends => std::process::exit(Code::Interrupted as i32),
    }
}

/// The flags that signals raise while a rig is run: every signal that would end or suspend the process and that can be caught.
/// Faults of the program itself (SIGSEGV and its like) cannot be.
#[cfg(unix)]
pub fn run_stop() -> Result<RunStop, Failure> {
    use signal_hook::consts::*;
    use signal_hook::iterator::Signals;
    let stop = RunStop::default();
    let raised = stop.clone();
    // SIGXFSZ: a limit of file sizes; the write then fails with an error.
    let ends = [
        SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGXCPU,
        SIGXFSZ, SIGABRT,
    ];
    let mut signals = Signals::new(ends.into_iter().chain([SIGTSTP])).map_err(failed)?;
    let watch = move || {
        signals.forever().for_each(|signal| match signal {
            SIGTSTP if raised.has_the_rig() => standard_output::warn(
                "A suspended program could not protect the rig: it goes on. Press Ctrl-C to stop the run.\n",
            ),
            // If it fails, the process just goes on.
            SIGTSTP => drop(signal_hook::low_level::emulate_default_handler(SIGTSTP)),
            _ => obey(&raised, signal == SIGINT),
        });
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(watch).map_err(failed)?;
    Ok(stop)
}

/// The flags that Ctrl-C raises while a rig is run.
#[cfg(not(unix))]
pub fn run_stop() -> Result<RunStop, Failure> {
    let stop = RunStop::default();
    let raised = stop.clone();
    ctrlc::set_handler(move || obey(&raised, true)).map_err(failed)?;
    Ok(stop)
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::new(Code::Failure, format!("failed to watch for Ctrl-C: {error}"))
}
