//! The points of a speed line on the nominal machine, from choke to surge: their positions on the line, and the
//! opening of the back-pressure valve for each.
//!
//! **The ends.** The choke end has the widest requested opening, the surge end the flow at the requested surge
//! margin ([`SteadyState::surge_margin_ratio`]). The points between them are evenly spaced in corrected flow.
//!
//! **The opening.** At a given speed and flow the map gives P2. The valve is the orifice of
//! [`orifice`](crate::laws::turbine), whose flow is in proportion to its opening, so that `opening = m_c / m_orifice(P2, T2, 1)`.
//! T2 depends on the housings, which depend on the flow: opening and [steady state](crate::simulation::steady) are computed alternately; each
//! round reduces the difference to some per cent.

use crate::machine::params::BoundaryConditions;
use crate::operating_point::reach::{FollowOutlet, hold_speed};
use crate::simulation::model::{Model, State};
use crate::simulation::steady::{SteadyError, SteadyState};
use mapper_core::{OperatingPoint, ReferenceState};
use mapper_numerics::root::root_between;
use serde::Serialize;

/// Maximum number of points of a line.
pub const MAX_POINTS: usize = 100;
/// Maximum number of rounds until opening and steady state agree.
const MAX_ROUNDS: usize = 40;
/// Relative tolerance of the flow: far below any flow meter, well above rounding.
const TOLERANCE_RATIO: f64 = 1e-10;
/// Smallest opening tried for the surge side, relative to the nominal area.
const MIN_OPENING_RATIO: f64 = 1e-3;

/// Distribution of a line's points between its ends, both included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Spread {
    /// A number of points, evenly spaced in corrected flow, 2 to [`MAX_POINTS`].
    Points(usize),
    /// A spacing from the choke end in corrected flow, kg/s, > 0, and the surge end. A remainder of less than half a spacing
    /// lengthens the last one.
    SpacingKgS(f64),
}

/// A requested line. Corrected quantities refer to `reference`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LineRequest {
    /// Corrected shaft speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Reference state of speed and spacing.
    pub reference: ReferenceState,
    /// Distribution of its points.
    pub spread: Spread,
    /// Surge margin of the last point, ratio, > -1.
    pub surge_margin_ratio: f64,
    /// Opening of the first point, above 0 to [`OperatingPoint::OPENING_MAX_RATIO`].
    pub widest_opening_ratio: f64,
}

/// Reason why a line has no points.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum LineError {
    #[error("the nominal machine has no steady state: {0}")]
    NoSteadyState(#[from] SteadyError),
    #[error(
        "the line has no points: its choke end at opening {widest_opening_ratio} has {:.2} g/s corrected, its surge end with a margin of {:.1} % would have {:.2} g/s", 1e3 * .choke_end_kg_s, 100.0 * .surge_margin_ratio, 1e3 * .surge_end_kg_s
    )]
    NoRoom { widest_opening_ratio: f64, choke_end_kg_s: f64, surge_margin_ratio: f64, surge_end_kg_s: f64 },
    #[error(
        "a spacing of {:.2} g/s gives one point: from choke ({:.2} g/s corrected) to surge end ({:.2} g/s) the line has {:.2} g/s", 1e3 * .spacing_kg_s, 1e3 * .choke_end_kg_s, 1e3 * .surge_end_kg_s, 1e3 * (.choke_end_kg_s - .surge_end_kg_s)
    )]
    SpacingTooWide { spacing_kg_s: f64, choke_end_kg_s: f64, surge_end_kg_s: f64 },
    #[error(
        "a spacing of {:.4} g/s gives {count:.0} points over {:.2} g/s; a line may have at most {MAX_POINTS}", 1e3 * .spacing_kg_s, 1e3 * .range_kg_s
    )]
    TooManyPoints { spacing_kg_s: f64, count: f64, range_kg_s: f64 },
}

