//! An effect as a struct of its own parameters, with its description and its change to a rig.

use crate::machine::hooks::TooManyExtraStates;
use crate::rig::effect::{Effect, EffectError, EffectInfo, EffectParameter, NamedValues, Rig, Submodel};
use std::borrow::Cow;
use std::marker::PhantomData;
use std::sync::Arc;

/// A row of a table of effects, without the parameters.
#[derive(Debug, Clone, Copy)]
pub struct EffectText {
    /// Name: lower case, digits and `_`.
    pub id: &'static str,
    /// Display name, a noun that can be the subject of a sentence.
    pub name: &'static str,
    /// A one-line description.
    pub description: &'static str,
    /// The equation, in the symbols of `docs/reference/model.md`.
    pub equation: &'static str,
    /// Source of the equation.
    pub source: &'static str,
    /// Submodel.
    pub submodel: Submodel,
    /// Submodels in which its gap may also appear: neighbours that share a balance with it.
    pub also_shows_in: &'static [Submodel],
}

/// The parameters of an effect, by their names. [`effect_parameters!`](crate::effect_parameters) implements it.
pub trait EffectNumbers: Sized {
    /// Every parameter with its range.
    fn parameters() -> Vec<EffectParameter>;

    /// Takes each parameter by its name.
    ///
    /// # Errors
    /// [`EffectError::NoParameter`] if a name is missing.
    fn from_values(values: &NamedValues<'_>) -> Result<Self, EffectError>;
}

/// An effect whose parameters are the fields of `Self`.
pub trait EffectKind: EffectNumbers + std::fmt::Debug + Send + Sync + 'static {
    /// Description.
    const ABOUT: EffectText;

    /// Adds the effect to a rig. Neutral values change nothing.
    ///
    /// # Errors
    /// [`TooManyExtraStates`] if the rig has no room for its hidden temperatures.
    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates>;
}

/// The effect of a kind, for effect libraries.
pub fn effect_of<K: EffectKind>() -> Arc<dyn Effect> {
    let EffectText { id, name, description, equation, source, submodel, also_shows_in } = K::ABOUT;
    let info = EffectInfo {
        id: Cow::Borrowed(id),
        name: Cow::Borrowed(name),
        description: Cow::Borrowed(description),
        equation: Cow::Borrowed(equation),
        source: Cow::Borrowed(source),
        submodel,
        also_shows_in: also_shows_in.to_vec(),
        parameters: K::parameters(),
    };
    Arc::new(KindEffect::<K> { info, kind: PhantomData })
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

/// Declares the struct of an effect's parameters, in the form that scripts use: a field, its name in files and reports,
/// `[unit] low .. high, neutral value, step value`.
///
/// ```
/// use mapper_physics::rig::effect_kind::EffectNumbers;
///
/// mapper_physics::effect_parameters! {
///     /// A wall with its own temperature.
///     #[derive(Debug)]
///     struct Wall {
///         /// Conductance to the rest, W/K.
///         conductance_w_k = "G" ["W/K"] 1.0 .. 500.0, neutral 500.0, step -480.0;
///     }
/// }
/// let [parameter]: [_; 1] = Wall::parameters().try_into().unwrap();
/// assert_eq!((parameter.name.as_ref(), parameter.high, parameter.typical_step), ("G", 500.0, -480.0));
/// ```
#[macro_export]
macro_rules! effect_parameters {
    (
        $(#[$meta:meta])* $vis:vis struct $kind:ident {
            $(
                $(#[$field_meta:meta])*
                $field:ident = $name:literal [$unit:literal] $low:literal .. $high:literal, neutral $neutral:literal, step $step:literal;
            )+
        }
    ) => {
        $(#[$meta])*
        $vis struct $kind {
            $($(#[$field_meta])* $vis $field: f64,)+
        }

        impl $crate::rig::effect_kind::EffectNumbers for $kind {
            fn parameters() -> Vec<$crate::rig::effect::EffectParameter> {
                vec![$($crate::rig::effect::EffectParameter {
                    name: $name.into(),
                    unit: $unit.into(),
                    low: $low,
                    high: $high,
                    neutral: $neutral,
                    typical_step: $step,
                }),+]
            }

            fn from_values(
                values: &$crate::rig::effect::NamedValues<'_>,
            ) -> Result<Self, $crate::rig::effect::EffectError> {
                Ok($kind { $($field: values.get($name)?),+ })
            }
        }
    };
}
