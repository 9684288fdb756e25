//! Measured data for every step of the work: channels, sensor uncertainties, samples, events, and recordings in memory.

pub(crate) mod channel;
pub(crate) mod joined_recordings;
pub(crate) mod jump;
pub(crate) mod plausible;
pub(crate) mod recording;
pub(crate) mod redundant;
