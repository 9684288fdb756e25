//! Runs on the virtual lab: the complete run, and each early end.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "faults/mod.rs"]
mod faults;

use mapper_backends::virtual_lab::{LabSettings, VirtualLab};
use mapper_core::{
    Backend, BackendError, Channel, Event, EventKind, GuardName, OperatingPoint, PacedClock, Plan,
    PlanFigures, PlanInputHashes, PlanStep, Predicted, Quality, Reaction, RigDescription, RunEnding,
    SampleBatch, Setpoints, SignalGuard, StepKind, StepMarker, UnpacedClock, WallClock,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_runner::{
    Guard, ObserverError, Operator, PlanSteps, Protection, RunError, RunObserver, Runner, SignalWatch,
    StepSource, StepSourceError,
};
use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Two steps of 20 s after 10 s of warm-up and before 5 s of cool-down.
pub fn plan() -> Plan {
    let step = |index: usize, p3_pa: f64, speed_rpm: f64| PlanStep {
        index,
        kind: StepKind::Point,
        from: None,
        to: OperatingPoint { speed_rpm, valve_opening_ratio: 0.7 },
        p3_pa,
        t3_k: 773.15,
        oil_temperature_k: 323.15,
        dwell_s: 20.0,
        start_s: 10.0 + 20.0 * index as f64,
        transition: None,
        predicted: Predicted::settled(0.0, 1.0, 300.0, 20.0),
    };
    Plan {
        campaign: "test".to_owned(),
        objective: "listed".to_owned(),
        seed: 1,
        made_from: PlanInputHashes {
            campaign_sha256: String::new(),
            model_sha256: String::new(),
            script_sha256: None,
            rig_sha256: None,
        },
        warm_up_s: 10.0,
        cool_down_s: 5.0,
        // 50 and 110 krpm from the reference table of steady states.
        steps: vec![step(0, 123_527.6, 50e3), step(1, 173_717.1, 110e3)],
        figures: PlanFigures {
            sum_gradient_k: 0.0,
            min_gradient_k: None,
            worst_sigma_eta: None,
            rms_error_eta: None,
            rms_error_reported_eta: None,
            prior_sensitivity_eta: None,
            worst_error_eta: None,
            minutes: 1.0,
        },
        surge_search_s: 0.0,
        remarks: Vec::new(),
    }
}

/// Times and speeds.
type Recorded = Vec<(f64, f64)>;

#[derive(Default)]
struct Notebook {
    samples: Recorded,
    events: Vec<EventKind>,
    starts: Vec<StepMarker>,
    ends: Vec<StepMarker>,
    abandoned: Vec<StepMarker>,
    /// Channels with bad readings.
    bad: BTreeSet<Channel>,
    /// Raised once this run time is reached.
    stop_at_s: Option<(f64, &'static AtomicBool)>,
    /// Writing fails from this run time on.
    fail_at_s: Option<f64>,
}

impl RunObserver for Notebook {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.starts.push(*marker);
        Ok(())
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        let bad = batch.provenance.iter().filter(|from| from.quality.contains(&Quality::Bad));
        self.bad.extend(bad.map(|from| from.channel));
        let Some(speeds) = batch.column(Channel::ShaftSpeed) else { return Ok(()) };
        self.samples.extend(batch.t_s.iter().copied().zip(speeds.iter().copied()));
        let now_s = self.samples.last().map_or(0.0, |sample| sample.0);
        if let Some((stop_s, stop)) = self.stop_at_s {
            stop.store(now_s >= stop_s, Ordering::Relaxed);
        }
        match self.fail_at_s {
            Some(fail_s) if now_s >= fail_s => {
                Err(ObserverError::new(std::io::Error::other("the disk is full")))
            }
            _ => Ok(()),
        }
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.events.push(event.kind);
        Ok(())
    }

    fn on_step_abandoned(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.abandoned.push(*marker);
        Ok(())
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.ends.push(*marker);
        Ok(())
    }
}

/// The lab, with a record of whether it was made safe and disarmed.
struct Watched {
    lab: VirtualLab,
    made_safe: bool,
    disarmed: bool,
}

impl Watched {
    fn new() -> Self {
        let settings = LabSettings::ideal(Model::nominal(), BoundaryConditions::default());
        Watched { lab: VirtualLab::new(settings), made_safe: false, disarmed: false }
    }
}

impl Backend for Watched {
    fn describe(&self) -> RigDescription {
        self.lab.describe()
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        self.lab.arm()
    }
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.lab.set(setpoints)
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.lab.poll(until_s)
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.made_safe = true;
        self.lab.make_safe()
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        self.disarmed = true;
        self.lab.disarm()
    }
}

