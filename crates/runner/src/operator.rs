//! What the operator asks for while a run goes on.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Sentences that wait to be recorded; whoever asks more often than the run looks is not heard.
const WAITING_MAX: usize = 64;

/// Asked from any thread, looked at by the run after every batch of samples.
#[derive(Debug, Default)]
pub struct Operator {
    holds: AtomicBool,
    said: Mutex<Vec<String>>,
}

impl Operator {
    /// Stays at the step that is under way until [`Operator::go_on`].
    pub fn hold(&self) {
        self.holds.store(true, Ordering::SeqCst);
    }

    /// Lets the step end.
    pub fn go_on(&self) {
        self.holds.store(false, Ordering::SeqCst);
    }

    /// Whether the step is held.
    pub fn holds(&self) -> bool {
        self.holds.load(Ordering::SeqCst)
    }

    /// Something for the recording: what was asked for, and by whom.
    pub fn say(&self, sentence: String) {
        if let Ok(mut said) = self.said.lock()
            && said.len() < WAITING_MAX
        {
            said.push(sentence);
        }
    }

    /// What was said since the last call.
    pub(crate) fn take_said(&self) -> Vec<String> {
        self.said.lock().map(|mut said| std::mem::take(&mut *said)).unwrap_or_default()
    }
}
