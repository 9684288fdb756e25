//! Measures CPU time and latency of a run on a stand with 24 sensors, and with an additional pressure at 1 kHz: docs/validation/performance.md.
//!
//! ```text
//! cargo run --release --locked -p mapper-session --example rig_load
//! ```
//!
//! This prints one table. A word after `--` runs only one part:
//!
//! ```text
//! load      # one hour at 100 Hz, and the same with 1 kHz, in scaled time
//! clock     # polling jitter during two minutes in real time
//! trip      # delay from the sample that violates a guard to the command
//! resume    # resuming a run of 12 hours
//! ```
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

use mapper_core::{
    Backend, BackendError, Channel, ChannelColumn, Element, ElementColumn, PacedClock, RigDescription,
    SafeTrajectory, SampleBatch, Setpoints, UnpacedClock, WallClock,
};
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_session::{InterruptedRun, Registry, RunRequest, Session, SessionEvent};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Log of the stand's actions.
struct StandLog {
    rate_hz: f64,
    real_time: bool,
    /// The speed reading is too high from this time on, s.
    trips_s: f64,
    /// P3, valve opening and speed of each step.
    steps: Vec<(f64, f64, f64)>,
    polled: Vec<(f64, Instant)>,
    violated: Option<Instant>,
    commanded: Option<Instant>,
}

static LOG: Mutex<StandLog> = Mutex::new(StandLog {
    rate_hz: 100.0,
    real_time: false,
    trips_s: f64::INFINITY,
    steps: Vec::new(),
    polled: Vec::new(),
    violated: None,
    commanded: None,
});

/// Low-cost readings: constant levels with little noise.
struct Stand {
    channels: Vec<Channel>,
    elements: Vec<Element>,
    rate_hz: f64,
    real_time: bool,
    controls: bool,
    next: u64,
    speed_rpm: f64,
    setpoints: Option<Setpoints>,
    noise: u64,
}

impl Stand {
    fn value(&mut self, channel: Channel, t_s: f64, trips_s: f64) -> f64 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        let noise = (self.noise >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        let setpoints = self.setpoints;
        let level = match channel {
            Channel::ShaftSpeed if t_s >= trips_s => 2e5,
            Channel::ShaftSpeed => self.speed_rpm,
            Channel::CompressorFlow | Channel::TurbineFlow => 0.08,
            Channel::P1 | Channel::P4 => 99e3,
            Channel::P2 => 160e3,
            Channel::P3 => setpoints.map_or(1e5, |set| set.p3_pa),
            Channel::T3 => setpoints.map_or(300.0, |set| set.t3_k),
            Channel::P3Command => return setpoints.map_or(f64::NAN, |set| set.p3_pa),
            Channel::T3Command => return setpoints.map_or(f64::NAN, |set| set.t3_k),
            Channel::ValveCommand => return setpoints.map_or(f64::NAN, |set| set.valve_opening_ratio),
            Channel::TOilCommand => return setpoints.map_or(f64::NAN, |set| set.oil_temperature_k),
            Channel::T2 => 360.0,
            Channel::TOil => 363.0,
            _ => 300.0,
        };
        level * (1.0 + 1e-4 * noise)
    }
}

