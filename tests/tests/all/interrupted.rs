//! Runs that end early: killed, and stopped by Ctrl-C.
#![cfg(unix)]

use mapper_core::EventKind;
use mapper_recording::{ChannelMap, ReadOptions, ReadReport, read_recording};
use mapper_tests::{CampaignFile, Finished, mapper, mapper_command, only_run, python};
use notify::{RecommendedWatcher, RecursiveMode, Watcher};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Hours of rig time: the run is far from its end when the recording has a few steps.
const LONG: &[(&str, &str)] = &[
    ("warm_up: 2 min ", "warm_up: 60 s "),
    // Half an hour in which nothing happens.
    ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    // This test does not need an optimised order, and the search would take most of its time.
    ("order: thermal_gradient ", "order: listed "),
    ("dwell: 40 s ", "dwell: 5 min "),
];
/// About 12 minutes of rig time with two steps of five minutes.
const SOME_STEPS_BYTES: u64 = 3_500_000;
/// The test fails if the recording does not grow for this time: a run writes each second of its own clock, thousands of
/// which take a second.
const LONGEST_SILENCE: Duration = Duration::from_secs(120);

/// A run that is killed when the test ends first.
pub(crate) struct Running {
    child: Option<Child>,
    runs: PathBuf,
    /// Ends the events when it is dropped.
    _watcher: RecommendedWatcher,
    file_events: Receiver<notify::Result<notify::Event>>,
}

impl Running {
    fn start(campaign: &CampaignFile) -> Self {
        Running::start_with(campaign, &[])
    }

