//! Control of a transition: the ramps of P3 and valve, held back by what the stand really does.
//!
//! The plan's ramps assume the declared actuators. A stand that is slower than declared is recognised from its readings: when P3 falls, the valve
//! moves no further than the measured P3 has fallen, and closes no further than the shaft has slowed. When P3 rises, it rises no further than
//! to the pressure at which the shaft, as it accelerates now, comes to rest at the higher target.

use mapper_core::{
    AvoidedSpeeds, Channel, OperatingPoint, PlanStep, Ramp, Ramps, RigActuators, RigMode, SampleBatch,
    Setpoints, SpeedResponse, is_commanded_jump,
};
use std::collections::VecDeque;

/// The stand, as far as transitions need it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandMotion {
    /// Motion of its actuators.
    pub actuators: RigActuators,
    /// Largest overshoot of the shaft speed over the higher target, ratio.
    pub overshoot_ratio: f64,
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
    /// Speeds at which the shaft must not stay.
    pub avoid: AvoidedSpeeds,
}

/// Time constant of a shaft for ramps without a plan, s. Judgement: turbochargers of passenger cars take half a second to two.
const USUAL_SHAFT_S: f64 = 1.5;
/// Relative change of its speed per relative change of P3. Judgement: one at high speeds to three at low ones.
const USUAL_SENSITIVITY: f64 = 1.5;
/// Change of the speed, relative, above which the valve waits for the shaft. Judgement: below, the reading is not clearly above its noise.
const MIN_SPEED_CHANGE_RATIO: f64 = 0.03;
/// Share of the allowed overshoot up to which P3 may rise. Judgement: the rest is for the error of the acceleration.
const HOLD_OVERSHOOT_SHARE: f64 = 0.25;
/// Distance of that from the limit of speed, and at which the speed alone holds P3, relative. Judgement: twice the change of a fast shaft in one
/// interval.
const LIMIT_DISTANCE_RATIO: f64 = 0.01;
/// Range of the time over which the acceleration is measured, s: the shaft's time constant. Judgement: noise is below a tenth of a per cent of the speed.
const ACCELERATION_S: (f64, f64) = (0.2, 1.0);
/// Longest search for a pressure at which the shaft keeps its speed, s. Judgement: half of a usual step.
const MAX_SEARCH_S: f64 = 20.0;
/// Time after the ramps in which the shaft may overshoot, s. Judgement: three time constants of a usual shaft.
const WATCH_S: f64 = 4.0;
/// Time after the expected arrival of P3 at which its rest is judged, s. Judgement: the time over which its motion is measured.
const REST_S: f64 = 5.0;
/// Relative change of the speed per second below which the shaft rests. Judgement: four standard deviations of a usual sensor.
const RESTING_PER_S: f64 = 5e-3;
/// Number of commands of a transition, and bounds of their interval, s. Judgement: finer than the steps that a shaft notices; a controller accepts
/// ten commands a second.
const COMMANDS: f64 = 40.0;
const INTERVAL_S: (f64, f64) = (0.1, 1.0);
/// Longest time that the valve waits for P3 and shaft, s. Bound: a shaft that has not slowed by then does not follow P3.
const MAX_WAIT_S: f64 = 300.0;

#[derive(Debug, Clone)]
pub(crate) struct TransitionControl {
    stand: StandMotion,
    from: Setpoints,
    to: Setpoints,
    ramps: Ramps,
    start_s: f64,
    now_s: f64,
    p3_share: f64,
    valve_share: f64,
    /// Speeds of the targets before and after, rpm.
    targets_rpm: (f64, f64),
    /// The first reading, as in `recent`.
    first: Option<(f64, f64, f64)>,
    /// How the shaft follows P3 at the target, without the delay of P3: change of the speed, rpm/Pa, and time constant, s.
    shaft: Option<(f64, f64)>,
    /// Command minus reading of P3 at rest, Pa.
    p3_offset_pa: f64,
    /// Times, s, speeds, rpm, and readings of P3, Pa, over which the acceleration is measured.
    recent: VecDeque<(f64, f64, f64)>,
    /// Whether P3 and shaft have come to rest.
    leader_rests: bool,
    /// Time since which the shaft rests above its target, s.
    too_fast_since_s: Option<f64>,
    /// Time of the last change of P3's command, s.
    p3_changed_s: f64,
}

