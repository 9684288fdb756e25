//! Closed-loop control of the shaft speed: P3 as planned, plus a correction from the measured speed.
//!
//! **Feed-forward.** The plan's P3 holds the nominal machine at the target. The turbine power missing in the real machine is kept
//! from step to step as a *deficit*, `d = ln(W_nominal(P3) / W_nominal(P3_plan))`. A turbine that is 10 % worse has the same deficit
//! on every speed line, while the pressure that compensates for it differs fourfold. A step starts at
//! `P3 = P3_plan exp(d s)`, `s` = [`SpeedResponse::p3_per_power`].
//!
//! **Feedback.** After the jump's own transient, a PI controller in velocity form adds, once a second,
//! `dP3 = (tau (e - e_before) + e dt) / (lambda K)`: `e` the error of the median speed of that second, `K` and `tau` gain and
//! time constant of the nominal machine, `lambda` the time constant of the closed loop (lambda or IMC tuning; Rivera, Morari
//! and Skogestad, Ind. Eng. Chem. Process Des. Dev. 25 (1986)). The zero cancels the shaft's pole, so that the loop is of first
//! order without overshoot. `lambda` grows with the time since the transient, as the gain of a Kalman filter falls.
//! An initial error is corrected within seconds; later the loop follows the slow housings and suppresses noise.
//!
//! **Limits.** In the velocity form the command itself is the only integral. Clamping the command to its limits and to the rig's
//! rate is therefore sufficient as anti-windup.

use crate::run_control::transition_control::ARRIVED_RATIO;
use mapper_core::{
    Channel, Event, EventKind, OperatingPoint, PlanStep, SampleBatch, SpeedControlSettings, SpeedResponse,
};
use mapper_numerics::statistics::median;
use std::collections::VecDeque;

/// Time constant of the closed loop, s: initial and final.
const LAMBDA_S: (f64, f64) = (2.5, 20.0);
/// Longest measured delay that tunes the loop, s. Bound: half of its slowest time constant.
const MAX_EXTRA_DELAY_S: f64 = 10.0;
/// Ratio of the closed loop's shortest time constant to the delay of P3. Source: Skogestad (2003), twice the delay has a margin of gain of five.
const DELAYS_OF_LAMBDA: f64 = 2.0;
/// Ratio of the closed loop's time constant to the time since the transient.
const LAMBDA_GROWTH: f64 = 0.4;
/// After a jump the loop waits for this number of machine time constants, plus the time that P3 needs at the rig's rate.
const TRANSIENT_TIME_CONSTANTS: f64 = 5.0;
/// Minimum wait, s.
const MIN_TRANSIENT_S: f64 = 2.0;
/// Maximum wait for the speed to settle, s: after that, the loop also controls a machine that never settles.
const MAX_TRANSIENT_S: f64 = 15.0;
/// The transient is over when the relative change of speed per second falls below this.
const MAX_SETTLED_CHANGE_RATIO: f64 = 1e-3;
/// Smallest change of the command that is sent, as a share of the speed band: it saves valve wear.
const MIN_CHANGE_SHARE: f64 = 0.05;
/// Largest deficit in either direction: a larger one indicates another fault, most likely of the speed sensor.
const MAX_DEFICIT: f64 = 0.4;
/// Minimum weight of a step's own deficit in the running average, which averages out the effect of the housings.
const MIN_LEARNING_RATIO: f64 = 0.3;
/// Time at the end of a step over which its speed is judged, s.
const AVERAGING_S: f64 = 10.0;
/// Consecutive seconds beyond the band after which the loop restarts with its fast time constant.
const MAX_SECONDS_OFF: usize = 3;

/// Limits of the control loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedControlLimits {
    /// Lowest P3, Pa.
    pub p3_min_pa: f64,
    /// Highest P3, Pa. It stays below the guard's limit by the sensor's error, so that the guard does not end the run. A step
    /// with a higher planned P3 keeps it.
    pub p3_max_pa: f64,
    /// Maximum rate of P3, Pa/s; `None`: the rig limits it.
    pub p3_slew_max_pa_s: Option<f64>,
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
}

/// Response of the nominal machine at a step; `None` if there is none, and P3 stays as planned.
pub type ResponseAt<'a> = Box<dyn FnMut(&PlanStep) -> Option<SpeedResponse> + 'a>;

/// Controls the shaft speed of a run. Time comes from the samples, so equal samples give equal commands.
pub struct SpeedControl<'a> {
    settings: SpeedControlSettings,
    limits: SpeedControlLimits,
    response_at: ResponseAt<'a>,
    /// Deficit with which steps begin.
    deficit: f64,
    averaged_steps: usize,
    hold: Option<Hold>,
    /// Measured delay of P3 beyond the declared one, s.
    extra_delay_s: f64,
    /// The last command, Pa.
    last_sent_pa: Option<f64>,
}

