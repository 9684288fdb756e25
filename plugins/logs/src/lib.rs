//! Readers of imported logs for `mapper`: [`LOG_FORMATS`] lists all formats, one file each.
//!
//! To add one, write its file with a constant `FORMAT`, and its line below. A format with a short signature
//! comes before one that accepts any text.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

pub(crate) mod clock;
pub(crate) mod clock_choice;
mod mdf;
pub(crate) mod table_head;
mod tables;

use mapper_recording::logs::LogFormats;

/// Declares the formats' modules and the list of them.
macro_rules! logs {
    ($($(#[$feature:meta])? $name:ident),* $(,)?) => {
        $($(#[$feature])? mod $name;)*

        /// Every format, in the order of recognition.
        pub const LOG_FORMATS: LogFormats = LogFormats(&[$($(#[$feature])? $name::FORMAT),*]);
    };
}

logs! {
    mdf3,
    mdf4,
    mat5,
    atfx,
    #[cfg(feature = "tdms")]
    tdms,
    #[cfg(feature = "parquet")]
    parquet,
    #[cfg(feature = "parquet")]
    arrow,
    xlsx,
    delimited,
}
