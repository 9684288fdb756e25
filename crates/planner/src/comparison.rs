//! What the plan is held against: conventional mapping with its waits, and the same points under all other orders.

use crate::best::all;
use crate::method::ForecastRow;
use crate::order::by_speed_line;
use crate::reach::reachable;
use crate::request::{PlanError, PlanRequest};
use mapper_core::{OperatingPoint, Plan};
use mapper_numerics::statistics::rms;
use mapper_physics::forecast::{self, hold};
use mapper_physics::model::{Outputs, State};
use mapper_physics::steady::SteadyState;

/// Drift of T2 and of the housing below which conventional mapping takes its reading, K/min.
pub const STABLE_DRIFT_K_MIN: f64 = 0.5;
/// Interval at which that is looked at, s.
const LOOK_S: f64 = 10.0;
/// Longest wait at a point, s.
const LONGEST_WAIT_S: f64 = 3600.0;

/// A way to map the points, in four numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct WayOfMapping {
    /// Points in order, repeats and the first once more where it is visited again.
    pub order: Vec<OperatingPoint>,
    /// Duration without soak, warm-up and cool-down, minutes.
    pub minutes: f64,
    /// Sum of the housing's changes within the windows, K; `None` for a way without windows.
    pub sum_gradient_k: Option<f64>,
    /// Largest predicted error of the efficiency (absolute, standard error and bias in quadrature), fraction; `None`
    /// where none was predicted.
    pub worst_error_eta: Option<f64>,
    /// Root of the mean square of these errors, fraction.
    pub rms_error_eta: Option<f64>,
    /// The same where nothing is as declared, fraction.
    pub open_rms_error_eta: Option<f64>,
}

/// The plan beside what it is held against.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The plan.
    pub proposed: WayOfMapping,
    /// Along speed lines, at each point until T2 and the housing drift by less than [`STABLE_DRIFT_K_MIN`], efficiency
    /// from the temperature rise. Its error is that of heat transfer and of the offsets that the plan's method has too.
    pub conventional: WayOfMapping,
    /// The same points by the same method under each order that allows it, the best for the time it takes first.
    pub orders: Vec<(String, WayOfMapping)>,
}

impl WayOfMapping {
    /// What is made small: gradients (with the sign turned), open error, minutes; `None` where one of them was not forecast.
    fn costs(&self) -> Option<[f64; 3]> {
        Some([-self.sum_gradient_k?, self.open_rms_error_eta?, self.minutes])
    }
}

/// Figures that differ by less than this share are alike: what is forecast is known no better.
const CLEARLY_RATIO: f64 = 0.02;

/// Whether one way is nowhere worse than another, and somewhere clearly better.
fn beats(one: &[f64], other: &[f64]) -> bool {
    let by = || one.iter().zip(other).map(|(one, other)| (other - one) / other.abs());
    by().all(|by| by >= -CLEARLY_RATIO) && by().any(|by| by > CLEARLY_RATIO)
}

impl Comparison {
    /// The orders that no other beats in gradients, open error and minutes at once, the largest gradients first.
    pub fn front(&self) -> Vec<&str> {
        let known = || self.orders.iter().filter_map(|(name, way)| Some((name.as_str(), way.costs()?)));
        let mut front: Vec<(&str, [f64; 3])> =
            known().filter(|(_, costs)| !known().any(|(_, other)| beats(&other, costs))).collect();
        front.sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]));
        front.into_iter().map(|(name, _)| name).collect()
    }

    /// An order that is forecast to err less than the plan and to take no longer, or to take less time and err no more; the best
    /// one for the time it takes.
    pub fn beaten_by(&self) -> Option<&(String, WayOfMapping)> {
        let [_, error, minutes] = self.proposed.costs()?;
        self.orders.iter().find(|(_, way)| {
            way.costs().is_some_and(|[_, other, others]| beats(&[other, others], &[error, minutes]))
        })
    }

    /// The way of an order, by its name in campaigns.
    pub fn of_order(&self, name: &str) -> Option<&WayOfMapping> {
        self.orders.iter().find(|(other, _)| other == name).map(|(_, way)| way)
    }
}

/// Points along speed lines: by speed, on each line from the widest opening to the narrowest.
pub fn along_speed_lines(points: &[OperatingPoint]) -> Vec<OperatingPoint> {
    let mut order = points.to_vec();
    order.sort_by(by_speed_line);
    order
}

