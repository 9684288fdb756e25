//! Columns of a log table found from its first rows: names, units, and the clocks that give the time of each row.

pub(crate) mod clock;
pub(crate) mod clock_choice;
pub(crate) mod table_head;
