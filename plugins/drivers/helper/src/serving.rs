//! Serves one host, from its first message until it disconnects and the rig is safe; signals, and the clock.

use crate::output_queue::OutputQueue;
use crate::server::Server;
use mapper_driver_host::protocol::{FRAME_LIMIT_BYTES, Message, decode, read_frame};
use std::io::Read;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::time::{Duration, Instant};

/// Queue of the host's messages while the rig is busy; further messages wait in its pipe.
pub(crate) const QUEUE_LENGTH: usize = 256;
/// Maximum wait, s.
const MAX_WAIT_S: f64 = 3600.0;

/// An event of the driver.
pub(crate) enum DriverEvent {
    /// A host has connected to the socket.
    #[cfg(unix)]
    Connected(std::os::unix::net::UnixStream),
    Message(Box<Message>),
    /// The host has disconnected, or sent an invalid frame.
    Closed,
    /// A signal requests termination.
    Terminate,
}

/// Serves this host. Returns whether a signal requested termination meanwhile.
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

/// A unique name of a session of this driver: its process and start time.
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

/// Forwards the host's messages, and finally that it has disconnected.
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