impl Backend for Stand {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: if self.controls { "stand" } else { "fast" }.to_owned(),
            version: "1".to_owned(),
            channels: self.channels.clone(),
            sample_rate_hz: self.rate_hz,
            simulated_time: !self.real_time,
            controls: self.controls,
            exclusive: None,
            reached_at: None,
            needs_guarded: Vec::new(),
            accepts: None,
            safe: SafeTrajectory { p3_slew_pa_s: Some(50e3), valve_opening_ratio: 1.0, within_s: 5.0 },
        }
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        (self.next, self.setpoints) = (0, None);
        Ok(())
    }
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        let mut log = LOG.lock().unwrap();
        if log.violated.is_some() && log.commanded.is_none() {
            log.commanded = Some(Instant::now());
        }
        let near = |step: &&(f64, f64, f64)| {
            (step.0 - setpoints.p3_pa).abs() < 1.0 && (step.1 - setpoints.valve_opening_ratio).abs() < 1e-9
        };
        self.speed_rpm = log.steps.iter().find(near).map_or(self.speed_rpm, |step| step.2);
        self.setpoints = Some(*setpoints);
        Ok(())
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let first_sequence = self.next;
        let mut t_s = Vec::new();
        while self.next as f64 / self.rate_hz <= until_s {
            t_s.push(self.next as f64 / self.rate_hz);
            self.next += 1;
        }
        let trips_s = LOG.lock().unwrap().trips_s;
        let mut columns = Vec::with_capacity(self.channels.len());
        for channel in self.channels.clone() {
            let values = t_s.iter().map(|t_s| self.value(channel, *t_s, trips_s)).collect();
            columns.push(ChannelColumn { channel, values });
        }
        let mut elements = Vec::with_capacity(self.elements.len());
        for element in self.elements.clone() {
            let values = t_s.iter().map(|t_s| self.value(element.channel, *t_s, trips_s)).collect();
            elements.push(ElementColumn { element, values });
        }
        if self.controls {
            let mut log = LOG.lock().unwrap();
            if log.real_time {
                let now = Instant::now();
                log.polled.push((until_s, now));
                if log.violated.is_none() && t_s.last().is_some_and(|t_s| *t_s >= trips_s) {
                    log.violated = Some(now);
                }
            }
        }
        Ok(SampleBatch { first_sequence, t_s, columns, elements, ..SampleBatch::default() })
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        Ok(())
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        Ok(())
    }
}

fn driver(name: &str, _: &serde_json::Value) -> Result<Box<dyn Backend>, BackendError> {
    let (rate_hz, real_time) = {
        let log = LOG.lock().unwrap();
        (log.rate_hz, log.real_time)
    };
    let controls = name == "stand";
    let all = mapper_core::CHANNELS.iter().map(|row| row.channel);
    let element = |(channel, number): &(Channel, usize)| Element { channel: *channel, number: *number };
    let several = [(Channel::T1, 1), (Channel::T1, 2), (Channel::T2, 1), (Channel::T2, 2), (Channel::T2, 3)];
    Ok(Box::new(Stand {
        channels: if controls { all.collect() } else { vec![Channel::P1] },
        elements: if controls { several.iter().map(element).collect() } else { Vec::new() },
        rate_hz: if controls { rate_hz } else { 1000.0 },
        real_time,
        controls,
        next: 0,
        speed_rpm: 0.0,
        setpoints: None,
        noise: 88172645463325252,
    }))
}

struct Clock(Instant);

impl WallClock for Clock {
    fn now_s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }
    fn wait_s(&self, duration_s: f64) {
        std::thread::sleep(Duration::from_secs_f64(duration_s));
    }
}

/// CPU time of this process on all cores, s; Linux has a resolution of 0.01 s.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    let ticks: f64 = after.split_whitespace().skip(11).take(2).filter_map(|n| n.parse::<f64>().ok()).sum();
    ticks / 100.0
}

