//! Runs an observer on a separate thread, so that a short disk stall delays neither the rig nor its guards.

use mapper_core::{Event, SampleBatch, StepMarker};
use mapper_runner::{ObserverError, RunObserver};
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::{Scope, ScopedJoinHandle};

/// Queue length: some seconds of samples. If the queue is full the run waits, so no data are lost.
const MAX_WAITING_MESSAGES: usize = 32;

/// Message to an observer.
enum ObserverMessage {
    StepStart(StepMarker),
    Batch(SampleBatch),
    Event(Event),
    StepAbandoned(StepMarker),
    StepEnd(StepMarker),
    StepCompleted(StepMarker),
}

/// The observer accepts no more messages.
#[derive(Debug, thiserror::Error)]
#[error("recording stopped after an error that was reported before")]
struct ObserverStopped;

/// Forwards messages in order to an observer on another thread until that observer fails. The next call returns its error; all later calls fail.
pub(crate) struct ThreadedObserver<'scope, O> {
    to_thread: SyncSender<ObserverMessage>,
    thread: ScopedJoinHandle<'scope, O>,
    failed: Receiver<ObserverError>,
}

impl<'scope, O: RunObserver + Send + 'scope> ThreadedObserver<'scope, O> {
    /// Starts the thread.
    pub(crate) fn start<'env>(scope: &'scope Scope<'scope, 'env>, mut observer: O) -> Self {
        let (to_thread, messages) = sync_channel(MAX_WAITING_MESSAGES);
        let (fail, failed) = channel();
        let thread = scope.spawn(move || {
            // The error must be stored before the end of the thread becomes visible.
            if let Err(error) = messages.iter().try_for_each(|message| observe(&mut observer, message)) {
                let _ = fail.send(error);
            }
            observer
        });
        ThreadedObserver { to_thread, thread, failed }
    }

    /// Waits until the observer has processed all messages. Returns the observer, and its error if no earlier call has returned that.
    pub(crate) fn end(self) -> (O, Result<(), ObserverError>) {
        drop(self.to_thread);
        let observer = self.thread.join().unwrap_or_else(|panicked| resume_unwind(panicked));
        (observer, self.failed.try_recv().map_or(Ok(()), Err))
    }
}

impl<O> ThreadedObserver<'_, O> {
    fn send(&mut self, message: ObserverMessage) -> Result<(), ObserverError> {
        match self.to_thread.send(message) {
            Ok(()) => Ok(()),
            Err(_) => Err(self.failed.recv().unwrap_or_else(|_| ObserverError::new(ObserverStopped))),
        }
    }
}

fn observe(observer: &mut impl RunObserver, message: ObserverMessage) -> Result<(), ObserverError> {
    match message {
        ObserverMessage::StepStart(marker) => observer.on_step_start(&marker),
        ObserverMessage::Batch(batch) => observer.on_batch(&batch),
        ObserverMessage::Event(event) => observer.on_event(&event),
        ObserverMessage::StepAbandoned(marker) => observer.on_step_abandoned(&marker),
        ObserverMessage::StepEnd(marker) => observer.on_step_end(&marker),
        ObserverMessage::StepCompleted(marker) => observer.on_step_completed(&marker),
    }
}

impl<O> RunObserver for ThreadedObserver<'_, O> {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.send(ObserverMessage::StepStart(*marker))
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        self.send(ObserverMessage::Batch(batch.clone()))
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.send(ObserverMessage::Event(event.clone()))
    }

    fn on_step_abandoned(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.send(ObserverMessage::StepAbandoned(*marker))
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.send(ObserverMessage::StepEnd(*marker))
    }

    fn on_step_completed(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.send(ObserverMessage::StepCompleted(*marker))
    }
}

/// The thread on which an observer runs.
pub(crate) enum ObserverThread<'scope, O> {
    /// The calling thread, for simulated time: a delay does no harm, and passing messages would cost more than the observer's own work.
    Calling(O),
    /// A separate thread, for a rig in real time.
    Separate(ThreadedObserver<'scope, O>),
}

impl<'scope, O: RunObserver + Send + 'scope> ObserverThread<'scope, O> {
    /// The observer, on either thread.
    pub(crate) fn observer(&mut self) -> &mut dyn RunObserver {
        match self {
            ObserverThread::Calling(observer) => observer,
            ObserverThread::Separate(threaded) => threaded,
        }
    }

    /// Same as [`ThreadedObserver::end`].
    pub(crate) fn end(self) -> (O, Result<(), ObserverError>) {
        match self {
            ObserverThread::Calling(observer) => (observer, Ok(())),
            ObserverThread::Separate(threaded) => threaded.end(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::EventKind;
    use std::io;
    use std::thread::scope;

    /// Counts messages and fails at a given count.
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
    fn all_is_seen_in_order_before_the_end() {
        let times: Vec<f64> = (0..1000).map(f64::from).collect();
        let (observer, error) = scope(|scope| {
            let mut threaded =
                ThreadedObserver::start(scope, Counts { times: Vec::new(), fails_at: usize::MAX });
            times.iter().for_each(|t_s| threaded.on_event(&event(*t_s)).unwrap());
            threaded.end()
        });
        assert_eq!(observer.times, times);
        error.unwrap();
    }

    /// For a failure at any call, the error is returned once, and no later message counts as observed.
    #[test]
    fn an_error_is_reported_and_nothing_after_it_passes() {
        for fails_at in [0, 1, 50, 99] {
            let (observer, errors) = scope(|scope| {
                let mut threaded = ThreadedObserver::start(scope, Counts { times: Vec::new(), fails_at });
                let results: Vec<_> = (0..100).map(|t_s| threaded.on_event(&event(f64::from(t_s)))).collect();
                let (observer, untold) = threaded.end();
                let errors =
                    results.into_iter().chain([untold]).skip_while(Result::is_ok).collect::<Vec<_>>();
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
    fn an_observer_that_panics_is_not_written_on() {
        struct Panics;
        impl RunObserver for Panics {
            fn on_event(&mut self, _event: &Event) -> Result<(), ObserverError> {
                panic!("on purpose")
            }
        }
        let ended = std::panic::catch_unwind(|| {
            scope(|scope| {
                let mut threaded = ThreadedObserver::start(scope, Panics);
                let refused = (0..1000).any(|t_s| threaded.on_event(&event(f64::from(t_s))).is_err());
                assert!(refused, "a thousand events after the observer failed");
                threaded.end().1
            })
        });
        assert_eq!(ended.unwrap_err().downcast_ref::<&str>(), Some(&"on purpose"));
    }
}
