//! Plans on the nominal machine: the 18-point grid of docs/explanation/planner.md and small ones.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{SimpleHousing, grid, request};
use mapper_core::{Dwell, Jump, OperatingPoint, PlanRemark, Repeats, StepKind, VisitOrder};
use mapper_physics::simulation::model::Model;
use mapper_planner::housing::gradients_k;
use mapper_planner::{
    Effort, PlanError, PlanRequest, Rejection, explain_jump, forecast_all_jumps, make_plan, max_steps, search,
};

#[test]
fn the_search_beats_the_listed_order() {
    let (model, points) = (Model::nominal(), grid());
    let plan = |order| make_plan(&request(&model, &points, order)).unwrap();
    let listed = plan(VisitOrder::Listed);
    let sum = plan(VisitOrder::ThermalGradient);
    assert!(sum.figures.sum_gradient_k > 2.0 * listed.figures.sum_gradient_k);
    for point in &points {
        assert_eq!(sum.steps.iter().filter(|step| step.to == *point).count(), 1);
    }
    assert_eq!(sum.steps[0].predicted.dtc_k, None);
    assert_eq!(sum, plan(VisitOrder::ThermalGradient), "same seed, same plan");
}

/// Housing with one time constant per point, as in `common::SimpleHousing`: the kind of housing on which a simple
/// annealing reached 677 K in total.
#[test]
fn the_search_reaches_the_figures_of_another_annealing_on_a_simple_housing() {
    let (model, points) = (Model::nominal(), grid());
    let housing = SimpleHousing::of(&model, &points);
    let given: Vec<usize> = (0..points.len()).collect();
    let sum_of = |order: &[usize]| gradients_k(&housing, order).iter().sum::<f64>();
    let worst_of = |order: &[usize]| gradients_k(&housing, order).into_iter().fold(f64::INFINITY, f64::min);
    // The housing reproduces the published figures of two reference orders to all their digits: along speed lines 129 K in total and
    // 0.4 K at minimum, a zigzag 640 K and 14.6 K.
    assert!((sum_of(&given) - 129.0).abs() < 0.5 && (worst_of(&given) - 0.4).abs() < 0.06);
    let zigzag: Vec<usize> =
        (0..3).flat_map(|opening| [2, 5, 0, 4, 1, 3].map(|speed| 3 * speed + opening)).collect();
    assert!((sum_of(&zigzag) - 640.0).abs() < 2.0 && (worst_of(&zigzag) - 14.6).abs() < 0.06);
    let effort = Effort::usual(points.len(), 0.3);
    let sum_k = sum_of(&search(&housing, &given, effort, 1)[0]);
    assert!(sum_k > 0.98 * 677.0, "{sum_k}");
}

#[test]
fn an_error_lists_all_unreachable_points_with_all_violated_limits() {
    let (model, points) = (Model::nominal(), grid());
    let mut strict = request(&model, &points, VisitOrder::Listed);
    strict.limits.p3_max_pa = 200e3;
    strict.limits.speed_max_rpm = 140e3;
    let Err(PlanError::Unreachable(culprits)) = make_plan(&strict) else { panic!("must not be reachable") };
    // Of the reference table: 150 krpm needs 219 to 259 kPa at all three openings, 130 krpm 201 and 217 at two.
    assert_eq!(culprits.len(), 5);
    let fast = culprits.iter().find(|culprit| culprit.point.speed_rpm == 150e3).unwrap();
    assert!(fast.reason.contains("218.6 kPa") && fast.reason.contains("140 krpm"), "{}", fast.reason);
}

#[test]
fn a_forbidden_jump_has_a_reason_and_is_avoided() {
    let (model, points) = (Model::nominal(), grid());
    let mut limited = request(&model, &points[..9], VisitOrder::ThermalGradient);
    let [from, to] = [(150e3, 0.5), (50e3, 0.5)]
        .map(|(speed_rpm, valve_opening_ratio)| OperatingPoint { speed_rpm, valve_opening_ratio });
    assert_eq!(explain_jump(&limited, from, to).unwrap().rejections, []);
    limited.limits.housing_gradient_max_k = Some(15.0);
    let rejections = explain_jump(&limited, from, to).unwrap().rejections;
    assert!(matches!(rejections[..], [Rejection::HousingGradient { limit_k: 15.0, .. }]), "{rejections:?}");
    let plan = make_plan(&limited).unwrap();
    assert!(plan.steps.iter().all(|step| step.predicted.dtc_k.unwrap_or(0.0).abs() <= 15.0));
    limited.limits.housing_gradient_max_k = Some(0.01);
    let Err(PlanError::SeparatePoints(separate)) = make_plan(&limited) else { panic!("a plan") };
    // No jump is allowed, so one point can be reached, and each of the others is alone.
    assert_eq!(separate.len(), 8);
    for part in &separate {
        let (_, reason) = part.into.unwrap();
        assert!(
            matches!(reason, Rejection::HousingGradient { gradient_k, .. } if gradient_k > 0.01),
            "{part}"
        );
        assert_eq!(part.points.len(), 1);
    }
}

