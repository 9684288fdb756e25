//! The lease: an armed driver hears from its host twice a second, or flies its safe trajectory.

use crate::link::Outlet;
use mapper_core::BackendError;
use mapper_protocol::{Message, RENEW_S};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A lease that is renewed until it is dropped, by a thread of its own, as long as somebody calls.
pub(crate) struct Lease {
    called: Arc<Mutex<Instant>>,
    /// Dropped with the lease, which ends the thread.
    _held: Sender<()>,
}

impl Lease {
    /// A lease of this session. `silence`: without a call for so long it is not renewed, because who should look at the rig
    /// does not; `None`: of a simulation, which may wait.
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
                    // Deaf or gone: the next call says so.
                    break;
                }
            }
        };
        std::thread::Builder::new()
            .name("lease".to_owned())
            .spawn(renew)
            .map_err(|error| BackendError::Lost { t_s: 0.0, source: Box::new(error) })?;
        Ok(Lease { called, _held: held })
    }

    /// Somebody has called.
    pub(crate) fn called(&self) {
        if let Ok(mut called) = self.called.lock() {
            *called = Instant::now();
        }
    }
}
