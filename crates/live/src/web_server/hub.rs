//! The connected browsers, each with a short queue.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};

/// Queue length of a browser. A browser that falls further behind is disconnected and restarts with the complete state.
const MAX_QUEUED_MESSAGES: usize = 64;
/// Maximum number of connected browsers.
const MAX_CLIENTS: usize = 16;

/// Sends messages to all browsers and never waits for any of them.
#[derive(Debug, Default)]
pub(crate) struct Hub {
    clients: Mutex<Vec<SyncSender<Arc<str>>>>,
}

impl Hub {
    /// Adds a browser that starts with `first`; `None` if there are too many already.
    pub(crate) fn join(&self, first: Arc<str>) -> Option<Receiver<Arc<str>>> {
        let mut clients = self.clients.lock().ok()?;
        if clients.len() >= MAX_CLIENTS {
            return None;
        }
        let (send, receive) = sync_channel(MAX_QUEUED_MESSAGES);
        send.try_send(first).ok()?;
        clients.push(send);
        Some(receive)
    }

    /// Sends a message; browsers that have gone or fall behind are removed.
    pub(crate) fn publish(&self, message: &Arc<str>) {
        if let Ok(mut clients) = self.clients.lock() {
            clients.retain(|client| client.try_send(message.clone()).is_ok());
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
        let (slow, quick) = (hub.join("first".into()).unwrap(), hub.join("first".into()).unwrap());
        for number in 0..200 {
            hub.publish(&number.to_string().into());
            let expected = if number == 0 { "first".to_owned() } else { (number - 1).to_string() };
            assert_eq!(&*quick.recv().unwrap(), expected);
        }
        // The slow browser gets the messages in its queue and then the end.
        assert_eq!(slow.iter().count(), MAX_QUEUED_MESSAGES);
    }

    #[test]
    fn there_is_room_for_so_many() {
        let hub = Hub::default();
        let all: Vec<_> = std::iter::from_fn(|| hub.join("".into())).take(100).collect();
        assert_eq!(all.len(), MAX_CLIENTS);
        drop(all);
        hub.publish(&"".into());
        assert!(hub.join("".into()).is_some(), "who has gone makes room");
    }
}
