//! The run itself: soak, warm-up, steps, cool-down.

use crate::guards::guard::{ActiveGuards, CommandedState, Guard, SpeedHistory, TripResponse};
use crate::guards::plausibility_watch::PlausibilityWatch;
use crate::run_control::observer::{ObserverError, Operator, Protection, RunError, RunObserver, stated_end};
use crate::run_control::speed_control::SpeedControl;
use crate::run_control::transition_control::{Arrival, PressureMotion, TransitionControl};
use crate::step_source::StepSource;
use crate::surge::estimate::FastStatistics;
use crate::surge::mark::SurgeEvents;
use mapper_core::{
    Backend, BackendError, Clock, Event, EventKind, GuardName, OperatingPoint, PlanStep, Reaction, RigMode,
    RunEnding, SampleBatch, Setpoints, Soak, StepMarker, Trip, is_commanded_jump,
};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::AtomicBool;

/// Interval at which observers and steps receive samples, s of run time.
const POLL_INTERVAL_S: f64 = 1.0;
/// Resolution of recorded times. Source: SI.
const NS_PER_S: f64 = 1e9;
/// Interval at which a soak that ends when the sensors rest is checked, s. Judgement: short compared with the soak.
const REST_CHECK_S: f64 = 10.0;
/// Longest time that a guard may hold the setpoints, s.
const MAX_HOLD_S: f64 = 300.0;
/// Longest time that the operator may hold a step, s. It limits a hold that an operator forgets.
const MAX_OPERATOR_HOLD_S: f64 = 4.0 * 3600.0;
/// Number of stages when a step is approached again, and the duration of each, s.
const APPROACH_STAGES: u32 = 4;
const APPROACH_STAGE_S: f64 = 10.0;
/// Maximum number of consecutive steps that guards may skip; one more ends the run.
const MAX_SKIPPED_STEPS: u32 = 3;

/// Step source, rig and everything else that a run needs.
pub struct Runner<'a> {
    /// The steps to execute: [`PlanSteps`](crate::PlanSteps) for a plan.
    pub steps: &'a mut dyn StepSource,
    /// The rig.
    pub backend: &'a mut dyn Backend,
    /// Paces the polls; see [`mapper_core::UnpacedClock`].
    pub clock: &'a mut dyn Clock,
    /// Guards that may end a step or the run.
    pub guards: Vec<Box<dyn Guard>>,
    /// Receives samples and events.
    pub observer: &'a mut dyn RunObserver,
    /// Controls the speed of each step; `None`: P3 stays as planned.
    pub speed: Option<SpeedControl<'a>>,
    /// Set from outside to stop at the next poll.
    pub stop: &'a AtomicBool,
}

/// Why the run stopped before its last step.
pub(crate) enum Halt {
    Interrupted,
    Tripped(Trip),
    /// A guard ends this step only.
    Cut(Trip),
    Failed(RunError),
}

impl<E: Into<RunError>> From<E> for Halt {
    fn from(error: E) -> Self {
        Halt::Failed(error.into())
    }
}

pub(crate) struct Run<'a, 'p> {
    pub(crate) runner: Runner<'a>,
    pub(crate) protection: &'p Protection<'p>,
    pub(crate) now_s: f64,
    /// The most recent setpoints.
    pub(crate) sent: Option<Setpoints>,
    pub(crate) commanded: CommandedState,
    sample_s: f64,
    speed_history: SpeedHistory,
    plausibility: Option<PlausibilityWatch>,
    skipped: u32,
    /// The transition of the current step, until all its commands have been sent.
    pub(crate) transition: Option<TransitionControl>,
    /// Arrival of P3 in the current step; `None` once it has arrived.
    pub(crate) arrival: Option<Arrival>,
    pub(crate) p3_motion: PressureMotion,
    surge_events: SurgeEvents,
    fast: FastStatistics,
    /// Longest delay of P3 that was reported, s.
    pub(crate) reported_late_s: f64,
    /// Whether the valve opens at the start of the safe shutdown: after a surge.
    pub(crate) opens_at_once: bool,
    /// The point of the last step.
    pub(crate) at: Option<OperatingPoint>,
    /// The step that a guard has cut short, until its end is reported.
    pub(crate) open_step: Option<StepMarker>,
    /// Samples of the second in which the run ended, which no observer has received yet: the rig is made safe first.
    pub(crate) unreported: Option<SampleBatch>,
    /// Whether the operator was informed that the run ends with this step.
    pub(crate) stop_confirmed: bool,
}

