//! Limits of the reader.

use crate::logs::LogFormats;

/// Limits that protect the reader from a file.
#[derive(Debug, Clone, Copy)]
pub struct ReadOptions {
    /// Chunks with a larger stated size are left out, bytes.
    pub max_chunk_bytes: u64,
    /// Messages and other records beyond these are left out; a log with more rows is refused.
    pub max_messages: u64,
    /// Values beyond these are left out; a log with more in its mapped columns, after averaging, is refused.
    pub max_values: u64,
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
            logs: LogFormats::default(),
        }
    }
}
