//! The end of a run: stops by the operator, and the safe shutdown after a fault: first the safe state, then the records of the reason.

use crate::guards::guard::{CommandedState, stop_is_due};
use crate::run_control::observer::{ObserverError, Protection, RunError, RunObserver, stated_end};
use crate::run_control::run::{Halt, Run, Runner, panic_message};
use crate::run_control::transition_control::StandMotion;
use mapper_core::{
    BackendError, Channel, Event, EventKind, GuardName, Quality, Reaction, RunEnding, SampleBatch, Setpoints,
    with_unit,
};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Time between two setpoints of the run-down, s.
const STEP_S: f64 = 0.1;
/// How long the rig is observed after it was made safe, s, one at a time, as a kill may cost: whether it reaches the safe state is recorded.
const OBSERVATION_S: u8 = 5;
/// Number of safe-state commands before the rig counts as lost.
pub const MAX_ATTEMPTS: usize = 3;
/// Time between two of these commands, s of the run's clock: an interrupted link may recover.
const PAUSE_S: f64 = 0.5;

/// Share of P3 above P4, or of the speed, that a rig without air must lose while it is observed: a supply that follows
/// with 60 s loses 8 % in 5 s.
const MIN_FALL_RATIO: f64 = 0.05;
/// Least excess of P3 whose fall is judged, Pa: 5 % of it are twice the offset of a transmitter of class 0.1 with 250 kPa.
const MIN_EXCESS_PA: f64 = 10e3;
/// Ratio of speeds below which a shaft coasts, whatever P3 reads: without air it loses more than half in 5 s.
const COASTS_RATIO: f64 = 0.5;
/// Speed below which a shaft is not driven by its turbine, rpm: a hundredth of what such machines reach.
const TURNS_RPM: f64 = 1e3;

/// The command that shuts the air off was acknowledged, and a reading shows that it had no effect.
#[derive(Debug, thiserror::Error)]
#[error(
    "it acknowledged that its air is off, but {channel} read {} before and reads {} after {OBSERVATION_S} s: the air is on, or the sensor is stuck",
    with_unit(format!("{before:.0}"), channel.unit()),
    with_unit(format!("{now:.0}"), channel.unit())
)]
pub struct AirStillOn {
    /// What was read.
    pub channel: Channel,
    /// First reading after the command, in the channel's unit.
    pub before: f64,
    /// Last reading, in the channel's unit.
    pub now: f64,
}

/// Readings of a rig that has acknowledged that its air is off: the first and the last of each.
#[derive(Debug, Default)]
struct AirOff {
    p3_pa: Option<(f64, f64)>,
    p4_pa: Option<(f64, f64)>,
    speed_rpm: Option<(f64, f64)>,
}

impl AirOff {
    fn read(&mut self, batch: &SampleBatch) {
        let read = [
            (Channel::P3, &mut self.p3_pa),
            (Channel::P4, &mut self.p4_pa),
            (Channel::ShaftSpeed, &mut self.speed_rpm),
        ];
        for (channel, ends) in read {
            let quality = batch.provenance_of(channel).map_or(&[][..], |from| &from.quality);
            let values = batch.column(channel).unwrap_or_default().iter().enumerate();
            let good =
                values.filter(|(at, value)| value.is_finite() && quality.get(*at) != Some(&Quality::Bad));
            for (_, value) in good {
                *ends = Some((ends.map_or(*value, |(first, _)| first), *value));
            }
        }
    }

    /// P3 above P4 (or above its lowest running value) drives the turbine. The speed decides where P3 is not read; a shaft that coasts contradicts
    /// a P3 that does not fall.
    fn check(&self, t_s: f64, p3_min_pa: f64) -> Result<(), BackendError> {
        let still_on = |channel: Channel, (before, now)| {
            Err(BackendError::Lost { t_s, source: Box::new(AirStillOn { channel, before, now }) })
        };
        let coasts = self.speed_rpm.is_some_and(|(before, now)| now < COASTS_RATIO * before);
        match (self.p3_pa, self.speed_rpm) {
            (Some((before, now)), _) => {
                let (excess_pa, fall_pa) =
                    (before - self.p4_pa.map_or(p3_min_pa, |(_, p4_pa)| p4_pa), before - now);
                let is_on = excess_pa > MIN_EXCESS_PA && fall_pa < MIN_FALL_RATIO * excess_pa;
                if is_on && !coasts { still_on(Channel::P3, (before, now)) } else { Ok(()) }
            }
            (None, Some((before, now))) if before > TURNS_RPM && now > (1.0 - MIN_FALL_RATIO) * before => {
                still_on(Channel::ShaftSpeed, (before, now))
            }
            _ => Ok(()),
        }
    }
}

