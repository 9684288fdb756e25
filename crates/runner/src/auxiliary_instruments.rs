//! The rig with auxiliary instruments as one backend; each instrument is read on its own thread, so that a slow one delays nothing.

use crate::deadline::{Answer, ENDED, answer_on_thread, catch_panic, lost_error};
use mapper_core::{
    Backend, BackendError, Channel, ChannelColumn, ElementColumn, Event, EventKind, Provenance, Quality,
    RigDescription, SampleBatch, Setpoints, TruthColumn,
};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

/// Time offset of a late reading from the last sample that was passed on, s.
const LATE_OFFSET_S: f64 = 1e-6;
/// Maximum number of readings of one instrument that wait for rig samples; an instrument that sends more is lost.
const MAX_WAITING: usize = 100_000;

/// An auxiliary instrument.
pub struct AuxiliaryInstrument {
    /// Display name.
    pub name: String,
    /// Its backend.
    pub backend: Box<dyn Backend>,
    /// Channels that it provides.
    pub channels: Vec<Channel>,
}

struct Source {
    name: String,
    channels: Vec<Channel>,
    link: InstrumentLink,
    /// Run time minus the instrument's own time, s.
    offset_s: f64,
    /// Readings later than the rig's last sample, in run time.
    waiting: SampleBatch,
    /// The instrument is no longer read.
    lost: bool,
}

/// A rig whose samples include the readings of auxiliary instruments.
pub struct RigWithInstruments {
    description: RigDescription,
    rig: Box<dyn Backend>,
    sources: Vec<Source>,
    next_sequence: u64,
    /// Time of the last sample that was passed on, and of the rig's own last one, s.
    last_s: Option<f64>,
    rig_last_s: Option<f64>,
}

impl RigWithInstruments {
    /// `rig` with the auxiliary instruments `readers`. In simulated time each instrument is polled together with the rig. Otherwise each
    /// has its own thread, and `deadline` to connect.
    pub fn new(
        rig: Box<dyn Backend>,
        readers: Vec<AuxiliaryInstrument>,
        deadline: Duration,
    ) -> Result<Self, BackendError> {
        let rig_description = rig.describe();
        let simulated_time = rig_description.simulated_time
            && readers.iter().all(|reader| reader.backend.describe().simulated_time);
        let instrument_channels: Vec<Channel> =
            readers.iter().flat_map(|reader| reader.channels.clone()).collect();
        let mut channels: Vec<Channel> = rig_description
            .channels
            .iter()
            .copied()
            .filter(|channel| !instrument_channels.contains(channel))
            .collect();
        channels.extend(instrument_channels);
        channels.sort();
        let source = |reader: AuxiliaryInstrument| {
            Ok(Source {
                name: reader.name,
                channels: reader.channels,
                link: InstrumentLink::new(reader.backend, simulated_time, deadline)?,
                offset_s: 0.0,
                waiting: SampleBatch::default(),
                lost: false,
            })
        };
        Ok(RigWithInstruments {
            description: RigDescription { channels, simulated_time, ..rig_description },
            rig,
            sources: readers.into_iter().map(source).collect::<Result<_, BackendError>>()?,
            next_sequence: 0,
            last_s: None,
            rig_last_s: None,
        })
    }

    /// Merges the rig's samples with the readings up to them.
    fn merge(&mut self, rig: SampleBatch) -> SampleBatch {
        let last_s = rig.t_s.last().copied().or(self.rig_last_s);
        self.rig_last_s = last_s;
        let mut parts: Vec<SampleBatch> = Vec::new();
        for source in &mut self.sources {
            let due = last_s.map_or(0, |last_s| source.waiting.t_s.partition_point(|t_s| *t_s <= last_s));
            let later = source.waiting.split_off(due);
            let mut part = std::mem::replace(&mut source.waiting, later);
            delay_late_readings(&mut part, self.last_s);
            parts.push(part);
        }
        let mut t_s: Vec<f64> = parts.iter().flat_map(|part| part.t_s.iter().copied()).collect();
        t_s.extend(&rig.t_s);
        t_s.sort_by(f64::total_cmp);
        t_s.dedup();
        let instrument_channels =
            |channel: &Channel| self.sources.iter().any(|source| source.channels.contains(channel));
        let fast = parts.iter_mut().flat_map(|part| std::mem::take(&mut part.fast));
        let fast = rig.fast.iter().cloned().chain(fast).collect();
        let mut merged = SampleBatch { first_sequence: self.next_sequence, fast, ..SampleBatch::default() };
        // Only the rig provides truth.
        merged.truth = resample_truth(&rig, &t_s);
        add_channels(&mut merged, rig, &t_s, &|channel| !instrument_channels(&channel));
        for (source, part) in self.sources.iter().zip(parts) {
            add_channels(&mut merged, part, &t_s, &|channel| source.channels.contains(&channel));
        }
        // A channel without a reading has a column of NaN.
        for channel in &self.description.channels {
            if merged.column(*channel).is_none() {
                merged.columns.push(ChannelColumn { channel: *channel, values: vec![f64::NAN; t_s.len()] });
            }
        }
        merged.columns.sort_by_key(|column| column.channel);
        merged.events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
        self.next_sequence += t_s.len() as u64;
        self.last_s = t_s.last().copied().or(self.last_s);
        merged.t_s = t_s;
        merged
    }

