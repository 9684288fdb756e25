//! Settings that are possible but unusual, and calibrations that do not fit.

use crate::campaign::{Campaign, MapSource};
use crate::checks::map_misfit::{Concern, find_map_misfit, to_mm, two_digits};
use crate::elements::rig::calibration::{Calibration, CalibrationRule, Date};
use crate::elements::rig::sensor_class::default_gain_sigma_ratio;
use crate::machine_sizes::{SIZES, Size, similar_machine};
use mapper_core::{
    CalibrationDefect, Channel, DeclaredUncertainty, Method, OperatingPoint, Warning, WindowRule,
};
use mapper_physics::compressor_map::closed_form_map::MAX_TIP_SPEED_M_S;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::hold_speed;
use mapper_physics::rig::instruments::true_value;
use mapper_physics::simulation::model::Model;
use mapper_yaml::{Step, steps};
use std::collections::BTreeMap;
use std::f64::consts::PI;

/// A path of keys.
fn steps_of(keys: &[&str]) -> Vec<Step> {
    keys.iter().map(|key| Step::from(*key)).collect()
}

/// All concerns that follow from the campaign and its nominal machine. `places`: the place of each of its points in the file.
pub(crate) fn find_concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
    let mut concerns = find_dwell_concerns(campaign);
    concerns.extend(find_size_concerns(campaign));
    concerns.extend(check_gains(campaign));
    let speeds = find_speed_concerns(campaign, places);
    let has_error = |concerns: &[Concern], at: &[&str]| {
        concerns.iter().any(|concern| concern.is_error && concern.at == steps_of(at))
    };
    // A wrong wheel explains a map that does not fit it, and such a map explains speeds that it does not have.
    if has_error(&concerns, &WHEEL) || has_error(&speeds, &WHEEL) {
        concerns.retain(|concern| concern.at != steps_of(&MAP_FILE));
        concerns.extend(speeds);
    } else if !has_error(&concerns, &MAP_FILE) {
        concerns.extend(speeds);
    }
    concerns
}

fn find_dwell_concerns(campaign: &Campaign) -> Vec<Concern> {
    let identification = &campaign.identification;
    if !matches!(identification.method, Method::Dynamic | Method::Joint) {
        return Vec::new();
    }
    // The planner only chooses dwells that are long enough for the window.
    let Some(dwell_s) = campaign.timing.dwell.fixed_s() else { return Vec::new() };
    let (earliest_s, shortest_s) = (WindowRule::EARLIEST_S, WindowRule::SHORTEST_S);
    let needed_s = earliest_s + shortest_s;
    // Methods that evaluate the transient need no settled window.
    if identification.method == Method::Joint && dwell_s > earliest_s {
        return Vec::new();
    }
    match identification.window {
        WindowRule::Auto if dwell_s < needed_s => {
            // A script may choose any dwell.
            let no_window = dwell_s <= earliest_s;
            let outcome =
                if no_window { "no point would have an efficiency" } else { "every point would be doubtful" };
            vec![Concern {
                is_error: no_window && campaign.sequence.is_none(),
                at: steps!["timing", "dwell"].to_vec(),
                message: format!(
                    "a dwell of {dwell_s} s is shorter than the {needed_s} s that `window: auto` needs (from {earliest_s} s \
                     after the jump, {shortest_s} s long): {outcome}"
                ),
                remedy: format!("stay at least {needed_s} s at each point; 120 s is usual"),
            }]
        }
        WindowRule::Fixed { start_s, end_s } if end_s - start_s < shortest_s => vec![Concern {
            is_error: false,
            at: steps!["identification", "window", "end"].to_vec(),
            message: format!(
                "the window is {} s long, shorter than the {shortest_s} s from which efficiency and heat transfer are distinguishable",
                end_s - start_s
            ),
            remedy: "lengthen the window".to_owned(),
        }],
        WindowRule::Auto | WindowRule::Fixed { .. } => Vec::new(),
    }
}

/// Finds sensors with an offset but without a gain, which would count as exact at 130 degC after a zero.
fn check_gains(campaign: &Campaign) -> Option<Concern> {
    let bare: Vec<Channel> = campaign
        .sensors
        .iter()
        .filter(|(channel, sensor)| {
            sensor.declared.offset_sigma > 0.0
                && !sensor.gain_is_declared
                && default_gain_sigma_ratio(**channel) > 0.0
        })
        .map(|(channel, _)| *channel)
        .collect();
    let first = bare.first()?;
    let names: Vec<&str> = bare.iter().map(|channel| channel.symbol()).collect();
    let percent = |channel: Channel| two_digits(100.0 * default_gain_sigma_ratio(channel));
    Some(Concern {
        is_error: false,
        at: steps!["sensors", first.symbol()].to_vec(),
        message: format!(
            "{} declare an offset but no gain: identification takes {} % for thermometers (thermocouple of class 1) and {} % for \
             pressure transducers (class 0.1)",
            names.join(", "),
            percent(Channel::T2),
            percent(Channel::P2)
        ),
        remedy: "write the sensor's class, e.g. `class: K1` or `class: 0.1 %, full_scale: 500 kPa`, or the gain of its calibration, \
                 e.g. `gain: 0.05 %`"
            .to_owned(),
    })
}

