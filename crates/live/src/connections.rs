//! Open connections and their limits, and the connected browsers, each with a short queue.

use std::net::{IpAddr, Shutdown, TcpStream};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard};

/// Maximum number of connections that have not sent a request yet or read the page. A new one replaces the oldest. Browsers send a request
/// within milliseconds of connecting, so a button works even if other clients keep connections open.
const MAX_BRIEF_CONNECTIONS: usize = 32;

/// All open connections.
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

/// A connection, removed from the list when dropped.
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
    /// Adds a connection. If there are too many short connections, the oldest one of the address with the most of them is closed. `None` if the connection
    /// is already closed.
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
    /// Marks an accepted stream, which is never replaced.
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

    /// Sends a message; browsers that have gone or fall behind are removed.
    pub(crate) fn publish(&self, message: &Arc<str>) {
        if let Ok(mut clients) = self.clients.lock() {
            clients.retain(|(_, client)| client.try_send(message.clone()).is_ok());
        }
    }

    /// Disconnects all browsers after their queued messages.
    pub(crate) fn close(&self) {
        if let Ok(mut clients) = self.clients.lock() {
            clients.clear();
        }
    }
}

#[cfg(test)]
mod tests {
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
