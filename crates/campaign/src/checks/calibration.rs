//! Checks that the calibration of each sensor supports its readings.

use crate::campaign::Campaign;
use crate::elements::rig::calibration::{Calibration, CalibrationRule, Date};
use mapper_core::{CalibrationDefect, Channel, DeclaredUncertainty, Warning};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::hold_speed;
use mapper_physics::rig::instruments::true_value;
use mapper_physics::simulation::model::Model;
use mapper_yaml::Step;
use std::collections::BTreeMap;

/// A defect of a sensor's calibration, at its place in the campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationWarning {
    /// The key of the calibration.
    pub at: Vec<Step>,
    /// The defect.
    pub warning: Warning,
}

impl Campaign {
    /// The defects of all calibrations on the day of a run. `readings`: lowest and highest reading of a channel.
    pub fn calibration_warnings(
        &self,
        day: Option<Date>,
        readings: impl Fn(Channel) -> Option<(f64, f64)>,
    ) -> Vec<CalibrationWarning> {
        let mut warnings = Vec::new();
        for (&channel, declaration) in &self.sensors {
            let range = readings(channel);
            for (index, sensor, calibration) in declaration.calibrated(channel) {
                let redundant =
                    declaration.redundant.as_ref().and_then(|sensors| sensors.elements.get(index?));
                let declared = redundant.map_or(declaration.declared, |element| element.declared);
                let mut defects = Vec::new();
                if self.calibration == CalibrationRule::Required {
                    let missing = first_missing_key(calibration).map(str::to_owned);
                    defects.extend(missing.map(|key| CalibrationDefect::Missing { key }));
                }
                defects.extend(calibration.into_iter().flat_map(|calibration| {
                    find_contradictions(channel, calibration, day, range, &declared)
                }));
                let sensors = [Step::from("sensors"), Step::from(channel.symbol())].into_iter();
                let at: Vec<Step> =
                    sensors.chain(index.map(Step::from)).chain([Step::from("calibration")]).collect();
                let warning = |defect| CalibrationWarning {
                    at: at.clone(),
                    warning: Warning::Calibration { channel, sensor: sensor.clone(), defect },
                };
                warnings.extend(defects.into_iter().map(warning));
            }
        }
        warnings
    }
}

fn first_missing_key(calibration: Option<&Calibration>) -> Option<&'static str> {
    let Some(calibration) = calibration else { return Some("calibration") };
    let keys = [
        ("certificate", calibration.certificate.is_some()),
        ("due", calibration.due.is_some()),
        ("range", calibration.range.is_some()),
    ];
    keys.into_iter().find(|(_, is_given)| !is_given).map(|(key, _)| key)
}

fn find_contradictions(
    channel: Channel,
    calibration: &Calibration,
    day: Option<Date>,
    readings: Option<(f64, f64)>,
    declared: &DeclaredUncertainty,
) -> Vec<CalibrationDefect> {
    let mut defects = Vec::new();
    if let (Some(due), Some(day)) = (calibration.due, day)
        && due < day
    {
        defects.push(CalibrationDefect::Expired { due: due.to_string(), day: day.to_string() });
    }
    if let (Some((min, max)), Some((low, high))) = (calibration.range, readings)
        && (low < min || high > max)
    {
        let reading = if min - low > high - max { low } else { high };
        defects.push(CalibrationDefect::Range { reading, min, max });
    }
    if let (Some(expanded), Some((_, high))) = (calibration.uncertainty, readings) {
        // k = 2, with a tolerance of a tenth for rounding.
        let certified = 0.5 * expanded;
        let declared = declared.fixed_sigma(channel, high);
        if declared < 0.9 * certified {
            defects.push(CalibrationDefect::Uncertainty { certified, declared });
        }
    }
    defects
}

/// The defects of all calibrations on the day of a run at the forecast readings of the points.
pub fn forecast_calibration_warnings(
    campaign: &Campaign,
    model: &Model,
    day: Option<Date>,
) -> Vec<CalibrationWarning> {
    let needs_readings = |channel: &Channel| {
        let calibrations = campaign.sensors.get(channel).into_iter().flat_map(|sensor| &sensor.calibrations);
        calibrations
            .flatten()
            .any(|calibration| calibration.range.is_some() || calibration.uncertainty.is_some())
    };
    let mut forecast: BTreeMap<Channel, (f64, f64)> = BTreeMap::new();
    let channels: Vec<Channel> = campaign.sensors.keys().copied().filter(needs_readings).collect();
    let points = if channels.is_empty() { &[][..] } else { &campaign.points };
    for point in points {
        let boundary =
            BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
        let Ok(steady) = hold_speed(model, point.speed_rpm, &boundary, campaign.follow_outlet) else {
            continue;
        };
        let prepared = model.prepare(&steady.boundary);
        for channel in &channels {
            let Some(value) = true_value(*channel, &prepared, &steady.state, &steady.outputs) else {
                continue;
            };
            let range = forecast.entry(*channel).or_insert((value, value));
            *range = (range.0.min(value), range.1.max(value));
        }
    }
    campaign.calibration_warnings(day, |channel| forecast.get(&channel).copied())
}
