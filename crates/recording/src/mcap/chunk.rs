//! Chunks, decompressed within limits and checked, and their messages, read in parallel: parsing numbers from text dominates the cost of reading a recording.

use crate::mcap::records::{Body, Sink, op, parse_message, split_record};
use mapper_numerics::parallel;
use std::io;
use std::io::Read;
use zstd::zstd_safe::{DCtx, ResetDirective, get_error_name};

/// Why a chunk cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ChunkError {
    #[error("its header is incomplete")]
    Header,
    #[error("its header gives {claimed} bytes, and at most {limit} bytes are read")]
    TooLarge { claimed: u64, limit: u64 },
    #[error(
        "it is compressed with `{compression}`, and only lz4 and zstd can be read; export it again with one of them"
    )]
    Compression { compression: String },
    #[error("it does not decompress ({reason})")]
    Decompress { reason: String },
    #[error("it has {found} bytes, and its header gives {claimed}")]
    Length { claimed: u64, found: u64 },
    #[error("its checksum is {found:08x}, not {saved:08x} as stored")]
    Checksum { saved: u32, found: u32 },
    #[error("it ends within a record")]
    CutRecord,
}

/// Unpacks chunks; keeps the decompression state for the next one.
pub(crate) struct Unpacker {
    context: DCtx<'static>,
    content: Vec<u8>,
}

impl Unpacker {
    pub(crate) fn new() -> Self {
        Unpacker { context: DCtx::create(), content: Vec::new() }
    }

    /// The records of a chunk.
    pub(crate) fn unpack(&mut self, body: &[u8], limit: u64) -> Result<&[u8], ChunkError> {
        let (claimed, saved, compression, data) = parse_header(body).ok_or(ChunkError::Header)?;
        if claimed > limit {
            return Err(ChunkError::TooLarge { claimed, limit });
        }
        self.content.clear();
        match compression {
            b"" => self.content.extend_from_slice(data),
            b"lz4" => {
                let most = claimed.saturating_add(1);
                let mut frames = lz4_flex::frame::FrameDecoder::new(data).take(most);
                frames
                    .read_to_end(&mut self.content)
                    .map_err(|error| ChunkError::Decompress { reason: error.to_string() })?;
            }
            b"zstd" => self
                .decompress(data, claimed)
                .map_err(|error| ChunkError::Decompress { reason: error.to_string() })?,
            other => {
                let compression = String::from_utf8_lossy(other).into_owned();
                return Err(ChunkError::Compression { compression });
            }
        }
        let found = self.content.len() as u64;
        if found != claimed {
            return Err(ChunkError::Length { claimed, found });
        }
        // Zero means that the writer computed no checksum.
        let found = if saved == 0 { 0 } else { crc32fast::hash(&self.content) };
        if found != saved {
            return Err(ChunkError::Checksum { saved, found });
        }
        Ok(&self.content)
    }

    fn decompress(&mut self, data: &[u8], claimed: u64) -> io::Result<()> {
        // A damaged earlier chunk may have left the context within a frame.
        self.context
            .reset(ResetDirective::SessionOnly)
            .map_err(|code| io::Error::other(get_error_name(code)))?;
        let decoder = zstd::stream::read::Decoder::with_context(data, &mut self.context);
        // One byte more than stated reveals a wrong size without unpacking the rest.
        decoder.take(claimed.saturating_add(1)).read_to_end(&mut self.content)?;
        Ok(())
    }
}

/// The stated unpacked size of a chunk, bytes; `None` if its header is incomplete.
pub(crate) fn claimed_bytes(body: &[u8]) -> Option<u64> {
    Some(parse_header(body)?.0)
}

/// Uncompressed size, checksum, compression, data.
fn parse_header(body: &[u8]) -> Option<(u64, u32, &[u8], &[u8])> {
    let mut body = Body(body);
    let (_start, _end) = (body.u64()?, body.u64()?);
    Some((body.u64()?, body.u32()?, body.u32_prefixed_bytes()?, body.u64_prefixed_bytes()?))
}

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
