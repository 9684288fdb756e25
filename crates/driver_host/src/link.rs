//! The link to a driver, and the queue of its samples.

use crate::find::DriverError;
use crate::protocol::{
    Encoding, FRAME_LIMIT_BYTES, FrameError, InvalidData, Message, RENEW_S, decode, encode, read_frame,
    write_frame,
};
use mapper_core::{BackendError, Channel, ChannelColumn, Event, EventKind, FastSamples, SampleBatch};
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Queue length in each direction, messages.
const QUEUE_LENGTH: usize = 64;
/// Wait for the driver's final error output after its output has ended.
const LAST_OUTPUT_TIMEOUT: Duration = Duration::from_millis(200);
/// Size of the stored final error output, bytes.
const LAST_OUTPUT_BYTES: usize = 2_000;

type Incoming = Result<Message, DriverError>;

/// Sends from any thread in the driver's own encoding. Before the first message from the driver it uses JSON, which every driver reads.
#[derive(Clone)]
pub(crate) struct MessageSender {
    to_write: SyncSender<Vec<u8>>,
    uses_message_pack: Arc<AtomicBool>,
}

impl MessageSender {
    pub(crate) fn send(&self, message: &Message) -> Result<(), DriverError> {
        let uses_message_pack = self.uses_message_pack.load(Ordering::Relaxed);
        let encoding = if uses_message_pack { Encoding::MessagePack } else { Encoding::Json };
        let body =
            encode(message, encoding).map_err(|error| DriverError::InvalidMessage(error.to_string()))?;
        self.to_write.try_send(body).map_err(|error| match error {
            TrySendError::Full(_) => DriverError::NotReading,
            TrySendError::Disconnected(_) => DriverError::Ended(String::new()),
        })
    }
}

enum Peer {
    Program(Child),
    /// A driver that was already running.
    #[cfg(unix)]
    Socket(std::os::unix::net::UnixStream),
}

pub(crate) struct Link {
    peer: Peer,
    sender: Option<MessageSender>,
    received: Receiver<Incoming>,
    frame_limit: Arc<AtomicU32>,
    last_output: Arc<Mutex<Vec<u8>>>,
    /// Closed by the reading thread after the last message.
    stderr_closed: Receiver<()>,
}

impl Link {
    pub(crate) fn start(program: &Path) -> Result<Link, DriverError> {
        let not_started = |source| DriverError::NotStarted { program: program.to_owned(), source };
        let mut command = Command::new(program);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // Ctrl-C in a terminal reaches the whole process group; the runner decides on the reaction.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(not_started)?;
        let (Some(stdin), Some(stdout), Some(stderr)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(not_started(std::io::Error::other("the pipes were not created")));
        };
        Link::from_streams(stdin, stdout, stderr, Peer::Program(child)).map_err(not_started)
    }

    #[cfg(unix)]
    pub(crate) fn connect(socket: &Path) -> Result<Link, DriverError> {
        let not_listening = |source| DriverError::NotListening { socket: socket.to_owned(), source };
        let stream = std::os::unix::net::UnixStream::connect(socket).map_err(not_listening)?;
        let clone_stream = || stream.try_clone().map_err(not_listening);
        let (input, output) = (SocketWriter(clone_stream()?), clone_stream()?);
        Link::from_streams(input, output, std::io::empty(), Peer::Socket(stream)).map_err(not_listening)
    }