/// Compares `plan` with conventional mapping and with the other orders; `make` makes a plan as that one was made, else they would
/// not be held against it but against how it was made.
///
/// # Errors
/// [`PlanError`] where a simulation fails, or no order is allowed, as an error of `make`.
pub fn compare<E: From<PlanError> + Send>(
    request: &PlanRequest<'_>,
    plan: &Plan,
    make: impl Fn(&PlanRequest<'_>) -> Result<Plan, E> + Sync,
) -> Result<Comparison, E> {
    let order = along_speed_lines(request.points);
    let targets = reachable(request, &order)?;
    let plans = all(&PlanRequest { appended: None, ..request.clone() }, make)?;
    Ok(Comparison {
        proposed: planned(plan),
        conventional: conventional(request, &order, &targets)?,
        orders: plans.iter().map(|plan| (plan.objective.clone(), planned(plan))).collect(),
    })
}

fn planned(plan: &Plan) -> WayOfMapping {
    WayOfMapping {
        order: plan.steps.iter().map(|step| step.to).collect(),
        minutes: plan.steps.iter().map(|step| step.dwell_s).sum::<f64>() / 60.0,
        sum_gradient_k: Some(plan.figures.sum_gradient_k),
        worst_error_eta: plan.figures.worst_error_eta,
        rms_error_eta: plan.figures.rms_error_eta,
        open_rms_error_eta: plan.figures.open_rms_error_eta,
    }
}

fn error(sigma: Option<f64>, bias: Option<f64>) -> Option<f64> {
    Some(sigma?.hypot(bias?))
}

fn warmed_up(request: &PlanRequest<'_>, first: &SteadyState) -> Result<State, PlanError> {
    let to = OperatingPoint {
        speed_rpm: first.state.shaft_speed_rpm(),
        valve_opening_ratio: first.boundary.valve_opening_ratio,
    };
    forecast::warmed_up(request.model, first.state, &first.boundary, request.timing.warm_up_s)
        .map_err(|source| PlanError::Forecast { to, source })
}

fn conventional(
    request: &PlanRequest<'_>,
    order: &[OperatingPoint],
    targets: &[SteadyState],
) -> Result<WayOfMapping, PlanError> {
    let first = targets.first().ok_or(PlanError::NoPoints)?;
    let mut state = warmed_up(request, first)?;
    let (mut seconds, mut errors) = (0.0, Vec::with_capacity(order.len()));
    for (&to, target) in order.iter().zip(targets) {
        let prepared = request.model.prepare(&target.boundary);
        let mut outputs: Option<Outputs> = None;
        let mut waited_s = 0.0;
        while waited_s < LONGEST_WAIT_S {
            let tc_k = state.tc_k;
            state = hold(request.model, state, &target.boundary, LOOK_S)
                .map_err(|source| PlanError::Forecast { to, source })?;
            waited_s += LOOK_S;
            let now = prepared.evaluate(&state);
            let drift_k_min = 60.0 / LOOK_S
                * outputs
                    .map_or(f64::INFINITY, |before| (now.t2_probe_k - before.t2_probe_k).abs())
                    .max((state.tc_k - tc_k).abs());
            outputs = Some(now);
            if drift_k_min < STABLE_DRIFT_K_MIN {
                break;
            }
        }
        seconds += waited_s;
        errors.push(outputs.zip(request.method).and_then(|(outputs, method)| {
            let row = ForecastRow {
                t_s: waited_s,
                speed_rpm: state.shaft_speed_rpm(),
                flow_kg_s: outputs.flow_kg_s,
                t1_k: target.boundary.t1_k,
                p1_pa: target.boundary.p1_pa,
                p2_pa: state.p2_pa,
                t2_k: outputs.t2_probe_k,
                tc_k: state.tc_k,
                efficiency: outputs.efficiency,
                h_w_m2k: outputs.h_w_m2k,
            };
            let (eta, sigma) = method.predict_settled(&row)?;
            error(Some(sigma), Some(eta - outputs.efficiency))
        }));
    }
    let errors: Vec<f64> = errors.into_iter().flatten().collect();
    Ok(WayOfMapping {
        order: order.to_vec(),
        minutes: seconds / 60.0,
        sum_gradient_k: None,
        worst_error_eta: errors.iter().copied().max_by(f64::total_cmp),
        rms_error_eta: rms(&errors),
        open_rms_error_eta: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(sum_gradient_k: f64, open: f64, minutes: f64) -> WayOfMapping {
        WayOfMapping {
            order: Vec::new(),
            minutes,
            sum_gradient_k: Some(sum_gradient_k),
            worst_error_eta: None,
            rms_error_eta: None,
            open_rms_error_eta: Some(open),
        }
    }

    #[test]
    fn the_front_has_what_nothing_beats_and_a_beaten_plan_is_told() {
        let orders = [
            ("information", way(500.0, 0.009, 30.0)),
            ("sum_gradient", way(1000.0, 0.009, 40.0)),
            // Its error is smaller by less than a forecast knows.
            ("greedy", way(900.0, 0.00899, 45.0)),
            ("speed_lines", way(400.0, 0.009, 70.0)),
        ];
        let compared = |proposed: &WayOfMapping| Comparison {
            proposed: proposed.clone(),
            conventional: way(0.0, 0.02, 120.0),
            orders: orders.iter().map(|(name, way)| ((*name).to_owned(), way.clone())).collect(),
        };
        assert_eq!(compared(&orders[0].1).front(), ["sum_gradient", "information"]);
        assert_eq!(compared(&orders[0].1).beaten_by(), None);
        // Larger gradients are no use of their own: what a plan is for is the error in its time.
        assert_eq!(compared(&orders[1].1).beaten_by().map(|(name, _)| name.as_str()), Some("information"));
        // What is better by less than a forecast knows is not better.
        assert_eq!(compared(&way(500.0, 0.009, 30.2)).beaten_by(), None);
        assert_eq!(
            compared(&WayOfMapping { open_rms_error_eta: None, ..way(0.0, 0.0, 90.0) }).beaten_by(),
            None
        );
    }
}
