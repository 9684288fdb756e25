//! An effect as a struct of its own parameters, with its description and its change to a rig.

use crate::machine::hooks::TooManyExtraStates;
use crate::rig::effect::{Effect, EffectError, EffectInfo, NamedValues, Rig};
use std::marker::PhantomData;
use std::sync::Arc;

/// An effect whose parameters are the fields of `Self`. [`effect!`](crate::effect) implements it.
pub trait EffectKind: std::fmt::Debug + Send + Sync + Sized + 'static {
    /// Description and parameters.
    fn info() -> EffectInfo;

    /// Takes each parameter by its name.
    ///
    /// # Errors
    /// [`EffectError::NoParameter`] if a name is missing.
    fn from_values(values: &NamedValues<'_>) -> Result<Self, EffectError>;

    /// Adds the effect to a rig. Neutral values change nothing.
    ///
    /// # Errors
    /// [`TooManyExtraStates`] if the rig has no room for its hidden temperatures.
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
/// use mapper_physics::rig::effect_kind::EffectKind;
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

        impl $crate::rig::effect_kind::EffectKind for $kind {
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
