//! Transitions of plans on random machines and stands: none leaves a limit, and slow stands are planned.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, dead_code)]

mod common;

use common::{grid, request};
use mapper_core::{
    ActuatorMotion, AvoidedRange, Dwell, OperatingPoint, Plan, RigActuators, VisitOrder, WindowRule,
};
use mapper_physics::simulation::model::Model;
use mapper_planner::{PlanError, PlanRequest, make_plan};
use proptest::prelude::*;

/// From a fast valve to a compressor that takes a minute.
fn actuators() -> impl Strategy<Value = RigActuators> {
    let p3 = (0.1..8.0f64, 5e3..200e3f64, 0.0..1.5f64);
    let valve = (0.1..2.0f64, 0.1..2.0f64, 0.0..0.5f64);
    (p3, valve).prop_map(|(p3, valve)| {
        let motion = |(lag_s, rate_per_s, dead_time_s)| ActuatorMotion { lag_s, rate_per_s, dead_time_s };
        RigActuators { p3: motion(p3), valve: motion(valve), ..RigActuators::FAST_VALVE }
    })
}

/// The nominal machine with another shaft, turbine and outlet.
fn machine() -> impl Strategy<Value = Model> {
    (0.3..4.0f64, 0.9..1.1f64, 0.3..3.0f64).prop_map(|(inertia, turbine, volume)| {
        let mut model = Model::nominal();
        model.params.shaft_inertia_kgm2 *= inertia;
        model.params.turbine.peak_efficiency *= turbine;
        model.params.outlet.volume_m3 *= volume;
        model
    })
}

fn points() -> impl Strategy<Value = Vec<OperatingPoint>> {
    let point = (45e3..155e3f64, 0.45..2.5f64)
        .prop_map(|(speed_rpm, valve_opening_ratio)| OperatingPoint { speed_rpm, valve_opening_ratio });
    prop::collection::vec(point, 3..5)
}

fn stand<'a>(model: &'a Model, points: &'a [OperatingPoint], actuators: RigActuators) -> PlanRequest<'a> {
    let mut stand = request(model, points, VisitOrder::Listed);
    stand.window = WindowRule::Auto;
    stand.actuators = actuators;
    (stand.limits.speed_max_rpm, stand.limits.p3_max_pa) = (160e3, 600e3);
    stand.timing.dwell = Dwell::Fixed(60.0);
    stand
}

/// Panics if a transition of the plan leaves a limit.
fn assert_within_limits(plan: &Plan, request: &PlanRequest<'_>) {
    for step in &plan.steps {
        let Some(transition) = step.transition else {
            assert!(step.from.is_none());
            continue;
        };
        let higher_rpm = step.from.unwrap().speed_rpm.max(step.to.speed_rpm);
        assert!(transition.highest_speed_rpm <= 160e3, "{step:?}");
        assert!(transition.highest_speed_rpm <= 1.02 * higher_rpm, "{step:?}");
        assert!(transition.lowest_surge_margin_ratio >= 0.0, "{step:?}");
        // The commands never exceed the rates of the stand.
        let (from, to) = (step.from.unwrap().valve_opening_ratio, step.to.valve_opening_ratio);
        let valve_s = request.actuators.valve.ramp_s(to - from);
        assert!(transition.ramps.valve.duration_s >= valve_s * (1.0 - 1e-9), "{step:?}");
        assert!(step.dwell_s >= transition.arrival_s + 60.0 - WindowRule::EARLIEST_S, "{step:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn no_transition_leaves_a_limit(model in machine(), points in points(), actuators in actuators()) {
        let request = stand(&model, &points, actuators);
        match make_plan(&request) {
            // A point beyond the surge line or the limits: no transition is planned.
            Err(PlanError::Unreachable(_)) => {}
            plan => assert_within_limits(&plan.unwrap(), &request),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// A plan, with its repeats and its ways around forbidden jumps, holds no speed to avoid and crosses it in time; or it is refused.
    #[test]
    fn no_step_stays_within_the_speeds_to_avoid(
        points in points(),
        actuators in actuators(),
        (from_rpm, width_rpm, longest_s) in (50e3..150e3f64, 0.5e3..8e3f64, 0.3..5.0f64),
    ) {
        let model = Model::nominal();
        let range = AvoidedRange { from_rpm, to_rpm: from_rpm + width_rpm, longest_s };
        let mut request = stand(&model, &points, actuators);
        (request.order, request.effort) = (VisitOrder::ThermalGradient, 0.1);
        request.return_to_first = true;
        request.limits.avoid = vec![range].into();
        let is_inside = |point: &OperatingPoint| (range.from_rpm..=range.to_rpm).contains(&point.speed_rpm);
        let any_inside = points.iter().any(is_inside);
        match make_plan(&request) {
            Err(PlanError::Unreachable(_)) => {}
            _ if any_inside => prop_assert!(false, "a point inside was accepted"),
            Err(PlanError::NoAdmissibleOrder { .. } | PlanError::SeparatePoints(_)) => {}
            plan => for step in &plan.unwrap().steps {
                prop_assert!(!is_inside(&step.to), "{step:?}");
                let inside_s = step.transition.and_then(|way| way.avoided).map_or(0.0, |way| way.inside_s);
                prop_assert!(inside_s <= longest_s, "{step:?}");
                let crosses = step.from.is_some_and(|from| {
                    let (low, high) = (from.speed_rpm.min(step.to.speed_rpm), from.speed_rpm.max(step.to.speed_rpm));
                    low < range.from_rpm && high > range.to_rpm
                });
                prop_assert!(!crosses || inside_s > 0.0, "a crossing takes time: {step:?}");
            },
        }
    }
}

/// The whole grid on a stand that takes a minute from the lowest to the highest pressure: planned, with longer steps.
#[test]
fn a_slow_stand_is_planned_with_longer_steps() {
    let (model, points) = (Model::nominal(), grid());
    let slow = ActuatorMotion { lag_s: 4.0, rate_per_s: 290e3 / 60.0, dead_time_s: 1.0 };
    let actuators = RigActuators { p3: slow, ..RigActuators::FAST_VALVE };
    let plan_on = |actuators| {
        let mut request = stand(&model, &points, actuators);
        (request.order, request.effort) = (VisitOrder::ThermalGradient, 0.1);
        let plan = make_plan(&request).unwrap();
        assert_within_limits(&plan, &request);
        plan
    };
    let (fast, slow) = (plan_on(RigActuators::FAST_VALVE), plan_on(actuators));
    assert!(fast.steps.iter().all(|step| step.dwell_s == 60.0), "a fast stand needs no more time");
    // 160 kPa take more than 30 s, and the lag 18 s more.
    let longest_s = slow.steps.iter().map(|step| step.dwell_s).fold(0.0, f64::max);
    assert!(longest_s > 85.0, "{longest_s}");
    assert!(slow.duration_s() > fast.duration_s());
    // The step from a slow to a fast point warms the housing less than on a fast stand, and it still settles.
    assert!(slow.steps.iter().skip(1).all(|step| step.predicted.settle_s.is_some()));
}
