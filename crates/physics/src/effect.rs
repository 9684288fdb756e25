//! The seam between the model and effects: what a rig may have and the nominal model has not.

use crate::hooks::{Hooks, TooManyExtraStates};
use crate::instruments::Instruments;
use crate::model::Model;
use mapper_core::with_unit;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::sync::Arc;

/// A machine behind its instruments: everything an effect can change.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The machine.
    pub model: Model,
    /// Sensors and the actuator of P3.
    pub instruments: Instruments,
}

impl Rig {
    /// A machine with ideal sensors and the declared actuator.
    pub fn new(model: Model) -> Self {
        Rig { model, instruments: Instruments::default() }
    }

    /// Adds something that is not a parameter.
    ///
    /// # Errors
    /// [`TooManyExtraStates`].
    pub fn hook(&mut self, hooks: impl Hooks + 'static) -> Result<(), TooManyExtraStates> {
        self.model.hooks.push(Arc::new(hooks))
    }
}

/// The parts of a rig in which a gap can lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Submodel {
    /// P3 behind its command.
    Actuator,
    /// Flow that the turbine swallows.
    TurbineFlow,
    /// Speed from the balance of powers.
    Shaft,
    /// Flow from speed and pressure ratio.
    CompressorFlow,
    /// The meter of the compressor's flow.
    FlowMeter,
    /// Volume and back-pressure valve.
    Outlet,
    /// Gas temperature through the compressor.
    CompressorGas,
    /// Probe before the compressor.
    T1Probe,
    /// Probe behind the compressor.
    T2Probe,
    /// Probe in the compressor housing.
    TcProbe,
    /// Pressure sensor behind the compressor.
    P2Sensor,
    /// Metal of the compressor.
    CompressorHousing,
    /// Metal of the turbine.
    TurbineHousing,
}

impl Submodel {
    /// All of them, in the order of the flow.
    pub const ALL: [Submodel; 13] = [
        Submodel::Actuator,
        Submodel::TurbineFlow,
        Submodel::Shaft,
        Submodel::CompressorFlow,
        Submodel::FlowMeter,
        Submodel::Outlet,
        Submodel::CompressorGas,
        Submodel::T1Probe,
        Submodel::T2Probe,
        Submodel::TcProbe,
        Submodel::P2Sensor,
        Submodel::CompressorHousing,
        Submodel::TurbineHousing,
    ];

    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Submodel::Actuator => "actuator",
            Submodel::TurbineFlow => "turbine_flow",
            Submodel::Shaft => "shaft",
            Submodel::CompressorFlow => "compressor_flow",
            Submodel::FlowMeter => "flow_meter",
            Submodel::Outlet => "outlet",
            Submodel::CompressorGas => "compressor_gas",
            Submodel::T1Probe => "t1_probe",
            Submodel::T2Probe => "t2_probe",
            Submodel::TcProbe => "tc_probe",
            Submodel::P2Sensor => "p2_sensor",
            Submodel::CompressorHousing => "compressor_housing",
            Submodel::TurbineHousing => "turbine_housing",
        }
    }
}

/// A number that says how strong an effect is.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectParameter {
    /// Name within the effect; the effect's own id where it has one parameter only.
    pub name: Cow<'static, str>,
    /// Unit, `1` for ratios.
    pub unit: Cow<'static, str>,
    /// Smallest value with a meaning.
    pub low: f64,
    /// Largest value with a meaning.
    pub high: f64,
    /// Value at which the effect is not there.
    pub neutral: f64,
    /// How far from neutral the effect is where it is plainly there: a step to start a search from.
    pub typical_step: f64,
}

/// What stands in a table of effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectInfo {
    /// Its name: lower case, digits and `_`.
    pub id: Cow<'static, str>,
    /// Its name for people.
    pub name: Cow<'static, str>,
    /// What happens, one line for people.
    pub description: Cow<'static, str>,
    /// The equation, in the symbols of `docs/physics.md`.
    pub equation: Cow<'static, str>,
    /// Where the equation comes from.
    pub source: Cow<'static, str>,
    /// Where it sits.
    pub submodel: Submodel,
    /// Where its gap may show as well: neighbours that share a balance with it.
    pub also_shows_in: Vec<Submodel>,
    /// Its numbers, at least one.
    pub parameters: Vec<EffectParameter>,
}

impl EffectInfo {
    /// Names of its parameters for messages.
    fn parameter_names(&self) -> String {
        let names: Vec<&str> = self.parameters.iter().map(|parameter| parameter.name.as_ref()).collect();
        names.join(", ")
    }

