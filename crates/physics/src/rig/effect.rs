//! Effects: what a rig may have and the nominal model omits, with their kinds and the interface of their plug-ins.

use crate::machine::hooks::{Hooks, TooManyExtraStates};
use crate::rig::instruments::Instruments;
use crate::simulation::model::Model;
use mapper_core::{named_enum, with_unit};
use serde::Serialize;
use std::borrow::Cow;
use std::marker::PhantomData;
use std::sync::Arc;

/// An effect whose parameters are the fields of `Self`. [`effect!`](crate::effect) implements it.
pub trait EffectKind: std::fmt::Debug + Send + Sync + Sized + 'static {
    /// Description and parameters.
    fn info() -> EffectInfo;

    /// Takes each parameter by its name.
    fn from_values(values: &NamedValues<'_>) -> Result<Self, EffectError>;

    /// Adds the effect to a rig. Neutral values change nothing.
    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates>;
}

/// The effect of a kind, for effect libraries.
pub fn effect_of<K: EffectKind>() -> Arc<dyn Effect> {
    Arc::new(KindEffect::<K> { info: K::info(), kind: PhantomData })
}

/// A kind with its row of text.
#[derive(Debug)]
struct KindEffect<K> {
    info: EffectInfo,
    kind: PhantomData<fn() -> K>,
}

impl<K: EffectKind> Effect for KindEffect<K> {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError> {
        Ok(K::from_values(values)?.put_into(rig)?)
    }
}

/// Declares an effect: its id, the texts of [`EffectInfo`], its parameters in the form that scripts use (a field, its name in files and
/// reports, `[unit] low .. high, neutral value, step value`), and its change to a rig.
///
/// ```
/// use mapper_physics::rig::effect::EffectKind;
///
/// mapper_physics::effect! {
///     struct Wall "wall";
///     name: "inner wall",
///     description: "the inner wall has its own temperature",
///     equation: "dT/dt = G (Tc - T)/C",
///     source: "two-node wall",
///     submodel: CompressorHousing, also_shows_in: [CompressorGas];
///     /// Conductance to the rest, W/K.
///     conductance_w_k = "G" ["W/K"] 1.0 .. 500.0, neutral 500.0, step -480.0;
///     |effect, rig| rig.model.params.compressor.inner_conductance_w_k = effect.conductance_w_k
/// }
/// let [parameter]: [_; 1] = Wall::info().parameters.try_into().unwrap();
/// assert_eq!((parameter.name.as_ref(), parameter.high, parameter.typical_step), ("G", 500.0, -480.0));
/// ```
#[macro_export]
macro_rules! effect {
    (
        $vis:vis struct $kind:ident $id:literal;
        name: $name:literal,
        description: $description:literal,
        equation: $equation:literal,
        source: $source:literal,
        submodel: $submodel:ident, also_shows_in: [$($neighbour:ident),*];
        $(
            $(#[$field_meta:meta])*
            $field:ident = $parameter:literal [$unit:literal] $low:literal .. $high:literal, neutral $neutral:literal, step $step:literal;
        )+
        |$effect:ident, $rig:ident| $change:expr
    ) => {
        #[doc = $description]
        #[derive(Debug, Clone, Copy)]
        $vis struct $kind {
            $($(#[$field_meta])* $vis $field: f64,)+
        }

        impl $crate::rig::effect::EffectKind for $kind {
            fn info() -> $crate::rig::effect::EffectInfo {
                use $crate::rig::effect::{EffectParameter, Submodel};
                $crate::rig::effect::EffectInfo {
                    id: $id.into(),
                    name: $name.into(),
                    description: $description.into(),
                    equation: $equation.into(),
                    source: $source.into(),
                    submodel: Submodel::$submodel,
                    also_shows_in: vec![$(Submodel::$neighbour),*],
                    parameters: vec![$(EffectParameter {
                        name: $parameter.into(),
                        unit: $unit.into(),
                        low: $low,
                        high: $high,
                        neutral: $neutral,
                        typical_step: $step,
                    }),+],
                }
            }

            fn from_values(
                values: &$crate::rig::effect::NamedValues<'_>,
            ) -> Result<Self, $crate::rig::effect::EffectError> {
                Ok($kind { $($field: values.get($parameter)?),+ })
            }

            fn put_into(
                self,
                $rig: &mut $crate::rig::effect::Rig,
            ) -> Result<(), $crate::machine::hooks::TooManyExtraStates> {
                let $effect = self;
                $change;
                Ok(())
            }
        }
    };
}

/// A machine with its instruments: everything an effect can change.
#[derive(Debug, Clone)]
pub struct Rig {
    /// The machine.
    pub model: Model,
    /// Sensors and actuators.
    pub instruments: Instruments,
}

impl Rig {
    /// A machine with ideal sensors and the declared actuator.
    pub fn new(model: Model) -> Self {
        Rig { model, instruments: Instruments::default() }
    }

    /// Adds something that is not a parameter.
    pub fn hook(&mut self, hooks: impl Hooks + 'static) -> Result<(), TooManyExtraStates> {
        self.model.hooks.push(Arc::new(hooks))
    }
}

named_enum! {
    /// The parts of a rig in which a gap can originate.
    pub enum Submodel {
        /// Response of P3 to its command.
        Actuator = "actuator",
        /// Flow that the turbine swallows.
        TurbineFlow = "turbine_flow",
        /// Speed from the balance of powers.
        Shaft = "shaft",
        /// Flow from speed and pressure ratio.
        CompressorFlow = "compressor_flow",
        /// The meter of the compressor's flow.
        FlowMeter = "flow_meter",
        /// Volume and back-pressure valve.
        Outlet = "outlet",
        /// Gas temperature through the compressor.
        CompressorGas = "compressor_gas",
        /// Probe before the compressor.
        T1Probe = "t1_probe",
        /// Probe after the compressor.
        T2Probe = "t2_probe",
        /// Probe in the compressor housing.
        TcProbe = "tc_probe",
        /// Pressure sensor after the compressor.
        P2Sensor = "p2_sensor",
        /// Pressure sensor before the compressor.
        P1Sensor = "p1_sensor",
        /// Pressure sensor before the turbine.
        P3Sensor = "p3_sensor",
        /// Probe before the turbine.
        T3Probe = "t3_probe",
        /// Pressure sensor after the turbine.
        P4Sensor = "p4_sensor",
        /// Probe of the oil's temperature.
        OilProbe = "oil_probe",
        /// Sensor of the shaft speed.
        SpeedSensor = "speed_sensor",
        /// Metal of the compressor.
        CompressorHousing = "compressor_housing",
        /// Metal of the turbine.
        TurbineHousing = "turbine_housing",
    }
}

/// A parameter that sets the strength of an effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectParameter {
    /// Name within the effect; the effect's own id if it has only one parameter.
    pub name: Cow<'static, str>,
    /// Unit, `1` for ratios.
    pub unit: Cow<'static, str>,
    /// Smallest valid value.
    pub low: f64,
    /// Largest valid value.
    pub high: f64,
    /// Value without effect.
    pub neutral: f64,
    /// Distance from neutral at which the effect is clearly visible: the first step of a search.
    pub typical_step: f64,
}

/// A row of a table of effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectInfo {
    /// Name: lower case, digits and `_`.
    pub id: Cow<'static, str>,
    /// Display name.
    pub name: Cow<'static, str>,
    /// A one-line description.
    pub description: Cow<'static, str>,
    /// The equation, in the symbols of `docs/reference/model.md`.
    pub equation: Cow<'static, str>,
    /// Source of the equation.
    pub source: Cow<'static, str>,
    /// Submodel.
    pub submodel: Submodel,
    /// Submodels in which its gap may also appear: neighbours that share a balance with it.
    pub also_shows_in: Vec<Submodel>,
    /// Parameters, at least one.
    pub parameters: Vec<EffectParameter>,
}

impl EffectInfo {
    /// Names of its parameters for messages.
    fn parameter_names(&self) -> String {
        let names: Vec<&str> = self.parameters.iter().map(|parameter| parameter.name.as_ref()).collect();
        names.join(", ")
    }

    /// Whether its gap may appear in the submodel of this name.
    pub fn shows_in(&self, submodel_name: &str) -> bool {
        std::iter::once(&self.submodel).chain(&self.also_shows_in).any(|place| place.name() == submodel_name)
    }
}

/// The values of an effect's parameters, one for each and within its range, accessed by name.
#[derive(Debug, Clone, Copy)]
pub struct NamedValues<'a> {
    info: &'a EffectInfo,
    values: &'a [f64],
}