    fn from_streams(
        input: impl Write + Send + 'static,
        output: impl Read + Send + 'static,
        stderr: impl Read + Send + 'static,
        peer: Peer,
    ) -> std::io::Result<Link> {
        let frame_limit = Arc::new(AtomicU32::new(crate::protocol::FIRST_FRAME_LIMIT_BYTES));
        let (send, to_write) = sync_channel(QUEUE_LENGTH);
        let (to_incoming, received) = sync_channel(QUEUE_LENGTH);
        let last_output = Arc::new(Mutex::new(Vec::new()));
        let uses_message_pack = Arc::new(AtomicBool::new(false));
        let (stderr_open, stderr_closed) = sync_channel::<()>(1);
        let (limit, stderr_tail, encoding_flag) =
            (frame_limit.clone(), last_output.clone(), uses_message_pack.clone());
        // These threads are not joined: each ends with its pipe.
        let thread = |name: &str| std::thread::Builder::new().name(name.to_owned());
        thread("to driver").spawn(move || write_all(input, &to_write, &limit))?;
        thread("from driver").spawn(move || read_all(output, &to_incoming, &encoding_flag))?;
        thread("driver stderr").spawn(move || {
            collect_stderr(stderr, &stderr_tail);
            drop(stderr_open);
        })?;
        Ok(Link {
            peer,
            sender: Some(MessageSender { to_write: send, uses_message_pack }),
            received,
            frame_limit,
            last_output,
            stderr_closed,
        })
    }

    pub(crate) fn sender(&self) -> Result<&MessageSender, DriverError> {
        self.sender.as_ref().ok_or_else(|| DriverError::Ended(String::new()))
    }

    pub(crate) fn limit_frames(&self, bytes: u32) {
        self.frame_limit.store(bytes, Ordering::Relaxed);
    }

    pub(crate) fn receive(&self, within: Duration) -> Result<Option<Message>, DriverError> {
        match self.received.recv_timeout(within) {
            Ok(incoming) => incoming.map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(DriverError::Ended(self.last_error_line())),
        }
    }

    fn last_error_line(&self) -> String {
        // The output has ended, but the final error output may still be on its way.
        let _ = self.stderr_closed.recv_timeout(LAST_OUTPUT_TIMEOUT);
        let Ok(stderr_tail) = self.last_output.lock() else { return String::new() };
        let text = String::from_utf8_lossy(&stderr_tail);
        let line = text.lines().map(str::trim).rfind(|line| !line.is_empty());
        line.map_or_else(String::new, |line| format!("; its last error output: {line}"))
    }

    /// Closes the driver's input or session. A driver that holds a rig is left to its safe trajectory; any other is ended after `within`.
    pub(crate) fn close(&mut self, holds_a_rig: bool, within: Duration) {
        self.sender = None;
        let end = Instant::now() + within;
        // The driver's output ends when it exits.
        while let Some(left) = end.checked_duration_since(Instant::now()) {
            if matches!(self.received.recv_timeout(left), Err(RecvTimeoutError::Disconnected)) {
                break;
            }
        }
        match &mut self.peer {
            Peer::Program(child) => {
                if !holds_a_rig && !matches!(child.try_wait(), Ok(Some(_))) {
                    // A driver whose output is closed is about to exit, so killing it is safe.
                    let _ = child.kill();
                    let _ = child.wait();
                }
            }
            #[cfg(unix)]
            Peer::Socket(stream) => {
                use std::net::Shutdown::{Both, Write};
                // The driver may have gone already.
                let _ = stream.shutdown(if holds_a_rig { Write } else { Both });
            }
        }
    }
}

/// The writing half of a socket. Dropping it closes that direction, as with a pipe, while the reading half stays open.
#[cfg(unix)]
struct SocketWriter(std::os::unix::net::UnixStream);

