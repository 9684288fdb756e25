//! An actuator that follows its command after a dead time, with a first-order lag, a limited rate and play, in closed form.

/// Dynamics of an actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatorDynamics {
    /// Time constant of the lag, s; 0 without lag.
    pub lag_s: f64,
    /// Maximum rate, unit of the actuator per second; infinity for none.
    pub slew_per_s: f64,
    /// Time before it begins to follow a command, s.
    pub dead_time_s: f64,
    /// Play between drive and output, unit of the actuator: the drive of a reversing actuator moves so far before the output follows.
    pub play: f64,
    /// Distance of a command from the drive's last command below which the drive does not move.
    pub dead_band: f64,
}

impl ActuatorDynamics {
    /// Follows its command at once.
    pub const AT_ONCE: ActuatorDynamics = ActuatorDynamics::new(0.0, f64::INFINITY);

    /// A lag and a rate, without dead time and play.
    pub const fn new(lag_s: f64, slew_per_s: f64) -> Self {
        ActuatorDynamics { lag_s, slew_per_s, dead_time_s: 0.0, play: 0.0, dead_band: 0.0 }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Actuator {
    dynamics: ActuatorDynamics,
    /// Motions that have begun or will begin, the oldest first. Earlier ones than that under way are dropped when the next command comes.
    motions: Vec<Motion>,
    /// The last command.
    command: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Motion {
    /// Its start, s.
    since_s: f64,
    /// Position of the drive at the start.
    start: f64,
    /// Position of the output at the start; it differs from the drive's by the play.
    output: f64,
    command: f64,
}

/// Remaining fraction of the last jump of the command at which the actuator counts as arrived.
const ARRIVED_RATIO: f64 = 1e-9;

impl Actuator {
    /// An actuator at rest at `value`.
    pub fn at_rest(dynamics: ActuatorDynamics, value: f64) -> Self {
        let motion = Motion { since_s: 0.0, start: value, output: value, command: value };
        Actuator { dynamics, motions: vec![motion], command: value }
    }

    pub fn set(&mut self, t_s: f64, command: f64) {
        let change = (command - self.command).abs();
        if change == 0.0 || change < self.dynamics.dead_band {
            return;
        }
        self.command = command;
        let since_s = t_s + self.dynamics.dead_time_s;
        let (start, output) = (self.drive(since_s), self.value(since_s));
        let under_way = self.motions.iter().rposition(|motion| motion.since_s <= t_s).unwrap_or(0);
        self.motions.drain(..under_way);
        self.motions.retain(|motion| motion.since_s < since_s);
        self.motions.push(Motion { since_s, start, output, command });
    }

    fn motion_at(&self, t_s: f64) -> Motion {
        let motion = self.motions.iter().rev().find(|motion| motion.since_s <= t_s);
        let rest = Motion { since_s: 0.0, start: self.command, output: self.command, command: self.command };
        motion.or(self.motions.first()).copied().unwrap_or(rest)
    }

    /// Position of the actuator at `t_s`, at or after the last command.
    pub fn value(&self, t_s: f64) -> f64 {
        let motion = self.motion_at(t_s);
        let half = 0.5 * self.dynamics.play;
        let drive = motion.drive(t_s, &self.dynamics);
        // The drive moves in one direction, so that the output depends on its start alone.
        motion.output.clamp(drive - half, drive + half)
    }

    fn drive(&self, t_s: f64) -> f64 {
        self.motion_at(t_s).drive(t_s, &self.dynamics)
    }

    /// The next time after `t_s` at which the form of the time history changes; infinity if there is none.
    pub fn next_kink_s(&self, t_s: f64) -> f64 {
        let motion = self.motion_at(t_s);
        let (ramp_s, exponential_s) = motion.phases_s(&self.dynamics);
        let next_start_s = self.motions.iter().map(|motion| motion.since_s).find(|since_s| *since_s > t_s);
        let own = [motion.since_s + ramp_s, motion.since_s + ramp_s + exponential_s];
        own.into_iter().chain(next_start_s).filter(|kink_s| *kink_s > t_s).fold(f64::INFINITY, f64::min)
    }

    /// Whether the value is constant from `t_s` on.
    pub fn has_arrived(&self, t_s: f64) -> bool {
        let motion = self.motion_at(t_s);
        let (ramp_s, exponential_s) = motion.phases_s(&self.dynamics);
        t_s >= motion.since_s + ramp_s + exponential_s
            && self.motions.last().is_none_or(|last| last.since_s <= t_s)
    }
}

impl Motion {
    fn drive(&self, t_s: f64, dynamics: &ActuatorDynamics) -> f64 {
        let after_s = t_s - self.since_s;
        let jump = self.command - self.start;
        let (ramp_s, exponential_s) = self.phases_s(dynamics);
        if after_s <= 0.0 && exponential_s + ramp_s > 0.0 {
            self.start
        } else if after_s >= ramp_s + exponential_s {
            self.command
        } else if after_s < ramp_s {
            self.start + dynamics.slew_per_s * jump.signum() * after_s
        } else {
            // The distance to the command at which the rate of the lag falls below the slew limit.
            let remaining = jump.abs().min(dynamics.slew_per_s * dynamics.lag_s);
            self.command - remaining * jump.signum() * (-(after_s - ramp_s) / dynamics.lag_s).exp()
        }
    }

    /// Durations of the slew-limited ramp and of the exponential approach, s.
    fn phases_s(&self, dynamics: &ActuatorDynamics) -> (f64, f64) {
        let ActuatorDynamics { lag_s, slew_per_s, .. } = *dynamics;
        let jump = (self.command - self.start).abs();
        if jump == 0.0 {
            return (0.0, 0.0);
        }
        let ramp_s = if slew_per_s.is_finite() { (jump / slew_per_s - lag_s).max(0.0) } else { 0.0 };
        (ramp_s, -ARRIVED_RATIO.ln() * lag_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pure_lag_is_an_exponential() {
        let mut actuator = Actuator::at_rest(ActuatorDynamics::new(0.3, f64::INFINITY), 1.0);
        actuator.set(10.0, 3.0);
        for after_s in [0.0f64, 0.1, 0.3, 2.0] {
            let expected = 3.0 - 2.0 * (-after_s / 0.3).exp();
            assert!((actuator.value(10.0 + after_s) - expected).abs() < 1e-12);
        }
        assert_eq!(actuator.value(30.0), 3.0);
        assert!(actuator.has_arrived(30.0) && !actuator.has_arrived(11.0));
    }

    #[test]
    fn the_rate_never_exceeds_the_slew_limit_and_the_course_is_continuous() {
        let mut actuator = Actuator::at_rest(ActuatorDynamics::new(0.5, 2.0), 0.0);
        actuator.set(0.0, 10.0);
        let mut before = 0.0;
        for i in 1..=1200 {
            let value = actuator.value(f64::from(i) * 0.01);
            assert!(value >= before && value - before <= 2.0 * 0.01 + 1e-12);
            before = value;
        }
        // Reversed on its way, it starts from its current position.
        let mut actuator = Actuator::at_rest(ActuatorDynamics::new(0.5, 2.0), 0.0);
        actuator.set(0.0, 10.0);
        actuator.set(1.0, 0.0);
        assert!((actuator.value(1.0) - 2.0).abs() < 1e-12);
        assert!(actuator.value(1.1) < 2.0);
    }

    #[test]
    fn without_lag_it_jumps() {
        let mut actuator = Actuator::at_rest(ActuatorDynamics::AT_ONCE, 1.0);
        actuator.set(5.0, 2.0);
        assert_eq!(actuator.value(5.0), 2.0);
        assert_eq!(actuator.next_kink_s(5.0), f64::INFINITY);
    }

    #[test]
    fn commands_that_follow_each_other_are_delayed_by_the_dead_time() {
        let dynamics = ActuatorDynamics { dead_time_s: 1.0, ..ActuatorDynamics::new(0.4, f64::INFINITY) };
        let mut delayed = Actuator::at_rest(dynamics, 0.0);
        let mut prompt = Actuator::at_rest(ActuatorDynamics::new(0.4, f64::INFINITY), 0.0);
        for i in 0..40 {
            let t_s = 0.1 * f64::from(i);
            delayed.set(t_s, 0.02 * f64::from(i));
            prompt.set(t_s + 1.0, 0.02 * f64::from(i));
            // Both are asked at times after all their commands.
            if i > 12 {
                let early = delayed.value(t_s + 0.05);
                let mut again = Actuator::at_rest(ActuatorDynamics::new(0.4, f64::INFINITY), 0.0);
                (0..=i)
                    .filter(|k| 0.1 * f64::from(*k) + 1.0 <= t_s + 0.05)
                    .for_each(|k| again.set(0.1 * f64::from(k) + 1.0, 0.02 * f64::from(k)));
                assert!((early - again.value(t_s + 0.05)).abs() < 1e-12, "{i}: {early}");
            }
        }
    }

    #[test]
    fn a_reversing_valve_moves_after_its_play() {
        let dynamics = ActuatorDynamics { play: 0.02, ..ActuatorDynamics::AT_ONCE };
        let mut valve = Actuator::at_rest(dynamics, 1.0);
        let mut at = 0.0;
        let mut go = |command: f64| {
            at += 1.0;
            valve.set(at, command);
            valve.value(at)
        };
        assert!((go(1.1) - 1.09).abs() < 1e-12, "half of the play behind");
        assert!((go(1.09) - 1.09).abs() < 1e-12 && (go(1.08) - 1.09).abs() < 1e-12, "within the play");
        assert!((go(1.0) - 1.01).abs() < 1e-12, "on the other side");
    }

    #[test]
    fn changes_below_the_dead_band_do_nothing() {
        let dynamics = ActuatorDynamics { dead_band: 0.01, ..ActuatorDynamics::AT_ONCE };
        let mut valve = Actuator::at_rest(dynamics, 1.0);
        valve.set(1.0, 1.005);
        assert_eq!(valve.value(2.0), 1.0);
        // Two small changes are one large one.
        valve.set(3.0, 1.011);
        assert_eq!(valve.value(4.0), 1.011);
    }
}