fn run(
    notebook: &mut Notebook,
    guards: Vec<Box<dyn Guard>>,
    stop: &AtomicBool,
) -> Result<RunEnding, RunError> {
    let (plan, mut rig) = (plan(), Watched::new());
    let end = Runner {
        steps: &mut PlanSteps::new(&plan),
        backend: &mut rig,
        clock: &mut UnpacedClock,
        guards,
        observer: notebook,
        speed: None,
        stop,
    }
    .run();
    assert!(rig.made_safe && rig.disarmed, "whatever happens, the rig ends safe and free");
    end
}

#[test]
fn a_plan_is_run_in_time_and_without_gaps() {
    let mut notebook = Notebook::default();
    assert_eq!(run(&mut notebook, Vec::new(), &AtomicBool::new(false)).unwrap(), RunEnding::Completed);
    assert_eq!(notebook.samples.len(), 551);
    let times: Vec<(f64, f64)> = notebook.ends.iter().map(|marker| (marker.start_s, marker.end_s)).collect();
    assert_eq!(times, [(10.0, 30.0), (30.0, 50.0)]);
    assert_eq!(notebook.starts.len(), 2);
    let speed_at = |t_s: f64| notebook.samples.iter().find(|(t, _)| *t >= t_s).unwrap().1;
    assert!((speed_at(29.9) - 50e3).abs() < 100.0 && (speed_at(49.9) - 110e3).abs() < 1000.0);
    assert!(notebook.events.is_empty());
}

/// Trips after the shaft has turned faster than 80 krpm for this time.
fn overspeed(dwell_s: f64) -> SignalWatch {
    SignalWatch::new(SignalGuard {
        name: GuardName::Overspeed,
        channel: Channel::ShaftSpeed,
        above: Some(80e3),
        below: None,
        change: None,
        hysteresis: 0.0,
        dwell_s,
        age_s: 3.0,
        frozen: None,
        reaction: Reaction::Safe,
    })
}

#[test]
fn a_tripped_guard_makes_the_rig_safe_and_is_reported() {
    let mut notebook = Notebook::default();
    let guard = overspeed(0.2);
    let end = run(&mut notebook, vec![Box::new(guard)], &AtomicBool::new(false)).unwrap();
    let RunEnding::Tripped(trip) = end else { panic!("{end:?}") };
    assert!((30.0..32.0).contains(&trip.t_s), "{trip:?}");
    assert_eq!(notebook.events, [EventKind::GuardTripped, EventKind::SafeState]);
    // The unfinished step ends at the stop, and the recording shows the shaft slow down.
    assert!(notebook.ends[1].end_s < 33.0);
    let fastest = notebook.samples.iter().map(|sample| sample.1).fold(0.0, f64::max);
    assert!(notebook.samples.last().unwrap().1 < 0.8 * fastest);
}

#[test]
fn the_operator_stops_at_the_next_poll() {
    static STOP: AtomicBool = AtomicBool::new(false);
    let mut notebook = Notebook { stop_at_s: Some((15.0, &STOP)), ..Notebook::default() };
    let end = run(&mut notebook, Vec::new(), &STOP).unwrap();
    assert_eq!(end, RunEnding::Interrupted { t_s: 15.0 });
    assert_eq!(notebook.events, [EventKind::Interrupted, EventKind::SafeState]);
}

