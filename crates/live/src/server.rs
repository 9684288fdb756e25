//! The server of the program's pages: axum over HTTP/1.1, with limits on what one visitor can take from the others.

use crate::tls::{HEAD_TIMEOUT, Stream, Tls};
use axum::Router;
use axum::body::Body;
use axum::extract::Request;
use futures_util::future::select;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use std::net::IpAddr;
use std::pin::{Pin, pin};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{broadcast, oneshot};
use tokio::time::timeout;
use tokio_io_timeout::TimeoutStream;
use tower_service::Service;

/// Maximum size of the head, bytes.
const MAX_HEAD_BYTES: usize = 8192;
/// Maximum number of headers.
const MAX_HEADERS: usize = 64;
/// Maximum time that a browser may block a write.
const WRITE_TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum time of a connection that is not a stream of events: it may wait for a map to be fitted.
const BRIEF_TIMEOUT: Duration = Duration::from_secs(60);
/// Pause after a connection that the system refuses, because it has no room for it.
const REFUSED_PAUSE: Duration = Duration::from_millis(20);

/// Serves the pages of `router` on a thread of its own, for the rest of the process.
pub(crate) fn serve(
    listener: std::net::TcpListener,
    tls: Option<Tls>,
    router: Router,
    connections: Arc<Connections>,
) -> std::io::Result<()> {
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    let accept = async move {
        let Ok(listener) = TcpListener::from_std(listener) else { return };
        loop {
            match listener.accept().await {
                Ok((stream, peer)) => {
                    let (connection, leave) = connections.admit(peer.ip());
                    let (router, tls) = (router.clone(), tls.clone());
                    tokio::spawn(async move {
                        // A browser that disconnects, lags or has to make room ends only its own connection.
                        let served = pin!(handle(stream, tls, router, connection));
                        select(served, leave).await;
                    });
                }
                Err(_) => tokio::time::sleep(REFUSED_PAUSE).await,
            }
        }
    };
    std::thread::Builder::new().name("pages".to_owned()).spawn(move || runtime.block_on(accept))?;
    Ok(())
}

async fn handle(stream: TcpStream, tls: Option<Tls>, router: Router, connection: Arc<Connection>) {
    // Without it only the last packet of an answer is late.
    let _ = stream.set_nodelay(true);
    let stream: Pin<Box<dyn Stream>> = match tls {
        None => Box::pin(stream),
        Some(tls) => match tls.accept(stream).await {
            Some(stream) => stream,
            None => return,
        },
    };
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(WRITE_TIMEOUT));
    let for_requests = connection.clone();
    let answer = service_fn(move |request: hyper::Request<hyper::body::Incoming>| {
        let mut request: Request = request.map(Body::new);
        request.extensions_mut().insert(for_requests.clone());
        router.clone().call(request)
    });
    let mut http = http1::Builder::new();
    http.timer(TokioTimer::new()).header_read_timeout(HEAD_TIMEOUT).keep_alive(false);
    http.max_buf_size(MAX_HEAD_BYTES).max_headers(MAX_HEADERS);
    let mut served = pin!(http.serve_connection(TokioIo::new(Box::pin(stream)), answer));
    if timeout(BRIEF_TIMEOUT, served.as_mut()).await.is_err() && connection.is_stream() {
        let _ = served.await;
    }
}

/// Maximum number of connections that have not sent a request yet or read the page. A new one replaces the oldest. Browsers send a request
/// within milliseconds of connecting, so a button works even if other clients keep connections open.
const MAX_BRIEF_CONNECTIONS: usize = 32;
/// Maximum number of streams of events. A new one replaces the oldest of the address with the most of them, because one that does not read
/// looks like one that does until the buffers of the system are full. Browsers connect again by themselves.
const MAX_STREAMS: usize = 16;

#[derive(Debug, Default)]
pub(crate) struct Connections {
    open: Mutex<Vec<OpenConnection>>,
}

#[derive(Debug)]
struct OpenConnection {
    number: u64,
    address: IpAddr,
    /// Whether it is a stream of events, or brief.
    is_stream: bool,
    /// Its end closes the connection when this is dropped.
    _leave: oneshot::Sender<()>,
}

#[derive(Debug)]
pub(crate) struct Connection {
    all: Arc<Connections>,
    number: u64,
}

/// Closes the oldest of the address with the most connections of this kind, if there are more than `limit`.
fn make_room(open: &mut Vec<OpenConnection>, is_stream: bool, limit: usize) {
    let of_kind = || open.iter().filter(|connection| connection.is_stream == is_stream);
    let count = |address: IpAddr| of_kind().filter(|other| other.address == address).count();
    // In order of arrival: of equal counts the oldest is chosen.
    let leaving = of_kind().rev().max_by_key(|connection| count(connection.address));
    let busiest = leaving.filter(|_| of_kind().count() > limit).map(|leaving| leaving.address);
    let oldest = |other: &OpenConnection| other.is_stream == is_stream && Some(other.address) == busiest;
    if let Some(place) = open.iter().position(oldest) {
        open.remove(place);
    }
}

