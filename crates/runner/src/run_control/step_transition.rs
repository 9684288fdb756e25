//! The transition of a step: its start and commands, the wait for a P3 that arrives late, and the run-down before the end of a run.

use crate::run_control::observer::ObserverError;
use crate::run_control::run::{Halt, Run};
use crate::run_control::speed_control::SpeedControl;
use crate::run_control::transition_control::{Arrival, StandMotion, TransitionControl};
use mapper_core::{BackendError, Event, EventKind, PlanStep, RigMode, SampleBatch, Setpoints, WindowRule};

/// Longest extension of a step whose P3 has not arrived, s. Bound: five times the stroke of the slowest stands.
const MAX_ARRIVAL_WAIT_S: f64 = 300.0;
/// Shortest run-down of P3 before the safe state, s: a faster P3 falls before the shaft has noticed the valve. Judgement.
const MIN_UNLOAD_S: f64 = 5.0;
/// Lags of P3 in the time of its arrival. Source: ln 100, as for declared actuators.
const LAGS_OF_ARRIVAL: f64 = 4.6;
/// Time within which P3 arrives, relative to the plan. Judgement: the last part of a change is within the noise of its reading.
const EXPECTED_RATIO: f64 = 1.3;
/// Time after which a P3 that neither arrives nor moves is given up, s. Judgement: longer than any dead time.
const STUCK_S: f64 = 10.0;
/// Smallest delay of P3 that is reported, s, and the factor from which a later one is reported again. Judgement.
const MIN_LATE_S: f64 = 3.0;
const LATER_RATIO: f64 = 1.5;
impl Run<'_, '_> {
    /// Lowers P3 at the closed valve before the end of a run on a slow stand: the safe state opens the valve, and the shaft would speed up.
    pub(crate) fn unload(&mut self) -> Result<(), Halt> {
        let (Some(StandMotion { actuators, .. }), Some(sent)) = (self.protection.stand, self.sent) else {
            return Ok(());
        };
        let p3_pa = self.protection.p3_min_pa.min(sent.p3_pa);
        let duration_s = actuators.p3.ramp_s(sent.p3_pa - p3_pa) + actuators.p3.follow_s();
        if sent.mode != RigMode::Running || duration_s < MIN_UNLOAD_S {
            return Ok(());
        }
        self.send(Setpoints { p3_pa, ..sent })?;
        self.run_until(self.now_s + duration_s.min(MAX_ARRIVAL_WAIT_S), false, false)
    }

    /// Starts the way to the setpoints of a step: at once, or on ramps.
    pub(crate) fn start_transition(
        &mut self,
        step: &PlanStep,
        setpoints: Setpoints,
    ) -> Result<(), BackendError> {
        let control = self.protection.stand.zip(self.sent).and_then(|(stand, before)| {
            let shaft = self.runner.speed.as_ref().and_then(SpeedControl::response);
            let rests = !self.p3_motion.is_moving_to(before.p3_pa);
            let p3_pa = self.p3_motion.p3_pa().filter(|_| rests).unwrap_or(before.p3_pa);
            let shaft = (shaft, before.p3_pa - p3_pa);
            TransitionControl::new(&stand, before, setpoints, (step, self.at), shaft, self.now_s)
        });
        self.transition = None;
        self.arrival = self.protection.stand.map(|stand| Arrival {
            start_s: self.now_s,
            planned_s: match step.transition {
                Some(transition) => transition.arrival_s,
                None => stand.actuators.p3.follow_s(),
            },
            extended_s: 0.0,
        });
        let Some(control) = control else { return self.send(setpoints) };
        self.send(control.setpoints())?;
        self.transition = Some(control);
        Ok(())
    }

