//! The pipes or the socket to a driver. Separate threads read and write, so that no call exceeds its timeout; a third keeps the lease: the host
//! sends an armed driver a message twice a second, otherwise the driver executes its safe trajectory.

use crate::find::DriverError;
use crate::protocol::{
    Encoding, FRAME_LIMIT_BYTES, FrameError, Message, RENEW_S, decode, encode, read_frame, write_frame,
};
use mapper_core::BackendError;
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
    /// Sends without waiting.
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

/// The other end of the link.
enum Peer {
    /// A program started for this run, which ends with the run.
    Program(Child),
    /// A driver that was already running.
    #[cfg(unix)]
    Socket(std::os::unix::net::UnixStream),
}

/// A connection to a driver.
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

    /// Sets the maximum frame size of the driver, bytes.
    pub(crate) fn limit_frames(&self, bytes: u32) {
        self.frame_limit.store(bytes, Ordering::Relaxed);
    }

    /// The next message; `None` if none arrives in time.
    pub(crate) fn receive(&self, within: Duration) -> Result<Option<Message>, DriverError> {
        match self.received.recv_timeout(within) {
            Ok(incoming) => incoming.map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(DriverError::Ended(self.last_error_line())),
        }
    }

    /// The driver's final error output, to be appended to a sentence.
    fn last_error_line(&self) -> String {
        // The output has ended, but the final error output may still be on its way.
        let _ = self.stderr_closed.recv_timeout(LAST_OUTPUT_TIMEOUT);
        let Ok(stderr_tail) = self.last_output.lock() else { return String::new() };
        let text = String::from_utf8_lossy(&stderr_tail);
        let line = text.lines().map(str::trim).rfind(|line| !line.is_empty());
        line.map_or_else(String::new, |line| format!("; its last error output: {line}"))
    }

    /// Closes the driver's input, which ends the driver or, for a socket, its session. A driver that holds a rig is left to execute its safe
    /// trajectory. Any other driver is killed or disconnected after `within`.
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