/// Place of the nominal map.
const MAP_FILE: [&str; 3] = ["machine", "map", "file"];
/// Place of the wheel.
const WHEEL: [&str; 4] = ["machine", "geometry", "compressor", "wheel_diameter"];
/// Usual diameters of compressor wheels, m: 20 mm in the smallest passenger cars, 200 mm in locomotives. Ships have larger ones, which are
/// not tested on such gas stands.
pub const USUAL_WHEEL_DIAMETERS_M: (f64, f64) = (0.02, 0.2);
/// Possible diameters of compressor wheels, m: a tenth of the smallest to ten times the largest usual one. Outside, the unit is wrong.
const POSSIBLE_WHEEL_DIAMETERS_M: (f64, f64) = (0.002, 2.0);
/// Maximum efficiency of a turbine: the best ones reach 0.8 (Baines, Fundamentals of Turbocharging, ch. 5).
const MAX_TURBINE_EFFICIENCY: f64 = 0.85;

fn find_size_concerns(campaign: &Campaign) -> Vec<Concern> {
    let params = &campaign.machine.params;
    let mut concerns = Vec::new();
    let wheel_m = params.compressor.wheel_diameter_m;
    if !(USUAL_WHEEL_DIAMETERS_M.0..=USUAL_WHEEL_DIAMETERS_M.1).contains(&wheel_m) {
        let is_error = !(POSSIBLE_WHEEL_DIAMETERS_M.0..=POSSIBLE_WHEEL_DIAMETERS_M.1).contains(&wheel_m);
        concerns.push(Concern {
            is_error,
            at: WHEEL.map(Step::from).to_vec(),
            message: format!(
                "a compressor wheel of {} mm is unusual: turbochargers have {:.0} to {:.0} mm",
                to_mm(wheel_m),
                1e3 * USUAL_WHEEL_DIAMETERS_M.0,
                1e3 * USUAL_WHEEL_DIAMETERS_M.1
            ),
            remedy: "write its diameter at the exit, with its unit".to_owned(),
        });
        // The other sizes cannot be compared with such a wheel. The map shows whether the wheel is wrong, which would make
        // points of its lines unreachable.
        concerns.extend(check_map(campaign).filter(|_| !is_error));
        return concerns;
    }
    let reference = similar_machine(wheel_m);
    let check_size = |size: &Size| {
        let usual_ratio = size.usual_ratio?;
        let (value, usual) = (size.value(params), size.value(&reference));
        let ((low, high), (by, unit)) = ((usual / usual_ratio, usual * usual_ratio), size.unit);
        (!(low..=high).contains(&value)).then(|| Concern {
            is_error: false,
            at: size.steps(),
            message: format!(
                "the {} is {} {unit}; with a compressor wheel of {} mm {} to {} {unit} would be usual",
                size.name,
                two_digits(by * value),
                to_mm(wheel_m),
                two_digits(by * low),
                two_digits(by * high)
            ),
            remedy: "check the value and its unit, and the wheel's diameter".to_owned(),
        })
    };
    concerns.extend(SIZES.iter().filter_map(check_size));
    concerns.extend(check_map(campaign));
    if params.turbine.peak_efficiency > MAX_TURBINE_EFFICIENCY {
        concerns.push(Concern {
            is_error: false,
            at: steps!["machine", "geometry", "turbine", "peak_efficiency"].to_vec(),
            message: format!(
                "a peak efficiency of {} is above that of any turbine of a turbocharger; the best have {MAX_TURBINE_EFFICIENCY}",
                params.turbine.peak_efficiency
            ),
            remedy: "write the peak efficiency of the turbine, total to static, e.g. 0.75".to_owned(),
        });
    }
    concerns
}

/// Compares the nominal map with the wheel.
fn check_map(campaign: &Campaign) -> Option<Concern> {
    let MapSource::Table { named, .. } = &campaign.machine.map else { return None };
    let map = campaign.machine.map.table()?.ok()?;
    let misfit = find_map_misfit(&map, campaign.machine.params.compressor.wheel_diameter_m)?;
    Some(Concern {
        is_error: true,
        at: MAP_FILE.map(Step::from).to_vec(),
        message: format!("the map `{named}`: {misfit}"),
        remedy: misfit.remedy().to_owned(),
    })
}

/// Usual maximum tip speed, m/s: series wheels reach 560 m/s (see [`MAX_TIP_SPEED_M_S`]), and the warning must leave some margin.
const MAX_USUAL_TIP_SPEED_M_S: f64 = 600.0;
/// Extrapolation of a map beyond its outermost speed lines that is only a warning, as a ratio of their speed. Judgement: not much more
/// than the distance between two lines.
const MAX_EXTRAPOLATION_RATIO: f64 = 0.1;
/// Maximum extrapolation without a warning, ratio: corrected speeds of maps are rounded, and the inlet temperature varies.
const ROUNDING_RATIO: f64 = 0.01;

