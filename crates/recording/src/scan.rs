//! One pass over a recording within limits: finds the recoverable data and forwards them.

use crate::logs::LogFormats;
use crate::mcap::{
    Batch, ChannelDefinition, ChunkError, Frame, FrameReader, Item, MAGIC, Sink, UnpackedChunk, Unpacker, op,
    parse_attachment, parse_channel, parse_message, parse_metadata, parse_schema, split_record,
};
use crate::{DamagedPart, ReadWarning, RecordError};
use std::collections::BTreeMap;
use std::io;
use std::io::Read;
use std::path::Path;

/// Larger schemas are skipped, bytes. Bound: the memory that many of them could take.
const MAX_SCHEMA_BYTES: usize = 1 << 20;

/// Maximum total size of topic definitions and schemas; later ones are skipped. Bound: memory; later ones are skipped.
const MAX_DEFINITIONS_BYTES: usize = 64 << 20;

/// Number of damaged chunks and records that are listed; further ones are only counted. Bound: memory; further ones are only counted.
const MAX_LISTED_DAMAGE: u64 = 100;

#[derive(Default)]
pub(crate) struct ScanResult {
    pub(crate) warnings: Vec<ReadWarning>,
    /// All topics that the file defines, in chunks or in the index at its end.
    definitions: BTreeMap<u16, ChannelDefinition>,
    schemas: BTreeMap<u16, Vec<u8>>,
    /// Messages that came before a definition of their topic.
    undefined: BTreeMap<u16, u64>,
    /// Records of any kind, damaged ones included.
    records: u64,
    damaged: u64,
    unpacked_chunks: u64,
    /// Bytes of all definitions and schemas.
    defined_bytes: usize,
}

/// Reads a recording into a fresh sink. If a damaged chunk contained the definition of a topic, and the index at the
/// file's end still has it, a second pass uses that one.
pub(crate) fn scan<S: Sink>(
    path: &Path,
    open: &dyn Fn() -> io::Result<Box<dyn Read>>,
    options: &ReadOptions,
    new_sink: impl Fn() -> S,
) -> Result<(S, ScanResult), RecordError> {
    let mut sink = new_sink();
    let first = pass(path, open, options, &BTreeMap::new(), &mut sink)?;
    if !first.undefined.keys().any(|id| first.definitions.contains_key(id)) {
        return Ok((sink, first));
    }
    let mut sink = new_sink();
    let second = pass(path, open, options, &first.definitions, &mut sink)?;
    Ok((sink, second))
}

fn pass<S: Sink>(
    path: &Path,
    open: &dyn Fn() -> io::Result<Box<dyn Read>>,
    options: &ReadOptions,
    known: &BTreeMap<u16, ChannelDefinition>,
    sink: &mut S,
) -> Result<ScanResult, RecordError> {
    let failed = |source| RecordError::Read { path: path.to_owned(), source };
    let mut source = open().map_err(failed)?;
    let mut magic = Vec::new();
    source.by_ref().take(MAGIC.len() as u64).read_to_end(&mut magic).map_err(failed)?;
    if magic != MAGIC {
        return Err(RecordError::NotMcap { path: path.to_owned(), found: describe(&magic) });
    }
    known.values().for_each(|definition| sink.define(definition));
    let mut scanned = ScanResult { definitions: known.clone(), ..ScanResult::default() };
    let mut frames = FrameReader::new(source, MAGIC.len() as u64);
    let (mut unpacker, mut batch) = (Unpacker::new(), Batch::default());
    let mut end = MAGIC.len() as u64;
    loop {
        let frame = frames.next_frame().map_err(failed)?;
        let joins = matches!(&frame, Frame::Record { opcode: op::CHUNK, body, .. } if Batch::accepts(body));
        // A message index follows its chunk; every other record is handled after the chunks before it.
        let index = matches!(&frame, Frame::Record { opcode: op::MESSAGE_INDEX, .. });
        if !(joins || index) || batch.is_full() {
            scanned.batch(&mut batch, options, sink);
        }
        match frame {
            Frame::Record { opcode: op::FOOTER, .. } => break,
            // No record has opcode 0: after a power failure a file may end in zeros.
            Frame::Record { offset, opcode: 0, .. } | Frame::Truncated { offset } => {
                scanned.warnings.push(ReadWarning::Truncated { offset });
                break;
            }
            Frame::End => {
                scanned.warnings.push(ReadWarning::Truncated { offset: end });
                break;
            }
            Frame::Record { offset, opcode, body } => {
                end = offset + 9 + body.len() as u64;
                match opcode {
                    op::CHUNK if joins => batch.push(offset, body),
                    op::CHUNK => scanned.chunk(offset, body, options, &mut unpacker, sink),
                    _ => scanned.record(offset, opcode, body, options, sink),
                }
            }
        }
        if scanned.records > options.max_messages {
            scanned.warnings.push(ReadWarning::TooManyMessages { limit: options.max_messages });
            break;
        }
        if sink.value_count() > options.max_values {
            scanned.warnings.push(ReadWarning::TooManyValues { limit: options.max_values });
            break;
        }
    }
    if scanned.damaged > MAX_LISTED_DAMAGE {
        scanned.warnings.push(ReadWarning::MoreDamage { count: scanned.damaged - MAX_LISTED_DAMAGE });
    }
    let count = scanned.undefined.values().sum();
    if count > 0 {
        scanned.warnings.push(ReadWarning::UndefinedChannel { count });
    }
    Ok(scanned)
}

