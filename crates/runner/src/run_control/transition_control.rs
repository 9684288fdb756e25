//! Control of a transition: the ramps of P3 and valve, held back by what the stand really does.
//!
//! The plan's ramps assume the declared actuators. A stand that is slower than declared is recognised from its readings: when P3 falls, the valve
//! moves no further than the measured P3 has fallen, and closes no further than the shaft has slowed. When P3 rises, it stops rising while
//! the shaft is above the higher target.

use mapper_core::{
    Channel, OperatingPoint, PlanStep, Ramp, Ramps, RigActuators, RigMode, SampleBatch, Setpoints, is_commanded_jump,
};

/// The stand, as far as transitions need it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StandMotion {
    /// Motion of its actuators.
    pub actuators: RigActuators,
    /// Largest overshoot of the shaft speed over the higher target, ratio.
    pub overshoot_ratio: f64,
    /// Highest shaft speed, rpm.
    pub speed_max_rpm: f64,
}

/// Time constant of a shaft for ramps without a plan, s. Judgement: turbochargers of passenger cars take half a second to two.
const USUAL_SHAFT_S: f64 = 1.5;
/// Share of a change by which a follower may be ahead of the measured leader: the leader need not arrive exactly. Judgement.
const AHEAD_SHARE: f64 = 0.03;
/// Change of the speed, relative, above which the valve waits for the shaft. Judgement: below, the reading is not clearly above its noise.
const MIN_SPEED_CHANGE_RATIO: f64 = 0.03;
/// Change of P3, relative, above which the valve waits for it. Judgement: as above.
const MIN_P3_CHANGE_RATIO: f64 = 0.02;
/// Share of the allowed overshoot at which P3 stops rising. Judgement: the other half is for the delay of the shaft.
const HOLD_OVERSHOOT_SHARE: f64 = 0.25;
/// Distance from the limit of speed at which P3 stops rising, relative. Judgement: twice the change of a fast shaft in one interval.
const LIMIT_DISTANCE_RATIO: f64 = 0.01;
/// Number of commands of a transition, and bounds of their interval, s. Judgement: finer than the steps that a shaft notices; a controller accepts
/// ten commands a second.
const COMMANDS: f64 = 40.0;
const INTERVAL_S: (f64, f64) = (0.1, 1.0);
/// Longest time that the valve waits for P3 and shaft, s. Bound: a shaft that has not slowed by then does not follow P3.
const MAX_WAIT_S: f64 = 300.0;

/// A transition under way.
#[derive(Debug, Clone)]
pub(crate) struct TransitionControl {
    stand: StandMotion,
    from: Setpoints,
    to: Setpoints,
    ramps: Ramps,
    start_s: f64,
    now_s: f64,
    /// Time that the ramp of P3 was held, s.
    p3_held_s: f64,
    p3_share: f64,
    valve_share: f64,
    /// Speeds of the targets before and after, rpm.
    targets_rpm: (f64, f64),
    /// Readings of P3, Pa, and speed, rpm, at the start.
    first: (Option<f64>, Option<f64>),
    latest: (Option<f64>, Option<f64>),
}