/// Points at one opening, where jumps of 20 krpm change the housing by at most 25.3 K and jumps of 100 krpm by more than 26 K.
#[test]
fn a_way_over_points_between_replaces_a_forbidden_jump() {
    let (model, points) = (Model::nominal(), grid());
    let line: Vec<OperatingPoint> =
        points.iter().copied().filter(|point| point.valve_opening_ratio == 0.5).collect();
    let ends_first = [line[0], line[5], line[1], line[2], line[3], line[4]];
    let mut limited = request(&model, &ends_first, VisitOrder::Listed);
    limited.limits.housing_gradient_max_k = Some(26.0);
    let plan = make_plan(&limited).unwrap();
    assert!(plan.steps.iter().all(|step| step.predicted.dtc_k.unwrap_or(0.0).abs() <= 26.0));
    // The order of the points is the listed one; the visits between them are no points.
    let of_kind = |kind| plan.steps.iter().filter(move |step| step.kind == kind);
    assert_eq!(of_kind(StepKind::Point).map(|step| step.to).collect::<Vec<_>>(), ends_first);
    assert!(of_kind(StepKind::Repeat).count() >= 2);
    let around =
        |remark: &&PlanRemark| matches!(remark, PlanRemark::WayAround { over, .. } if !over.is_empty());
    assert!(plan.remarks.iter().any(|remark| around(&remark)), "{:?}", plan.remarks);
}

#[test]
fn every_jump_is_forecast_once() {
    let (model, points) = (Model::nominal(), grid());
    let jumps = forecast_all_jumps(&request(&model, &points[..4], VisitOrder::ThermalGradient)).unwrap();
    let pairs =
        |from: OperatingPoint| points[..4].iter().filter(move |to| **to != from).map(move |to| (from, *to));
    let expected: Vec<_> = points[..4].iter().flat_map(|from| pairs(*from)).collect();
    assert_eq!(jumps.iter().map(|jump| (jump.from, jump.to)).collect::<Vec<_>>(), expected);
}

#[test]
fn repeats_make_the_same_jump_and_every_point_is_still_visited() {
    let (model, points) = (Model::nominal(), grid());
    let mut repeating = request(&model, &points, VisitOrder::ThermalGradient);
    repeating.effort = 0.1;
    let (from, to) = (points[2], points[17]);
    repeating.repeats = Some(Repeats { jump: Some(Jump { from, to }), every_steps: 12, at_least: 2 });
    let plan = make_plan(&repeating).unwrap();
    let repeat = |step: &&mapper_core::PlanStep| step.kind == StepKind::Repeat && step.to == to;
    let repeats: Vec<_> = plan.steps.iter().filter(repeat).map(|step| step.from).collect();
    // 18 points at a spacing of 12: at both ends and once between.
    assert_eq!(repeats, [Some(from); 3]);
    for point in &points {
        let visit = |step: &&mapper_core::PlanStep| step.to == *point && step.kind == StepKind::Point;
        assert_eq!(plan.steps.iter().filter(visit).count(), 1);
    }
}

#[test]
fn the_default_repeat_is_an_allowed_jump() {
    let (model, points) = (Model::nominal(), grid());
    let mut repeating = request(&model, &points, VisitOrder::ThermalGradient);
    repeating.effort = 0.1;
    repeating.repeats = Some(Repeats { jump: None, every_steps: 12, at_least: 2 });
    let jumps = |request: &PlanRequest<'_>| {
        let steps = make_plan(request).unwrap().steps;
        let last = steps
            .iter()
            .rfind(|step| step.kind == StepKind::Repeat)
            .map(|step| (step.from.unwrap(), step.to));
        let count = steps
            .iter()
            .filter(|step| step.kind == StepKind::Repeat && step.from.map(|from| (from, step.to)) == last);
        (last, count.count())
    };
    let (jump, count) = jumps(&repeating);
    assert_eq!(jump.map(|(from, to)| (from.speed_rpm, to.speed_rpm)), Some((50e3, 150e3)));
    assert!(count >= 2);
    // Such a jump moves the housing by more than 25 K: under that limit a shorter one is repeated.
    repeating.limits.housing_gradient_max_k = Some(25.0);
    let (jump, count) = jumps(&repeating);
    let (from, to) = jump.unwrap();
    assert!(from.speed_rpm == 50e3 && to.speed_rpm < 150e3 && count >= 2, "{from} {to} {count}");
    // One point has no jump.
    let alone = PlanRequest { points: &points[..1], ..repeating };
    assert_eq!(jumps(&alone), (None, 0));
}