impl TransitionControl {
    /// The transition to `to`, the setpoints of `step`, on its planned ramps if it starts at `at`, the current point. `None` if nothing changes, or
    /// if the machine does not run.
    pub(crate) fn new(
        stand: &StandMotion,
        from: Setpoints,
        to: Setpoints,
        (step, at): (&PlanStep, Option<OperatingPoint>),
        (shaft, p3_offset_pa): (Option<SpeedResponse>, f64),
        now_s: f64,
    ) -> Option<Self> {
        let is_same = from.p3_pa == to.p3_pa && from.valve_opening_ratio == to.valve_opening_ratio;
        if is_same || from.mode != RigMode::Running || to.mode != RigMode::Running {
            return None;
        }
        let starts_here = |from: OperatingPoint| at.is_some_and(|at| at.is_same_place(&from));
        let planned = step.transition.filter(|_| step.from.is_some_and(starts_here));
        let (p3_change_pa, opening_change_ratio) =
            (to.p3_pa - from.p3_pa, to.valve_opening_ratio - from.valve_opening_ratio);
        let ramps = planned.map_or_else(
            || Ramps::overlapping(p3_change_pa, opening_change_ratio, USUAL_SHAFT_S, &stand.actuators),
            |transition| transition.ramps,
        );
        // The control of the speed may have changed P3 by more than planned.
        let p3_s = stand.actuators.p3.ramp_s(p3_change_pa).max(ramps.p3.duration_s);
        let ramps = Ramps { p3: Ramp { duration_s: p3_s, ..ramps.p3 }, ..ramps };
        let target_rpm = step.to.speed_rpm;
        Some(TransitionControl {
            stand: *stand,
            from,
            to,
            ramps,
            start_s: now_s,
            now_s,
            p3_share: 0.0,
            valve_share: 0.0,
            targets_rpm: (at.map_or(target_rpm, |at| at.speed_rpm), target_rpm),
            first: None,
            shaft: shaft.map(|of| (of.rpm_per_pa, (of.time_constant_s - stand.actuators.p3.lag_s).max(0.0))),
            p3_offset_pa,
            recent: VecDeque::new(),
            leader_rests: false,
            too_fast_since_s: None,
            p3_changed_s: now_s,
        })
    }

    /// Interval of the commands, s: a multiple of the shortest, so that samples at 10 Hz show when each was sent.
    pub(crate) fn interval_s(&self) -> f64 {
        if self.is_sent() && self.now_s - self.start_s > self.ramps.end_s() + WATCH_S {
            // P3 only arrives.
            return INTERVAL_S.1;
        }
        let interval_s = (self.ramps.end_s() / COMMANDS).clamp(INTERVAL_S.0, INTERVAL_S.1);
        INTERVAL_S.0 * (interval_s / INTERVAL_S.0).round()
    }

    /// Whether the transition as a whole is a jump.
    pub(crate) fn is_jump(&self) -> bool {
        let commands = |setpoints: &Setpoints| (setpoints.p3_pa, setpoints.valve_opening_ratio);
        is_commanded_jump(commands(&self.from), commands(&self.to))
    }

    /// Whether P3 and valve have their last commands.
    pub(crate) fn is_sent(&self) -> bool {
        self.p3_share >= 1.0 && self.valve_share >= 1.0
    }

    /// Whether the valve has its last command, and P3 has its own and has arrived. The control of the speed goes on where P3 would hold the shaft
    /// above its target, or has not found a pressure that does not.
    pub(crate) fn is_complete(&self, p3_moves: bool) -> bool {
        let rises = self.to.p3_pa > self.from.p3_pa;
        let since_s = self.now_s - self.start_s;
        let watched_s = self.ramps.end_s() + if rises { WATCH_S } else { 0.0 };
        let is_found = match self.p3_share >= 1.0 {
            true => {
                let watched_s = self.p3_changed_s + WATCH_S + self.stand.actuators.p3.dead_time_s;
                self.now_s >= watched_s && !(p3_moves && since_s < MAX_WAIT_S)
            }
            false => {
                let stays_too_fast = self.too_fast_since_s.is_some_and(|from_s| self.now_s - from_s > REST_S);
                stays_too_fast || since_s > watched_s + MAX_SEARCH_S
            }
        };
        let is_found = !rises || is_found;
        self.valve_share >= 1.0 && since_s >= watched_s && is_found
    }