/// The operating point under control.
#[derive(Debug)]
struct Hold {
    target: OperatingPoint,
    plan_pa: f64,
    response: SpeedResponse,
    start_s: f64,
    /// Earliest end of the transient, s.
    earliest_end_s: f64,
    /// Command of the loop, Pa; it differs from the last command by changes too small to be sent.
    setpoint_pa: f64,
    /// Time at which the loop was closed or restarted, s.
    closed_s: Option<f64>,
    /// Time and speed error of the previous second.
    before: Option<(f64, f64)>,
    /// Consecutive seconds beyond the band.
    seconds_off: usize,
    /// Time and speed of the last seconds.
    recent: VecDeque<(f64, f64)>,
    /// The latest reading of P3, Pa.
    measured_p3_pa: Option<f64>,
    /// Start of saturation at a limit, and whether it was reported.
    saturated: Option<(f64, bool)>,
}

impl Hold {
    fn deficit(&self, p3_pa: f64) -> f64 {
        (p3_pa / self.plan_pa).ln() / self.response.p3_per_power
    }

    fn p3_pa(&self, deficit: f64) -> f64 {
        self.plan_pa * (deficit * self.response.p3_per_power).exp()
    }

    /// Mean speed of the last seconds, rpm.
    fn reached_rpm(&self) -> Option<f64> {
        let count = self.recent.len();
        (count > 0).then(|| self.recent.iter().map(|(_, rpm)| rpm).sum::<f64>() / count as f64)
    }
}

fn transient_s(response: &SpeedResponse) -> f64 {
    (TRANSIENT_TIME_CONSTANTS * response.time_constant_s).clamp(MIN_TRANSIENT_S, MAX_TRANSIENT_S)
}

impl<'a> SpeedControl<'a> {
    /// Creates a controller without a learnt deficit.
    pub fn new(
        settings: SpeedControlSettings,
        limits: SpeedControlLimits,
        response_at: ResponseAt<'a>,
    ) -> Self {
        SpeedControl {
            settings,
            limits,
            response_at,
            deficit: 0.0,
            averaged_steps: 0,
            hold: None,
            extra_delay_s: 0.0,
            last_sent_pa: None,
        }
    }

    /// P3 with which a step begins at `t_s`, Pa. A step at the current point continues with the current command.
    pub fn begin(&mut self, step: &PlanStep, t_s: f64) -> f64 {
        if let Some(hold) = &mut self.hold
            && hold.target.is_same_place(&step.to)
            && hold.plan_pa == step.p3_pa
        {
            hold.recent.clear();
            hold.saturated = None;
            return self.last_sent_pa.unwrap_or(hold.setpoint_pa);
        }
        let Some(response) = (self.response_at)(step) else {
            self.hold = None;
            self.last_sent_pa = Some(step.p3_pa);
            return step.p3_pa;
        };
        let mut hold = Hold {
            target: step.to,
            plan_pa: step.p3_pa,
            response,
            start_s: t_s,
            earliest_end_s: 0.0,
            setpoint_pa: step.p3_pa,
            closed_s: None,
            before: None,
            seconds_off: 0,
            recent: VecDeque::new(),
            measured_p3_pa: None,
            saturated: None,
        };
        // A deficit learnt at other points must not drive the nominal machine beyond the speed limit.
        let room_pa = (self.limits.speed_max_rpm - step.to.speed_rpm).max(0.0) / response.rpm_per_pa;
        hold.setpoint_pa = self.clamp_to_limits(hold.p3_pa(self.deficit).min(step.p3_pa + room_pa), &hold);
        let from_pa = self.last_sent_pa.unwrap_or(hold.setpoint_pa);
        let ramp_s = self
            .limits
            .p3_slew_max_pa_s
            .map_or(0.0, |slew_pa_s| (hold.setpoint_pa - from_pa).abs() / slew_pa_s);
        hold.earliest_end_s = t_s + ramp_s + transient_s(&response);
        let p3_pa = hold.setpoint_pa;
        self.hold = Some(hold);
        self.last_sent_pa = Some(p3_pa);
        p3_pa
    }

    /// Takes a delay of P3 into account that was measured beyond the declared one, s. The longest one stands: a loop that is too slow is
    /// only slow.
    pub fn learn_delay(&mut self, delay_s: f64) {
        self.extra_delay_s = self.extra_delay_s.max(delay_s.min(MAX_EXTRA_DELAY_S));
    }

