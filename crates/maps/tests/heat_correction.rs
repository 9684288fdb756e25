//! A hot map corrected by the heat that it shows.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::support::{Row, map_of};
use mapper_core::{HeatCorrected, Method, Warning};
#[allow(dead_code, reason = "shared with other tests, which use more of it")]
use mapper_maps::{HeatCorrectionError, correct_for_heat};
use proptest::prelude::*;

const CP: f64 = 1005.0;
const T_REF_K: f64 = 298.0;

/// A compressor by Euler's equation at five to nine speeds, with a heat that counts as work: row and true efficiency.
/// Reaction and density law are those of a wheel of its own, not what the correction assumes.
fn euler(speeds_krpm: &[f64], heat_w: f64) -> Vec<(Row, f64)> {
    let mut rows = Vec::new();
    for krpm in speeds_krpm {
        let tip_m_s = std::f64::consts::PI * 0.052 * krpm * 1e3 / 60.0;
        for i in 0..7 {
            let coefficient = 0.045 + 0.012 * f64::from(i);
            let flow_kg_s = coefficient * 1.169 * 0.052 * 0.052 * tip_m_s;
            let mut work = 0.7;
            for _ in 0..60 {
                let rise = work * tip_m_s * tip_m_s / (CP * T_REF_K);
                work = 0.84 - 1.9 * coefficient / (1.0 + 0.5 * rise).powf(2.2) + 1.5e-3 / coefficient;
            }
            let eta = 0.74 - 40.0 * (coefficient - 0.075f64).powi(2);
            let isentropic_j_kg = eta * work * tip_m_s * tip_m_s;
            let pressure_ratio = (1.0 + isentropic_j_kg / (CP * T_REF_K)).powf(3.5);
            let apparent = isentropic_j_kg / (work * tip_m_s * tip_m_s + heat_w / flow_kg_s);
            rows.push(([krpm * 1e3, flow_kg_s, pressure_ratio, apparent], eta));
        }
    }
    rows
}

const SPEEDS_KRPM: [f64; 7] = [50.0, 65.0, 80.0, 100.0, 120.0, 140.0, 160.0];

fn rows_of(found: &[(Row, f64)]) -> Vec<Row> {
    found.iter().map(|(row, _)| *row).collect()
}

#[test]
fn a_heat_that_all_points_share_is_found_and_taken_off() {
    for heat_w in [0.0, 15.0, 40.0, 80.0] {
        let made = euler(&SPEEDS_KRPM, heat_w);
        let (map, correction) = correct_for_heat(map_of(&rows_of(&made)), None).unwrap();
        let shown_w = correction.heat_shown_w.unwrap();
        // The wheel's own reaction and cp leave a few watts.
        assert!((shown_w - heat_w).abs() < 4.0, "{shown_w} W of {heat_w} W");
        let truth = made.iter().map(|(_, eta)| *eta);
        for (point, eta) in map.lines.iter().flat_map(|line| &line.points).zip(truth) {
            assert!((point.eta.unwrap() - eta).abs() < 0.012, "{heat_w} W: {:?} {eta}", point.eta);
            let (low, high) = (point.identified.eta_low.unwrap(), point.identified.eta_high.unwrap());
            assert!(low < eta && eta < high);
            assert_eq!(point.identified.warnings[0].code(), "heat_corrected");
            assert_eq!(point.identified.common.eta_changes.len(), 2);
        }
    }
}

/// By hand: 30 W into 0.02 kg/s are 1500 J/kg. At pressure ratio 1.1 the isentropic work is 1004.8 x 298 x (1.1^0.28567 - 1) =
/// 8266 J/kg; of an apparent 12 716 J/kg (65 %) 11 216 are left: 73.7 %.
#[test]
fn a_heat_that_is_given() {
    let map = map_of(&[[50e3, 0.02, 1.1, 0.65]]);
    let (map, correction) = correct_for_heat(map, Some(30.0)).unwrap();
    let eta = map.lines[0].points[0].eta.unwrap();
    assert!((eta - 0.737).abs() < 1e-3, "{eta}");
    assert_eq!((correction.heat_w, correction.heat_shown_w), (30.0, None));
    // The heat is known to half its size, the rest to a point.
    let point = &map.lines[0].points[0].identified;
    let half = 0.5 * (point.eta_high.unwrap() - point.eta_low.unwrap());
    let by_heat = 0.5 * 30.0 * eta * eta / 8266.0 / 0.02;
    assert!((half / (1.96 * by_heat.hypot(0.01)) - 1.0).abs() < 0.01, "{half}");
}

