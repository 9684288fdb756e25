//! The operator's requests during a run.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Maximum number of requests that wait to be recorded; further ones are dropped.
const WAITING_MAX: usize = 64;

/// Set from any thread; the run checks it after every batch of samples.
#[derive(Debug, Default)]
pub struct Operator {
    holds: AtomicBool,
    requests: Mutex<Vec<String>>,
}

impl Operator {
    /// Holds the current step until [`Operator::go_on`].
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

    /// Adds a sentence to the recording: the request and who made it.
    pub fn say(&self, sentence: String) {
        if let Ok(mut requests) = self.requests.lock()
            && requests.len() < WAITING_MAX
        {
            requests.push(sentence);
        }
    }

    /// The requests since the last call.
    pub(crate) fn take_messages(&self) -> Vec<String> {
        self.requests.lock().map(|mut requests| std::mem::take(&mut *requests)).unwrap_or_default()
    }
}