/// Contains a panic of an observer, so that the shutdown continues.
pub(crate) fn catch_panic(report: impl FnOnce() -> Result<(), RunError>) -> Result<(), RunError> {
    let panicked =
        |panic: Box<dyn std::any::Any + Send>| Err(RunError::Panicked { message: panic_message(&*panic) });
    catch_unwind(AssertUnwindSafe(report)).unwrap_or_else(panicked)
}

impl Run<'_, '_> {
    /// Makes the rig safe, then reports the reason. It cannot be interrupted and takes a bounded time.
    pub(crate) fn shut_down(&mut self, halt: Halt) -> Result<RunEnding, RunError> {
        // The first command is sent before anything is written: a disk may be slow.
        self.opens_at_once = matches!(&halt, Halt::Tripped(trip) if trip.guard == GuardName::Surge);
        let start = self.begin_run_down();
        // A step that missed its speed does not count, whatever its duration.
        let step_counts = !matches!(&halt, Halt::Tripped(trip) if trip.guard == GuardName::Speed);
        let locks_out = match &halt {
            Halt::Tripped(trip) | Halt::Cut(trip) => trip.reaction == Reaction::Latch,
            Halt::Failed(error) => error.leaves_rig_state_unknown(),
            Halt::Interrupted => false,
        };
        let (end, kind, message) = match halt {
            Halt::Interrupted => (
                Ok(RunEnding::Interrupted { t_s: self.now_s }),
                EventKind::Interrupted,
                "stopped by the operator".to_owned(),
            ),
            Halt::Tripped(trip) | Halt::Cut(trip) => {
                let reason = trip.reason.clone();
                (Ok(RunEnding::Tripped(trip)), EventKind::GuardTripped, reason)
            }
            Halt::Failed(error) => {
                let message = error.to_string();
                (Err(error), EventKind::Note, message)
            }
        };
        // The error that ended the run takes precedence over errors while reporting it.
        let reported = catch_panic(|| {
            if locks_out {
                self.report_lockout(&message)?;
            }
            self.report_reason(step_counts, kind, &message)
        });
        let mut reported = reported;
        let acknowledged = self.run_down(start).and_then(|()| self.cut_air());
        let safe = acknowledged.and_then(|()| self.observe_safe(&mut reported));
        if let Err(error) = &safe {
            let message = format!("the rig did not confirm its safe state: {error}");
            reported = reported.and_then(|()| catch_panic(|| self.report_unconfirmed(message)));
        }
        stated_end(end, safe, message, reported)
    }

    fn report_lockout(&mut self, message: &str) -> Result<(), RunError> {
        let (t_s, kind) = (self.now_s, EventKind::Latched);
        Ok(self.runner.observer.on_lockout(&Event { t_s, kind, message: message.to_owned() })?)
    }

    fn report_reason(&mut self, step_counts: bool, kind: EventKind, message: &str) -> Result<(), RunError> {
        let unreported = self.unreported.take();
        if let Some(batch) = &unreported {
            self.runner.observer.on_batch(batch)?;
        }
        match self.open_step.take() {
            Some(marker) if step_counts => self.runner.observer.on_step_end(&marker)?,
            Some(marker) => self.runner.observer.on_step_abandoned(&marker)?,
            None => {}
        }
        // The rig has reported its own trip in the batch.
        let was_reported = unreported
            .as_ref()
            .is_some_and(|batch| batch.events.iter().any(|event| event.message == message));
        let message = if was_reported { "the run ends, because the rig tripped" } else { message };
        self.runner.observer.on_event(&Event { t_s: self.now_s, kind, message: message.to_owned() })?;
        Ok(self.pass_notes()?)
    }

    fn report_unconfirmed(&mut self, message: String) -> Result<(), RunError> {
        self.report_lockout(&message)?;
        let event = Event { t_s: self.now_s, kind: EventKind::Latched, message };
        Ok(self.runner.observer.on_event(&event)?)
    }

