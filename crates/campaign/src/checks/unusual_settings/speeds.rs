//! Checks speeds against the strength of the wheel and the range of the nominal map.

use crate::campaign::{Campaign, MapSource};
use crate::checks::concern::{Concern, to_mm};
use mapper_core::OperatingPoint;
use mapper_physics::compressor_map::inlet_limit::MAX_TIP_SPEED_M_S;
use mapper_yaml::{Step, steps};
use std::f64::consts::PI;

/// Usual maximum tip speed, m/s: series wheels reach 560 m/s (see [`MAX_TIP_SPEED_M_S`]), and the warning must leave some margin.
const MAX_USUAL_TIP_SPEED_M_S: f64 = 600.0;
/// Extrapolation of a map beyond its outermost speed lines that is only a warning, as a ratio of their speed. Judgement: not much more
/// than the distance between two lines.
const MAX_EXTRAPOLATION_RATIO: f64 = 0.1;
/// Maximum extrapolation without a warning, ratio: corrected speeds of maps are rounded, and the inlet temperature varies.
const ROUNDING_RATIO: f64 = 0.01;

pub(crate) fn find_concerns(campaign: &Campaign, places: &[Vec<Step>]) -> Vec<Concern> {
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
