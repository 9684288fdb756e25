//! Maps of similar machines, and of two parts.

use crate::support::{Row, map_of};
use mapper_core::CompressorMap;
use mapper_maps::{MapScale, ScaleError, merge, scaled};
use mapper_physics::compressor_map::closed_form_map::{ClosedFormMap, CompressorCharacteristic};

/// Lines of these speeds of the closed form of a wheel, at these shares of the way from choke to surge.
fn lines(wheel_diameter_m: f64, speeds_rpm: &[f64], shares: &[f64]) -> CompressorMap {
    let exact = ClosedFormMap { wheel_diameter_m };
    let rows: Vec<Row> = speeds_rpm
        .iter()
        .flat_map(|speed_rpm| {
            let (_, surge) = exact.surge_point(*speed_rpm);
            shares.iter().map(move |share| {
                let point = exact.evaluate(*speed_rpm, 1.0 + share * (surge - 1.0));
                [*speed_rpm, point.flow_corrected_kg_s, 1.0 + share * (surge - 1.0), point.efficiency]
            })
        })
        .collect();
    map_of(&rows)
}

const SPEEDS_RPM: [f64; 4] = [60e3, 90e3, 120e3, 150e3];
const SHARES: [f64; 5] = [0.9, 0.75, 0.6, 0.45, 0.3];

fn rows(map: &CompressorMap) -> Vec<Row> {
    let of_line = |line: &mapper_core::SpeedLine| -> Vec<Row> {
        let point = |point: &mapper_core::MapPoint| {
            [line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio, point.eta.unwrap()]
        };
        line.points.iter().map(point).collect()
    };
    map.lines.iter().flat_map(of_line).collect()
}

fn assert_equal(found: &CompressorMap, expected: &CompressorMap) {
    let (found, expected) = (rows(found), rows(expected));
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(&expected) {
        for (a, b) in found.iter().zip(expected) {
            // Some roundings.
            assert!((a / b - 1.0).abs() < 1e-12, "{found:?} {expected:?}");
        }
    }
}

/// The closed form depends on blade Mach number and flow coefficient alone, so a wheel of another size has exactly the scaled map.
#[test]
fn a_similar_wheel_has_the_scaled_map() {
    let of_larger = lines(0.065, &SPEEDS_RPM.map(|rpm| rpm / 1.25), &SHARES);
    let larger = scaled(lines(0.052, &SPEEDS_RPM, &SHARES), MapScale::of_size(1.25)).unwrap();
    assert_equal(&larger, &of_larger);
    let back = scaled(larger, MapScale::of_size(0.8)).unwrap();
    assert_equal(&back, &lines(0.052, &SPEEDS_RPM, &SHARES));
}

/// Gas at rest is not compressed, whatever the factor, and no efficiency reaches 1.
#[test]
fn a_factor_keeps_pressure_ratio_one_and_efficiencies_below_one() {
    let map = map_of(&[[60e3, 0.10, 1.0, 0.5], [60e3, 0.05, 1.4, 0.8]]);
    let neutral = MapScale::of_size(1.0);
    let found = scaled(map.clone(), MapScale { pressure_ratio: 1.5, ..neutral }).unwrap();
    assert_equal(&found, &map_of(&[[60e3, 0.10, 1.0, 0.5], [60e3, 0.05, 1.6, 0.8]]));
    let refused = |scale| scaled(map.clone(), scale).unwrap_err();
    assert!(matches!(
        refused(MapScale { efficiency: 1.25, ..neutral }),
        ScaleError::Efficiency { eta: 0.8, .. }
    ));
    for factor in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(refused(MapScale { flow: factor, ..neutral }), ScaleError::NotPositive { .. }));
    }
}

#[test]
fn the_parts_of_a_map_merge_to_the_whole() {
    let whole = lines(0.052, &SPEEDS_RPM, &SHARES);
    let mut sorted = whole.clone();
    sorted.lines.iter_mut().for_each(|line| line.points.reverse());
    let part = |speeds: &[f64], shares: &[f64]| lines(0.052, speeds, shares);
    // Of the two parts either may come first, and neither lies over the other.
    for (first, second) in [
        (part(&SPEEDS_RPM, &SHARES[..2]), part(&SPEEDS_RPM, &SHARES[2..])),
        (part(&SPEEDS_RPM, &SHARES[3..]), part(&SPEEDS_RPM, &SHARES[..3])),
    ] {
        let merged = merge(&first, &second);
        let flows = |map: &CompressorMap| -> Vec<f64> {
            let mut flows: Vec<f64> = rows(map).iter().map(|row| row[1]).collect();
            flows.sort_by(f64::total_cmp);
            flows
        };
        assert_eq!(flows(&merged.map), flows(&sorted));
        assert!(merged.lines.iter().all(|line| line.left_out == 0));
    }
    let merged = merge(&part(&SPEEDS_RPM[2..], &SHARES), &part(&SPEEDS_RPM[..2], &SHARES));
    assert_equal(&merged.map, &whole);
    assert_eq!(merged.seam, None);
    // A map adds nothing to itself, and meets itself without a step.
    let merged = merge(&whole, &whole);
    assert_equal(&merged.map, &whole);
    assert!(merged.lines.iter().all(|line| line.left_out == SHARES.len() && line.of_second == 0));
    let seam = merged.seam.unwrap();
    assert!(seam.eta_difference_rms < 1e-9 && seam.distance_rms_ratio < 1e-9, "{seam:?}");
}