#[cfg(unix)]
impl Write for SocketWriter {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

#[cfg(unix)]
impl Drop for SocketWriter {
    fn drop(&mut self) {
        // This fails only if the other side is already closed.
        let _ = self.0.shutdown(std::net::Shutdown::Write);
    }
}

fn write_all(mut stdin: impl Write, to_write: &Receiver<Vec<u8>>, limit: &AtomicU32) {
    for body in to_write {
        if write_frame(&mut stdin, &body, limit.load(Ordering::Relaxed)).is_err() {
            break;
        }
    }
}

fn read_all(mut stdout: impl Read, to_incoming: &SyncSender<Incoming>, uses_message_pack: &AtomicBool) {
    loop {
        let incoming = match read_frame(&mut stdout, FRAME_LIMIT_BYTES) {
            Ok(Some(body)) => {
                uses_message_pack.store(Encoding::of(&body) == Encoding::MessagePack, Ordering::Relaxed);
                decode(&body)
            }
            Ok(None) => break,
            Err(error) => Err(error),
        };
        let incoming = incoming.map_err(|error: FrameError| DriverError::InvalidMessage(error.to_string()));
        let is_invalid = incoming.is_err();
        // After an invalid message the start of the next frame is unknown.
        if to_incoming.send(incoming).is_err() || is_invalid {
            break;
        }
    }
}

fn collect_stderr(mut stderr: impl Read, stderr_tail: &Mutex<Vec<u8>>) {
    let mut piece = [0; 512];
    while let Ok(bytes @ 1..) = stderr.read(&mut piece) {
        let Ok(mut stderr_tail) = stderr_tail.lock() else { break };
        stderr_tail.extend_from_slice(&piece[..bytes]);
        let too_many = stderr_tail.len().saturating_sub(LAST_OUTPUT_BYTES);
        stderr_tail.drain(..too_many);
    }
}

/// A lease, renewed by a separate thread until it is dropped, as long as calls arrive.
pub(crate) struct Lease {
    last_call: Arc<Mutex<Instant>>,
    /// Dropped with the lease, which ends the thread.
    _end_thread: Sender<()>,
}

impl Lease {
    /// The lease of this session, not renewed after `silence` without calls: nobody supervises the rig. `None`: a simulation, which may wait.
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

/// Maximum number of queued values over all columns, at 8 bytes each, including names and texts: three hours of 19 channels at 10 Hz, 32 MB.
const MAX_VALUES: usize = 4_000_000;
/// Tolerance for due samples, s: the requested time is a sum of periods, the sample's time a multiple.
pub(crate) const ROUNDING_S: f64 = 1e-7;
const MAX_EVENTS: usize = 10_000;
/// Number of events above which a driver's notes are dropped.
const MAX_NOTES: usize = 100;

#[derive(Default)]
pub(crate) struct SampleQueue {
    batches: VecDeque<SampleBatch>,
    events: Vec<Event>,
    fast: Vec<FastSamples>,
    expected: u64,
    next: u64,
    last_s: Option<f64>,
    /// Time of the last returned sample, s.
    returned_until_s: Option<f64>,
    values: usize,
}

impl SampleQueue {
    pub(crate) fn push(&mut self, mut batch: SampleBatch) -> Result<(), InvalidData> {
        // An event from another clock might never be due. That must not happen to a trip of the rig.
        let latest_s = batch.t_s.last().copied().or(self.last_s).unwrap_or(0.0);
        for event in &mut batch.events {
            event.t_s = if event.t_s.is_finite() { event.t_s.min(latest_s) } else { latest_s };
        }
        self.events.append(&mut batch.events);
        let text: usize = self.events.iter().map(|event| event.message.len()).sum();
        if self.events.len() > MAX_EVENTS || self.values + text / 8 > MAX_VALUES {
            return Err(InvalidData::TooMany);
        }
        let fast: usize = batch.fast.iter().map(|fast| fast.values.len()).sum();
        self.values += fast;
        if self.values > MAX_VALUES {
            return Err(InvalidData::TooMany);
        }
        self.fast.append(&mut batch.fast);
        let Some(first_s) = batch.t_s.first().copied() else { return Ok(()) };
        if batch.first_sequence != self.expected {
            return Err(InvalidData::Sequence { expected: self.expected, found: batch.first_sequence });
        }
        if let Some(before_s) = self.last_s.filter(|last_s| first_s <= *last_s) {
            return Err(InvalidData::Time { before_s, t_s: first_s });
        }
        self.values += batch.t_s.len() * values_per_sample(&batch) + name_values(&batch);
        if self.values > MAX_VALUES {
            return Err(InvalidData::TooMany);
        }
        self.expected += batch.t_s.len() as u64;
        self.last_s = batch.t_s.last().copied();
        self.batches.push_back(batch);
        Ok(())
    }