    /// Records how the rig reaches the safe state that it has acknowledged.
    ///
    /// # Errors
    /// The readings show that its air is still on.
    fn observe_safe(&mut self, reported: &mut Result<(), RunError>) -> Result<(), BackendError> {
        let t_s = self.now_s;
        let mut report = |news: &dyn Fn(&mut dyn RunObserver) -> Result<(), ObserverError>,
                          run: &mut Self| {
            if reported.is_ok() {
                *reported = catch_panic(|| Ok(news(run.runner.observer)?));
            }
        };
        let message = "air off, valve open".to_owned();
        let event = Event { t_s, kind: EventKind::SafeState, message };
        report(&|observer| observer.on_event(&event), self);
        let mut air = AirOff::default();
        for second in 1..=OBSERVATION_S {
            self.now_s = t_s + f64::from(second);
            // A rig that has acknowledged and cannot be read any more counts as safe.
            let polled = catch_unwind(AssertUnwindSafe(|| {
                self.runner.clock.wait_until(self.now_s);
                self.runner.backend.poll(self.now_s)
            }));
            let Ok(Ok(batch)) = polled else { break };
            report(&|observer| observer.on_batch(&batch), self);
            air.read(&batch);
        }
        if self.sent.is_some() { air.check(t_s, self.protection.p3_min_pa) } else { Ok(()) }
    }

    /// Setpoints `after_s` into the run-down; `None` if the air is to be cut.
    fn run_down_setpoints(&self, from: &Setpoints, after_s: f64) -> Option<Setpoints> {
        let Protection { safe, p3_min_pa, accepts, stand, .. } = self.protection;
        let next = safe.setpoints(from, after_s, *p3_min_pa, accepts.as_ref())?;
        let Some(StandMotion { actuators, .. }) = stand.filter(|_| !self.opens_at_once) else {
            return Some(next);
        };
        // A valve that opens before P3 has fallen lets the shaft speed up; only a compressor in surge needs it at once.
        let rate_pa_s =
            safe.p3_slew_pa_s.map_or(actuators.p3.rate_per_s, |slew| slew.min(actuators.p3.rate_per_s));
        let fallen_pa = rate_pa_s * (after_s - actuators.p3.dead_time_s - actuators.p3.lag_s);
        let share = (fallen_pa / (from.p3_pa - p3_min_pa).max(1.0)).clamp(0.0, 1.0);
        let opening =
            from.valve_opening_ratio + share * (next.valve_opening_ratio - from.valve_opening_ratio);
        Some(Setpoints { valve_opening_ratio: opening, ..next })
    }

    /// Sends the first command of the run-down. Returns the setpoints from which it starts, or `None` if the air is to be cut at once.
    fn begin_run_down(&mut self) -> Option<Setpoints> {
        let from = self.sent?;
        self.commanded = CommandedState::default();
        let first = self.run_down_setpoints(&from, STEP_S)?;
        let sent = catch_unwind(AssertUnwindSafe(|| self.runner.backend.set(&first)));
        matches!(sent, Ok(Ok(()))).then_some(from)
    }

    /// Lowers P3 step by step. Any failure ends the run-down, and the air is cut at once.
    fn run_down(&mut self, from: Option<Setpoints>) -> Result<(), BackendError> {
        let Some(from) = from else { return Ok(()) };
        let steps = (self.protection.safe.within_s / STEP_S).ceil().clamp(0.0, 1e5) as usize;
        let mut recorded = true;
        for step in 1..=steps {
            let next_s = self.now_s + STEP_S;
            let polled = catch_unwind(AssertUnwindSafe(|| {
                self.runner.clock.wait_until(next_s);
                self.runner.backend.poll(next_s)
            }));
            let Ok(Ok(batch)) = polled else { break };
            self.now_s = next_s;
            recorded = recorded && self.runner.observer.on_batch(&batch).is_ok();
            let Some(next) = self.run_down_setpoints(&from, STEP_S * (step + 1) as f64) else { break };
            let sent = catch_unwind(AssertUnwindSafe(|| self.runner.backend.set(&next)));
            if !matches!(sent, Ok(Ok(()))) {
                break;
            }
        }
        Ok(())
    }

