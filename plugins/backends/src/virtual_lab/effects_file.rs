//! Below `virtual_lab`: `effects:` of the simulated machine that the nominal model of the campaign omits, and `faults:`, offset, slow or stuck
//! sensors among the redundant ones as declared.

use crate::virtual_lab::sensors::{Draws, LabElement, LabElements, SensorErrors, offset_kind, stream};
use crate::virtual_lab::setting_problem::{SettingProblem, check_range};
use mapper_core::{BackendError, Channel, DeclaredElement, Element};
use mapper_physics::rig::backend_plugin::NominalRig;
use mapper_physics::rig::effect::{self, Effect, EffectParameter, Rig};
use mapper_yaml::units::{Duration, Kind, Length, Quantity};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;
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

/// Applies the effects to a rig: those of the library by their ids, others by their files.
pub(crate) fn apply_effects(
    rig: &mut Rig,
    requested: &BTreeMap<String, EffectValues>,
    nominal: &NominalRig,
) -> Result<(), BackendError> {
    for (id, values) in requested {
        let key = format!("effects.{id}");
        let effect = find_effect(id, nominal).map_err(|problem| problem.at(key.as_str()))?;
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

fn find_effect(id: &str, nominal: &NominalRig) -> Result<Arc<dyn Effect>, SettingProblem> {
    if id.ends_with(".rhai") {
        return (nominal.read_effect)(Path::new(id)).map_err(SettingProblem::EffectFile);
    }
    let known = &nominal.effects;
    known.iter().find(|effect| effect.info().id == id).cloned().ok_or_else(|| {
        let ids: Vec<&str> = known.iter().map(|effect| effect.info().id.as_ref()).collect();
        let guess = mapper_yaml::closest(id, &ids).map(|guess| format!(" Did you mean `{guess}`?"));
        SettingProblem::UnknownEffect { guess: guess.unwrap_or_default(), known: ids.join(", ") }
    })
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

/// One entry: `{channel: T2, element: 2, offset: 1.5 K}`, or with `stuck_after`, `probe_diameter` or `lag`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct FaultFile {
    /// A channel with redundant sensors.
    channel: Channel,
    /// Number of the sensor, from 1.
    element: usize,
    /// Offset, in place of the drawn one.
    #[serde(default)]
    offset: Option<String>,
    /// Run time at which the reading freezes.
    #[serde(default)]
    stuck_after: Option<Quantity<Duration>>,
    /// Diameter of its tip; for T2 only.
    #[serde(default)]
    probe_diameter: Option<Quantity<Length>>,
    /// Time constant of its lag.
    #[serde(default)]
    lag: Option<Quantity<Duration>>,
}

/// The sensors of all channels with redundant sensors.
pub(crate) fn read_elements(
    files: &[FaultFile],
    nominal: &NominalRig,
    draws: &Draws,
    offset_of: &BTreeMap<Channel, f64>,
) -> Result<BTreeMap<Channel, LabElements>, BackendError> {
    let mut lab: BTreeMap<Channel, LabElements> = nominal
        .redundant
        .keys()
        .filter_map(|channel| Some((*channel, make_elements(*channel, nominal, draws)?)))
        .collect();
    // The settings of a channel apply to each of its sensors.
    for (channel, offset) in offset_of {
        let members = lab.get_mut(channel).map(|elements| &mut elements.elements);
        members.into_iter().flatten().for_each(|element| element.errors.offset = *offset);
    }
    for (index, file) in files.iter().enumerate() {
        apply_fault(&mut lab, index, file)?;
    }
    Ok(lab)
}

fn make_elements(channel: Channel, nominal: &NominalRig, draws: &Draws) -> Option<LabElements> {
    let declared = nominal.redundant.get(&channel)?.clone();
    let common = declared.common_offset_sigma * draws.of(channel as u64).0;
    // Probes of the declared diameter have the true diameter of the machine's probe, which may differ.
    let first_m = declared.elements.first().map(|element| element.probe_diameter_m);
    let have_equal_tips = declared.elements.iter().all(|element| Some(element.probe_diameter_m) == first_m);
    let make_element = |(index, element): (usize, &DeclaredElement)| {
        let errors = draws.errors(channel, &element.declared, stream(Element { channel, number: index + 1 }));
        LabElement {
            errors: SensorErrors { offset: errors.offset + common, ..errors },
            probe_diameter_m: (channel == Channel::T2 && !have_equal_tips)
                .then_some(element.probe_diameter_m),
            lag_s: 0.0,
            stuck_after_s: f64::INFINITY,
        }
    };
    let elements = declared.elements.iter().enumerate().map(make_element).collect();
    Some(LabElements { declared, elements })
}

fn apply_fault(
    lab: &mut BTreeMap<Channel, LabElements>,
    index: usize,
    file: &FaultFile,
) -> Result<(), BackendError> {
    let key = |key: &str| format!("faults[{index}].{key}");
    let count = lab.get(&file.channel).map_or(0, |elements| elements.elements.len());
    let element = lab
        .get_mut(&file.channel)
        .and_then(|elements| elements.elements.get_mut(file.element.checked_sub(1)?));
    let Some(element) = element else {
        let problem = SettingProblem::NoElement { channel: file.channel, count };
        return Err(problem.at(key(if count == 0 { "channel" } else { "element" })));
    };
    if let Some(text) = &file.offset {
        let kind = offset_kind(file.channel);
        element.errors.offset = mapper_yaml::units::parse(kind, text)
            .map_err(|source| SettingProblem::Quantity { kind, source }.at(key("offset")))?;
    }
    if let Some(stuck_after) = file.stuck_after {
        element.stuck_after_s = stuck_after.value;
    }
    if let Some(diameter) = file.probe_diameter {
        if file.channel != Channel::T2 {
            return Err(SettingProblem::NoProbe { channel: file.channel }.at(key("probe_diameter")));
        }
        check_range(1e3 * diameter.value, "mm", 0.0..=20.0)
            .map_err(|problem| problem.at(key("probe_diameter")))?;
        element.probe_diameter_m = Some(diameter.value);
    }
    if let Some(lag) = file.lag {
        check_range(lag.value, "s", 0.0..=3600.0).map_err(|problem| problem.at(key("lag")))?;
        element.lag_s = lag.value;
    }
    Ok(())
}