impl LineError {
    /// The remedy.
    pub fn remedy(&self) -> &'static str {
        match self {
            LineError::NoSteadyState(_) => "remove the line, or change its speed",
            LineError::NoRoom { .. } => "lower `surge_margin`, or raise `widest_opening`",
            LineError::SpacingTooWide { .. } => "choose a smaller spacing, or a number of `points`",
            LineError::TooManyPoints { .. } => "choose a wider spacing, or a number of `points`",
        }
    }
}

/// The points of a line from choke to surge. `boundary` has T1 and P1 and the other boundary conditions; its P3 and
/// valve are not used.
pub fn line_points(
    model: &Model,
    boundary: &BoundaryConditions,
    follow: FollowOutlet,
    line: &LineRequest,
) -> Result<Vec<OperatingPoint>, LineError> {
    let speed_rpm = line.reference.physical_speed_rpm(line.speed_corrected_rpm, boundary.t1_k);
    let hold = |valve_opening_ratio: f64| {
        hold_speed(model, speed_rpm, &BoundaryConditions { valve_opening_ratio, ..*boundary }, follow)
    };
    let choke_end = hold(line.widest_opening_ratio)?;
    // Compute with flows in the reference state of the map, and show them in the requested one.
    let display_factor = model.map.reference().flow_factor_to(line.reference);
    let map_speed_rpm = model.map.reference().corrected_speed_rpm(speed_rpm, boundary.t1_k);
    let choke_flow_kg_s = choke_end.outputs.flow_corrected_kg_s;
    // Rounding must not put the last point on the wrong side of a limit of the same margin.
    let margin_ratio = line.surge_margin_ratio + 10.0 * TOLERANCE_RATIO;
    let surge_flow_kg_s = model.map.surge_point(map_speed_rpm).0 * (1.0 + margin_ratio);
    let range_kg_s = choke_flow_kg_s - surge_flow_kg_s;
    if range_kg_s.is_nan() || range_kg_s <= 0.0 {
        return Err(LineError::NoRoom {
            widest_opening_ratio: line.widest_opening_ratio,
            choke_end_kg_s: choke_flow_kg_s * display_factor,
            surge_margin_ratio: line.surge_margin_ratio,
            surge_end_kg_s: surge_flow_kg_s * display_factor,
        });
    }
    let intervals: Vec<f64> = match line.spread {
        Spread::Points(count) => {
            let last = count.clamp(2, MAX_POINTS) - 1;
            (1..=last).map(|index| index as f64 / last as f64).collect()
        }
        Spread::SpacingKgS(spacing_kg_s) => spaced_positions(
            spacing_kg_s,
            choke_flow_kg_s * display_factor,
            surge_flow_kg_s * display_factor,
        )?,
    };
    let mut points = vec![OperatingPoint { speed_rpm, valve_opening_ratio: line.widest_opening_ratio }];
    let mut steady_state = choke_end;
    for share in intervals {
        steady_state = hold_flow(model, &hold, &steady_state, choke_flow_kg_s - share * range_kg_s)?;
        points.push(OperatingPoint {
            speed_rpm,
            valve_opening_ratio: steady_state.boundary.valve_opening_ratio,
        });
    }
    Ok(points)
}

/// Positions on the line after the choke end, for a spacing; corrected flows, kg/s.
fn spaced_positions(
    spacing_kg_s: f64,
    choke_end_kg_s: f64,
    surge_end_kg_s: f64,
) -> Result<Vec<f64>, LineError> {
    let range_kg_s = choke_end_kg_s - surge_end_kg_s;
    // Rounding must not reduce a whole number of spacings.
    let count = (range_kg_s / spacing_kg_s * (1.0 + 1e-9)).floor();
    if count < 1.0 {
        return Err(LineError::SpacingTooWide { spacing_kg_s, choke_end_kg_s, surge_end_kg_s });
    }
    let remainder_ratio = range_kg_s / spacing_kg_s - count;
    let inner = if remainder_ratio < 0.5 { count - 1.0 } else { count };
    if inner + 2.0 > MAX_POINTS as f64 {
        return Err(LineError::TooManyPoints { spacing_kg_s, count: inner + 2.0, range_kg_s });
    }
    let positions = (1..=inner as usize).map(|index| index as f64 * spacing_kg_s / range_kg_s);
    Ok(positions.chain([1.0]).collect())
}

