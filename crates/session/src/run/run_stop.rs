//! Reaction of a run to signals.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

/// Phase of a run; it determines the reaction to a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// No file or rig is in use: a signal ends the process.
    Planning,
    /// The rig is in use: nothing ends the process before it is safe.
    Rig,
    /// The rig is safe and the recording complete: the first signal gets a message, the second ends the process.
    Results,
}

/// Reaction to a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SignalResponse {
    /// A stop flag for the run was set.
    StopRequested,
    /// The results are still being written; the user gets a message.
    Deferred,
    /// The process may exit.
    MayExit,
}

/// Stop flags of a run.
#[derive(Debug, Clone, Default)]
pub struct RunStop {
    /// Stop at the end of the step: Ctrl-C once.
    pub after_step: Arc<AtomicBool>,
    /// Stop now: Ctrl-C twice, SIGTERM and other signals. Nothing ends the process before the rig is safe.
    pub now: Arc<AtomicBool>,
    /// A [`Phase`]; first [`Phase::Planning`].
    phase: Arc<AtomicU8>,
    /// Whether a signal has already arrived while results are written.
    deferred: Arc<AtomicBool>,
}

impl RunStop {
    /// Enters a phase.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::SeqCst);
    }

    /// Whether the rig is in use, so that the process must not be suspended.
    pub fn uses_rig(&self) -> bool {
        self.phase.load(Ordering::SeqCst) == Phase::Rig as u8
    }

    /// Handles a signal; `gentle`: the rig may finish its step first.
    pub fn handle_signal(&self, gentle: bool) -> SignalResponse {
        let phase = self.phase.load(Ordering::SeqCst);
        if phase == Phase::Rig as u8 {
            let is_second = self.after_step.swap(true, Ordering::SeqCst);
            if is_second || !gentle {
                self.now.store(true, Ordering::SeqCst);
            }
            SignalResponse::StopRequested
        } else if phase == Phase::Results as u8 && !self.deferred.swap(true, Ordering::SeqCst) {
            SignalResponse::Deferred
        } else {
            SignalResponse::MayExit
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_ends_the_process_while_the_rig_is_in_use() {
        for gentle in [true, false] {
            let stop = RunStop::default();
            assert_eq!(stop.handle_signal(gentle), SignalResponse::MayExit);
            stop.enter(Phase::Rig);
            for is_second in [false, true] {
                assert_eq!(stop.handle_signal(gentle), SignalResponse::StopRequested);
                assert!(stop.after_step.load(Ordering::SeqCst));
                assert_eq!(stop.now.load(Ordering::SeqCst), is_second || !gentle);
            }
            stop.enter(Phase::Results);
            assert_eq!(
                [stop.handle_signal(gentle), stop.handle_signal(gentle)],
                [SignalResponse::Deferred, SignalResponse::MayExit]
            );
        }
    }
}