/// Provides one step of half a second, then prepares the next one for ever, like an endless script.
struct NeverReady<'a> {
    first: Option<PlanStep>,
    looks: u32,
    /// Raised at the third call.
    stop: &'a AtomicBool,
    stops: bool,
}

impl StepSource for NeverReady<'_> {
    fn is_ready(&mut self) -> bool {
        self.looks += 1;
        self.stop.store(self.stops && self.looks > 3, Ordering::Relaxed);
        self.first.is_some()
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        Ok(self.first.take())
    }
}

/// A wall clock that advances only during waits.
struct WaitClock(std::cell::Cell<f64>);

impl WallClock for &WaitClock {
    fn now_s(&self) -> f64 {
        self.0.get()
    }
    fn wait_s(&self, duration_s: f64) {
        self.0.set(self.0.get() + duration_s);
    }
}

fn never_ready(stop: &AtomicBool, stops: bool) -> NeverReady<'_> {
    let first = plan().steps.pop().map(|step| PlanStep { index: 0, dwell_s: 0.5, ..step });
    NeverReady { first, looks: 0, stop, stops }
}

/// A step that never becomes ready does not delay the operator's stop.
#[test]
fn the_operator_can_stop_while_a_step_is_computed() {
    let (stop, mut rig, mut notebook) = (AtomicBool::new(false), Watched::new(), Notebook::default());
    let mut steps = never_ready(&stop, true);
    let end = Runner {
        steps: &mut steps,
        backend: &mut rig,
        clock: &mut UnpacedClock,
        guards: Vec::new(),
        observer: &mut notebook,
        speed: None,
        stop: &stop,
    }
    .run()
    .unwrap();
    assert_eq!(end, RunEnding::Interrupted { t_s: 0.5 });
    assert!(rig.made_safe && rig.disarmed);
}

/// A wall clock that advances only during waits, and a stop that comes at one of its times.
struct StopsAt<'a> {
    now_s: Mutex<f64>,
    stop_s: f64,
    stop: &'a AtomicBool,
}

impl WallClock for &StopsAt<'_> {
    fn now_s(&self) -> f64 {
        *self.now_s.lock().unwrap()
    }
    fn wait_s(&self, duration_s: f64) {
        let mut now_s = self.now_s.lock().unwrap();
        *now_s += duration_s;
        self.stop.store(*now_s >= self.stop_s, Ordering::Relaxed);
    }
}

/// The lab, with the time at which it was made safe.
struct SafeAt<'a> {
    lab: VirtualLab,
    wall: &'a StopsAt<'a>,
    safe_s: Option<f64>,
}

impl Backend for SafeAt<'_> {
    fn describe(&self) -> RigDescription {
        self.lab.describe()
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        self.lab.arm()
    }
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.lab.set(setpoints)
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.lab.poll(until_s)
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.safe_s = self.safe_s.or(Some(self.wall.now_s()));
        self.lab.make_safe()
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        self.lab.disarm()
    }
}

/// In warm-up and steps of a rig in real time, the safe command follows a stop within 20 ms, not at the next sample of 10 Hz.
#[test]
fn a_stop_does_not_wait_for_the_next_sample() {
    // A gentle stop waits for the end of a step, and outside of steps for nothing.
    for (stop_s, gentle) in
        [(3.013, false), (17.508, false), (33.3333, false), (49.9871, false), (3.013, true), (8.7654, true)]
    {
        let (stop, never) = (AtomicBool::new(false), AtomicBool::new(false));
        let wall = StopsAt { now_s: Mutex::new(0.0), stop_s, stop: &stop };
        let lab = VirtualLab::new(LabSettings::ideal(Model::nominal(), BoundaryConditions::default()));
        let mut rig = SafeAt { lab, wall: &wall, safe_s: None };
        let (plan, mut notebook) = (plan(), Notebook::default());
        let end = Runner {
            steps: &mut PlanSteps::new(&plan),
            backend: &mut rig,
            clock: &mut PacedClock::new(&wall, 1.0),
            guards: Vec::new(),
            observer: &mut notebook,
            speed: None,
            stop: if gentle { &never } else { &stop },
        }
        .run_under(&Protection {
            each_sample: !gentle,
            stop_after_step: if gentle { &stop } else { &never },
            ..Protection::default()
        })
        .unwrap();
        assert!(matches!(end, RunEnding::Interrupted { .. }), "{stop_s}: {end:?}");
        let late_s = rig.safe_s.unwrap() - stop_s;
        assert!((0.0..0.02).contains(&late_s), "{stop_s} s: {late_s} s late");
    }
}