    fn disconnect(&mut self) {
        // Errors while disconnecting are ignored: the rig is released anyway.
        self.sources.iter_mut().for_each(|source| drop(source.link.disarm()));
    }
}

impl Source {
    /// Takes an answer of the instrument, converted to run time. Its events go into `events` as notes.
    fn add_answer(&mut self, answer: Answer, until_s: f64, events: &mut Vec<Event>) {
        let note = |message| Event { t_s: until_s, kind: EventKind::Note, message };
        match answer {
            Ok(mut batch) => {
                let offset_s = self.offset_s;
                batch.t_s.iter_mut().for_each(|t_s| *t_s += offset_s);
                batch.fast.iter_mut().for_each(|fast| fast.first_s += offset_s);
                for from in &mut batch.provenance {
                    from.source_t_s.iter_mut().for_each(|t_s| *t_s += offset_s);
                }
                for event in std::mem::take(&mut batch.events) {
                    let t_s = (event.t_s + offset_s).clamp(0.0, until_s.max(0.0));
                    let message = format!("{}: {}", self.name, event.message);
                    // An event of an instrument is not a trip of the rig.
                    events.push(Event { t_s, kind: EventKind::Note, message });
                }
                // Readings from before the start of the run are dropped.
                let early_count = batch.t_s.partition_point(|t_s| *t_s < 0.0);
                let fast = std::mem::take(&mut batch.fast);
                let batch = SampleBatch { fast, ..batch.split_off(early_count) };
                if is_valid(&batch, self.waiting.t_s.last().copied())
                    && self.waiting.t_s.len() + batch.t_s.len() <= MAX_WAITING
                {
                    self.waiting.append(batch);
                    return;
                }
                self.lost = true;
                events.push(note(format!(
                    "the reader `{}` sends invalid samples and is no longer read",
                    self.name
                )));
            }
            Err(error) => {
                self.lost = true;
                events.push(note(format!("the reader `{}` is no longer read: {error}", self.name)));
            }
        }
    }
}

impl Backend for RigWithInstruments {
    fn describe(&self) -> RigDescription {
        self.description.clone()
    }

    /// Arms the instruments first: the rig stays untouched if one of them is unavailable.
    fn arm(&mut self) -> Result<(), BackendError> {
        let mut armed_at = Vec::with_capacity(self.sources.len());
        for index in 0..self.sources.len() {
            let Some(source) = self.sources.get_mut(index) else { break };
            if let Err(error) = source.link.arm() {
                let source = format!("the reader `{}`: {error}", source.name).into();
                self.disconnect();
                return Err(BackendError::Lost { t_s: 0.0, source });
            }
            (source.waiting, source.lost) = (SampleBatch::default(), false);
            armed_at.push(Instant::now());
        }
        if let Err(error) = self.rig.arm() {
            self.disconnect();
            return Err(error);
        }
        // In simulated time all sources start at 0.
        let now = Instant::now();
        for (source, at) in self.sources.iter_mut().zip(armed_at) {
            let since_s = now.duration_since(at).as_secs_f64();
            source.offset_s = if self.description.simulated_time { 0.0 } else { -since_s };
        }
        (self.next_sequence, self.last_s, self.rig_last_s) = (0, None, None);
        Ok(())
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.rig.set(setpoints)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        for source in self.sources.iter_mut().filter(|source| !source.lost) {
            source.link.request(until_s - source.offset_s);
        }
        let rig = self.rig.poll(until_s)?;
        let mut events = Vec::new();
        for source in self.sources.iter_mut().filter(|source| !source.lost) {
            while let Some(answer) = source.link.answer() {
                source.add_answer(answer, until_s, &mut events);
                if source.lost {
                    break;
                }
            }
        }
        let mut merged = self.merge(rig);
        merged.events.extend(events);
        Ok(merged)
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.rig.hold()
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.rig.make_safe()
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.rig.disarm()?;
        self.disconnect();
        Ok(())
    }
}

