//! An effect as a struct of its own numbers: one struct, what is said of it, and what it does to a rig.

use crate::effect::{Effect, EffectError, EffectInfo, EffectParameter, NamedValues, Rig, Submodel};
use crate::hooks::TooManyExtraStates;
use std::borrow::Cow;
use std::marker::PhantomData;
use std::sync::Arc;

/// What stands in a table of effects, but for the numbers.
#[derive(Debug, Clone, Copy)]
pub struct About {
    /// Name: lower case, digits and `_`.
    pub id: &'static str,
    /// Its name for people, a noun that can be the subject of a sentence.
    pub name: &'static str,
    /// What happens, one line for people.
    pub description: &'static str,
    /// The equation, in the symbols of `docs/physics.md`.
    pub equation: &'static str,
    /// Where the equation comes from.
    pub source: &'static str,
    /// Where it sits.
    pub submodel: Submodel,
    /// Where its gap may show as well: neighbours that share a balance with it.
    pub also_shows_in: &'static [Submodel],
}

/// The numbers of an effect, by their names. [`effect_parameters!`](crate::effect_parameters) writes it.
pub trait EffectNumbers: Sized {
    /// Every number with its range.
    fn parameters() -> Vec<EffectParameter>;

    /// Takes each number by its name.
    ///
    /// # Errors
    /// [`EffectError::NoParameter`] where a name is missing.
    fn from_values(values: &NamedValues<'_>) -> Result<Self, EffectError>;
}

/// An effect whose numbers are the fields of `Self`.
pub trait EffectKind: EffectNumbers + std::fmt::Debug + Send + Sync + 'static {
    /// What it is.
    const ABOUT: About;

    /// Puts it into a rig. At neutral numbers nothing changes.
    ///
    /// # Errors
    /// [`TooManyExtraStates`] where it brings hidden temperatures for which there is no room.
    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates>;
}

/// The effect of a kind, as catalogues list it.
pub fn effect_of<K: EffectKind>() -> Arc<dyn Effect> {
    let About { id, name, description, equation, source, submodel, also_shows_in } = K::ABOUT;
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
    Arc::new(OfKind::<K> { info, kind: PhantomData })
}

/// A kind with its row of text.
#[derive(Debug)]
struct OfKind<K> {
    info: EffectInfo,
    kind: PhantomData<fn() -> K>,
}

impl<K: EffectKind> Effect for OfKind<K> {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError> {
        Ok(K::from_values(values)?.put_into(rig)?)
    }
}

/// Declares the struct of an effect's numbers, in the form that scripts use: a field, its name in files and reports,
/// `[unit] low .. high, neutral value, step value`.
///
/// ```
/// use mapper_physics::effect_kind::EffectNumbers;
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

        impl $crate::effect_kind::EffectNumbers for $kind {
            fn parameters() -> Vec<$crate::effect::EffectParameter> {
                vec![$($crate::effect::EffectParameter {
                    name: $name.into(),
                    unit: $unit.into(),
                    low: $low,
                    high: $high,
                    neutral: $neutral,
                    typical_step: $step,
                }),+]
            }

            fn from_values(
                values: &$crate::effect::NamedValues<'_>,
            ) -> Result<Self, $crate::effect::EffectError> {
                Ok($kind { $($field: values.get($name)?),+ })
            }
        }
    };
}
