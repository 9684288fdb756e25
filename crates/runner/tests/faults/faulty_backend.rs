//! A backend with faults on demand, for tests.

use mapper_core::{
    Backend, BackendError, Channel, Event, EventKind, Provenance, Quality, RigDescription, RigMode,
    SampleBatch, Setpoints,
};

/// Payload of the panic of [`Fault::Panics`].
pub struct RequestedPanic;

/// A fault, active from its start time on.
#[derive(Debug, Clone, PartialEq)]
#[allow(dead_code, reason = "each program of tests uses some of them")]
pub enum Fault {
    /// A sensor repeats its last reading to the last bit.
    Frozen(Channel),
    /// A sensor reads NaN.
    Nan(Channel),
    /// A sensor reads this value.
    Reads(Channel, f64),
    /// A sensor's readings are multiplied by this factor.
    Scaled(Channel, f64),
    /// A sensor's readings are shifted by this amount, unit of the channel.
    Shifted(Channel, f64),
    /// A channel is missing.
    Absent(Channel),
    /// The rig reports a sensor's readings as bad.
    Bad(Channel),
    /// A sensor's readings keep the source time at which the fault began.
    Old(Channel),
    /// No samples for this time, s, over a live connection. The samples are lost.
    Mute(f64),
    /// Samples are delayed by this time, s, and arrive together.
    Late(f64),
    /// A batch arrives twice.
    Doubled,
    /// The samples of a batch are out of order.
    Reordered,
    /// Times jump back by this amount, s.
    Backward(f64),
    /// A column has fewer values than the batch has times.
    Torn(Channel),
    /// Setpoints are refused.
    Refuses,
    /// Setpoints are accepted but not followed.
    Ignores,
    /// The rig cuts its air by itself, with or without a report.
    Trips {
        /// Whether an event reports it.
        is_reported: bool,
    },
    /// The connection is lost permanently.
    Lost,
    /// The connection is lost for this time, s.
    LostFor(f64),
    /// No call is answered.
    Silent,
    /// The safe state is acknowledged without effect.
    NotMadeSafe,
    /// A call panics.
    Panics,
    /// This number of safe-state commands fail.
    NotSafe(usize),
}

/// An injected fault, as the backend's own error.
#[derive(Debug)]
struct InjectedFault(&'static str);

impl std::fmt::Display for InjectedFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0)
    }
}

impl std::error::Error for InjectedFault {}

/// Wraps another backend, and injects faults at their start times.
pub struct FaultyBackend<B> {
    inner: B,
    /// Start time, s of run time, and fault.
    faults: Vec<(f64, Fault)>,
    now_s: f64,
    /// The last reading before a sensor froze.
    frozen: Vec<(Channel, f64)>,
    /// Delayed batches.
    delayed: Vec<SampleBatch>,
    tripped: bool,
    /// Times of the safe-state commands, as the run time of the last poll, s.
    pub safe_at_s: Vec<f64>,
    /// Times of the hold commands, s.
    pub held_at_s: Vec<f64>,
    /// Setpoints received, with their times, s.
    pub commands: Vec<(f64, Setpoints)>,
}

impl<B: Backend> FaultyBackend<B> {
    /// Wraps `inner` with these faults.
    pub fn new(inner: B, faults: Vec<(f64, Fault)>) -> Self {
        FaultyBackend {
            inner,
            faults,
            now_s: 0.0,
            frozen: Vec::new(),
            delayed: Vec::new(),
            tripped: false,
            safe_at_s: Vec::new(),
            held_at_s: Vec::new(),
            commands: Vec::new(),
        }
    }

    fn active_faults(&self) -> Vec<(f64, Fault)> {
        self.faults.iter().filter(|(begin_s, _)| *begin_s <= self.now_s).cloned().collect()
    }

    /// The error of a call while the connection is lost or silent.
    fn unreachable(&mut self, call: &'static str) -> Result<(), BackendError> {
        for (begin_s, fault) in self.active_faults() {
            match fault {
                Fault::Lost => return Err(self.lost_error()),
                Fault::LostFor(duration_s) if self.now_s < begin_s + duration_s => {
                    let error = self.lost_error();
                    // The time of the call.
                    self.now_s += 0.25;
                    return Err(error);
                }
                Fault::Silent => return Err(BackendError::Deadline { call, limit_s: 2.0 }),
                _ => {}
            }
        }
        Ok(())
    }

    fn lost_error(&self) -> BackendError {
        BackendError::Lost { t_s: self.now_s, source: Box::new(InjectedFault("the connection is lost")) }
    }

