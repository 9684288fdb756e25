//! The simulator's truth, for scoring only.

use crate::format::{METADATA_NAME, START_KEY, TRUTH_TOPIC};
use crate::logs::LogFile;
use crate::mcap::message::{FieldValue, read_fields};
use crate::mcap::records::ChannelDefinition;
use crate::mcap::sink::Sink;
use crate::reading::log_reader::is_mcap;
use crate::reading::recording_reader::open;
use crate::reading::scan::scan;
use crate::samples::series_builder::run_time_s;
use crate::{ReadOptions, ReadWarning, RecordError};
use mapper_core::TruthColumn;
use std::collections::BTreeMap;
use std::path::Path;

/// The truth of a simulated run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// Run times, s, in the order of the file.
    pub t_s: Vec<f64>,
    /// Quantities in order of their names, each as long as `t_s`; NaN if a message had none.
    pub columns: Vec<TruthColumn>,
    /// Problems of the file.
    pub warnings: Vec<ReadWarning>,
}

impl Truth {
    /// The values of one quantity.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|column| column.name == name).map(|column| column.values.as_slice())
    }
}

/// Reads the truth of a recording; empty if it has none, like the log of another program.
///
/// # Errors
/// As [`read_recording`](crate::read_recording).
pub fn read_truth(path: &Path) -> Result<Truth, RecordError> {
    if !is_mcap(&LogFile::from_path(path).head(8)?) {
        return Ok(Truth::default());
    }
    let options = ReadOptions::default();
    let (sink, scanned) = scan(path, &|| open(path), &options, TruthSink::default)?;
    let rows = sink.times_ns.len();
    let zero_ns = sink.start_time_ns.or(sink.times_ns.iter().copied().min()).unwrap_or(0);
    let column = |(name, (unit, mut values)): (String, (String, Vec<f64>))| {
        values.resize(rows, f64::NAN);
        TruthColumn { name, unit, values }
    };
    Ok(Truth {
        t_s: sink.times_ns.into_iter().map(|time_ns| run_time_s(time_ns, zero_ns)).collect(),
        columns: sink.columns.into_iter().map(column).collect(),
        warnings: scanned.warnings,
    })
}

#[derive(Default)]
struct TruthSink {
    /// Names of the fields, by channel of the file.
    fields: BTreeMap<u16, Vec<String>>,
    start_time_ns: Option<u64>,
    times_ns: Vec<u64>,
    /// Unit and values by name; padded if a message had none.
    columns: BTreeMap<String, (String, Vec<f64>)>,
}

impl Sink for TruthSink {
    type SinkMessage = Vec<FieldValue>;

    fn define(&mut self, definition: &ChannelDefinition) {
        if definition.topic != TRUTH_TOPIC || definition.encoding != "json" {
            return;
        }
        self.fields.insert(definition.id, definition.metadata.keys().cloned().collect());
        for (name, unit) in &definition.metadata {
            self.columns.entry(name.clone()).or_insert_with(|| (unit.clone(), Vec::new()));
        }
    }

    fn read(&self, channel_id: u16, data: &[u8]) -> Option<Vec<FieldValue>> {
        let (fields, mut values) = (self.fields.get(&channel_id)?, Vec::new());
        read_fields(data, fields, &mut values).then_some(values)
    }

    fn take(&mut self, channel_id: u16, log_time_ns: u64, content: Vec<FieldValue>) {
        let Some(fields) = self.fields.get(&channel_id) else { return };
        let row = self.times_ns.len();
        self.times_ns.push(log_time_ns);
        for (field, value) in fields.iter().zip(&content) {
            if let (Some((_, values)), FieldValue::Number(value)) = (self.columns.get_mut(field), value) {
                values.resize(row, f64::NAN);
                values.push(*value);
            }
        }
    }

    fn metadata(&mut self, name: String, pairs: BTreeMap<String, String>) {
        if name == METADATA_NAME && self.start_time_ns.is_none() {
            self.start_time_ns = pairs.get(START_KEY).and_then(|text| text.parse().ok());
        }
    }

    fn attachment(&mut self, _name: String, _data: &[u8]) {}

    fn value_count(&self) -> u64 {
        // Columns must finally be as long as the times.
        let width = u64::try_from(self.columns.len()).unwrap_or(u64::MAX).saturating_add(1);
        u64::try_from(self.times_ns.len()).unwrap_or(u64::MAX).saturating_mul(width)
    }
}
