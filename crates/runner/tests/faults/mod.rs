//! Every fault of a rig, injected into the virtual lab by a misbehaving backend: the reaction of the run, and the safe state at
//! its end.

mod faulty_driver;
#[cfg(unix)]
mod over_protocol;

use super::{Notebook, Recorded, plan};
use faulty_driver::faulty_backend::{Fault, FaultyBackend};
use faulty_driver::{FAULT_S, lab};
use mapper_backends::virtual_lab::VirtualLab;
use mapper_core::{
    Backend, BackendError, Channel, EventKind, FrozenLimit, GuardName, GuardSet, Plan, Reaction, RunEnding,
    SafeTrajectory, SignalGuard, SpeedBand, SurgeVariation, UnpacedClock,
};
use mapper_runner::{
    AirStillOn, BatchWatch, Guard, PlanSteps, Protection, ReadingBounds, RigWatch, RunError, Runner,
    SignalWatch, SilenceWatch, SurgeWatch, UnguardedChannel,
};
use std::sync::atomic::AtomicBool;

/// Two steps of a minute after 10 s of warm-up.
fn plan_of_minutes() -> Plan {
    let mut plan = plan();
    for (index, step) in plan.steps.iter_mut().enumerate() {
        (step.dwell_s, step.start_s) = (60.0, 10.0 + 60.0 * index as f64);
    }
    plan
}

const FROZEN: FrozenLimit = FrozenLimit { after_s: 20.0, band: 0.0 };

fn guard(name: GuardName, channel: Channel, above: Option<f64>) -> SignalGuard {
    SignalGuard {
        name,
        channel,
        above,
        below: None,
        change: None,
        hysteresis: 0.0,
        dwell_s: 0.2,
        age_s: 3.0,
        // P3 has no noise here, and may stay constant.
        frozen: (channel != Channel::P3).then_some(FROZEN),
        reaction: Reaction::Safe,
    }
}

/// The default guards of a campaign.
fn default_guards() -> GuardSet {
    GuardSet {
        signals: vec![
            guard(GuardName::Overspeed, Channel::ShaftSpeed, Some(180e3)),
            guard(GuardName::TurbineInletPressure, Channel::P3, Some(400e3)),
            guard(GuardName::CompressorOutletTemperature, Channel::T2, Some(573.15)),
            guard(GuardName::Signals, Channel::P2, None),
        ],
        surge: Some(SurgeVariation {
            flow_ratio: 0.05,
            pressure_ratio: 0.01,
            dwell_s: 5.0,
            reaction: Reaction::Safe,
        }),
        valve: None,
        speed: Some(SpeedBand { band_ratio: 0.05, reaction: Reaction::Safe }),
        // Without noise, a flow of zero is constant.
        frozen_flow: None,
    }
}

/// The machine of [`lab`]: a wheel of 52 mm, a T2 probe without inertia.
fn readings() -> ReadingBounds {
    ReadingBounds { wheel_diameter_m: Some(0.052), t2_lag_s: (0.0, 0.0), noise_k: [0.1, 0.0, 0.0] }
}

struct FaultRun {
    end: Result<RunEnding, RunError>,
    notebook: Notebook,
    rig: FaultyBackend<VirtualLab>,
}

fn run_with_faults(faults: &[(f64, Fault)], set: &GuardSet) -> FaultRun {
    let mut rig = FaultyBackend::new(lab(), faults.to_vec());
    let (end, notebook) = run_on(&mut rig, set);
    FaultRun { end, notebook, rig }
}

fn run_on(rig: &mut dyn Backend, set: &GuardSet) -> (Result<RunEnding, RunError>, Notebook) {
    let safe = SafeTrajectory { p3_slew_pa_s: Some(50e3), valve_opening_ratio: 1.0, within_s: 20.0 };
    run_to_safe(rig, set, safe)
}