    /// Response of the nominal machine at the current step.
    pub fn response(&self) -> Option<SpeedResponse> {
        self.hold.as_ref().map(|hold| hold.response)
    }

    /// Continues from a command other than that with which the step began, Pa, sent at `t_s`.
    pub fn continue_from(&mut self, p3_pa: f64, t_s: f64) {
        if let Some(hold) = &mut self.hold {
            hold.setpoint_pa = p3_pa;
        }
        self.last_sent_pa = Some(p3_pa);
        self.restart_wait(t_s);
    }

    /// Restarts the wait for the transient, when the last command of a transition was sent at `t_s`.
    pub fn restart_wait(&mut self, t_s: f64) {
        if let Some(hold) = &mut self.hold {
            hold.start_s = t_s;
            hold.earliest_end_s = t_s + transient_s(&hold.response);
        }
    }

    /// Processes new samples: returns the next P3 to send, Pa, and an event, if any. While P3 still moves towards its command, nothing is
    /// integrated.
    pub fn on_batch(&mut self, batch: &SampleBatch, p3_moves: bool) -> (Option<f64>, Option<Event>) {
        let Some(mut hold) = self.hold.take() else { return (None, None) };
        let event = self.advance(&mut hold, batch, p3_moves);
        let smallest_pa =
            MIN_CHANGE_SHARE * self.settings.band_ratio * hold.target.speed_rpm / hold.response.rpm_per_pa;
        let send = self
            .last_sent_pa
            .is_none_or(|last_sent_pa| (hold.setpoint_pa - last_sent_pa).abs() > smallest_pa);
        let next = send.then_some(hold.setpoint_pa);
        if send {
            self.last_sent_pa = next;
        }
        self.hold = Some(hold);
        (next, event)
    }

    fn advance(&mut self, hold: &mut Hold, batch: &SampleBatch, p3_moves: bool) -> Option<Event> {
        let now_s = *batch.t_s.last()?;
        let speeds = batch.column(Channel::ShaftSpeed)?;
        let speed_rpm = median(speeds.iter().filter(|speed| speed.is_finite()))?;
        let pressures = batch.column(Channel::P3).unwrap_or_default();
        hold.measured_p3_pa =
            median(pressures.iter().filter(|p3_pa| p3_pa.is_finite())).or(hold.measured_p3_pa);
        hold.recent.push_back((now_s, speed_rpm));
        while hold.recent.front().is_some_and(|(t_s, _)| *t_s < now_s - AVERAGING_S) {
            hold.recent.pop_front();
        }
        let error_rpm = hold.target.speed_rpm - speed_rpm;
        let before = hold.before.replace((now_s, error_rpm));
        let (before_s, error_before_rpm) = before?;
        let dt_s = now_s - before_s;
        // A batch without later samples adds nothing.
        if dt_s <= 0.0 {
            return None;
        }
        if p3_moves {
            // The loop begins, or goes on, when the speed has followed the pressure that was commanded last.
            hold.start_s = now_s;
            if let Some(closed_s) = &mut hold.closed_s {
                *closed_s += dt_s;
                // The proportional part sees the whole change of the speed when the loop goes on.
                hold.before = Some((now_s, error_before_rpm));
            }
            return None;
        }
        if hold.closed_s.is_none() {
            let moves = (error_rpm - error_before_rpm).abs()
                > MAX_SETTLED_CHANGE_RATIO * hold.target.speed_rpm * dt_s;
            let is_waiting = now_s - hold.start_s < hold.earliest_end_s - hold.start_s + MAX_TRANSIENT_S;
            if now_s < hold.earliest_end_s || (moves && is_waiting) {
                return None;
            }
            hold.closed_s = Some(now_s - dt_s);
        }
        let beyond = error_rpm.abs() > self.settings.band_ratio * hold.target.speed_rpm;
        hold.seconds_off = if beyond { hold.seconds_off + 1 } else { 0 };
        if hold.seconds_off == MAX_SECONDS_OFF {
            hold.closed_s = Some(now_s - dt_s);
        }
        let closed_for_s = now_s - hold.closed_s.unwrap_or(now_s);
        // A loop that is slower than the delay of P3 does not swing (Skogestad, J. Process Control 13 (2003): lambda of at least the delay).
        let delay_s = hold.response.delay_s + self.extra_delay_s;
        let fastest_s = LAMBDA_S.0.max(DELAYS_OF_LAMBDA * delay_s).min(LAMBDA_S.1);
        let lambda_s = (LAMBDA_GROWTH * closed_for_s).clamp(fastest_s, LAMBDA_S.1);
        let response = &hold.response;
        // After a gap in the samples, the integral counts a limited time only.
        let counted_s = dt_s.min(0.5 * lambda_s);
        let time_constant_s = response.time_constant_s + self.extra_delay_s;
        let change_pa = (time_constant_s * (error_rpm - error_before_rpm) + error_rpm * counted_s)
            / (lambda_s * response.rpm_per_pa);
        let requested_pa = hold.setpoint_pa + change_pa;
        let slew_pa = self.limits.p3_slew_max_pa_s.map_or(f64::INFINITY, |slew_pa_s| slew_pa_s * dt_s);
        let rated_pa = requested_pa.clamp(hold.setpoint_pa - slew_pa, hold.setpoint_pa + slew_pa);
        let allowed_pa = self.clamp_to_limits(rated_pa, hold);
        hold.setpoint_pa = allowed_pa;
        self.report_saturation(hold, now_s, rated_pa)
    }

