//! What is written is what is read.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::common::{batch, header, part, step, write};
use mapper_core::{
    CHANNELS, Channel, ChannelColumn, Element, ElementColumn, MAX_ELEMENTS, Provenance, Quality,
    ReadingOrigin, SampleBatch, TruthColumn,
};
use mapper_recording::{
    ChannelMap, FormatVersion, ReadOptions, ReadReport, ReadWarning, RecordError, RecordingWriter, StepPhase,
    read_recording, score::read_truth,
};
use proptest::prelude::*;
use std::path::Path;

fn read(path: &Path) -> ReadReport {
    read_recording(path, &ChannelMap::native(), &ReadOptions::default()).unwrap()
}

#[test]
fn a_run_reads_back_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let (batch, steps) = (batch(35), [step(0, 0.0, 1.7), step(1, 1.7, 3.4)]);
    write(&path, &batch, &steps);
    let report = read(&path);
    assert_eq!(report.warnings, []);
    assert_eq!(report.recording.steps, steps);
    assert_eq!(report.recording.events, batch.events);
    assert_eq!(report.format, Some(FormatVersion::CURRENT));
    assert_eq!(
        (
            report.metadata,
            report.start_time_ns,
            report.plan_json,
            report.campaign_text.map(String::into_bytes)
        ),
        (header().metadata, header().start_time_ns, header().plan_json, header().campaign_yaml)
    );
    for column in &batch.columns {
        let series = &report.recording.series[&column.channel];
        assert_eq!((&series.t_s, &series.values), (&batch.t_s, &column.values), "{}", column.channel);
    }
    let truth = read_truth(&path).unwrap();
    assert_eq!((truth.t_s, truth.columns), (batch.t_s, batch.truth));
}

/// Quality and source time are kept if they are not as usual, a bad reading is none, and a run without any has no such topic.
#[test]
fn the_provenance_of_readings_is_kept_with_them() {
    let folder = tempfile::tempdir().unwrap();
    let (plain, marked) = (folder.path().join("plain.mcap"), folder.path().join("marked.mcap"));
    let whole = batch(35);
    write(&plain, &whole, &[]);
    let usual =
        Provenance { channel: Channel::T1, source_t_s: whole.t_s.clone(), quality: vec![Quality::Good; 35] };
    let mut source_t_s = whole.t_s.clone();
    let mut quality = vec![Quality::Good; 35];
    (source_t_s[3], quality[5], quality[7]) = (source_t_s[3] - 0.04, Quality::Bad, Quality::Uncertain);
    let unusual = Provenance { channel: Channel::T2, source_t_s, quality };
    write(&marked, &SampleBatch { provenance: vec![usual.clone(), unusual], ..whole.clone() }, &[]);
    let same = folder.path().join("same.mcap");
    write(&same, &SampleBatch { provenance: vec![usual], ..whole.clone() }, &[]);
    assert_eq!(
        std::fs::read(&same).unwrap(),
        std::fs::read(&plain).unwrap(),
        "what is as usual is not written"
    );
    let (plain, marked) = (read(&plain), read(&marked));
    assert!(plain.recording.origins.is_empty());
    assert_eq!(marked.warnings, [ReadWarning::BadReadings { channel: Channel::T2, count: 1 }]);
    let origins = &marked.recording.origins;
    assert_eq!(origins.keys().collect::<Vec<_>>(), [&Channel::T2]);
    let of = |index: usize, source_t_s, quality| ReadingOrigin { t_s: whole.t_s[index], source_t_s, quality };
    let expected = [
        of(3, Some(whole.t_s[3] - 0.04), Quality::Good),
        of(5, None, Quality::Bad),
        of(7, None, Quality::Uncertain),
    ];
    assert_eq!(origins[&Channel::T2], expected);
    let (before, after) = (&plain.recording.series[&Channel::T2], &marked.recording.series[&Channel::T2]);
    assert!(after.values[5].is_nan());
    let others = |values: &[f64]| [&values[..5], &values[6..]].concat();
    assert_eq!(others(&before.values), others(&after.values));
}