impl<'a> NamedValues<'a> {
    /// `values` are in the order of the effect's parameters.
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

    /// Whether every value is neutral.
    pub fn is_neutral(&self) -> bool {
        self.iter().all(|(parameter, value)| parameter.neutral == value)
    }
}

/// A property that a rig may have.
///
/// It changes parameters of the model and of the instruments once, before a run; anything else it
/// adds as [`Hooks`]. At neutral values it changes nothing.
pub trait Effect: std::fmt::Debug + Send + Sync {
    /// Description.
    fn info(&self) -> &EffectInfo;

    /// Adds it to a rig.
    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError>;
}

/// Reason why an effect cannot be added to a rig.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum EffectError {
    #[error("effect `{id}` has the parameters {names}, and {given} values were given: give one for each")]
    Count { id: String, names: String, given: usize },
    #[error(
        "{name} = {} of effect `{id}` is not between {low} and {}",
        with_unit(value, unit),
        with_unit(high, unit)
    )]
    OutOfRange { id: String, name: String, value: f64, unit: String, low: f64, high: f64 },
    /// A bug in the effect.
    #[error("effect `{id}` has no parameter `{name}`; it has {names}")]
    NoParameter { id: String, name: String, names: String },
    #[error(transparent)]
    Room(#[from] TooManyExtraStates),
}

/// Adds `effect` to `rig`, after the effects already there; effects compose in any number and order.
/// After an error the rig is unchanged.
pub fn add(rig: &mut Rig, effect: &dyn Effect, values: &[f64]) -> Result<(), EffectError> {
    effect.prepare(&NamedValues::new(effect.info(), values)?, rig)
}