    pub(crate) fn setpoints(&self) -> Setpoints {
        let between = |from: f64, to: f64, share: f64| match share >= 1.0 {
            true => to,
            false => from + share * (to - from),
        };
        Setpoints {
            p3_pa: between(self.from.p3_pa, self.to.p3_pa, self.p3_share),
            valve_opening_ratio: between(
                self.from.valve_opening_ratio,
                self.to.valve_opening_ratio,
                self.valve_share,
            ),
            ..self.to
        }
    }

    /// Advances to `now_s`, the end of a batch of samples, and returns the next setpoints. `p3_moves`: whether P3 still follows its command.
    pub(crate) fn advance(&mut self, batch: &SampleBatch, now_s: f64, p3_moves: bool) -> Setpoints {
        let column = |channel: Channel| batch.column(channel).unwrap_or_default().iter().copied();
        let rows = batch.t_s.iter().copied().zip(column(Channel::ShaftSpeed)).zip(column(Channel::P3));
        let rows = rows.map(|((t_s, rpm), p3_pa)| (t_s, rpm, p3_pa));
        self.recent.extend(rows.filter(|(_, rpm, p3_pa)| rpm.is_finite() && p3_pa.is_finite()));
        self.first = self.first.or(self.recent.front().copied());
        let span_s = self.shaft.map_or(0.0, |(_, time_s)| time_s);
        let span_s = span_s.clamp(ACCELERATION_S.0, ACCELERATION_S.1);
        while self.recent.front().is_some_and(|(t_s, ..)| *t_s < now_s - span_s) {
            self.recent.pop_front();
        }
        let step_s = (now_s - self.now_s).max(0.0);
        self.now_s = now_s;
        self.leader_rests = self.find_rest(p3_moves);
        let is_too_fast =
            self.speed_and_rate().is_some_and(|speed| speed.0 > self.targets_rpm.1 && is_resting(speed));
        self.too_fast_since_s = is_too_fast.then(|| self.too_fast_since_s.unwrap_or(now_s));
        let share_before = self.p3_share;
        self.advance_p3(step_s);
        if self.p3_share != share_before {
            self.p3_changed_s = now_s;
        }
        self.advance_valve(step_s);
        self.setpoints()
    }

    fn advance_p3(&mut self, step_s: f64) {
        let planned = self.ramps.p3.share(self.now_s - self.start_s);
        let ramp_s = self.ramps.p3.duration_s;
        if self.to.p3_pa <= self.from.p3_pa || ramp_s <= 0.0 {
            self.p3_share = planned;
            return;
        }
        let change_pa = self.to.p3_pa - self.from.p3_pa;
        let allowed = self.highest_p3_pa().map_or(1.0, |p3_pa| (p3_pa - self.from.p3_pa) / change_pa);
        // After a hold P3 goes on at the rate of its ramp.
        let most = self.p3_share + step_s / ramp_s;
        self.p3_share = planned.min(most).min(allowed).max(0.0);
    }

    /// The command of P3 with which the shaft comes to rest at its limit: the pressure now, less what its speed and acceleration are above. It holds for
    /// the opening that the valve has now, however late the air is.
    fn highest_p3_pa(&self) -> Option<f64> {
        let (speed_rpm, rate_rpm_s) = self.speed_and_rate()?;
        let p3_pa = mean(self.recent.iter().map(|(.., p3_pa)| *p3_pa))?;
        let usual = || {
            // Without a model of the shaft, only one that is close to its limit holds P3.
            let is_close = speed_rpm > self.limit_rpm() * (1.0 - LIMIT_DISTANCE_RATIO);
            is_close.then_some((USUAL_SENSITIVITY * speed_rpm / p3_pa, 0.0))
        };
        let (rpm_per_pa, time_s) = self.shaft.or_else(usual)?;
        let rest_rpm = speed_rpm + time_s * rate_rpm_s;
        Some(p3_pa + self.p3_offset_pa + (self.limit_rpm() - rest_rpm) / rpm_per_pa)
    }

