//! Records of an MCAP file or chunk, one after the other: opcode, length, body.
//!
//! The framing is read here rather than by `mcap`'s readers because those stop at the first fault, and because
//! wrong lengths must neither allocate nor overflow.

use std::io::{self, Read};

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
