//! Writes a recording: one message per device group and sample, flushed each second of the run's clock.

use crate::run_file::{DiskFaults, RunFile};
use crate::topics::{
    ELEMENTS_TOPIC, Field, McapFile, OpenedFile, ProvenanceWriter, RecordingHeader, StepPhase, TRUTH_TOPIC,
    Topic, add_channel, event_message, io_error, open, step_message,
};
use crate::{BatchError, RecordError};
use mapper_core::unit_factors::NS_PER_S;
use mapper_core::{Channel, Event, Group, SampleBatch, StepMarker};
use mcap::McapResult;
use mcap::records::MessageHeader;
use serde_json::{Value, json};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// A topic of numeric fields in the file. All batches have the same topics: a schema for each batch would cost more than the samples.
struct TopicLayout {
    topic: &'static str,
    fields: Vec<(String, String)>,
    channel_id: u16,
    /// Text before each value: `{"speed_rpm":`, then `,"flow_kg_s":` and so on.
    prefixes: Vec<Vec<u8>>,
}

struct Table<'a> {
    /// Position in the writer's layouts.
    layout: usize,
    columns: Vec<&'a [f64]>,
}

/// Writes one recording.
///
/// Samples of a second of the run's clock form a chunk, which goes to the operating system when the clock enters the
/// next second: a process killed at any moment leaves everything before in a readable file. Times are kept in whole
/// nanoseconds, values exactly. Non-finite values are written as null and read back as NaN.
///
/// Dropping a writer finishes the file as well as it can; [`finish`](RecordingWriter::finish) also reports errors.
pub struct RecordingWriter {
    path: PathBuf,
    mcap: McapFile,
    start_time_ns: u64,
    /// Whole second of the run's clock whose messages are not flushed yet.
    second: Option<i64>,
    last_sample_s: Option<f64>,
    saved_until_s: Option<f64>,
    failed: bool,
    step_channel: u16,
    event_channel: u16,
    steps_written: u32,
    events_written: u32,
    layouts: Vec<TopicLayout>,
    /// Topic of fast samples, once there are any: other recordings stay unchanged.
    fast_channel: Option<u16>,
    line: Vec<u8>,
    /// Fields without a reading are not written at all.
    omit_absent: bool,
    provenance: ProvenanceWriter,
}

impl RecordingWriter {
    /// Creates the file and writes header, metadata and attachments.
    pub fn create(path: &Path, header: &RecordingHeader) -> Result<RecordingWriter, RecordError> {
        RecordingWriter::create_on(None, path, header)
    }

    /// The same on a disk with faults.
    pub fn create_on(
        faults: Option<DiskFaults>,
        path: &Path,
        header: &RecordingHeader,
    ) -> Result<RecordingWriter, RecordError> {
        let file = File::create_new(path).map_err(|source| match source.kind() {
            io::ErrorKind::AlreadyExists => RecordError::Exists { path: path.to_owned() },
            _ => RecordError::Create { path: path.to_owned(), source },
        })?;
        RecordingWriter::on(RunFile::new(file, path, faults), path, header)
    }

    fn on(file: RunFile, path: &Path, header: &RecordingHeader) -> Result<RecordingWriter, RecordError> {
        let OpenedFile { mcap, step_channel, event_channel } = open(file, header).map_err(|error| {
            RecordError::Write { path: path.to_owned(), saved_until_s: None, source: io_error(error) }
        })?;
        Ok(RecordingWriter {
            path: path.to_owned(),
            mcap,
            start_time_ns: header.start_time_ns,
            second: None,
            last_sample_s: None,
            saved_until_s: None,
            failed: false,
            step_channel,
            event_channel,
            steps_written: 0,
            events_written: 0,
            layouts: Vec::new(),
            fast_channel: None,
            line: Vec::with_capacity(512),
            omit_absent: false,
            provenance: ProvenanceWriter::default(),
        })
    }

    /// Omits fields without a reading instead of writing null: for channels of several sources, each with its own times.
    pub fn omit_absent(self, omit_absent: bool) -> Self {
        RecordingWriter { omit_absent, ..self }
    }

