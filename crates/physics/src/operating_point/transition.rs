//! The way from one operating point to the next: coordinated ramps of P3 and valve, followed by the declared actuators.
//!
//! The compressor surges if the valve closes before the shaft has slowed, and the shaft overspeeds if the valve opens before P3 has fallen.
//! Both are excluded if P3 is never above what the opening of the moment needs: when P3 falls, it leads and the valve follows; when P3 rises,
//! the valve leads. Ramps overlap as long as the follower stays behind the leader's lag; if that is not admissible, the follower waits until the leader and the shaft
//! have arrived.

use crate::machine::params::BoundaryConditions;
use crate::simulation::model::Model;
use crate::simulation::steady::{Inputs, SteadyState};
use mapper_core::{ActuatorMotion, Ramp, Ramps, RigActuators};

/// Time constants of the shaft after which a waiting follower starts. Judgement: 2 % of the change of speed remain.
const SETTLED_TIME_CONSTANTS: f64 = 4.0;
/// Lags after which an actuator is at its command. Source: e^-20 is below the tolerance of the integration.
const REST_LAGS: f64 = 20.0;
/// Longest time constant of a shaft that a follower waits for, s. Bound: the largest turbochargers take ten seconds at idle.
const MAX_SHAFT_S: f64 = 10.0;

/// Time constant with which the shaft follows P3 at a steady state, s: `J w / (dP/dw)`, with a power of the compressor that grows with the cube of
/// the speed.
pub fn shaft_time_constant_s(model: &Model, steady: &SteadyState) -> f64 {
    let speed_rad_s = steady.state.shaft_speed_rad_s;
    let power_w = steady.outputs.compressor_power_w + steady.outputs.friction_power_w;
    let time_s = model.params.shaft_inertia_kgm2 * speed_rad_s * speed_rad_s / (3.0 * power_w);
    if time_s.is_finite() { time_s.clamp(0.0, MAX_SHAFT_S) } else { MAX_SHAFT_S }
}

/// Ramps from one steady state to the other, the fastest first: overlapping, one after the other, and one after the other with the opposite lead.
pub fn candidate_ramps(
    model: &Model,
    from: &SteadyState,
    to: &SteadyState,
    actuators: &RigActuators,
) -> [Ramps; 3] {
    let shaft_s = shaft_time_constant_s(model, from).max(shaft_time_constant_s(model, to));
    let change = |value: fn(&BoundaryConditions) -> f64| value(&to.boundary) - value(&from.boundary);
    let p3_change_pa = change(|boundary| boundary.p3_pa);
    let p3_s = actuators.p3.ramp_s(p3_change_pa);
    let p3_leads = p3_change_pa < 0.0;
    let ramp = |start_s: f64, duration_s: f64| Ramp { start_s, duration_s };
    let opening_change_ratio = change(|boundary| boundary.valve_opening_ratio);
    let overlapping = Ramps::overlapping(p3_change_pa, opening_change_ratio, shaft_s, actuators);
    let valve_s = actuators.valve.ramp_s(opening_change_ratio);
    let one_by_one = |p3_leads: bool| match p3_leads {
        true => {
            let arrived_s = p3_s + actuators.p3.follow_s() + SETTLED_TIME_CONSTANTS * shaft_s;
            Ramps { p3: ramp(0.0, p3_s), valve: ramp(arrived_s, valve_s) }
        }
        false => {
            let arrived_s = valve_s + actuators.valve.follow_s();
            Ramps { p3: ramp(arrived_s, p3_s), valve: ramp(0.0, valve_s) }
        }
    };
    [overlapping, one_by_one(p3_leads), one_by_one(!p3_leads)]
}

/// Boundary conditions of a transition, behind the actuators.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransitionInputs {
    to: BoundaryConditions,
    p3_pa: FollowedRamp,
    /// The parts of its command, one after the other.
    valve_ratio: [FollowedRamp; VALVE_PARTS],
    t3_k: FollowedRamp,
}

impl TransitionInputs {
    /// The transition between two boundary conditions.
    pub fn new(
        from: &BoundaryConditions,
        to: &BoundaryConditions,
        ramps: &Ramps,
        actuators: &RigActuators,
    ) -> Self {
        let t3_ramp = Ramp { start_s: 0.0, duration_s: actuators.t3.ramp_s(to.t3_k - from.t3_k) };
        let p3_pa = FollowedRamp::new((from.p3_pa, to.p3_pa), &ramps.p3, &actuators.p3);
        let opening = (from.valve_opening_ratio, to.valve_opening_ratio);
        TransitionInputs {
            to: *to,
            p3_pa,
            valve_ratio: valve_parts(opening, &ramps.valve, &actuators.valve, &p3_pa),
            t3_k: FollowedRamp::new((from.t3_k, to.t3_k), &t3_ramp, &actuators.t3),
        }
    }

