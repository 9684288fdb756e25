//! The connected browsers, each with a short queue.

use crate::web_server::connections::leaves_first;
use std::net::IpAddr;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};

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