    /// Adds a note at this run time, s, to the next batch; only a few are kept.
    pub(crate) fn note(&mut self, t_s: f64, text: &str) {
        if self.events.len() < MAX_NOTES {
            self.events.push(Event { t_s, kind: EventKind::Note, message: text.to_owned() });
        }
    }

    pub(crate) fn has_reached(&self, t_s: f64) -> bool {
        self.last_s.is_some_and(|last_s| last_s >= t_s)
    }

    /// Returns all samples up to `until_s` plus `rounding_s`, with a column for each of `channels`: NaN without a reading.
    pub(crate) fn take(&mut self, until_s: f64, rounding_s: f64, channels: &[Channel]) -> SampleBatch {
        let mut merged = SampleBatch {
            first_sequence: self.next,
            columns: channels.iter().map(|c| ChannelColumn { channel: *c, values: Vec::new() }).collect(),
            ..SampleBatch::default()
        };
        while let Some(mut batch) = self.batches.pop_front() {
            let mut due = batch.t_s.partition_point(|t_s| *t_s <= until_s);
            let before_s =
                due.checked_sub(1).and_then(|last| batch.t_s.get(last).copied()).or(self.returned_until_s);
            if let Some(t_s) = batch.t_s.get_mut(due)
                && *t_s <= until_s + rounding_s
                && before_s.is_none_or(|before_s| before_s < until_s)
            {
                (*t_s, due) = (until_s, due + 1);
            }
            if due > 0 {
                self.returned_until_s = batch.t_s.get(due - 1).copied();
            }
            self.values = self.values.saturating_sub(due * values_per_sample(&batch));
            let later = batch.split_off(due);
            if later.t_s.is_empty() {
                self.values = self.values.saturating_sub(name_values(&batch));
            }
            merged.append(batch);
            if !later.t_s.is_empty() {
                self.batches.push_front(later);
                break;
            }
        }
        merged.columns.retain(|column| channels.contains(&column.channel));
        self.next += merged.t_s.len() as u64;
        let (now, later) =
            std::mem::take(&mut self.events).into_iter().partition(|e: &Event| e.t_s <= until_s);
        (merged.events, self.events) = (now, later);
        merged.fast = std::mem::take(&mut self.fast);
        self.values -= merged.fast.iter().map(|fast| fast.values.len()).sum::<usize>().min(self.values);
        merged
    }
}

fn values_per_sample(batch: &SampleBatch) -> usize {
    1 + batch.columns.len() + batch.elements.len() + batch.truth.len() + 2 * batch.provenance.len()
}

/// Memory of the names in a batch, in values.
fn name_values(batch: &SampleBatch) -> usize {
    batch.truth.iter().map(|column| column.name.len() + column.unit.len()).sum::<usize>() / 8
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Provenance, Quality};

    fn batch(first_sequence: u64, t_s: &[f64], channels: &[Channel]) -> SampleBatch {
        let column = |channel: &Channel| ChannelColumn { channel: *channel, values: t_s.to_vec() };
        SampleBatch {
            first_sequence,
            t_s: t_s.to_vec(),
            columns: channels.iter().map(column).collect(),
            ..SampleBatch::default()
        }
    }

