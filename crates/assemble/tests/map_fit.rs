//! The fit of a map against lines that it has not seen.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use mapper_assemble::{MapFit, MapFitError, MapFitOptions, fit_map, leave_out};
use mapper_core::{CompressorMap, LeftOutLine};
use mapper_physics::characteristic::CompressorCharacteristic;
use mapper_physics::closed_form_map::ClosedFormMap;
use support::{Row, map_of};

/// A map as users have them (tests/data/LICENSE-sample).
fn sample() -> CompressorMap {
    let rows: Vec<Row> = include_str!("data/sample_compressor.csv")
        .lines()
        .skip(1)
        .map(|line| {
            let numbers: Vec<f64> = line.split(',').map(|field| field.trim().parse().unwrap()).collect();
            numbers.try_into().unwrap()
        })
        .collect();
    assert_eq!(rows.len(), 93);
    map_of(&rows)
}

/// The closed form of turbo_a, 7 points on each of 9 lines.
fn turbo_a() -> CompressorMap {
    let exact = ClosedFormMap { wheel_diameter_m: 0.052 };
    let rows: Vec<Row> = (0..9)
        .flat_map(|i| {
            let speed = 50e3 + 15e3 * f64::from(i);
            let (_, surge) = exact.surge_point(speed);
            let choke = 1.0 + 0.15 * (surge - 1.0);
            (0..7).map(move |j| {
                let ratio = choke + (surge - choke) * (0.99 - 0.89 * f64::from(j) / 6.0);
                let point = exact.evaluate(speed, ratio);
                [speed, point.flow_corrected_kg_s, ratio, point.efficiency]
            })
        })
        .collect();
    map_of(&rows)
}

fn worst(lines: &[LeftOutLine], outermost: bool, value: fn(&LeftOutLine) -> f64) -> f64 {
    lines.iter().filter(|line| line.outermost == outermost).map(value).fold(0.0, f64::max)
}

fn mean(lines: &[LeftOutLine], value: fn(&LeftOutLine) -> f64) -> f64 {
    let inner: Vec<f64> = lines.iter().filter(|line| !line.outermost).map(value).collect();
    inner.iter().sum::<f64>() / inner.len() as f64
}

#[test]
fn lines_that_were_left_out_are_found() {
    let started = std::time::Instant::now();
    let map = sample();
    let lines = leave_out(&MapFit::new(&map).unwrap());
    eprintln!("{:?} {lines:#?}", started.elapsed());
    let eta = |line: &LeftOutLine| line.eta.unwrap();
    assert_eq!(lines.len(), 13);
    // Plain similarity interpolation between the neighbours has 1.2 % and 0.3 to 0.5 points, and cannot extrapolate.
    assert!(mean(&lines, |l| l.distance_ratio) < 0.010);
    assert!(mean(&lines, eta) < 0.005);
    assert!(worst(&lines, true, |l| l.distance_ratio) < 0.04);
    assert!(worst(&lines, true, eta) < 0.02);
}
