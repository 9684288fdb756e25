//! A closure term, and the balance on which it acts.

use crate::closure::expression::Expression;
use crate::gap::best_fit::fit::MAX_SIGMAS;
use crate::gap::best_fit::normal::PRIOR_STEPS;
use mapper_core::Channel;
use mapper_physics::gas::air;
use mapper_physics::machine::hooks::{Hooks, Site, TooManyExtraStates};
use mapper_physics::rig::effect::{
    Effect, EffectError, EffectInfo, EffectParameter, NamedValues, Rig, Submodel,
};
use std::borrow::Cow;

/// Role of a term among others of its balance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    Level,
    /// Proportional to a temperature relative to the library reference; together with the level, heat exchange with an unknown temperature.
    Slope,
    /// Heat exchange with a known temperature.
    Exchange,
    Other,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Term {
    /// Balances it acts on, with the formulas that its coefficient multiplies; the first is its location. Heat between two parts acts on both.
    pub(crate) acts_on: Vec<(Balance, Expression)>,
    pub(crate) unit: &'static str,
    /// A clearly significant size of the coefficient.
    pub(crate) step: f64,
    /// Description, with `{}` for the coefficient.
    pub(crate) words: String,
    /// Its role among others of its balance.
    pub(crate) role: Role,
    /// Whether the coefficient must be positive: a conductance, an area, a time.
    pub(crate) positive: bool,
}

impl Term {
    pub(crate) fn balance(&self) -> Balance {
        self.acts_on[0].0
    }

    /// The sensor whose reading alone it changes, if any.
    pub(crate) fn sensor(&self) -> Option<Channel> {
        match self.acts_on[..] {
            [(Balance::Reading(channel) | Balance::Lag(channel), _)] => Some(channel),
            _ => None,
        }
    }

    /// Whether it is independent of the machine's state.
    pub(crate) fn is_constant(&self) -> bool {
        matches!(self.acts_on[..], [(_, Expression::Number(_))])
    }

    /// Whether it has its own memory, like a lag.
    pub(crate) fn has_memory(&self) -> bool {
        self.acts_on.iter().any(|(balance, _)| matches!(balance, Balance::Lag(_)))
    }

    /// The machine part in which it acts.
    pub(crate) fn submodel(&self) -> Submodel {
        self.balance().properties().submodel
    }
}

/// Terms with their coefficients, active in a model.
#[derive(Debug)]
pub(crate) struct TermHooks {
    /// Balance, coefficient, formula.
    acting: Vec<(Balance, f64, Expression)>,
    /// Whether each kind of hook is used, so that unused ones are skipped.
    on_readings: bool,
}

pub(crate) fn put_into(rig: &mut Rig, terms: &[(Term, f64)]) -> Result<(), TooManyExtraStates> {
    let mut acting = Vec::new();
    for (term, coefficient) in terms {
        for (balance, formula) in &term.acts_on {
            if let Balance::Lag(channel) = balance {
                rig.instruments.path_mut(*channel).lag_s += coefficient;
            } else if *coefficient != 0.0 {
                acting.push((*balance, *coefficient, formula.clone()));
            }
        }
    }
    if acting.is_empty() {
        return Ok(());
    }
    let on_readings = acting.iter().any(|(balance, ..)| matches!(balance, Balance::Reading(_)));
    rig.hook(TermHooks { acting, on_readings })
}

impl TermHooks {
    fn sum(&self, at: Balance, site: &Site<'_>, value: f64) -> f64 {
        let here = self.acting.iter().filter(|(balance, ..)| *balance == at);
        here.map(|(_, coefficient, formula)| coefficient * formula.of(site, value)).sum()
    }

    fn heated_k(&self, at: Balance, site: &Site<'_>, gas_k: f64) -> f64 {
        let heat_w = self.sum(at, site, gas_k);
        if heat_w == 0.0 {
            gas_k
        } else {
            gas_k + heat_w / (site.flow_kg_s * air::heat_capacity_j_kgk(gas_k))
        }
    }
}

