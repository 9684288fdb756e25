//! Records of an MCAP file or chunk, one after the other, parsed without trusting any length. `mcap`'s own readers stop at the first fault, allocate a stated length (4 GB for a damaged string), and panic on a short attachment.

use std::collections::BTreeMap;
use std::io;
use std::io::Read;

/// Start of every MCAP file.
pub(crate) const MAGIC: &[u8] = mcap::MAGIC;
/// Kinds of records.
pub(crate) use mcap::records::op;

/// Reads fields off the front of a body.
pub(crate) struct Body<'a>(pub(crate) &'a [u8]);

impl<'a> Body<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        Some(u16::from_le_bytes(*self.bytes(2)?.first_chunk()?))
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(*self.bytes(4)?.first_chunk()?))
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(*self.bytes(8)?.first_chunk()?))
    }

    /// Bytes after their number in 32 bits.
    pub(crate) fn u32_prefixed_bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()?;
        self.bytes(usize::try_from(count).ok()?)
    }

    /// Bytes after their number in 64 bits.
    pub(crate) fn u64_prefixed_bytes(&mut self) -> Option<&'a [u8]> {
        let count = self.u64()?;
        self.bytes(usize::try_from(count).ok()?)
    }

    pub(crate) fn text(&mut self) -> Option<String> {
        Some(std::str::from_utf8(self.u32_prefixed_bytes()?).ok()?.to_owned())
    }

    pub(crate) fn text_map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut pairs = Body(self.u32_prefixed_bytes()?);
        let mut map = BTreeMap::new();
        while !pairs.0.is_empty() {
            map.insert(pairs.text()?, pairs.text()?);
        }
        Some(map)
    }
}

/// A topic as a file defines it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChannelDefinition {
    pub(crate) id: u16,
    pub(crate) topic: String,
    pub(crate) encoding: String,
    pub(crate) metadata: BTreeMap<String, String>,
    /// Content of the schema; empty if there is none.
    pub(crate) schema: Vec<u8>,
}

/// Id and content of a schema.
pub(crate) fn parse_schema(body: &[u8]) -> Option<(u16, &[u8])> {
    let mut body = Body(body);
    let id = body.u16()?;
    let (_name, _encoding) = (body.u32_prefixed_bytes()?, body.u32_prefixed_bytes()?);
    Some((id, body.u32_prefixed_bytes()?))
}

/// A topic and the id of its schema; the schema's content is not filled in.
pub(crate) fn parse_channel(body: &[u8]) -> Option<(ChannelDefinition, u16)> {
    let mut body = Body(body);
    let (id, schema_id) = (body.u16()?, body.u16()?);
    let (topic, encoding, metadata) = (body.text()?, body.text()?, body.text_map()?);
    Some((ChannelDefinition { id, topic, encoding, metadata, schema: Vec::new() }, schema_id))
}

/// Channel id, log time and content of a message.
pub(crate) fn parse_message(body: &[u8]) -> Option<(u16, u64, &[u8])> {
    let mut body = Body(body);
    let (id, _sequence, log_time, _publish_time) = (body.u16()?, body.u32()?, body.u64()?, body.u64()?);
    Some((id, log_time, body.0))
}

/// Name and pairs of a metadata record.
pub(crate) fn parse_metadata(body: &[u8]) -> Option<(String, BTreeMap<String, String>)> {
    let mut body = Body(body);
    Some((body.text()?, body.text_map()?))
}

/// Name and content of an attachment with a correct checksum.
pub(crate) fn parse_attachment(record: &[u8]) -> Option<(String, &[u8])> {
    let mut body = Body(record);
    let (_log_time, _create_time) = (body.u64()?, body.u64()?);
    let (name, _media_type, data) = (body.text()?, body.u32_prefixed_bytes()?, body.u64_prefixed_bytes()?);
    let checked = record.get(..record.len() - body.0.len())?;
    let saved = body.u32()?;
    (saved == 0 || saved == crc32fast::hash(checked)).then_some((name, data))
}

/// Bytes before a record's body. Source: MCAP, one of opcode, eight of length.
const FRAME_BYTES: usize = 9;

/// Result of a read.
#[derive(Debug, PartialEq)]
pub(crate) enum Frame<'a> {
    /// A whole record.
    Record { offset: u64, opcode: u8, body: &'a [u8] },
    /// The stream ends between two records.
    End,
    /// The stream ends within the record at this offset.
    Truncated { offset: u64 },
}

/// Reads records from a stream. Memory grows with the actual data, never with a stated length.
pub(crate) struct FrameReader<R> {
    source: R,
    offset: u64,
    buffer: Vec<u8>,
}

impl<R: Read> FrameReader<R> {
    /// Starts at the first record, `offset` bytes into the file.
    pub(crate) fn new(source: R, offset: u64) -> Self {
        FrameReader { source, offset, buffer: Vec::new() }
    }

    /// The next record.
    pub(crate) fn next_frame(&mut self) -> io::Result<Frame<'_>> {
        let offset = self.offset;
        self.buffer.clear();
        let frame_bytes = self.source.by_ref().take(FRAME_BYTES as u64).read_to_end(&mut self.buffer)?;
        if frame_bytes == 0 {
            return Ok(Frame::End);
        }
        let Some((opcode, length)) = parse_frame(&self.buffer) else {
            return Ok(Frame::Truncated { offset });
        };
        self.buffer.clear();
        let body_bytes = self.source.by_ref().take(length).read_to_end(&mut self.buffer)? as u64;
        if body_bytes < length {
            return Ok(Frame::Truncated { offset });
        }
        self.offset = offset.saturating_add(FRAME_BYTES as u64).saturating_add(length);
        Ok(Frame::Record { offset, opcode, body: &self.buffer })
    }
}

/// Splits the first record off a chunk: opcode, body, rest. `None` if it is incomplete.
pub(crate) fn split_record(chunk: &[u8]) -> Option<(u8, &[u8], &[u8])> {
    let (opcode, length) = parse_frame(chunk)?;
    let rest = &chunk[FRAME_BYTES..];
    let length = usize::try_from(length).ok().filter(|length| *length <= rest.len())?;
    let (body, rest) = rest.split_at(length);
    Some((opcode, body, rest))
}

fn parse_frame(bytes: &[u8]) -> Option<(u8, u64)> {
    let (opcode, rest) = bytes.split_first()?;
    Some((*opcode, u64::from_le_bytes(*rest.first_chunk()?)))
}

/// Receives the content of a recording.
pub(crate) trait Sink: Sync {
    type SinkMessage: Send;
    /// A topic, before its first message.
    fn define(&mut self, definition: &ChannelDefinition);
    /// Reads a message on a defined topic; `None` if the topic is not wanted. Several are read in parallel.
    fn read(&self, channel_id: u16, data: &[u8]) -> Option<Self::SinkMessage>;
    /// Receives the content of a message, in the order of the file.
    fn take(&mut self, channel_id: u16, log_time_ns: u64, content: Self::SinkMessage);
    /// A metadata record.
    fn metadata(&mut self, name: String, pairs: BTreeMap<String, String>);
    fn attachment(&mut self, name: String, data: &[u8]);
    /// Number of values kept so far.
    fn value_count(&self) -> u64;
}