    /// Applies a sensor fault to a batch.
    fn apply_sensor_fault(&mut self, begin_s: f64, fault: &Fault, batch: &mut SampleBatch) {
        let (Fault::Frozen(channel)
        | Fault::Nan(channel)
        | Fault::Reads(channel, _)
        | Fault::Scaled(channel, _)
        | Fault::Shifted(channel, _)
        | Fault::Absent(channel)
        | Fault::Bad(channel)
        | Fault::Old(channel)
        | Fault::Torn(channel)) = fault
        else {
            return;
        };
        let samples = batch.t_s.len();
        match fault {
            Fault::Absent(_) => batch.columns.retain(|column| column.channel != *channel),
            Fault::Bad(_) | Fault::Old(_) => batch.provenance.push(Provenance {
                channel: *channel,
                source_t_s: if *fault == Fault::Old(*channel) {
                    vec![begin_s; samples]
                } else {
                    batch.t_s.clone()
                },
                quality: vec![
                    if *fault == Fault::Bad(*channel) { Quality::Bad } else { Quality::Good };
                    samples
                ],
            }),
            _ => {
                let Some(column) = batch.columns.iter_mut().find(|column| column.channel == *channel) else {
                    return;
                };
                match fault {
                    Fault::Scaled(_, factor) => column.values.iter_mut().for_each(|value| *value *= factor),
                    Fault::Shifted(_, by) => column.values.iter_mut().for_each(|value| *value += by),
                    _ => {}
                }
                let value = match fault {
                    Fault::Scaled(..) | Fault::Shifted(..) => return,
                    Fault::Nan(_) => f64::NAN,
                    Fault::Reads(_, value) => *value,
                    Fault::Frozen(_) => match self.frozen.iter().find(|(frozen, _)| frozen == channel) {
                        Some((_, value)) => *value,
                        None => {
                            let value = column.values.first().copied().unwrap_or(f64::NAN);
                            self.frozen.push((*channel, value));
                            value
                        }
                    },
                    _ => {
                        column.values.pop();
                        return;
                    }
                };
                column.values.iter_mut().for_each(|reading| *reading = value);
            }
        }
    }

    /// Applies a stream fault to a batch. A fault that affects a single batch ends with it.
    fn apply_stream_fault(&mut self, begin_s: f64, fault: &Fault, batch: SampleBatch) -> SampleBatch {
        match fault {
            Fault::Mute(duration_s) if self.now_s < begin_s + duration_s => SampleBatch::default(),
            Fault::Late(duration_s) if self.now_s < begin_s + duration_s => {
                self.delayed.push(batch);
                SampleBatch::default()
            }
            Fault::Late(_) if !self.delayed.is_empty() => {
                let mut delayed_batches = std::mem::take(&mut self.delayed).into_iter().chain([batch]);
                let mut full_batch = delayed_batches.next().unwrap_or_default();
                for next_batch in delayed_batches {
                    full_batch.t_s.extend(next_batch.t_s);
                    for (column, further) in full_batch.columns.iter_mut().zip(next_batch.columns) {
                        column.values.extend(further.values);
                    }
                    for (column, further) in full_batch.truth.iter_mut().zip(next_batch.truth) {
                        column.values.extend(further.values);
                    }
                    full_batch.events.extend(next_batch.events);
                }
                full_batch
            }
            Fault::Reordered => {
                let mut batch = batch;
                batch.t_s.reverse();
                batch
            }
            Fault::Backward(by_s) => {
                let mut batch = batch;
                batch.t_s.iter_mut().for_each(|t_s| *t_s -= by_s);
                batch
            }
            _ => batch,
        }
    }
}

impl<B: Backend> Backend for FaultyBackend<B> {
    fn describe(&self) -> RigDescription {
        self.inner.describe()
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        self.now_s = 0.0;
        self.inner.arm()
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.commands.push((self.now_s, *setpoints));
        self.unreachable("set")?;
        for (_, fault) in self.active_faults() {
            match fault {
                Fault::Refuses => {
                    let (quantity, value, unit) = ("P3", setpoints.p3_pa, "Pa");
                    return Err(BackendError::SetpointOutOfRange {
                        quantity,
                        value,
                        unit,
                        low: 0.0,
                        high: 1.0,
                    });
                }
                Fault::Ignores => return Ok(()),
                Fault::Trips { .. } => {
                    return self.inner.set(&Setpoints { mode: RigMode::Standstill, ..*setpoints });
                }
                _ => {}
            }
        }
        self.inner.set(setpoints)
    }

    #[allow(clippy::panic, reason = "a panic on request is what it is for")]
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.unreachable("poll")?;
        for (_, fault) in self.active_faults() {
            match fault {
                Fault::Panics => std::panic::panic_any(RequestedPanic),
                Fault::Trips { .. } if !self.tripped => self.inner.make_safe()?,
                _ => {}
            }
        }
        let mut batch = self.inner.poll(until_s)?;
        self.now_s = self.now_s.max(until_s);
        for (begin_s, fault) in self.active_faults() {
            if let Fault::Trips { is_reported } = fault {
                if is_reported && !self.tripped {
                    let message = "the rig has tripped by itself: emergency stop".to_owned();
                    batch.events.push(Event { t_s: self.now_s, kind: EventKind::RigTripped, message });
                }
                self.tripped = true;
            }
            self.apply_sensor_fault(begin_s, &fault, &mut batch);
            batch = self.apply_stream_fault(begin_s, &fault, batch);
            if fault == Fault::Doubled && batch.first_sequence > 0 {
                // The batch looks like a repeat of the previous one.
                batch.first_sequence -= 1;
            }
        }
        Ok(batch)
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.unreachable("hold")?;
        self.held_at_s.push(self.now_s);
        self.inner.hold()
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        for (_, fault) in &mut self.faults {
            if let Fault::NotSafe(left) = fault
                && *left > 0
            {
                *left -= 1;
                return Err(BackendError::Lost {
                    t_s: self.now_s,
                    source: Box::new(InjectedFault("the valve of the air supply does not answer")),
                });
            }
        }
        self.unreachable("make_safe")?;
        self.safe_at_s.push(self.now_s);
        match self.active_faults().iter().any(|(_, fault)| *fault == Fault::NotMadeSafe) {
            true => Ok(()),
            false => self.inner.make_safe(),
        }
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.inner.disarm()
    }
}