fn find_speed_concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
    let by_speed =
        |a: &(usize, &OperatingPoint), b: &(usize, &OperatingPoint)| a.1.speed_rpm.total_cmp(&b.1.speed_rpm);
    let points = || campaign.points.iter().enumerate();
    let (Some(slowest), Some(fastest)) = (points().min_by(by_speed), points().max_by(by_speed)) else {
        return Vec::new();
    };
    let place = |index: usize| places.get(index).cloned().unwrap_or_else(|| steps!["grid"].to_vec());
    let mut concerns = check_tip_speed(campaign, fastest.1.speed_rpm);
    if concerns.iter().all(|concern| !concern.is_error) {
        concerns.extend(check_table_range(
            campaign,
            [(slowest.1.speed_rpm, place(slowest.0)), (fastest.1.speed_rpm, place(fastest.0))],
        ));
    }
    concerns
}

fn check_tip_speed(campaign: &Campaign, speed_rpm: f64) -> Vec<Concern> {
    let params = &campaign.machine.params;
    let wheels = [
        ("compressor", "wheel_diameter", params.compressor.wheel_diameter_m),
        ("turbine", "wheel_radius", 2.0 * params.turbine.wheel_radius_m),
    ];
    let check_wheel = |(side, key, diameter_m): (&'static str, &'static str, f64)| {
        let tip_m_s = PI * diameter_m * speed_rpm / 60.0;
        // A wheel that is scaled from the other one would repeat its mistake.
        let is_assumed = campaign.machine.assumed.iter().any(|size| size.key == format!("{side}.{key}"));
        (tip_m_s > MAX_USUAL_TIP_SPEED_M_S && !is_assumed).then(|| Concern {
            is_error: tip_m_s > MAX_TIP_SPEED_M_S,
            at: steps!["machine", "geometry", side, key].to_vec(),
            message: format!(
                "the {side}'s wheel of {} mm has a tip speed of {tip_m_s:.0} m/s at the grid's highest speed, {:.1} krpm; {}",
                to_mm(diameter_m),
                speed_rpm / 1e3,
                if tip_m_s > MAX_TIP_SPEED_M_S {
                    format!("wheels of any material burst before {MAX_TIP_SPEED_M_S:.0} m/s")
                } else {
                    format!("few wheels endure more than {MAX_USUAL_TIP_SPEED_M_S:.0} m/s")
                }
            ),
            remedy: "correct the wheel's size, or lower the highest speed of the grid".to_owned(),
        })
    };
    wheels.into_iter().filter_map(check_wheel).collect()
}

/// A speed in krpm; below 10 krpm, where a unit may be wrong, with more digits.
fn krpm(rpm: f64) -> String {
    format!("{:.*}", if rpm < 10e3 { 3 } else { 1 }, rpm / 1e3)
}

/// Compares the speed range of the grid with that of the nominal table.
fn check_table_range(campaign: &Campaign, [slowest, fastest]: [(f64, Vec<Step>); 2]) -> Vec<Concern> {
    let MapSource::Table { named, reference, .. } = &campaign.machine.map else { return Vec::new() };
    let Some(Ok(map)) = campaign.machine.map.table() else { return Vec::new() };
    let lines_rpm = map.speeds_corrected_rpm();
    let (Some(&low_rpm), Some(&high_rpm)) = (lines_rpm.first(), lines_rpm.last()) else { return Vec::new() };
    let correction = (reference.t_ref_k / campaign.boundary.t1_k).sqrt();
    let check_end = |(rpm, at): (f64, Vec<Step>), edge_rpm: f64, verb: &str, beyond: f64| {
        let corrected_rpm = rpm * correction;
        (beyond > ROUNDING_RATIO).then(|| Concern {
            // `lines` need the surge and choke of the map, which cannot be extrapolated.
            is_error: beyond > MAX_EXTRAPOLATION_RATIO || !campaign.lines.is_empty(),
            at,
            message: format!(
                "the grid goes to {} krpm ({} krpm corrected), but the nominal map `{named}` {verb} at {} krpm: \
                 forecast and plan would be unreliable there",
                krpm(rpm),
                krpm(corrected_rpm),
                krpm(edge_rpm)
            ),
            remedy: "remove these speeds, or give a map that contains them (`map: closed_form` if there is none)"
                .to_owned(),
        })
    };
    let below = 1.0 - slowest.0 * correction / low_rpm;
    let above = fastest.0 * correction / high_rpm - 1.0;
    [check_end(slowest, low_rpm, "begins", below), check_end(fastest, high_rpm, "ends", above)]
        .into_iter()
        .flatten()
        .collect()
}

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