/// Of several sources each has its own times: what is absent is not there, and a topic without any reading has no message.
#[test]
fn absent_readings_are_left_out_where_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut whole = SampleBatch { truth: Vec::new(), elements: Vec::new(), ..batch(35) };
    for column in &mut whole.columns {
        let every = if column.channel == Channel::TAmb { 5 } else { 1 };
        let sparse = |(index, value): (usize, &mut f64)| {
            if index % every != 0 {
                *value = f64::NAN;
            }
        };
        column.values.iter_mut().enumerate().for_each(sparse);
    }
    let mut writer = RecordingWriter::create(&path, &header()).unwrap().omit_absent(true);
    writer.write_batch(&whole).unwrap();
    writer.finish().unwrap();
    let report = read(&path);
    assert_eq!(report.warnings, []);
    for column in &whole.columns {
        let finite = whole.t_s.iter().zip(&column.values).filter(|(_, value)| value.is_finite());
        let (t_s, values): (Vec<f64>, Vec<f64>) = finite.unzip();
        let series = &report.recording.series[&column.channel];
        assert_eq!((&series.t_s, &series.values), (&t_s, &values), "{}", column.channel);
    }
}

#[test]
fn without_truth_a_recording_reads_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (with, without) = (folder.path().join("with.mcap"), folder.path().join("without.mcap"));
    write(&with, &batch(35), &[]);
    write(&without, &SampleBatch { truth: Vec::new(), ..batch(35) }, &[]);
    assert_eq!(read(&with), read(&without));
    assert_eq!(read_truth(&without).unwrap().columns, []);
}

#[test]
fn equal_runs_give_equal_bytes_however_they_are_cut_into_batches() {
    let folder = tempfile::tempdir().unwrap();
    let batch = SampleBatch { events: Vec::new(), ..batch(60) };
    let whole = folder.path().join("whole.mcap");
    write(&whole, &batch, &[]);
    for size in [1, 7, 10, 25] {
        let path = folder.path().join(format!("{size}.mcap"));
        let mut writer = RecordingWriter::create(&path, &header()).unwrap();
        for start in (0..60).step_by(size) {
            writer.write_batch(&part(&batch, start..(start + size).min(60))).unwrap();
        }
        writer.finish().unwrap();
        assert!(std::fs::read(&path).unwrap() == std::fs::read(&whole).unwrap(), "batches of {size}");
    }
}

#[test]
fn a_recording_is_never_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    std::fs::write(&path, "precious").unwrap();
    let error = RecordingWriter::create(&path, &header()).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
}

#[test]
fn what_was_flushed_is_readable_while_the_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = RecordingWriter::create(&path, &header()).unwrap();
    writer.write_step(&step(0, 0.0, 9.0), StepPhase::Start).unwrap();
    writer.write_batch(&batch(57)).unwrap();
    assert_eq!(writer.saved_until_s(), Some(4.9));
    // A copy of the file now is what a killed process leaves.
    let killed = folder.path().join("killed.mcap");
    std::fs::copy(&path, &killed).unwrap();
    let report = read(&killed);
    let series = &report.recording.series[&CHANNELS[0].channel];
    assert_eq!(series.t_s.last(), Some(&4.9));
    assert_eq!(series.values, batch(50).columns[0].values);
    assert_eq!(report.recording.steps[0].end_s, 4.9);
    assert!(report.warnings.iter().any(|w| matches!(w, ReadWarning::Truncated { .. })));
    assert!(report.warnings.contains(&ReadWarning::UnfinishedStep { index: 0, end_s: 4.9 }));
}

#[test]
fn columns_that_do_not_fit_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = RecordingWriter::create(&folder.path().join("run.mcap"), &header()).unwrap();
    let mut short = batch(3);
    short.columns[2].values.pop();
    let mut twice = batch(3);
    twice.columns.push(twice.columns[0].clone());
    let mut timeless = batch(3);
    timeless.t_s[1] = f64::NAN;
    for wrong in [short, twice, timeless] {
        let error = writer.write_batch(&wrong).unwrap_err();
        assert!(matches!(error, RecordError::BadInput { .. }), "{error}");
    }
}

#[test]
fn a_dropped_writer_finishes_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut writer = RecordingWriter::create(&path, &header()).unwrap();
    writer.write_batch(&batch(5)).unwrap();
    drop(writer);
    assert_eq!(read(&path).warnings, []);
}

