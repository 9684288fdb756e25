//! Arrow's files and streams (Feather, version 2).

use crate::tables::record_batches::{Batches, batch_of, open_log};
use arrow_ipc::reader::{FileReader, StreamReader};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{ArrowError, Schema};
use mapper_recording::logs::{Log, LogError, LogFile, LogFormat, LogOptions, SampleTable};
use std::io;

pub(crate) const FORMAT: LogFormat =
    LogFormat { name: NAME, recognises, open, write: Some(("arrow", write)) };

const NAME: &str = "Arrow";

const FILE: &[u8] = b"ARROW1";

fn write(table: &SampleTable) -> io::Result<Vec<u8>> {
    let write = || -> Result<Vec<u8>, ArrowError> {
        let batch = batch_of(table)?;
        let mut writer = FileWriter::try_new(Vec::new(), &batch.schema())?;
        writer.write(&batch)?;
        writer.into_inner()
    };
    write().map_err(io::Error::other)
}

/// A stream begins with the marker of its first message and that message's length, which is below 16 MiB.
fn recognises(head: &[u8]) -> bool {
    head.starts_with(FILE) || (head.starts_with(&[0xff; 4]) && head.get(7) == Some(&0))
}

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    open_log(NAME, file, options, batches)
}

fn batches(file: &LogFile) -> Result<(Schema, Batches), LogError> {
    let failed = |error: ArrowError| file.content_error(NAME, error.to_string());
    if file.head(FILE.len())? == FILE {
        let reader = FileReader::try_new_buffered(file.open()?, None).map_err(failed)?;
        return Ok((reader.schema().as_ref().clone(), Box::new(reader)));
    }
    let reader = StreamReader::try_new_buffered(file.open()?, None).map_err(failed)?;
    Ok((reader.schema().as_ref().clone(), Box::new(reader)))
}
