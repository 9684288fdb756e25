//! What every operation of a session shares.

use crate::event::OnEvent;
use crate::{Registry, SessionEvent};
use mapper_runner::Operator;
use std::sync::atomic::AtomicBool;

/// Plug-ins, somebody who looks on, and a way to stop.
#[derive(Clone, Copy)]
pub struct Session<'a> {
    /// The plug-ins.
    pub registry: &'a Registry,
    /// Called with everything that happens.
    pub on_event: OnEvent<'a>,
    /// Set from outside to stop at the next sample; the rig is brought into its safe state.
    pub stop: &'a AtomicBool,
    /// Set from outside to stop a run at the end of its step.
    pub stop_after_step: &'a AtomicBool,
    /// What the operator asks for during a run besides; `None`: nobody can.
    pub operator: Option<&'a Operator>,
    /// Whether each step of a run is identified by itself as soon as it has ended, for whoever looks on.
    pub estimates: bool,
}

/// Nobody stops a session that was opened without a flag.
static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Session<'a> {
    /// A session that nobody looks at and nobody stops.
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

    /// Tells whoever looks on.
    pub(crate) fn tell(&self, event: SessionEvent) {
        (self.on_event)(&event);
    }
}