    /// Constant conditions.
    pub fn constant(boundary: &BoundaryConditions) -> Self {
        let at_once = Ramp { start_s: 0.0, duration_s: 0.0 };
        let ramps = Ramps { p3: at_once, valve: at_once };
        TransitionInputs::new(boundary, boundary, &ramps, &RigActuators::default())
    }

    /// Time after the start of the step until P3 and valve have arrived, s.
    pub fn arrival_s(&self, actuators: &RigActuators) -> f64 {
        let [.., valve] = &self.valve_ratio;
        let of = |ramp: &FollowedRamp, motion: &ActuatorMotion| {
            ramp.ramp.end_s() - motion.dead_time_s + motion.follow_s()
        };
        of(&self.p3_pa, &actuators.p3).max(of(valve, &actuators.valve))
    }

    fn channels(&self) -> impl Iterator<Item = &FollowedRamp> {
        [&self.p3_pa, &self.t3_k].into_iter().chain(&self.valve_ratio)
    }
}

/// Number of straight parts of the valve's command while it waits for P3. Bound: they differ from the command by less
/// than the valve may be ahead.
const VALVE_PARTS: usize = 12;

/// The valve behind its command: the ramp, but no further than P3 has fallen.
fn valve_parts(
    (from, to): (f64, f64),
    ramp: &Ramp,
    motion: &ActuatorMotion,
    p3_pa: &FollowedRamp,
) -> [FollowedRamp; VALVE_PARTS] {
    let share = |t_s: f64| ramp.share(t_s).min((p3_pa.share(t_s) + Ramps::AHEAD_SHARE).min(1.0));
    let waits = Ramps::valve_waits(p3_pa.from, p3_pa.to) && from != to;
    let end_s =
        if waits { ramp.end_s().max(p3_pa.reaches_s(1.0 - Ramps::AHEAD_SHARE)) } else { ramp.end_s() };
    let time_s = |part: usize| ramp.start_s + (end_s - ramp.start_s) * part as f64 / VALVE_PARTS as f64;
    let is_on_the_ramp = (1..=VALVE_PARTS).all(|part| share(time_s(part)) >= ramp.share(time_s(part)));
    let opening = |part: usize| match part {
        0 => from,
        VALVE_PARTS => to,
        part => from + share(time_s(part)) * (to - from),
    };
    std::array::from_fn(|part| {
        if !waits || is_on_the_ramp {
            let from = if part + 1 == VALVE_PARTS { from } else { to };
            return FollowedRamp::new((from, to), ramp, motion);
        }
        let start_s = time_s(part);
        let straight = Ramp { start_s, duration_s: time_s(part + 1) - start_s };
        FollowedRamp::new((opening(part), opening(part + 1)), &straight, motion)
    })
}

impl Inputs for TransitionInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        BoundaryConditions {
            p3_pa: self.p3_pa.value(t_s),
            valve_opening_ratio: self
                .valve_ratio
                .iter()
                .rev()
                .fold(self.to.valve_opening_ratio, |opening, part| opening + (part.value(t_s) - part.to)),
            t3_k: self.t3_k.value(t_s),
            ..self.to
        }
    }

    // Steps are calculated without a time of the run, as steady states are.
    fn time_s(&self, _t_s: f64) -> f64 {
        f64::NAN
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.channels().map(|channel| channel.next_kink_s(t_s)).fold(f64::INFINITY, f64::min)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.channels().all(|channel| channel.is_constant_after(t_s))
    }
}

/// A ramp of a command behind a first-order lag, in closed form.
#[derive(Debug, Clone, Copy, PartialEq)]
struct FollowedRamp {
    from: f64,
    to: f64,
    /// The ramp, with the dead time.
    ramp: Ramp,
    lag_s: f64,
}

impl FollowedRamp {
    fn new((from, to): (f64, f64), ramp: &Ramp, motion: &ActuatorMotion) -> Self {
        let ramp = Ramp { start_s: ramp.start_s + motion.dead_time_s, ..*ramp };
        FollowedRamp { from, to, ramp, lag_s: motion.lag_s }
    }

    /// Share of the change that is complete.
    fn share(&self, t_s: f64) -> f64 {
        if self.from == self.to { 1.0 } else { (self.value(t_s) - self.from) / (self.to - self.from) }
    }

    /// Time at which this share of the change is complete, at the earliest the end of the ramp, s.
    fn reaches_s(&self, share: f64) -> f64 {
        let end_s = self.ramp.end_s();
        end_s + self.lag_s * ((1.0 - self.share(end_s)) / (1.0 - share)).ln().max(0.0)
    }

    fn rest_s(&self) -> f64 {
        self.ramp.end_s() + REST_LAGS * self.lag_s
    }

