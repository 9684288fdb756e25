//! Who looks on while a campaign runs: the recorder, and whoever opened the session.

use crate::SessionEvent;
use crate::event::OnEvent;
use mapper_core::{Event, RigDescription, SampleBatch, StepMarker};
use mapper_record::{RecordError, RecordingWriter, StepPhase};
use mapper_runner::{ObserverError, RunObserver};

/// Writes everything into the run's recording.
pub(crate) struct Recorder {
    writer: RecordingWriter,
}

impl Recorder {
    pub(crate) fn new(writer: RecordingWriter) -> Self {
        Recorder { writer }
    }

    /// Ends the file.
    pub(crate) fn finish(self) -> Result<(), RecordError> {
        self.writer.finish()
    }
}

impl RunObserver for Recorder {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::Start).map_err(ObserverError::of)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        // The batch's own events are written with it.
        self.writer.write_batch(batch).map_err(ObserverError::of)
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.writer.write_event(event).map_err(ObserverError::of)
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::End).map_err(ObserverError::of)
    }
}

/// Passes on what the runner sees as events of the session.
pub(crate) struct Teller<'a> {
    pub on_event: OnEvent<'a>,
    /// Steps planned.
    pub steps: usize,
    /// Rig time planned, soak included, s.
    pub duration_s: f64,
}

impl RunObserver for Teller<'_> {
    fn on_start(&mut self, rig: &RigDescription) -> Result<(), ObserverError> {
        (self.on_event)(&SessionEvent::RunStarted {
            rig: rig.clone(),
            steps: self.steps,
            duration_s: self.duration_s,
        });
        Ok(())
    }

    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        (self.on_event)(&SessionEvent::StepStarted(*marker));
        Ok(())
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        if let Some(t_s) = batch.t_s.last() {
            (self.on_event)(&SessionEvent::RigTime { t_s: *t_s });
        }
        batch.events.iter().try_for_each(|event| self.on_event(event))
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        (self.on_event)(&SessionEvent::Told(event.clone()));
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        (self.on_event)(&SessionEvent::StepEnded(*marker));
        Ok(())
    }
}
