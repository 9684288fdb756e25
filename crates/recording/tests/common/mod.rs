//! Made-up runs.

use mapper_core::{
    CHANNELS, ChannelColumn, Event, EventKind, OperatingPoint, SampleBatch, StepKind, StepMarker, TruthColumn,
};
use mapper_recording::{RecordingHeader, RecordingWriter, StepPhase};
use std::collections::BTreeMap;
use std::path::Path;

/// A run header with everything filled in.
pub fn header() -> RecordingHeader {
    RecordingHeader {
        library: "mapper test".to_owned(),
        profile: String::new(),
        start_time_ns: 1_790_000_000_000_000_000,
        metadata: BTreeMap::from([("campaign".to_owned(), "turbo_a".to_owned())]),
        plan_json: Some(b"{\"steps\": []}".to_vec()),
        campaign_yaml: Some(b"name: turbo_a\n".to_vec()),
    }
}

/// All samples of a run of `samples` at 10 Hz, every channel, in one batch.
pub fn batch(samples: usize) -> SampleBatch {
    let column = |c: usize| (0..samples).map(|i| 300.0 + (i * (c + 1)) as f64 / 7.0).collect::<Vec<f64>>();
    SampleBatch {
        first_sequence: 0,
        t_s: (0..samples).map(|i| i as f64 / 10.0).collect(),
        columns: (0..CHANNELS.len())
            .map(|c| ChannelColumn { channel: CHANNELS[c].channel, values: column(c) })
            .collect(),
        truth: vec![TruthColumn { name: "eta".to_owned(), unit: "1".to_owned(), values: column(30) }],
        events: vec![Event { t_s: 0.15, kind: EventKind::Note, message: "valve is 2 % off".to_owned() }],
        ..SampleBatch::default()
    }
}

/// A part of a batch.
pub fn part(batch: &SampleBatch, rows: std::ops::Range<usize>) -> SampleBatch {
    let mut part = batch.clone();
    part.first_sequence += rows.start as u64;
    part.t_s = batch.t_s[rows.clone()].to_vec();
    for (to, from) in part.columns.iter_mut().zip(&batch.columns) {
        to.values = from.values[rows.clone()].to_vec();
    }
    for (to, from) in part.elements.iter_mut().zip(&batch.elements) {
        to.values = from.values[rows.clone()].to_vec();
    }
    for (to, from) in part.truth.iter_mut().zip(&batch.truth) {
        to.values = from.values[rows.clone()].to_vec();
    }
    part.events.clear();
    part
}

/// A step at these times.
pub fn step(index: usize, start_s: f64, end_s: f64) -> StepMarker {
    let point = |speed_rpm| OperatingPoint { speed_rpm, valve_opening_ratio: 0.7 };
    StepMarker {
        index,
        kind: if index == 0 { StepKind::Point } else { StepKind::Repeat },
        start_s,
        end_s,
        from: (index > 0).then(|| point(90_000.1)),
        to: Some(point(110_000.3)),
        p3_pa: 145_882.123_456_789,
        valve_opening_ratio: 0.7,
    }
}

/// Writes a whole run.
pub fn write(path: &Path, batch: &SampleBatch, steps: &[StepMarker]) {
    let mut writer = RecordingWriter::create(path, &header()).unwrap();
    let mut row = 0;
    for step in steps {
        writer.write_step(step, StepPhase::Start).unwrap();
        let end = batch.t_s.partition_point(|t| *t < step.end_s);
        writer.write_batch(&with_events(part(batch, row..end), batch, row)).unwrap();
        writer.write_step(step, StepPhase::End).unwrap();
        row = end;
    }
    writer.write_batch(&with_events(part(batch, row..batch.t_s.len()), batch, row)).unwrap();
    writer.finish().unwrap();
}

/// The events of a run come with its first samples.
fn with_events(part: SampleBatch, batch: &SampleBatch, row: usize) -> SampleBatch {
    if row == 0 { SampleBatch { events: batch.events.clone(), ..part } } else { part }
}
