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

/// Properties of a balance.
pub struct Properties {
    /// Part of the machine to which it belongs.
    pub submodel: Submodel,
    /// Unit of the source term.
    pub unit: &'static str,
    /// A clearly significant size of the source term, for a machine of some kilowatts.
    pub plain_size: f64,
    /// Name of the source term, for sentences.
    pub words: String,
    /// Name of what it acts on, for sentences.
    pub place_words: String,
    /// The script function that applies it; `None` if a script cannot.
    pub hook_name: Option<String>,
}

impl Balance {
    /// Its properties.
    pub fn properties(self) -> Properties {
        let term = |submodel, unit, plain_size, words: &str, hook_name: &str| Properties {
            submodel,
            unit,
            plain_size,
            words: words.to_owned(),
            place_words: words.to_owned(),
            hook_name: Some(hook_name.to_owned()),
        };
        let heat = |submodel, place: &str, hook_name: &str| Properties {
            words: format!("heat to {place}"),
            ..term(submodel, "W", 50.0, place, hook_name)
        };
        let gas = Submodel::CompressorGas;
        match self {
            Balance::CompressorHousing => {
                heat(Submodel::CompressorHousing, "the compressor housing", "heat_to_compressor_w")
            }
            Balance::TurbineHousing => {
                heat(Submodel::TurbineHousing, "the turbine housing", "heat_to_turbine_w")
            }
            Balance::GasBefore => heat(gas, "the gas before the wheel", "gas_before_k"),
            Balance::GasAfter => heat(gas, "the gas behind the wheel", "gas_after_k"),
            Balance::GasOutlet => heat(gas, "the gas at the outlet", "gas_outlet_k"),
            Balance::Shaft => term(Submodel::Shaft, "N m", 0.01, "torque on the shaft", "shaft_torque_nm"),
            Balance::Outlet => {
                term(Submodel::Outlet, "kg/s", 1e-3, "flow into the outlet volume", "flow_to_outlet_kg_s")
            }
            Balance::Work => term(gas, "1", 0.03, "efficiency", "efficiency"),
            Balance::Convection => term(gas, "1", 0.1, "h", "h_w_m2k"),
            Balance::MapFlow => term(Submodel::CompressorFlow, "1", 0.03, "the map's flow", "flow_kg_s"),
            Balance::Reading(channel) => {
                let plain_size = match channel {
                    Channel::ShaftSpeed | Channel::P2 => 500.0,
                    Channel::CompressorFlow | Channel::TurbineFlow => 1e-3,
                    _ => 2.0,
                };
                let words = format!("the reading of {channel}");
                let hook_name = format!("reading_{}", channel.symbol());
                term(submodel_of_sensor(channel), channel.unit(), plain_size, &words, &hook_name)
            }
            Balance::Lag(channel) => {
                let words = format!("a lag of the reading of {channel}");
                Properties { hook_name: None, ..term(submodel_of_sensor(channel), "s", 3.0, &words, "") }
            }
        }
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
