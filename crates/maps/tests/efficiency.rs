//! Conversion of a map between definitions of efficiency.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::support::map_of;
use mapper_core::EfficiencyDefinition::{ConstantGamma, Enthalpy, KappaOfT1};
use mapper_maps::{compare, convert_efficiency};

/// Air compressed from 298 K and 100 kPa with an efficiency of 72 % by enthalpy (CoolProp 6, air as a real gas): pressure
/// ratio, and the efficiency that gamma = 1.4 gives from its T2.
const REAL_GAS: [[f64; 2]; 3] = [[2.0, 0.722_215_93], [3.0, 0.724_680_41], [4.0, 0.727_132_48]];

#[test]
fn constant_gamma_is_converted_to_enthalpy() {
    for [ratio, eta] in REAL_GAS {
        let map = map_of(&[[80e3, 0.05, ratio, eta]]);
        let converted = convert_efficiency(map.clone(), ConstantGamma(1.4), Enthalpy);
        let found = converted.lines[0].points[0].eta.unwrap();
        // The heat capacity is within 0.1 %, and air at a few bar is not quite an ideal gas: 0.06 points.
        assert!((found - 0.72).abs() < 6e-4, "{found} at {ratio}");
        let back = convert_efficiency(converted, Enthalpy, ConstantGamma(1.4));
        assert!((back.lines[0].points[0].eta.unwrap() - eta).abs() < 1e-9);
    }
}

/// The definitions agree where nothing is compressed, and the paper's reads the higher the more is.
#[test]
fn the_papers_efficiency_is_higher() {
    let change = |ratio: f64| {
        let map = map_of(&[[80e3, 0.05, ratio, 0.7]]);
        let found = convert_efficiency(map, KappaOfT1, Enthalpy).lines[0].points[0].eta.unwrap();
        0.7 - found
    };
    assert!(change(1.01).abs() < 1e-4);
    assert!(change(2.0) > change(1.5) && change(4.0) > change(2.0));
}

/// Two files of one map differ in nothing, whatever their definitions.
#[test]
fn definitions_are_no_difference_between_maps() {
    let rows = [60e3, 90e3, 120e3].into_iter().flat_map(|speed: f64| {
        (0..6).map(move |place| {
            let (x, n) = (f64::from(place) / 5.0, speed / 60e3);
            [
                speed,
                n * (0.03 + 0.03 * x),
                1.0 + 0.3 * n * n * (1.0 - 0.6 * x * x),
                0.7 - 0.4 * (x - 0.4) * (x - 0.4),
            ]
        })
    });
    let mut first = map_of(&rows.collect::<Vec<_>>());
    first.efficiency = Some(KappaOfT1);
    let second = convert_efficiency(first.clone(), KappaOfT1, Enthalpy);
    // Rounding, once there and back.
    assert!(compare(&first, &second).unwrap().eta_difference_rms < 1e-9);
    let unnamed = mapper_core::CompressorMap { efficiency: None, ..second };
    assert!(compare(&first, &unnamed).unwrap().eta_difference_rms > 1e-3);
}