impl Runner<'_> {
    /// Runs all steps from arming to disarming, with guards but without further protection.
    pub fn run(self) -> Result<RunEnding, RunError> {
        self.run_under(&Protection::default())
    }

    /// Runs all steps from arming to disarming.
    ///
    /// When this returns, the rig has been commanded to its safe state and disarmed, even after a panic.
    pub fn run_under(mut self, protection: &Protection<'_>) -> Result<RunEnding, RunError> {
        let answered = self.arm(protection)?;
        let sample_s = 1.0 / self.backend.describe().sample_rate_hz;
        let mut run = Run {
            runner: self,
            protection,
            now_s: 0.0,
            sent: None,
            commanded: CommandedState::default(),
            sample_s: if sample_s > 0.0 { sample_s.min(POLL_INTERVAL_S) } else { POLL_INTERVAL_S },
            speed_history: SpeedHistory::default(),
            plausibility: protection.readings.map(PlausibilityWatch::new),
            skipped: 0,
            transition: None,
            arrival: None,
            p3_motion: PressureMotion::default(),
            surge_events: SurgeEvents::default(),
            fast: FastStatistics::default(),
            reported_late_s: 0.0,
            opens_at_once: false,
            at: None,
            open_step: None,
            unreported: None,
            stop_confirmed: false,
        };
        // After a panic, the possibly inconsistent state is used only to make the rig safe.
        let end = match catch_unwind(AssertUnwindSafe(|| {
            answered.map_err(Halt::from).and_then(|()| run.execute())
        })) {
            Ok(Ok(())) => Ok(RunEnding::Completed),
            Ok(Err(halt)) => run.shut_down(halt),
            Err(panic) => run.shut_down(Halt::Failed(RunError::Panicked { message: panic_message(&*panic) })),
        };
        let disarmed = catch_unwind(AssertUnwindSafe(|| run.runner.backend.disarm()));
        let end = end?;
        let disarmed = match disarmed {
            Ok(disarmed) => disarmed.map_err(RunError::from),
            Err(panic) => Err(RunError::Panicked { message: panic_message(&*panic) }),
        };
        stated_end(Ok(end), Ok(()), String::new(), disarmed)
    }
}

pub(crate) fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic".to_owned())
}

/// A time without the rounding of its sums: a command of the same time as a sample then always follows it.
fn in_nanoseconds(t_s: f64) -> f64 {
    (t_s * NS_PER_S).round() / NS_PER_S
}

impl Run<'_, '_> {
    fn execute(&mut self) -> Result<(), Halt> {
        self.runner.observer.on_start(&self.runner.backend.describe())?;
        let mut next = self.next_step()?;
        self.pass_notes()?;
        if let Some(first) = &next {
            if let Some(soak) = self.runner.steps.soak() {
                self.soak(first, soak)?;
            }
            let warm_s = self.now_s + self.runner.steps.warm_up_s();
            if warm_s > self.now_s {
                let first_setpoints = self.begin_step(first);
                self.send(first_setpoints)?;
                self.run_until(warm_s, false, true)?;
                self.at = Some(first.to);
                // The first step reports whether its speed was reached; the warm-up does not.
                let now_s = self.now_s;
                let _ = self.runner.speed.as_mut().map(|speed| speed.end(now_s));
            }
        }
        while let Some(step) = next {
            self.rest_before(&step)?;
            self.step(&step)?;
            next = self.next_step()?;
            self.pass_notes()?;
        }
        self.unload()?;
        self.runner.backend.make_safe()?;
        (self.sent, self.commanded) = (None, CommandedState::default());
        let end_s = self.now_s + self.runner.steps.cool_down_s();
        self.run_until(end_s, false, false)
    }

    /// Waits for the next step, unless a stop is requested. A rig in real time is polled and guarded meanwhile.
    fn next_step(&mut self) -> Result<Option<PlanStep>, Halt> {
        loop {
            self.check_for_stop(false, self.now_s)?;
            if self.runner.steps.is_ready() {
                break;
            }
            if self.sent.is_some() && self.runner.clock.advances_by_itself() {
                self.run_until(self.now_s + self.sample_s, false, true)?;
            }
        }
        Ok(self.runner.steps.next_step()?)
    }

