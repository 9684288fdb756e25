//! The lease: the host sends an armed driver a message twice a second, otherwise the driver executes its safe trajectory.

use crate::link::MessageSender;
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
        sender: MessageSender,
        session: String,
        silence: Option<Duration>,
    ) -> Result<Lease, BackendError> {
        let call_time = Arc::new(Mutex::new(Instant::now()));
        let (end_thread, lease_dropped) = channel();
        let last = call_time.clone();
        let renew = move || {
            let note = Message { session: Some(session), ..Message::note("lease", serde_json::Value::Null) };
            while lease_dropped.recv_timeout(Duration::from_secs_f64(RENEW_S))
                == Err(RecvTimeoutError::Timeout)
            {
                let silent = last.lock().map_or(Duration::MAX, |last| last.elapsed());
                if silence.is_none_or(|silence| silent < silence) && sender.send(&note).is_err() {
                    // The driver does not read or has exited; the next call reports it.
                    break;
                }
            }
        };
        std::thread::Builder::new()
            .name("lease".to_owned())
            .spawn(renew)
            .map_err(|error| BackendError::Lost { t_s: 0.0, source: Box::new(error) })?;
        Ok(Lease { last_call: call_time, _end_thread: end_thread })
    }

    pub(crate) fn record_call(&self) {
        if let Ok(mut call_time) = self.last_call.lock() {
            *call_time = Instant::now();
        }
    }
}