fn campaign(dwell_s: u32, more: &str) -> String {
    let text = include_str!("../../../campaigns/turbo_a.yaml");
    let replaced = [
        ("  virtual_lab: {}\n", "  stand: {}\n".to_owned()),
        ("order: thermal_gradient ", "order: listed ".to_owned()),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", String::new()),
        ("  dwell: 40 s ", format!("  dwell: {dwell_s} s ")),
        ("  warm_up: 2 min ", "  warm_up: 1 s ".to_owned()),
        ("method: joint ", "method: dynamic ".to_owned()),
        ("  formats: [csv, json, svg]\n", "  formats: []\n".to_owned()),
        ("seed: 1 ", format!("repeats: off\nreturn_to_first: false\nspeed_control: off\n{more}seed: 1 ")),
    ];
    replaced.iter().fold(text.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

struct Cost {
    drive_cpu_s: f64,
    drive_s: f64,
    to_start_s: f64,
    recording: std::path::PathBuf,
    directory: std::path::PathBuf,
    end: String,
}

/// Makes one run. `stop_at`: the run is stopped at the start of this step.
fn run(text: &str, parent: &Path, real_time: bool, stop_at: usize, resume: Option<&Path>) -> Cost {
    let files = |path: &Path| std::fs::read_to_string(path);
    let origin = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../campaigns/turbo_a.yaml"));
    let campaign = mapper_campaign::check(text, origin, &files).unwrap_or_else(|error| panic!("{error}"));
    let registry = Registry { driver: Some(Arc::new(driver)), ..Registry::empty() };
    let (stop, begun, asked) = (AtomicBool::new(false), Mutex::new((0.0, Instant::now())), Instant::now());
    let (cost, to_start) = (Mutex::new((0.0, 0.0)), Mutex::new(0.0));
    let on_event = |event: &SessionEvent| match event {
        SessionEvent::RunStarted { .. } => {
            *begun.lock().unwrap() = (cpu_s(), Instant::now());
            *to_start.lock().unwrap() = asked.elapsed().as_secs_f64();
        }
        SessionEvent::StepStarted { marker, .. } if marker.index == stop_at => {
            stop.store(true, Ordering::Relaxed)
        }
        SessionEvent::Progress { what, .. } if what.starts_with("identifying") => {
            let (cpu, at) = *begun.lock().unwrap();
            *cost.lock().unwrap() = (cpu_s() - cpu, at.elapsed().as_secs_f64());
        }
        _ => {}
    };
    let session = Session { on_event: &on_event, stop: &stop, ..Session::new(&registry) };
    let resume = resume.map(|run| InterruptedRun::read(run).unwrap());
    let request = RunRequest { resume, ..RunRequest::new(&campaign, text, parent) };
    let prepared = session.prepare(request).unwrap();
    let steps = &prepared.plan().steps;
    LOG.lock().unwrap().steps =
        steps.iter().map(|step| (step.p3_pa, step.to.valve_opening_ratio, step.to.speed_rpm)).collect();
    let outcome = if real_time {
        prepared.run_paced(&session, &mut PacedClock::new(Clock(Instant::now()), 1.0), true)
    } else {
        prepared.run_paced(&session, &mut UnpacedClock, true)
    }
    .unwrap();
    let (drive_cpu_s, drive_s) = *cost.lock().unwrap();
    let to_start_s = *to_start.lock().unwrap();
    let end = outcome.sentence();
    Cost { drive_cpu_s, drive_s, to_start_s, recording: outcome.recording, directory: outcome.directory, end }
}

fn row(what: &str, measured: &str) {
    println!("| {what} | {measured} |");
}

fn load(folder: &Path) {
    let fast = "readers: {fast: {backend: {fast: {}}, channels: [P1]}}\n";
    for (name, readers) in [("100 Hz, 24 sensors", ""), ("the same with 1 kHz of P1", fast)] {
        let cost = run(&campaign(75, readers), folder, false, usize::MAX, None);
        let read = read_recording(&cost.recording, &ChannelMap::native(), &ReadOptions::default()).unwrap();
        let count = |channel| read.recording.series.get(&channel).map_or(0, |s| s.t_s.len());
        let run_s = read.recording.series[&Channel::T2].t_s.last().copied().unwrap_or(0.0);
        let words = format!(
            "{run_s:.1} s of run time: {} samples of T2, {} of P1; {:.1} s of one core, {:.2} % of the run's time",
            count(Channel::T2),
            count(Channel::P1),
            cost.drive_cpu_s,
            100.0 * cost.drive_cpu_s / run_s,
        );
        row(name, &words);
        eprintln!("{}; {}", name, cost.end);
    }
}

fn clock(folder: &Path) {
    {
        let mut log = LOG.lock().unwrap();
        (log.real_time, log.trips_s) = (true, f64::INFINITY);
        log.polled.clear();
    }
    let stops = run(&campaign(60, ""), folder, true, 1, None);
    let log = LOG.lock().unwrap();
    let (from_s, from) = log.polled[10];
    let late = |(until_s, at): &(f64, Instant)| {
        1e3 * (at.duration_since(from).as_secs_f64() - (until_s - from_s)).abs()
    };
    let mut late_ms: Vec<f64> = log.polled[10..].iter().map(late).collect();
    late_ms.sort_by(f64::total_cmp);
    let at = |share: f64| late_ms[((late_ms.len() - 1) as f64 * share) as usize];
    let words = format!(
        "{} polls at 100 Hz off their time by {:.2} ms (median), {:.2} ms (99 %), {:.2} ms (worst); {:.1} % of one core",
        late_ms.len(),
        at(0.5),
        at(0.99),
        at(1.0),
        100.0 * stops.drive_cpu_s / stops.drive_s,
    );
    row("jitter in real time", &words);
}

fn trip(folder: &Path) {
    let mut took_ms = Vec::new();
    for turn in 0..TRIPS {
        {
            let mut log = LOG.lock().unwrap();
            (log.real_time, log.trips_s) = (true, 2.0 + 0.003 * f64::from(turn));
            (log.violated, log.commanded) = (None, None);
        }
        let guards = "guards: {overspeed: {dwell: 0 s}}\n";
        let cost = run(&campaign(60, guards), folder, true, usize::MAX, None);
        let log = LOG.lock().unwrap();
        let (Some(violated), Some(commanded)) = (log.violated, log.commanded) else {
            panic!("not seen: {}", cost.end);
        };
        took_ms.push(1e3 * commanded.duration_since(violated).as_secs_f64());
    }
    took_ms.sort_by(f64::total_cmp);
    let words = format!(
        "{TRIPS} runs: {:.2} ms (median), {:.2} ms (worst)",
        took_ms[took_ms.len() / 2],
        took_ms[took_ms.len() - 1]
    );
    row("from the sample to the safe command", &words);
}

fn resume(folder: &Path) {
    {
        let mut log = LOG.lock().unwrap();
        (log.real_time, log.trips_s, log.rate_hz) = (false, f64::INFINITY, 10.0);
    }
    for (name, more) in [("by its plan", ""), ("replayed", "drift: {on_drift: continue}\n")] {
        let text = campaign(900, more);
        let text = match more {
            "" => text,
            _ => text.replacen("repeats: off\n", "repeats: {every: 12}\n", 1),
        };
        let first = run(&text, folder, false, STOPPED_AT, None);
        let read = read_recording(&first.recording, &ChannelMap::native(), &ReadOptions::default());
        let samples = read.map_or(0, |read| read.recording.series[&Channel::T2].t_s.len());
        let _ = std::fs::remove_file(first.directory.join("points.json"));
        let again = run(&text, folder, false, usize::MAX, Some(&first.directory));
        let words = format!(
            "{samples} samples of 24 sensors: {:.2} s until the rig is armed again",
            again.to_start_s
        );
        row(&format!("a run of 12 hours goes on, {name}"), &words);
        eprintln!("{}; {}", name, again.end);
    }
}

/// The long run is stopped at the start of this step.
const STOPPED_AT: usize = 46;
const TRIPS: i32 = 20;

fn main() {
    let only = std::env::args().nth(1);
    let load_of_machine = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    eprintln!("load of the machine: {}", load_of_machine.trim());
    println!("| what | measured |\n|---|---|");
    type Part = (&'static str, fn(&Path));
    let parts: [Part; 4] = [("load", load), ("clock", clock), ("trip", trip), ("resume", resume)];
    for (name, part) in parts {
        if only.as_deref().is_none_or(|only| only == name) {
            let folder = tempfile::tempdir().unwrap();
            part(folder.path());
        }
    }
}
