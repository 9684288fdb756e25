//! Observers of a run: the recorder with its journal, the sender of events, the estimator of points, each in a thread of its own if it is slow.

use crate::SessionEvent;
use crate::recording::journal::{Entry, Journal};
use crate::rig::rig_state::RigLease;
use crate::session::OnEvent;
use mapper_core::{Event, EventKind, Method, Recording, RigDescription, RunEnding, SampleBatch, StepMarker};
use mapper_identify::{IdentifyConfig, identify_each};
use mapper_recording::{RecordError, RecordingWriter, RunFile, StepPhase};
use mapper_runner::{ObserverError, RunObserver};
use std::panic::resume_unwind;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::{Scope, ScopedJoinHandle};

/// Writes everything to the recording, and the safely recorded steps to the journal.
pub(crate) struct Recorder {
    writer: RecordingWriter,
    journal: Option<Journal>,
    /// Entries whose data may not be flushed yet, with the flushed sample time at that moment, s.
    pending: Vec<(Entry, Option<f64>)>,
    /// A second handle to the recording, to flush it to disk. `None` for simulated rigs, which stop with the computer.
    sync_handle: Option<RunFile>,
}

impl Recorder {
    pub(crate) fn new(writer: RecordingWriter) -> Self {
        Recorder { writer, journal: None, pending: Vec::new(), sync_handle: None }
    }

    /// Keeps a journal, and flushes everything to disk if `sync_handle` is given.
    pub(crate) fn with_journal(self, journal: Journal, sync_handle: Option<RunFile>) -> Self {
        Recorder { journal: Some(journal), sync_handle, ..self }
    }

    fn queue_entry(&mut self, entry: Entry) {
        if self.journal.is_some() {
            self.pending.push((entry, self.writer.saved_until_s()));
        }
    }

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

/// Locks the rig out as soon as it must be inspected, so that a kill during the safe shutdown does not lose it.
pub(crate) struct Lockouts<'scope, 'env> {
    pub lease: &'env RigLease,
    pub run: &'env Path,
    pub scope: &'scope Scope<'scope, 'env>,
}

impl RunObserver for Lockouts<'_, '_> {
    fn on_lockout(&mut self, event: &Event) -> Result<(), ObserverError> {
        let (lease, run, reason) = (self.lease, self.run, event.message.clone());
        // On a thread of its own: the disk must not delay the shutdown. The release of the rig tries again and reports an error.
        self.scope.spawn(move || drop(lease.lock_out(reason, run)));
        Ok(())
    }
}

pub(crate) struct EventForwarder<'a> {
    pub on_event: OnEvent<'a>,
    pub steps: usize,
    /// Planned rig time including soak, s.
    pub duration_s: f64,
    /// Planned rig time of the steps that have not started, s.
    pub steps_left_s: f64,
    /// Planned rig time after the last step, s.
    pub cool_down_s: f64,
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
        // Counted from the start of the step: a hold or a step that ended early does not change the time of those to come.
        let step_s = marker.end_s - marker.start_s;
        let left_s = self.steps_left_s.max(step_s) + self.cool_down_s;
        self.steps_left_s -= step_s;
        (self.on_event)(&SessionEvent::StepStarted { marker: *marker, left_s });
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

/// Queue length: some seconds of samples. If the queue is full the run waits, so no data are lost.
const MAX_WAITING_CALLS: usize = 32;

type Call<'scope, O> = Box<dyn FnOnce(&mut O) -> Result<(), ObserverError> + Send + 'scope>;

#[derive(Debug, thiserror::Error)]
#[error("recording stopped after an error that was reported before")]
struct ObserverStopped;

/// Makes all calls, in order, on another thread until its observer fails. The next call returns the error; all later calls fail.
pub(crate) struct ThreadedObserver<'scope, O> {
    to_thread: SyncSender<Call<'scope, O>>,
    /// Receives the end of each call, if the calls are to be waited for.
    done: Option<Receiver<()>>,
    thread: ScopedJoinHandle<'scope, O>,
    failed: Receiver<ObserverError>,
}

