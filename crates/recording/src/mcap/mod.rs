//! Low-level reading of MCAP files that may be damaged: records, chunks and messages, with every length checked.

pub(crate) mod batch;
pub(crate) mod chunk;
pub(crate) mod framing;
pub(crate) mod message;
pub(crate) mod records;
pub(crate) mod sink;
