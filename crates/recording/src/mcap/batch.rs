//! Unpacks chunks and reads their messages in parallel: parsing numbers from text dominates the cost of reading a recording.

use crate::mcap::chunk::{ChunkError, Unpacker, claimed_bytes};
use crate::mcap::framing::split_record;
use crate::mcap::records::{op, parse_message};
use crate::mcap::sink::Sink;
use mapper_numerics::parallel;

/// Maximum total size of a batch, unpacked. Bound: enough work for all cores, and small compared with a recording.
const MAX_BATCH_BYTES: u64 = 4 << 20;
/// Maximum number of chunks of a batch. Bound: with small chunks, a larger batch would only delay the first messages.
const MAX_BATCH_CHUNKS: usize = 1024;
/// Parts of a batch. Bound: more than there are cores, to balance the load.
const PARTS: usize = 16;

/// A record of a chunk.
pub(crate) enum Item<T> {
    /// A message on a topic that was known before the batch; `None` if the topic is not wanted.
    Message { channel_id: u16, log_time_ns: u64, message: Option<T> },
    /// Any other record; it is read after the records before it.
    Record { opcode: u8, body: Vec<u8> },
    /// The chunk ends within a record.
    Cut,
}

/// A chunk of a batch.
pub(crate) struct UnpackedChunk<T> {
    /// Its offset in the file.
    pub(crate) offset: u64,
    pub(crate) items: Result<Vec<Item<T>>, ChunkError>,
}

/// Chunks that are unpacked together.
#[derive(Default)]
pub(crate) struct Batch {
    chunks: Vec<(u64, Vec<u8>)>,
    bytes: u64,
}

impl Batch {
    /// Whether a chunk may share a batch: reading a large one at once might need many times its size.
    pub(crate) fn accepts(body: &[u8]) -> bool {
        claimed_bytes(body).is_none_or(|bytes| bytes <= MAX_BATCH_BYTES)
    }

    /// Adds a chunk at `offset` in the file.
    pub(crate) fn push(&mut self, offset: u64, body: &[u8]) {
        self.bytes = self.bytes.saturating_add(claimed_bytes(body).unwrap_or(0));
        self.chunks.push((offset, body.to_owned()));
    }

    pub(crate) fn is_full(&self) -> bool {
        self.bytes >= MAX_BATCH_BYTES || self.chunks.len() >= MAX_BATCH_CHUNKS
    }

    /// Unpacks the chunks and reads their messages on topics that are `known`; leaves the batch empty.
    pub(crate) fn open<S: Sink>(
        &mut self,
        sink: &S,
        known: impl Fn(u16) -> bool + Sync,
        max_chunk_bytes: u64,
    ) -> Vec<UnpackedChunk<S::SinkMessage>> {
        let Batch { chunks, .. } = std::mem::take(self);
        let parts: Vec<&[(u64, Vec<u8>)]> = chunks.chunks(chunks.len().div_ceil(PARTS).max(1)).collect();
        let open = |part: &&[(u64, Vec<u8>)]| {
            let mut unpacker = Unpacker::new();
            let one = |(offset, body): &(u64, Vec<u8>)| {
                let content = unpacker.unpack(body, max_chunk_bytes);
                UnpackedChunk {
                    offset: *offset,
                    items: content.map(|content| split_items(content, sink, &known)),
                }
            };
            part.iter().map(one).collect::<Vec<_>>()
        };
        parallel::map(&parts, open).into_iter().flatten().collect()
    }
}

fn split_items<S: Sink>(mut rest: &[u8], sink: &S, known: impl Fn(u16) -> bool) -> Vec<Item<S::SinkMessage>> {
    let mut items = Vec::new();
    while !rest.is_empty() {
        let Some((opcode, body, after)) = split_record(rest) else {
            items.push(Item::Cut);
            break;
        };
        let message = (opcode == op::MESSAGE).then(|| parse_message(body)).flatten();
        items.push(match message.filter(|(channel_id, ..)| known(*channel_id)) {
            Some((channel_id, log_time_ns, data)) => {
                Item::Message { channel_id, log_time_ns, message: sink.read(channel_id, data) }
            }
            None => Item::Record { opcode, body: body.to_owned() },
        });
        rest = after;
    }
    items
}
