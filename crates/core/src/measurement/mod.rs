//! Measured data for every step of the work: channels, sensor uncertainties, samples, events, and recordings in memory.

pub(crate) mod channel;
pub(crate) mod declared_uncertainty;
pub(crate) mod event;
pub(crate) mod fault_kind;
pub(crate) mod frozen;
pub(crate) mod joined_recordings;
mod joined_samples;
pub(crate) mod jump;
pub(crate) mod plausible;
pub(crate) mod recording;
pub(crate) mod redundant;
pub(crate) mod sample;
pub(crate) mod step_marker;
