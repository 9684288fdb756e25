//! The output queue: a host that does not read must not block the driver.

use mapper_driver_host::protocol::{Encoding, Message, encode, write_frame};
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};

/// Queue for a host that does not read: some seconds of samples. Further samples are dropped, which the host detects.
const QUEUE_LENGTH: usize = 256;
/// Extra places for answers and remarks, more than a host requests at a time. A rig that was made safe is in doubt until
/// its answer arrives.
const RESERVED: usize = 64;

/// The queue before the pipe to the host.
pub(crate) struct OutputQueue {
    to_write: SyncSender<Vec<u8>>,
    waiting: Arc<AtomicUsize>,
}

impl OutputQueue {
    /// Writes to `pipe` on a thread of its own, which ends with the pipe.
    pub(crate) fn into_pipe(mut pipe: impl Write + Send + 'static) -> std::io::Result<OutputQueue> {
        let (to_write, bodies) = sync_channel::<Vec<u8>>(QUEUE_LENGTH + RESERVED);
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
        Ok(OutputQueue { to_write, waiting })
    }

    /// Sends without waiting. A message is dropped if the queue is full or the frame exceeds this limit. The loss shows as a
    /// missing number, or as a timeout of the request.
    pub(crate) fn send(&self, message: &Message, limit_bytes: usize) {
        let is_droppable = matches!(message.method.as_deref(), Some("samples" | "lost"));
        // No other thread adds to the queue, so it can only shrink meanwhile.
        if is_droppable && self.waiting.load(Ordering::Relaxed) >= QUEUE_LENGTH {
            return;
        }
        let Ok(body) = encode(message, Encoding::MessagePack) else { return };
        if body.len() > limit_bytes {
            return;
        }
        // Counted before sending, since the writer may be faster.
        self.waiting.fetch_add(1, Ordering::Relaxed);
        if self.to_write.try_send(body).is_err() {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
        }
    }
}