impl TransitionControl {
    /// The transition to `to`, the setpoints of `step`, on its planned ramps if it starts at `at`, the current point. `None` if nothing changes, or
    /// if the machine does not run.
    pub(crate) fn new(
        stand: StandMotion,
        from: Setpoints,
        to: Setpoints,
        (step, at): (&PlanStep, Option<OperatingPoint>),
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
            stand,
            from,
            to,
            ramps,
            start_s: now_s,
            now_s,
            p3_held_s: 0.0,
            p3_share: 0.0,
            valve_share: 0.0,
            targets_rpm: (at.map_or(target_rpm, |at| at.speed_rpm), target_rpm),
            first: (None, None),
            latest: (None, None),
        })
    }

    /// Interval of the commands, s.
    pub(crate) fn interval_s(&self) -> f64 {
        (self.ramps.end_s() / COMMANDS).clamp(INTERVAL_S.0, INTERVAL_S.1)
    }

    /// Whether the transition as a whole is a jump.
    pub(crate) fn is_jump(&self) -> bool {
        let commands = |setpoints: &Setpoints| (setpoints.p3_pa, setpoints.valve_opening_ratio);
        is_commanded_jump(commands(&self.from), commands(&self.to))
    }

    /// Whether all commands have been sent.
    pub(crate) fn is_complete(&self) -> bool {
        self.p3_share >= 1.0 && self.valve_share >= 1.0
    }

    /// The setpoints at the latest time.
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

    /// Advances to `now_s`, the end of a batch of samples, and returns the next setpoints.
    pub(crate) fn advance(&mut self, batch: &SampleBatch, now_s: f64) -> Setpoints {
        let last = |channel: Channel| {
            batch.column(channel).and_then(|values| values.iter().rev().copied().find(|value| value.is_finite()))
        };
        let (p3_pa, speed_rpm) = (last(Channel::P3), last(Channel::ShaftSpeed));
        self.latest = (p3_pa.or(self.latest.0), speed_rpm.or(self.latest.1));
        self.first = (self.first.0.or(p3_pa), self.first.1.or(speed_rpm));
        let step_s = (now_s - self.now_s).max(0.0);
        self.now_s = now_s;
        self.advance_p3(step_s);
        self.advance_valve(step_s);
        self.setpoints()
    }

    fn advance_p3(&mut self, step_s: f64) {
        let rises = self.to.p3_pa > self.from.p3_pa;
        let limit_rpm = (self.targets_rpm.0.max(self.targets_rpm.1)
            * (1.0 + HOLD_OVERSHOOT_SHARE * self.stand.overshoot_ratio))
            .min(self.stand.speed_max_rpm * (1.0 - LIMIT_DISTANCE_RATIO));
        let limit_rpm = limit_rpm.max(self.targets_rpm.1);
        if rises && self.latest.1.is_some_and(|speed_rpm| speed_rpm > limit_rpm) && self.valve_share < 1.0 {
            // The valve has not arrived yet: P3 goes back at the rate at which it came.
            self.p3_held_s += 2.0 * step_s;
        }
        let since_s = self.now_s - self.start_s - self.p3_held_s;
        self.p3_share = self.ramps.p3.share(since_s);
    }

    fn advance_valve(&mut self, step_s: f64) {
        let since_s = self.now_s - self.start_s;
        let planned = self.ramps.valve.share(since_s);
        let allowed = if since_s > MAX_WAIT_S { 1.0 } else { self.leader_share() + AHEAD_SHARE };
        // After a wait the valve goes on at the rate of its ramp.
        let most = match self.ramps.valve.duration_s > 0.0 {
            true => self.valve_share + step_s / self.ramps.valve.duration_s,
            false => 1.0,
        };
        self.valve_share = planned.min(allowed).min(most).clamp(self.valve_share, 1.0);
    }

    /// Share that P3 and shaft have really completed, if they lead; otherwise 1.
    fn leader_share(&self) -> f64 {
        let share = |first: f64, latest: f64, change: f64| (latest - first) / change;
        let p3_change_pa = self.to.p3_pa - self.from.p3_pa;
        if p3_change_pa >= -MIN_P3_CHANGE_RATIO * self.from.p3_pa {
            return 1.0;
        }
        let p3_share = match (self.first.0, self.latest.0) {
            (Some(first_pa), Some(latest_pa)) => share(first_pa, latest_pa, p3_change_pa),
            _ => 1.0,
        };
        let speed_change_rpm = self.targets_rpm.1 - self.targets_rpm.0;
        let slows = speed_change_rpm < -MIN_SPEED_CHANGE_RATIO * self.targets_rpm.0;
        let closes = self.to.valve_opening_ratio < self.from.valve_opening_ratio;
        let speed_share = match (self.first.1, self.latest.1) {
            (Some(first_rpm), Some(latest_rpm)) if slows && closes => {
                share(first_rpm, latest_rpm, speed_change_rpm)
            }
            _ => 1.0,
        };
        p3_share.min(speed_share).max(0.0)
    }
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
    /// Adds the readings of a batch.
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
