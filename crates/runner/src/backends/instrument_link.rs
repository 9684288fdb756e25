//! The backend of an auxiliary instrument: called directly, or on its own thread so that the run never waits for it.

use crate::backends::deadline::{Answer, ENDED, answer_on_thread, catch_panic, lost_error};
use mapper_core::{Backend, BackendError, SampleBatch};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::Duration;

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

fn make_call(backend: &mut dyn Backend, call: &Call) -> Answer {
    // The run continues without the instrument.
    catch_panic("it", || match call {
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
        let (calls, answers) = answer_on_thread("reader", move |call| make_call(backend.as_mut(), &call))?;
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
        calls.send(call).map_err(|_| lost_error(ENDED))?;
        match answers.recv_timeout(*deadline) {
            Ok(answer) => answer,
            Err(RecvTimeoutError::Timeout) => {
                Err(BackendError::Deadline { call: name, limit_s: deadline.as_secs_f64() })
            }
            Err(RecvTimeoutError::Disconnected) => Err(lost_error(ENDED)),
        }
    }
}
