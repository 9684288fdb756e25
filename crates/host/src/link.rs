//! The pipes to a driver. Two threads read and write, so that nobody waits for longer than he said.

use crate::error::DriverError;
use mapper_protocol::{
    Encoding, FRAME_LIMIT_BYTES, FrameError, Message, decode, encode, read_frame, write_frame,
};
use std::io::Read;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Messages that wait in each direction.
const WAITING: usize = 64;
/// How long they are waited for once its output has ended.
const LAST_WORDS_WITHIN: Duration = Duration::from_millis(200);
/// What is kept of a driver's last words, bytes.
const LAST_WORDS_BYTES: usize = 2_000;

/// What comes from a driver.
type Came = Result<Message, DriverError>;

/// Sends, from any thread, as the driver writes itself: JSON until it has said anything, which everybody reads.
#[derive(Clone)]
pub(crate) struct Outlet {
    to_write: SyncSender<Vec<u8>>,
    packed: Arc<AtomicBool>,
}

impl Outlet {
    /// Sends without waiting.
    pub(crate) fn send(&self, message: &Message) -> Result<(), DriverError> {
        let packed = self.packed.load(Ordering::Relaxed);
        let encoding = if packed { Encoding::MessagePack } else { Encoding::Json };
        let body = encode(message, encoding).map_err(|error| DriverError::Garbage(error.to_string()))?;
        self.to_write.try_send(body).map_err(|error| match error {
            TrySendError::Full(_) => DriverError::Deaf,
            TrySendError::Disconnected(_) => DriverError::Ended(String::new()),
        })
    }
}

/// A driver and its pipes.
pub(crate) struct Link {
    child: Child,
    outlet: Option<Outlet>,
    inlet: Receiver<Came>,
    frame_limit: Arc<AtomicU32>,
    last_words: Arc<Mutex<Vec<u8>>>,
    /// Closed by the thread that listens, once it has heard everything.
    heard: Receiver<()>,
}

impl Link {
    /// Starts a driver.
    pub(crate) fn start(program: &Path) -> Result<Link, DriverError> {
        let not_started = |source| DriverError::NotStarted { program: program.to_owned(), source };
        let mut command = Command::new(program);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // Ctrl-C in a terminal reaches a whole group: what is to be done about it, the runner decides.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(not_started)?;
        let (Some(stdin), Some(stdout), Some(stderr)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err(not_started(std::io::Error::other("it has no pipes")));
        };
        let frame_limit = Arc::new(AtomicU32::new(mapper_protocol::FIRST_FRAME_LIMIT_BYTES));
        let (send, to_write) = sync_channel(WAITING);
        let (tell, inlet) = sync_channel(WAITING);
        let last_words = Arc::new(Mutex::new(Vec::new()));
        let packed = Arc::new(AtomicBool::new(false));
        let (listens, heard) = sync_channel::<()>(1);
        let (limit, words, its) = (frame_limit.clone(), last_words.clone(), packed.clone());
        // None of them is waited for: each ends with its pipe.
        std::thread::Builder::new()
            .name("to driver".to_owned())
            .spawn(move || write_all(stdin, &to_write, &limit))
            .and_then(|_| {
                std::thread::Builder::new()
                    .name("from driver".to_owned())
                    .spawn(move || read_all(stdout, &tell, &its))
            })
            .and_then(|_| {
                std::thread::Builder::new().name("driver's words".to_owned()).spawn(move || {
                    listen(stderr, &words);
                    drop(listens);
                })
            })
            .map_err(not_started)?;
        Ok(Link {
            child,
            outlet: Some(Outlet { to_write: send, packed }),
            inlet,
            frame_limit,
            last_words,
            heard,
        })
    }

    /// Where to send.
    pub(crate) fn outlet(&self) -> Result<&Outlet, DriverError> {
        self.outlet.as_ref().ok_or_else(|| DriverError::Ended(String::new()))
    }

    /// Largest frame that the driver takes, bytes.
    pub(crate) fn limit_frames(&self, bytes: u32) {
        self.frame_limit.store(bytes, Ordering::Relaxed);
    }

    /// The next message; `None` where none has come in time.
    pub(crate) fn next(&self, within: Duration) -> Result<Option<Message>, DriverError> {
        match self.inlet.recv_timeout(within) {
            Ok(came) => came.map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(DriverError::Ended(self.words())),
        }
    }

    /// What the driver said last on standard error, to be put behind a sentence.
    fn words(&self) -> String {
        // Its output has ended; its last words may still be on their way.
        let _ = self.heard.recv_timeout(LAST_WORDS_WITHIN);
        let Ok(words) = self.last_words.lock() else { return String::new() };
        let text = String::from_utf8_lossy(&words);
        let line = text.lines().map(str::trim).rfind(|line| !line.is_empty());
        line.map_or_else(String::new, |line| format!("; its last words: {line}"))
    }

    /// Closes the driver's input, which ends it. One that holds a rig is left to its own: it flies its safe trajectory. Any other has
    /// so much time, and is killed then.
    pub(crate) fn close(&mut self, holds_a_rig: bool, within: Duration) {
        self.outlet = None;
        let end = Instant::now() + within;
        // Its output ends with it.
        while let Some(left) = end.checked_duration_since(Instant::now()) {
            if matches!(self.inlet.recv_timeout(left), Err(RecvTimeoutError::Disconnected)) {
                break;
            }
        }
        if !holds_a_rig && !matches!(self.child.try_wait(), Ok(Some(_))) {
            // Where it has closed its output it is about to end; killing it then harms nobody.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

fn write_all(mut stdin: ChildStdin, to_write: &Receiver<Vec<u8>>, limit: &AtomicU32) {
    for body in to_write {
        if write_frame(&mut stdin, &body, limit.load(Ordering::Relaxed)).is_err() {
            break;
        }
    }
}

fn read_all(mut stdout: ChildStdout, tell: &SyncSender<Came>, packed: &AtomicBool) {
    loop {
        let came = match read_frame(&mut stdout, FRAME_LIMIT_BYTES) {
            Ok(Some(body)) => {
                packed.store(Encoding::of(&body) == Encoding::MessagePack, Ordering::Relaxed);
                decode(&body)
            }
            Ok(None) => break,
            Err(error) => Err(error),
        };
        let came = came.map_err(|error: FrameError| DriverError::Garbage(error.to_string()));
        let lost = came.is_err();
        // After garbage nobody knows where the next frame begins.
        if tell.send(came).is_err() || lost {
            break;
        }
    }
}

fn listen(mut stderr: impl Read, words: &Mutex<Vec<u8>>) {
    let mut piece = [0; 512];
    while let Ok(bytes @ 1..) = stderr.read(&mut piece) {
        let Ok(mut words) = words.lock() else { break };
        words.extend_from_slice(&piece[..bytes]);
        let too_many = words.len().saturating_sub(LAST_WORDS_BYTES);
        words.drain(..too_many);
    }
}