    #[test]
    fn repeated_missing_and_backward_batches_are_refused_and_valid_ones_stay() {
        use Channel::{T1, T2};
        let mut pending = SampleQueue::default();
        pending.push(batch(0, &[0.0, 0.1], &[T1, T2])).unwrap();
        let again = pending.push(batch(0, &[0.0, 0.1], &[T1, T2]));
        assert_eq!(again, Err(InvalidData::Sequence { expected: 2, found: 0 }));
        let missing = pending.push(batch(3, &[0.3], &[T1, T2]));
        assert_eq!(missing, Err(InvalidData::Sequence { expected: 2, found: 3 }));
        let backward = pending.push(batch(2, &[0.05], &[T1, T2]));
        assert_eq!(backward, Err(InvalidData::Time { before_s: 0.1, t_s: 0.05 }));
        let mut worse = batch(2, &[0.2, 0.3], &[T1]);
        worse.provenance =
            vec![Provenance { channel: T1, source_t_s: vec![0.1, 0.1], quality: vec![Quality::Bad; 2] }];
        pending.push(worse).unwrap();
        assert!(pending.has_reached(0.3) && !pending.has_reached(0.31));
        let merged = pending.take(0.25, 0.0, &[T1, T2]);
        assert_eq!((merged.first_sequence, &merged.t_s[..]), (0, &[0.0, 0.1, 0.2][..]));
        assert_eq!(merged.column(T1), Some(&[0.0, 0.1, 0.2][..]));
        assert!(merged.column(T2).unwrap()[2].is_nan());
        let from = merged.provenance_of(T1).unwrap();
        assert_eq!(from.source_t_s, [0.0, 0.1, 0.1]);
        assert_eq!(from.quality, [Quality::Good, Quality::Good, Quality::Bad]);
        let rest = pending.take(9.0, 0.0, &[T1, T2]);
        assert_eq!((rest.first_sequence, &rest.t_s[..]), (3, &[0.3][..]));
    }

    /// Seven times 0.1 added up is slightly less than 0.7. Without the tolerance, a sample would reach its guard one poll later.
    #[test]
    fn a_sample_is_not_late_by_rounding() {
        let mut pending = SampleQueue::default();
        let (sum_s, multiple_s) = ([0.1; 7].iter().sum::<f64>(), 7.0 * 0.1);
        assert!(sum_s < multiple_s);
        pending.push(batch(0, &[multiple_s], &[Channel::T1])).unwrap();
        assert_eq!(pending.take(sum_s, ROUNDING_S, &[Channel::T1]).t_s, [sum_s]);
        pending.push(batch(1, &[multiple_s + 1e-3], &[Channel::T1])).unwrap();
        assert!(pending.take(multiple_s, ROUNDING_S, &[Channel::T1]).t_s.is_empty());
    }

    #[test]
    fn an_event_with_an_unsynchronised_time_is_returned_with_its_samples() {
        let mut pending = SampleQueue::default();
        let tripped = Event { t_s: 1.8e9, kind: EventKind::RigTripped, message: "overspeed".to_owned() };
        let with_it = SampleBatch { events: vec![tripped], ..batch(0, &[0.0, 0.1], &[Channel::T1]) };
        pending.push(with_it).unwrap();
        assert_eq!(pending.take(0.1, 0.0, &[Channel::T1]).events[0].t_s, 0.1);
    }

    #[test]
    fn texts_and_names_count_towards_the_limit() {
        let mut pending = SampleQueue::default();
        let long = Event { t_s: 0.0, kind: EventKind::Note, message: "x".repeat(1 << 20) };
        let flood = (0..100).try_for_each(|_| {
            pending.push(SampleBatch { events: vec![long.clone()], ..SampleBatch::default() })
        });
        assert_eq!(flood, Err(InvalidData::TooMany));
    }

    #[test]
    fn the_queue_is_limited() {
        let mut pending = SampleQueue::default();
        let t_s: Vec<f64> = (0..100_000).map(f64::from).collect();
        let flood = (0..50).try_for_each(|i| {
            let later: Vec<f64> = t_s.iter().map(|t_s| t_s + f64::from(i) * 1e5).collect();
            pending.push(batch(i as u64 * 100_000, &later, &[Channel::T1]))
        });
        assert_eq!(flood, Err(InvalidData::TooMany));
    }
}
