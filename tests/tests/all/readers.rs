//! Channels from several sources: the lab is controlled, and auxiliary instruments are read.
#![cfg(unix)]

use mapper_core::{Channel, EventKind, Quality};
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, read_recording};
use mapper_tests::{
    CampaignFile, Finished, SHORT_GRID, SINGLE_STEP_METHOD, build_driver, mapper, mapper_command, only_run,
    python, shared_run,
};
use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;

fn with_readers(readers: &str, more: &[(&str, &str)]) -> CampaignFile {
    let backend = format!("  virtual_lab: {{}}\nreaders:\n{readers}");
    let own = [("  virtual_lab: {}\n", backend.as_str())];
    let all: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).chain(more).chain(&own).copied().collect();
    CampaignFile::shipped_with(&all)
}

fn run(campaign: &CampaignFile) -> Finished {
    let runs = campaign.runs();
    let arguments = ["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), runs.as_os_str()];
    let mut command = mapper_command(arguments);
    command.env("MAPPER_STATE_DIR", campaign.directory().join("states"));
    command.output().unwrap().into()
}

fn read(run: &Path) -> ReadReport {
    read_recording(&run.join("recording.mcap"), &ChannelMap::native(), &ReadOptions::default()).unwrap()
}

/// T2 comes from a recording that is played along with the lab: its samples to the bit, in the lab's own steps, and all of it is identified.
#[test]
fn a_channel_of_an_instrument_is_in_the_recording_and_the_points() {
    let first = with_readers("  none: {backend: {replay: {}}}\n", &[]);
    // Without the reader, on another seed.
    let plain = CampaignFile::shipped_with(
        &SHORT_GRID
            .iter()
            .chain(SINGLE_STEP_METHOD)
            .chain(&[("seed: 1 ", "seed: 9 ")])
            .copied()
            .collect::<Vec<_>>(),
    );
    run(&plain).exits(0);
    let played = only_run(&plain.runs());
    let wrong = run(&first).exits(3);
    assert!(wrong.stderr.contains("readers") && wrong.stderr.contains('^'), "{}", wrong.stderr);
    let reader = format!(
        "  bench: {{backend: {{replay: {{recording: {}}}}}, channels: [T2]}}\n",
        played.join("recording.mcap").display()
    );
    let campaign = with_readers(&reader, &[]);
    run(&campaign).exits(0);
    let (own, other) = (read(&only_run(&campaign.runs())), read(&played));
    let of = |report: &ReadReport, channel: Channel| report.recording.series[&channel].clone();
    let (t2, bench) = (of(&own, Channel::T2), of(&other, Channel::T2));
    let length = t2.values.len().min(bench.values.len());
    assert!(length > 1000);
    assert_eq!(t2.values[..length], bench.values[..length]);
    assert_ne!(of(&own, Channel::P2).values[..length], of(&other, Channel::P2).values[..length]);
    assert_eq!(own.metadata["readers"], "bench");
    let points = std::fs::read_to_string(only_run(&campaign.runs()).join("points.json")).unwrap();
    let points: serde_json::Value = serde_json::from_str(&points).unwrap();
    assert!(
        points["points"].as_array().unwrap().iter().filter(|point| point["eta"].is_number()).count() >= 3
    );
}

/// Each mistake is reported with its position before the rig is touched.
#[test]
fn mistakes_in_readers_are_reported_with_their_lines() {
    let other =
        CampaignFile::shipped_with(&SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect::<Vec<_>>());
    let recording = shared_run(&other).run.join("recording.mcap");
    let replay = format!("{{replay: {{recording: {}}}}}", recording.display());
    for (readers, words) in [
        ("  bench: {backend: {virtual_lab: {}}, channels: [T2]}\n".to_owned(), "is only read"),
        (format!("  bench: {{backend: {replay}}}\n"), "also comes from the rig"),
        (format!("  bench: {{backend: {replay}, channels: [T9]}}\n"), "no channel is called `T9`"),
        (
            format!(
                "  a: {{backend: {replay}, channels: [T2]}}\n  b: {{backend: {replay}, channels: [T2]}}\n"
            ),
            "already taken from `a`",
        ),
        (format!("  bench: {{backend: {replay}, channel: [T2]}}\n"), "channels"),
        ("  be nch: {backend: {replay: {}}}\n".to_owned(), "cannot be the name of a reader"),
    ] {
        let campaign = with_readers(&readers, &[]);
        let finished = mapper(["check".as_ref(), campaign.path.as_os_str()]).exits(3);
        assert!(finished.mentions(words) && finished.stderr.contains('^'), "{readers}: {}", finished.stderr);
        assert!(!campaign.runs().exists());
    }
}

/// An instrument that answers so many questions, then nothing more.
fn instrument(answers: usize) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let mut left = answers;
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut bytes = [0; 64];
            while left > 0 && matches!(stream.read(&mut bytes), Ok(1..)) {
                left -= 1;
                let celsius = 25.0 + 0.001 * (answers - left) as f64;
                if write!(stream, "\x02 AKON 0 {celsius:.3}\x03").is_err() {
                    break;
                }
            }
        }
    });
    address
}