    /// Sends the next setpoints of a transition. Returns whether it is under way.
    pub(crate) fn advance_transition(
        &mut self,
        batch: &SampleBatch,
        until_s: f64,
    ) -> Result<bool, BackendError> {
        let Some(mut control) = self.transition.take() else { return Ok(false) };
        let was_sent = control.is_sent();
        let p3_moves = self.sent.is_some_and(|sent| self.p3_motion.is_moving_to(sent.p3_pa));
        let next = control.advance(batch, self.now_s, p3_moves);
        if self.now_s < until_s && self.sent != Some(next) {
            self.send(next)?;
        }
        if control.is_sent() && !was_sent {
            // Sensors have to follow from here on.
            if control.is_jump() {
                self.commanded.jumped_s = Some(self.now_s);
            }
            let now_s = self.now_s;
            if let Some(speed) = &mut self.runner.speed {
                speed.restart_wait(now_s);
            }
        }
        let is_complete = control.is_complete(p3_moves);
        if !is_complete {
            self.transition = Some(control);
        } else if !control.is_sent()
            && let Some(speed) = &mut self.runner.speed
        {
            speed.continue_from(next.p3_pa, self.now_s);
        }
        Ok(!is_complete)
    }

    /// Extends a step by `passed_s` while P3 has not arrived although it should have. Returns the extension, s.
    pub(crate) fn wait_for_arrival(&mut self, passed_s: f64) -> Result<f64, ObserverError> {
        let (Some(mut arrival), Some(sent)) = (self.arrival.take(), self.sent) else { return Ok(0.0) };
        let since_s = self.now_s - arrival.start_s;
        let late_s = since_s - (EXPECTED_RATIO * arrival.planned_s).max(WindowRule::EARLIEST_S);
        let is_under_way = self.transition.is_some() || self.p3_motion.is_moving_to(sent.p3_pa);
        let has_arrived = !is_under_way && self.p3_motion.has_arrived(sent.p3_pa);
        if late_s < 0.0 && !has_arrived {
            self.arrival = Some(arrival);
            return Ok(0.0);
        }
        let gives_up = arrival.extended_s >= MAX_ARRIVAL_WAIT_S || (!is_under_way && late_s > STUCK_S);
        if has_arrived || gives_up {
            if let Some(speed) = &mut self.runner.speed {
                // The change beyond the declared motion is that of a longer lag.
                speed.learn_delay((since_s - arrival.planned_s).max(0.0) / LAGS_OF_ARRIVAL);
            }
            self.report_arrival(&sent, since_s, arrival.planned_s, has_arrived)?;
            return Ok(0.0);
        }
        arrival.extended_s += passed_s;
        self.arrival = Some(arrival);
        Ok(passed_s)
    }

    /// Reports a P3 that arrives clearly later than planned, or not at all.
    fn report_arrival(
        &mut self,
        sent: &Setpoints,
        since_s: f64,
        planned_s: f64,
        has_arrived: bool,
    ) -> Result<(), ObserverError> {
        let late_s = since_s - (EXPECTED_RATIO * planned_s).max(WindowRule::EARLIEST_S);
        if late_s < MIN_LATE_S || late_s < LATER_RATIO * self.reported_late_s {
            return Ok(());
        }
        self.reported_late_s = late_s;
        let command_kpa = sent.p3_pa / 1e3;
        let message = match (has_arrived, self.p3_motion.p3_pa()) {
            (false, Some(p3_pa)) => format!(
                "P3 has not arrived: {command_kpa:.1} kPa commanded, {:.1} kPa measured {since_s:.0} s after the start of the step; check \
                 the air supply",
                p3_pa / 1e3
            ),
            _ => format!(
                "P3 arrived at {command_kpa:.1} kPa {since_s:.0} s after the start of the step, {planned_s:.0} s planned: the stand is slower \
                 than declared, and the step lasts longer; write its lag and rate in `rig.actuators.turbine_inlet_pressure`"
            ),
        };
        self.runner.observer.on_event(&Event { t_s: self.now_s, kind: EventKind::Note, message })
    }
}