    /// P3 within the rig's limits and within the largest deficit from the plan, Pa.
    fn clamp_to_limits(&self, p3_pa: f64, hold: &Hold) -> f64 {
        let (low_pa, high_pa) = (hold.p3_pa(-MAX_DEFICIT), hold.p3_pa(MAX_DEFICIT));
        p3_pa
            .clamp(low_pa, high_pa)
            .max(self.limits.p3_min_pa.min(hold.plan_pa))
            .min(self.limits.p3_max_pa.max(hold.plan_pa))
    }

    /// Reports saturation once per step, after some seconds, so that a brief contact with the limit is ignored.
    fn report_saturation(&self, hold: &mut Hold, now_s: f64, requested_pa: f64) -> Option<Event> {
        let speed_rpm = hold.reached_rpm()?;
        if requested_pa == hold.setpoint_pa {
            hold.saturated = hold.saturated.filter(|(_, reported)| *reported);
            return None;
        }
        let (since_s, reported) = hold.saturated.unwrap_or((now_s, false));
        let report = !reported && now_s - since_s >= MAX_SECONDS_OFF as f64;
        hold.saturated = Some((since_s, reported || report));
        report.then(|| Event {
            t_s: now_s,
            kind: EventKind::Note,
            message: format!(
                "speed control: P3 stays at {:.1} kPa, {}; the speed is {:.2} krpm instead of {:.2} krpm",
                hold.setpoint_pa / 1e3,
                self.describe_limit(hold),
                speed_rpm / 1e3,
                hold.target.speed_rpm / 1e3
            ),
        })
    }

    fn describe_limit(&self, hold: &Hold) -> String {
        let p3_pa = hold.setpoint_pa;
        let far = |measured_pa: &f64| (measured_pa - p3_pa).abs() > ARRIVED_RATIO * p3_pa;
        if let Some(measured_pa) = hold.measured_p3_pa.filter(far) {
            format!("and has not arrived: {:.1} kPa measured; check the air supply", measured_pa / 1e3)
        } else if p3_pa >= self.limits.p3_max_pa {
            "its upper limit".to_owned()
        } else if p3_pa <= self.limits.p3_min_pa {
            "its lower limit".to_owned()
        } else {
            format!(
                "the largest correction of turbine power ({:.0} %); check the speed sensor",
                100.0 * MAX_DEFICIT.exp_m1()
            )
        }
    }

    /// Ends a step at `t_s`: updates the deficit, and reports a speed beyond the band.
    pub fn end(&mut self, t_s: f64) -> Option<Event> {
        let hold = self.hold.as_ref()?;
        if hold.closed_s.is_some() {
            let own_deficit = hold.deficit(hold.setpoint_pa);
            self.averaged_steps += 1;
            let weight = (1.0 / self.averaged_steps as f64).max(MIN_LEARNING_RATIO);
            self.deficit += weight * (own_deficit - self.deficit);
        }
        let (requested_rpm, reached_rpm) = (hold.target.speed_rpm, hold.reached_rpm()?);
        let off_ratio = reached_rpm / requested_rpm - 1.0;
        (off_ratio.abs() > self.settings.band_ratio).then(|| Event {
            t_s,
            kind: EventKind::SpeedNotReached,
            message: format!(
                "the speed was not reached: {:.2} krpm requested, {:.2} krpm in the last {AVERAGING_S:.0} s ({:+.2} %, band {:.2} %)",
                requested_rpm / 1e3,
                reached_rpm / 1e3,
                100.0 * off_ratio,
                100.0 * self.settings.band_ratio
            ),
        })
    }
}
