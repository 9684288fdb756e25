//! What may drift.

use mapper_core::{Channel, Dimension, with_unit};
use mapper_physics::bearing_friction::at_150_krpm;
use serde::{Serialize, Serializer};

/// One thing that may drift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Cause {
    /// A sensor reads more and more beside: offset in K, Pa or rpm, gain of a flow meter.
    Sensor(Channel),
    /// The compressor fouls: its efficiency changes by the rate, its map's flow by 0.6 of it.
    Fouling,
    /// The bearing takes power c omega^2 from the shaft.
    BearingFriction,
}

/// Sensor or machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CauseKind {
    /// What is measured is right, its reading is not.
    Sensor,
    /// The machine itself changes.
    Machine,
}

/// Share of fouling's change of efficiency by which the flow of the map changes.
pub(crate) const FOULING_FLOW_SHARE: f64 = 0.6;

impl Cause {
    /// All causes that are considered, in the order of the table. Speed pick-ups count pulses and do not drift.
    pub const ALL: [Cause; 14] = [
        Cause::Sensor(Channel::T1),
        Cause::Sensor(Channel::T2),
        Cause::Sensor(Channel::Tc),
        Cause::Sensor(Channel::P2),
        Cause::Sensor(Channel::CompressorFlow),
        Cause::Sensor(Channel::TurbineFlow),
        Cause::Fouling,
        Cause::BearingFriction,
        Cause::Sensor(Channel::P1),
        Cause::Sensor(Channel::P3),
        Cause::Sensor(Channel::T3),
        Cause::Sensor(Channel::P4),
        Cause::Sensor(Channel::T4),
        Cause::Sensor(Channel::Tt),
    ];

    /// Name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Cause::Sensor(channel) => channel.info().symbol,
            Cause::Fouling => "fouling",
            Cause::BearingFriction => "bearing_friction",
        }
    }

    /// Sensor or machine.
    pub fn kind(self) -> CauseKind {
        match self {
            Cause::Sensor(_) => CauseKind::Sensor,
            Cause::Fouling | Cause::BearingFriction => CauseKind::Machine,
        }
    }

    /// Whether it is a gain: relative change of a flow's reading.
    pub(crate) fn is_gain(self) -> bool {
        matches!(self, Cause::Sensor(channel) if channel.info().dimension == Dimension::MassFlow)
    }

    /// Unit of its size.
    pub fn unit(self) -> &'static str {
        match self {
            Cause::Sensor(_) if self.is_gain() => "1",
            Cause::Sensor(channel) => channel.info().dimension.unit(),
            Cause::Fouling => "1",
            Cause::BearingFriction => "W s^2/rad^2",
        }
    }

    /// A size of it for people, SI: a ratio without a unit, friction also as its power at 150 krpm.
    pub fn show(self, size: f64) -> String {
        match self {
            Cause::BearingFriction => format!("{size:.2e} {} ({})", self.unit(), at_150_krpm(size)),
            _ => with_unit(format!("{size:.4}"), self.unit()),
        }
    }

    /// A drift over a campaign that surprises nobody, unit of the cause: the width of the prior of its size.
    pub(crate) fn usual_size(self) -> f64 {
        match self {
            Cause::Sensor(channel) => match channel.info().dimension {
                Dimension::MassFlow => 0.015,
                Dimension::Pressure => 500.0,
                Dimension::Temperature => 1.0,
                Dimension::RotationalSpeed => 300.0,
                Dimension::Ratio => 0.02,
            },
            Cause::Fouling => 0.02,
            // 1e-6 of it takes 185 W at 130 krpm.
            Cause::BearingFriction => 1e-6,
        }
    }
}

impl std::fmt::Display for Cause {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Cause {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}
