//! Recordings that cannot show drift give a reason and no verdict.

use mapper_core::{Channel, ChannelColumn, Recording, SampleBatch};
use mapper_recording::{
    ChannelMap, ReadOptions, RecordingHeader, RecordingWriter, StepPhase, read_recording,
};
use mapper_tests::{DriftCampaign, Finished, mapper, scratch};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Writes a recording without campaign and plan.
fn write(recording: &Recording, path: &Path) {
    let header = RecordingHeader {
        library: "another program".to_owned(),
        profile: String::new(),
        start_time_ns: 0,
        metadata: BTreeMap::new(),
        plan_json: None,
        campaign_yaml: None,
    };
    let mut writer = RecordingWriter::create(path, &header).unwrap();
    let times_s = &recording.series[&Channel::T1].t_s;
    let mut edges: Vec<f64> = recording.steps.iter().flat_map(|step| [step.start_s, step.end_s]).collect();
    // A step ends where the next one begins.
    edges.dedup();
    edges.push(f64::INFINITY);
    let mut written = 0;
    for edge_s in edges {
        let until = times_s.partition_point(|t_s| *t_s < edge_s);
        let column = |(channel, series): (&Channel, &mapper_core::Series)| ChannelColumn {
            channel: *channel,
            values: series.values[written..until].to_vec(),
        };
        let batch = SampleBatch {
            first_sequence: written as u64,
            t_s: times_s[written..until].to_vec(),
            columns: recording.series.iter().map(column).collect(),
            ..SampleBatch::default()
        };
        writer.write_batch(&batch).unwrap();
        written = until;
        for step in recording.steps.iter().filter(|step| step.end_s == edge_s) {
            writer.write_step(step, StepPhase::End).unwrap();
        }
        for step in recording.steps.iter().filter(|step| step.start_s == edge_s) {
            writer.write_step(step, StepPhase::Start).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Keeps the samples whose time is wanted, in all channels.
fn keep(recording: &mut Recording, wanted: impl Fn(f64) -> bool) {
    for series in recording.series.values_mut() {
        let kept = series.t_s.iter().zip(&series.values).filter(|(t_s, _)| wanted(**t_s));
        (series.t_s, series.values) = kept.map(|(t_s, value)| (*t_s, *value)).unzip();
    }
}

struct Case<'a> {
    name: &'a str,
    change: &'a dyn Fn(&mut Recording),
    /// Part of the expected reason.
    word: &'a str,
}

#[test]
fn recordings_without_comparable_repeats_get_a_reason_and_no_verdict() {
    let scratch = scratch();
    // Half an hour with four visits of the jump.
    let speeds = "[90 krpm, 130 krpm, 70 krpm]";
    let campaign = DriftCampaign { seed: 21, speeds, every: 4, ..DriftCampaign::default() };
    let file = campaign.write();
    let own = campaign.recording();
    let whole = read_recording(&own, &ChannelMap::native(), &ReadOptions::default()).unwrap().recording;
    let jump =
        |step: &mapper_core::StepMarker| step.from.zip(step.to).map(|(a, b)| (a.speed_rpm, b.speed_rpm));
    let repeats: Vec<usize> = whole
        .steps
        .iter()
        .filter(|step| jump(step) == Some((70e3, 130e3)) && step.valve_opening_ratio == 0.7)
        .map(|step| step.index)
        .collect();
    assert!(repeats.len() >= 4, "{repeats:?}");
    let until = |steps: usize| move |recording: &mut Recording| recording.steps.truncate(steps);
    let scaled = |channel: Channel, factor: f64| {
        move |recording: &mut Recording| {
            let series = recording.series.get_mut(&channel).unwrap();
            series.values.iter_mut().for_each(|value| *value *= factor);
        }
    };
    let cases = [
        Case {
            name: "gap",
            change: &|recording| keep(recording, |t_s| !(1000.0..1040.0).contains(&t_s)),
            word: "gap",
        },
        // Before the second visit, no jump is repeated.
        Case { name: "none", change: &until(repeats[1] - 1), word: "no repeats" },
        Case { name: "one", change: &until(repeats[1] + 1), word: "one repeat" },
        Case {
            name: "other_jumps",
            // Each visit but the first comes from somewhere else: the step before it is the visit of another point.
            change: &|recording| {
                let opening = |index: usize| 0.5 + 0.03 * index as f64;
                for index in &repeats {
                    let before = &mut recording.steps[index - 1];
                    before.valve_opening_ratio = opening(*index);
                    before.to.as_mut().unwrap().valve_opening_ratio = opening(*index);
                }
            },
            word: "different jumps",
        },
        Case {
            name: "no_t2",
            change: &|recording| {
                recording.series.remove(&Channel::T2);
            },
            word: "T2",
        },
        Case { name: "nan", change: &scaled(Channel::P2, f64::NAN), word: "P2" },
        Case { name: "kpa", change: &scaled(Channel::P2, 1e-3), word: "P2" },
        Case {
            name: "celsius",
            change: &|recording| {
                let series = recording.series.get_mut(&Channel::T1).unwrap();
                series.values.iter_mut().for_each(|value| *value -= 273.15);
            },
            word: "T1",
        },
        Case { name: "no_steps", change: &until(0), word: "" },
    ];
    for case in cases {
        let mut changed = whole.clone();
        (case.change)(&mut changed);
        let path = scratch.path().join(format!("{}.mcap", case.name));
        write(&changed, &path);
        let reason = reason(&path, &file.path);
        assert!(reason.contains(case.word), "{}: {reason}", case.name);
    }
    // The unchanged recording has a verdict.
    let path = scratch.path().join("whole.mcap");
    write(&whole, &path);
    let report = ask(&path, &file.path).exits(0).json();
    assert_eq!(report["verdict"], "none", "{}", report["reason"]);
}

fn ask(recording: &Path, campaign: &Path) -> Finished {
    let arguments: [PathBuf; 4] =
        ["drift".into(), recording.to_owned(), "--campaign".into(), campaign.to_owned()];
    mapper(arguments.iter().map(PathBuf::as_path).chain([Path::new("--json")]))
}

/// The explanation of a missing verdict: as `reason`, or as the error that ends the command.
fn reason(recording: &Path, campaign: &Path) -> String {
    let finished = ask(recording, campaign);
    if finished.code == Some(0) {
        let report = finished.json();
        assert_eq!(report["verdict"], "unclear", "{report}");
        assert!(
            report["drifts"].as_array().unwrap().is_empty()
                && report["corrected_points"].as_array().unwrap().is_empty()
        );
        let reason = report["reason"].as_str().unwrap();
        assert!(reason.starts_with("No verdict"), "{reason}");
        return reason.to_owned();
    }
    // A recording that cannot be read or followed: the code of bad recordings, one sentence, no panic.
    assert_eq!(finished.code, Some(6), "{}", finished.stderr);
    assert!(!finished.stderr.contains("panicked"), "{}", finished.stderr);
    finished.stderr
}
