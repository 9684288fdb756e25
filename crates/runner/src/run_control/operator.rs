//! The operator's requests during a run.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Maximum number of requests that wait to be recorded; further ones are dropped.
const MAX_WAITING: usize = 64;

/// Requests of the operator, from any thread. The run reads them after every batch of samples.
#[derive(Debug, Default)]
pub struct Operator {
    is_held: AtomicBool,
    requests: Mutex<Vec<String>>,
}

impl Operator {
    /// Holds the current step until [`Operator::release`].
    pub fn hold(&self) {
        self.is_held.store(true, Ordering::SeqCst);
    }

    /// Releases a held step.
    pub fn release(&self) {
        self.is_held.store(false, Ordering::SeqCst);
    }

    /// Whether the step is held.
    pub fn is_holding(&self) -> bool {
        self.is_held.load(Ordering::SeqCst)
    }

    /// Adds a sentence to the recording: the request and who made it.
    pub fn add_message(&self, sentence: String) {
        if let Ok(mut requests) = self.requests.lock()
            && requests.len() < MAX_WAITING
        {
            requests.push(sentence);
        }
    }

    /// The requests since the last call.
    pub(crate) fn take_messages(&self) -> Vec<String> {
        self.requests.lock().map(|mut requests| std::mem::take(&mut *requests)).unwrap_or_default()
    }
}
