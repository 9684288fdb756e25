//! A recording or log as a table or as a recording of this program: its channels under their symbols, in SI, with the channel map applied.

use crate::recording::files::{Existing, PROGRAM, write_file};
use crate::recording::run_directory;
use crate::{Registry, SessionError};
use mapper_core::{
    ChannelColumn, Element, ElementColumn, Recording, SampleBatch, Series, StepMarker, step_number,
};
use mapper_recording::logs::{SampleColumn, SampleTable};
use mapper_recording::{
    ChannelMap, ReadOptions, ReadReport, RecordingHeader, RecordingWriter, StepPhase, read_recording,
};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Extension of a recording of this program.
const RECORDING: &str = "mcap";
/// Longest piece of a recording that is written at once, s. Bound: memory.
const PIECE_S: f64 = 60.0;

/// A converted recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Converted {
    /// The new file.
    pub file: PathBuf,
    /// Its channels, by symbol.
    pub channels: Vec<String>,
    /// Number of times at which at least one channel has a sample.
    pub rows: usize,
    /// Number of steps: as recorded, or as found from the commands.
    pub steps: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Problems of the source.
    pub warnings: Vec<String>,
}

/// Reads a recording, a run or a log through a channel map, and writes it to `out`, whose extension gives the format.
pub fn convert_recording(
    registry: &Registry,
    source: &Path,
    map: &ChannelMap,
    (out, existing): (&Path, Existing),
) -> Result<Converted, SessionError> {
    let extension = out.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    let extension = extension.unwrap_or_default();
    let writer = registry.logs.writer(&extension);
    if writer.is_none() && extension != RECORDING {
        let known = registry.logs.extensions().chain([RECORDING]).collect();
        return Err(SessionError::UnknownSampleFormat { path: out.to_owned(), known });
    }
    existing.check(out)?;
    let file = run_directory::recording_of(source);
    // A conversion keeps every sample, also those that identification averages.
    let options = ReadOptions { logs: registry.logs, averages: false, ..ReadOptions::default() };
    let read = read_recording(&file, map, &options)?;
    let recording = &read.recording;
    let times_s = times_s(recording);
    match writer {
        Some(write) => {
            let bytes = write(&table(recording, &times_s)).map_err(SessionError::file("write", out))?;
            write_file(out, &bytes, existing)?;
        }
        None => write_recording(&read, (source, &times_s), (out, existing))?,
    }
    let symbols = recording.series.keys().map(|channel| channel.symbol().to_owned());
    Ok(Converted {
        file: out.to_owned(),
        channels: symbols.chain(recording.elements.keys().map(Element::to_string)).collect(),
        rows: times_s.len(),
        steps: recording.steps.len(),
        duration_s: times_s.last().zip(times_s.first()).map_or(0.0, |(last, first)| last - first),
        warnings: read.warnings.iter().map(ToString::to_string).collect(),
    })
}

fn times_s(recording: &Recording) -> Vec<f64> {
    let all = recording.series.values().chain(recording.elements.values());
    let mut times_s: Vec<f64> = all.flat_map(|series| series.t_s.iter().copied()).collect();
    times_s.sort_by(f64::total_cmp);
    times_s.dedup();
    times_s
}

/// The values of a series at the given times, NaN where it has none.
fn values_at(series: &Series, times_s: &[f64]) -> Vec<f64> {
    let mut next = times_s.first().map_or(0, |first| series.t_s.partition_point(|t_s| t_s < first));
    times_s
        .iter()
        .map(|t_s| {
            let value = series.t_s.get(next).filter(|own_s| *own_s == t_s).and(series.values.get(next));
            next += usize::from(value.is_some());
            value.copied().unwrap_or(f64::NAN)
        })
        .collect()
}

fn table(recording: &Recording, times_s: &[f64]) -> SampleTable {
    let column = |name: String, unit: &str, series: &Series| SampleColumn {
        name,
        unit: unit.to_owned(),
        values: values_at(series, times_s),
    };
    let channels = recording
        .series
        .iter()
        .map(|(channel, series)| column(channel.symbol().to_owned(), channel.unit(), series));
    let elements = recording
        .elements
        .iter()
        .map(|(element, series)| column(element.to_string(), element.channel.unit(), series));
    let mut columns: Vec<SampleColumn> = channels.chain(elements).collect();
    if !recording.steps.is_empty() {
        let step_at = |t_s: &f64| {
            let within = |step: &&StepMarker| (step.start_s..=step.end_s).contains(t_s);
            recording.steps.iter().find(within).map_or(f64::NAN, |step| step_number(step.index) as f64)
        };
        let values = times_s.iter().map(step_at).collect();
        columns.push(SampleColumn { name: "step".to_owned(), unit: String::new(), values });
    }
    SampleTable { times_s: times_s.to_vec(), columns }
}

fn write_recording(
    read: &ReadReport,
    (source, times_s): (&Path, &[f64]),
    (out, existing): (&Path, Existing),
) -> Result<(), SessionError> {
    if existing == Existing::Replaced && out.exists() {
        std::fs::remove_file(out).map_err(SessionError::file("write", out))?;
    }
    let header = RecordingHeader {
        library: PROGRAM.to_owned(),
        start_time_ns: read.start_time_ns,
        metadata: BTreeMap::from([("converted_from".to_owned(), source.display().to_string())]),
        ..RecordingHeader::default()
    };
    let recording = &read.recording;
    let mut writer = RecordingWriter::create(out, &header)?.omit_absent(true);
    let mut marks: Vec<(f64, &StepMarker, StepPhase)> = Vec::new();
    for step in &recording.steps {
        marks.extend([(step.start_s, step, StepPhase::Start), (step.end_s, step, StepPhase::End)]);
    }
    // A step that ends where the next one starts ends first.
    marks.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.2 == StepPhase::Start).cmp(&(b.2 == StepPhase::Start))));
    let mut from = 0;
    let mut piece = |writer: &mut RecordingWriter, until_s: f64| -> Result<(), SessionError> {
        while from < times_s.len() && times_s[from] < until_s {
            let limit_s = until_s.min(times_s[from] + PIECE_S);
            let to = from + times_s[from..].partition_point(|t_s| *t_s < limit_s);
            let to = to.max(from + 1);
            writer.write_batch(&batch(recording, &times_s[from..to], from))?;
            from = to;
        }
        Ok(())
    };
    for (t_s, step, phase) in marks {
        piece(&mut writer, t_s)?;
        writer.write_step(step, phase)?;
    }
    piece(&mut writer, f64::INFINITY)?;
    Ok(writer.finish()?)
}

fn batch(recording: &Recording, times_s: &[f64], first: usize) -> SampleBatch {
    let columns = recording.series.iter();
    let elements = recording.elements.iter();
    SampleBatch {
        first_sequence: first as u64,
        t_s: times_s.to_vec(),
        columns: columns
            .map(|(channel, series)| ChannelColumn { channel: *channel, values: values_at(series, times_s) })
            .collect(),
        elements: elements
            .map(|(element, series)| ElementColumn { element: *element, values: values_at(series, times_s) })
            .collect(),
        events: Vec::new(),
        ..SampleBatch::default()
    }
}
