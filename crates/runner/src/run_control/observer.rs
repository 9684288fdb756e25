//! Observers of a run: recorders, progress bars.

use mapper_core::{Event, RigDescription, SampleBatch, StepMarker};

/// Failure of an observer; the run ends in its safe state.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct ObserverError {
    /// The observer's own error: the failure and its remedy.
    source: Box<dyn std::error::Error + Send + Sync>,
}

impl ObserverError {
    /// Wraps the observer's own error.
    pub fn new(error: impl std::error::Error + Send + Sync + 'static) -> Self {
        ObserverError { source: Box::new(error) }
    }
}

/// Declares [`RunObserver`], and a list of observers as one observer.
macro_rules! run_observer {
    ($($(#[$doc:meta])+ $method:ident($news:ty);)+) => {
        /// Called by the runner in order of run time. Every method does nothing by default.
        pub trait RunObserver {
            $(
                $(#[$doc])+
                ///
                /// # Errors
                /// [`ObserverError`] ends the run in its safe state.
                fn $method(&mut self, _news: &$news) -> Result<(), ObserverError> {
                    Ok(())
                }
            )+
        }

        /// Calls each observer in turn; the first error skips the remaining ones.
        impl RunObserver for Vec<&mut dyn RunObserver> {
            $(
                fn $method(&mut self, news: &$news) -> Result<(), ObserverError> {
                    self.iter_mut().try_for_each(|observer| observer.$method(news))
                }
            )+
        }
    };
}

run_observer! {
    /// The rig is armed.
    on_start(RigDescription);
    /// A step begins; `end_s` of its marker is its planned end.
    on_step_start(StepMarker);
    /// New samples with the rig's own events; also called for warm-up and cool-down.
    on_batch(SampleBatch);
    /// A message of the runner: a guard that tripped, a stop, the safe state.
    on_event(Event);
    /// A guard has cut the step short: it does not count.
    on_step_abandoned(StepMarker);
    /// A step has ended; `end_s` of its marker is its real end.
    on_step_end(StepMarker);
    /// The step that has just ended was complete: neither a stop nor a fault cut it short.
    on_step_completed(StepMarker);
}
