//! `effects:` below `virtual_lab`: effects of the simulated machine that the nominal model of the campaign omits.

use crate::virtual_lab::setting_problem::SettingProblem;
use mapper_core::BackendError;
use mapper_physics::rig::effect::{self, Effect, EffectParameter, Rig};
use mapper_yaml::units::Kind;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A single value, or several values by name.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub(crate) enum EffectValues {
    Number(f64),
    Text(String),
    Named(BTreeMap<String, ValueText>),
}

/// A number, for ratios, or a value with its unit.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub(crate) enum ValueText {
    Number(f64),
    Text(String),
}

/// Applies the effects to a rig.
pub(crate) fn apply_effects(
    rig: &mut Rig,
    requested: &BTreeMap<String, EffectValues>,
    known: &[Arc<dyn Effect>],
) -> Result<(), BackendError> {
    for (id, values) in requested {
        let key = format!("effects.{id}");
        let Some(effect) = known.iter().find(|effect| effect.info().id == id.as_str()) else {
            let ids: Vec<&str> = known.iter().map(|effect| effect.info().id.as_ref()).collect();
            let guess = mapper_yaml::closest(id, &ids).map(|guess| format!(" Did you mean `{guess}`?"));
            let (guess, known) = (guess.unwrap_or_default(), ids.join(", "));
            return Err(SettingProblem::UnknownEffect { guess, known }.at(key));
        };
        let parameters = &effect.info().parameters;
        if let Some(name) = values.unknown_name(parameters) {
            return Err(form_problem(parameters).at(format!("{key}.{name}")));
        }
        read_parameters(parameters, values)
            .and_then(|values| Ok(effect::add(rig, effect.as_ref(), &values)?))
            .map_err(|problem| problem.at(key))?;
    }
    Ok(())
}

impl EffectValues {
    /// The first name that is not a parameter.
    fn unknown_name(&self, parameters: &[EffectParameter]) -> Option<&str> {
        let EffectValues::Named(values) = self else { return None };
        values
            .keys()
            .map(String::as_str)
            .find(|name| parameters.iter().all(|parameter| parameter.name != *name))
    }
}

/// A value for each parameter, in their order.
fn read_parameters(
    parameters: &[EffectParameter],
    values: &EffectValues,
) -> Result<Vec<f64>, SettingProblem> {
    let read_parameter = |parameter: &EffectParameter| {
        let value = match values {
            EffectValues::Number(number) if parameters.len() == 1 => &ValueText::Number(*number),
            EffectValues::Text(text) if parameters.len() == 1 => &ValueText::Text(text.clone()),
            EffectValues::Named(values) => {
                values.get(parameter.name.as_ref()).ok_or_else(|| form_problem(parameters))?
            }
            EffectValues::Number(_) | EffectValues::Text(_) => return Err(form_problem(parameters)),
        };
        read_value(parameter, value)
    };
    parameters.iter().map(read_parameter).collect()
}

fn form_problem(parameters: &[EffectParameter]) -> SettingProblem {
    let names: Vec<String> = parameters
        .iter()
        .map(|parameter| format!("{}: a value in {}", parameter.name, parameter.unit))
        .collect();
    SettingProblem::EffectForm { form: format!("{{{}}}", names.join(", ")) }
}

fn read_value(parameter: &EffectParameter, value: &ValueText) -> Result<f64, SettingProblem> {
    let unit = parameter.unit.as_ref();
    let ratio = matches!(unit, "1" | "kg/kg");
    match value {
        ValueText::Number(number) if ratio => Ok(*number),
        ValueText::Number(value) => Err(SettingProblem::BareNumber { value: *value, unit: unit.to_owned() }),
        ValueText::Text(text) => {
            if let Some(Ok(number)) = text.trim().strip_suffix(unit).map(|number| number.trim().parse()) {
                return Ok(number);
            }
            let kind = match unit {
                "m" => Kind::Length,
                "m2" => Kind::Area,
                "s" => Kind::Duration,
                "K" => Kind::TemperatureDifference,
                "Pa" => Kind::PressureDifference,
                "W/K" => Kind::Conductance,
                _ if ratio => Kind::Fraction,
                _ => return Err(SettingProblem::NotInUnit { text: text.clone(), unit: unit.to_owned() }),
            };
            mapper_yaml::units::parse(kind, text).map_err(|source| SettingProblem::Quantity { kind, source })
        }
    }
}
