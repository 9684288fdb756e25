//! `effects:` below `virtual_lab`: what the machine has that the campaign's nominal model has not.

use mapper_physics::effect::{self, Effect, EffectParameter, Rig};
use mapper_yaml::units::Kind;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// One value, or several by their names.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub(super) enum EffectValues {
    Number(f64),
    Text(String),
    Named(BTreeMap<String, ValueText>),
}

/// A bare number, for ratios, or a value with its unit.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub(super) enum ValueText {
    Number(f64),
    Text(String),
}

/// Puts the effects into a rig; gives the key that is wrong and what would be right.
pub(super) fn put_in(
    rig: &mut Rig,
    wanted: &BTreeMap<String, EffectValues>,
    known: &[Arc<dyn Effect>],
) -> Result<(), (String, String)> {
    for (id, values) in wanted {
        let key = || format!("effects.{id}");
        let Some(effect) = known.iter().find(|effect| effect.info().id == id.as_str()) else {
            let ids: Vec<&str> = known.iter().map(|effect| effect.info().id.as_ref()).collect();
            return Err((key(), format!("there is no such effect; there are {}", ids.join(", "))));
        };
        let parameters = &effect.info().parameters;
        let values = match (values, parameters.as_slice()) {
            (EffectValues::Number(number), [only]) => vec![read(only, &ValueText::Number(*number))],
            (EffectValues::Text(text), [only]) => vec![read(only, &ValueText::Text(text.clone()))],
            (EffectValues::Named(values), several) => {
                if let Some(name) =
                    values.keys().find(|name| several.iter().all(|one| one.name != name.as_str()))
                {
                    return Err((format!("effects.{id}.{name}"), names(several)));
                }
                several
                    .iter()
                    .map(|one| {
                        values
                            .get(one.name.as_ref())
                            .map_or_else(|| Err(names(several)), |text| read(one, text))
                    })
                    .collect()
            }
            (_, several) => return Err((key(), names(several))),
        };
        let values: Vec<f64> =
            values.into_iter().collect::<Result<_, String>>().map_err(|message| (key(), message))?;
        effect::add(rig, effect.as_ref(), &values).map_err(|error| (key(), error.to_string()))?;
    }
    Ok(())
}

fn names(parameters: &[EffectParameter]) -> String {
    let names: Vec<String> =
        parameters.iter().map(|one| format!("{}: a value in {}", one.name, one.unit)).collect();
    format!("write {{{}}}", names.join(", "))
}

fn read(parameter: &EffectParameter, value: &ValueText) -> Result<f64, String> {
    let unit = parameter.unit.as_ref();
    let ratio = matches!(unit, "1" | "kg/kg");
    match value {
        ValueText::Number(number) if ratio => Ok(*number),
        ValueText::Number(number) => Err(format!("{number} lacks its unit: write `{number} {unit}`")),
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
                _ => return Err(format!("`{text}` is not a number and `{unit}`")),
            };
            mapper_yaml::units::parse(kind, text).map_err(|error| error.to_string())
        }
    }
}