impl<'scope, O: RunObserver + Send + 'scope> ThreadedObserver<'scope, O> {
    /// `waits`: each call returns after it was made.
    pub(crate) fn start<'env>(scope: &'scope Scope<'scope, 'env>, mut observer: O, waits: bool) -> Self {
        let (to_thread, calls) = sync_channel::<Call<'scope, O>>(MAX_WAITING_CALLS);
        let (fail, failed) = channel();
        let (made, done) = waits.then(channel).unzip();
        let thread = scope.spawn(move || {
            // The error must be stored before the end of the thread becomes visible.
            let mut make = |call: Call<'scope, O>| {
                call(&mut observer)?;
                if let Some(made) = &made {
                    let _ = made.send(());
                }
                Ok(())
            };
            if let Err(error) = calls.iter().try_for_each(|call| make(call)) {
                let _ = fail.send(error);
            }
            observer
        });
        ThreadedObserver { to_thread, done, thread, failed }
    }

    /// Waits for the end of all calls. Returns the observer, and its error if no earlier call has returned that.
    pub(crate) fn end(self) -> (O, Result<(), ObserverError>) {
        drop(self.to_thread);
        let observer = self.thread.join().unwrap_or_else(|panicked| resume_unwind(panicked));
        (observer, self.failed.try_recv().map_or(Ok(()), Err))
    }

    fn send(
        &mut self,
        call: impl FnOnce(&mut O) -> Result<(), ObserverError> + Send + 'scope,
    ) -> Result<(), ObserverError> {
        let is_sent = self.to_thread.send(Box::new(call)).is_ok();
        match is_sent && self.done.as_ref().is_none_or(|done| done.recv().is_ok()) {
            true => Ok(()),
            false => Err(self.failed.recv().unwrap_or_else(|_| ObserverError::new(ObserverStopped))),
        }
    }
}

impl<'scope, O: RunObserver + Send + 'scope> RunObserver for ThreadedObserver<'scope, O> {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        let marker = *marker;
        self.send(move |observer| observer.on_step_start(&marker))
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        let batch = batch.clone();
        self.send(move |observer| observer.on_batch(&batch))
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        let event = event.clone();
        self.send(move |observer| observer.on_event(&event))
    }

    fn on_step_abandoned(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        let marker = *marker;
        self.send(move |observer| observer.on_step_abandoned(&marker))
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        let marker = *marker;
        self.send(move |observer| observer.on_step_end(&marker))
    }

    fn on_step_completed(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        let marker = *marker;
        self.send(move |observer| observer.on_step_completed(&marker))
    }
}

/// Steps that may wait for identification. If the run is faster, estimates are dropped and the run is not delayed.
const MAX_WAITING_STEPS: usize = 4;

/// Keeps the last two steps and sends them to a separate thread, so that identification never delays the rig.
pub(crate) struct StepEstimator {
    recent: Recording,
    to_thread: SyncSender<Recording>,
}

impl StepEstimator {
    pub(crate) fn start<'scope, 'env>(
        scope: &'scope Scope<'scope, 'env>,
        config: IdentifyConfig,
        on_event: OnEvent<'env>,
    ) -> Self {
        let (to_thread, steps) = sync_channel::<Recording>(MAX_WAITING_STEPS);
        let config = config_for_single_steps(config);
        scope.spawn(move || {
            while let Ok(recording) = steps.recv() {
                let points = identify_each(&recording, &config).unwrap_or_default();
                if let Some(Ok(point)) = points.into_iter().last() {
                    on_event(&SessionEvent::PointEstimated(Box::new(point)));
                }
            }
        });
        StepEstimator { recent: Recording::default(), to_thread }
    }
}

impl RunObserver for StepEstimator {
    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        append_samples(&mut self.recent, batch);
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        retain_last_two_steps(&mut self.recent, marker);
        let _ = self.to_thread.try_send(self.recent.clone());
        Ok(())
    }
}

/// Appends samples to a recording as a file reader would: missing readings are omitted.
pub(crate) fn append_samples(recent: &mut Recording, batch: &SampleBatch) {
    for column in &batch.columns {
        let series = recent.series.entry(column.channel).or_default();
        for (t_s, value) in batch.t_s.iter().zip(&column.values).filter(|(_, value)| value.is_finite()) {
            series.t_s.push(*t_s);
            series.values.push(*value);
        }
    }
}

/// Adds an ended step and drops data before the previous one. Identification of the last step needs only these two.
pub(crate) fn retain_last_two_steps(recent: &mut Recording, marker: &StepMarker) {
    if recent.steps.len() > 1 {
        recent.steps.remove(0);
    }
    if let Some(before) = recent.steps.first().copied() {
        for series in recent.series.values_mut() {
            let old_samples = series.t_s.partition_point(|t_s| *t_s < before.start_s);
            series.t_s.drain(..old_samples);
            series.values.drain(..old_samples);
        }
    }
    recent.steps.push(*marker);
}