impl ScanResult {
    /// The first chunk with an unknown compression, if no chunk could be unpacked: the file is whole, and was written by another program.
    pub(crate) fn unknown_compression(&self) -> Option<&ReadWarning> {
        let unknown = |warning: &&ReadWarning| {
            matches!(warning, ReadWarning::DamagedChunk { source: ChunkError::Compression { .. }, .. })
        };
        self.warnings.iter().find(unknown).filter(|_| self.unpacked_chunks == 0)
    }

    fn note_damage(&mut self, warning: ReadWarning) {
        self.damaged += 1;
        if self.damaged <= MAX_LISTED_DAMAGE {
            self.warnings.push(warning);
        }
    }

    fn has_room(&mut self, bytes: usize) -> bool {
        let together = self.defined_bytes.saturating_add(bytes);
        let fits = together <= MAX_DEFINITIONS_BYTES;
        if fits {
            self.defined_bytes = together;
        }
        fits
    }

    fn batch<S: Sink>(&mut self, batch: &mut Batch, options: &ReadOptions, sink: &mut S) {
        let known = |channel_id| self.definitions.contains_key(&channel_id);
        for UnpackedChunk { offset, items } in batch.open(sink, known, options.max_chunk_bytes) {
            match items {
                Ok(items) => {
                    self.unpacked_chunks += 1;
                    items.into_iter().for_each(|item| self.item(offset, item, options, sink));
                }
                Err(source) => self.note_damage(ReadWarning::DamagedChunk { offset, source }),
            }
        }
    }

    fn item<S: Sink>(
        &mut self,
        offset: u64,
        item: Item<S::SinkMessage>,
        options: &ReadOptions,
        sink: &mut S,
    ) {
        match item {
            Item::Record { opcode, body } => self.record(offset, opcode, &body, options, sink),
            Item::Cut if self.has_capacity(options, sink) => {
                self.note_damage(ReadWarning::DamagedChunk { offset, source: ChunkError::CutRecord });
            }
            Item::Cut => {}
            Item::Message { channel_id, log_time_ns, message } => {
                self.records += 1;
                if let Some(message) = message.filter(|_| self.has_capacity(options, sink)) {
                    sink.take(channel_id, log_time_ns, message);
                }
            }
        }
    }

    fn has_capacity(&self, options: &ReadOptions, sink: &impl Sink) -> bool {
        self.records <= options.max_messages && sink.value_count() <= options.max_values
    }

