//! The server: a thread for each of few connections, one request each.

use crate::access::Access;
use crate::hub::Hub;
use crate::pressed::Pressed;
use crate::request::{ARRIVES_WITHIN, Request, read_request};
use crate::tls::{Punctual, Tls};
use std::collections::HashMap;
use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, TcpListener, TcpStream};
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Connections at once; further ones are closed.
const CONNECTIONS_MAX: usize = 32;
/// Connections of one address at once: nobody without the token takes all of them from the operator.
const CONNECTIONS_OF_ONE_MAX: usize = 8;
/// Longest time that a browser may keep one read or write waiting.
const PATIENCE: Duration = Duration::from_secs(5);
/// Bytes of a page that are written at once.
const PIECE: usize = 1 << 14;
/// A stream that has nothing to say says so this often: a browser that hears nothing for longer connects again.
const HEARTBEAT: Duration = Duration::from_secs(2);
const HEADERS: &str = "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
                       X-Frame-Options: DENY\r\nConnection: close\r\n";

/// What is served.
pub(crate) struct Served {
    pub(crate) page: String,
    pub(crate) access: Access,
    pub(crate) hub: Hub,
    /// Where the page is served over TLS.
    pub(crate) tls: Option<Tls>,
    /// The whole state as a message.
    pub(crate) snapshot: Box<dyn Fn() -> Arc<str> + Send + Sync>,
    /// Does what a button asks for.
    pub(crate) ask: Box<dyn Fn(Pressed) + Send + Sync>,
    /// Connections that are open, by address.
    pub(crate) open: Mutex<HashMap<IpAddr, usize>>,
}

impl Served {
    /// Whether any connection is open.
    pub(crate) fn are_open(&self) -> bool {
        self.open.lock().is_ok_and(|open| !open.is_empty())
    }
}

/// Counts a connection as long as it is there.
struct Slot {
    served: Arc<Served>,
    address: IpAddr,
}

impl Slot {
    /// `None` where there is none left for this address.
    fn take(served: &Arc<Served>, address: IpAddr) -> Option<Slot> {
        let mut open = served.open.lock().ok()?;
        let all: usize = open.values().sum();
        let own = open.entry(address).or_default();
        if all >= CONNECTIONS_MAX || *own >= CONNECTIONS_OF_ONE_MAX {
            return None;
        }
        *own += 1;
        Some(Slot { served: served.clone(), address })
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        let Ok(mut open) = self.served.open.lock() else { return };
        if let Some(own) = open.get_mut(&self.address) {
            *own -= 1;
        }
        open.retain(|_, own| *own > 0);
    }
}

/// Answers until the process ends.
pub(crate) fn serve(listener: &TcpListener, served: &Arc<Served>) {
    for stream in listener.incoming().filter_map(Result::ok) {
        let Some(slot) = stream.peer_addr().ok().and_then(|peer| Slot::take(served, peer.ip())) else {
            continue;
        };
        // Where no thread can be started the slot is dropped with what it should have run.
        let _ = std::thread::Builder::new().name("live".to_owned()).spawn(move || {
            // A browser that goes away ends its own connection.
            let _ = connected(stream, &slot.served);
        });
    }
}

fn connected(stream: TcpStream, served: &Served) -> std::io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.set_nodelay(true)?;
    let mut stream = Punctual { stream, until: Instant::now() + ARRIVES_WITHIN };
    match &served.tls {
        None => answer(&mut stream, served),
        Some(tls) => tls.over(stream, |stream| answer(stream, served)),
    }
}

fn answer(stream: &mut (impl Read + Write), served: &Served) -> std::io::Result<()> {
    let Some(request) = read_request(stream) else { return plain(stream, "400 Bad Request") };
    let access = &served.access;
    if !access.calls_by_name(&request) || access.is_of_another_page(&request) {
        return plain(stream, "403 Forbidden");
    }
    match (request.method.as_str(), request.path.as_str()) {
        // Without data of the run: it is read before anybody can show a token.
        ("GET", "/") => page(stream, &served.page),
        ("GET", "/events") if !access.has_token(&request) => plain(stream, "401 Unauthorized"),
        ("GET", "/events") => events(stream, served),
        ("POST", path) => match asked(path) {
            None => plain(stream, "404 Not Found"),
            Some(_) if !may_ask(access, &request) => plain(stream, "403 Forbidden"),
            Some(asked) => {
                (served.ask)(asked);
                plain(stream, "204 No Content")
            }
        },
        ("GET", _) => plain(stream, "404 Not Found"),
        _ => plain(stream, "405 Method Not Allowed"),
    }
}

fn may_ask(access: &Access, request: &Request) -> bool {
    access.is_of_own_page(request) && access.has_token(request)
}

fn asked(path: &str) -> Option<Pressed> {
    match path {
        "/ask/hold" => Some(Pressed::Hold),
        "/ask/go-on" => Some(Pressed::GoOn),
        "/ask/stop" => Some(Pressed::StopAfterStep),
        "/ask/safe" => Some(Pressed::SafeNow),
        _ => None,
    }
}

fn plain(stream: &mut impl Write, status: &str) -> std::io::Result<()> {
    write!(stream, "HTTP/1.1 {status}\r\n{HEADERS}Content-Length: 0\r\n\r\n")
}

fn page(stream: &mut impl Write, page: &str) -> std::io::Result<()> {
    let length = page.len();
    write!(
        stream,
        "HTTP/1.1 200 OK\r\n{HEADERS}Content-Security-Policy: frame-ancestors 'none'\r\n\
         Content-Type: text/html; charset=utf-8\r\nContent-Length: {length}\r\n\r\n"
    )?;
    // A reader of a byte at a time keeps its slot no longer than this.
    let until = Instant::now() + PATIENCE;
    for piece in page.as_bytes().chunks(PIECE) {
        if Instant::now() > until {
            return Err(ErrorKind::TimedOut.into());
        }
        stream.write_all(piece)?;
    }
    Ok(())
}

/// The whole state, then every message, until one side goes away.
fn events(stream: &mut impl Write, served: &Served) -> std::io::Result<()> {
    let Some(messages) = served.hub.join((served.snapshot)()) else {
        return plain(stream, "503 Service Unavailable");
    };
    write!(stream, "HTTP/1.1 200 OK\r\n{HEADERS}Content-Type: text/event-stream\r\n\r\n")?;
    loop {
        match messages.recv_timeout(HEARTBEAT) {
            Ok(message) => write!(stream, "data: {message}\n\n")?,
            Err(RecvTimeoutError::Timeout) => write!(stream, ":\n\n")?,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
}
