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

/// Called by the runner in order of run time. Every method does nothing by default.
pub trait RunObserver {
    /// The rig is armed.
    ///
    /// # Errors
    /// [`ObserverError`] ends the run in its safe state, here and below.
    fn on_start(&mut self, _rig: &RigDescription) -> Result<(), ObserverError> {
        Ok(())
    }

    /// A step begins; `marker.end_s` is its planned end.
    ///
    /// # Errors
    /// [`ObserverError`].
    fn on_step_start(&mut self, _marker: &StepMarker) -> Result<(), ObserverError> {
        Ok(())
    }

    /// New samples with the rig's own events; also called for warm-up and cool-down.
    ///
    /// # Errors
    /// [`ObserverError`].
    fn on_batch(&mut self, _batch: &SampleBatch) -> Result<(), ObserverError> {
        Ok(())
    }

    /// A message of the runner: a guard that tripped, a stop, the safe state.
    ///
    /// # Errors
    /// [`ObserverError`].
    fn on_event(&mut self, _event: &Event) -> Result<(), ObserverError> {
        Ok(())
    }

    /// A guard has cut the step short: it does not count.
    ///
    /// # Errors
    /// [`ObserverError`].
    fn on_step_abandoned(&mut self, _marker: &StepMarker) -> Result<(), ObserverError> {
        Ok(())
    }

    /// A step has ended; `marker.end_s` is its real end.
    ///
    /// # Errors
    /// [`ObserverError`].
    fn on_step_end(&mut self, _marker: &StepMarker) -> Result<(), ObserverError> {
        Ok(())
    }

    /// The step that has just ended was complete: neither a stop nor a fault cut it short.
    ///
    /// # Errors
    /// [`ObserverError`].
    fn on_step_completed(&mut self, _marker: &StepMarker) -> Result<(), ObserverError> {
        Ok(())
    }
}

/// Calls each observer in turn; the first error skips the remaining ones.
impl RunObserver for Vec<&mut dyn RunObserver> {
    fn on_start(&mut self, rig: &RigDescription) -> Result<(), ObserverError> {
        self.iter_mut().try_for_each(|observer| observer.on_start(rig))
    }

    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.iter_mut().try_for_each(|observer| observer.on_step_start(marker))
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        self.iter_mut().try_for_each(|observer| observer.on_batch(batch))
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.iter_mut().try_for_each(|observer| observer.on_event(event))
    }

    fn on_step_abandoned(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.iter_mut().try_for_each(|observer| observer.on_step_abandoned(marker))
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.iter_mut().try_for_each(|observer| observer.on_step_end(marker))
    }

    fn on_step_completed(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.iter_mut().try_for_each(|observer| observer.on_step_completed(marker))
    }
}
