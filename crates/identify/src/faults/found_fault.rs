//! A detected fault and its description.

use crate::faults::balance_rows::Machine;
use mapper_core::{Channel, FaultKind, SeenAtRest, SuspectedFault};
use mapper_physics::rig::sensor_fault::SensorFault;
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
    /// Where it shows while the machine is at rest.
    pub at_rest: Option<SeenAtRest>,
}

impl Suspect {
    /// The channels concerned; empty for a machine.
    pub fn channels(&self) -> &'static [Channel] {
        match self {
            Suspect::Sensor(fault) => fault.channels,
            Suspect::Machine(_) => &[],
        }
    }

    /// Unit of its size.
    fn unit(&self) -> &'static str {
        match self {
            Suspect::Sensor(SensorFault { kind: FaultKind::Gain | FaultKind::TowardsWall, .. })
            | Suspect::Sensor(SensorFault {
                kind: FaultKind::Drift,
                channels: [Channel::CompressorFlow | Channel::ShaftSpeed],
                ..
            }) => "1",
            Suspect::Sensor(SensorFault { channels, .. }) => channels.first().map_or("1", |c| c.unit()),
            Suspect::Machine(Machine::Condition(channel)) => channel.unit(),
            Suspect::Machine(_) => "1",
        }
    }
}

impl From<&FoundFault> for SuspectedFault {
    fn from(found: &FoundFault) -> Self {
        SuspectedFault {
            fault: found.suspect.to_string(),
            channels: found.suspect.channels().to_vec(),
            value: found.value,
            sigma: found.sigma,
            unit: found.suspect.unit().to_owned(),
            alternatives: found.alternatives.iter().map(ToString::to_string).collect(),
            touches_points: found.touches_points,
            at_rest: found.at_rest,
        }
    }
}

impl Serialize for FoundFault {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        SuspectedFault::from(self).serialize(serializer)
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

fn machine_name(machine: Machine) -> String {
    let name = match machine {
        Machine::FlowCapacity => "flow of the declared map",
        Machine::Efficiency => "efficiency of the declared map",
        Machine::ValveArea => "area of the declared valve",
        Machine::ValvePlay => "play of the back-pressure valve",
        Machine::Convection => "convection of the declared machine",
        Machine::Condition(channel) => return format!("{} ({channel})", channel.info().description),
    };
    name.to_owned()
}