fn run_to_safe(
    rig: &mut dyn Backend,
    set: &GuardSet,
    safe: SafeTrajectory,
) -> (Result<RunEnding, RunError>, Notebook) {
    let plan = plan_of_minutes();
    let mut notebook = Notebook::default();
    let mut guards: Vec<Box<dyn Guard>> =
        vec![Box::new(BatchWatch::default()), Box::new(RigWatch::default())];
    guards.extend(set.signals.iter().map(|spec| Box::new(SignalWatch::new(*spec)) as Box<dyn Guard>));
    guards.push(Box::new(SilenceWatch::new(vec![UnguardedChannel {
        source: "lab".to_owned(),
        channel: Channel::CompressorFlow,
        age_s: 3.0,
        frozen: set.frozen_flow,
    }])));
    guards.extend(set.surge.map(|spec| Box::new(SurgeWatch::new(spec)) as Box<dyn Guard>));
    let protection = Protection {
        safe,
        p3_min_pa: 110e3,
        speed: set.speed,
        readings: Some(readings()),
        ..Protection::default()
    };
    let end = Runner {
        steps: &mut PlanSteps::new(&plan),
        backend: rig,
        clock: &mut UnpacedClock,
        guards,
        observer: &mut notebook,
        speed: None,
        stop: &AtomicBool::new(false),
    }
    .run_under(&protection);
    (end, notebook)
}

#[test]
fn without_a_fault_no_guard_trips() {
    let run = run_with_faults(&[], &default_guards());
    assert_eq!(run.end.unwrap(), RunEnding::Completed);
    assert_eq!(run.notebook.events, []);
    assert!(run.notebook.bad.is_empty(), "{:?}", run.notebook.bad);
    assert_eq!(run.rig.safe_at_s, [130.0], "made safe once, at its end");
}

/// Each fault trips with its text within its time, the rig is made safe, and the events follow in order. Two cases take longest:
/// a frozen sensor (20 s after the jump at 70 s), and the speed, which is judged at the end of the step.
#[test]
fn every_fault_of_a_rig_ends_the_run_in_the_safe_state() {
    use Channel::{P2, P3, ShaftSpeed, T2};
    for (fault, words, at_most_s) in [
        (Fault::Nan(ShaftSpeed), "(N) has given no good reading", FAULT_S + 4.0),
        (Fault::Absent(T2), "(T2) has given no good reading", FAULT_S + 4.0),
        (Fault::Bad(P3), "(P3) has given no good reading", FAULT_S + 4.0),
        (Fault::Old(P2), "(P2) has given no good reading", FAULT_S + 4.0),
        (Fault::Mute(1e9), "has given no good reading", FAULT_S + 4.0),
        (Fault::Late(6.0), "has given no good reading", FAULT_S + 4.0),
        (Fault::Reads(ShaftSpeed, 181e3), "(N) is 181", FAULT_S + 1.5),
        (Fault::Reads(P3, 401e3), "(P3) is 401", FAULT_S + 1.5),
        (Fault::Reads(T2, 600.0), "(T2) is", FAULT_S + 1.5),
        (Fault::Doubled, "sent twice", FAULT_S + 1.5),
        (Fault::Reordered, "time runs backward", FAULT_S + 1.5),
        (Fault::Backward(100.0), "time runs backward", FAULT_S + 1.5),
        (Fault::Torn(T2), "values for", FAULT_S + 1.5),
        (Fault::Trips { is_reported: true }, "tripped by itself", FAULT_S + 1.5),
        (Fault::Trips { is_reported: false }, "no longer drives it", 130.0),
        (Fault::Ignores, "instead of", 130.0),
    ] {
        // Setpoints are ignored from before the jump.
        let begin_s = if fault == Fault::Ignores { 60.0 } else { FAULT_S };
        let run = run_with_faults(&[(begin_s, fault.clone())], &default_guards());
        let end = run.end.unwrap_or_else(|error| panic!("{fault:?}: {error}"));
        let RunEnding::Tripped(trip) = end else { panic!("{fault:?}: {end:?}") };
        assert!(trip.reason.contains(words), "{fault:?}: {}", trip.reason);
        // A fault affects the whole batch of its second.
        assert!((begin_s - 1.0..=at_most_s).contains(&trip.t_s), "{fault:?}: at {} s", trip.t_s);
        assert!(!run.rig.safe_at_s.is_empty(), "{fault:?}: the air is still on");
        let kinds = &run.notebook.events;
        let place = |kind| kinds.iter().position(|seen| *seen == kind);
        assert!(place(EventKind::GuardTripped) < place(EventKind::SafeState), "{fault:?}: {kinds:?}");
    }
}

