//! The balances of the model in which a source term can be missing.

use mapper_core::Channel;
use mapper_physics::rig::effect::Submodel;

/// A balance of the model: a state equation, an algebraic equation, or a sensor reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Balance {
    /// Heat of the compressor housing, W.
    CompressorHousing,
    /// Heat of the turbine housing, W.
    TurbineHousing,
    /// Torque of the shaft, N m.
    Shaft,
    /// Flow into the volume downstream of the compressor, kg/s.
    Outlet,
    /// Heat to the gas upstream of the wheel, W.
    GasBefore,
    /// Heat to the gas downstream of the wheel, W, not from the shaft.
    GasAfter,
    /// Heat to the gas between housing and probe, W.
    GasOutlet,
    /// Relative deviation of the isentropic efficiency.
    Work,
    /// Relative deviation of the convection between gas and compressor housing.
    Convection,
    /// Relative deviation of the compressor map's flow.
    MapFlow,
    /// Offset of a sensor reading, in its unit.
    Reading(Channel),
    /// Time constant of a sensor, s.
    Lag(Channel),
}

impl Balance {
    /// Part of the machine to which it belongs.
    pub fn submodel(self) -> Submodel {
        match self {
            Balance::CompressorHousing => Submodel::CompressorHousing,
            Balance::TurbineHousing => Submodel::TurbineHousing,
            Balance::Shaft => Submodel::Shaft,
            Balance::Outlet => Submodel::Outlet,
            Balance::GasBefore
            | Balance::GasAfter
            | Balance::GasOutlet
            | Balance::Work
            | Balance::Convection => Submodel::CompressorGas,
            Balance::MapFlow => Submodel::CompressorFlow,
            Balance::Reading(channel) | Balance::Lag(channel) => submodel_of_sensor(channel),
        }
    }

    /// Unit of the source term.
    pub fn unit(self) -> &'static str {
        match self {
            Balance::CompressorHousing
            | Balance::TurbineHousing
            | Balance::GasBefore
            | Balance::GasAfter
            | Balance::GasOutlet => "W",
            Balance::Shaft => "N m",
            Balance::Outlet => "kg/s",
            Balance::Work | Balance::Convection | Balance::MapFlow => "1",
            Balance::Reading(channel) => channel.unit(),
            Balance::Lag(_) => "s",
        }
    }

    /// A clearly significant size of the source term, for a machine of some kilowatts.
    pub fn plain_size(self) -> f64 {
        match self {
            Balance::CompressorHousing | Balance::TurbineHousing => 50.0,
            Balance::GasBefore | Balance::GasAfter | Balance::GasOutlet => 50.0,
            Balance::Shaft => 0.01,
            Balance::Outlet => 1e-3,
            Balance::Work | Balance::MapFlow => 0.03,
            Balance::Convection => 0.1,
            Balance::Reading(channel) => match channel {
                Channel::ShaftSpeed => 500.0,
                Channel::CompressorFlow | Channel::TurbineFlow => 1e-3,
                Channel::P2 => 500.0,
                _ => 2.0,
            },
            Balance::Lag(_) => 3.0,
        }
    }

    /// Name of the source term, for sentences.
    pub fn words(self) -> String {
        match self {
            Balance::Shaft => "torque on the shaft".to_owned(),
            Balance::Outlet => "flow into the outlet volume".to_owned(),
            Balance::CompressorHousing
            | Balance::TurbineHousing
            | Balance::GasBefore
            | Balance::GasAfter
            | Balance::GasOutlet => format!("heat to {}", self.place_words()),
            Balance::Work => "efficiency".to_owned(),
            Balance::Convection => "h".to_owned(),
            Balance::MapFlow => "the map's flow".to_owned(),
            Balance::Reading(channel) => format!("the reading of {channel}"),
            Balance::Lag(channel) => format!("a lag of the reading of {channel}"),
        }
    }

    /// Name of what it acts on, for sentences.
    pub fn place_words(self) -> String {
        match self {
            Balance::CompressorHousing => "the compressor housing".to_owned(),
            Balance::TurbineHousing => "the turbine housing".to_owned(),
            Balance::GasBefore => "the gas before the wheel".to_owned(),
            Balance::GasAfter => "the gas behind the wheel".to_owned(),
            Balance::GasOutlet => "the gas at the outlet".to_owned(),
            _ => self.words(),
        }
    }

    /// The script function that applies it; `None` if a script cannot.
    pub fn hook_name(self) -> Option<String> {
        Some(match self {
            Balance::CompressorHousing => "heat_to_compressor_w".to_owned(),
            Balance::TurbineHousing => "heat_to_turbine_w".to_owned(),
            Balance::Shaft => "shaft_torque_nm".to_owned(),
            Balance::Outlet => "flow_to_outlet_kg_s".to_owned(),
            Balance::GasBefore => "gas_before_k".to_owned(),
            Balance::GasAfter => "gas_after_k".to_owned(),
            Balance::GasOutlet => "gas_outlet_k".to_owned(),
            Balance::Work => "efficiency".to_owned(),
            Balance::Convection => "h_w_m2k".to_owned(),
            Balance::MapFlow => "flow_kg_s".to_owned(),
            Balance::Reading(channel) => format!("reading_{}", channel.symbol()),
            Balance::Lag(_) => return None,
        })
    }
}

/// A sensor without its own part belongs to the balance that uses its reading.
fn submodel_of_sensor(channel: Channel) -> Submodel {
    match channel {
        Channel::T1 => Submodel::T1Probe,
        Channel::T2 => Submodel::T2Probe,
        Channel::Tc => Submodel::TcProbe,
        Channel::P2 => Submodel::P2Sensor,
        Channel::CompressorFlow => Submodel::FlowMeter,
        Channel::TurbineFlow => Submodel::TurbineFlow,
        Channel::Tt | Channel::T4 => Submodel::TurbineHousing,
        _ => Submodel::Shaft,
    }
}
