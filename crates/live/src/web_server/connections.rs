//! Open connections and their limits.

use std::net::{IpAddr, Shutdown, TcpStream};
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
pub(crate) fn leaves_first(addresses: &[Option<IpAddr>]) -> Option<usize> {
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
}
