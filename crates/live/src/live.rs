//! The live page of a run: opened before the run, updated during it, closed after it.

use crate::access::{Access, guard};
use crate::feed::{Feed, LiveRun, OperatorCommand};
use crate::server::{Connection, Connections, Hub, serve};
use crate::tls::{Tls, TlsError, TlsFiles, read};
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Extension, Router};
use futures_util::StreamExt;
use futures_util::future::ready;
use futures_util::stream::{once, unfold};
use mapper_report::page::live_page;
use mapper_session::SessionEvent;
use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Time for browsers to receive the last message.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);
/// Interval of heartbeats on an idle stream. Browsers reconnect after a longer silence.
const HEARTBEAT: Duration = Duration::from_secs(2);

/// What the server shows.
pub(crate) struct LiveContent {
    page: String,
    access: Arc<Access>,
    hub: Hub,
    snapshot: Box<dyn Fn() -> Arc<str> + Send + Sync>,
    ask: Box<dyn Fn(OperatorCommand) + Send + Sync>,
    connections: Arc<Connections>,
}

fn router(content: Arc<LiveContent>) -> Router {
    let button = |command| {
        post(move |State(live): State<Arc<LiveContent>>| async move {
            (live.ask)(command);
            StatusCode::NO_CONTENT
        })
    };
    let guarded = axum::middleware::from_fn_with_state(content.access.clone(), guard);
    Router::new()
        .route("/", get(page))
        .route("/events", get(events))
        .route("/ask/hold", button(OperatorCommand::Hold))
        .route("/ask/go-on", button(OperatorCommand::Continue))
        .route("/ask/stop", button(OperatorCommand::StopAfterStep))
        .route("/ask/safe", button(OperatorCommand::SafeNow))
        .layer(guarded)
        .with_state(content)
}

/// The page contains no run data, because it is read before a token can be checked.
async fn page(State(live): State<Arc<LiveContent>>) -> impl IntoResponse {
    ([(header::CONTENT_SECURITY_POLICY, "frame-ancestors 'none'")], Html(live.page.clone()))
}

async fn events(
    State(live): State<Arc<LiveContent>>,
    Extension(connection): Extension<Arc<Connection>>,
    headers: HeaderMap,
) -> Response {
    if !live.access.has_token(&headers) {
        return StatusCode::UNAUTHORIZED.into_response();
    }
    let Some(messages) = live.hub.join() else { return StatusCode::SERVICE_UNAVAILABLE.into_response() };
    connection.mark_as_stream();
    // One that lags behind ends, and connects again.
    let later = unfold(messages, |mut messages| async move { Some((messages.recv().await.ok()?, messages)) });
    let all = once(ready((live.snapshot)())).chain(later);
    let events = all.map(|message| Ok::<_, Infallible>(Event::default().data(message)));
    Sse::new(events).keep_alive(KeepAlive::new().interval(HEARTBEAT)).into_response()
}

/// The live page of a run.
pub struct Live {
    listener: Mutex<Option<TcpListener>>,
    address: SocketAddr,
    token: Option<String>,
    tls: Option<Tls>,
    started: OnceLock<(Arc<Feed>, Arc<LiveContent>)>,
}

impl Live {
    /// Binds an address. Browsers on other machines need the token that this creates.
    pub fn open(address: SocketAddr, tls: Option<&TlsFiles>) -> Result<Live, LiveError> {
        let tls = tls.map(read).transpose()?;
        let listen = |source| LiveError::Listen(address, source);
        let listener = TcpListener::bind(address).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        let token = if address.ip().is_loopback() { None } else { Some(token()?) };
        Ok(Live { listener: Mutex::new(Some(listener)), address, token, tls, started: OnceLock::new() })
    }

    /// URL of the page. The token follows `#`, so that browsers never send it with the address.
    pub fn url(&self) -> String {
        let scheme = if self.tls.is_some() { "https" } else { "http" };
        match &self.token {
            None => format!("{scheme}://{}/", self.address),
            Some(token) => format!("{scheme}://{}/#token={token}", self.address),
        }
    }