#[test]
fn more_heat_than_a_point_took_up_leaves_it_without_efficiency() {
    let (map, correction) = correct_for_heat(map_of(&[[50e3, 0.02, 1.1, 0.65]]), Some(120.0)).unwrap();
    let point = &map.lines[0].points[0];
    assert_eq!((point.eta, point.identified.eta, point.identified.eta_low), (None, None, None));
    let lost = Warning::HeatCorrected(HeatCorrected::TooMuchHeat { heat_w: 120.0 });
    assert_eq!(point.identified.warnings, [lost]);
    assert!(correction.lines.is_empty());
}

#[test]
fn what_shows_no_heat_is_refused_with_what_to_do() {
    let refused = |map, heat| correct_for_heat(map, heat).unwrap_err();
    let mut joint = map_of(&rows_of(&euler(&SPEEDS_KRPM, 30.0)));
    joint.method = Method::Joint;
    assert!(matches!(refused(joint, None), HeatCorrectionError::Adiabatic(_)));
    let two = map_of(&rows_of(&euler(&[50.0, 100.0], 30.0)));
    assert!(matches!(refused(two, None), HeatCorrectionError::TooFew { lines: 2, .. }));
    let near = map_of(&rows_of(&euler(&[100.0, 110.0, 120.0, 130.0], 30.0)));
    assert!(matches!(refused(near, None), HeatCorrectionError::OneSpeed { .. }));
    for heat_w in [-1.0, f64::NAN, f64::INFINITY] {
        let map = map_of(&[[50e3, 0.02, 1.1, 0.65]]);
        assert!(matches!(refused(map, Some(heat_w)), HeatCorrectionError::Heat { .. }));
    }
}

/// Slow lines that take less work than fast ones: nothing is taken off, and the map says so.
#[test]
fn a_heat_below_zero_is_not_put_in() {
    let map = map_of(&rows_of(&euler(&SPEEDS_KRPM, -20.0)));
    let before: Vec<_> = map.lines.iter().flat_map(|line| &line.points).map(|point| point.eta).collect();
    let (map, correction) = correct_for_heat(map, None).unwrap();
    assert!(correction.heat_shown_w.unwrap() < -10.0 && correction.heat_w == 0.0);
    for (point, apparent) in map.lines.iter().flat_map(|line| &line.points).zip(before) {
        assert!((point.eta.unwrap() - apparent.unwrap()).abs() < 1e-12);
    }
}

proptest! {
    /// Any map gives a result or a message, and every efficiency in the result is possible.
    #[test]
    fn any_map_is_corrected_or_refused(
        rows in prop::collection::vec((1e3..3e5f64, 1e-4..2.0f64, 0.2..9.0f64, -0.5..1.5f64), 0..40),
        heat in prop::option::of(0.0..1e4f64),
    ) {
        let mut rows: Vec<Row> = rows.into_iter().map(|(n, m, p, e)| [(n / 2e4).round() * 2e4 + 1e3, m, p, e]).collect();
        rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
        if let Ok((map, correction)) = correct_for_heat(map_of(&rows), heat) {
            prop_assert!(correction.heat_w.is_finite() && correction.heat_w >= 0.0);
            for point in map.lines.iter().flat_map(|line| &line.points) {
                if let (Some(eta), Some(low), Some(high)) = (point.eta, point.identified.eta_low, point.identified.eta_high) {
                    prop_assert!(eta <= 1.5 && low <= eta && eta <= high);
                }
            }
        }
    }
}
