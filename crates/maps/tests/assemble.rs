//! What must hold for any set of points.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{CommonErrors, IdentifiedPoint, Method, OperatingPoint, ReferenceState, StepKind, Verdict};
use mapper_maps::{AssembleError, assemble};
use proptest::prelude::*;

fn point(
    step: usize,
    target_speed_rpm: Option<f64>,
    speed_corrected_rpm: f64,
    flow_kg_s: f64,
) -> IdentifiedPoint {
    IdentifiedPoint {
        step,
        kind: StepKind::Point,
        target: target_speed_rpm.map(|speed_rpm| OperatingPoint { speed_rpm, valve_opening_ratio: 1.0 }),
        speed_rpm: speed_corrected_rpm,
        valve_opening_ratio: 1.0,
        flow_kg_s,
        flow_corrected_kg_s: flow_kg_s,
        speed_corrected_rpm,
        pressure_ratio: 1.5,
        t1_k: 298.0,
        p1_pa: 100_000.0,
        eta: Some(0.7),
        eta_low: Some(0.69),
        eta_high: Some(0.71),
        eta_allowance: None,
        eta_uncertainty: None,
        h_w_m2k: None,
        h_low_w_m2k: None,
        h_high_w_m2k: None,
        h_uncertainty: None,
        common: CommonErrors::default(),
        method: Method::Dynamic,
        verdict: Verdict::Good,
        warnings: Vec::new(),
        window: None,
        residual_rms_k: None,
        dt2_k: None,
        dtc_k: None,
    }
}

fn make(points: &[IdentifiedPoint]) -> Result<mapper_core::CompressorMap, AssembleError> {
    assemble(points, "turbo_a", ReferenceState::SAE, Method::Dynamic)
}

prop_compose! {
    fn any_point()(target in proptest::option::of(0..4u32), speed in 3e4..2e5f64, flow in 0.01..0.2f64, bad in any::<bool>()) -> IdentifiedPoint {
        let mut point = point(0, target.map(|t| 50_000.0 + 30_000.0 * f64::from(t)), speed, flow);
        if bad { point.verdict = Verdict::Unusable; }
        point
    }
}

proptest! {
    #[test]
    fn every_point_is_in_one_line_and_all_is_sorted(mut points in proptest::collection::vec(any_point(), 1..40)) {
        for (step, point) in points.iter_mut().enumerate() { point.step = step; }
        let map = make(&points).unwrap();
        let mut steps: Vec<usize> = map.lines.iter().flat_map(|l| l.points.iter().map(|p| p.identified.step)).collect();
        steps.sort_unstable();
        prop_assert_eq!(steps, (0..points.len()).collect::<Vec<_>>());
        prop_assert!(map.lines.windows(2).all(|w| w[0].speed_corrected_rpm <= w[1].speed_corrected_rpm));
        for line in &map.lines {
            prop_assert!(line.points.windows(2).all(|w| w[0].flow_corrected_kg_s <= w[1].flow_corrected_kg_s));
            let speeds: Vec<f64> = line.points.iter().map(|p| p.identified.speed_corrected_rpm).collect();
            let (low, high) = speeds.iter().fold((f64::INFINITY, 0.0f64), |r, s| (r.0.min(*s), r.1.max(*s)));
            prop_assert_eq!(line.speed_spread_rpm, high - low);
            // The mean may round by a few ulp past equal speeds.
            prop_assert!(line.speed_corrected_rpm >= low * (1.0 - 1e-12) && line.speed_corrected_rpm <= high * (1.0 + 1e-12));
            for point in &line.points {
                prop_assert_eq!(point.identified.target.map(|t| t.speed_rpm), line.target_speed_rpm);
                prop_assert_eq!(point.eta.is_none(), point.identified.verdict == Verdict::Unusable);
            }
            if line.target_speed_rpm.is_none() {
                let mut sorted = speeds.clone();
                sorted.sort_by(f64::total_cmp);
                prop_assert!(sorted.windows(2).all(|w| w[1] <= 1.04 * w[0] * (1.0 + 1e-12)));
            }
        }
    }

    #[test]
    fn well_separated_speeds_are_found_without_targets(scatter in proptest::collection::vec(-0.01..0.01f64, 32)) {
        // Lines 10 % or more apart, held within 1 %: the smallest gap is 7.8 %, the largest step within a line 2 %.
        let lines: [f64; 8] = [50e3, 65e3, 80e3, 95e3, 110e3, 125e3, 140e3, 155e3];
        let points: Vec<_> = scatter.iter().enumerate()
            .map(|(i, s)| point(i, None, lines[i % 8] * (1.0 + s), 0.02 + 0.001 * i as f64)).collect();
        let map = make(&points).unwrap();
        prop_assert_eq!(map.lines.len(), 8);
        prop_assert!(map.lines.iter().all(|line| line.points.len() == 4));
    }
}

