//! Work in a thread of its own while the calling thread watches for Ctrl-C.

use crate::error::{Fault, MapperError};
use mapper::{Observer, SessionEvent, with_messages};
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread;
use std::time::Duration;

/// Interval at which signals and progress are looked at. Judgement: below what a person notices, above what costs time.
const POLL: Duration = Duration::from_millis(50);
/// Events that wait to be shown; further ones are dropped, so that an observer never slows a run.
const WAITING_EVENTS: usize = 1024;

/// What worker and caller share.
#[derive(Debug, Clone, Default)]
pub struct Shared {
    /// Stop at the next sample.
    pub stop: Arc<AtomicBool>,
    /// Whether a rig is held, which must not be left alone. The worker sets it first and then looks at `stop`; the caller sets `stop` first and
    /// then looks here. So no rig is armed behind the back of a caller that has left.
    pub holds_rig: Arc<AtomicBool>,
}

/// The worker's side: events for the caller.
#[derive(Clone)]
pub struct Events {
    shared: Shared,
    /// `None` if no one looks.
    sender: Option<SyncSender<String>>,
}

impl Events {
    /// The observer that passes every event on.
    pub fn observer(&self) -> Observer {
        let events = self.clone();
        Arc::new(move |event| events.show(event))
    }

    /// Notes an event and passes it on.
    fn show(&self, event: &SessionEvent) {
        if matches!(event, SessionEvent::RigReleased) {
            self.shared.holds_rig.store(false, Ordering::SeqCst);
        }
        if let Some(sender) = &self.sender
            && let Ok(event) = with_messages(|| serde_json::to_value(event))
        {
            // A full queue loses a movement of the bar.
            let _ = sender.try_send(event.to_string());
        }
    }
}

/// Result of attended work.
pub enum Attended<T> {
    /// The work ended; with the exception that stopped it, if any.
    Ended(Result<T, Fault>, Option<PyErr>),
    /// The caller left work that holds no rig.
    Left(PyErr),
}

/// Runs `work` in a thread. An exception in the calling thread (Ctrl-C, or one of `on_event`) sets the stop flag. If a rig is held, the call
/// waits for the end of the work; a second exception ends the wait as soon as the rig is safe.
///
/// # Errors
/// [`MapperError`] if the thread cannot be started or panics.
pub fn attend<T: Send + 'static>(
    py: Python<'_>,
    shared: Shared,
    on_event: Option<&Py<PyAny>>,
    work: impl FnOnce(&Events) -> Result<T, Fault> + Send + 'static,
) -> PyResult<Attended<T>> {
    let (sender, events) = sync_channel(WAITING_EVENTS);
    let (done, result) = sync_channel(1);
    let worker = Events { shared: shared.clone(), sender: on_event.is_some().then_some(sender) };
    thread::Builder::new()
        .name("mapper".to_owned())
        .spawn(move || {
            // The caller may have left.
            let _ = done.send(work(&worker));
        })
        .map_err(|error| MapperError::new_err(format!("failed to start a thread: {error}")))?;
    py.detach(move || wait(&shared, on_event, &events, &result))
}

fn wait<T: Send>(
    shared: &Shared,
    on_event: Option<&Py<PyAny>>,
    events: &Receiver<String>,
    result: &Receiver<Result<T, Fault>>,
) -> PyResult<Attended<T>> {
    let mut stopped_by: Option<PyErr> = None;
    loop {
        match result.recv_timeout(POLL) {
            Ok(result) => {
                if stopped_by.is_none() {
                    stopped_by = Python::attach(|py| look(py, on_event, events)).err();
                }
                return Ok(Attended::Ended(result, stopped_by));
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(MapperError::new_err(
                    "the work ended with a defect of the program; its message stands above",
                ));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let looked = Python::attach(|py| match stopped_by {
            None => look(py, on_event, events),
            Some(_) => py.check_signals(),
        });
        if let Err(error) = looked {
            shared.stop.store(true, Ordering::SeqCst);
            if !shared.holds_rig.load(Ordering::SeqCst) {
                return Ok(Attended::Left(error));
            }
            stopped_by.get_or_insert(error);
        }
    }
}

/// Shows waiting events and raises what a signal raised.
fn look(py: Python<'_>, on_event: Option<&Py<PyAny>>, events: &Receiver<String>) -> PyResult<()> {
    py.check_signals()?;
    let Some(on_event) = on_event else { return Ok(()) };
    loop {
        match events.try_recv() {
            Ok(event) => on_event.call1(py, (event,)).map(drop)?,
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => return Ok(()),
        }
    }
}

/// Runs work that holds no rig and has no stop flag. Ctrl-C leaves it: it ends by itself and its result is dropped.
///
/// # Errors
/// That of the work, or the exception of the caller.
pub fn compute<T: Send + 'static>(
    py: Python<'_>,
    on_event: Option<&Py<PyAny>>,
    work: impl FnOnce(&Events) -> Result<T, Fault> + Send + 'static,
) -> PyResult<T> {
    match attend(py, Shared::default(), on_event, work)? {
        Attended::Ended(_, Some(error)) | Attended::Left(error) => Err(error),
        Attended::Ended(result, None) => Ok(result?),
    }
}
