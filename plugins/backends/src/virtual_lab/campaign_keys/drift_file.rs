//! `drift:` below `virtual_lab`: drifts during the campaign.

use crate::virtual_lab::campaign_keys::setting_problem::SettingProblem;
use crate::virtual_lab::rig::drift::{DriftTarget, LabDrift};
use crate::virtual_lab::sensors::offset_kind;
use mapper_core::{BackendError, Channel, Dimension};
use mapper_yaml::units::{Kind, Quantity};
use serde::Deserialize;

/// One entry: `{cause: T2, change: 0.5 K, over: 4 h, from: 10 min}`, or without `over` a step.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct DriftFile {
    /// A channel, `fouling` or `bearing_friction`.
    cause: String,
    /// Size of the change, with its unit.
    change: String,
    /// Duration of the change; it continues at this rate afterwards. Default: a step.
    #[serde(default)]
    over: Option<Quantity<mapper_yaml::units::Duration>>,
    /// Start; default 0, negative for a drift that began before the run.
    #[serde(default)]
    from: Option<Quantity<mapper_yaml::units::Duration>>,
}

/// Drifts with their units resolved.
pub(crate) fn read(files: &[DriftFile]) -> Result<Vec<LabDrift>, BackendError> {
    files.iter().enumerate().map(|(index, file)| read_one(index, file)).collect()
}

fn read_one(index: usize, file: &DriftFile) -> Result<LabDrift, BackendError> {
    let key = |key: &str| format!("drift[{index}].{key}");
    let target = match file.cause.as_str() {
        "fouling" => DriftTarget::Fouling,
        "bearing_friction" => DriftTarget::BearingFriction,
        name => match serde_json::from_value::<Channel>(serde_json::json!(name)) {
            Ok(channel) if !is_command(channel) => DriftTarget::Sensor(channel),
            _ => return Err(SettingProblem::UnknownDrift { cause: name.to_owned() }.at(key("cause"))),
        },
    };
    let change = parse_change(target, &file.change).map_err(|problem| problem.at(key("change")))?;
    let over_s = file.over.map(|over| over.value);
    if let Some(over_s) = over_s.filter(|over_s| *over_s <= 0.0) {
        return Err(SettingProblem::NoDuration { over_s }.at(key("over")));
    }
    Ok(LabDrift { target, change, over_s, from_s: file.from.map_or(0.0, |from| from.value) })
}

fn is_command(channel: Channel) -> bool {
    matches!(channel, Channel::P3Command | Channel::T3Command | Channel::ValveCommand | Channel::TOilCommand)
}

/// Maximum relative change: a larger one would be physically impossible for the machine or its air supply.
const MAX_CHANGE_RATIO: f64 = 0.3;

fn parse_change(target: DriftTarget, text: &str) -> Result<f64, SettingProblem> {
    const FRICTION: &str = "W s2/rad2";
    let kind = match target {
        DriftTarget::Sensor(channel) if channel.info().dimension == Dimension::MassFlow => Kind::Fraction,
        DriftTarget::Sensor(channel) => offset_kind(channel),
        DriftTarget::Fouling => Kind::Fraction,
        DriftTarget::BearingFriction => {
            let number = text.trim().strip_suffix(FRICTION).map(|number| number.trim().parse());
            return match number {
                Some(Ok(value)) if f64::is_finite(value) => Ok(value),
                _ => Err(SettingProblem::NotInUnit { text: text.to_owned(), unit: FRICTION.to_owned() }),
            };
        }
    };
    let value =
        mapper_yaml::units::parse(kind, text).map_err(|source| SettingProblem::Quantity { kind, source })?;
    if kind == Kind::Fraction && value.abs() > MAX_CHANGE_RATIO {
        return Err(SettingProblem::DriftTooLarge { text: text.to_owned(), limit_ratio: MAX_CHANGE_RATIO });
    }
    Ok(value)
}
