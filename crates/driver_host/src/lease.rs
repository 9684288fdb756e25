//! The lease: the host sends an armed driver a message twice a second, otherwise the driver executes its safe trajectory.

use crate::link::Outlet;
use crate::protocol::{Message, RENEW_S};
use mapper_core::BackendError;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A lease, renewed by a separate thread until it is dropped, as long as calls arrive.
pub(crate) struct Lease {
    last_call: Arc<Mutex<Instant>>,
    /// Dropped with the lease, which ends the thread.
    _end_thread: Sender<()>,
}

impl Lease {
    /// The lease of this session. Without calls for `silence` it is not renewed, because the runner no longer supervises the rig. `None`: a
    /// simulation, which may wait.
    pub(crate) fn new(
        outlet: Outlet,
        session: String,
        silence: Option<Duration>,
    ) -> Result<Lease, BackendError> {
        let called = Arc::new(Mutex::new(Instant::now()));
        let (held, dropped) = channel();
        let last = called.clone();
        let renew = move || {
            let note = Message { session: Some(session), ..Message::note("lease", serde_json::Value::Null) };
            while dropped.recv_timeout(Duration::from_secs_f64(RENEW_S)) == Err(RecvTimeoutError::Timeout) {
                let silent = last.lock().map_or(Duration::MAX, |last| last.elapsed());
                if silence.is_none_or(|silence| silent < silence) && outlet.send(&note).is_err() {
                    // The driver does not read or has exited; the next call reports it.
                    break;
                }
            }
        };
        std::thread::Builder::new()
            .name("lease".to_owned())
            .spawn(renew)
            .map_err(|error| BackendError::Lost { t_s: 0.0, source: Box::new(error) })?;
        Ok(Lease { last_call: called, _end_thread: held })
    }

    pub(crate) fn record_call(&self) {
        if let Ok(mut called) = self.last_call.lock() {
            *called = Instant::now();
        }
    }
}