/// Whether the samples continue after `last_s`, with columns of equal length.
fn is_valid(batch: &SampleBatch, last_s: Option<f64>) -> bool {
    let samples = batch.t_s.len();
    let lengths = batch.columns.iter().map(|column| column.values.len());
    let lengths = lengths.chain(batch.elements.iter().map(|column| column.values.len()));
    let from = batch.provenance.iter().flat_map(|from| [from.source_t_s.len(), from.quality.len()]);
    batch.t_s.iter().all(|t_s| t_s.is_finite())
        && batch.t_s.is_sorted_by(|a, b| a < b)
        && batch.t_s.first().zip(last_s).is_none_or(|(first_s, last_s)| *first_s > last_s)
        && lengths.chain(from).all(|length| length == samples)
}

/// Moves late readings behind `last_s`; they keep their source time.
fn delay_late_readings(part: &mut SampleBatch, last_s: Option<f64>) {
    let Some(last_s) = last_s else { return };
    let late_count = part.t_s.partition_point(|t_s| *t_s <= last_s);
    if late_count == 0 {
        return;
    }
    for column in &part.columns {
        if part.provenance.iter().all(|from| from.channel != column.channel) {
            let (source_t_s, quality) = (part.t_s.clone(), vec![Quality::Good; part.t_s.len()]);
            part.provenance.push(Provenance { channel: column.channel, source_t_s, quality });
        }
    }
    let mut shifted_s = last_s;
    for t_s in &mut part.t_s {
        if *t_s > shifted_s {
            break;
        }
        // A step of one microsecond, or of the last bit if that is larger.
        shifted_s = (shifted_s + LATE_OFFSET_S).max(shifted_s.next_up());
        *t_s = shifted_s;
    }
}

/// Distributes values over a superset of their times; `absent` elsewhere.
fn resample<T: Copy>(values: &[T], own_s: &[f64], t_s: &[f64], absent: T) -> Vec<T> {
    if own_s.len() == t_s.len() {
        return values.to_vec();
    }
    let mut samples = own_s.iter().zip(values).peekable();
    t_s.iter()
        .map(|t_s| samples.next_if(|(own_s, _)| **own_s == *t_s).map_or(absent, |(_, value)| *value))
        .collect()
}

fn resample_truth(rig: &SampleBatch, t_s: &[f64]) -> Vec<TruthColumn> {
    let column = |column: &TruthColumn| TruthColumn {
        values: resample(&column.values, &rig.t_s, t_s, f64::NAN),
        name: column.name.clone(),
        unit: column.unit.clone(),
    };
    rig.truth.iter().map(column).collect()
}

fn add_channels(
    merged: &mut SampleBatch,
    part: SampleBatch,
    t_s: &[f64],
    selected: &dyn Fn(Channel) -> bool,
) {
    for column in part.columns.into_iter().filter(|column| selected(column.channel)) {
        let values = resample(&column.values, &part.t_s, t_s, f64::NAN);
        merged.columns.push(ChannelColumn { values, ..column });
    }
    for column in part.elements.into_iter().filter(|column| selected(column.element.channel)) {
        let values = resample(&column.values, &part.t_s, t_s, f64::NAN);
        merged.elements.push(ElementColumn { values, ..column });
    }
    for from in part.provenance.into_iter().filter(|from| selected(from.channel)) {
        let mut source_t_s = resample(&from.source_t_s, &part.t_s, t_s, f64::NAN);
        // A time without a reading of this source is not old.
        for (source_s, t_s) in source_t_s.iter_mut().zip(t_s).filter(|(source_s, _)| source_s.is_nan()) {
            *source_s = *t_s;
        }
        let quality = resample(&from.quality, &part.t_s, t_s, Quality::Good);
        merged.provenance.push(Provenance { source_t_s, quality, ..from });
    }
    merged.events.extend(part.events);
}

pub(crate) enum Call {
    Arm,
    Poll(f64),
    Disarm,
}

pub(crate) enum InstrumentLink {
    /// Called directly: in simulated time all sources wait for each other.
    Direct { backend: Box<dyn Backend>, answer: Option<Answer> },
    /// Called on its own thread, in real time.
    OwnThread {
        calls: Sender<Call>,
        answers: Receiver<Answer>,
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