    fn chunk<S: Sink>(
        &mut self,
        offset: u64,
        body: &[u8],
        options: &ReadOptions,
        unpacker: &mut Unpacker,
        sink: &mut S,
    ) {
        let mut rest = match unpacker.unpack(body, options.max_chunk_bytes) {
            Ok(content) => {
                self.unpacked_chunks += 1;
                content
            }
            Err(error) => {
                self.note_damage(ReadWarning::DamagedChunk { offset, source: error });
                return;
            }
        };
        while !rest.is_empty() && self.has_capacity(options, sink) {
            let Some((opcode, body, after)) = split_record(rest) else {
                self.note_damage(ReadWarning::DamagedChunk { offset, source: ChunkError::CutRecord });
                return;
            };
            self.record(offset, opcode, body, options, sink);
            rest = after;
        }
    }

    fn record<S: Sink>(&mut self, offset: u64, opcode: u8, body: &[u8], options: &ReadOptions, sink: &mut S) {
        self.records += 1;
        if !self.has_capacity(options, sink) {
            return;
        }
        let whole = match opcode {
            op::MESSAGE => {
                parse_message(body).map(|(id, log_time_ns, data)| match self.definitions.contains_key(&id) {
                    true => sink
                        .read(id, data)
                        .into_iter()
                        .for_each(|message| sink.take(id, log_time_ns, message)),
                    false => *self.undefined.entry(id).or_default() += 1,
                })
            }
            op::SCHEMA => parse_schema(body).map(|(id, data)| {
                let new = data.len() <= MAX_SCHEMA_BYTES && !self.schemas.contains_key(&id);
                if new && self.has_room(data.len()) {
                    self.schemas.insert(id, data.to_owned());
                }
            }),
            op::CHANNEL => parse_channel(body).map(|(mut definition, schema_id)| {
                let schema_bytes = self.schemas.get(&schema_id).map_or(0, Vec::len);
                if self.definitions.contains_key(&definition.id) || !self.has_room(body.len() + schema_bytes)
                {
                    return;
                }
                definition.schema = self.schemas.get(&schema_id).cloned().unwrap_or_default();
                sink.define(&definition);
                self.definitions.insert(definition.id, definition);
            }),
            op::METADATA => parse_metadata(body).map(|(name, pairs)| sink.metadata(name, pairs)),
            op::ATTACHMENT => parse_attachment(body).map(|(name, data)| sink.attachment(name, data)),
            _ => Some(()),
        };
        if whole.is_none() {
            let part = match opcode {
                op::MESSAGE => DamagedPart::Message,
                op::SCHEMA => DamagedPart::Schema,
                op::CHANNEL => DamagedPart::Topic,
                op::METADATA => DamagedPart::Metadata,
                _ => DamagedPart::Attachment,
            };
            self.note_damage(ReadWarning::DamagedRecord { offset, part });
        }
    }
}

fn describe(magic: &[u8]) -> String {
    if magic.is_empty() { "nothing: it is empty".to_owned() } else { format!("`{}`", magic.escape_ascii()) }
}

/// Limits that protect the reader from a file.
#[derive(Debug, Clone, Copy)]
pub struct ReadOptions {
    /// Chunks with a larger stated size are left out, bytes.
    pub max_chunk_bytes: u64,
    /// Messages and other records beyond these are left out; a log with more rows is refused.
    pub max_messages: u64,
    /// Values beyond these are left out; a log with more in its mapped columns, after averaging, is refused.
    pub max_values: u64,
    /// Whether samples that are faster than identification needs are averaged.
    pub averages: bool,
    /// Formats of logs that are read in addition to MCAP.
    pub logs: LogFormats,
}

impl Default for ReadOptions {
    /// 256 MiB; 100 million, a month of four groups at 10 Hz; 64 million of 16 bytes, three days of 24 channels
    /// at 10 Hz; MCAP alone.
    fn default() -> Self {
        ReadOptions {
            max_chunk_bytes: 256 << 20,
            max_messages: 100_000_000,
            max_values: 64_000_000,
            averages: true,
            logs: LogFormats::default(),
        }
    }
}