/// Settings for single steps. The standard errors exclude the assumed alpha_A, because further visits would not reduce that part.
pub(crate) fn config_for_single_steps(config: IdentifyConfig) -> IdentifyConfig {
    let method = match config.method {
        Method::Joint => Method::Dynamic,
        method => method,
    };
    IdentifyConfig { method, alpha_area_sigma_ratio: 0.0, ..config }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{EventKind, StepKind};
    use std::io;
    use std::sync::Mutex;
    use std::thread::scope;

    /// Keeps the times of events, and fails at a given number of them.
    struct Counts {
        times: Vec<f64>,
        fails_at: usize,
    }

    impl RunObserver for Counts {
        fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
            if self.times.len() == self.fails_at {
                return Err(ObserverError::new(io::Error::from(io::ErrorKind::StorageFull)));
            }
            self.times.push(event.t_s);
            Ok(())
        }
    }

    fn event(t_s: f64) -> Event {
        Event { t_s, kind: EventKind::Note, message: String::new() }
    }

    #[test]
    fn all_events_arrive_in_order_before_the_end() {
        let times: Vec<f64> = (0..1000).map(f64::from).collect();
        let (observer, error) = scope(|scope| {
            let mut threaded =
                ThreadedObserver::start(scope, Counts { times: Vec::new(), fails_at: usize::MAX }, false);
            times.iter().for_each(|t_s| threaded.on_event(&event(*t_s)).unwrap());
            threaded.end()
        });
        assert_eq!(observer.times, times);
        error.unwrap();
    }

    /// For a failure at any call, the error is returned once, and no later message counts as observed.
    #[test]
    fn an_error_is_reported_and_later_events_are_not_observed() {
        for fails_at in [0, 1, 50, 99] {
            let (observer, errors) = scope(|scope| {
                let mut threaded =
                    ThreadedObserver::start(scope, Counts { times: Vec::new(), fails_at }, false);
                let results: Vec<_> = (0..100).map(|t_s| threaded.on_event(&event(f64::from(t_s)))).collect();
                let (observer, at_end) = threaded.end();
                let errors =
                    results.into_iter().chain([at_end]).skip_while(Result::is_ok).collect::<Vec<_>>();
                (observer, errors)
            });
            assert_eq!(observer.times.len(), fails_at);
            let full = io::Error::from(io::ErrorKind::StorageFull).to_string();
            let [first, later @ ..] = errors.as_slice() else { panic!("no error") };
            assert_eq!(first.as_ref().unwrap_err().to_string(), full, "{fails_at}");
            // If a call has returned the error, the end must not return it.
            if let [calls @ .., end] = later {
                assert!(calls.iter().all(Result::is_err) && end.is_ok(), "{fails_at}");
            }
        }
    }

    #[test]
    fn the_panic_of_an_observer_reaches_the_caller() {
        struct Panics;
        impl RunObserver for Panics {
            fn on_event(&mut self, _event: &Event) -> Result<(), ObserverError> {
                panic!("on purpose")
            }
        }
        let ended = std::panic::catch_unwind(|| {
            scope(|scope| {
                let mut threaded = ThreadedObserver::start(scope, Panics, false);
                let refused = (0..1000).any(|t_s| threaded.on_event(&event(f64::from(t_s))).is_err());
                assert!(refused, "a thousand events after the observer failed");
                threaded.end().1
            })
        });
        assert_eq!(ended.unwrap_err().downcast_ref::<&str>(), Some(&"on purpose"));
    }

    /// Two steps of 60 s and a cool-down of 10 s: a hold of seven minutes in the first, and a third step that nobody planned.
    #[test]
    fn a_hold_takes_no_time_from_the_steps_to_come() {
        let left = Mutex::new(Vec::new());
        let on_event = |event: &SessionEvent| {
            if let SessionEvent::StepStarted { left_s, .. } = event {
                left.lock().unwrap().push(*left_s);
            }
        };
        let mut forwarder = EventForwarder {
            on_event: &on_event,
            steps: 2,
            duration_s: 160.0,
            steps_left_s: 120.0,
            cool_down_s: 10.0,
        };
        for (index, start_s) in [(0, 30.0), (1, 510.0), (2, 570.0)] {
            let (kind, end_s) = (StepKind::Point, start_s + 60.0);
            let marker = StepMarker {
                index,
                kind,
                start_s,
                end_s,
                from: None,
                to: None,
                p3_pa: 2e5,
                valve_opening_ratio: 1.0,
            };
            forwarder.on_step_start(&marker).unwrap();
        }
        assert_eq!(*left.lock().unwrap(), [130.0, 70.0, 70.0]);
    }
}
