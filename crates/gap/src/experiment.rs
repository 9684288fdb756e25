//! What may be done on a stand to tell causes apart: one settled start, one step, and perhaps a sensor more.

use mapper_core::{Channel, OperatingPoint, Series};

/// A jump that may be run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllowedJump {
    /// Where it starts, settled.
    pub from: OperatingPoint,
    /// Where it goes.
    pub to: OperatingPoint,
    /// Turbine inlet total pressure commanded at the start, Pa.
    pub from_p3_pa: f64,
    /// Turbine inlet total pressure commanded by the jump, Pa.
    pub to_p3_pa: f64,
    /// Time at the target, s.
    pub dwell_s: f64,
}

/// Something that may be done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// Start, target and time; equal points where a temperature alone is changed. P3 is what holds the target. Nothing of it counts for a soak.
    pub jump: AllowedJump,
    /// What is changed besides.
    pub beside: Beside,
}

/// What is changed beside P3 and the valve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Beside {
    /// Nothing.
    Nothing,
    /// Turbine inlet total temperature, with the step; K.
    T3 {
        /// Before.
        from_k: f64,
        /// After.
        to_k: f64,
    },
    /// Oil inlet temperature, with the step; K.
    Oil {
        /// Before.
        from_k: f64,
        /// After.
        to_k: f64,
    },
    /// A channel of the model is measured that was not.
    Sensor(Channel),
    /// The machine rests before it runs, so that its temperature sensors are held against each other.
    Soak(AtRest),
}

/// How well a soak tells the offsets of the temperature sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtRest {
    /// Time at rest, s, > 0.
    pub duration_s: f64,
    /// One standard deviation of what is then left of each offset against the others, K, > 0; in the order of [`AtRest::CHANNELS`].
    pub left_sigma_k: [f64; AtRest::CHANNELS.len()],
}

impl AtRest {
    /// Sensors that are told. Of two pressure taps that differ nobody knows which is off, and a supply of oil wanders.
    pub const CHANNELS: [Channel; 3] = [Channel::T1, Channel::T2, Channel::Tc];
}

/// How T3 and oil follow their setpoints on a usual stand, s: the virtual lab's, and nobody declares another.
const T3_LAG_S: f64 = 20.0;
const OIL_LAG_S: f64 = 30.0;
/// Time that mounting a sensor takes, min.
const MOUNTING_MIN: f64 = 30.0;

impl Experiment {
    /// A jump and nothing else.
    pub fn jump(jump: AllowedJump) -> Experiment {
        Experiment { jump, beside: Beside::Nothing }
    }

    /// Time that it takes, min; the way to its start is not counted, a sensor's mounting is (half an hour).
    pub fn minutes(&self) -> f64 {
        let mounting = if matches!(self.beside, Beside::Sensor(_)) { MOUNTING_MIN } else { 0.0 };
        let at_work_s =
            if let Beside::Soak(soak) = self.beside { soak.duration_s } else { self.jump.dwell_s };
        (at_work_s / 60.0).max(0.1) + mounting
    }

    /// Whether the valve alone is moved, at one speed.
    pub fn is_valve_step(&self) -> bool {
        let AllowedJump { from, to, .. } = self.jump;
        self.beside == Beside::Nothing
            && (from.speed_rpm - to.speed_rpm).abs() < 1e-3 * from.speed_rpm.abs()
            && from.valve_opening_ratio != to.valve_opening_ratio
    }

    /// The driver that its step changes, as it would be recorded at `t_s` (rising) if the step began at `start_s`.
    pub fn driven(&self, t_s: &[f64], start_s: f64) -> Option<(Channel, Series)> {
        let (channel, from_k, to_k, lag_s) = match self.beside {
            Beside::Nothing | Beside::Sensor(_) | Beside::Soak(_) => return None,
            Beside::T3 { from_k, to_k } => (Channel::T3, from_k, to_k, T3_LAG_S),
            Beside::Oil { from_k, to_k } => (Channel::TOil, from_k, to_k, OIL_LAG_S),
        };
        let at = |t: &f64| to_k + (from_k - to_k) * (-(t - start_s).max(0.0) / lag_s).exp();
        Some((channel, Series { t_s: t_s.to_vec(), values: t_s.iter().map(at).collect() }))
    }
}
