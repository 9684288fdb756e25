//! Common data of all session operations.

use crate::event::OnEvent;
use crate::{Registry, SessionEvent};
use mapper_runner::Operator;
use std::sync::atomic::AtomicBool;

/// Plug-ins, an observer and stop flags.
#[derive(Clone, Copy)]
pub struct Session<'a> {
    /// The plug-ins.
    pub registry: &'a Registry,
    /// Called with every event.
    pub on_event: OnEvent<'a>,
    /// Set by the caller to stop at the next sample; the rig then goes to its safe state.
    pub stop: &'a AtomicBool,
    /// Set by the caller to stop a run at the end of its step.
    pub stop_after_step: &'a AtomicBool,
    /// Other operator requests during a run; `None` without an operator.
    pub operator: Option<&'a Operator>,
    /// Whether each step is identified separately as soon as it ends, for observers.
    pub estimates: bool,
}

/// Stop flag of a session that is never stopped.
static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Session<'a> {
    /// A session without observer and stop flag.
    pub fn new(registry: &'a Registry) -> Self {
        Session {
            registry,
            on_event: &|_| {},
            stop: &NEVER,
            stop_after_step: &NEVER,
            operator: None,
            estimates: false,
        }
    }

    /// Sends an event to the observer.
    pub(crate) fn send(&self, event: SessionEvent) {
        (self.on_event)(&event);
    }
}
