//! A detected fault and its description.

use crate::faults::balance_rows::Machine;
use mapper_core::Channel;
use mapper_physics::rig::sensor_fault::{FaultKind, SensorFault};
use serde::{Serialize, Serializer};
use std::fmt;

/// Possible causes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Suspect {
    /// One or several sensors.
    Sensor(SensorFault),
    /// The machine is not as declared, ratio.
    Machine(Machine),
}

/// A fault that explains why the balances of a recording do not close.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundFault {
    /// The most probable cause.
    pub suspect: Suspect,
    /// Its size, in the unit of the suspect.
    pub value: f64,
    /// One standard deviation of the size.
    pub sigma: f64,
    /// Other causes that are at least one twentieth as probable.
    pub alternatives: Vec<Suspect>,
    /// Whether any number of the points depends on it; if not, they keep their verdicts.
    pub touches_points: bool,
}

impl Suspect {
    /// The channels concerned; empty for a machine.
    pub fn channels(&self) -> &'static [Channel] {
        match self {
            Suspect::Sensor(fault) => fault.channels,
            Suspect::Machine(_) => &[],
        }
    }

    /// Factor and display unit of its size.
    fn scale(&self) -> (f64, &'static str) {
        let Suspect::Sensor(SensorFault { channels, kind, .. }) = self else {
            return match self {
                Suspect::Machine(Machine::Condition(Channel::P1)) => (1e-3, "kPa"),
                Suspect::Machine(Machine::Condition(_)) => (1.0, "K"),
                _ => (100.0, "%"),
            };
        };
        match (kind, channels) {
            (FaultKind::Gain | FaultKind::TowardsWall, _)
            | (FaultKind::Drift, [Channel::CompressorFlow | Channel::ShaftSpeed]) => (100.0, "%"),
            (_, [Channel::P1 | Channel::P2, ..]) => (1e-3, "kPa"),
            (_, [Channel::CompressorFlow]) => (1e3, "g/s"),
            (_, [Channel::ShaftSpeed]) => (1e-3, "krpm"),
            _ => (1.0, "K"),
        }
    }
}

/// Machine-readable form: the cause, its size in SI units or as a ratio, and the alternatives.
impl Serialize for FoundFault {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Shown {
            fault: String,
            channels: &'static [Channel],
            value: f64,
            sigma: f64,
            unit: &'static str,
            alternatives: Vec<String>,
            touches_points: bool,
        }
        let unit = match self.suspect.scale().1 {
            "%" => "1",
            "kPa" => "Pa",
            "g/s" => "kg/s",
            "krpm" => "rpm",
            other => other,
        };
        let alternatives = self.alternatives.iter().map(ToString::to_string).collect();
        let (fault, channels) = (self.suspect.to_string(), self.suspect.channels());
        Shown {
            fault,
            channels,
            value: self.value,
            sigma: self.sigma,
            unit,
            alternatives,
            touches_points: self.touches_points,
        }
        .serialize(serializer)
    }
}

/// Without its size: `offset of T2`.
impl fmt::Display for Suspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Suspect::Sensor(fault) => fault.fmt(f),
            Suspect::Machine(machine) => f.write_str(&machine_name(*machine)),
        }
    }
}

/// With its size, its 95 % interval and the alternatives.
impl fmt::Display for FoundFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (scale, unit) = self.suspect.scale();
        let size = format!("{:+.2} +/- {:.2} {unit}", scale * self.value, 1.96 * scale * self.sigma);
        match self.suspect {
            Suspect::Sensor(fault) => {
                let channels = fault.channel_names();
                let several = fault.channels.len() > 1;
                let verb = |one, many| if several { many } else { one };
                match fault.kind {
                    FaultKind::Offset => write!(f, "{channels} {} {size} too high", verb("reads", "read")),
                    FaultKind::Gain => write!(f, "{channels} {} a gain error of {size}", verb("has", "have")),
                    FaultKind::TowardsWall => {
                        write!(f, "{channels} reads {size} of the way to the housing temperature")
                    }
                    _ => write!(f, "{channels} {} by {size} over the run", verb("drifts", "drift")),
                }?;
            }
            Suspect::Machine(machine) => {
                write!(f, "the {} is {size} off its declaration", machine_name(machine))?
            }
        }
        match self.alternatives.as_slice() {
            [] => Ok(()),
            others => {
                let others: Vec<String> = others.iter().map(ToString::to_string).collect();
                write!(f, " (or: {})", others.join("; "))
            }
        }
    }
}

fn machine_name(machine: Machine) -> String {
    let name = match machine {
        Machine::FlowCapacity => "flow of the declared map",
        Machine::Efficiency => "efficiency of the declared map",
        Machine::ValveArea => "area of the declared valve",
        Machine::Convection => "convection of the declared machine",
        Machine::Condition(channel) => return format!("{} ({channel})", channel.info().description),
    };
    name.to_owned()
}
