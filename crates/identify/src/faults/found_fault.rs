//! A detected fault and its description.

use mapper_core::{Channel, FaultKind, SeenAtRest, SuspectedFault, step_number};
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
    /// None of the others: errors of a balance beyond the declared ones, ratio.
    Unmodelled(Law),
}

/// The balances of the check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Law {
    /// One opening has one area.
    Valve,
    /// P3 and valve follow their commands.
    Motion,
    /// Heads go with the speed squared.
    Head,
    /// The housing stores the heat of the gas.
    Housing,
    /// T1 does not follow Tc.
    InletTemperature,
    /// Efficiency is a smooth function of the map position.
    Efficiency,
    /// Sensors at rest read the same.
    Rest,
    /// h follows a law.
    Convection,
    /// Conditions are as declared.
    Conditions,
}

impl Law {
    fn name(self) -> &'static str {
        match self {
            Law::Valve => "the valve's area",
            Law::Motion => "the actuators' motion",
            Law::Head => "the head",
            Law::Housing => "the housing's heat",
            Law::InletTemperature => "T1 while Tc changes",
            Law::Efficiency => "the efficiency over the map",
            Law::Rest => "the readings at rest",
            Law::Convection => "the convection",
            Law::Conditions => "the conditions",
        }
    }
}

/// Machine properties that may differ from the declaration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Machine {
    /// Flow of the compressor map, all over.
    FlowCapacity,
    /// Efficiency of the compressor map, all over.
    Efficiency,
    /// Area of the back-pressure valve.
    ValveArea,
    /// Play of its drive beyond the declared one, opening.
    ValvePlay,
    /// Delay of the turbine inlet pressure beyond the declared one, s.
    SlowAir,
    /// The same of the back-pressure valve.
    SlowValve,
    /// Share of its commands that the valve does not follow in a series of steps, by their indices; 1 stands still at this opening.
    ValveStuck {
        /// The first of them.
        first: usize,
        /// The last of them.
        last: usize,
        /// The opening that its flow has.
        opening_ratio: f64,
    },
    /// Heat transfer between gas and housing, all over.
    Convection,
    /// A condition of the rig, in the channel's unit.
    Condition(Channel),
}

/// Those that every recording may have, in the order of the parameters; actuators that do not follow come after them.
pub(crate) const MACHINE: [Machine; 10] = [
    Machine::FlowCapacity,
    Machine::Efficiency,
    Machine::ValveArea,
    Machine::ValvePlay,
    Machine::Convection,
    Machine::Condition(Channel::P1),
    Machine::Condition(Channel::T1),
    Machine::Condition(Channel::T3),
    Machine::Condition(Channel::TOil),
    Machine::Condition(Channel::TAmb),
];

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
            Suspect::Machine(_) | Suspect::Unmodelled(_) => &[],
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
            Suspect::Machine(Machine::SlowAir | Machine::SlowValve) => "s",
            Suspect::Machine(_) | Suspect::Unmodelled(_) => "1",
        }
    }
}

impl FoundFault {
    /// The opening at which the valve stands in a step instead of following its command.
    pub(crate) fn valve_opening_ratio(&self, step: usize) -> Option<f64> {
        match self.suspect {
            Suspect::Machine(Machine::ValveStuck { first, last, opening_ratio })
                if (first..=last).contains(&step) =>
            {
                Some(opening_ratio)
            }
            _ => None,
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
            Suspect::Unmodelled(law) => write!(f, "error of {} (none of these)", law.name()),
        }
    }
}

fn machine_name(machine: Machine) -> String {
    let name = match machine {
        Machine::FlowCapacity => "flow of the declared map",
        Machine::Efficiency => "efficiency of the declared map",
        Machine::ValveArea => "area of the declared valve",
        Machine::ValvePlay => "play of the back-pressure valve",
        Machine::SlowAir => "delay of P3 behind its command",
        Machine::SlowValve => "delay of the back-pressure valve behind its command",
        Machine::ValveStuck { first, last, .. } => {
            let (first, last) = (step_number(first), step_number(last));
            return format!(
                "share of its commands that the back-pressure valve does not follow in steps {first} to {last}"
            );
        }
        Machine::Convection => "convection of the declared machine",
        Machine::Condition(channel) => return format!("{} ({channel})", channel.info().description),
    };
    name.to_owned()
}
