//! The formats of foreign logs, one file each.
//!
//! To add one, write its file with a constant `FORMAT`, and its line below. A format that is known by few bytes alone
//! stands before one that takes any text.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod cells;
mod clock;
mod clock_choice;
mod encoding;
mod instant;
mod number;
mod row_stream;
mod separator;
mod table_head;
mod table_log;

use mapper_logs::LogFormats;

/// Declares the formats' modules and the list of them.
macro_rules! logs {
    ($($name:ident),* $(,)?) => {
        $(mod $name;)*

        /// Every format, in the order in which they are asked.
        pub const LOG_FORMATS: LogFormats = LogFormats(&[$($name::FORMAT),*]);
    };
}

logs! {
    mdf4,
    xlsx,
    delimited,
}
