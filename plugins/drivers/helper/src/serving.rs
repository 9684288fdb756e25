//! Serves one host, from its first message until it disconnects and the rig is safe; signals, the clock, and the output queue: a host that does
//! not read must not block the driver.

use crate::server::Server;
use mapper_driver_host::protocol::{
    Encoding, FRAME_LIMIT_BYTES, Message, decode, encode, read_frame, write_frame,
};
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// Queue of the host's messages while the rig is busy; further messages wait in its pipe.
pub(crate) const QUEUE_LENGTH: usize = 256;
/// Maximum wait, s.
const MAX_WAIT_S: f64 = 3600.0;

pub(crate) enum DriverEvent {
    #[cfg(unix)]
    Connected(std::os::unix::net::UnixStream),
    Message(Box<Message>),
    /// The host has disconnected, or sent an invalid frame.
    Closed,
    Terminate,
}

pub(crate) fn serve_one(mut server: Server, events: &Receiver<DriverEvent>, output: &OutputQueue) -> bool {
    let start = Instant::now();
    let now_s = || start.elapsed().as_secs_f64();
    let mut terminate = false;
    let mut handle_event = |server: &mut Server, event: DriverEvent, now_s: f64| match event {
        DriverEvent::Message(message) => server.handle_message(now_s, *message),
        DriverEvent::Closed => server.leave(now_s),
        DriverEvent::Terminate => {
            terminate = true;
            server.leave(now_s);
        }
        // The accept thread refuses a host while another one is served.
        #[cfg(unix)]
        DriverEvent::Connected(_) => {}
    };
    while !server.is_over() {
        // Messages that arrived while the rig was busy count as in time.
        while let Ok(event) = events.try_recv() {
            handle_event(&mut server, event, now_s());
        }
        let next_s = server.tick(now_s());
        send(&mut server, output);
        if server.is_over() {
            break;
        }
        if let Some(event) = wait_for_event(events, next_s) {
            handle_event(&mut server, event, now_s());
        }
        send(&mut server, output);
    }
    terminate
}

pub(crate) fn new_session_name() -> String {
    let since = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    format!("{}-{}", std::process::id(), since.as_nanos())
}

/// The next event, within this many seconds; `None`: there was none.
pub(crate) fn wait_for_event(events: &Receiver<DriverEvent>, next_s: Option<f64>) -> Option<DriverEvent> {
    let within = Duration::from_secs_f64(next_s.unwrap_or(MAX_WAIT_S).clamp(0.0, MAX_WAIT_S));
    match events.recv_timeout(within) {
        Ok(event) => Some(event),
        Err(RecvTimeoutError::Timeout) => None,
        Err(RecvTimeoutError::Disconnected) => Some(DriverEvent::Closed),
    }
}

fn send(server: &mut Server, output: &OutputQueue) {
    let limit_bytes = server.frame_limit_bytes() as usize;
    for message in std::mem::take(&mut server.out) {
        output.send(&message, limit_bytes);
    }
}

pub(crate) fn forward_messages(
    mut host: impl Read + Send + 'static,
    sender: SyncSender<DriverEvent>,
) -> std::io::Result<()> {
    let read = move || {
        while let Ok(Some(body)) = read_frame(&mut host, FRAME_LIMIT_BYTES) {
            let Ok(message) = decode(&body) else { break };
            if sender.send(DriverEvent::Message(Box::new(message))).is_err() {
                return;
            }
        }
        // If this fails, the receiver is gone.
        let _ = sender.send(DriverEvent::Closed);
    };
    std::thread::Builder::new().name("from host".to_owned()).spawn(read).map(drop)
}

#[cfg(unix)]
pub(crate) fn forward_signals(sender: SyncSender<DriverEvent>) -> std::io::Result<()> {
    use signal_hook::consts::*;
    // All that would end the process with the rig armed.
    let ending_signals = [
        SIGTERM, SIGHUP, SIGINT, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGXCPU,
        SIGXFSZ, SIGABRT,
    ];
    let mut signals = signal_hook::iterator::Signals::new(ending_signals)?;
    let handle_event = move || {
        for _ in signals.forever() {
            if sender.send(DriverEvent::Terminate).is_err() {
                return;
            }
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(handle_event).map(drop)
}

#[cfg(not(unix))]
pub(crate) fn forward_signals(_: SyncSender<DriverEvent>) -> std::io::Result<()> {
    Ok(())
}

/// Queue for a host that does not read: some seconds of samples. Further samples are dropped, which the host detects.
const MAX_WAITING: usize = 256;
/// Extra places for answers and remarks, more than a host requests at a time. A rig that was made safe is in doubt until
/// its answer arrives.
const RESERVED: usize = 64;

pub(crate) struct OutputQueue {
    to_write: SyncSender<Vec<u8>>,
    waiting: Arc<AtomicUsize>,
}

impl OutputQueue {
    /// Writes to `pipe` on a thread of its own, which ends with the pipe.
    pub(crate) fn into_pipe(mut pipe: impl Write + Send + 'static) -> std::io::Result<OutputQueue> {
        let (to_write, bodies) = sync_channel::<Vec<u8>>(MAX_WAITING + RESERVED);
        let waiting = Arc::new(AtomicUsize::new(0));
        let counted = waiting.clone();
        std::thread::Builder::new().name("to host".to_owned()).spawn(move || {
            for body in bodies {
                counted.fetch_sub(1, Ordering::Relaxed);
                if write_frame(&mut pipe, &body, u32::MAX).is_err() {
                    break;
                }
            }
        })?;
        Ok(OutputQueue { to_write, waiting })
    }

    /// Sends without waiting. A message is dropped if the queue is full or the frame exceeds this limit. The loss shows as a
    /// missing number, or as a timeout of the request.
    pub(crate) fn send(&self, message: &Message, limit_bytes: usize) {
        let is_droppable = matches!(message.method.as_deref(), Some("samples" | "lost"));
        // No other thread adds to the queue, so it can only shrink meanwhile.
        if is_droppable && self.waiting.load(Ordering::Relaxed) >= MAX_WAITING {
            return;
        }
        let Ok(body) = encode(message, Encoding::MessagePack) else { return };
        if body.len() > limit_bytes {
            return;
        }
        // Counted before sending, since the writer may be faster.
        self.waiting.fetch_add(1, Ordering::Relaxed);
        if self.to_write.try_send(body).is_err() {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
    }
}