    /// Executes one step, and repeats it once if a guard requests smaller steps.
    fn step(&mut self, step: &PlanStep) -> Result<(), Halt> {
        self.refuse_avoided(step)?;
        let before = self.sent;
        let mut repeats = false;
        loop {
            let setpoints = self.begin_step(step);
            if repeats && let Some(before) = before {
                self.approach(before, setpoints)?;
            }
            let mut marker = StepMarker {
                index: step.index,
                kind: step.kind,
                start_s: self.now_s,
                end_s: self.now_s + step.dwell_s,
                from: step.from,
                to: Some(step.to),
                p3_pa: setpoints.p3_pa,
                valve_opening_ratio: setpoints.valve_opening_ratio,
            };
            self.start_transition(step, setpoints)?;
            (self.commanded.step_since_s, self.commanded.aim) = (Some(self.now_s), Some(step.to));
            self.speed_history.clear();
            self.runner.observer.on_step_start(&marker)?;
            self.runner.steps.before_step(&marker);
            let result = self.run_until(marker.end_s, true, true);
            let result = result.and_then(|()| {
                self.end_speed_control()?;
                self.check_speed(step)
            });
            (self.transition, self.arrival) = (None, None);
            self.at = Some(step.to);
            (self.commanded.step_since_s, self.commanded.aim) = (None, None);
            marker.end_s = self.now_s;
            let trip = match result {
                Err(Halt::Cut(trip)) => trip,
                Err(halt @ Halt::Tripped(_)) => {
                    // The rig comes first: the safe shutdown reports the end of the step after its samples.
                    self.open_step = Some(marker);
                    return Err(halt);
                }
                ended => {
                    // The reason for an early end takes precedence over a failure to write the marker.
                    let recorded = self.runner.observer.on_step_end(&marker);
                    ended?;
                    recorded?;
                    self.runner.observer.on_step_completed(&marker)?;
                    self.runner.steps.after_step(&marker)?;
                    self.skipped = 0;
                    return Ok(());
                }
            };
            self.runner.observer.on_step_abandoned(&marker)?;
            // Smaller steps would stop the shaft inside.
            let crosses = self
                .protection
                .stand
                .zip(step.from)
                .is_some_and(|(stand, from)| stand.avoid.is_crossed(from.speed_rpm, step.to.speed_rpm));
            let (is_repeated, response) = match trip.reaction {
                Reaction::SmallerSteps if crosses => (
                    false,
                    "the step is skipped, because smaller steps would stop within the speeds to avoid",
                ),
                Reaction::SmallerSteps if !repeats && before.is_some() => {
                    (true, "the step is repeated in smaller steps")
                }
                _ => (false, "the step is skipped"),
            };
            self.report_trip(&trip, response)?;
            if !is_repeated {
                self.skipped += 1;
                if self.skipped > MAX_SKIPPED_STEPS {
                    let reason =
                        format!("{} consecutive steps were skipped; the last: {}", self.skipped, trip.reason);
                    return Err(Halt::Tripped(Trip { reaction: Reaction::Safe, reason, ..trip }));
                }
                self.runner.steps.after_skipped_step(&marker)?;
                return Ok(());
            }
            repeats = true;
        }
    }

    /// Ends the run instead of setting a target within the speeds to avoid, wherever the step comes from.
    fn refuse_avoided(&self, step: &PlanStep) -> Result<(), Halt> {
        let refused = self.protection.stand.and_then(|stand| stand.avoid.refusing(step.to.speed_rpm));
        let Some(range) = refused else { return Ok(()) };
        let (from_krpm, to_krpm) = (range.from_rpm / 1e3, range.to_rpm / 1e3);
        let reason = format!(
            "the step to {} would stay within {from_krpm:.2} to {to_krpm:.2} krpm",
            step.to.in_words()
        );
        let (guard, reaction) = (GuardName::AvoidedSpeed, Reaction::Safe);
        Err(Halt::Tripped(Trip { t_s: self.now_s, guard, reaction, reason }))
    }

