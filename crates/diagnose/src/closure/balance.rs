//! The balances of the model in which a source term can be missing.

use mapper_core::Channel;
use mapper_physics::rig::effect::Submodel;

/// A clearly significant heat flow, W. Bound: a prior of `PRIOR_STEPS` times this size, as for all
/// sizes below, is wider than what a machine of some kilowatts loses; the evidence narrows it.
pub(crate) const PLAIN_HEAT_W: f64 = 50.0;
/// A clearly significant torque, N m. Bound: a tenth of what such a shaft carries.
pub(crate) const PLAIN_TORQUE_NM: f64 = 0.01;
/// A clearly significant flow, kg/s. Bound: some per cent of the smallest compressor's flow.
pub(crate) const PLAIN_FLOW_KG_S: f64 = 1e-3;
/// A clearly significant deviation of efficiency or flow. Bound: three per cent, as much as maps of one type differ.
const PLAIN_DEVIATION_RATIO: f64 = 0.03;
/// A clearly significant deviation of the convection. Bound: the scatter of correlations for pipes.
const PLAIN_CONVECTION_RATIO: f64 = 0.1;
/// A clearly significant error of a speed, rpm, or of a pressure, Pa. Bound: several times the uncertainty of such sensors.
const PLAIN_READING: f64 = 500.0;
/// A clearly significant error of a temperature, K. Bound: several times the tolerance of a thermocouple.
const PLAIN_TEMPERATURE_K: f64 = 2.0;
/// A clearly significant lag, s. Bound: that of a sheathed probe in a slow flow.
pub(crate) const PLAIN_LAG_S: f64 = 3.0;

/// A balance of the model: a state equation, an algebraic equation, or a sensor reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Balance {
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
pub(crate) struct Properties {
    /// Part of the machine to which it belongs.
    pub(crate) submodel: Submodel,
    /// Unit of the source term.
    pub(crate) unit: &'static str,
    /// A clearly significant size of the source term, for a machine of some kilowatts.
    pub(crate) plain_size: f64,
    /// Name of the source term, for sentences.
    pub(crate) words: String,
    /// Name of what it acts on, for sentences.
    pub(crate) place_words: String,
    /// The script function that applies it; `None` if a script cannot.
    pub(crate) hook_name: Option<String>,
}

impl Balance {
    /// Its properties.
    pub(crate) fn properties(self) -> Properties {
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
            ..term(submodel, "W", PLAIN_HEAT_W, place, hook_name)
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
            Balance::Shaft => {
                term(Submodel::Shaft, "N m", PLAIN_TORQUE_NM, "torque on the shaft", "shaft_torque_nm")
            }
            Balance::Outlet => {
                let words = "flow into the outlet volume";
                term(Submodel::Outlet, "kg/s", PLAIN_FLOW_KG_S, words, "flow_to_outlet_kg_s")
            }
            Balance::Work => term(gas, "1", PLAIN_DEVIATION_RATIO, "efficiency", "efficiency"),
            Balance::Convection => term(gas, "1", PLAIN_CONVECTION_RATIO, "h", "h_w_m2k"),
            Balance::MapFlow => {
                term(Submodel::CompressorFlow, "1", PLAIN_DEVIATION_RATIO, "the map's flow", "flow_kg_s")
            }
            Balance::Reading(channel) => {
                let plain_size = match channel {
                    Channel::ShaftSpeed | Channel::P2 => PLAIN_READING,
                    Channel::CompressorFlow | Channel::TurbineFlow => PLAIN_FLOW_KG_S,
                    _ => PLAIN_TEMPERATURE_K,
                };
                let words = format!("the reading of {channel}");
                let hook_name = format!("reading_{}", channel.symbol());
                term(submodel_of_sensor(channel), channel.unit(), plain_size, &words, &hook_name)
            }
            Balance::Lag(channel) => {
                let words = format!("a lag of the reading of {channel}");
                let lag = term(submodel_of_sensor(channel), "s", PLAIN_LAG_S, &words, "");
                Properties { hook_name: None, ..lag }
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