    /// Whether its gap may show in the submodel of this name.
    pub fn shows_in(&self, submodel_name: &str) -> bool {
        std::iter::once(&self.submodel).chain(&self.also_shows_in).any(|place| place.name() == submodel_name)
    }
}

/// The values of an effect's parameters, one for each and within its range, asked for by name.
#[derive(Debug, Clone, Copy)]
pub struct NamedValues<'a> {
    info: &'a EffectInfo,
    values: &'a [f64],
}

impl<'a> NamedValues<'a> {
    /// `values` stand in the order of the effect's parameters.
    ///
    /// # Errors
    /// [`EffectError`] where a value is missing, out of range or not finite.
    pub fn new(info: &'a EffectInfo, values: &'a [f64]) -> Result<Self, EffectError> {
        let id = || info.id.clone().into_owned();
        if values.len() != info.parameters.len() {
            return Err(EffectError::Count { id: id(), names: info.parameter_names(), given: values.len() });
        }
        for (parameter, value) in info.parameters.iter().zip(values) {
            let EffectParameter { low, high, .. } = *parameter;
            if !(low..=high).contains(value) {
                let (name, unit) = (parameter.name.clone().into_owned(), parameter.unit.clone().into_owned());
                return Err(EffectError::OutOfRange { id: id(), name, value: *value, unit, low, high });
            }
        }
        Ok(NamedValues { info, values })
    }

    /// The value of a parameter, in its unit.
    ///
    /// # Errors
    /// [`EffectError::NoParameter`].
    pub fn get(&self, name: &str) -> Result<f64, EffectError> {
        self.iter().find(|(parameter, _)| parameter.name == name).map(|(_, value)| value).ok_or_else(|| {
            EffectError::NoParameter {
                id: self.info.id.clone().into_owned(),
                name: name.to_owned(),
                names: self.info.parameter_names(),
            }
        })
    }

    /// Each parameter with its value.
    pub fn iter(&self) -> impl Iterator<Item = (&'a EffectParameter, f64)> {
        self.info.parameters.iter().zip(self.values.iter().copied())
    }

    /// Whether every value is the one at which the effect is not there.
    pub fn is_neutral(&self) -> bool {
        self.iter().all(|(parameter, value)| parameter.neutral == value)
    }
}

/// Something a rig may have.
///
/// What it changes of the model's parameters and of the instruments it changes once, before a run; what is neither it
/// adds as [`Hooks`]. At neutral values it changes nothing.
pub trait Effect: std::fmt::Debug + Send + Sync {
    /// What it is.
    fn info(&self) -> &EffectInfo;

    /// Puts it into a rig.
    ///
    /// # Errors
    /// [`EffectError::Room`] where it brings hidden temperatures for which there is no room;
    /// [`EffectError::NoParameter`] where it asks for a parameter that it does not declare.
    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError>;
}

/// Why an effect cannot be put into a rig.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EffectError {
    /// Too few or too many values.
    #[error("effect `{id}` has the parameters {names}, and {given} values were given: give one for each")]
    Count {
        /// The effect.
        id: String,
        /// Names of its parameters.
        names: String,
        /// Number of values.
        given: usize,
    },
    /// A value without meaning.
    #[error(
        "{name} = {} of effect `{id}` is not between {low} and {}",
        with_unit(value, unit),
        with_unit(high, unit)
    )]
    OutOfRange {
        /// The effect.
        id: String,
        /// The parameter.
        name: String,
        /// Its value.
        value: f64,
        /// Its unit.
        unit: String,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// A parameter that the effect does not have: a fault of the effect.
    #[error("effect `{id}` has no parameter `{name}`; it has {names}")]
    NoParameter {
        /// The effect.
        id: String,
        /// The name asked for.
        name: String,
        /// Names of its parameters.
        names: String,
    },
    /// No room for hidden temperatures.
    #[error(transparent)]
    Room(#[from] TooManyExtraStates),
}

/// Puts `effect` into `rig`, after what is already there; effects compose in any number and order.
///
/// # Errors
/// [`EffectError`] where a value is missing, out of range or not finite, or hidden temperatures are too many. The rig
/// is then as before.
pub fn add(rig: &mut Rig, effect: &dyn Effect, values: &[f64]) -> Result<(), EffectError> {
    effect.prepare(&NamedValues::new(effect.info(), values)?, rig)
}

/// `nominal` with all `effects` at their values.
///
/// # Errors
/// As [`add`].
pub fn compose<'a>(
    nominal: &Rig,
    effects: impl IntoIterator<Item = (&'a dyn Effect, &'a [f64])>,
) -> Result<Rig, EffectError> {
    let mut rig = nominal.clone();
    for (effect, values) in effects {
        add(&mut rig, effect, values)?;
    }
    Ok(rig)
}
