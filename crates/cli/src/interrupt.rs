//! Ctrl-C and its like: to stop in good order.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::output;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

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

/// What a run is about: a signal means something else in each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// Nothing has been touched: a signal ends the process.
    Planning,
    /// The rig is in use: nothing ends the process before it is safe.
    Rig,
    /// The rig is safe and the recording whole: the first signal is answered, the second ends the process.
    Results,
}

/// How a run is stopped.
#[derive(Debug, Clone, Default)]
pub struct RunStop {
    /// At the end of the step: Ctrl-C once.
    pub after_step: Arc<AtomicBool>,
    /// Now: Ctrl-C twice, SIGTERM, SIGHUP. Nothing ends the process before the rig is safe.
    pub now: Arc<AtomicBool>,
    phase: Arc<AtomicU8>,
    /// Whether a signal was answered while results were made.
    answered: Arc<AtomicBool>,
}

impl RunStop {
    /// The run has come to this.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::SeqCst);
    }

    /// A signal has come; `gentle`: the rig may finish its step first.
    fn signalled(&self, gentle: bool) {
        let phase = self.phase.load(Ordering::SeqCst);
        if phase == Phase::Rig as u8 {
            let again = self.after_step.swap(true, Ordering::SeqCst);
            if again || !gentle {
                self.now.store(true, Ordering::SeqCst);
            }
        } else if phase == Phase::Results as u8 && !self.answered.swap(true, Ordering::SeqCst) {
            output::warn(
                "The rig is safe and the recording is whole; its results are being written. Ask again to end without them: `mapper \
                 identify` makes them from the run's directory.\n",
            );
        } else {
            std::process::exit(Code::Interrupted as i32);
        }
    }
}

/// The flags that signals raise while a rig is run.
#[cfg(unix)]
pub fn run_stop() -> Result<RunStop, Failure> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    let stop = RunStop::default();
    stop.enter(Phase::Planning);
    let raised = stop.clone();
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(failed)?;
    let watch = move || signals.forever().for_each(|signal| raised.signalled(signal == SIGINT));
    std::thread::Builder::new().name("signals".to_owned()).spawn(watch).map_err(failed)?;
    Ok(stop)
}

/// The flags that Ctrl-C raises while a rig is run.
#[cfg(not(unix))]
pub fn run_stop() -> Result<RunStop, Failure> {
    let stop = RunStop::default();
    stop.enter(Phase::Planning);
    let raised = stop.clone();
    ctrlc::set_handler(move || raised.signalled(true)).map_err(failed)?;
    Ok(stop)
}

fn failed(error: impl std::fmt::Display) -> Failure {
    Failure::new(Code::Failure, format!("failed to watch for Ctrl-C: {error}"))
}