    /// Shuts the air off, with a limited number of retries.
    fn cut_air(&mut self) -> Result<(), BackendError> {
        let mut last = Ok(());
        for attempt in 0..MAX_ATTEMPTS {
            if attempt > 0 {
                self.now_s += PAUSE_S;
                self.runner.clock.wait_until(self.now_s);
            }
            last =
                catch_unwind(AssertUnwindSafe(|| self.runner.backend.make_safe())).unwrap_or_else(|panic| {
                    let source = format!("the backend failed: {}", panic_message(&*panic)).into();
                    Err(BackendError::Lost { t_s: self.now_s, source })
                });
            if last.is_ok() {
                break;
            }
        }
        last
    }
}

/// Interval at which a waiting run checks for a stop, s of run time: half of the 20 ms that a stop may take.
const STOP_CHECK_INTERVAL_S: f64 = 0.01;

impl Runner<'_> {
    /// Connects and arms the rig. A stop request in the meantime is confirmed immediately. No setpoint is sent before the rig is armed, so
    /// after a stop the safe command is the first one. The inner result is that of the confirmation: its failure must not leave an armed rig.
    pub(crate) fn arm(&mut self, protection: &Protection<'_>) -> Result<Result<(), RunError>, RunError> {
        let Runner { backend, observer, stop, .. } = self;
        let stops = || stop.load(Ordering::Relaxed) || protection.stop_after_step.load(Ordering::Relaxed);
        let mut confirmation = None;
        let armed = thread::scope(|scope| {
            let (done, ended) = channel();
            let arming = scope.spawn(move || {
                let armed = backend.arm();
                // The caller waits for it.
                let _ = done.send(());
                armed
            });
            while ended.recv_timeout(Duration::from_secs_f64(STOP_CHECK_INTERVAL_S))
                == Err(RecvTimeoutError::Timeout)
            {
                if confirmation.is_none() && stops() {
                    let message = "stop requested while the rig is being connected: the rig has no setpoint yet and is made safe as \
                                   soon as it is connected"
                        .to_owned();
                    let event = Event { t_s: 0.0, kind: EventKind::Note, message };
                    confirmation = Some(catch_panic(|| Ok(observer.on_event(&event)?)));
                }
            }
            arming.join().unwrap_or_else(|panic| resume_unwind(panic))
        });
        armed.map_err(RunError::NotArmed)?;
        Ok(confirmation.unwrap_or(Ok(())))
    }
}

impl Run<'_, '_> {
    /// Waits for the clock; `false` if a stop came first.
    pub(crate) fn wait_until_or_stop(&mut self, t_s: f64, in_step: bool) -> bool {
        let mut next_check_s = self.now_s + STOP_CHECK_INTERVAL_S;
        while next_check_s < t_s && self.runner.clock.advances_by_itself() {
            self.runner.clock.wait_until(next_check_s);
            if self.is_stop_requested(in_step) {
                return false;
            }
            next_check_s += STOP_CHECK_INTERVAL_S;
        }
        self.runner.clock.wait_until(t_s);
        !self.is_stop_requested(in_step)
    }

    /// Whether a stop was requested that ends the run now: outside a step, also one at the end of the step.
    fn is_stop_requested(&self, in_step: bool) -> bool {
        let with_step = self.protection.stop_after_step.load(Ordering::Relaxed);
        stop_is_due(self.runner.stop.load(Ordering::Relaxed), with_step, in_step)
    }

    /// Checks for a requested stop. Outside a step the run ends immediately. Within a step, one event confirms the request and states the
    /// remaining time, so that the operator knows that the stop was received.
    pub(crate) fn check_for_stop(&mut self, in_step: bool, until_s: f64) -> Result<(), Halt> {
        if self.is_stop_requested(in_step) {
            return Err(Halt::Interrupted);
        }
        if self.protection.stop_after_step.load(Ordering::Relaxed)
            && !std::mem::replace(&mut self.stop_confirmed, true)
        {
            let left_s = until_s - self.now_s;
            let message = format!(
                "stop requested: the run ends with this step, in at most {left_s:.0} s; request it again (Ctrl-C) and the rig is made \
                 safe now"
            );
            self.runner.observer.on_event(&Event { t_s: self.now_s, kind: EventKind::Note, message })?;
        }
        Ok(())
    }
}
