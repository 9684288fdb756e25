//! The content of a chunk, decompressed within limits and checked.

use crate::mcap::records::Body;
use std::io::{self, Read};
use zstd::zstd_safe::{DCtx, ResetDirective, get_error_name};

/// Why a chunk cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ChunkError {
    #[error("its header is incomplete")]
    Header,
    #[error("its header gives {claimed} bytes, and at most {limit} bytes are read")]
    TooLarge { claimed: u64, limit: u64 },
    #[error("it is compressed with `{compression}`, and only lz4 and zstd can be read")]
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
