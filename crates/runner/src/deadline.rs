//! A backend whose calls return within a deadline, even if the rig hangs: a separate thread makes them.

use crate::run_control::run::panic_message;
use mapper_core::{Backend, BackendError, RigDescription, SampleBatch, Setpoints};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// A call that is sent to the rig's thread.
enum Call {
    Arm,
    Set(Setpoints),
    Poll(f64),
    Hold,
    MakeSafe,
    Disarm,
}

/// Result of a call; only a poll has samples.
pub(crate) type Answer = Result<SampleBatch, BackendError>;

/// Adds deadlines to another backend. A call that has timed out is not repeated: later calls wait behind it, and time out
/// themselves until the rig answers. Late answers are discarded, and the samples in them count as missed.
pub struct DeadlineBackend {
    description: RigDescription,
    calls: Sender<(u64, Call)>,
    answers: Receiver<(u64, Answer)>,
    number: u64,
    deadlines: Deadlines,
}

/// Time limits of the calls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Deadlines {
    /// To connect and arm, and to disconnect.
    pub arming: Duration,
    /// Every other call.
    pub call: Duration,
}

pub(crate) const ENDED: &str = "its thread has ended";

pub(crate) fn lost_error(message: impl Into<String>) -> BackendError {
    BackendError::Lost { t_s: 0.0, source: message.into().into() }
}

/// Contains a panic of a backend, which `name` names.
pub(crate) fn catch_panic(name: &str, call: impl FnOnce() -> Answer) -> Answer {
    catch_unwind(AssertUnwindSafe(call))
        .unwrap_or_else(|panic| Err(lost_error(format!("{name} panicked: {}", panic_message(&*panic)))))
}

/// Starts a thread that answers calls. It is detached: a hanging call must not keep the program from ending.
pub(crate) fn answer_on_thread<C: Send + 'static, A: Send + 'static>(
    name: &str,
    mut answer: impl FnMut(C) -> A + Send + 'static,
) -> Result<(Sender<C>, Receiver<A>), BackendError> {
    let (calls, to_do) = channel();
    let (reply, answers) = channel();
    let work = move || {
        for call in to_do {
            if reply.send(answer(call)).is_err() {
                break;
            }
        }
    };
    let started = std::thread::Builder::new().name(name.to_owned()).spawn(work);
    started.map_err(|error| BackendError::Lost { t_s: 0.0, source: Box::new(error) })?;
    Ok((calls, answers))
}

impl DeadlineBackend {
    /// `backend` with these deadlines for its calls.
    pub fn new(mut backend: Box<dyn Backend>, deadlines: Deadlines) -> Result<Self, BackendError> {
        let description = backend.describe();
        let done = SampleBatch::default;
        let mut make = move |call| match call {
            Call::Arm => backend.arm().map(|()| done()),
            Call::Set(setpoints) => backend.set(&setpoints).map(|()| done()),
            Call::Poll(until_s) => backend.poll(until_s),
            Call::Hold => backend.hold().map(|()| done()),
            Call::MakeSafe => backend.make_safe().map(|()| done()),
            Call::Disarm => backend.disarm().map(|()| done()),
        };
        let answer = move |(number, call)| (number, catch_panic("the backend", || make(call)));
        let (calls, answers) = answer_on_thread("rig", answer)?;
        Ok(DeadlineBackend { description, calls, answers, number: 0, deadlines })
    }

    fn call(&mut self, name: &'static str, call: Call) -> Answer {
        let limit = match call {
            Call::Arm | Call::Disarm => self.deadlines.arming,
            _ => self.deadlines.call,
        };
        self.number += 1;
        self.calls.send((self.number, call)).map_err(|_| lost_error(ENDED))?;
        loop {
            match self.answers.recv_timeout(limit) {
                // A late answer to a call that has timed out.
                Ok((number, _)) if number < self.number => {}
                Ok((_, answer)) => return answer,
                Err(RecvTimeoutError::Timeout) => {
                    return Err(BackendError::Deadline { call: name, limit_s: limit.as_secs_f64() });
                }
                Err(RecvTimeoutError::Disconnected) => return Err(lost_error(ENDED)),
            }
        }
    }
}

impl Backend for DeadlineBackend {
    fn describe(&self) -> RigDescription {
        self.description.clone()
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        self.call("arm", Call::Arm).map(drop)
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.call("set", Call::Set(*setpoints)).map(drop)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.call("poll", Call::Poll(until_s))
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.call("hold", Call::Hold).map(drop)
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.call("make_safe", Call::MakeSafe).map(drop)
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.call("disarm", Call::Disarm).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, SafeTrajectory};
    use std::sync::Mutex;

    /// Does not answer a poll until it is released.
    struct Hangs(Mutex<Receiver<()>>);

    impl Backend for Hangs {
        fn describe(&self) -> RigDescription {
            RigDescription {
                backend: "hangs".to_owned(),
                version: "1".to_owned(),
                channels: vec![Channel::T2],
                sample_rate_hz: 10.0,
                simulated_time: false,
                controls: true,
                exclusive: None,
                reached_at: None,
                needs_guarded: Vec::new(),
                accepts: None,
                safe: SafeTrajectory::default(),
            }
        }
        fn arm(&mut self) -> Result<(), BackendError> {
            Ok(())
        }
        fn set(&mut self, _: &Setpoints) -> Result<(), BackendError> {
            Ok(())
        }
        fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
            self.0.lock().unwrap().recv().unwrap();
            Ok(SampleBatch { t_s: vec![until_s], ..SampleBatch::default() })
        }
        fn make_safe(&mut self) -> Result<(), BackendError> {
            Ok(())
        }
        fn disarm(&mut self) -> Result<(), BackendError> {
            Ok(())
        }
    }

    #[test]
    fn calls_to_a_hanging_rig_time_out_and_late_answers_are_discarded() {
        let (go, going) = channel();
        // One second allows for a machine that is busy with other tests.
        let [arming, call] = [Duration::from_secs(10), Duration::from_secs(1)];
        let mut rig =
            DeadlineBackend::new(Box::new(Hangs(Mutex::new(going))), Deadlines { arming, call }).unwrap();
        rig.arm().unwrap();
        go.send(()).unwrap();
        assert_eq!(rig.poll(1.0).unwrap().t_s, [1.0]);
        assert!(matches!(rig.poll(2.0), Err(BackendError::Deadline { call: "poll", .. })));
        // It still hangs: every call fails, in bounded time.
        assert!(matches!(rig.make_safe(), Err(BackendError::Deadline { call: "make_safe", .. })));
        go.send(()).unwrap();
        go.send(()).unwrap();
        // Once it responds again, an answer belongs to the call that was made.
        let answer = (0..1000).find_map(|_| rig.poll(3.0).ok().inspect(|_| go.send(()).unwrap_or(())));
        assert_eq!(answer.unwrap().t_s, [3.0]);
    }
}