#[test]
fn an_appended_jump_comes_last_and_changes_nothing_before_it() {
    let (model, points) = (Model::nominal(), grid());
    let listed = request(&model, &points, VisitOrder::Listed);
    let plain = make_plan(&listed).unwrap();
    let last = plain.steps.last().unwrap().to;
    // One end is not a point of the grid.
    let off_grid = OperatingPoint { speed_rpm: 60e3, ..points[0] };
    for from in [points[1], last] {
        let plan = make_plan(&PlanRequest { appended: Some(Jump { from, to: off_grid }), ..listed.clone() })
            .unwrap();
        let (before, behind) = plan.steps.split_at(plain.steps.len());
        assert_eq!(before, plain.steps);
        let visited: Vec<OperatingPoint> = behind.iter().map(|step| step.to).collect();
        // If the points end at the start of the jump, it takes one step.
        let expected = if from == last { vec![off_grid] } else { vec![from, off_grid] };
        assert_eq!(visited, expected);
        assert!(behind.iter().all(|step| step.kind == StepKind::Repeat));
        assert_eq!(plan.figures.sum_gradient_k, plain.figures.sum_gradient_k);
    }
}

#[test]
fn the_best_order_of_few_points_is_found() {
    let (model, points) = (Model::nominal(), grid());
    let few = [points[0], points[5], points[10], points[15], points[17]];
    for return_to_first in [false, true] {
        let plan =
            make_plan(&PlanRequest { return_to_first, ..request(&model, &few, VisitOrder::ThermalGradient) })
                .unwrap();
        // All 120 orders in full.
        let mut best_k = 0.0f64;
        permute(&mut few.clone(), 0, &mut |order| {
            let plan =
                make_plan(&PlanRequest { return_to_first, ..request(&model, order, VisitOrder::Listed) })
                    .unwrap();
            best_k = best_k.max(plan.figures.sum_gradient_k);
        });
        // The reduced housing may prefer another order of nearly equal value.
        assert!(plan.figures.sum_gradient_k > 0.999 * best_k, "{} {best_k}", plan.figures.sum_gradient_k);
    }
}

/// The first point of a plan has no transient, so it is visited once more after all points and repeats. That visit counts in every
/// figure as the point itself.
#[test]
fn the_first_point_is_visited_again_at_the_end() {
    let (model, points) = (Model::nominal(), grid());
    for order in [VisitOrder::Listed, VisitOrder::ThermalGradient] {
        let mut returning = request(&model, &points, order);
        (returning.effort, returning.return_to_first) = (0.1, true);
        returning.repeats = Some(Repeats { jump: None, every_steps: 12, at_least: 2 });
        let plan = make_plan(&returning).unwrap();
        let (first, last) = (&plan.steps[0], plan.steps.last().unwrap());
        assert_eq!((last.kind, last.to), (StepKind::Return, first.to));
        assert_eq!(plan.steps.iter().filter(|step| step.kind == StepKind::Return).count(), 1);
        let measured = || plan.steps.iter().filter(|step| step.kind != StepKind::Repeat);
        assert_eq!(measured().count(), points.len() + 1);
        let gradients_k: Vec<f64> =
            measured().filter_map(|step| step.predicted.dtc_k).map(f64::abs).collect();
        assert_eq!(gradients_k.len(), points.len(), "one for each point");
        assert_eq!(plan.figures.sum_gradient_k, gradients_k.iter().sum::<f64>());
        assert_eq!(plan.figures.min_gradient_k, gradients_k.iter().copied().min_by(f64::total_cmp));
        assert!((60.0 * plan.figures.minutes - (last.start_s + last.dwell_s)).abs() < 1e-6);
        assert!(
            plan.remarks.iter().any(|remark| matches!(remark, PlanRemark::FirstPointAgain { .. })),
            "{:?}",
            plan.remarks
        );
        // An appended jump comes after the return.
        let appended = Some(Jump { from: points[1], to: points[16] });
        let longer = make_plan(&PlanRequest { appended, ..returning.clone() }).unwrap();
        assert_eq!(longer.steps[..plan.steps.len()], plan.steps);
    }
    // A single point has no return.
    let alone = PlanRequest { return_to_first: true, ..request(&model, &points[..1], VisitOrder::Listed) };
    assert_eq!(make_plan(&alone).unwrap().steps.len(), 1);
}

