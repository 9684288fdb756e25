//! Logs in Apache Parquet.

use crate::tables::record_batches::{Batches, batch_of, open_log};
use arrow_schema::Schema;
use mapper_recording::logs::limits::max_unpacked_bytes;
use mapper_recording::logs::{Log, LogError, LogFile, LogFormat, LogOptions, SampleTable};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use std::io;

pub(crate) const FORMAT: LogFormat =
    LogFormat { name: NAME, recognises, open, write: Some(("parquet", write)) };

const NAME: &str = "Parquet";

fn write(table: &SampleTable) -> io::Result<Vec<u8>> {
    let batch = batch_of(table).map_err(io::Error::other)?;
    let compression = Compression::ZSTD(ZstdLevel::default());
    let properties = WriterProperties::builder().set_compression(compression).build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    writer.close()?;
    Ok(bytes)
}

/// Rows decoded at once.
const BATCH_ROWS: usize = 8192;

/// Unpacked size of a value, bytes.
const VALUE_BYTES: u64 = 8;

fn recognises(head: &[u8]) -> bool {
    head.starts_with(b"PAR1")
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    open_log(NAME, file, options, batches)
}

fn batches(file: &LogFile) -> Result<(Schema, Batches), LogError> {
    let limit_bytes = max_unpacked_bytes(file.size_bytes()?);
    let failed = |error: ParquetError| file.content_error(NAME, error.to_string());
    macro_rules! reader_of {
        ($source:expr) => {{
            let builder = ParquetRecordBatchReaderBuilder::try_new($source).map_err(failed)?;
            let rows = u64::try_from(builder.metadata().file_metadata().num_rows()).unwrap_or(u64::MAX);
            if rows.saturating_mul(VALUE_BYTES) > limit_bytes {
                return Err(file.content_error(
                    NAME,
                    format!(
                        "it states {rows} rows; a file of this size may have {}",
                        limit_bytes / VALUE_BYTES
                    ),
                ));
            }
            let schema = builder.schema().as_ref().clone();
            let reader = builder.with_batch_size(BATCH_ROWS).build().map_err(failed)?;
            (schema, Box::new(reader) as Batches)
        }};
    }
    Ok(match file.bytes() {
        Some(bytes) => reader_of!(bytes::Bytes::copy_from_slice(bytes)),
        None => reader_of!(file.open_path()?),
    })
}
