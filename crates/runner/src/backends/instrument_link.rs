//! The backend of an auxiliary instrument: called directly, or on its own thread so that the run never waits for it.

use crate::run_control::run::panic_message;
use mapper_core::{Backend, BackendError, SampleBatch};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Result of a request.
pub(crate) type Answer = Result<SampleBatch, BackendError>;

/// Why an instrument was lost.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct ThreadEnded(String);

pub(crate) enum Call {
    Arm,
    Poll(f64),
    Disarm,
}

/// Connection to the backend of an instrument.
pub(crate) enum InstrumentLink {
    /// Called directly: in simulated time all sources wait for each other.
    Direct { backend: Box<dyn Backend>, answer: Option<Answer> },
    /// Called on its own thread, in real time.
    OwnThread {
        calls: Sender<Call>,
        answers: Receiver<Answer>,
        /// A request is pending.
        is_pending: bool,
        armed: bool,
        deadline: Duration,
    },
}

fn lost_error(message: String) -> BackendError {
    BackendError::Lost { t_s: 0.0, source: Box::new(ThreadEnded(message)) }
}

/// Contains a panic of an instrument: the run continues without the instrument.
fn catch_panic(call: impl FnOnce() -> Answer) -> Answer {
    catch_unwind(AssertUnwindSafe(call))
        .unwrap_or_else(|panic| Err(lost_error(format!("it panicked: {}", panic_message(&*panic)))))
}

fn make_call(backend: &mut dyn Backend, call: &Call) -> Answer {
    catch_panic(|| match call {
        Call::Arm => backend.arm().map(|()| SampleBatch::default()),
        Call::Poll(until_s) => backend.poll(*until_s),
        Call::Disarm => backend.disarm().map(|()| SampleBatch::default()),
    })
}

impl InstrumentLink {
    pub(crate) fn new(
        mut backend: Box<dyn Backend>,
        simulated_time: bool,
        deadline: Duration,
    ) -> Result<Self, BackendError> {
        if simulated_time {
            return Ok(InstrumentLink::Direct { backend, answer: None });
        }
        let (calls, to_do) = channel::<Call>();
        let (reply, answers) = channel::<Answer>();
        // Detached: a hanging instrument must not keep the program from ending.
        std::thread::Builder::new()
            .name("reader".to_owned())
            .spawn(move || {
                for call in to_do {
                    if reply.send(make_call(backend.as_mut(), &call)).is_err() {
                        break;
                    }
                }
            })
            .map_err(|error| BackendError::Lost { t_s: 0.0, source: Box::new(error) })?;
        Ok(InstrumentLink::OwnThread { calls, answers, is_pending: false, armed: false, deadline })
    }

    /// Connects, within its deadline.
    pub(crate) fn arm(&mut self) -> Result<(), BackendError> {
        match self {
            InstrumentLink::Direct { backend, answer } => {
                *answer = None;
                make_call(backend.as_mut(), &Call::Arm).map(drop)
            }
            InstrumentLink::OwnThread { armed, is_pending, .. } => {
                (*armed, *is_pending) = (true, false);
                self.wait(Call::Arm, "arm").map(drop)
            }
        }
    }

    /// Requests the samples up to `until_s` of the instrument's own time, unless a request is pending.
    pub(crate) fn request(&mut self, until_s: f64) {
        match self {
            InstrumentLink::Direct { backend, answer } => {
                *answer = Some(make_call(backend.as_mut(), &Call::Poll(until_s)));
            }
            InstrumentLink::OwnThread { calls, is_pending, .. } => {
                *is_pending = *is_pending || calls.send(Call::Poll(until_s)).is_ok();
            }
        }
    }

    /// The answer, if it has arrived.
    pub(crate) fn answer(&mut self) -> Option<Answer> {
        match self {
            InstrumentLink::Direct { answer, .. } => answer.take(),
            InstrumentLink::OwnThread { answers, is_pending, .. } => {
                let answer = answers.try_recv().ok()?;
                *is_pending = false;
                Some(answer)
            }
        }
    }

    /// Disconnects.
    pub(crate) fn disarm(&mut self) -> Result<(), BackendError> {
        match self {
            InstrumentLink::Direct { backend, .. } => make_call(backend.as_mut(), &Call::Disarm).map(drop),
            InstrumentLink::OwnThread { armed, .. } if !*armed => Ok(()),
            InstrumentLink::OwnThread { armed, is_pending, answers, deadline, .. } => {
                *armed = false;
                // The answer to the previous request arrives first.
                if std::mem::take(is_pending) {
                    let _ = answers.recv_timeout(*deadline);
                }
                self.wait(Call::Disarm, "disarm").map(drop)
            }
        }
    }

    fn wait(&mut self, call: Call, name: &'static str) -> Answer {
        let InstrumentLink::OwnThread { calls, answers, deadline, .. } = self else {
            return Ok(SampleBatch::default());
        };
        calls.send(call).map_err(|_| lost_error("its thread has ended".to_owned()))?;
        match answers.recv_timeout(*deadline) {
            Ok(answer) => answer,
            Err(RecvTimeoutError::Timeout) => {
                Err(BackendError::Deadline { call: name, limit_s: deadline.as_secs_f64() })
            }
            Err(RecvTimeoutError::Disconnected) => Err(lost_error("its thread has ended".to_owned())),
        }
    }
}
