//! Values that settings of several drivers contain.

pub(crate) mod address;
pub(crate) mod by_channel;
pub(crate) mod secret;
