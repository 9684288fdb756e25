//! The MCAP container: records and chunks.

use mapper_numerics::parallel;
pub(crate) use mcap::records::op;
use serde::de::{Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::value::RawValue;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;
use std::{fmt, io};
use zstd::zstd_safe::{DCtx, ResetDirective, get_error_name};

// Records of an MCAP file or chunk, one after the other, parsed without trusting any length. `mcap`'s own readers stop at the first fault, allocate a stated length (4 GB for a damaged string), and panic on a short attachment.
// The numbers of a flat JSON message are read exactly, without building a tree.

/// Start of every MCAP file.
pub(crate) const MAGIC: &[u8] = mcap::MAGIC;

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

    fn text_map(&mut self) -> Option<BTreeMap<String, String>> {
        let mut pairs = Body(self.u32_prefixed_bytes()?);
        let mut map = BTreeMap::new();
        while !pairs.0.is_empty() {
            map.insert(pairs.text()?, pairs.text()?);
        }
        Some(map)
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ChannelDefinition {
    pub(crate) id: u16,
    pub(crate) topic: String,
    pub(crate) encoding: String,
    pub(crate) metadata: BTreeMap<String, String>,
    pub(crate) schema: Vec<u8>,
}

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

/// Program and version that wrote a recording; `None` if its header cannot be read.
pub fn recording_program(path: &Path) -> Option<String> {
    /// A header has two short texts, bytes. Bound: memory.
    const MAX_HEADER_BYTES: u64 = 4096;
    let mut start = mapper_yaml::open_file(path).ok()?.take(MAX_HEADER_BYTES);
    let mut magic = vec![0; MAGIC.len()];
    start.read_exact(&mut magic).ok().filter(|()| magic == MAGIC)?;
    match FrameReader::new(start, MAGIC.len() as u64).next_frame().ok()? {
        Frame::Record { opcode: op::HEADER, body, .. } => {
            let mut body = Body(body);
            let (_profile, library) = (body.text()?, body.text()?);
            Some(library).filter(|library| !library.is_empty())
        }
        _ => None,
    }
}

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

pub(crate) trait Sink: Sync {
    type SinkMessage: Send;
    fn define(&mut self, definition: &ChannelDefinition);
    /// Reads a message on a defined topic; `None` if the topic is not wanted. Several are read in parallel.
    fn read(&self, channel_id: u16, data: &[u8]) -> Option<Self::SinkMessage>;
    fn take(&mut self, channel_id: u16, log_time_ns: u64, content: Self::SinkMessage);
    fn metadata(&mut self, name: String, pairs: BTreeMap<String, String>);
    fn attachment(&mut self, name: String, data: &[u8]);
    fn value_count(&self) -> u64;
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum FieldValue {
    /// The field is missing.
    Absent,
    /// A number; NaN for null.
    Number(f64),
    /// Something else.
    Other,
}

/// Reads the named fields into `values`, which is resized to the number of names. Returns false if the message is
/// not a JSON object.
pub(crate) fn read_fields(message: &[u8], names: &[String], values: &mut Vec<FieldValue>) -> bool {
    let read = |message: &[u8], values: &mut Vec<FieldValue>| {
        values.clear();
        values.resize(names.len(), FieldValue::Absent);
        // Of a slice, serde_json would check the UTF-8 of each number.
        let Ok(text) = std::str::from_utf8(message) else { return false };
        if read_plain(text, names, values).is_some() {
            return true;
        }
        values.fill(FieldValue::Absent);
        let mut deserializer = serde_json::Deserializer::from_str(text);
        deserializer.deserialize_map(FieldsVisitor { names, values }).is_ok() && deserializer.end().is_ok()
    };
    // Python's json writes NaN and Infinity, which JSON does not have.
    read(message, values) || null_for_nonfinite(message).is_some_and(|message| read(&message, values))
}

/// Reads a message as our writer makes it, in half the time: plain keys and numbers without spaces. `None` for any other.
fn read_plain(message: &str, names: &[String], values: &mut [FieldValue]) -> Option<()> {
    let until = |text: &str, ends: &[u8]| text.bytes().position(|byte| ends.contains(&byte));
    let mut rest = message.strip_prefix('{')?;
    let mut expected = 0;
    loop {
        rest = rest.strip_prefix('"')?;
        let (key, after) = rest.split_at(until(rest, b"\"\\")?);
        let after = after.strip_prefix("\":")?;
        let (number, after) = after.split_at(until(after, b",}")?);
        // `parse` would also take -inf.
        let is_finite = number.ends_with(|last: char| last.is_ascii_digit());
        let value = match parse(number) {
            value @ FieldValue::Number(_) if is_finite || number == "null" => value,
            _ => return None,
        };
        if let Some(index) = position(names, expected, key) {
            values[index] = value;
            expected = index + 1;
        }
        if after == "}" {
            return Some(());
        }
        rest = after.strip_prefix(',')?;
    }
}

/// The place of a key among the names; messages usually keep the order of the names.
fn position(names: &[String], expected: usize, key: &str) -> Option<usize> {
    if names.get(expected).is_some_and(|name| name == key) {
        return Some(expected);
    }
    names.iter().position(|name| name == key)
}

struct FieldsVisitor<'a> {
    names: &'a [String],
    values: &'a mut [FieldValue],
}

impl<'de> Visitor<'de> for FieldsVisitor<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object of numbers")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let mut expected = 0;
        while let Some(index) = map.next_key_seed(KeySeed { names: self.names, expected })? {
            match index {
                Some(index) => {
                    self.values[index] = parse(map.next_value::<&RawValue>()?.get());
                    expected = index + 1;
                }
                None => drop(map.next_value::<IgnoredAny>()?),
            }
        }
        Ok(())
    }
}