    /// Speed above which P3 stops rising, rpm.
    fn limit_rpm(&self) -> f64 {
        let highest_rpm = self.targets_rpm.0.max(self.targets_rpm.1);
        let overshoot_rpm = highest_rpm * (1.0 + HOLD_OVERSHOOT_SHARE * self.stand.overshoot_ratio);
        overshoot_rpm.min(self.stand.speed_max_rpm * (1.0 - LIMIT_DISTANCE_RATIO)).max(highest_rpm)
    }

    /// The mean speed over the last samples, rpm, and its rate by their regression, rpm/s.
    fn speed_and_rate(&self) -> Option<(f64, f64)> {
        let mean_s = mean(self.recent.iter().map(|(t_s, ..)| *t_s))?;
        let mean_rpm = mean(self.recent.iter().map(|(_, rpm, _)| *rpm))?;
        let (along, square) = self.recent.iter().fold((0.0, 0.0), |(along, square), (t_s, rpm, _)| {
            (along + (t_s - mean_s) * (rpm - mean_rpm), square + (t_s - mean_s).powi(2))
        });
        Some((mean_rpm, if square > 0.0 { along / square } else { 0.0 }))
    }

    fn advance_valve(&mut self, step_s: f64) {
        let since_s = self.now_s - self.start_s;
        let planned = self.ramps.valve.share(since_s);
        let allowed = if since_s > MAX_WAIT_S { 1.0 } else { self.leader_share() + Ramps::AHEAD_SHARE };
        // After a wait the valve goes on at the rate of its ramp.
        let most = match self.ramps.valve.duration_s > 0.0 {
            true => self.valve_share + step_s / self.ramps.valve.duration_s,
            false => 1.0,
        };
        self.valve_share = planned.min(allowed).min(most).clamp(self.valve_share, 1.0);
    }

    /// Share that P3 and shaft have really completed, if they lead; otherwise 1.
    fn leader_share(&self) -> f64 {
        if !Ramps::valve_waits(self.from.p3_pa, self.to.p3_pa) || self.leader_rests {
            return 1.0;
        }
        // From the readings at the start, which need not be at the last commands.
        let (Some(first), Some(latest)) = (self.first, self.recent.back()) else { return 1.0 };
        let share = |first: f64, latest: f64, end: f64| {
            if first > end { (first - latest) / (first - end) } else { 1.0 }
        };
        let p3_share = share(first.2, latest.2, self.to.p3_pa);
        let closes = self.to.valve_opening_ratio < self.from.valve_opening_ratio;
        let slows = self.targets_rpm.1 < first.1 * (1.0 - MIN_SPEED_CHANGE_RATIO);
        let speed_share = if closes && slows { share(first.1, latest.1, self.targets_rpm.1) } else { 1.0 };
        p3_share.min(speed_share).max(0.0)
    }

    /// Whether P3 and shaft have come to rest after the last command of P3, wherever their readings are.
    fn find_rest(&self, p3_moves: bool) -> bool {
        let follow_s = self.stand.actuators.p3.follow_s() + REST_S;
        let is_late = self.now_s - self.start_s > self.ramps.p3.end_s() + follow_s;
        is_late && !p3_moves && self.speed_and_rate().is_none_or(is_resting)
    }
}

/// Whether a shaft at this speed, rpm, and rate, rpm/s, has come to rest.
fn is_resting((now_rpm, rate_rpm_s): (f64, f64)) -> bool {
    rate_rpm_s.abs() < RESTING_PER_S * now_rpm
}

pub(crate) struct Arrival {
    pub(crate) start_s: f64,
    /// Time after the start by which the plan expects it, s.
    pub(crate) planned_s: f64,
    pub(crate) extended_s: f64,
}

