//! Log tables in all storage forms, presented to the reader of recordings as one stream of rows in order of time.

pub(crate) mod column_log;
pub(crate) mod long_table;
#[cfg(feature = "parquet")]
pub(crate) mod record_batches;
pub(crate) mod table_log;
pub(crate) mod table_row;