#[test]
fn a_forbidden_return_is_omitted_with_a_remark() {
    let (model, points) = (Model::nominal(), grid());
    // Points at one opening: steps of 20 krpm change the housing by at most 25.3 K; the return is a jump of 100 krpm.
    let line: Vec<OperatingPoint> =
        points.iter().copied().filter(|point| point.valve_opening_ratio == 0.5).collect();
    let mut limited = request(&model, &line, VisitOrder::Listed);
    limited.return_to_first = true;
    limited.limits.housing_gradient_max_k = Some(26.0);
    let plan = make_plan(&limited).unwrap();
    assert!(plan.steps.iter().all(|step| step.kind == StepKind::Point));
    assert!(plan.remarks.contains(&PlanRemark::NoWayBack), "{:?}", plan.remarks);
}

fn permute(points: &mut [OperatingPoint], from: usize, visit: &mut impl FnMut(&[OperatingPoint])) {
    if from == points.len() {
        return visit(points);
    }
    for other in from..points.len() {
        points.swap(from, other);
        permute(points, from + 1, visit);
        points.swap(from, other);
    }
}

/// One more second for each step would exceed the budget.
#[test]
fn the_dwell_fills_the_time_budget_without_exceeding_it() {
    let (model, points) = (Model::nominal(), grid());
    let mut budgeted = request(&model, &points, VisitOrder::ThermalGradient);
    (budgeted.effort, budgeted.return_to_first) = (0.1, true);
    budgeted.repeats = Some(Repeats { jump: None, every_steps: 6, at_least: 2 });
    for minutes in [75.0, 90.0, 120.0] {
        budgeted.timing.dwell = Dwell::TimeBudget(60.0 * minutes);
        let plan = make_plan(&budgeted).unwrap();
        let (steps, dwell_s) = (plan.steps.len() as f64, plan.steps[0].dwell_s);
        assert!(plan.steps.len() <= max_steps(&budgeted));
        assert!(plan.steps.iter().all(|step| step.dwell_s == dwell_s), "all steps last equally long");
        assert!(plan.duration_s() <= 60.0 * minutes && plan.duration_s() + steps > 60.0 * minutes);
    }
    // An hour of warm-up leaves 3 s a step.
    budgeted.timing.dwell = Dwell::TimeBudget(3660.0);
    assert!(matches!(make_plan(&budgeted), Err(PlanError::BudgetTooShort { .. })));
}

/// Conventional mapping follows the speed lines and waits at each point for stability: every step has settled by then.
#[test]
fn conventional_mapping_waits_for_stability() {
    let (model, points) = (Model::nominal(), grid());
    let mut conventional = request(&model, &points, VisitOrder::Conventional);
    conventional.timing.dwell = Dwell::Fixed(0.0);
    let plan = make_plan(&conventional).unwrap();
    let order: Vec<OperatingPoint> = plan.steps.iter().map(|step| step.to).collect();
    let lines = make_plan(&request(&model, &points, VisitOrder::SpeedLines)).unwrap();
    assert_eq!(order, lines.steps.iter().map(|step| step.to).collect::<Vec<_>>());
    // Burke et al. state 5 to 15 minutes a point; a point that lies next to the one before takes less.
    let mean_min = plan.steps.iter().map(|step| step.dwell_s).sum::<f64>() / 60.0 / plan.steps.len() as f64;
    assert!((1.0..15.0).contains(&mean_min), "{mean_min} min");
    assert!(plan.steps.iter().skip(1).all(|step| step.predicted.settle_s.is_some()));
}

#[test]
fn impossible_requests_are_refused() {
    let (model, points) = (Model::nominal(), grid());
    let mut required = request(&model, &points, VisitOrder::SpeedLines);
    required.timing.dwell = Dwell::RequiredSigmaEta(0.01);
    assert!(matches!(make_plan(&required), Err(PlanError::NoPredictedError)), "no method predicts an error");
    assert!(matches!(make_plan(&request(&model, &[], VisitOrder::Listed)), Err(PlanError::NoPoints)));
}