/// Impossible readings end the run two seconds after their first sample, and are recorded as bad from the first one on. None of them
/// violates a limit, and most are within the range of their sensor.
#[test]
fn readings_that_contradict_physics_end_the_run() {
    use Channel::{CompressorFlow, P1, P2, P3, ShaftSpeed, T1, T2, T3, T4, Tc, Tt};
    for (fault, channel) in [
        (Fault::Shifted(T2, -273.15), T2),
        (Fault::Shifted(T2, -50.0), T2),
        (Fault::Scaled(P2, 1e-3), P2),
        (Fault::Scaled(P2, 2.5), P2),
        (Fault::Scaled(P2, 0.4), P2),
        (Fault::Scaled(P1, 1e-3), P1),
        (Fault::Scaled(P1, 0.5), P1),
        (Fault::Shifted(T1, -273.15), T1),
        (Fault::Shifted(T1, 60.0), T1),
        (Fault::Scaled(CompressorFlow, -1.0), CompressorFlow),
        (Fault::Reads(CompressorFlow, 0.0), CompressorFlow),
        (Fault::Scaled(ShaftSpeed, 0.5), ShaftSpeed),
        (Fault::Reads(ShaftSpeed, 0.0), ShaftSpeed),
        (Fault::Shifted(Tc, 60.0), Tc),
        (Fault::Shifted(Tc, -30.0), Tc),
        (Fault::Scaled(P3, 0.5), P3),
        (Fault::Shifted(T3, -400.0), T3),
    ] {
        let run = run_with_faults(&[(FAULT_S + 20.0, fault.clone())], &default_guards());
        let end = run.end.unwrap_or_else(|error| panic!("{fault:?}: {error}"));
        let RunEnding::Tripped(trip) = end else { panic!("{fault:?}: {end:?}") };
        assert_eq!((trip.guard, trip.reaction), (GuardName::Signals, Reaction::Safe), "{fault:?}");
        // A fault affects the whole batch of its second; what follows the shaft late, and backflow of surge, may last two seconds more.
        let begin_s = FAULT_S + 20.0;
        // The probe behind the turbine has half a minute to follow.
        let follows_s = if channel == T3 { 30.0 } else { 0.0 };
        assert!(
            (begin_s - 1.0..=begin_s + follows_s + 4.2).contains(&trip.t_s),
            "{fault:?}: at {} s",
            trip.t_s
        );
        assert!(trip.reason.contains(channel.symbol()), "{fault:?}: {}", trip.reason);
        let bad = &run.notebook.bad;
        assert!(bad.contains(&channel), "{fault:?}: {bad:?}");
    }
    // A turbine-side channel that nothing depends on is noted, and the run goes on.
    for fault in [Fault::Shifted(Tt, 300.0), Fault::Reads(T4, 100.0)] {
        let run = run_with_faults(&[(FAULT_S + 20.0, fault.clone())], &default_guards());
        assert_eq!(run.end.unwrap(), RunEnding::Completed, "{fault:?}");
        assert_eq!(run.notebook.events, [EventKind::GuardActed], "{fault:?}");
    }
}

/// A sensor that froze before the jump at 70 s is detected 20 s after it, with a polling interval of one second; N and T2 earlier, since they
/// then contradict the pressure ratio. So is the flow, which no other guard checks.
#[test]
fn a_frozen_sensor_is_detected_after_the_next_jump() {
    for (channel, at_s) in [
        (Channel::P2, 90.0..91.5),
        (Channel::CompressorFlow, 90.0..91.5),
        (Channel::T2, 71.0..85.0),
        (Channel::ShaftSpeed, 71.0..85.0),
    ] {
        let guards = GuardSet { frozen_flow: Some(FROZEN), ..default_guards() };
        let run = run_with_faults(&[(40.0, Fault::Frozen(channel))], &guards);
        let RunEnding::Tripped(trip) = run.end.unwrap() else { panic!("{channel}") };
        let is_late = at_s.start == 90.0;
        assert_eq!(trip.reason.contains("frozen"), is_late, "{}", trip.reason);
        assert!(trip.reason.contains(channel.symbol()), "{}", trip.reason);
        assert!(at_s.contains(&trip.t_s), "{channel}: {}", trip.t_s);
    }
}

#[test]
fn an_interrupted_link_loses_samples_and_a_delayed_one_does_not() {
    // The samples of that second are lost, which the sequence numbers of later ones show.
    let night_without = run_with_faults(&[(FAULT_S, Fault::Mute(1.5))], &default_guards());
    let RunEnding::Tripped(trip) = night_without.end.unwrap() else { panic!("not seen") };
    assert!(trip.reason.contains("samples were lost"), "{}", trip.reason);
    // Samples that are only delayed are not lost.
    let held = run_with_faults(&[(FAULT_S, Fault::Late(1.5))], &default_guards());
    assert_eq!(held.end.unwrap(), RunEnding::Completed);
    assert_eq!(held.notebook.samples.len(), 1351);
}