/// Time over which the motion of P3 is judged, s. Judgement: longer than its noise, shorter than a slow stand's lag.
const MOTION_S: f64 = 5.0;
/// Relative change of P3 per second above which it still moves. Judgement: twice what a speed loop changes in a settled step.
const MOVING_PER_S: f64 = 4e-4;
/// Relative distance of P3 from its command within which it has arrived. Judgement: offsets of sensors and losses of pipes are below.
pub(crate) const ARRIVED_RATIO: f64 = 0.02;

/// Watches whether the measured P3 follows its command.
#[derive(Debug, Clone, Default)]
pub(crate) struct PressureMotion {
    recent: Vec<(f64, f64)>,
}

impl PressureMotion {
    pub(crate) fn add(&mut self, batch: &SampleBatch) {
        let Some(values) = batch.column(Channel::P3) else { return };
        let rows = batch.t_s.iter().copied().zip(values.iter().copied());
        self.recent.extend(rows.filter(|(_, p3_pa)| p3_pa.is_finite()));
        let Some((last_s, _)) = self.recent.last().copied() else { return };
        self.recent.retain(|(t_s, _)| *t_s >= last_s - MOTION_S);
    }

    /// The measured P3, mean of the last second, Pa.
    pub(crate) fn p3_pa(&self) -> Option<f64> {
        let (last_s, _) = self.recent.last()?;
        mean(self.recent.iter().filter(|(t_s, _)| *t_s > last_s - 1.0).map(|(_, p3_pa)| *p3_pa))
    }

    /// Whether P3 moves towards `command_pa`: its rate is that of a stand which follows.
    pub(crate) fn is_moving_to(&self, command_pa: f64) -> bool {
        let (Some((first_s, _)), Some((last_s, _))) = (self.recent.first(), self.recent.last()) else {
            return false;
        };
        let (span_s, middle_s) = (last_s - first_s, 0.5 * (first_s + last_s));
        let half = |late: bool| {
            mean(self.recent.iter().filter(|(t_s, _)| (*t_s > middle_s) == late).map(|(_, p3_pa)| *p3_pa))
        };
        let (Some(before_pa), Some(after_pa)) = (half(false), half(true)) else { return false };
        let rate_per_s = (after_pa - before_pa) / (0.5 * span_s * after_pa);
        span_s > 0.5 * MOTION_S
            && rate_per_s.abs() > MOVING_PER_S
            && (command_pa - after_pa).signum() == rate_per_s.signum()
    }

