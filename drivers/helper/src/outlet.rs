//! What goes out waits in a queue: a host that does not read must not stop the driver.

use mapper_protocol::{Encoding, Message, encode, write_frame};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};

/// Messages that wait for a host that does not read: some seconds of samples. Samples beyond are dropped, which the host sees.
const WAITING: usize = 256;
/// Places beyond those for answers and remarks alone, more than a host asks for at a time. A rig that was made safe is in doubt as long as
/// its answer has not come.
const KEPT: usize = 64;

/// The queue before the pipe to the host.
pub(crate) struct Outlet {
    to_write: SyncSender<Vec<u8>>,
    waiting: Arc<AtomicUsize>,
}

impl Outlet {
    /// Writes into `pipe` by a thread of its own, which ends with it.
    pub(crate) fn into_pipe(mut pipe: impl Write + Send + 'static) -> std::io::Result<Outlet> {
        let (to_write, bodies) = sync_channel::<Vec<u8>>(WAITING + KEPT);
        let waiting = Arc::new(AtomicUsize::new(0));
        let counted = waiting.clone();
        std::thread::Builder::new().name("to host".to_owned()).spawn(move || {
            for body in bodies {
                counted.fetch_sub(1, Ordering::Relaxed);
                if write_frame(&mut pipe, &body, u32::MAX).is_err() {
                    break;
                }
            }
        })?;
        Ok(Outlet { to_write, waiting })
    }

    /// Sends without waiting: what finds no place, or fits into no frame of so many bytes, is dropped. It will be missed: by its number, or
    /// by the deadline of who asked.
    pub(crate) fn send(&self, message: &Message, limit_bytes: usize) {
        let comes_again = matches!(message.method.as_deref(), Some("samples" | "lost"));
        // Nobody else adds to it: it can only become less meanwhile.
        if comes_again && self.waiting.load(Ordering::Relaxed) >= WAITING {
            return;
        }
        let Ok(body) = encode(message, Encoding::MessagePack) else { return };
        if body.len() > limit_bytes {
            return;
        }
        // Counted first: who writes may be quicker.
        self.waiting.fetch_add(1, Ordering::Relaxed);
        if self.to_write.try_send(body).is_err() {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
    }
}
