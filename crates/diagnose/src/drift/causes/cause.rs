//! Possible causes of drift.

use crate::drift::causes::time_history::CourseKind;
use mapper_core::{Channel, Dimension, with_unit};
use mapper_physics::laws::bearing_friction::at_150_krpm;
use mapper_physics::rig::sensor_fault::drifts;
use serde::{Serialize, Serializer};

/// A possible cause of drift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// One or several sensors have a growing common error: in K or Pa, for flow and speed as a ratio to the reading.
    Sensors(&'static [Channel]),
    /// The compressor fouls: its efficiency changes by the rate, and its map's flow by 0.6 of that.
    Fouling,
    /// The bearing takes power c omega^2 from the shaft.
    BearingFriction,
}

/// Sensor or machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// The measured quantity is unchanged, but its reading drifts.
    Sensor,
    /// The machine itself changes.
    Machine,
}

/// Ratio of the change of map flow to that of efficiency in fouling.
pub(crate) const FOULING_FLOW_SHARE: f64 = 0.6;

impl Cause {
    /// All causes considered: the drifts of the catalogue of sensor faults, and those of the machine.
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

    /// Sensor or machine.
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

    /// A size for display, SI: a ratio without a unit, friction also as its power at 150 krpm.
    pub fn show(self, size: f64) -> String {
        match self {
            Cause::BearingFriction => format!("{size:.2e} {} ({})", self.unit(), at_150_krpm(size)),
            _ => with_unit(format!("{size:.4}"), self.unit()),
        }
    }

    /// Prior size of its drift over a campaign, one standard deviation, unit of the cause.
    fn sigma(self) -> f64 {
        match self {
            Cause::Sensors(channels) => {
                drifts().find(|fault| fault.channels == channels).map_or(0.0, |fault| fault.sigma)
            }
            // Judgement: a compressor that has lost 2 % of its efficiency is cleaned.
            Cause::Fouling => 0.02,
            // Judgement: it takes 185 W at 130 krpm.
            Cause::BearingFriction => 1e-6,
        }
    }

    /// The same for a time history of this kind over a campaign of this length, s: a rate per hour, or a step.
    pub(crate) fn sigma_of(self, kind: CourseKind, campaign_s: f64) -> f64 {
        match kind {
            CourseKind::Ramp => self.sigma() * 3600.0 / campaign_s,
            CourseKind::Step => self.sigma(),
        }
    }

    /// Whether it cannot be negative: a bearing takes power but never gives any.
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