    /// Whether P3 is at `command_pa`; true without readings.
    pub(crate) fn has_arrived(&self, command_pa: f64) -> bool {
        self.p3_pa().is_none_or(|p3_pa| (p3_pa - command_pa).abs() < ARRIVED_RATIO * command_pa)
    }
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value));
    (count > 0.0).then(|| sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{ChannelColumn, Predicted, StepKind};

    fn setpoints(p3_pa: f64, valve_opening_ratio: f64) -> Setpoints {
        Setpoints {
            mode: RigMode::Running,
            p3_pa,
            t3_k: 773.15,
            valve_opening_ratio,
            oil_temperature_k: 323.15,
        }
    }

    fn step(from: OperatingPoint, to: OperatingPoint, p3_pa: f64) -> PlanStep {
        PlanStep {
            index: 1,
            kind: StepKind::Point,
            from: Some(from),
            to,
            p3_pa,
            t3_k: 773.15,
            oil_temperature_k: 323.15,
            dwell_s: 60.0,
            start_s: 0.0,
            transition: None,
            predicted: Predicted::settled(0.05, 1.5, 350.0, 60.0),
        }
    }

    const FAST: StandMotion = StandMotion {
        actuators: RigActuators::FAST_VALVE,
        overshoot_ratio: 0.02,
        speed_max_rpm: 170e3,
        avoid: AvoidedSpeeds::NONE,
    };

    /// Readings of a tenth of a second.
    fn batch(t_s: f64, p3_pa: f64, speed_rpm: f64) -> SampleBatch {
        let column = |channel, value| ChannelColumn { channel, values: vec![value] };
        let columns = vec![column(Channel::P3, p3_pa), column(Channel::ShaftSpeed, speed_rpm)];
        SampleBatch { t_s: vec![t_s], columns, ..SampleBatch::default() }
    }

    /// Unloading on a stand with a lag of 5 s that declares a fast one: at any time the valve has opened no further than P3 has fallen.
    #[test]
    fn the_valve_waits_for_the_pressure_that_is_measured() {
        let point = |speed_rpm, valve_opening_ratio| OperatingPoint { speed_rpm, valve_opening_ratio };
        let (from, to) = (point(150e3, 0.5), point(50e3, 2.5));
        let (start, end) = (setpoints(300e3, 0.5), setpoints(130e3, 2.5));
        let plan = step(from, to, 130e3);
        let mut control =
            TransitionControl::new(&FAST, start, end, (&plan, Some(from)), (None, 0.0), 0.0).unwrap();
        let (mut p3_pa, mut complete_s) = (300e3, f64::INFINITY);
        for tick in 1..=600 {
            let t_s = 0.1 * f64::from(tick);
            let sent = control.advance(&batch(t_s, p3_pa, 150e3), t_s, true);
            let (fallen, opened) = ((300e3 - p3_pa) / 170e3, (sent.valve_opening_ratio - 0.5) / 2.0);
            assert!(opened <= fallen + Ramps::AHEAD_SHARE + 1e-9, "{t_s} s: {opened} of {fallen}");
            if control.is_complete(false) {
                complete_s = complete_s.min(t_s);
            }
            p3_pa += 0.1 / 5.0 * (sent.p3_pa - p3_pa);
        }
        // ln(1 / 0.03) lags.
        assert!((15.0..25.0).contains(&complete_s), "{complete_s}");
        assert_eq!(control.setpoints(), end);
    }

    /// Loading with a valve that does not close: P3 stops before the shaft overshoots much, although the model of the shaft is not its own.
    #[test]
    fn p3_does_not_rise_while_the_shaft_is_too_fast() {
        let point = |speed_rpm, valve_opening_ratio| OperatingPoint { speed_rpm, valve_opening_ratio };
        let (from, to) = (point(100e3, 2.5), point(150e3, 0.5));
        let (start, end) = (setpoints(160e3, 2.5), setpoints(300e3, 0.5));
        let plan = step(from, to, 300e3);
        let shaft = SpeedResponse { rpm_per_pa: 0.5, p3_per_power: 1.0, time_constant_s: 1.3, delay_s: 0.3 };
        let mut control =
            TransitionControl::new(&FAST, start, end, (&plan, Some(from)), (Some(shaft), 0.0), 0.0).unwrap();
        let (mut speed_rpm, mut highest_rpm) = (100e3, 0.0f64);
        let mut sent = start;
        for tick in 1..=200 {
            let t_s = 0.1 * f64::from(tick);
            // The shaft follows P3 within a second, to 200 krpm at 300 kPa.
            let target_rpm = 100e3 + 100e3 * (sent.p3_pa - 160e3) / 140e3;
            speed_rpm += 0.1 * (target_rpm - speed_rpm);
            highest_rpm = highest_rpm.max(speed_rpm);
            sent = control.advance(&batch(t_s, sent.p3_pa, speed_rpm), t_s, true);
        }
        assert!(highest_rpm < 160e3, "{highest_rpm}");
        assert!(speed_rpm < 1.01 * 150e3 && sent.p3_pa < 300e3, "{speed_rpm} {}", sent.p3_pa);
    }

    #[test]
    fn a_pressure_that_follows_is_moving_until_it_has_arrived() {
        let mut motion = PressureMotion::default();
        let mut arrived_s = f64::INFINITY;
        for tick in 1..=600 {
            let t_s = 0.1 * f64::from(tick);
            let p3_pa = 200e3 - 50e3 * (-t_s / 5.0).exp();
            motion.add(&batch(t_s, p3_pa, 1e5));
            if motion.has_arrived(200e3) && !motion.is_moving_to(200e3) && t_s > MOTION_S {
                arrived_s = arrived_s.min(t_s);
            }
        }
        // 50 kPa/5 s exp(-t/5) falls below 80 Pa/s, about 2.5 s late.
        assert!((22.0..32.0).contains(&arrived_s), "{arrived_s}");
    }
}