/// The standard library's parser returns the nearest number, which serde_json's own does not always.
fn parse(raw: &str) -> FieldValue {
    match raw {
        "null" => FieldValue::Number(f64::NAN),
        _ => raw.parse().map_or(FieldValue::Other, FieldValue::Number),
    }
}

struct KeySeed<'a> {
    names: &'a [String],
    expected: usize,
}

impl<'de> serde::de::DeserializeSeed<'de> for KeySeed<'_> {
    type Value = Option<usize>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Option<usize>, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for KeySeed<'_> {
    type Value = Option<usize>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E>(self, key: &str) -> Result<Option<usize>, E> {
        Ok(position(self.names, self.expected, key))
    }
}

/// The message with null for NaN, Infinity and -Infinity outside strings; `None` if it contains none of them.
fn null_for_nonfinite(message: &[u8]) -> Option<Vec<u8>> {
    let mut rewritten = Vec::with_capacity(message.len());
    let (mut in_string, mut escaped, mut changed) = (false, false, false);
    let mut rest = message;
    while let Some((&byte, after)) = rest.split_first() {
        let token =
            [&b"NaN"[..], b"Infinity", b"-Infinity"].into_iter().find(|token| rest.starts_with(token));
        if let (false, Some(token)) = (in_string, token) {
            rewritten.extend_from_slice(b"null");
            changed = true;
            rest = &rest[token.len()..];
            continue;
        }
        if byte == b'"' && !escaped {
            in_string = !in_string;
        }
        escaped = in_string && byte == b'\\' && !escaped;
        rewritten.push(byte);
        rest = after;
    }
    changed.then_some(rewritten)
}

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

pub(crate) enum Item<T> {
    /// A message on a topic that was known before the batch; `None` if the topic is not wanted.
    Message { channel_id: u16, log_time_ns: u64, message: Option<T> },
    /// Any other record; it is read after the records before it.
    Record { opcode: u8, body: Vec<u8> },
    /// The chunk ends within a record.
    Cut,
}

pub(crate) struct UnpackedChunk<T> {
    pub(crate) offset: u64,
    pub(crate) items: Result<Vec<Item<T>>, ChunkError>,
}

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

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(message: &str, names: &[&str]) -> Option<Vec<FieldValue>> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        let mut values = Vec::new();
        read_fields(message.as_bytes(), &names, &mut values).then_some(values)
    }

    #[test]
    fn numbers_are_the_nearest_ones_and_everything_else_is_distinguished() {
        use FieldValue::{Absent, Number, Other};
        let values = fields(
            r#"{"b":-0.1,"x":{"a":[9]},"a":1.7976931348623157e308,"c":"1","d":7}"#,
            &["a", "b", "c", "d", "e"],
        );
        assert_eq!(values, Some(vec![Number(f64::MAX), Number(-0.1), Other, Number(7.0), Absent]));
    }

    #[test]
    fn nan_as_python_writes_it_is_nan() {
        let values =
            fields(r#"{"s":"NaN \" NaN","a":NaN,"b":-Infinity,"c":null}"#, &["a", "b", "c", "s"]).unwrap();
        assert!(values[..3].iter().all(|v| matches!(v, FieldValue::Number(x) if x.is_nan())), "{values:?}");
        assert_eq!(values[3], FieldValue::Other);
    }

    #[test]
    fn messages_that_are_not_objects_are_refused() {
        for message in ["", "[1]", "{", "{\"a\":}", "{\"a\":1} x", "\u{fffd}"] {
            assert_eq!(fields(message, &["a"]), None, "{message}");
        }
    }
}
