//! The columns of the model against differences of its predictions.

use super::*;
use crate::IdentifyConfig;
use crate::joint::step_model::smoothing::Smoothing;
use nalgebra::DMatrix;

fn model(has_inner_wall: bool) -> Model {
    let config = IdentifyConfig::default();
    let setting = Setting {
        internal_area_m2: config.internal_area_m2,
        outlet_diameter_m: config.outlet_diameter_m,
        inlet_diameter_m: config.inlet_diameter_m,
        rest_pressure_pa: 100e3,
        air: config.air,
        reynolds_reference: 1.3e5,
    };
    Model { setting, housing: config.housing, has_inner_wall, has_balance: true }
}

/// A step after a jump: the housing warms up, flow and P2 settle.
fn step() -> StepRows {
    let row = |i: i32| {
        let t_s = 0.5 * f64::from(i);
        let settling = (-t_s / 3.0).exp();
        Row {
            t_s,
            t1_k: 297.0 + 0.01 * t_s,
            t2_k: 400.0,
            tc_k: 350.0 + 12.0 * (1.0 - (-t_s / 60.0).exp()),
            tc_read_k: 350.0,
            tc_slope_k_s: 0.2 * (-t_s / 60.0).exp(),
            p1_pa: 99e3,
            p2_pa: 220e3 + 3e3 * settling,
            flow_kg_s: 0.06 - 2e-3 * settling,
            tt_k: 620.0,
            oil_k: 360.0,
            ambient_k: 298.0,
            place: (120e3, 0.06),
        }
    };
    let rows: Vec<Row> = (12..80).map(row).collect();
    let t_s: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let count = rows.len();
    StepRows {
        position: 0,
        lead: (0..12).map(row).collect(),
        end: rows[count - 1],
        rows,
        smoothing: Some(Smoothing::new(&t_s)),
        noise: DMatrix::identity(count, count),
    }
}

/// Every column against a central difference of the prediction, with and without an inner wall, before and behind the linear part of the
/// probe's lag.
#[test]
fn columns_are_derivatives() {
    let step = step();
    let terms: Vec<[f64; TERM_COUNT]> =
        (0..80).map(|i| std::array::from_fn(|k| 1e-2 * f64::from(80 - i) / (1.0 + k as f64))).collect();
    let history = StepHistory { step: &step, terms };
    let mut shared = [0.0; SHARED];
    shared[LN_COEFFICIENT] = 0.004_f64.ln() + 1.13 * 1.3e5_f64.ln();
    shared[EXPONENT] = 1.13;
    shared[ALPHA] = 0.1;
    shared[LN_HEATING_COOLING_RATIO] = 0.1;
    shared[PREHEAT] = 0.4;
    shared[TC_LAG] = 1.5;
    shared[LOGIT_INNER] = -0.5;
    shared[LN_INNER_CONDUCTANCE] = 3.0;
    shared[GAINS + 1] = 0.01;
    shared[SURFACE] = 0.6;
    shared[SURFACE + 1] = 0.1;
    let local = [0.7, 0.01, 399.0, 2.0];
    for (has_inner_wall, square_mm2) in [(false, 0.04), (false, 2.0), (true, 0.04), (true, 2.0)] {
        let model = model(has_inner_wall);
        shared[PROBE_MM2] = square_mm2;
        let predict = |shared: &SharedVector, local: &LocalVector| {
            model.predict(&history, (shared, local), &[false; SHARED], false, None).readings_k
        };
        let columns = model.predict(&history, (&shared, &local), &[true; SHARED], true, None).columns;
        for index in 0..SHARED + LOCAL {
            let step = match index {
                PROBE_MM2 => 1e-4,
                HUMIDITY => 1e-5,
                _ if (OFFSETS + 3..FLOW_GAIN).contains(&index) || index == BAROMETER => 1.0,
                _ => 1e-4,
            };
            let at = |by: f64| {
                let (mut shared, mut local) = (shared, local);
                if index < SHARED {
                    shared[index] += by
                } else {
                    local[index - SHARED] += by
                }
                predict(&shared, &local)
            };
            let (low, high) = (at(-step), at(step));
            let expected: Vec<f64> = high.iter().zip(&low).map(|(a, b)| (a - b) / (2.0 * step)).collect();
            let size = expected.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
            for (row, (found, expected)) in columns[index].iter().zip(&expected).enumerate() {
                // Coefficients along a row of the inner wall are held: 2 % of the largest.
                let allowed = if has_inner_wall { 0.03 } else { 2e-2 } * size + 1e-6;
                assert!(
                    (found - expected).abs() <= allowed,
                    "inner wall {has_inner_wall}, parameter {index}, row {row}: {found} and {expected}, largest {size}"
                );
            }
        }
    }
}