    /// Returns to `before`, then approaches `to` in stages.
    fn approach(&mut self, before: Setpoints, to: Setpoints) -> Result<(), Halt> {
        for piece in 0..APPROACH_STAGES {
            let share = f64::from(piece) / f64::from(APPROACH_STAGES);
            let between = |from: f64, to: f64| from + share * (to - from);
            self.send(Setpoints {
                p3_pa: between(before.p3_pa, to.p3_pa),
                valve_opening_ratio: between(before.valve_opening_ratio, to.valve_opening_ratio),
                ..to
            })?;
            match self.run_until(self.now_s + APPROACH_STAGE_S, true, false) {
                // The same guard tripped again: the step itself reports it.
                Ok(()) | Err(Halt::Cut(_)) => {}
                halt => return halt,
            }
        }
        Ok(())
    }

    /// Checks the speed at the end of a step against the campaign's band.
    fn check_speed(&mut self, step: &PlanStep) -> Result<(), Halt> {
        let missed = self.protection.speed.and_then(|band| self.speed_history.check(band, step, self.now_s));
        let Some(trip) = missed else { return Ok(()) };
        match TripResponse::of(trip.reaction, true, true) {
            TripResponse::Continue | TripResponse::Hold => self.report_trip(&trip, "the run continues"),
            TripResponse::EndStep => Err(Halt::Cut(trip)),
            TripResponse::End => Err(Halt::Tripped(trip)),
        }
    }

    /// Starts the speed control of a step, and returns its first setpoints.
    fn begin_step(&mut self, step: &PlanStep) -> Setpoints {
        let now_s = self.now_s;
        let p3_pa = self.runner.speed.as_mut().map_or(step.p3_pa, |speed| speed.begin(step, now_s));
        Setpoints { p3_pa, ..setpoints(step) }
    }

    /// Sends setpoints to the rig, and updates the state that the guards use.
    pub(crate) fn send(&mut self, setpoints: Setpoints) -> Result<(), BackendError> {
        self.runner.backend.set(&setpoints)?;
        let running = setpoints.mode == RigMode::Running;
        // Sensors have to follow a jump: see the guards of frozen readings.
        let commands = |of: &Setpoints| (of.p3_pa, of.valve_opening_ratio);
        let jumps =
            self.sent.is_some_and(|before| is_commanded_jump(commands(&before), commands(&setpoints)));
        if jumps && running && self.commanded.running {
            self.commanded.jumped_s = Some(self.now_s);
        } else if !running {
            self.commanded.jumped_s = None;
        }
        let opening_ratio = setpoints.valve_opening_ratio;
        let known = self.commanded.valve.filter(|(before_ratio, _)| *before_ratio == opening_ratio);
        self.commanded.valve = known.or(Some((opening_ratio, self.now_s)));
        (self.commanded.running, self.sent) = (running, Some(setpoints));
        Ok(())
    }

    /// Ends the speed control of a step, and reports a speed that was not reached.
    fn end_speed_control(&mut self) -> Result<(), ObserverError> {
        let now_s = self.now_s;
        let event = self.runner.speed.as_mut().and_then(|speed| speed.end(now_s));
        event.map_or(Ok(()), |event| self.runner.observer.on_event(&event))
    }

    /// Reports a guard that does not end the run.
    fn report_trip(&mut self, trip: &Trip, response: &str) -> Result<(), Halt> {
        let message = format!("guard `{}`: {}; {response}", trip.guard, trip.reason);
        let t_s = trip.t_s.max(self.now_s);
        Ok(self.runner.observer.on_event(&Event { t_s, kind: EventKind::GuardActed, message })?)
    }

    /// Switches the air off before a step that a standstill precedes.
    fn rest_before(&mut self, step: &PlanStep) -> Result<(), Halt> {
        if let Some(soak) = self.runner.steps.rest() {
            self.unload()?;
            self.soak(step, soak)?;
            (self.at, self.commanded.valve) = (None, None);
        }
        Ok(())
    }

