//! Resolves the speed lines of a campaign to points on the nominal machine.

use crate::campaign::Campaign;
use crate::checks::concern::Concern;
use mapper_core::OperatingPoint;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::follow_outlet::hold_speed;
use mapper_physics::operating_point::line_points::{LineRequest, Spread, line_points};
use mapper_physics::simulation::model::Model;
use mapper_yaml::{Step, steps};
use serde::Serialize;

/// Adds the points of the lines to the campaign, or reports mistakes at their lines.
pub(crate) fn resolve(campaign: &mut Campaign, model: &Model) -> Result<(), Vec<Concern>> {
    let (mut points, mut concerns) = (Vec::new(), Vec::new());
    let limit_rpm = campaign.limits.speed_max_rpm;
    let lowest_rpm =
        campaign.lines.iter().map(|line| physical_speed_rpm(line, campaign)).fold(f64::INFINITY, f64::min);
    if campaign.lines.len() > 1 && lowest_rpm > limit_rpm {
        return Err(vec![Concern {
            is_error: true,
            at: steps!["limits", "speed"].to_vec(),
            message: format!(
                "the limit, {} krpm, is below every line of the grid; the slowest has {:.2} krpm at T1 = {:.2} K",
                limit_rpm / 1e3,
                lowest_rpm / 1e3,
                campaign.boundary.t1_k
            ),
            remedy: "raise the limit to what the machine allows".to_owned(),
        }]);
    }
    for (index, line) in campaign.lines.iter().enumerate() {
        let at = |key: &str| steps!["grid", "lines", index, key].to_vec();
        let krpm = line.speed_corrected_rpm / 1e3;
        let speed_rpm = physical_speed_rpm(line, campaign);
        if speed_rpm > limit_rpm {
            concerns.push(Concern {
                is_error: true,
                at: at("speed_corrected"),
                message: format!(
                    "{krpm} krpm corrected are {:.2} krpm at T1 = {:.2} K, above `limits.speed`, {} krpm",
                    speed_rpm / 1e3,
                    campaign.boundary.t1_k,
                    limit_rpm / 1e3
                ),
                remedy: "lower it, or raise the limit if the machine allows it".to_owned(),
            });
            continue;
        }
        match line_points(model, &campaign.boundary, campaign.follow_outlet, line) {
            Ok(resolved) => points.extend(resolved),
            Err(error) => concerns.push(Concern {
                is_error: true,
                at: at(match line.spread {
                    Spread::Points(_) => "points",
                    Spread::SpacingKgS(_) => "spacing",
                }),
                message: format!("{krpm} krpm corrected: {error}"),
                remedy: error.remedy().to_owned(),
            }),
        }
    }
    if !concerns.is_empty() {
        return Err(concerns);
    }
    campaign.points = points;
    Ok(())
}

/// The physical speed of a line at the campaign's T1, rpm.
fn physical_speed_rpm(line: &LineRequest, campaign: &Campaign) -> f64 {
    line.reference.physical_speed_rpm(line.speed_corrected_rpm, campaign.boundary.t1_k)
}

/// The place of each point in the file: its line.
pub(crate) fn places(campaign: &Campaign) -> Vec<Vec<Step>> {
    let line_of = |point: &OperatingPoint| {
        campaign.lines.iter().position(|line| physical_speed_rpm(line, campaign) == point.speed_rpm)
    };
    let place = |point: &OperatingPoint| match line_of(point) {
        Some(index) => steps!["grid", "lines", index, "speed_corrected"].to_vec(),
        None => steps!["grid", "lines"].to_vec(),
    };
    campaign.points.iter().map(place).collect()
}

/// A speed line with its points from choke to surge.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResolvedLine {
    /// Corrected shaft speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Physical shaft speed under the campaign's T1, rpm.
    pub speed_rpm: f64,
    /// The points.
    pub points: Vec<ResolvedPoint>,
}

/// A point of a line on the nominal machine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ResolvedPoint {
    /// Corrected compressor flow in the campaign's reference state, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio P2/P1.
    pub pressure_ratio: f64,
    /// Opening of the back-pressure valve relative to its nominal area.
    pub valve_opening_ratio: f64,
    /// Flow over the surge flow at equal corrected speed, minus one.
    pub surge_margin_ratio: f64,
}

/// The lines of a campaign; none if its file gives openings. A point without a steady state is left out; a
/// checked campaign has none.
pub fn resolved_lines(campaign: &Campaign, model: &Model) -> Vec<ResolvedLine> {
    let boundary = &campaign.boundary;
    let resolved = |point: &OperatingPoint| {
        let under = BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..*boundary };
        let held = hold_speed(model, point.speed_rpm, &under, campaign.follow_outlet).ok()?;
        let flow_kg_s = held.outputs.flow_kg_s;
        Some(ResolvedPoint {
            flow_corrected_kg_s: campaign.reference.corrected_flow_kg_s(
                flow_kg_s,
                boundary.t1_k,
                boundary.p1_pa,
            ),
            pressure_ratio: held.outputs.pressure_ratio,
            valve_opening_ratio: point.valve_opening_ratio,
            surge_margin_ratio: held.surge_margin_ratio(model),
        })
    };
    let of_line = |line| {
        let speed_rpm = physical_speed_rpm(line, campaign);
        let own = campaign.points.iter().filter(|point| point.speed_rpm == speed_rpm);
        ResolvedLine {
            speed_corrected_rpm: line.speed_corrected_rpm,
            speed_rpm,
            points: own.filter_map(resolved).collect(),
        }
    };
    campaign.lines.iter().map(of_line).collect()
}
