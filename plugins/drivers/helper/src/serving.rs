//! Serves one host, from its first message until it disconnects and the rig is safe; signals, and the clock.

use crate::outlet::Outlet;
use crate::server::Server;
use mapper_driver_host::protocol::{FRAME_LIMIT_BYTES, Message, decode, read_frame};
use std::io::Read;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::time::{Duration, Instant};

/// Queue of the host's messages while the rig is busy; further messages wait in its pipe.
pub(crate) const WAITING: usize = 256;
/// Maximum wait, s.
const LONGEST_S: f64 = 3600.0;

/// An event of the driver.
pub(crate) enum Came {
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
pub(crate) fn serve_one(mut server: Server, news: &Receiver<Came>, outlet: &Outlet) -> bool {
    let begun = Instant::now();
    let now_s = || begun.elapsed().as_secs_f64();
    let mut asked_to_end = false;
    let mut heed = |server: &mut Server, came: Came, now_s: f64| match came {
        Came::Message(message) => server.take(now_s, *message),
        Came::Closed => server.leave(now_s),
        Came::Terminate => {
            asked_to_end = true;
            server.leave(now_s);
        }
        // The accept thread refuses a host while another one is served.
        #[cfg(unix)]
        Came::Connected(_) => {}
    };
    while !server.is_over() {
        // Messages that arrived while the rig was busy count as in time.
        while let Ok(came) = news.try_recv() {
            heed(&mut server, came, now_s());
        }
        let next_s = server.tick(now_s());
        send(&mut server, outlet);
        if server.is_over() {
            break;
        }
        if let Some(came) = wait(news, next_s) {
            heed(&mut server, came, now_s());
        }
        send(&mut server, outlet);
    }
    asked_to_end
}

/// A unique name of a session of this driver: its process and start time.
pub(crate) fn session() -> String {
    let since = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    format!("{}-{}", std::process::id(), since.as_nanos())
}

/// The next event, within this many seconds; `None`: there was none.
pub(crate) fn wait(news: &Receiver<Came>, next_s: Option<f64>) -> Option<Came> {
    let within = Duration::from_secs_f64(next_s.unwrap_or(LONGEST_S).clamp(0.0, LONGEST_S));
    match news.recv_timeout(within) {
        Ok(came) => Some(came),
        Err(RecvTimeoutError::Timeout) => None,
        Err(RecvTimeoutError::Disconnected) => Some(Came::Closed),
    }
}

fn send(server: &mut Server, outlet: &Outlet) {
    let limit_bytes = server.frame_limit_bytes() as usize;
    for message in std::mem::take(&mut server.out) {
        outlet.send(&message, limit_bytes);
    }
}

/// Forwards the host's messages, and finally that it has disconnected.
pub(crate) fn listen(mut host: impl Read + Send + 'static, sender: SyncSender<Came>) -> std::io::Result<()> {
    let read = move || {
        while let Ok(Some(body)) = read_frame(&mut host, FRAME_LIMIT_BYTES) {
            let Ok(message) = decode(&body) else { break };
            if sender.send(Came::Message(Box::new(message))).is_err() {
                return;
            }
        }
        // If this fails, the receiver is gone.
        let _ = sender.send(Came::Closed);
    };
    std::thread::Builder::new().name("from host".to_owned()).spawn(read).map(drop)
}

#[cfg(unix)]
pub(crate) fn heed_signals(sender: SyncSender<Came>) -> std::io::Result<()> {
    use signal_hook::consts::*;
    // All that would end the process with the rig armed.
    let ends = [
        SIGTERM, SIGHUP, SIGINT, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGIO, SIGXCPU,
        SIGXFSZ, SIGABRT,
    ];
    let mut signals = signal_hook::iterator::Signals::new(ends)?;
    let heed = move || {
        for _ in signals.forever() {
            if sender.send(Came::Terminate).is_err() {
                return;
            }
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(heed).map(drop)
}

#[cfg(not(unix))]
pub(crate) fn heed_signals(_: SyncSender<Came>) -> std::io::Result<()> {
    Ok(())
}
