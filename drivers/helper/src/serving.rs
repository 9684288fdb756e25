//! One host, from its first word until it is gone and the rig is safe; signals, and the clock.

use crate::outlet::Outlet;
use crate::server::Server;
use mapper_protocol::{FRAME_LIMIT_BYTES, Message, decode, read_frame};
use std::io::Read;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::time::{Duration, Instant};

/// Messages of the host that wait for a rig that is busy; more wait in its pipe.
pub(crate) const WAITING: usize = 256;
/// Longest wait, s.
const LONGEST_S: f64 = 3600.0;

/// What happens to a driver.
pub(crate) enum Came {
    /// A host has come to the socket.
    #[cfg(unix)]
    Connected(std::os::unix::net::UnixStream),
    Message(Box<Message>),
    /// The host is gone, or talks what nobody understands.
    Closed,
    /// A signal asks it to end.
    Terminate,
}

/// Serves this host. Whether a signal asked to end meanwhile.
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
        // Whoever comes while another is served is turned away at the door.
        #[cfg(unix)]
        Came::Connected(_) => {}
    };
    while !server.is_over() {
        // What has come while the rig was busy has come in time.
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

/// A name that no other session of this driver has: its process and when it began.
pub(crate) fn session() -> String {
    let since = std::time::UNIX_EPOCH.elapsed().unwrap_or_default();
    format!("{}-{}", std::process::id(), since.as_nanos())
}

/// What happens next, within so many seconds; `None`: nothing has.
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

/// Passes on what a host says, and at last that it is gone.
pub(crate) fn listen(mut host: impl Read + Send + 'static, tell: SyncSender<Came>) -> std::io::Result<()> {
    let read = move || {
        while let Ok(Some(body)) = read_frame(&mut host, FRAME_LIMIT_BYTES) {
            let Ok(message) = decode(&body) else { break };
            if tell.send(Came::Message(Box::new(message))).is_err() {
                return;
            }
        }
        // Nobody is left to be told where this fails.
        let _ = tell.send(Came::Closed);
    };
    std::thread::Builder::new().name("from host".to_owned()).spawn(read).map(drop)
}

#[cfg(unix)]
pub(crate) fn heed_signals(tell: SyncSender<Came>) -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGTERM, SIGHUP, SIGINT])?;
    let heed = move || {
        for _ in signals.forever() {
            if tell.send(Came::Terminate).is_err() {
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
