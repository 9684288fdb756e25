//! Reading of recordings and imported logs within limits, in one pass that recovers all valid data.

pub(crate) mod log_reader;
pub(crate) mod recording_reader;
pub(crate) mod scan;