fn values(samples: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(any::<f64>(), samples)
}

prop_compose! {
    fn any_batch()(samples in 1usize..40)(
        steps_ms in prop::collection::vec(1u32..3000, samples),
        picked in prop::sample::subsequence((0..CHANNELS.len()).collect::<Vec<_>>(), 1..=CHANNELS.len()),
        columns in prop::collection::vec(values(samples), CHANNELS.len()),
        several in prop::sample::subsequence((1..=MAX_ELEMENTS).collect::<Vec<_>>(), 0..=4),
        readings in prop::collection::vec(values(samples), 4),
        truth in values(samples),
    ) -> SampleBatch {
        let mut t_ms = 0;
        SampleBatch {
            first_sequence: 5,
            t_s: steps_ms.iter().map(|step_ms| { t_ms += step_ms; f64::from(t_ms) / 1e3 }).collect(),
            columns: picked.iter().zip(columns).map(|(c, values)| ChannelColumn { channel: CHANNELS[*c].channel, values }).collect(),
            elements: several.iter().zip(&readings).map(|(number, values)| ElementColumn { element: Element { channel: Channel::T2, number: *number }, values: values.clone() }).collect(),
            truth: vec![TruthColumn { name: "a \"quoted\" name".to_owned(), unit: "K".to_owned(), values: truth }],
            ..SampleBatch::default()
        }
    }
}

fn same(a: &[f64], b: &[f64]) -> bool {
    // What is not finite has no place in JSON and reads back as NaN.
    let bits = |x: &f64| if x.is_finite() { x.to_bits() } else { f64::NAN.to_bits() };
    a.iter().map(bits).eq(b.iter().map(bits))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_batch_reads_back_to_the_bit(batch in any_batch()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        write(&path, &batch, &[]);
        let report = read(&path);
        prop_assert_eq!(&report.warnings, &[]);
        // A channel of which only single sensors were recorded is read from them.
        let from_elements = !batch.elements.is_empty() && batch.column(Channel::T2).is_none();
        prop_assert_eq!(report.recording.series.len(), batch.columns.len() + usize::from(from_elements));
        for column in &batch.columns {
            let series = &report.recording.series[&column.channel];
            prop_assert_eq!(&series.t_s, &batch.t_s);
            prop_assert!(same(&series.values, &column.values));
        }
        prop_assert_eq!(report.recording.elements.len(), batch.elements.len());
        for column in &batch.elements {
            let series = &report.recording.elements[&column.element];
            prop_assert_eq!(&series.t_s, &batch.t_s);
            prop_assert!(same(&series.values, &column.values));
        }
        let truth = read_truth(&path).unwrap();
        prop_assert!(same(&truth.columns[0].values, &batch.truth[0].values));
    }
}

/// A recording at 100 Hz is read with ten samples a second, a ramp as the same ramp, and whole on request.
#[test]
fn a_fast_recording_is_averaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut fast = batch(6000);
    fast.t_s = (0..6000).map(|i| f64::from(i) / 100.0).collect();
    write(&path, &fast, &[step(0, 0.0, 60.0)]);
    let report = read(&path);
    assert_eq!(report.warnings, [ReadWarning::Averaged]);
    for (column, series) in fast.columns.iter().zip(report.recording.series.values()) {
        // The rows that show the rate are as they were.
        assert!((600..670).contains(&series.t_s.len()), "{}", series.t_s.len());
        assert!(series.t_s.is_sorted_by(|a, b| a < b));
        let slope = (column.values[5999] - column.values[0]) / (fast.t_s[5999] - fast.t_s[0]);
        for (t_s, value) in series.t_s.iter().zip(&series.values) {
            assert!((value - column.values[0] - slope * t_s).abs() < 1e-6, "{t_s} {value}");
        }
    }
    let options = ReadOptions { averages: false, ..ReadOptions::default() };
    let whole = read_recording(&path, &ChannelMap::native(), &options).unwrap();
    assert_eq!(whole.warnings, []);
    assert!(whole.recording.series.values().all(|series| series.t_s == fast.t_s));
}