#[test]
fn a_target_holds_its_points_together_however_far_the_speed_was_off() {
    let points =
        [point(0, Some(5e4), 46e3, 0.03), point(1, Some(5e4), 54e3, 0.02), point(2, Some(6e4), 55e3, 0.04)];
    let map = make(&points).unwrap();
    assert_eq!(map.lines.iter().map(|l| l.points.len()).collect::<Vec<_>>(), [2, 1]);
    assert_eq!(map.lines[0].target_speed_rpm, Some(5e4));
    assert_eq!(map.lines[0].speed_spread_rpm, 8e3);
}

#[test]
fn repeats_are_kept_out_of_the_lines() {
    let repeat = |step| IdentifiedPoint { kind: StepKind::Repeat, ..point(step, Some(5e4), 5e4, 0.03) };
    let steps = |points: &[IdentifiedPoint]| -> Vec<usize> {
        make(points).unwrap().lines[0].points.iter().map(|point| point.identified.step).collect()
    };
    let measured = point(0, Some(5e4), 5e4, 0.03);
    assert_eq!(steps(&[measured.clone(), repeat(7), repeat(9)]), [0]);
    // Where the point itself has no efficiency, the surest repeat of the same target stands for it.
    let lost = IdentifiedPoint { eta: None, verdict: Verdict::Unusable, ..measured };
    let sure = IdentifiedPoint { eta_low: Some(0.699), eta_high: Some(0.701), ..repeat(9) };
    let doubtful = IdentifiedPoint { verdict: Verdict::Doubtful, ..sure.clone() };
    assert_eq!(steps(&[lost.clone(), repeat(7), sure, repeat(11)]), [9]);
    assert_eq!(steps(&[lost.clone(), repeat(7), doubtful]), [7]);
    let elsewhere = OperatingPoint { speed_rpm: 5e4, valve_opening_ratio: 0.5 };
    assert_eq!(steps(&[lost, IdentifiedPoint { target: Some(elsewhere), ..repeat(7) }]), [0]);
    // The first point, visited again because no jump had led to it: the surer of the two visits stands for it.
    let first = |half: f64| IdentifiedPoint {
        eta_low: Some(0.7 - half),
        eta_high: Some(0.7 + half),
        ..point(0, Some(5e4), 5e4, 0.03)
    };
    let again = |half: f64| IdentifiedPoint { step: 12, kind: StepKind::Return, ..first(half) };
    assert_eq!(steps(&[first(0.02), repeat(7), again(0.01)]), [12]);
    assert_eq!(steps(&[first(0.01), repeat(7), again(0.02)]), [0]);
    let lost_again = IdentifiedPoint { verdict: Verdict::Unusable, ..again(0.001) };
    assert_eq!(steps(&[first(0.02), lost_again]), [0]);
    // A campaign of repeats alone has no points.
    assert_eq!(make(&[repeat(3)]), Err(AssembleError::NoPoints));
}

#[test]
fn points_that_make_no_map_are_refused_with_a_reason() {
    assert_eq!(make(&[]), Err(AssembleError::NoPoints));
    let lost = make(&[point(3, None, 5e4, f64::NAN)]).unwrap_err();
    assert!(lost.to_string().starts_with("step 4: corrected mass flow is NaN kg/s"), "{lost}");
    let mut other = point(4, None, 5e4, 0.03);
    other.method = Method::Steady;
    assert!(matches!(make(&[other]), Err(AssembleError::MixedMethods { step: 4, .. })));
}

proptest! {
    #[test]
    fn the_shift_to_the_line_is_similarity_and_is_recorded(speeds in proptest::collection::vec(-0.01..0.01f64, 4)) {
        let points: Vec<_> =
            speeds.iter().enumerate().map(|(i, s)| point(i, Some(1e5), 1e5 * (1.0 + s), 0.02 + 0.01 * i as f64)).collect();
        let map = make(&points).unwrap();
        let line = &map.lines[0];
        for at_line in &line.points {
            let measured = &at_line.identified;
            let ratio = line.speed_corrected_rpm / measured.speed_corrected_rpm;
            // Flow over speed, and isentropic head over its square, are what they were.
            prop_assert!((at_line.flow_corrected_kg_s / measured.flow_corrected_kg_s - ratio).abs() < 1e-12);
            let head = |pr: f64| pr.powf(2.0 / 7.0) - 1.0;
            prop_assert!((head(at_line.pressure_ratio) / head(measured.pressure_ratio) - ratio * ratio).abs() < 1e-10);
            prop_assert_eq!(at_line.eta, measured.eta);
            if let Some(shift) = at_line.shift {
                prop_assert!((measured.flow_corrected_kg_s + shift.flow_corrected_kg_s - at_line.flow_corrected_kg_s).abs() < 1e-15);
                prop_assert!((measured.pressure_ratio + shift.pressure_ratio - at_line.pressure_ratio).abs() < 1e-12);
                prop_assert!((measured.speed_corrected_rpm + shift.speed_corrected_rpm - line.speed_corrected_rpm).abs() < 1e-9);
            }
        }
    }
}