    /// Network warning for the operator: other machines can connect, and all traffic is unencrypted.
    pub fn warning(&self) -> Option<&'static str> {
        (self.token.is_some() && self.tls.is_none()).then_some(
            "other computers can reach the live page WITHOUT encryption: everyone on the network can read the readings and the token, and use \
             the buttons with the token. Use a certificate and a key, or serve on 127.0.0.1 and use a tunnel (ssh -L)",
        )
    }

    /// Starts the server.
    pub fn start(&self, run: &LiveRun<'_>) -> Result<(), LiveError> {
        let Some(listener) = self.listener.lock().ok().and_then(|mut listener| listener.take()) else {
            return Ok(());
        };
        let feed = Arc::new(Feed::new(run));
        let feed_for_snapshots = feed.clone();
        let (operator, after_step, now) = (run.operator.clone(), run.after_step.clone(), run.now.clone());
        let feed_for_commands = feed.clone();
        let served = Arc::new(LiveContent {
            page: live_page()?,
            access: Arc::new(Access::new(self.address, self.token.clone(), self.tls.is_some())),
            hub: Hub::default(),
            snapshot: Box::new(move || feed_for_snapshots.snapshot()),
            ask: Box::new(move |command| {
                let effect = match command {
                    OperatorCommand::Hold => {
                        operator.hold();
                        "the step is held"
                    }
                    OperatorCommand::Continue => {
                        operator.release();
                        "the step continues"
                    }
                    OperatorCommand::StopAfterStep => {
                        after_step.store(true, Ordering::SeqCst);
                        "the run stops at the end of the step"
                    }
                    OperatorCommand::SafeNow => {
                        after_step.store(true, Ordering::SeqCst);
                        now.store(true, Ordering::SeqCst);
                        "the rig goes into its safe state now"
                    }
                };
                operator.add_message(format!("operator, on the live page: {effect}"));
                feed_for_commands.show_command(command);
            }),
            connections: Arc::default(),
        });
        serve(listener, self.tls.clone(), router(served.clone()), served.connections.clone())
            .map_err(|source| LiveError::Listen(self.address, source))?;
        // This is the only start, because the listener was just taken.
        let _ = self.started.set((feed, served));
        Ok(())
    }

    /// Forwards a session event. Never waits for a browser.
    pub fn show(&self, event: &SessionEvent) {
        let Some((feed, served)) = self.started.get() else { return };
        for message in feed.process(event) {
            served.hub.publish(message);
        }
    }

    /// Reports the outcome and the run's page, and waits briefly until browsers have received them.
    pub fn end(&self, outcome: &str, page: Option<&std::path::Path>) {
        let Some((feed, served)) = self.started.get() else { return };
        served.hub.publish(feed.show_end(outcome, page));
        served.hub.close();
        let deadline = Instant::now() + CLOSE_TIMEOUT;
        while served.connections.any_open() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

pub(crate) fn token() -> Result<String, LiveError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(LiveError::Token)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Why the live page cannot be served.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum LiveError {
    #[error("the live page cannot be served at {0}: {1}; choose another address")]
    Listen(SocketAddr, #[source] std::io::Error),
    #[error("the system cannot generate random numbers for a token: {0}")]
    Token(getrandom::Error),
    /// A defect of the program.
    #[error("failed to write the live page: {0}")]
    Page(#[from] serde_json::Error),
    #[error(transparent)]
    Tls(#[from] TlsError),
    #[error(transparent)]
    Session(#[from] mapper_session::SessionError),
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader, Read, Write};
    use std::net::TcpStream;
    use std::sync::atomic::AtomicUsize;

    /// All from one address, as through a tunnel: the maximum number of streams, and more silent connections than allowed. Some are in the
    /// middle of a request or of the page. The button still works and the page can be read.
    #[test]
    fn a_button_gets_through_whoever_holds_lines_open() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let command = Arc::new(AtomicUsize::new(0));
        let of_ask = command.clone();
        let live = Arc::new(LiveContent {
            page: "x".repeat(1 << 22),
            access: Arc::new(Access::new(address, None, false)),
            hub: Hub::default(),
            snapshot: Box::new(|| "{}".into()),
            ask: Box::new(move |_| {
                of_ask.fetch_add(1, Ordering::SeqCst);
            }),
            connections: Arc::default(),
        });
        serve(listener, None, router(live.clone()), live.connections.clone()).unwrap();
        let send = |head: &str| {
            let mut stream = TcpStream::connect(address).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
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
        // A malformed head of a request, a head that never ends, and one of too many lines press no button.
        let many = format!("POST /ask/safe HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(100));
        for head in ["\u{1}".repeat(64), "a".repeat(100_000), many] {
            let mut refused = Vec::new();
            let mut stream = TcpStream::connect(address).unwrap();
            // The server may have left already.
            let _ = stream.write_all(head.as_bytes());
            let _ =
                stream.shutdown(std::net::Shutdown::Write).and_then(|()| stream.read_to_end(&mut refused));
            assert!(!refused.starts_with(b"HTTP/1.1 2"), "{}", String::from_utf8_lossy(&refused));
        }
        assert_eq!(command.load(Ordering::SeqCst), 50);
    }
}