#[test]
fn refused_setpoints_and_a_panic_end_safe_and_a_lost_rig_is_reported_as_unknown() {
    let refused = run_with_faults(&[(60.0, Fault::Refuses)], &default_guards());
    let error = refused.end.unwrap_err();
    assert!(
        error.to_string().contains("outside the range of the rig") && !error.leaves_rig_state_unknown(),
        "{error}"
    );
    assert!(!refused.rig.safe_at_s.is_empty());
    let panicked = run_with_faults(&[(FAULT_S, Fault::Panics)], &default_guards());
    let error = panicked.end.unwrap_err();
    assert!(matches!(error, RunError::Panicked { .. }) && error.leaves_rig_state_unknown(), "{error}");
    assert!(!panicked.rig.safe_at_s.is_empty(), "a panic cuts the air too");
    let lost = run_with_faults(&[(FAULT_S, Fault::Lost)], &default_guards());
    let error = lost.end.unwrap_err();
    assert!(matches!(error, RunError::NotSafe { .. }) && error.leaves_rig_state_unknown(), "{error}");
    assert!(error.to_string().contains("Cut its air by hand"), "{error}");
    assert!(lost.notebook.events.contains(&EventKind::Latched));
}

#[test]
fn the_safe_state_is_retried_and_then_its_failure_is_reported() {
    let nan = (FAULT_S, Fault::Nan(Channel::T2));
    let twice = run_with_faults(&[nan.clone(), (0.0, Fault::NotSafe(2))], &default_guards());
    assert!(matches!(twice.end, Ok(RunEnding::Tripped(_))));
    assert_eq!(twice.rig.safe_at_s.len(), 1);
    let never = run_with_faults(&[nan, (0.0, Fault::NotSafe(usize::MAX))], &default_guards());
    let error = never.end.unwrap_err();
    assert!(matches!(error, RunError::NotSafe { .. }) && error.leaves_rig_state_unknown(), "{error}");
    assert!(error.to_string().contains("(T2) has given no good reading"), "{error}");
}

/// The command that shuts the air off is acknowledged and ignored: P3 shows it, and the speed without P3. A P3 that stays while the shaft
/// coasts does not.
#[test]
fn air_that_stays_on_after_an_acknowledged_command_is_reported() {
    let nan = (FAULT_S, Fault::Nan(Channel::T2));
    let at_once = SafeTrajectory { p3_slew_pa_s: None, valve_opening_ratio: 1.0, within_s: 20.0 };
    let end = |faults: &[(f64, Fault)]| {
        run_to_safe(&mut FaultyBackend::new(lab(), faults.to_vec()), &default_guards(), at_once).0
    };
    let seen_by = |faults: &[(f64, Fault)]| match end(faults) {
        Err(RunError::NotSafe { source: BackendError::Lost { source, .. }, .. }) => {
            source.downcast_ref::<AirStillOn>().map(|seen| seen.channel)
        }
        Err(error) => panic!("{error}"),
        Ok(_) => None,
    };
    let deaf = (0.0, Fault::NotMadeSafe);
    assert_eq!(seen_by(&[nan.clone(), deaf.clone()]), Some(Channel::P3));
    let without_p3 = [nan.clone(), deaf, (FAULT_S, Fault::Nan(Channel::P3))];
    assert_eq!(seen_by(&without_p3), Some(Channel::ShaftSpeed));
    assert_eq!(seen_by(&[nan, (FAULT_S, Fault::Frozen(Channel::P3))]), None);
}

/// A clock that advances only during waits and slow disk writes.
struct WaitClock(std::cell::Cell<f64>);

impl mapper_core::WallClock for &WaitClock {
    fn now_s(&self) -> f64 {
        self.0.get()
    }
    fn wait_s(&self, duration_s: f64) {
        self.0.set(self.0.get() + duration_s);
    }
}

/// Takes this time for every write, s on the wall clock.
struct SlowDisk<'a> {
    wall: &'a WaitClock,
    takes_s: f64,
    written: usize,
}

impl mapper_runner::RunObserver for SlowDisk<'_> {
    fn on_batch(&mut self, _: &mapper_core::SampleBatch) -> Result<(), mapper_runner::ObserverError> {
        self.wall.0.set(self.wall.0.get() + self.takes_s);
        self.written += 1;
        Ok(())
    }
}