    /// Keeps the machine at rest for the duration of the soak; events mark start and end.
    fn soak(&mut self, first: &PlanStep, soak: Soak) -> Result<(), Halt> {
        self.send(Setpoints {
            mode: RigMode::Standstill,
            oil_temperature_k: soak.oil_temperature_k,
            ..setpoints(first)
        })?;
        // Without a stated non-uniformity a rest does not count as a zero.
        let (name, kinds) = match soak.temperature_sigma_k > 0.0 {
            true => ("soak", [EventKind::SoakStarted, EventKind::SoakEnded]),
            false => ("rest", [EventKind::Note, EventKind::Note]),
        };
        let message = format!(
            "{name} for {}{:.1} min: air off, oil at {}",
            if soak.until_settled { "at least " } else { "" },
            soak.duration_s / 60.0,
            mapper_core::temperature(soak.oil_temperature_k)
        );
        let (t_s, kind) = (self.now_s, kinds[0]);
        self.runner.observer.on_event(&Event { t_s, kind, message })?;
        let start_s = self.now_s;
        self.run_until(start_s + soak.duration_s, false, false)?;
        while soak.until_settled && !self.runner.steps.is_at_rest() && self.now_s < start_s + Soak::LONGEST_S
        {
            self.run_until((self.now_s + REST_CHECK_S).min(start_s + Soak::LONGEST_S), false, false)?;
        }
        let message = if soak.until_settled {
            format!("{name} completed after {:.1} min, air on", (self.now_s - start_s) / 60.0)
        } else {
            format!("{name} completed, air on")
        };
        let (t_s, kind) = (self.now_s, kinds[1]);
        self.runner.observer.on_event(&Event { t_s, kind, message })?;
        Ok(())
    }

    pub(crate) fn pass_notes(&mut self) -> Result<(), ObserverError> {
        let (t_s, kind) = (self.now_s, EventKind::Note);
        let mut notes = self.runner.steps.take_notes().into_iter();
        notes.try_for_each(|message| self.runner.observer.on_event(&Event { t_s, kind, message }))?;
        self.pass_requests()
    }

    fn pass_requests(&mut self) -> Result<(), ObserverError> {
        let Some(operator) = self.protection.operator else { return Ok(()) };
        let (t_s, kind) = (self.now_s, EventKind::Note);
        let mut requests = operator.take_messages().into_iter();
        requests.try_for_each(|message| self.runner.observer.on_event(&Event { t_s, kind, message }))
    }

    /// Runs the rig to `until_s` while guards, observer and source receive its samples. Within a step the source may end it early,
    /// and a guard may hold or cut it short. Outside a step, a guard that would cut a step short ends the run.
    pub(crate) fn run_until(
        &mut self,
        mut until_s: f64,
        in_step: bool,
        hold_speed: bool,
    ) -> Result<(), Halt> {
        let (mut held_s, mut operator_held_s, mut hold_sent) = (0.0, 0.0, false);
        while self.now_s < until_s {
            self.check_for_stop(in_step, until_s)?;
            let before_s = self.now_s;
            let next_s = self.transition.as_ref().map_or(until_s, |control| before_s + control.interval_s());
            let (mut batch, trips) = self.poll_until_trip(next_s.min(until_s), in_step)?;
            // Fast samples are recorded at the end of a step, and where the compressor surges.
            let surges = batch.events.iter().any(|event| event.kind == EventKind::SurgeEntered);
            if trips.is_empty() && !surges && !(in_step && self.now_s >= until_s) {
                batch.fast.clear();
            }
            self.p3_motion.add(&batch);
            if let Some(trip) = trips.iter().find(|trip| trip.reaction.ends_the_run()) {
                let trip = trip.clone();
                self.unreported = Some(batch);
                return Err(Halt::Tripped(trip));
            }
            self.runner.observer.on_batch(&batch)?;
            for trip in &trips {
                match TripResponse::of(trip.reaction, in_step, held_s < MAX_HOLD_S) {
                    TripResponse::Continue => self.report_trip(trip, "the run continues")?,
                    TripResponse::Hold => self.report_trip(trip, "the setpoints are held")?,
                    TripResponse::EndStep => return Err(Halt::Cut(trip.clone())),
                    TripResponse::End => {
                        return Err(Halt::Tripped(Trip { reaction: Reaction::Safe, ..trip.clone() }));
                    }
                }
            }
            self.pass_requests()?;
            let operator_holds = self.protection.operator.is_some_and(Operator::is_holding)
                && operator_held_s < MAX_OPERATOR_HOLD_S;
            if operator_holds {
                let more_s = self.now_s - before_s;
                (operator_held_s, until_s) = (operator_held_s + more_s, until_s + more_s);
            }
            self.speed_history.add(&batch, self.now_s);
            let ends = self.runner.steps.on_batch(&batch);
            let holding = trips.iter().any(|trip| trip.reaction == Reaction::Hold)
                || (held_s > 0.0 && ActiveGuards::new(&mut self.runner.guards).is_violated());
            // Sent once per hold: the backend reports whether it still accepts commands.
            if (holding || operator_holds) && !hold_sent {
                self.runner.backend.hold()?;
            }
            hold_sent = holding || operator_holds;
            if holding {
                let last_s =
                    batch.t_s.first().zip(batch.t_s.last()).map_or(0.0, |(first, last)| last - first);
                let more_s = last_s.max(self.sample_s);
                (held_s, until_s) = (held_s + more_s, until_s + more_s);
                if held_s >= MAX_HOLD_S {
                    let reason = format!(
                        "a guard has held the setpoints for {MAX_HOLD_S:.0} s, and is still violated"
                    );
                    let (guard, reaction) = (GuardName::Signals, Reaction::Safe);
                    return Err(Halt::Tripped(Trip { t_s: self.now_s, guard, reaction, reason }));
                }
                continue;
            }
            held_s = 0.0;
            if ends && in_step {
                break;
            }
            if in_step {
                until_s += self.wait_for_arrival(self.now_s - before_s)?;
            }
            if self.advance_transition(&batch, until_s)? {
                continue;
            }
            if hold_speed && let (Some(speed), Some(sent)) = (&mut self.runner.speed, self.sent) {
                let (p3_pa, event) = speed.on_batch(&batch, self.p3_motion.is_moving_to(sent.p3_pa));
                event.map_or(Ok(()), |event| self.runner.observer.on_event(&event))?;
                // At the end of a step the next step sets P3.
                if let Some(p3_pa) = p3_pa.filter(|_| self.now_s < until_s) {
                    self.send(Setpoints { p3_pa, ..sent })?;
                }
            }
        }
        Ok(())
    }