    /// Starts a run with further options, with locks and latches of its own.
    pub(crate) fn start_with(campaign: &CampaignFile, more: &[&str]) -> Self {
        // Watched before it starts, so that no event is missed.
        let (sender, file_events) = channel();
        let mut watcher = notify::recommended_watcher(sender).unwrap();
        watcher.watch(campaign.directory(), RecursiveMode::Recursive).unwrap();
        let child = mapper_command(["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref()])
            .arg("--out")
            .arg(campaign.runs())
            .args(more)
            .env("MAPPER_STATE_DIR", campaign.directory().join("states"))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        Running { child: Some(child), runs: campaign.runs(), _watcher: watcher, file_events }
    }

    /// Waits until the recording has grown to `bytes`; the run must still be going on.
    pub(crate) fn wait_for_recording(&mut self, bytes: u64) -> PathBuf {
        self.wait_until(|recording| recording.metadata().is_ok_and(|file| file.len() >= bytes))
    }

    /// Waits until the journal has a line; the run must still be going on.
    pub(crate) fn wait_for_journal(&mut self, line: &str) -> PathBuf {
        self.wait_until(|recording| {
            let journal = std::fs::read_to_string(recording.with_file_name("journal.jsonl"));
            journal.is_ok_and(|journal| journal.lines().any(|written| written == line))
        })
    }

    fn wait_until(&mut self, is_met: impl Fn(&Path) -> bool) -> PathBuf {
        loop {
            self.file_events.recv_timeout(LONGEST_SILENCE).expect("the recording grows").unwrap();
            let ended = self.child.as_mut().unwrap().try_wait().unwrap();
            assert_eq!(ended, None, "the run was over before it could be stopped");
            let run = self.runs.read_dir().ok().and_then(|mut runs| runs.next()).and_then(Result::ok);
            let recording = run.map(|run| run.path().join("recording.mcap"));
            if let Some(recording) = recording.filter(|path| is_met(path)) {
                return recording;
            }
        }
    }

    /// Number of the process.
    pub(crate) fn id(&self) -> u32 {
        self.child.as_ref().unwrap().id()
    }

    /// Waits until the process has a handler for SIGINT.
    pub(crate) fn wait_for_signal_handler(&self) {
        loop {
            let status = std::fs::read_to_string(format!("/proc/{}/status", self.id())).unwrap();
            let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap().trim();
            if u64::from_str_radix(caught, 16).unwrap() & 0b10 != 0 {
                return;
            }
            std::thread::yield_now();
        }
    }

    /// Sends a signal, e.g. `INT`.
    pub(crate) fn signal(&self, name: &str) {
        let id = self.id().to_string();
        let status = Command::new("sh").args(["-c", "kill -\"$1\" \"$2\"", "sh", name, &id]).status();
        assert!(status.unwrap().success());
    }

    /// Waits until the run prints this text on its standard error; the remaining output stays in the pipe.
    pub(crate) fn wait_for_output(&mut self, text: &str) {
        let stderr = self.child.as_mut().unwrap().stderr.as_mut().unwrap();
        let (mut printed, mut byte) = (Vec::new(), [0]);
        while !printed.ends_with(text.as_bytes()) {
            let read = stderr.read_exact(&mut byte);
            assert!(read.is_ok(), "`{text}` is not in {}", String::from_utf8_lossy(&printed));
            printed.extend(byte);
        }
    }

    pub(crate) fn kill(mut self) {
        let mut child = self.child.take().unwrap();
        child.kill().unwrap();
        let status = child.wait().unwrap();
        assert_eq!(status.code(), None, "the run ended by itself: {status}");
    }

    pub(crate) fn wait(mut self) -> Finished {
        self.child.take().unwrap().wait_with_output().unwrap().into()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(mut child) = self.child.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn read(recording: &Path) -> ReadReport {
    read_recording(recording, &ChannelMap::native(), &ReadOptions::default()).unwrap()
}

fn killed_run() -> (CampaignFile, PathBuf) {
    let campaign = CampaignFile::shipped_with(LONG);
    let mut running = Running::start(&campaign);
    let recording = running.wait_for_recording(SOME_STEPS_BYTES);
    running.kill();
    (campaign, recording)
}

#[test]
fn the_recording_of_a_killed_run_is_readable_and_identified() {
    let (_campaign, recording) = killed_run();
    let report = read(&recording);
    let finished_steps = report.recording.steps.len();
    // Five minutes each after a minute of warm-up; the last one was under way.
    let samples = report.recording.series.values().map(|series| series.t_s.len()).min().unwrap();
    let seconds = samples as f64 / 10.0;
    assert!(seconds > 660.0, "{seconds} s were saved");
    assert_eq!(finished_steps, 1 + ((seconds - 60.0) / 300.0).floor() as usize);
    let run = recording.parent().unwrap();
    let result = mapper(["identify".as_ref(), run.as_os_str(), "--json".as_ref()]).exits(0).json();
    let points = result["points"].as_array().unwrap();
    assert_eq!(points.len(), finished_steps);
    assert!(points[1]["eta"].is_f64(), "{}", points[1]);
    assert!(!result["recording_warnings"].as_array().unwrap().is_empty(), "the cut is not mentioned");
    // Independent readers can read it too.
    if cfg!(with_python) {
        let seen = python("read_recording.py", [&recording]);
        assert_eq!(seen["complete"], false);
        let ours = report.recording.series.values().map(|series| series.t_s.len()).max().unwrap();
        assert_eq!(seen["topics"]["/rig/compressor"]["messages"], ours);
    }
}

#[test]
fn an_interrupt_makes_the_rig_safe_and_keeps_the_finished_steps() {
    let campaign = CampaignFile::shipped_with(LONG);
    let mut running = Running::start(&campaign);
    let recording = running.wait_for_recording(SOME_STEPS_BYTES);
    running.signal("INT");
    let finished = running.wait().exits(130);
    assert!(finished.stderr.contains("stopped by the operator"), "{}", finished.stderr);
    let result = finished.json();
    let points = result["points"].as_array().unwrap();
    assert!(points.len() >= 2 && points.len() < 48, "{} points", points.len());
    assert!(points[1]["eta"].is_f64(), "{}", points[1]);

    let report = read(&recording);
    assert_eq!(report.warnings, [], "the file was not ended well");
    let events: Vec<String> = report
        .recording
        .events
        .iter()
        .map(|event| serde_json::to_value(event.kind).unwrap().as_str().unwrap().to_owned())
        .collect();
    let index_of = |kind: &str| events.iter().position(|event| event == kind);
    let asked = report
        .recording
        .events
        .iter()
        .position(|event| event.kind == EventKind::Note && event.message.contains("Ctrl-C"));
    assert!(asked.is_some() && asked < index_of("interrupted"), "{:#?}", report.recording.events);
    let (interrupted, safe) = (index_of("interrupted"), index_of("safe_state"));
    assert!(interrupted.is_some() && safe.is_some(), "{events:?}");
    assert!(only_run(&campaign.runs()).join("points.json").is_file());
}

/// A T2 sensor that reads 400 K too much is above its limit from the first samples on, while the machine rests.
#[test]
fn a_guard_trip_before_the_first_step_is_recorded() {
    let campaign =
        CampaignFile::shipped_with(&[("  virtual_lab: {}", "  virtual_lab: {offset_of: {T2: 400 K}}")]);
    let arguments = ["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref()];
    let out = campaign.runs();
    let finished = mapper(arguments.into_iter().chain(["--out".as_ref(), out.as_os_str()])).exits(5);
    assert_eq!(finished.json()["points"].as_array().unwrap().len(), 0);
    let recording = only_run(&campaign.runs()).join("recording.mcap");
    let kinds: Vec<EventKind> = read(&recording).recording.events.iter().map(|event| event.kind).collect();
    assert_eq!(kinds, [EventKind::SoakStarted, EventKind::GuardTripped, EventKind::SafeState]);
}