/// Finds the steady state with this corrected flow (in the reference state of the map), from a steady state at the same speed.
fn hold_flow(
    model: &Model,
    hold: &impl Fn(f64) -> Result<SteadyState, SteadyError>,
    near: &SteadyState,
    flow_corrected_kg_s: f64,
) -> Result<SteadyState, SteadyError> {
    let mut steady_state = *near;
    for _ in 0..MAX_ROUNDS {
        if (steady_state.outputs.flow_corrected_kg_s / flow_corrected_kg_s - 1.0).abs() < TOLERANCE_RATIO {
            break;
        }
        let opening = opening_of_flow(model, &steady_state, flow_corrected_kg_s);
        let Some(opening) = opening.filter(|opening| opening.is_finite() && *opening > MIN_OPENING_RATIO)
        else {
            return Err(SteadyError::NoFlowBalance {
                speed_rpm: steady_state.state.shaft_speed_rpm(),
                valve_opening_ratio: steady_state.boundary.valve_opening_ratio,
            });
        };
        steady_state = hold(opening)?;
    }
    Ok(steady_state)
}

/// The opening that passes this flow at the speed and with the housings of `steady_state`; `None` if the line has no such flow.
fn opening_of_flow(model: &Model, steady_state: &SteadyState, flow_corrected_kg_s: f64) -> Option<f64> {
    let (prepared, boundary) = (model.prepare(&steady_state.boundary), &steady_state.boundary);
    let at = |p2_pa: f64| prepared.evaluate(&State { p2_pa, ..steady_state.state });
    let corrected_rpm =
        model.map.reference().corrected_speed_rpm(steady_state.state.shaft_speed_rpm(), boundary.t1_k);
    let surge_pressure_ratio = model.map.surge_point(corrected_rpm).1;
    // Far enough beyond the surge line for margins below 0.
    let highest_pa = boundary.p1_pa * (1.0 + 2.0 * (surge_pressure_ratio - 1.0).max(1e-3));
    let excess_kg_s = |p2_pa: f64| at(p2_pa).flow_corrected_kg_s - flow_corrected_kg_s;
    let p2_pa = root_between(boundary.p1_pa, highest_pa, 0.0, excess_kg_s)?;
    let target = at(p2_pa);
    Some(boundary.valve_opening_ratio * target.flow_kg_s / target.valve_flow_kg_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::simulate::{DEFAULT_RELATIVE_TOLERANCE, Simulator, Watch};
    use crate::simulation::steady;
    use mapper_core::ReferenceState as Reference;

    fn line(speed_corrected_rpm: f64, spread: Spread) -> LineRequest {
        LineRequest {
            speed_corrected_rpm,
            reference: Reference::GARRETT,
            spread,
            surge_margin_ratio: 0.1,
            widest_opening_ratio: 2.5,
        }
    }

    /// A cell that is neither the map's reference state nor Garrett's.
    fn boundary() -> BoundaryConditions {
        BoundaryConditions { t1_k: 305.0, p1_pa: 97e3, ..BoundaryConditions::default() }
    }

    fn resolved(line: &LineRequest) -> Result<Vec<OperatingPoint>, LineError> {
        line_points(&Model::nominal(), &boundary(), FollowOutlet::default(), line)
    }

    /// Speed and flow at the end of the integrated transient to a point, corrected to Garrett's state:
    /// the P3 that holds the point, an hour from cold housings.
    fn at_rest(point: OperatingPoint) -> (f64, f64) {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..boundary() };
        let steady_state = steady::hold_speed(&model, point.speed_rpm, &boundary).unwrap();
        let cold = State { tc_k: 300.0, tt_k: 400.0, ..steady_state.state };
        let mut simulator = Simulator::new(&model, 0.0, cold, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
        let mut flow_kg_s = 0.0;
        simulator
            .run_to(
                10_800.0,
                &steady_state.boundary,
                [10_800.0],
                |_, _, outputs| flow_kg_s = outputs.flow_kg_s,
                |_| {},
            )
            .unwrap();
        let speed_rpm = simulator.state().shaft_speed_rpm();
        (
            Reference::GARRETT.corrected_speed_rpm(speed_rpm, boundary.t1_k),
            Reference::GARRETT.corrected_flow_kg_s(flow_kg_s, boundary.t1_k, boundary.p1_pa),
        )
    }

    #[test]
    fn the_machine_comes_to_rest_where_the_points_are_asked_for() {
        for speed_corrected_rpm in [50e3, 150e3] {
            let points = resolved(&line(speed_corrected_rpm, Spread::Points(4))).unwrap();
            assert_eq!((points.len(), points[0].valve_opening_ratio), (4, 2.5));
            let rest: Vec<(f64, f64)> = points.iter().map(|point| at_rest(*point)).collect();
            // Integrated with a relative tolerance of 1e-6 a step, and the valve's flow is steep in pressure at low speed.
            let close =
                |found: f64, asked: f64| assert!((found / asked - 1.0).abs() < 2e-5, "{found} {asked}");
            // The surge flow at this speed, from the map's state to Garrett's.
            let model = Model::nominal();
            let map = model.map.reference();
            let at_map_rpm = speed_corrected_rpm * Reference::GARRETT.speed_factor_to(map);
            let surge_kg_s = model.map.surge_point(at_map_rpm).0 * map.flow_factor_to(Reference::GARRETT);
            let (first, last) = (rest[0].1, 1.1 * surge_kg_s);
            for (index, (speed, flow)) in rest.iter().enumerate() {
                close(*speed, speed_corrected_rpm);
                close(*flow, first + (last - first) * index as f64 / 3.0);
            }
            assert!(points.windows(2).all(|pair| pair[1].valve_opening_ratio < pair[0].valve_opening_ratio));
        }
    }

    #[test]
    fn a_spacing_is_kept_from_the_choke_end_and_both_ends_are_there() {
        let flows = |spread| -> Vec<f64> {
            let points = resolved(&line(110e3, spread)).unwrap();
            points.iter().map(|point| at_rest(*point).1).collect()
        };
        let ends = flows(Spread::Points(2));
        let spacing = 8e-3;
        let spaced = flows(Spread::SpacingKgS(spacing));
        assert!((spaced[0] / ends[0] - 1.0).abs() < 2e-5);
        assert!((spaced[spaced.len() - 1] / ends[1] - 1.0).abs() < 2e-5);
        let distances: Vec<f64> = spaced.windows(2).map(|pair| pair[0] - pair[1]).collect();
        let (last, inner) = distances.split_last().unwrap();
        assert!(inner.iter().all(|distance| (distance / spacing - 1.0).abs() < 1e-3), "{distances:?}");
        assert!((0.5..1.5).contains(&(last / spacing)), "{distances:?}");
    }

    #[test]
    fn what_has_no_points_says_why() {
        let narrow = LineRequest { widest_opening_ratio: 0.2, ..line(150e3, Spread::Points(3)) };
        assert!(matches!(resolved(&narrow), Err(LineError::NoRoom { .. })));
        let wide = resolved(&line(110e3, Spread::SpacingKgS(0.5)));
        assert!(matches!(wide, Err(LineError::SpacingTooWide { .. })), "{wide:?}");
        let fine = resolved(&line(110e3, Spread::SpacingKgS(1e-9)));
        assert!(matches!(fine, Err(LineError::TooManyPoints { .. })), "{fine:?}");
    }
}
