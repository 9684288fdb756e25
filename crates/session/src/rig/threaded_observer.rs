//! Runs an observer on a separate thread, so that compression and a short disk stall delay neither the rig nor its guards.

use mapper_core::{Event, SampleBatch, StepMarker};
use mapper_runner::{ObserverError, RunObserver};
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::{Scope, ScopedJoinHandle};

/// Queue length: some seconds of samples. If the queue is full the run waits, so no data are lost.
const MAX_WAITING_CALLS: usize = 32;

/// A call of an observer, to be made on its thread.
type Call<'scope, O> = Box<dyn FnOnce(&mut O) -> Result<(), ObserverError> + Send + 'scope>;

/// The observer accepts no more messages.
#[derive(Debug, thiserror::Error)]
#[error("recording stopped after an error that was reported before")]
struct ObserverStopped;

/// Makes all calls, in order, on another thread until its observer fails. The next call returns the error; all later calls fail.
pub(crate) struct ThreadedObserver<'scope, O> {
    to_thread: SyncSender<Call<'scope, O>>,
    thread: ScopedJoinHandle<'scope, O>,
    failed: Receiver<ObserverError>,
}

impl<'scope, O: RunObserver + Send + 'scope> ThreadedObserver<'scope, O> {
    /// Starts the thread.
    pub(crate) fn start<'env>(scope: &'scope Scope<'scope, 'env>, mut observer: O) -> Self {
        let (to_thread, calls) = sync_channel::<Call<'scope, O>>(MAX_WAITING_CALLS);
        let (fail, failed) = channel();
        let thread = scope.spawn(move || {
            // The error must be stored before the end of the thread becomes visible.
            if let Err(error) = calls.iter().try_for_each(|call| call(&mut observer)) {
                let _ = fail.send(error);
            }
            observer
        });
        ThreadedObserver { to_thread, thread, failed }
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
        match self.to_thread.send(Box::new(call)) {
            Ok(()) => Ok(()),
            Err(_) => Err(self.failed.recv().unwrap_or_else(|_| ObserverError::new(ObserverStopped))),
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

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::EventKind;
    use std::io;
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
                ThreadedObserver::start(scope, Counts { times: Vec::new(), fails_at: usize::MAX });
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
                let mut threaded = ThreadedObserver::start(scope, Counts { times: Vec::new(), fails_at });
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
                let mut threaded = ThreadedObserver::start(scope, Panics);
                let refused = (0..1000).any(|t_s| threaded.on_event(&event(f64::from(t_s))).is_err());
                assert!(refused, "a thousand events after the observer failed");
                threaded.end().1
            })
        });
        assert_eq!(ended.unwrap_err().downcast_ref::<&str>(), Some(&"on purpose"));
    }
}