/// On a real-time rig, guards receive every sample meanwhile: the shaft stays above their limit long enough after the step.
#[test]
fn guards_check_samples_while_a_step_is_computed() {
    let (stop, mut rig, mut notebook) = (AtomicBool::new(false), Watched::new(), Notebook::default());
    let guard = overspeed(2.0);
    let wall = WaitClock(std::cell::Cell::new(0.0));
    let mut steps = never_ready(&stop, false);
    let end = Runner {
        steps: &mut steps,
        backend: &mut rig,
        clock: &mut PacedClock::new(&wall, 1.0),
        guards: vec![Box::new(guard)],
        observer: &mut notebook,
        speed: None,
        stop: &stop,
    }
    .run()
    .unwrap();
    let RunEnding::Tripped(trip) = end else { panic!("{end:?}") };
    assert!(trip.t_s > 0.5, "{trip:?}");
    assert!(rig.made_safe && rig.disarmed);
    assert!(notebook.samples.windows(2).all(|pair| pair[1].0 - pair[0].0 < 0.11), "no gap in the samples");
}

#[test]
fn a_recorder_that_fails_ends_the_run_with_its_own_error() {
    let mut notebook = Notebook { fail_at_s: Some(15.0), ..Notebook::default() };
    let error = run(&mut notebook, Vec::new(), &AtomicBool::new(false)).unwrap_err();
    assert_eq!(error.to_string(), "the disk is full");
}

/// Holds the first step from its start, and releases it at a given time.
struct HoldsFirst<'a> {
    operator: &'a Operator,
    until_s: f64,
    notebook: Notebook,
}

impl RunObserver for HoldsFirst<'_> {
    fn on_step_start(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        if marker.index == 0 {
            self.operator.hold();
        }
        self.notebook.on_step_start(marker)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), ObserverError> {
        if self.operator.is_holding() && batch.t_s.last().is_some_and(|t_s| *t_s >= self.until_s) {
            self.operator.release();
            self.operator.add_message("let go on".to_owned());
        }
        self.notebook.on_batch(batch)
    }

    fn on_event(&mut self, event: &Event) -> Result<(), ObserverError> {
        self.notebook.on_event(event)
    }

    fn on_step_end(&mut self, marker: &StepMarker) -> Result<(), ObserverError> {
        self.notebook.on_step_end(marker)
    }
}

#[test]
fn a_held_step_lasts_until_its_release() {
    let (plan, operator, mut rig) = (plan(), Operator::default(), Watched::new());
    let mut holds = HoldsFirst { operator: &operator, until_s: 60.0, notebook: Notebook::default() };
    let runner = Runner {
        steps: &mut PlanSteps::new(&plan),
        backend: &mut rig,
        clock: &mut UnpacedClock,
        guards: Vec::new(),
        observer: &mut holds,
        speed: None,
        stop: &AtomicBool::new(false),
    };
    let end = runner.run_under(&Protection { operator: Some(&operator), ..Protection::default() }).unwrap();
    assert_eq!(end, RunEnding::Completed);
    // It starts at 10 s, is held until the second that ends at 60 s, then lasts its 20 s; the next one is as planned.
    let [first, second] = holds.notebook.ends[..] else { panic!("{:?}", holds.notebook.ends) };
    assert!((first.end_s - 10.0 - 20.0 - 50.0).abs() <= 1.0, "{first:?}");
    assert!((second.end_s - second.start_s - 20.0).abs() < 1e-9, "{second:?}");
    assert_eq!(holds.notebook.events, [EventKind::Note], "what was asked for is recorded");
}
