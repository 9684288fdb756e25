//! An actuator that follows its command with a first-order lag and a limited rate, in closed form.

/// Dynamics of an actuator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ActuatorDynamics {
    /// Time constant of the lag, s; 0 without lag.
    pub lag_s: f64,
    /// Maximum rate, unit of the actuator per second; infinity for none.
    pub slew_per_s: f64,
}

/// One actuator and its position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuator {
    dynamics: ActuatorDynamics,
    /// Time of the last command, s.
    since_s: f64,
    /// Value at the last command.
    start: f64,
    command: f64,
}

/// Remaining fraction of the last jump of the command at which the actuator counts as arrived.
const ARRIVED_RATIO: f64 = 1e-9;

impl Actuator {
    /// An actuator at rest at `value`.
    pub fn at_rest(dynamics: ActuatorDynamics, value: f64) -> Self {
        Actuator { dynamics, since_s: 0.0, start: value, command: value }
    }

    /// Sends a new command at `t_s`.
    pub fn set(&mut self, t_s: f64, command: f64) {
        if command != self.command {
            self.start = self.value(t_s);
            self.since_s = t_s;
            self.command = command;
        }
    }

    /// Position of the actuator at `t_s`, at or after the last command.
    pub fn value(&self, t_s: f64) -> f64 {
        let after_s = t_s - self.since_s;
        let jump = self.command - self.start;
        let (ramp_s, exponential_s) = self.phases_s();
        if after_s >= ramp_s + exponential_s {
            self.command
        } else if after_s < ramp_s {
            self.start + self.dynamics.slew_per_s * jump.signum() * after_s
        } else {
            // The distance to the command at which the rate of the lag falls below the slew limit.
            let remaining = jump.abs().min(self.dynamics.slew_per_s * self.dynamics.lag_s);
            self.command - remaining * jump.signum() * (-(after_s - ramp_s) / self.dynamics.lag_s).exp()
        }
    }

    /// The next time after `t_s` at which the form of the time history changes; infinity if there is none.
    pub fn next_kink_s(&self, t_s: f64) -> f64 {
        let (ramp_s, exponential_s) = self.phases_s();
        [self.since_s + ramp_s, self.since_s + ramp_s + exponential_s]
            .into_iter()
            .find(|kink_s| *kink_s > t_s)
            .unwrap_or(f64::INFINITY)
    }

    /// Whether the value is constant from `t_s` on.
    pub fn has_arrived(&self, t_s: f64) -> bool {
        let (ramp_s, exponential_s) = self.phases_s();
        t_s >= self.since_s + ramp_s + exponential_s
    }

    /// Durations of the slew-limited ramp and of the exponential approach, s.
    fn phases_s(&self) -> (f64, f64) {
        let ActuatorDynamics { lag_s, slew_per_s } = self.dynamics;
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
        let mut actuator = Actuator::at_rest(ActuatorDynamics { lag_s: 0.3, slew_per_s: f64::INFINITY }, 1.0);
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
        let mut actuator = Actuator::at_rest(ActuatorDynamics { lag_s: 0.5, slew_per_s: 2.0 }, 0.0);
        actuator.set(0.0, 10.0);
        let mut before = 0.0;
        for i in 1..=1200 {
            let value = actuator.value(f64::from(i) * 0.01);
            assert!(value >= before && value - before <= 2.0 * 0.01 + 1e-12);
            before = value;
        }
        // Reversed on its way, it starts from its current position.
        actuator.set(1.0, 0.0);
        assert!((actuator.value(1.0) - 2.0).abs() < 1e-12);
        assert!(actuator.value(1.1) < 2.0);
    }

    #[test]
    fn without_lag_it_jumps() {
        let mut actuator = Actuator::at_rest(ActuatorDynamics { lag_s: 0.0, slew_per_s: f64::INFINITY }, 1.0);
        actuator.set(5.0, 2.0);
        assert_eq!(actuator.value(5.0), 2.0);
        assert_eq!(actuator.next_kink_s(5.0), f64::INFINITY);
    }
}
