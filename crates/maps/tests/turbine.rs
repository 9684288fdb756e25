//! The fit of turbine maps, on a made-up turbine: a nozzle whose throat depends on vanes, and a parabola over the blade-speed ratio.

use mapper_core::{TurbineMap, TurbineMapPoint};
use mapper_maps::{TurbineFit, TurbineFitError, compare_turbines, fit_turbine};

/// Flow parameter and efficiency.
fn truth(vane: f64, speed: f64, ratio: f64) -> (f64, f64) {
    let throat = 0.02 * (1.0 + 0.9 * vane) * (1.0 - 0.03 * (speed / 3000.0 - 1.0));
    let flow = throat * (1.0 - ratio.powf(-1.4)).sqrt();
    let blade = speed / 5200.0 / (1.0 - ratio.powf(-0.25)).sqrt();
    (flow, 0.7 - 0.08 * (vane - 0.5).powi(2) - 0.6 * (blade - 1.0).powi(2))
}

/// Three vane positions, five speeds, six expansion ratios, with a repeatable scatter of flow (ratio) and efficiency.
fn map(vanes: &[f64], flow_error: f64, efficiency_error: f64) -> TurbineMap {
    let mut points = Vec::new();
    for &vane in vanes {
        for line in 0..5 {
            let speed = 1800.0 + 700.0 * f64::from(line);
            for place in 0..6 {
                let ratio = 1.2 + 0.12 * f64::from(line) + 0.25 * f64::from(place);
                let (flow, efficiency) = truth(vane, speed, ratio);
                // Irrational steps fill -1 to 1 evenly.
                let scatter = |step: f64| 2.0 * (step * (points.len() + 1) as f64).fract() - 1.0;
                points.push(TurbineMapPoint {
                    vane_position: Some(vane),
                    speed_parameter_rpm_sqrt_k: speed,
                    flow_parameter_kg_sqrt_k_s_kpa: flow * (1.0 + flow_error * scatter(0.618_034)),
                    expansion_ratio: ratio,
                    efficiency: Some(efficiency + efficiency_error * scatter(0.414_214)),
                });
            }
        }
    }
    TurbineMap { machine: "made up".to_owned(), points, fitted: None }
}

#[test]
fn between_lines_and_vane_positions_the_fit_is_the_turbine() {
    let fit = TurbineFit::new(&map(&[0.2, 0.5, 0.8], 0.0, 0.0)).unwrap();
    for (vane, speed, ratio) in
        [(0.35, 2150.0, 1.8), (0.65, 3550.0, 2.3), (0.5, 2500.0, 1.6), (0.8, 4600.0, 2.9)]
    {
        let place = fit.at(Some(vane), speed, ratio);
        let (flow, efficiency) = truth(vane, speed, ratio);
        assert!(!place.extrapolated, "{vane} {speed} {ratio}");
        // The surface is no closed form of this turbine: 1 % of flow and half a point of efficiency.
        assert!((place.flow_parameter_kg_sqrt_k_s_kpa / flow - 1.0).abs() < 0.01, "{place:?} {flow}");
        assert!((place.efficiency.unwrap() - efficiency).abs() < 0.005, "{place:?} {efficiency}");
    }
    assert!(fit.at(Some(0.5), 3000.0, 4.5).extrapolated && fit.at(Some(0.9), 3000.0, 2.0).extrapolated);
    assert!(fit.at(Some(0.5), 6000.0, 2.0).extrapolated);
}

/// 95 % intervals of a measurement cover new measurements at other places in about 95 of 100 cases.
#[test]
fn intervals_cover_new_measurements() {
    let fit = TurbineFit::new(&map(&[0.2, 0.5, 0.8], 0.01, 0.01)).unwrap();
    let (mut inside, mut all) = ([0, 0], 0);
    for index in 0..600u32 {
        let share = |step: f64| (step * f64::from(index + 1)).fract();
        let (vane, speed) = (0.2 + 0.6 * share(0.732_051), 1800.0 + 2800.0 * share(0.236_068));
        let line = (speed - 1800.0) / 700.0;
        let ratio = 1.2 + 0.12 * line + 1.25 * share(0.449_490);
        let (flow, efficiency) = truth(vane, speed, ratio);
        let place = fit.at(Some(vane), speed, ratio);
        let (flow, efficiency) = (
            flow * (1.0 + 0.01 * (2.0 * share(0.645_751) - 1.0)),
            efficiency + 0.01 * (2.0 * share(0.162_278) - 1.0),
        );
        inside[0] += usize::from((place.flow_low..=place.flow_high).contains(&flow));
        inside[1] += usize::from(
            (place.efficiency_low.unwrap()..=place.efficiency_high.unwrap()).contains(&efficiency),
        );
        all += 1;
    }
    for count in inside {
        let share = f64::from(u32::try_from(count).unwrap()) / f64::from(all);
        assert!((0.9..=1.0).contains(&share), "{share}");
    }
}

/// A second machine with 3 % more flow and 2 points less efficiency differs by that.
#[test]
fn two_turbines_differ_by_what_differs() {
    let first = map(&[0.2, 0.5, 0.8], 0.002, 0.002);
    let mut second = map(&[0.35, 0.65], 0.002, 0.002);
    for point in &mut second.points {
        point.flow_parameter_kg_sqrt_k_s_kpa *= 1.03;
        point.efficiency = point.efficiency.map(|efficiency| efficiency - 0.02);
    }
    let same = compare_turbines(&first, &first).unwrap();
    assert!(
        same.flow_difference_mean_ratio.unwrap().abs() < 1e-3 && same.flow_differs_ratio < 0.1,
        "{same:?}"
    );
    let other = compare_turbines(&first, &second).unwrap();
    assert!((other.flow_difference_mean_ratio.unwrap() - 0.03).abs() < 0.004, "{other:?}");
    assert!((other.efficiency_difference_mean.unwrap() + 0.02).abs() < 0.004);
    assert!(other.flow_differs_ratio > 0.9 && other.points.len() > 50);
}

#[test]
fn a_table_has_every_line_and_few_points_are_refused() {
    let map = map(&[0.5], 0.002, 0.002);
    let fitted = fit_turbine(map.clone()).unwrap().fitted.unwrap();
    assert_eq!(fitted.lines.len(), 5);
    assert!(fitted.lines.iter().flat_map(|line| &line.nodes).all(|node| node.flow_low < node.flow_high));
    assert!(fitted.flow_error_rms_ratio < 0.01);
    let few = TurbineMap { points: map.points[..2].to_vec(), ..map };
    assert_eq!(TurbineFit::new(&few).unwrap_err(), TurbineFitError::TooFewPoints(2));
}
