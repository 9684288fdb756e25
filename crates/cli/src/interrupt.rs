//! Handles Ctrl-C and other signals, so that a run stops safely.

use crate::output::failure::{Code, Failure};
use crate::output::standard_output;
use mapper_session::{RunStop, SignalResponse};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that Ctrl-C sets. A second Ctrl-C ends the process at once. For commands that do not use a rig.
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

/// Ctrl-C ends the process at once, with its exit code: for work that uses no rig and writes whole files.
pub fn end_at_once() -> Result<(), Failure> {
    let end = || {
        standard_output::say("\nstopped by the operator\n");
        std::process::exit(Code::Interrupted as i32)
    };
    ctrlc::set_handler(end).map_err(failed)
}

fn handle_signal(stop: &RunStop, gentle: bool) {
    match stop.handle_signal(gentle) {
        SignalResponse::StopRequested => {}
        SignalResponse::Deferred => standard_output::say(
            "The rig is safe and the recording is complete; its results are being written. Press Ctrl-C again to end without them; `mapper \
             identify` makes them later from the run directory.\n",
        ),
        SignalResponse::MayExit => {
            standard_output::say("stopped by the operator\n");
            std::process::exit(Code::Interrupted as i32)
        }
    }
}

/// Least address space of a run, bytes. Bound: the stack of a script, and twice what a run of four points needs.
#[cfg(unix)]
const RUN_MIN_BYTES: u64 = 512 << 20;

#[cfg(unix)]
static MEMORY_HANDLER: std::sync::OnceLock<signal_hook::SigId> = std::sync::OnceLock::new();

/// Ends the process as a failure, not as a crash, if the system refuses memory; the library has printed that then.
#[cfg(unix)]
pub fn end_without_memory() {
    use signal_hook::{consts::SIGABRT, flag::register_conditional_shutdown};
    let handler =
        register_conditional_shutdown(SIGABRT, Code::Failure as i32, Arc::new(AtomicBool::new(true)));
    // Without the handler, the end is a crash.
    let _ = handler.map(|handler| MEMORY_HANDLER.set(handler));
}

#[cfg(not(unix))]
pub fn end_without_memory() {}

/// The flags that signals raise while a rig is run: every signal that would end or suspend the process and that can be caught.
/// Faults of the program itself (SIGSEGV and its like) cannot be.
#[cfg(unix)]
pub fn run_stop() -> Result<RunStop, Failure> {
    use nix::sys::resource::{Resource, getrlimit};
    use nix::sys::signal::{SigSet, Signal};
    use signal_hook::consts::*;
    use signal_hook::iterator::Signals;
    let (allowed_bytes, _) = getrlimit(Resource::RLIMIT_AS).map_err(failed)?;
    if allowed_bytes < RUN_MIN_BYTES {
        let (allowed, needed) = (allowed_bytes >> 20, RUN_MIN_BYTES >> 20);
        let message =
            format!("a run needs {needed} MiB of memory, and the limit is {allowed} MiB (`ulimit -v`)");
        return Err(Failure::new(Code::Failure, message));
    }
    // During a run the same signal makes the rig safe.
    if let Some(handler) = MEMORY_HANDLER.get() {
        signal_hook::low_level::unregister(*handler);
    }
    let stop = RunStop::default();
    let raised = stop.clone();
    let ends = [
        SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGXCPU,
        SIGXFSZ, SIGABRT, SIGSYS, SIGTRAP,
    ];
    // A background job that prints to a terminal with `stty tostop` would be suspended. Blocked, the signal lets the text through;
    // the threads started below inherit this.
    let mut suspends = SigSet::empty();
    suspends.add(Signal::SIGTTOU);
    suspends.add(Signal::SIGTTIN);
    suspends.thread_block().map_err(failed)?;
    let mut signals =
        Signals::new(ends.into_iter().chain(more_signals()).chain([SIGTSTP])).map_err(failed)?;
    let watch = move || {
        signals.forever().for_each(|signal| match signal {
            SIGTSTP if raised.uses_rig() => standard_output::say(
                "The run continues, because a suspended program could not protect the rig. Press Ctrl-C to stop the run.\n",
            ),
            // The write that reached the limit has failed and reports it.
            SIGXFSZ if !raised.uses_rig() => {}
            // If this fails, the process continues.
            SIGTSTP => drop(signal_hook::low_level::emulate_default_handler(SIGTSTP)),
            _ => handle_signal(&raised, signal == SIGINT),
        });
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(watch).map_err(failed)?;
    Ok(stop)
}

/// Further signals that would end the process and that only Linux has.
#[cfg(unix)]
fn more_signals() -> Vec<i32> {
    #[cfg(target_os = "linux")]
    {
        use nix::libc::{SIGPWR, SIGRTMAX, SIGRTMIN, SIGSTKFLT};
        (SIGRTMIN()..=SIGRTMAX()).chain([SIGPWR, SIGSTKFLT]).collect()
    }
    #[cfg(not(target_os = "linux"))]
    Vec::new()
}

#[cfg(not(unix))]
pub fn run_stop() -> Result<RunStop, Failure> {
    let stop = RunStop::default();
    let raised = stop.clone();
    ctrlc::set_handler(move || handle_signal(&raised, true)).map_err(failed)?;
    Ok(stop)
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::new(Code::Failure, format!("failed to install a handler for Ctrl-C: {error}"))
}
