//! Possible causes of drift, and their effects on machine and inputs.

use mapper_core::unit_factors::S_PER_H;
use mapper_core::{Channel, Dimension, with_unit};
use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_observe::averages::INPUT_CHANNELS;
use mapper_observe::perturbation::Perturbation;
use mapper_physics::laws::turbine::at_150_krpm;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::rig::sensor_fault::drifts;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A possible cause of drift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// The error of one or several sensors changes: in K or Pa; for flow and speed as a ratio to the reading.
    Sensors(&'static [Channel]),
    /// The compressor fouls: its efficiency changes by the size of the drift, the flow of its map by 0.6 of it.
    Fouling,
    /// The bearing takes power c omega^2 from the shaft.
    BearingFriction,
}

/// Whether a sensor or the machine drifts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// Only the reading changes, not the measured quantity.
    Sensor,
    Machine,
}

/// A drift at a constant rate, per hour.
pub const RATE_PER_H: Shape = Shape::Ramp(S_PER_H);

/// Change of the map's flow by fouling, over the change of its efficiency. Judgement: deposits narrow the passages less than they
/// roughen them.
pub(crate) const FOULING_FLOW_SHARE: f64 = 0.6;
/// Prior of the loss of efficiency by fouling over a campaign. Bound: a compressor that has lost 2 % of its efficiency is cleaned.
const FOULING_RATIO: f64 = 0.02;
/// Prior of the change of friction over a campaign, W s2/rad2. Bound: 185 W at 130 krpm, half of a sound bearing's.
const FRICTION_W_S2_RAD2: f64 = 1e-6;

impl Cause {
    /// All causes that the diagnosis considers: the drifts in the library of sensor faults, and those of the machine.
    pub fn all() -> Vec<Cause> {
        let sensors = drifts().map(|fault| Cause::Sensors(fault.channels));
        sensors.chain([Cause::Fouling, Cause::BearingFriction]).collect()
    }

    /// Name in JSON; several sensors are joined with a plus sign.
    pub fn name(self) -> String {
        match self {
            Cause::Sensors(channels) => {
                channels.iter().map(|channel| channel.info().symbol).collect::<Vec<_>>().join("+")
            }
            Cause::Fouling => "fouling".to_owned(),
            Cause::BearingFriction => "bearing_friction".to_owned(),
        }
    }

    /// Whether a sensor or the machine drifts.
    pub fn kind(self) -> CauseKind {
        match self {
            Cause::Sensors(_) => CauseKind::Sensor,
            Cause::Fouling | Cause::BearingFriction => CauseKind::Machine,
        }
    }

    /// The sensors that drift; empty if the machine does.
    pub fn channels(self) -> &'static [Channel] {
        match self {
            Cause::Sensors(channels) => channels,
            Cause::Fouling | Cause::BearingFriction => &[],
        }
    }

    /// Unit of its size.
    pub fn unit(self) -> &'static str {
        match self {
            Cause::Sensors(channels) => match channels.first() {
                Some(channel) if !is_relative(*channel) => channel.info().dimension.unit(),
                _ => "1",
            },
            Cause::Fouling => "1",
            Cause::BearingFriction => "W s^2/rad^2",
        }
    }

    /// A size as text, SI. Friction also as its power at 150 krpm, which is easier to judge.
    pub fn show(self, size: f64) -> String {
        match self {
            Cause::BearingFriction => format!("{size:.2e} {} ({})", self.unit(), at_150_krpm(size)),
            _ => with_unit(format!("{size:.4}"), self.unit()),
        }
    }

    /// Prior standard deviation of its change over a campaign, in the unit of the cause.
    fn sigma_of_change(self) -> f64 {
        match self {
            Cause::Sensors(channels) => {
                drifts().find(|fault| fault.channels == channels).map_or(0.0, |fault| fault.sigma)
            }
            Cause::Fouling => FOULING_RATIO,
            Cause::BearingFriction => FRICTION_W_S2_RAD2,
        }
    }

    /// Prior standard deviation of its rate per hour, or of its step, in a campaign of this length, s.
    pub(crate) fn prior_sigma(self, shape: Shape, campaign_s: f64) -> f64 {
        match shape {
            Shape::Ramp(length_s) => self.sigma_of_change() * length_s / campaign_s,
            Shape::Step | Shape::Decay(_) => self.sigma_of_change(),
        }
    }

    /// Whether its size cannot be negative: a bearing takes power and never gives any.
    pub(crate) fn is_at_least_zero(self) -> bool {
        self == Cause::BearingFriction
    }
}

/// Whether the drift of a channel is a ratio to its reading.
pub(crate) fn is_relative(channel: Channel) -> bool {
    matches!(channel.info().dimension, Dimension::MassFlow | Dimension::RotationalSpeed)
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.name())
    }
}

impl Serialize for Cause {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name())
    }
}

impl<'de> Deserialize<'de> for Cause {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Cause, D::Error> {
        let name = String::deserialize(deserializer)?;
        let known = Cause::all().into_iter().find(|cause| cause.name() == name);
        known.ok_or_else(|| serde::de::Error::custom(format!("`{name}` is no cause of drift")))
    }
}

/// A cause with its time history and size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drift {
    pub cause: Cause,
    pub history: TimeHistory,
    /// Rate per hour, or step; in the unit of the cause.
    pub size: f64,
}

impl Drift {
    /// Size at a campaign time, s; in the unit of the cause.
    pub(super) fn at(&self, t_s: f64) -> f64 {
        self.size * self.history.at(t_s)
    }

    /// Whether a model run depends on it. The drift of an output sensor is linear in the readings, so no run is needed.
    pub(crate) fn acts_on_model(&self) -> bool {
        self.acts_on_machine() || self.acts_on_inputs()
    }

    /// Whether the machine changes over time.
    pub(crate) fn acts_on_machine(&self) -> bool {
        matches!(self.cause, Cause::Fouling | Cause::BearingFriction)
    }

    /// Whether the sensor of a model input drifts.
    pub(crate) fn acts_on_inputs(&self) -> bool {
        self.cause.channels().iter().any(|channel| INPUT_CHANNELS.contains(channel))
    }

    /// Applies its mean between two campaign times, s, to the machine.
    pub(super) fn apply_to(&self, params: &mut Params, from_s: f64, to_s: f64) {
        let mean = self.size * self.history.mean(from_s, to_s);
        match self.cause {
            Cause::Fouling => {
                Perturbation::Efficiency.adjust_machine(params, mean);
                Perturbation::Flow.adjust_machine(params, FOULING_FLOW_SHARE * mean);
            }
            Cause::BearingFriction => Perturbation::Friction.adjust_machine(params, mean),
            Cause::Sensors(_) => {}
        }
    }

    /// Subtracts the drift of a sensor from the input that it measures.
    pub(crate) fn subtract_from(&self, boundary: &mut BoundaryConditions, t_s: f64) {
        for channel in self.cause.channels().iter().filter(|channel| INPUT_CHANNELS.contains(channel)) {
            Perturbation::Input(*channel).adjust_boundary(boundary, -self.at(t_s));
        }
    }
}