/// Faults with a wall clock: the rig is polled sample by sample, and every write is slow.
fn run_on_wall_clock(
    faults: &[(f64, Fault)],
    takes_s: f64,
) -> (Result<RunEnding, RunError>, FaultyBackend<VirtualLab>, usize, f64) {
    let (plan, wall) = (plan_of_minutes(), WaitClock(std::cell::Cell::new(0.0)));
    let mut rig = FaultyBackend::new(lab(), faults.to_vec());
    let mut disk = SlowDisk { wall: &wall, takes_s, written: 0 };
    let guards = default_guards()
        .signals
        .iter()
        .map(|spec| Box::new(SignalWatch::new(*spec)) as Box<dyn Guard>)
        .collect();
    let protection = Protection {
        safe: SafeTrajectory { p3_slew_pa_s: Some(50e3), valve_opening_ratio: 1.0, within_s: 20.0 },
        p3_min_pa: 110e3,
        each_sample: true,
        ..Protection::default()
    };
    let end = Runner {
        steps: &mut PlanSteps::new(&plan),
        backend: &mut rig,
        clock: &mut mapper_core::PacedClock::new(&wall, 1.0),
        guards,
        observer: &mut disk,
        speed: None,
        stop: &AtomicBool::new(false),
    }
    .run_under(&protection);
    let written = disk.written;
    (end, rig, written, wall.0.get())
}

/// The first safe command follows the violating sample directly, before anything is written. If writing one second of samples takes 0.8 s,
/// the run catches up at each poll. If it takes 3 s, the run is delayed, but the guards still check every sample.
#[test]
fn a_slow_disk_does_not_delay_the_first_safe_command() {
    // Five seconds of observation, each written by itself.
    for (takes_s, late_s) in [(0.8, 4.0), (3.0, 400.0)] {
        let faults = [(FAULT_S, Fault::Reads(Channel::T2, 600.0))];
        let (end, rig, written, wall_s) = run_on_wall_clock(&faults, takes_s);
        let RunEnding::Tripped(trip) = end.unwrap() else { panic!("not seen") };
        // The dwell of 0.2 s, and the next sample.
        assert!(trip.t_s - FAULT_S < 0.35, "{takes_s} s: {}", trip.t_s);
        let first = rig.commands.iter().find(|(_, sent)| sent.t3_k < 300.0).unwrap();
        assert!(first.0 - trip.t_s < 0.11, "{takes_s} s: {} after {}", first.0, trip.t_s);
        assert!(written > 70);
        assert!(wall_s - rig.safe_at_s[0] < 10.0 + late_s, "{takes_s} s: {wall_s}");
    }
}

/// Between two safe-state commands the link has half a second of the run's clock to recover.
#[test]
fn attempts_to_make_the_rig_safe_are_half_a_second_apart() {
    let wall_of = |fails: usize| {
        let faults = [(FAULT_S, Fault::Reads(Channel::T2, 600.0)), (0.0, Fault::NotSafe(fails))];
        let (end, rig, _, wall_s) = run_on_wall_clock(&faults, 0.0);
        assert_eq!(end.is_ok(), fails < 3);
        assert_eq!(rig.safe_at_s.len(), usize::from(fails < 3));
        // Until the safe state: a confirmed one is followed by seconds of observation.
        if fails < 3 { wall_s - 5.0 } else { wall_s }
    };
    let at_once_s = wall_of(0);
    for (fails, more_s) in [(1, 0.5), (2, 1.0), (usize::MAX, 1.0)] {
        assert!((wall_of(fails) - at_once_s - more_s).abs() < 1e-6, "{fails} tries fail");
    }
}

/// P3 falls by 50 kPa/s, in steps of a tenth of a second, with the valve open and the heater off. The air is cut at the lowest
/// P3.
#[test]
fn the_run_down_follows_the_declared_trajectory() {
    let run = run_with_faults(&[(FAULT_S, Fault::Reads(Channel::T2, 600.0))], &default_guards());
    let RunEnding::Tripped(trip) = run.end.unwrap() else { panic!("not seen") };
    let run_down: Vec<_> = run.rig.commands.iter().filter(|(_, sent)| sent.t3_k < 300.0).collect();
    let before = run.rig.commands.iter().rev().find(|(_, sent)| sent.t3_k > 300.0).unwrap().1;
    let expected = ((before.p3_pa - 110e3) / 5e3).floor() as usize;
    assert_eq!(run_down.len(), expected, "from {} Pa", before.p3_pa);
    // The first command follows the poll with the violation; a simulated rig is polled every second.
    assert!(run_down[0].0 - trip.t_s < 1.01, "{} s after {} s", run_down[0].0, trip.t_s);
    for (step, (_, sent)) in run_down.iter().enumerate() {
        assert!((sent.p3_pa - (before.p3_pa - 5e3 * (step + 1) as f64)).abs() < 1e-6);
        assert!(sent.valve_opening_ratio >= 1.0 && sent.valve_opening_ratio >= before.valve_opening_ratio);
    }
    assert!(run.rig.safe_at_s[0] - trip.t_s < 20.0);
}

