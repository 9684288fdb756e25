//! The header of a script: lines `//! key: value` that describe the effect.

use mapper_core::Channel;
use mapper_physics::rig::effect::{EffectInfo, EffectParameter, Submodel};
use std::borrow::Cow;

/// A line, from 1, if known, and the error.
pub(super) type Mistake = (Option<usize>, String);

/// Maximum number of parameters of a script: each is a dimension of the fit.
const MAX_PARAMETERS: usize = 4;

const LAG_FORM: &str = "//! lag: CHANNEL PARAMETER";

/// Notation of a parameter.
const PARAMETER_FORM: &str = "//! parameter: NAME [UNIT] LOW .. HIGH, neutral VALUE, step VALUE";

pub(super) struct Header {
    pub info: EffectInfo,
    /// Sensor lags, each with the parameter that holds its time constant.
    pub lags: Vec<(Channel, String)>,
}

pub(super) fn read(text: &str) -> Result<Header, Mistake> {
    let (mut id, mut description, mut equation, mut source) = (None, None, None, None);
    let mut submodel = None;
    let mut lags: Vec<(Channel, String)> = Vec::new();
    let mut parameters: Vec<EffectParameter> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let Some(header) = line.trim_start().strip_prefix("//!") else { continue };
        let at_line = |message: String| (Some(index + 1), message);
        let Some((key, value)) = header.split_once(':') else { continue };
        let value = value.trim();
        let owned = || Some(Cow::<'static, str>::Owned(value.to_owned()));
        match key.trim() {
            "effect" if is_name(value) => id = owned(),
            "effect" => {
                return Err(at_line(format!(
                    "`{value}` is not a valid name: use lower-case letters, digits and _, at most 40"
                )));
            }
            "description" => description = owned(),
            "equation" => equation = owned(),
            "source" => source = owned(),
            "submodel" => submodel = Some(submodel_called(value).map_err(at_line)?),
            "parameter" => {
                let parameter =
                    parameter(value).ok_or_else(|| at_line(format!("write `{PARAMETER_FORM}`")))?;
                check(&parameter, &parameters).map_err(at_line)?;
                parameters.push(parameter);
            }
            "lag" => {
                let (channel, name) = value
                    .split_once(char::is_whitespace)
                    .ok_or_else(|| at_line(format!("write `{LAG_FORM}`")))?;
                let channel: Channel = channel.parse().map_err(|unknown| at_line(format!("{unknown}")))?;
                lags.push((channel, name.trim().to_owned()));
            }
            other => {
                let keys = "effect, description, equation, source, submodel, parameter, lag";
                return Err(at_line(format!("`{other}` is not a key of an effect; the keys are {keys}")));
            }
        }
    }
    let missing = |line: &str| (None, format!("the header has no `{line}`"));
    if parameters.is_empty() {
        return Err(missing(PARAMETER_FORM));
    }
    let id = id.ok_or_else(|| missing("//! effect: NAME"))?;
    if let Some((_, name)) = lags.iter().find(|(_, name)| parameters.iter().all(|p| p.name != *name)) {
        return Err((None, format!("the lag's `{name}` is not a parameter; write `{LAG_FORM}`")));
    }
    let info = EffectInfo {
        name: Cow::Owned(id.replace('_', " ")),
        description: description.unwrap_or_else(|| id.clone()),
        equation: equation.unwrap_or(Cow::Borrowed("as in its script")),
        source: source.unwrap_or(Cow::Borrowed("suspected by the user")),
        submodel: submodel.ok_or_else(|| missing("//! submodel: NAME"))?,
        also_shows_in: Vec::new(),
        id,
        parameters,
    };
    Ok(Header { info, lags })
}

fn submodel_called(name: &str) -> Result<Submodel, String> {
    Submodel::ALL.into_iter().find(|submodel| submodel.name() == name).ok_or_else(|| {
        let names: Vec<&str> = Submodel::ALL.iter().map(|submodel| submodel.name()).collect();
        format!("`{name}` is not a submodel; the submodels are {}", names.join(", "))
    })
}

fn is_name(text: &str) -> bool {
    (1..=40).contains(&text.len())
        && text.starts_with(|c: char| c.is_ascii_lowercase())
        && text.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
}

fn is_identifier(text: &str) -> bool {
    (1..=40).contains(&text.len())
        && text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// `G [W/K] 0 .. 20, neutral 0, step 1.5`.
fn parameter(text: &str) -> Option<EffectParameter> {
    let (name, rest) = text.split_once('[')?;
    let (unit, rest) = rest.split_once(']')?;
    let mut parts = rest.split(',').map(str::trim);
    let (low, high) = parts.next()?.split_once("..")?;
    let neutral = parts.next()?.strip_prefix("neutral")?;
    let step = parts.next()?.strip_prefix("step")?;
    if parts.next().is_some() {
        return None;
    }
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    Some(EffectParameter {
        name: Cow::Owned(name.trim().to_owned()),
        unit: Cow::Owned(unit.trim().to_owned()),
        low: number(low)?,
        high: number(high)?,
        neutral: number(neutral)?,
        typical_step: number(step)?,
    })
}

fn check(parameter: &EffectParameter, others: &[EffectParameter]) -> Result<(), String> {
    let EffectParameter { name, low, high, neutral, typical_step, .. } = parameter;
    if !is_identifier(name) {
        return Err(format!("`{name}` is not a valid name of a parameter: use letters, digits and _"));
    }
    if others.iter().any(|other| other.name == *name) {
        return Err(format!("there are two parameters `{name}`"));
    }
    if others.len() >= MAX_PARAMETERS {
        return Err(format!("more than {MAX_PARAMETERS} parameters cannot be distinguished"));
    }
    if !(low < high && (low..=high).contains(&neutral)) {
        return Err(format!("{low} .. {high} must increase and contain the neutral value {neutral}"));
    }
    if *typical_step == 0.0 || !(*low..=*high).contains(&(neutral + typical_step)) {
        return Err(format!(
            "the step {typical_step} must lead from {neutral} to another value of {low} .. {high}"
        ));
    }
    Ok(())
}
