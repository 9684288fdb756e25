//! Low-level reading of MCAP files that may be damaged: records, chunks and messages, with every length checked.

pub(crate) mod chunk;
pub(crate) mod records;
