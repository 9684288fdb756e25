//! The server of the live page and its connections.

use crate::request::{Access, REQUEST_TIMEOUT, read_request};
use crate::tls::{DeadlineStream, Tls};
use std::io::{ErrorKind, Read, Write};
use std::net::{IpAddr, Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Maximum time that a browser may block one read or write.
const IO_TIMEOUT: Duration = Duration::from_secs(5);
/// Bytes of a page per write.
const WRITE_BYTES: usize = 1 << 14;
/// Interval of heartbeats on an idle stream. Browsers reconnect after a longer silence.
const HEARTBEAT: Duration = Duration::from_secs(2);
const HEADERS: &str = "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
                       X-Frame-Options: DENY\r\nConnection: close\r\n";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OperatorCommand {
    Hold,
    Continue,
    /// Stop the run at the end of the step.
    StopAfterStep,
    SafeNow,
}

pub(crate) struct ServedContent {
    pub(crate) page: String,
    pub(crate) access: Access,
    pub(crate) hub: Hub,
    pub(crate) tls: Option<Tls>,
    pub(crate) snapshot: Box<dyn Fn() -> Arc<str> + Send + Sync>,
    pub(crate) ask: Box<dyn Fn(OperatorCommand) + Send + Sync>,
    pub(crate) connections: Arc<Connections>,
}

pub(crate) fn serve(listener: &TcpListener, served: &Arc<ServedContent>) {
    for stream in listener.incoming().filter_map(Result::ok) {
        let Some(connection) = served.connections.admit(&stream) else { continue };
        let served = served.clone();
        // If no thread can be started, the connection is dropped with its closure.
        let _ = std::thread::Builder::new().name("live".to_owned()).spawn(move || {
            // A browser that disconnects ends only its own connection.
            let _ = handle_connection(stream, &served, &connection);
        });
    }
}

fn handle_connection(
    stream: TcpStream,
    served: &ServedContent,
    connection: &Connection,
) -> std::io::Result<()> {
    stream.set_read_timeout(Some(IO_TIMEOUT))?;
    stream.set_write_timeout(Some(IO_TIMEOUT))?;
    stream.set_nodelay(true)?;
    let mut stream = DeadlineStream { stream, until: Instant::now() + REQUEST_TIMEOUT };
    match &served.tls {
        None => answer(&mut stream, served, connection),
        Some(tls) => tls.serve_over(stream, |stream| answer(stream, served, connection)),
    }
}

fn answer(
    stream: &mut (impl Read + Write),
    served: &ServedContent,
    connection: &Connection,
) -> std::io::Result<()> {
    let Some(request) = read_request(stream) else { return plain(stream, "400 Bad Request") };
    let access = &served.access;
    if !access.has_own_host(&request) || access.is_of_another_page(&request) {
        return plain(stream, "403 Forbidden");
    }
    match (request.method.as_str(), request.path.as_str()) {
        // The page contains no run data, because it is read before a token can be checked.
        ("GET", "/") => page(stream, &served.page),
        ("GET", "/events") if !access.has_token(&request) => plain(stream, "401 Unauthorized"),
        ("GET", "/events") => events(stream, served, connection),
        ("POST", path) => match command(path) {
            None => plain(stream, "404 Not Found"),
            Some(_) if !(access.is_of_own_page(&request) && access.has_token(&request)) => {
                plain(stream, "403 Forbidden")
            }
            Some(command) => {
                (served.ask)(command);
                plain(stream, "204 No Content")
            }
        },
        ("GET", _) => plain(stream, "404 Not Found"),
        _ => plain(stream, "405 Method Not Allowed"),
    }
}