    /// Run time up to which all samples are in the file, s; `None` before the first flush.
    pub fn saved_until_s(&self) -> Option<f64> {
        self.saved_until_s
    }

    /// Writes the samples, the truth and the events of a batch.
    ///
    /// # Errors
    /// [`RecordError::BadInput`] for columns that do not fit the batch's times, [`RecordError::Write`] for errors of
    /// the system (disk full). After an error everything up to [`saved_until_s`](Self::saved_until_s) is safe.
    pub fn write_batch(&mut self, batch: &SampleBatch) -> Result<(), RecordError> {
        self.check_batch(batch)?;
        let tables = self.group_by_topic(batch)?;
        let mut events = batch.events.iter().peekable();
        for (index, t_s) in batch.t_s.iter().enumerate() {
            while let Some(event) = events.next_if(|event| event.t_s <= *t_s) {
                self.write_event(event)?;
            }
            let log_time = self.advance(*t_s)?;
            // MCAP has 32 bits for it; at 10 Hz they last for 13 years.
            let sequence = batch.first_sequence.wrapping_add(index as u64) as u32;
            for table in &tables {
                let layout = &self.layouts[table.layout];
                let channel_id = layout.channel_id;
                self.line.clear();
                for (prefix, column) in layout.prefixes.iter().zip(&table.columns) {
                    let value = column.get(index).copied().unwrap_or(f64::NAN);
                    if self.omit_absent && !value.is_finite() {
                        continue;
                    }
                    let at = self.line.len();
                    self.line.extend_from_slice(prefix);
                    // The fields before it may have been omitted.
                    self.line[at] = if at == 0 { b'{' } else { b',' };
                    push_number(&mut self.line, value);
                }
                if self.line.is_empty() {
                    continue;
                }
                self.line.push(b'}');
                self.write_line(channel_id, sequence, log_time)?;
            }
            if let Some(message) = self.provenance.message(batch, index) {
                let channel_id = self.provenance.channel(&mut self.mcap);
                let channel_id = self.check_write(channel_id)?;
                self.write_json(channel_id, sequence, log_time, &message)?;
            }
            self.last_sample_s = Some(*t_s);
        }
        events.try_for_each(|event| self.write_event(event))?;
        for fast in &batch.fast {
            let channel_id = match self.fast_channel {
                Some(channel_id) => channel_id,
                None => {
                    let added = add_channel(&mut self.mcap, &Topic::of_fast_samples());
                    let channel_id = self.check_write(added)?;
                    self.fast_channel = Some(channel_id);
                    channel_id
                }
            };
            let log_time = self.log_time_ns(self.last_sample_s.unwrap_or(fast.first_s))?;
            let message = serde_json::to_value(fast).unwrap_or_default();
            self.write_json(channel_id, batch.first_sequence as u32, log_time, &message)?;
        }
        Ok(())
    }

    /// Writes one event.
    pub fn write_event(&mut self, event: &Event) -> Result<(), RecordError> {
        let log_time = self.advance(event.t_s)?;
        let sequence = self.events_written;
        self.events_written = sequence.wrapping_add(1);
        self.write_json(self.event_channel, sequence, log_time, &event_message(event))
    }

    /// Writes the start or the end of a step.
    pub fn write_step(&mut self, step: &StepMarker, phase: StepPhase) -> Result<(), RecordError> {
        let (t_s, message) = step_message(step, phase);
        let log_time = self.advance(t_s)?;
        let sequence = self.steps_written;
        self.steps_written = sequence.wrapping_add(1);
        self.write_json(self.step_channel, sequence, log_time, &message)
    }

