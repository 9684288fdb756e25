//! What a signal means for a run.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};

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

/// What a signal has led to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signalled {
    /// A flag that the run obeys.
    Raised,
    /// Nothing yet: the run goes on, and the user needs an answer.
    Answered,
    /// The process may end.
    Ends,
}

/// How a run is stopped.
#[derive(Debug, Clone)]
pub struct RunStop {
    /// At the end of the step: Ctrl-C once.
    pub after_step: Arc<AtomicBool>,
    /// Now: Ctrl-C twice, SIGTERM, SIGHUP. Nothing ends the process before the rig is safe.
    pub now: Arc<AtomicBool>,
    phase: Arc<AtomicU8>,
    /// Whether a signal was answered while results were made.
    answered: Arc<AtomicBool>,
}

impl Default for RunStop {
    fn default() -> Self {
        RunStop {
            after_step: Arc::default(),
            now: Arc::default(),
            phase: Arc::new(AtomicU8::new(Phase::Planning as u8)),
            answered: Arc::default(),
        }
    }
}

impl RunStop {
    /// The run has come to this.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::SeqCst);
    }

    /// A signal has come; `gentle`: the rig may finish its step first.
    pub fn signalled(&self, gentle: bool) -> Signalled {
        let phase = self.phase.load(Ordering::SeqCst);
        if phase == Phase::Rig as u8 {
            let again = self.after_step.swap(true, Ordering::SeqCst);
            if again || !gentle {
                self.now.store(true, Ordering::SeqCst);
            }
            Signalled::Raised
        } else if phase == Phase::Results as u8 && !self.answered.swap(true, Ordering::SeqCst) {
            Signalled::Answered
        } else {
            Signalled::Ends
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
            assert_eq!(stop.signalled(gentle), Signalled::Ends);
            stop.enter(Phase::Rig);
            for again in [false, true] {
                assert_eq!(stop.signalled(gentle), Signalled::Raised);
                assert!(stop.after_step.load(Ordering::SeqCst));
                assert_eq!(stop.now.load(Ordering::SeqCst), again || !gentle);
            }
            stop.enter(Phase::Results);
            assert_eq!(
                [stop.signalled(gentle), stop.signalled(gentle)],
                [Signalled::Answered, Signalled::Ends]
            );
        }
    }
}