fn command(path: &str) -> Option<OperatorCommand> {
    match path {
        "/ask/hold" => Some(OperatorCommand::Hold),
        "/ask/go-on" => Some(OperatorCommand::Continue),
        "/ask/stop" => Some(OperatorCommand::StopAfterStep),
        "/ask/safe" => Some(OperatorCommand::SafeNow),
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
    // Limits a client that reads one byte at a time.
    let until = Instant::now() + IO_TIMEOUT;
    for piece in page.as_bytes().chunks(WRITE_BYTES) {
        if Instant::now() > until {
            return Err(ErrorKind::TimedOut.into());
        }
        stream.write_all(piece)?;
    }
    Ok(())
}

fn events(stream: &mut impl Write, served: &ServedContent, connection: &Connection) -> std::io::Result<()> {
    let Some(messages) = served.hub.join(connection.address, (served.snapshot)()) else {
        return plain(stream, "503 Service Unavailable");
    };
    connection.mark_as_stream();
    write!(stream, "HTTP/1.1 200 OK\r\n{HEADERS}Content-Type: text/event-stream\r\n\r\n")?;
    loop {
        match messages.recv_timeout(HEARTBEAT) {
            Ok(message) => write!(stream, "data: {message}\n\n")?,
            Err(RecvTimeoutError::Timeout) => write!(stream, ":\n\n")?,
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
}

/// Maximum number of connections that have not sent a request yet or read the page. A new one replaces the oldest. Browsers send a request
/// within milliseconds of connecting, so a button works even if other clients keep connections open.
const MAX_BRIEF_CONNECTIONS: usize = 32;

#[derive(Debug, Default)]
pub(crate) struct Connections {
    open: Mutex<Vec<OpenConnection>>,
}

#[derive(Debug)]
struct OpenConnection {
    number: u64,
    address: IpAddr,
    /// Handle to close a short connection from another thread; `None` for a stream of events, which the hub limits.
    brief: Option<TcpStream>,
}

#[derive(Debug)]
pub(crate) struct Connection {
    all: Arc<Connections>,
    number: u64,
    pub(crate) address: IpAddr,
}

/// Place of the one that makes room for another: the oldest of the address with the most of them. In order of arrival; `None` does not count.
fn leaves_first(addresses: &[Option<IpAddr>]) -> Option<usize> {
    let count = |address: &Option<IpAddr>| {
        address.map_or(0, |_| addresses.iter().filter(|other| *other == address).count())
    };
    let most = addresses.iter().map(count).max().filter(|most| *most > 0)?;
    addresses.iter().position(|address| count(address) == most)
}

impl Connections {
    /// Adds a connection; with too many short ones, the oldest of the busiest address is closed. `None` if it is closed already.
    pub(crate) fn admit(self: &Arc<Connections>, stream: &TcpStream) -> Option<Connection> {
        let (address, own_stream) = (stream.peer_addr().ok()?.ip(), stream.try_clone().ok()?);
        let mut open = self.lock();
        let brief: Vec<Option<IpAddr>> =
            open.iter().map(|connection| connection.brief.as_ref().map(|_| connection.address)).collect();
        if brief.iter().flatten().count() >= MAX_BRIEF_CONNECTIONS
            && let Some(stream) = open.remove(leaves_first(&brief)?).brief
        {
            // Its thread notices the closed socket and ends.
            let _ = stream.shutdown(Shutdown::Both);
        }
        let number = open.last().map_or(0, |last| last.number + 1);
        open.push(OpenConnection { number, address, brief: Some(own_stream) });
        Some(Connection { all: self.clone(), number, address })
    }

    pub(crate) fn any_open(&self) -> bool {
        !self.lock().is_empty()
    }

    /// A thread that panicked while it held the lock left the list valid.
    fn lock(&self) -> MutexGuard<'_, Vec<OpenConnection>> {
        self.open.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

impl Connection {
    pub(crate) fn mark_as_stream(&self) {
        if let Some(open) = self.all.lock().iter_mut().find(|connection| connection.number == self.number) {
            open.brief = None;
        }
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.all.lock().retain(|connection| connection.number != self.number);
    }
}

/// Queue length of a browser. A browser that falls further behind is disconnected and restarts with the complete state.
const MAX_QUEUED_MESSAGES: usize = 64;
/// Maximum number of connected browsers. A new one replaces the oldest of the address with the most of them, because one that does not read
/// looks like one that does until the buffers of the system are full. Browsers connect again by themselves.
const MAX_CLIENTS: usize = 16;

/// Sends messages to all browsers and never waits for any of them.
#[derive(Debug, Default)]
pub(crate) struct Hub {
    clients: Mutex<Vec<(IpAddr, SyncSender<Arc<str>>)>>,
}

impl Hub {
    /// Adds a browser at this address that starts with `first`; `None` after a defect.
    pub(crate) fn join(&self, address: IpAddr, first: Arc<str>) -> Option<Receiver<Arc<str>>> {
        let mut clients = self.clients.lock().ok()?;
        if clients.len() >= MAX_CLIENTS {
            let addresses: Vec<_> = clients.iter().map(|(address, _)| Some(*address)).collect();
            clients.remove(leaves_first(&addresses)?);
        }
        let (send, receive) = sync_channel(MAX_QUEUED_MESSAGES);
        send.try_send(first).ok()?;
        clients.push((address, send));
        Some(receive)
    }

    pub(crate) fn publish(&self, message: &Arc<str>) {
        if let Ok(mut clients) = self.clients.lock() {
            clients.retain(|(_, client)| client.try_send(message.clone()).is_ok());
        }
    }

    pub(crate) fn close(&self) {
        if let Ok(mut clients) = self.clients.lock() {
            clients.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// All from one address, as through a tunnel: the maximum number of streams, and more silent connections than allowed. Some are in the
    /// middle of a request or of the page. The button still works and the page can be read.
    #[test]
    fn a_button_gets_through_whoever_holds_lines_open() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let command = Arc::new(AtomicUsize::new(0));
        let of_ask = command.clone();
        let served = Arc::new(ServedContent {
            page: "x".repeat(1 << 22),
            access: Access::new(address, None, false),
            hub: Hub::default(),
            tls: None,
            snapshot: Box::new(|| "{}".into()),
            ask: Box::new(move |_| {
                of_ask.fetch_add(1, Ordering::SeqCst);
            }),
            connections: Arc::default(),
        });
        std::thread::spawn(move || serve(&listener, &served));
        let send = |head: &str| {
            let mut stream = TcpStream::connect(address).unwrap();
            stream.set_read_timeout(Some(IO_TIMEOUT)).unwrap();
            stream.write_all(head.as_bytes()).unwrap();
            stream
        };
        let first_line = |stream: &mut TcpStream| {
            let mut line = String::new();
            BufReader::new(stream).read_line(&mut line).unwrap();
            line.trim_end().to_owned()
        };
        let mut held: Vec<TcpStream> = Vec::new();
        for _ in 0..40 {
            let mut stream = send(&format!("GET /events HTTP/1.1\r\nHost: {address}\r\n\r\n"));
            assert_eq!(first_line(&mut stream), "HTTP/1.1 200 OK");
            held.push(stream);
        }
        for round in 0..50 {
            held.push(send(""));
            held.push(send("POST /ask/sa"));
            held.push(send(&format!("GET / HTTP/1.1\r\nHost: {address}\r\n\r\n")));
            let origin = format!("Host: {address}\r\nOrigin: http://{address}");
            let mut button = send(&format!("POST /ask/safe HTTP/1.1\r\n{origin}\r\n\r\n"));
            assert_eq!(first_line(&mut button), "HTTP/1.1 204 No Content", "round {round}");
        }
        assert_eq!(command.load(Ordering::SeqCst), 50);
        let mut page = send(&format!("GET / HTTP/1.1\r\nHost: {address}\r\n\r\n"));
        let mut read = Vec::new();
        page.read_to_end(&mut read).unwrap();
        assert!(read.len() > 1 << 22);
    }
}

#[cfg(test)]
mod connections_tests {
    use super::*;
    use std::io::Read;
    use std::net::TcpListener;

    #[test]
    fn the_oldest_makes_room_and_a_stream_does_not() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let all = Arc::new(Connections::default());
        let mut clients = Vec::new();
        let mut come = || {
            let client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            let (stream, _) = listener.accept().unwrap();
            clients.push(client);
            (all.admit(&stream).unwrap(), stream)
        };
        let held: Vec<_> = (0..MAX_BRIEF_CONNECTIONS).map(|_| come()).collect();
        held[0].0.mark_as_stream();
        let more: Vec<_> = (0..3).map(|_| come()).collect();
        // The stream does not count; the two oldest brief connections have been closed.
        let ended = |client: &mut TcpStream| {
            client.set_read_timeout(Some(std::time::Duration::from_millis(1))).unwrap();
            matches!(client.read(&mut [0]), Ok(0))
        };
        let gone: Vec<usize> = (0..clients.len()).filter(|place| ended(&mut clients[*place])).collect();
        assert_eq!(gone, [1, 2]);
        drop((held, more));
        assert!(!all.any_open());
    }

    #[test]
    fn who_lags_behind_is_left_and_the_others_get_everything() {
        let hub = Hub::default();
        let join = || hub.join(IpAddr::from([127, 0, 0, 1]), "first".into()).unwrap();
        let (slow, quick) = (join(), join());
        for number in 0..200 {
            hub.publish(&number.to_string().into());
            let expected = if number == 0 { "first".to_owned() } else { (number - 1).to_string() };
            assert_eq!(&*quick.recv().unwrap(), expected);
        }
        // The slow browser gets the messages in its queue and then the end.
        assert_eq!(slow.iter().count(), MAX_QUEUED_MESSAGES);
    }

    /// None of them reads, and the page cannot tell which ones do.
    #[test]
    fn a_further_browser_replaces_the_oldest_of_the_address_with_the_most() {
        let hub = Hub::default();
        let (here, there) = (IpAddr::from([127, 0, 0, 1]), IpAddr::from([10, 0, 0, 7]));
        let of_there = hub.join(there, "".into()).unwrap();
        let of_here: Vec<_> = (0..100).map(|_| hub.join(here, "".into()).unwrap()).collect();
        hub.publish(&"now".into());
        let is_connected = |client: &Receiver<Arc<str>>| client.try_iter().any(|message| &*message == "now");
        assert!(is_connected(&of_there));
        let connected: Vec<bool> = of_here.iter().map(is_connected).collect();
        assert_eq!(connected.iter().filter(|connected| **connected).count(), MAX_CLIENTS - 1);
        assert!(
            connected[100 - (MAX_CLIENTS - 1)..].iter().all(|connected| *connected),
            "the last ones stay"
        );
    }
}