/// The driver of an instrument as it ships, along with the lab in real time: its readings have their own rate and arrive in the recording. One
/// that falls silent is noted where nothing needs it, and ends the run where it does.
#[test]
fn an_instrument_is_read_together_with_the_lab_in_real_time() {
    build_driver("mapper-backend-ak");
    let short = [
        ("warm_up: 60 s ", "warm_up: 1 s "),
        // P3 and valve need 2.1 s.
        ("dwell: 120 s ", "dwell: 6 s "),
        ("window: auto ", "window: {start: 3 s, end: 6 s} "),
    ];
    let reader = |channel: &str, answers: usize| {
        format!(
            "  cell:\n    channels: [{channel}]\n    backend:\n      ak: {{address: \"{}\", rate: 5 Hz, timeout: 100 ms, read: {{{channel}: \
             {{code: AKON, value: 1, offset: 273.15}}}}}}\n",
            instrument(answers)
        )
    };
    let campaign = with_readers(&reader("T_amb", 60), &short);
    let finished = run(&campaign);
    assert!(matches!(finished.code, Some(0 | 6)), "{}", finished.stderr);
    let report = read(&only_run(&campaign.runs()));
    let (air, t2) = (&report.recording.series[&Channel::TAmb], &report.recording.series[&Channel::T2]);
    // 10 Hz of the lab and 5 Hz of the instrument, of which 60 answers came at most.
    assert!(
        (20..=60).contains(&air.values.len()) && t2.values.len() > 150,
        "{} {}",
        air.values.len(),
        t2.values.len()
    );
    assert!(air.values.iter().all(|kelvin| (298.0..298.3).contains(kelvin)), "{:?}", air.values);
    let noted = |event: &&mapper_core::Event| {
        event.kind == EventKind::GuardActed && event.message.contains("`cell` has given no T_amb")
    };
    assert_eq!(report.recording.events.iter().filter(noted).count(), 1, "{:?}", report.recording.events);
    assert!(report.recording.origins.values().flatten().all(|origin| origin.quality == Quality::Good));
    // What others find in it.
    if cfg!(with_python) {
        let seen = python("read_recording.py", [&only_run(&campaign.runs()).join("recording.mcap")]);
        assert_eq!(seen["topics"]["/rig/ambient"]["messages"], air.values.len());
        let origins: usize = report.recording.origins.values().map(Vec::len).sum();
        assert_eq!(seen["topics"]["/rig/provenance"]["messages"].as_u64().unwrap_or(0), origins as u64);
    }
    let campaign = with_readers(&reader("T1", 30), &short);
    let finished = run(&campaign).exits(5);
    assert!(finished.stderr.contains("`cell` has given no T1"), "{}", finished.stderr);
}
