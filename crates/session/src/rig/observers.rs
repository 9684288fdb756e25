//! Observers of a running campaign: the recorder, and the forwarder to the session's own observer.

use crate::SessionEvent;
use crate::event::OnEvent;
use crate::recording::journal::{Entry, Journal};
use mapper_core::{Event, EventKind, RigDescription, RunEnding, SampleBatch, StepMarker};
use mapper_recording::{RecordError, RecordingWriter, StepPhase};
use mapper_runner::{ObserverError, RunObserver};
use std::fs::File;

/// Writes everything to the recording, and the safely recorded steps to the journal.
pub(crate) struct Recorder {
    writer: RecordingWriter,
    journal: Option<Journal>,
    /// Entries whose data may not be flushed yet, with the flushed sample time at that moment, s.
    pending: Vec<(Entry, Option<f64>)>,
    /// A second handle to the recording, to flush it to disk. `None` for simulated rigs, which stop with the computer.
    sync_handle: Option<File>,
}

impl Recorder {
    pub(crate) fn new(writer: RecordingWriter) -> Self {
        Recorder { writer, journal: None, pending: Vec::new(), sync_handle: None }
    }

    /// Keeps a journal, and flushes everything to disk if `sync_handle` is given.
    pub(crate) fn with_journal(self, journal: Journal, sync_handle: Option<File>) -> Self {
        Recorder { journal: Some(journal), sync_handle, ..self }
    }

    fn queue_entry(&mut self, entry: Entry) {
        if self.journal.is_some() {
            self.pending.push((entry, self.writer.saved_until_s()));
        }
    }

    /// Writes those pending entries to the journal whose data are flushed.
    fn write_flushed_entries(&mut self) -> Result<(), ObserverError> {
        let saved_s = self.writer.saved_until_s();
        if let Some(file) = &self.sync_handle {
            file.sync_data().map_err(ObserverError::new)?;
        }
        let Some(journal) = &mut self.journal else { return Ok(()) };
        let done = self.pending.partition_point(|(_, before_s)| *before_s != saved_s);
        for (entry, _) in self.pending.drain(..done) {
            journal.write(&entry).map_err(ObserverError::new)?;
        }
        Ok(())
    }

    /// Writes the end of the run into the journal.
    fn write_end(journal: Option<Journal>, pending: Vec<(Entry, Option<f64>)>, end: RunEnding) {
        let Some(mut journal) = journal else { return };
        let entries = pending.into_iter().map(|(entry, _)| entry).chain([Entry::Ended(end)]);
        for entry in entries {
            // The recording is complete; a missing end entry costs at most one step.
            if journal.write(&entry).is_err() {
                break;
            }
        }
    }

    /// Closes the file, and writes how the run ended into the journal.
    pub(crate) fn finish(self, end: RunEnding) -> Result<(), RecordError> {
        self.writer.finish()?;
        Recorder::write_end(self.journal, self.pending, end);
        Ok(())
    }
}

impl RunObserver for Recorder {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::Start).map_err(ObserverError::new)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        // This also writes the batch's own events.
        self.writer.write_batch(batch).map_err(ObserverError::new)?;
        self.write_flushed_entries()
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.writer.write_event(event).map_err(ObserverError::new)?;
        if event.kind == EventKind::SoakEnded {
            self.queue_entry(Entry::Soaked);
        }
        Ok(())
    }

    fn on_step_abandoned(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::Abandoned).map_err(ObserverError::new)
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.writer.write_step(marker, StepPhase::End).map_err(ObserverError::new)
    }

    fn on_step_completed(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.queue_entry(Entry::StepSaved(marker.index));
        Ok(())
    }
}

/// Forwards the runner's events as session events.
pub(crate) struct EventForwarder<'a> {
    pub on_event: OnEvent<'a>,
    /// Planned steps.
    pub steps: usize,
    /// Planned rig time including soak, s.
    pub duration_s: f64,
}

impl RunObserver for EventForwarder<'_> {
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
            let last = |values: &[f64]| values.iter().rev().find(|value| value.is_finite()).copied();
            let values =
                batch.columns.iter().filter_map(|column| Some((column.channel, last(&column.values)?)));
            (self.on_event)(&SessionEvent::Readings { t_s: *t_s, values: values.collect() });
        }
        batch.events.iter().try_for_each(|event| self.on_event(event))
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        (self.on_event)(&SessionEvent::Reported(event.clone()));
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        (self.on_event)(&SessionEvent::StepEnded(*marker));
        Ok(())
    }
}