    /// Polls samples for one second, at most to `until_s`, and stops at the sample at which a guard trips.
    fn poll_until_trip(
        &mut self,
        until_s: f64,
        in_step: bool,
    ) -> Result<(SampleBatch, Vec<Trip>), BackendError> {
        let end_s = (self.now_s + POLL_INTERVAL_S).min(until_s);
        let mut merged: Option<SampleBatch> = None;
        loop {
            let alert = self.protection.each_sample || ActiveGuards::new(&mut self.runner.guards).is_alert();
            let next_s = in_nanoseconds(if alert { (self.now_s + self.sample_s).min(end_s) } else { end_s });
            if !self.wait_until_or_stop(next_s, in_step) {
                return Ok((merged.unwrap_or_default(), Vec::new()));
            }
            let mut batch = match self.runner.backend.poll(next_s) {
                Ok(batch) => batch,
                Err(error) => {
                    self.unreported = merged;
                    return Err(error);
                }
            };
            self.now_s = next_s;
            // Guards check the readings before impossible ones are marked, because a mark must not hide a value above its limit.
            let mut trips = ActiveGuards::new(&mut self.runner.guards).check(&batch, next_s, &self.commanded);
            let judged =
                self.plausibility.as_mut().and_then(|watch| watch.judge(&mut batch, &self.commanded));
            trips.extend(judged);
            self.surge_events.join(&mut batch, next_s);
            self.fast.add_columns(&mut batch);
            match &mut merged {
                None => merged = Some(batch),
                Some(merged) => merged.append(batch),
            }
            // Rounding: accumulated sample times fall slightly short of the full second.
            if !trips.is_empty() || end_s - self.now_s < 1e-9 * end_s.abs() {
                self.now_s = if trips.is_empty() { end_s } else { self.now_s };
                return Ok((merged.unwrap_or_default(), trips));
            }
        }
    }
}

fn setpoints(step: &PlanStep) -> Setpoints {
    Setpoints {
        mode: RigMode::Running,
        p3_pa: step.p3_pa,
        t3_k: step.t3_k,
        valve_opening_ratio: step.to.valve_opening_ratio,
        oil_temperature_k: step.oil_temperature_k,
    }
}
