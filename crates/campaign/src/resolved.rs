//! Resolves the speed lines of a campaign to points on the nominal machine.

use crate::campaign::Campaign;
use crate::checks::map_misfit::Concern;
use mapper_core::OperatingPoint;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::line_points::{LineRequest, Spread, line_points};
use mapper_physics::operating_point::reach::hold_speed;
use mapper_physics::simulation::model::Model;
use mapper_yaml::{Step, steps};
use serde::Serialize;

/// Whether a limit is probably wrong, and not what exceeds it. Judgement: from half of the lines or points on, one message at the limit is clearer
/// than one for each of them.
pub(crate) fn limit_is_wrong(exceeding: usize, all: usize) -> bool {
    exceeding > 0 && 2 * exceeding >= all
}

/// Adds the points of the speed lines to the campaign, or reports the mistakes of the lines.
pub(crate) fn resolve(campaign: &mut Campaign, model: &Model) -> Result<(), Vec<Concern>> {
    let (mut points, mut concerns) = (Vec::new(), Vec::new());
    let limit_rpm = campaign.limits.speed_max_rpm;
    let speeds_rpm = campaign.lines.iter().map(|line| physical_speed_rpm(line, campaign));
    let above_rpm: Vec<f64> = speeds_rpm.filter(|rpm| *rpm > limit_rpm).collect();
    if campaign.lines.len() > 1 && limit_is_wrong(above_rpm.len(), campaign.lines.len()) {
        return Err(vec![Concern {
            is_error: true,
            at: steps!["limits", "speed"].to_vec(),
            message: format!(
                "the limit, {:.2} krpm, is below {} of {} lines of the grid, the slowest of them with {:.2} krpm at T1 = {:.2} K",
                limit_rpm / 1e3,
                above_rpm.len(),
                campaign.lines.len(),
                above_rpm.iter().copied().fold(f64::INFINITY, f64::min) / 1e3,
                campaign.boundary.t1_k
            ),
            remedy: "raise the limit to what the machine allows, or remove these lines".to_owned(),
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
                    "{krpm:.2} krpm corrected are {:.2} krpm at T1 = {:.2} K, above `limits.speed`, {:.2} krpm",
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

/// The place of each point in the file, which is that of its line.
pub(crate) fn places(campaign: &Campaign) -> Vec<Vec<Step>> {
    let is_on_line =
        |line: &LineRequest, point: &OperatingPoint| physical_speed_rpm(line, campaign) == point.speed_rpm;
    let place = |point: &OperatingPoint| match campaign.lines.iter().position(|line| is_on_line(line, point))
    {
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

/// The speed lines of a campaign; none if its file gives openings. Points without a steady state are omitted; a
/// checked campaign has no such points.
pub fn resolved_lines(campaign: &Campaign, model: &Model) -> Vec<ResolvedLine> {
    let boundary = &campaign.boundary;
    let resolve_point = |point: &OperatingPoint| {
        let boundary = BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..*boundary };
        let steady = hold_speed(model, point.speed_rpm, &boundary, campaign.follow_outlet).ok()?;
        let flow_kg_s = steady.outputs.flow_kg_s;
        Some(ResolvedPoint {
            flow_corrected_kg_s: campaign.reference.corrected_flow_kg_s(
                flow_kg_s,
                boundary.t1_k,
                boundary.p1_pa,
            ),
            pressure_ratio: steady.outputs.pressure_ratio,
            valve_opening_ratio: point.valve_opening_ratio,
            surge_margin_ratio: steady.surge_margin_ratio(model),
        })
    };
    let resolve_line = |line| {
        let speed_rpm = physical_speed_rpm(line, campaign);
        let points = campaign.points.iter().filter(|point| point.speed_rpm == speed_rpm);
        ResolvedLine {
            speed_corrected_rpm: line.speed_corrected_rpm,
            speed_rpm,
            points: points.filter_map(resolve_point).collect(),
        }
    };
    campaign.lines.iter().map(resolve_line).collect()
}