impl Connections {
    /// Adds a connection, with what ends it; with too many short ones, the oldest of the busiest address is closed.
    fn admit(self: &Arc<Connections>, address: IpAddr) -> (Arc<Connection>, oneshot::Receiver<()>) {
        let mut open = self.lock();
        make_room(&mut open, false, MAX_BRIEF_CONNECTIONS - 1);
        let number = open.last().map_or(0, |last| last.number + 1);
        let (leave, left) = oneshot::channel();
        open.push(OpenConnection { number, address, is_stream: false, _leave: leave });
        (Arc::new(Connection { all: self.clone(), number }), left)
    }

    pub(crate) fn any_open(&self) -> bool {
        !self.lock().is_empty()
    }

    /// A thread that panicked while it held the lock left the list valid.
    fn lock(&self) -> MutexGuard<'_, Vec<OpenConnection>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Connection {
    pub(crate) fn mark_as_stream(&self) {
        let mut open = self.all.lock();
        if let Some(own) = open.iter_mut().find(|open| open.number == self.number) {
            own.is_stream = true;
        }
        make_room(&mut open, true, MAX_STREAMS);
    }

    fn is_stream(&self) -> bool {
        self.all.lock().iter().any(|open| open.number == self.number && open.is_stream)
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.all.lock().retain(|open| open.number != self.number);
    }
}

/// Queue length of a browser. A browser that falls further behind is disconnected and restarts with the complete state.
const MAX_QUEUED_MESSAGES: usize = 64;

/// Sends messages to all browsers and never waits for any of them.
#[derive(Debug)]
pub(crate) struct Hub(Mutex<Option<broadcast::Sender<Arc<str>>>>);

impl Default for Hub {
    fn default() -> Self {
        Hub(Mutex::new(Some(broadcast::Sender::new(MAX_QUEUED_MESSAGES))))
    }
}

impl Hub {
    /// What a browser receives from now on; `None` after the end.
    pub(crate) fn join(&self) -> Option<broadcast::Receiver<Arc<str>>> {
        self.0.lock().ok()?.as_ref().map(broadcast::Sender::subscribe)
    }

    pub(crate) fn publish(&self, message: Arc<str>) {
        if let Ok(Some(sender)) = self.0.lock().as_deref() {
            // Without a browser nothing receives it.
            let _ = sender.send(message);
        }
    }

    pub(crate) fn close(&self) {
        drop(self.0.lock().map(|mut sender| sender.take()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::sync::broadcast::error::RecvError;
    use tokio::sync::oneshot::error::TryRecvError;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    type Admitted = (Arc<Connection>, oneshot::Receiver<()>);

    /// Places of those that have to end.
    fn gone(held: &mut [Admitted]) -> Vec<usize> {
        let has_to_end = |leave: &mut oneshot::Receiver<()>| leave.try_recv() == Err(TryRecvError::Closed);
        let places = held.iter_mut().enumerate();
        places.filter_map(|(place, (_, leave))| has_to_end(leave).then_some(place)).collect()
    }

    #[test]
    fn the_oldest_makes_room_and_a_stream_does_not() {
        let all = Arc::new(Connections::default());
        let mut held: Vec<_> = (0..MAX_BRIEF_CONNECTIONS).map(|_| all.admit(HERE)).collect();
        held[0].0.mark_as_stream();
        held.extend((0..3).map(|_| all.admit(HERE)));
        // The stream does not count; the two oldest brief connections have to end.
        assert_eq!(gone(&mut held), [1, 2]);
        drop(held);
        assert!(!all.any_open());
    }

    #[test]
    fn who_lags_behind_is_left_and_the_others_get_everything() {
        let hub = Hub::default();
        let (mut slow, mut quick) = (hub.join().unwrap(), hub.join().unwrap());
        for number in 0..200 {
            hub.publish(number.to_string().into());
            assert_eq!(*quick.blocking_recv().unwrap(), *number.to_string());
        }
        assert!(matches!(slow.blocking_recv(), Err(RecvError::Lagged(_))));
        hub.close();
        assert_eq!(quick.blocking_recv(), Err(RecvError::Closed));
        assert!(hub.join().is_none());
    }

    /// None of them reads, and the page cannot tell which ones do.
    #[test]
    fn a_further_browser_replaces_the_oldest_of_the_address_with_the_most() {
        let all = Arc::new(Connections::default());
        let join = |address| {
            let admitted = all.admit(address);
            admitted.0.mark_as_stream();
            admitted
        };
        let mut held = vec![join(IpAddr::from([10, 0, 0, 7]))];
        held.extend((0..100).map(|_| join(HERE)));
        // The only one from there stays, and the last ones from here.
        assert_eq!(gone(&mut held), (1..=100 - (MAX_STREAMS - 1)).collect::<Vec<_>>());
    }
}