    /// Writes index and summary, and hands the file to the operating system.
    ///
    /// # Errors
    /// [`RecordError::Write`] as the system reports; flushed data stay readable.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.flush()?;
        // Ends with a flush of the file.
        let finished = self.mcap.finish();
        self.check_write(finished).map(drop)
    }

    /// Flushes the chunk when the clock enters a new second. Returns `log_time`.
    fn advance(&mut self, t_s: f64) -> Result<u64, RecordError> {
        let log_time = self.log_time_ns(t_s)?;
        let second = t_s.floor() as i64;
        if self.second.is_some_and(|open| second != open) {
            self.flush()?;
        }
        self.second = Some(second);
        Ok(log_time)
    }

    /// Ends the chunk and hands it to the operating system.
    fn flush(&mut self) -> Result<(), RecordError> {
        self.refuse_after_failure()?;
        let flushed = self.mcap.flush();
        self.check_write(flushed)?;
        self.saved_until_s = self.last_sample_s;
        Ok(())
    }

    fn log_time_ns(&self, t_s: f64) -> Result<u64, RecordError> {
        // The cast saturates, and the limit of NS_PER_S s keeps sums far from the range of i128.
        let since_epoch = self.start_time_ns as i128 + (t_s * NS_PER_S).round() as i128;
        match u64::try_from(since_epoch) {
            Ok(log_time) if t_s.is_finite() => Ok(log_time),
            _ => Err(self.input_error(BatchError::Time { t_s })),
        }
    }

    fn write_json(
        &mut self,
        channel_id: u16,
        sequence: u32,
        log_time: u64,
        message: &Value,
    ) -> Result<(), RecordError> {
        self.line.clear();
        self.line.extend_from_slice(message.to_string().as_bytes());
        self.write_line(channel_id, sequence, log_time)
    }

    fn write_line(&mut self, channel_id: u16, sequence: u32, log_time: u64) -> Result<(), RecordError> {
        self.refuse_after_failure()?;
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        let written = self.mcap.write_to_known_channel(&header, &self.line);
        self.check_write(written)
    }

    fn check_write<T>(&mut self, result: McapResult<T>) -> Result<T, RecordError> {
        result.map_err(|error| {
            self.failed = true;
            RecordError::Write {
                path: self.path.clone(),
                saved_until_s: self.saved_until_s,
                source: io_error(error),
            }
        })
    }

    fn refuse_after_failure(&self) -> Result<(), RecordError> {
        if !self.failed {
            return Ok(());
        }
        Err(RecordError::Write {
            path: self.path.clone(),
            saved_until_s: self.saved_until_s,
            source: io::Error::other("an earlier write failed"),
        })
    }

    fn input_error(&self, source: BatchError) -> RecordError {
        RecordError::BadInput { path: self.path.clone(), source }
    }

    fn check_batch(&self, batch: &SampleBatch) -> Result<(), RecordError> {
        let samples = batch.t_s.len();
        let columns = batch.columns.iter().map(|column| (column.channel.symbol(), column.values.len()));
        let truth = batch.truth.iter().map(|column| (column.name.as_str(), column.values.len()));
        for (name, length) in columns.chain(truth) {
            if length != samples {
                return Err(self.input_error(BatchError::Length { name: name.to_owned(), length, samples }));
            }
        }
        for (index, column) in batch.elements.iter().enumerate() {
            let (name, length) = (column.element.to_string(), column.values.len());
            if length != samples {
                return Err(self.input_error(BatchError::Length { name, length, samples }));
            }
            if batch.elements[..index].iter().any(|earlier| earlier.element == column.element) {
                return Err(self.input_error(BatchError::Twice { name }));
            }
        }
        for (index, column) in batch.columns.iter().enumerate() {
            if batch.columns[..index].iter().any(|earlier| earlier.channel == column.channel) {
                return Err(self.input_error(BatchError::Twice { name: column.channel.to_string() }));
            }
        }
        for (index, column) in batch.truth.iter().enumerate() {
            if batch.truth[..index].iter().any(|earlier| earlier.name == column.name) {
                return Err(self.input_error(BatchError::Twice { name: column.name.clone() }));
            }
        }
        Ok(())
    }

    fn group_by_topic<'a>(&mut self, batch: &'a SampleBatch) -> Result<Vec<Table<'a>>, RecordError> {
        let mut tables = Vec::with_capacity(Group::ALL.len() + 2);
        if batch.t_s.is_empty() {
            return Ok(tables);
        }
        for group in Group::ALL {
            let mut members: Vec<_> =
                batch.columns.iter().filter(|column| column.channel.info().group == group).collect();
            members.sort_by_key(|column| column.channel);
            let fields: Vec<Field<'_>> =
                members.iter().map(|column| Field::of_channel(Channel::info(column.channel))).collect();
            let columns = members.iter().map(|column| column.values.as_slice()).collect();
            tables.extend(self.table(group.topic(), &fields, columns)?);
        }
        tables.extend(self.elements(batch)?);
        let fields: Vec<Field<'_>> = batch
            .truth
            .iter()
            .map(|column| Field {
                name: &column.name,
                title: &column.name,
                description: "known to the simulator alone",
                unit: &column.unit,
            })
            .collect();
        let columns = batch.truth.iter().map(|column| column.values.as_slice()).collect();
        tables.extend(self.table(TRUTH_TOPIC, &fields, columns)?);
        Ok(tables)
    }

    /// The topic of single sensors; `None` for a rig that has one for each channel.
    fn elements<'a>(&mut self, batch: &'a SampleBatch) -> Result<Option<Table<'a>>, RecordError> {
        let mut members: Vec<_> = batch.elements.iter().collect();
        members.sort_by_key(|column| column.element);
        let names: Vec<(String, String)> =
            members.iter().map(|column| (column.element.field(), column.element.to_string())).collect();
        let mut fields = Vec::with_capacity(members.len());
        for ((name, title), column) in names.iter().zip(&members) {
            let row = Channel::info(column.element.channel);
            fields.push(Field { name, title, description: row.description, unit: row.dimension.unit() });
        }
        let columns = members.iter().map(|column| column.values.as_slice()).collect();
        self.table(ELEMENTS_TOPIC, &fields, columns)
    }

    fn table<'a>(
        &mut self,
        topic: &'static str,
        fields: &[Field<'_>],
        columns: Vec<&'a [f64]>,
    ) -> Result<Option<Table<'a>>, RecordError> {
        if fields.is_empty() {
            return Ok(None);
        }
        let same =
            |(known, field): (&(String, String), &Field<'_>)| known.0 == field.name && known.1 == field.unit;
        let known = self.layouts.iter().position(|layout| {
            layout.topic == topic
                && layout.fields.len() == fields.len()
                && layout.fields.iter().zip(fields).all(same)
        });
        let layout = match known {
            Some(layout) => layout,
            None => self.add_layout(topic, fields)?,
        };
        Ok(Some(Table { layout, columns }))
    }

    /// Defines a topic in the file; one whose fields change over the run gets a second definition.
    fn add_layout(&mut self, topic: &'static str, fields: &[Field<'_>]) -> Result<usize, RecordError> {
        self.refuse_after_failure()?;
        let added = add_channel(&mut self.mcap, &Topic::of_fields(topic, fields));
        let channel_id = self.check_write(added)?;
        let prefixes = fields
            .iter()
            .enumerate()
            .map(|(index, field)| {
                let opening = if index == 0 { '{' } else { ',' };
                format!("{opening}{}:", json!(field.name)).into_bytes()
            })
            .collect();
        let fields = fields.iter().map(|field| (field.name.to_owned(), field.unit.to_owned())).collect();
        self.layouts.push(TopicLayout { topic, fields, channel_id, prefixes });
        Ok(self.layouts.len() - 1)
    }
}

impl std::fmt::Debug for RecordingWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RecordingWriter")
            .field("path", &self.path)
            .field("saved_until_s", &self.saved_until_s)
            .finish_non_exhaustive()
    }
}

/// The shortest text that reads back as the same number; null for values that JSON cannot represent.
fn push_number(line: &mut Vec<u8>, value: f64) {
    // Writing a number into memory cannot fail.
    if serde_json::to_writer(&mut *line, &value).is_err() {
        line.extend_from_slice(b"null");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Linux has a device that is always full.
    #[test]
    fn a_full_disk_is_reported_with_the_file_and_a_remedy() {
        let path = Path::new("run.mcap");
        let full = File::options().write(true).open("/dev/full").unwrap();
        let error = RecordingWriter::on(RunFile::new(full, path, None), path, &RecordingHeader::default())
            .unwrap_err();
        let RecordError::Write { saved_until_s: None, source, .. } = &error else { panic!("{error}") };
        assert_eq!(source.kind(), io::ErrorKind::StorageFull);
        assert!(error.to_string().contains("run.mcap") && error.to_string().contains("make room"), "{error}");
    }
}