impl Hooks for TermHooks {
    fn flow_kg_s(&self, site: &Site<'_>, flow_kg_s: f64) -> f64 {
        flow_kg_s * (1.0 + self.sum(Balance::MapFlow, site, flow_kg_s))
    }

    fn efficiency(&self, site: &Site<'_>, efficiency: f64) -> f64 {
        efficiency * (1.0 + self.sum(Balance::Work, site, efficiency))
    }

    fn h_w_m2k(&self, site: &Site<'_>, h_w_m2k: f64) -> f64 {
        h_w_m2k * (1.0 + self.sum(Balance::Convection, site, h_w_m2k))
    }

    fn gas_before_k(&self, site: &Site<'_>, t1_prime_k: f64) -> f64 {
        self.heated_k(Balance::GasBefore, site, t1_prime_k)
    }

    fn gas_after_k(&self, site: &Site<'_>, t2_prime_k: f64) -> f64 {
        self.heated_k(Balance::GasAfter, site, t2_prime_k)
    }

    fn gas_outlet_k(&self, site: &Site<'_>, t2_k: f64) -> f64 {
        self.heated_k(Balance::GasOutlet, site, t2_k)
    }

    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.sum(Balance::CompressorHousing, site, f64::NAN)
    }

    fn heat_to_turbine_w(&self, site: &Site<'_>) -> f64 {
        self.sum(Balance::TurbineHousing, site, f64::NAN)
    }

    fn flow_to_outlet_kg_s(&self, site: &Site<'_>) -> f64 {
        self.sum(Balance::Outlet, site, f64::NAN)
    }

    fn shaft_torque_nm(&self, site: &Site<'_>) -> f64 {
        self.sum(Balance::Shaft, site, f64::NAN)
    }

    fn reading(&self, site: &Site<'_>, channel: Channel, value: f64) -> f64 {
        if self.on_readings { value + self.sum(Balance::Reading(channel), site, value) } else { value }
    }
}

/// Maximum distance of a coefficient from zero, in steps.
pub(crate) const MAX_STEPS: f64 = PRIOR_STEPS * MAX_SIGMAS;

/// Some terms of one part of the machine, each with a coefficient.
#[derive(Debug, Clone)]
pub(crate) struct ClosureEffect {
    info: EffectInfo,
    terms: Vec<Term>,
}

impl ClosureEffect {
    pub(crate) fn new(terms: Vec<Term>) -> ClosureEffect {
        let parameters = terms
            .iter()
            .enumerate()
            .map(|(place, term)| EffectParameter {
                name: Cow::Owned(format!("c{}", place + 1)),
                unit: Cow::Borrowed(term.unit),
                low: if term.positive { 0.0 } else { -MAX_STEPS * term.step },
                high: MAX_STEPS * term.step,
                neutral: 0.0,
                typical_step: term.step,
            })
            .collect();
        let info = EffectInfo {
            name: Cow::Borrowed("a closure term that is proposed"),
            id: Cow::Borrowed("law"),
            description: Cow::Borrowed("terms that were found"),
            equation: Cow::Borrowed("as its terms"),
            source: Cow::Borrowed("found by regression"),
            submodel: terms.first().map_or(mapper_physics::rig::effect::Submodel::Shaft, Term::submodel),
            also_shows_in: Vec::new(),
            parameters,
        };
        ClosureEffect { info, terms }
    }
}

impl Effect for ClosureEffect {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError> {
        let with: Vec<(Term, f64)> =
            self.terms.iter().cloned().zip(values.iter().map(|(_, value)| value)).collect();
        Ok(put_into(rig, &with)?)
    }
}

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

pub(crate) struct Properties {
    /// Part of the machine to which it belongs.
    pub(crate) submodel: Submodel,
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
