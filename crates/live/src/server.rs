//! The server: one thread per connection, one request per connection.

use crate::connections::{Connection, Connections, Hub};
use crate::request::{Access, REQUEST_TIMEOUT, read_request};
use crate::tls::{DeadlineStream, Tls};
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::RecvTimeoutError;
use std::time::{Duration, Instant};

/// Maximum time that a browser may block one read or write.
const IO_TIMEOUT: Duration = Duration::from_secs(5);
/// Bytes of a page per write.
const WRITE_BYTES: usize = 1 << 14;
/// Interval of heartbeats on an idle stream. Browsers reconnect after a longer silence.
const HEARTBEAT: Duration = Duration::from_secs(2);
const HEADERS: &str = "Cache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
                       X-Frame-Options: DENY\r\nConnection: close\r\n";

/// Command of a button.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OperatorCommand {
    /// Hold the current step.
    Hold,
    /// Continue after a hold.
    Continue,
    /// Stop the run at the end of the step.
    StopAfterStep,
    /// Go to the safe state now.
    SafeNow,
}

pub(crate) struct ServedContent {
    pub(crate) page: String,
    pub(crate) access: Access,
    pub(crate) hub: Hub,
    /// TLS settings, if the page uses TLS.
    pub(crate) tls: Option<Tls>,
    /// The complete state as a message.
    pub(crate) snapshot: Box<dyn Fn() -> Arc<str> + Send + Sync>,
    /// Executes a button command.
    pub(crate) ask: Box<dyn Fn(OperatorCommand) + Send + Sync>,
    /// The open connections.
    pub(crate) connections: Arc<Connections>,
}

/// Serves until the process ends.
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

/// Sends the complete state, then every message, until one side disconnects.
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