    fn value(&self, t_s: f64) -> f64 {
        let Ramp { start_s, duration_s } = self.ramp;
        let change = self.to - self.from;
        if change == 0.0 || t_s <= start_s {
            return self.from;
        }
        if t_s >= self.rest_s() {
            return self.to;
        }
        let since_s = t_s - start_s;
        if duration_s <= 0.0 {
            return self.to - change * (-since_s / self.lag_s).exp();
        }
        let rate = change / duration_s;
        // Distance behind the command that a ramp without end approaches, and the share of it that is reached.
        let behind = |since_s: f64| match self.lag_s > 0.0 {
            true => rate * self.lag_s * -(-since_s / self.lag_s).exp_m1(),
            false => 0.0,
        };
        if since_s < duration_s {
            self.from + rate * since_s - behind(since_s)
        } else {
            self.to - behind(duration_s) * (-(since_s - duration_s) / self.lag_s).exp()
        }
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        if self.from == self.to {
            return f64::INFINITY;
        }
        let kinks_s = [self.ramp.start_s, self.ramp.end_s(), self.rest_s()];
        kinks_s.into_iter().find(|kink_s| *kink_s > t_s).unwrap_or(f64::INFINITY)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.from == self.to || t_s < self.ramp.start_s || t_s >= self.rest_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against the lag's differential equation in small steps.
        #[test]
        fn a_followed_ramp_obeys_its_lag(
            (start_s, duration_s, lag_s) in (0.0..5.0f64, 0.0..20.0f64, 0.05..8.0f64),
            (from, to) in (1.0..2.0f64, 1.0..2.0f64),
        ) {
            let followed = FollowedRamp { from, to, ramp: Ramp { start_s, duration_s }, lag_s };
            let (mut value, step_s) = (from, 1e-3 * lag_s);
            for i in 0..(30.0 / step_s) as usize {
                let middle_s = (i as f64 + 0.5) * step_s;
                value += step_s / lag_s * (from + (to - from) * followed.ramp.share(middle_s) - value);
            }
            let end_s = (30.0 / step_s).floor() * step_s;
            prop_assert!((followed.value(end_s) - value).abs() < 2e-3, "{} {value}", followed.value(end_s));
        }
    }

    /// The restraint of the control (runner's `TransitionControl`) on a stand that moves as declared, in small steps: the command follows the
    /// ramp, but is ahead of P3 by 3 % of the change at most, and the valve follows it with its lag.
    #[test]
    fn the_valve_waits_for_a_falling_pressure_as_the_control_makes_it() {
        let at = |p3_pa: f64, valve_opening_ratio: f64| BoundaryConditions {
            p3_pa,
            valve_opening_ratio,
            ..Default::default()
        };
        let (from, to, actuators) = (at(194e3, 2.5), at(164e3, 0.5), RigActuators::SCREW_COMPRESSOR);
        let ramps = Ramps::overlapping(to.p3_pa - from.p3_pa, -2.0, 0.5, &actuators);
        let inputs = TransitionInputs::new(&from, &to, &ramps, &actuators);
        let (step_s, mut opening, mut arrived_s) = (1e-3, 2.5, 0.0);
        let dead_s = actuators.valve.dead_time_s;
        for i in 0..60_000 {
            let middle_s = (f64::from(i) + 0.5) * step_s;
            let fallen = (from.p3_pa - inputs.at(middle_s - dead_s).p3_pa) / 30e3;
            let share = ramps.valve.share(middle_s - dead_s).min(fallen + 0.03).min(1.0);
            opening += step_s / actuators.valve.lag_s * (2.5 - 2.0 * share - opening);
            let end_s = f64::from(i + 1) * step_s;
            let off_share = (inputs.at(end_s).valve_opening_ratio - opening).abs() / 2.0;
            assert!(off_share < Ramps::AHEAD_SHARE, "{end_s} s: {off_share}");
            arrived_s = if opening > 0.5 + 0.01 * 2.0 { end_s } else { arrived_s };
        }
        assert!(inputs.arrival_s(&actuators) >= arrived_s, "{arrived_s} s");
        // When P3 rises, the valve leads.
        let rising = TransitionInputs::new(&to, &from, &ramps, &actuators);
        assert!(rising.valve_ratio[..VALVE_PARTS - 1].iter().all(|part| part.from == part.to));
    }

    #[test]
    fn without_a_lag_the_command_is_reached_at_the_end_of_the_ramp() {
        let ramp = Ramp { start_s: 1.0, duration_s: 2.0 };
        let followed = FollowedRamp { from: 1.0, to: 3.0, ramp, lag_s: 0.0 };
        assert_eq!([0.0, 1.0, 2.0, 3.0, 4.0].map(|t_s| followed.value(t_s)), [1.0, 1.0, 2.0, 3.0, 3.0]);
        assert!(followed.is_constant_after(0.5) && !followed.is_constant_after(1.5));
        assert_eq!((followed.next_kink_s(0.5), followed.next_kink_s(1.0)), (1.0, 3.0));
    }
}
