//! The backend of an auxiliary instrument: called directly, or on its own thread so that the run never waits for it.

use crate::run_control::run::words_of;
use mapper_core::{Backend, BackendError, SampleBatch};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Result of a request.
pub(crate) type Answer = Result<SampleBatch, BackendError>;

/// Why an instrument was lost.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Gone(String);

pub(crate) enum Ask {
    Arm,
    Poll(f64),
    Disarm,
}

/// See the module.
pub(crate) enum ReaderLink {
    /// In simulated time, where all sources wait for each other.
    Here { backend: Box<dyn Backend>, answer: Option<Answer> },
    /// In real time.
    OwnThread {
        asks: Sender<Ask>,
        answers: Receiver<Answer>,
        /// A request is pending.
        asked: bool,
        armed: bool,
        deadline: Duration,
    },
}

fn gone(words: String) -> BackendError {
    BackendError::Lost { t_s: 0.0, source: Box::new(Gone(words)) }
}

/// Contains a panic of an instrument: the run continues without the instrument.
fn contained(call: impl FnOnce() -> Answer) -> Answer {
    catch_unwind(AssertUnwindSafe(call))
        .unwrap_or_else(|panic| Err(gone(format!("it panicked: {}", words_of(&*panic)))))
}

fn answered(backend: &mut dyn Backend, ask: &Ask) -> Answer {
    contained(|| match ask {
        Ask::Arm => backend.arm().map(|()| SampleBatch::default()),
        Ask::Poll(until_s) => backend.poll(*until_s),
        Ask::Disarm => backend.disarm().map(|()| SampleBatch::default()),
    })
}

impl ReaderLink {
    pub(crate) fn new(
        mut backend: Box<dyn Backend>,
        simulated_time: bool,
        deadline: Duration,
    ) -> Result<Self, BackendError> {
        if simulated_time {
            return Ok(ReaderLink::Here { backend, answer: None });
        }
        let (asks, to_do) = channel::<Ask>();
        let (reply, answers) = channel::<Answer>();
        // Detached: a hanging instrument must not keep the program from ending.
        std::thread::Builder::new()
            .name("reader".to_owned())
            .spawn(move || {
                for ask in to_do {
                    if reply.send(answered(backend.as_mut(), &ask)).is_err() {
                        break;
                    }
                }
            })
            .map_err(|error| BackendError::Lost { t_s: 0.0, source: Box::new(error) })?;
        Ok(ReaderLink::OwnThread { asks, answers, asked: false, armed: false, deadline })
    }

    /// Connects, within its deadline.
    pub(crate) fn arm(&mut self) -> Result<(), BackendError> {
        match self {
            ReaderLink::Here { backend, answer } => {
                *answer = None;
                answered(backend.as_mut(), &Ask::Arm).map(drop)
            }
            ReaderLink::OwnThread { armed, asked, .. } => {
                (*armed, *asked) = (true, false);
                self.wait(Ask::Arm, "arm").map(drop)
            }
        }
    }

    /// Requests the samples up to `until_s` of the instrument's own time, unless a request is pending.
    pub(crate) fn ask(&mut self, until_s: f64) {
        match self {
            ReaderLink::Here { backend, answer } => {
                *answer = Some(answered(backend.as_mut(), &Ask::Poll(until_s)));
            }
            ReaderLink::OwnThread { asks, asked, .. } => {
                *asked = *asked || asks.send(Ask::Poll(until_s)).is_ok();
            }
        }
    }

    /// The answer, if it has arrived.
    pub(crate) fn answer(&mut self) -> Option<Answer> {
        match self {
            ReaderLink::Here { answer, .. } => answer.take(),
            ReaderLink::OwnThread { answers, asked, .. } => {
                let answer = answers.try_recv().ok()?;
                *asked = false;
                Some(answer)
            }
        }
    }

    /// Disconnects.
    pub(crate) fn disarm(&mut self) -> Result<(), BackendError> {
        match self {
            ReaderLink::Here { backend, .. } => answered(backend.as_mut(), &Ask::Disarm).map(drop),
            ReaderLink::OwnThread { armed, .. } if !*armed => Ok(()),
            ReaderLink::OwnThread { armed, asked, answers, deadline, .. } => {
                *armed = false;
                // The answer to the previous request arrives first.
                if std::mem::take(asked) {
                    let _ = answers.recv_timeout(*deadline);
                }
                self.wait(Ask::Disarm, "disarm").map(drop)
            }
        }
    }

    fn wait(&mut self, ask: Ask, call: &'static str) -> Answer {
        let ReaderLink::OwnThread { asks, answers, deadline, .. } = self else {
            return Ok(SampleBatch::default());
        };
        asks.send(ask).map_err(|_| gone("its thread has ended".to_owned()))?;
        match answers.recv_timeout(*deadline) {
            Ok(answer) => answer,
            Err(RecvTimeoutError::Timeout) => {
                Err(BackendError::Deadline { call, limit_s: deadline.as_secs_f64() })
            }
            Err(RecvTimeoutError::Disconnected) => Err(gone("its thread has ended".to_owned())),
        }
    }
}
