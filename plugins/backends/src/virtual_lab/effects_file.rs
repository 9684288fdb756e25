//! The file with the effects of the virtual lab, and its mistakes.

use crate::virtual_lab::sensors::{Draws, LabElement, LabElements, SensorErrors, offset_kind, stream};
use mapper_core::{BackendError, Channel, DeclaredElement, Element, with_unit};
use mapper_physics::rig::backend_plugin::NominalRig;
use mapper_physics::rig::effect::{self, Effect, EffectError, EffectParameter, Rig};
use mapper_yaml::units::{Duration, Kind, Length, Quantity, UnitError};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
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

/// An error in one of the lab's settings. [`BackendError::Settings`] carries it together with the key.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum SettingProblem {
    /// An unknown key, or a value of the wrong type.
    #[error(transparent)]
    Form(#[from] serde_json::Error),
    /// The unit is empty for ratios.
    #[error("{} is not between {low} and {}", with_unit(value, unit), with_unit(high, unit))]
    OutOfRange { value: f64, unit: &'static str, low: f64, high: f64 },
    #[error("{value} {unit} must be above 0")]
    NotPositive { value: f64, unit: &'static str },
    #[error("{value} {unit} must not be negative")]
    Negative { value: f64, unit: &'static str },
    /// A text that is not a value with a unit of the right kind.
    #[error("{source}; {}", source.remedy(*kind))]
    Quantity { kind: Kind, source: UnitError },
    #[error("`{text}` is not a number and `{unit}`: write e.g. `1e-6 {unit}`")]
    NotInUnit { text: String, unit: String },
    #[error("{value} has no unit: write `{value} {unit}`")]
    BareNumber { value: f64, unit: String },
    /// `guess`: the effect that was probably meant, as a question after a blank, or empty.
    #[error("unknown effect.{guess} The effects are {known}, or the path of a file in rhai")]
    UnknownEffect { guess: String, known: String },
    #[error(transparent)]
    EffectFile(Box<dyn std::error::Error + Send + Sync>),
    #[error("write {form}")]
    EffectForm { form: String },
    #[error(transparent)]
    Effect(#[from] EffectError),
    #[error("`{cause}` cannot drift: write a measured channel, `fouling` or `bearing_friction`")]
    UnknownDrift { cause: String },
    #[error("the duration {over_s} s must be above 0; remove `over` for a step")]
    NoDuration { over_s: f64 },
    /// `count` is 0 for a single sensor.
    #[error(
        "the campaign declares {count} redundant sensors of {channel}: write the number of one of them, from 1"
    )]
    NoElement { channel: Channel, count: usize },
    #[error("only T2 probes have a simulated tip: write `lag` for {channel}")]
    NoProbe { channel: Channel },
    #[error("{text} is too large: at most {} %", 100.0 * limit_ratio)]
    DriftTooLarge { text: String, limit_ratio: f64 },
}

impl SettingProblem {
    /// The problem at its key below `virtual_lab:`.
    pub fn at(self, path: impl Into<String>) -> BackendError {
        BackendError::Settings { backend: NAME.to_owned(), path: path.into(), source: Box::new(self) }
    }
}

/// Refuses a value outside its range.
pub fn check_range(value: f64, unit: &'static str, range: RangeInclusive<f64>) -> Result<(), SettingProblem> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(SettingProblem::OutOfRange { value, unit, low: *range.start(), high: *range.end() })
}

/// Name of this backend in campaigns.
pub const NAME: &str = "virtual_lab";