#[test]
fn of_two_guards_the_more_severe_reaction_wins() {
    let mut set = default_guards();
    set.signals[2].reaction = Reaction::Note;
    set.signals[0].reaction = Reaction::Latch;
    let faults =
        [(FAULT_S, Fault::Reads(Channel::T2, 600.0)), (FAULT_S, Fault::Reads(Channel::ShaftSpeed, 2e5))];
    let RunEnding::Tripped(trip) = run_with_faults(&faults, &set).end.unwrap() else { panic!("not seen") };
    assert_eq!((trip.guard, trip.reaction), (GuardName::Overspeed, Reaction::Latch));
}

/// Mild reactions to a T2 above its limit in the second step.
#[test]
fn mild_reactions_note_skip_repeat_or_hold() {
    let with = |reaction: Reaction, faults: &[(f64, Fault)]| {
        let mut set = default_guards();
        set.signals[2].reaction = reaction;
        run_with_faults(faults, &set)
    };
    let high = [(FAULT_S + 5.0, Fault::Reads(Channel::T2, 600.0))];
    let noted = with(Reaction::Note, &high);
    assert_eq!(noted.end.unwrap(), RunEnding::Completed);
    assert!(noted.notebook.events.iter().all(|kind| *kind == EventKind::GuardActed));
    // Reported at its start, and every ten seconds while it continues.
    assert!((5..=7).contains(&noted.notebook.events.len()), "{:?}", noted.notebook.events);
    assert_eq!(noted.notebook.ends.len(), 2);

    let skipped = with(Reaction::SkipStep, &high);
    assert_eq!(skipped.end.unwrap(), RunEnding::Completed);
    assert_eq!((skipped.notebook.ends.len(), skipped.notebook.abandoned.len()), (1, 1));

    let again = with(Reaction::SmallerSteps, &high);
    assert_eq!(again.end.unwrap(), RunEnding::Completed);
    assert_eq!((again.notebook.starts.len(), again.notebook.abandoned.len()), (3, 2));
    let sent: Vec<f64> = again.rig.commands.iter().map(|(_, sent)| sent.p3_pa).collect();
    let (low_pa, high_pa) = (sent[0], sent[2]);
    for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
        let piece_pa = low_pa + share * (high_pa - low_pa);
        assert!(sent[3..].iter().any(|p3_pa| (p3_pa - piece_pa).abs() < 1e-6), "{share}: {sent:?}");
    }

    // Held for the maximum time; then the run ends.
    let held = with(Reaction::Hold, &high);
    assert_eq!(held.rig.held_at_s.len(), 1, "the rig gets one hold command, when the hold begins");
    assert!((FAULT_S + 5.0..FAULT_S + 7.0).contains(&held.rig.held_at_s[0]), "{:?}", held.rig.held_at_s);
    let RunEnding::Tripped(trip) = held.end.unwrap() else { panic!("held for ever") };
    assert!(trip.reason.contains("has held the setpoints for 300 s"), "{}", trip.reason);
    assert!(trip.t_s < 130.0 + 320.0);
}

#[test]
fn the_recording_of_a_fault_has_no_gaps() {
    let run = run_with_faults(&[(FAULT_S, Fault::Reads(Channel::T2, 600.0))], &default_guards());
    let times: Vec<f64> = run.notebook.samples.iter().map(|(t_s, _)| *t_s).collect();
    assert!(times.is_sorted_by(|a, b| a < b));
    // Ten samples a second, through the violation and the run-down.
    let gaps = times.windows(2).map(|two| two[1] - two[0]);
    assert!(gaps.into_iter().all(|gap_s| (gap_s - 0.1).abs() < 1e-6));
    let _: &Recorded = &run.notebook.samples;
}
