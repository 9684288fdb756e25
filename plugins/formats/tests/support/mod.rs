//! A realistic map made from closed formulas (`docs/reference/model.md`, compressor map of turbo_a), independent of the
//! physics crate, which this crate may not depend on.

use mapper_core::{
    Bound, CommonErrors, CompressorMap, EfficiencyDefinition, EstimateUncertainty, IdentifiedPoint, MapPoint,
    Method, OperatingPoint, ReferenceState, SpeedLine, StepKind, Verdict, Warning, confidence_interval_95,
};

/// Flow (kg/s), pressure ratio, efficiency at corrected speed (rpm) and x, 1 at surge, 0 at choke, below 0 beyond.
pub fn closed_form(speed_corrected_rpm: f64, x: f64) -> (f64, f64, f64) {
    let n = speed_corrected_rpm / 1e5;
    let u = std::f64::consts::PI * 0.052 * speed_corrected_rpm / 60.0;
    let ratio_surge = (1.0 + 1.06 * u * u / (2.0 * 1005.0 * 298.0)).powf(3.5);
    let (flow_surge, flow_choke) = (0.0265 * n.powf(1.35), 0.052 + 0.058 * n.powf(1.25));
    let ratio_choke = 1.0 + 0.15 * (ratio_surge - 1.0);
    let ratio = ratio_choke + x * (ratio_surge - ratio_choke);
    let flow = if x <= 0.0 {
        flow_choke
    } else {
        flow_surge + (flow_choke - flow_surge) * (1.0 - x.powf(2.2)).max(0.0).sqrt()
    };
    let peak = 0.74 - 0.07 * (n - 1.05).powi(2) - 0.10 * (n - 1.2f64).max(0.0).powi(2);
    let optimum = flow_surge + 0.42 * (flow_choke - flow_surge);
    let eta = (peak * (1.0 - 0.9 * ((flow - optimum) / (flow_choke - flow_surge)).powi(2))).max(0.2);
    (flow, ratio, eta)
}

/// Eight speed lines of six points; the first of all points and one more are unusable, some are doubtful.
pub fn turbo_a() -> CompressorMap {
    let mut step = 0;
    let lines = (0..8)
        .map(|i| {
            let speed_rpm = 50_000.0 + 17_000.0 * f64::from(i);
            let points = [0.985, 0.93, 0.82, 0.66, 0.42, 0.12]
                .iter()
                .enumerate()
                .map(|(j, x)| {
                    let point = point(step, speed_rpm, *x, 0.6 + 0.3 * j as f64);
                    step += 1;
                    point
                })
                .collect();
            SpeedLine {
                speed_corrected_rpm: speed_rpm,
                speed_spread_rpm: 0.0,
                target_speed_rpm: Some(speed_rpm),
                points,
            }
        })
        .collect();
    CompressorMap {
        machine: "turbo_a".to_owned(),
        reference: ReferenceState::SAE,
        method: Method::Dynamic,
        efficiency: Some(EfficiencyDefinition::ConstantGamma(1.395)),
        gas: Some("air, 8.2 g of water per kg of dry gas".to_owned()),
        wheel_diameter_m: None,
        lines,
        surge: Vec::new(),
        fitted: None,
    }
}

fn point(step: usize, speed_rpm: f64, x: f64, valve_opening_ratio: f64) -> MapPoint {
    let (flow_kg_s, pressure_ratio, eta) = closed_form(speed_rpm, x);
    // Slow lines are less accurate because of small temperature rises; a fixed pattern replaces random numbers.
    let standard_error = 0.0012 * (160_000.0 / speed_rpm).powi(2) * (1.0 + 0.5 * (step % 3) as f64);
    let eta = eta + standard_error * [0.6, -0.9, 0.2, 1.1, -0.4][step % 5];
    let (verdict, warning) = match step {
        0 => (Verdict::Unusable, Some(Warning::NoTransient)),
        27 => (Verdict::Unusable, Some(Warning::AtBound(Bound::Eta { eta: 2.0 }))),
        4 | 5 | 10 | 23 => (
            Verdict::Doubtful,
            Some(Warning::SmallGradient { dt2_k: 0.25, needed_dt2_k: 0.5, eta_sigma: 0.0625 }),
        ),
        _ => (Verdict::Good, None),
    };
    let eta = (verdict != Verdict::Unusable).then_some(eta);
    let interval = eta.map(|eta| confidence_interval_95(eta, standard_error));
    let h = eta.map(|_| 40.0 + 900.0 * flow_kg_s);
    let identified = IdentifiedPoint {
        step,
        kind: StepKind::Point,
        target: Some(OperatingPoint { speed_rpm, valve_opening_ratio }),
        speed_rpm,
        valve_opening_ratio,
        flow_kg_s,
        flow_corrected_kg_s: flow_kg_s,
        speed_corrected_rpm: speed_rpm,
        pressure_ratio,
        t1_k: 298.15,
        p1_pa: 100_000.0,
        eta,
        eta_low: interval.map(|i| i.0),
        eta_high: interval.map(|i| i.1),
        eta_allowance: None,
        eta_uncertainty: eta
            .map(|_| EstimateUncertainty { noise_standard_error: standard_error, bias_standard_error: 0.0 }),
        h_w_m2k: h,
        h_low_w_m2k: h.map(|h| 0.95 * h),
        h_high_w_m2k: h.map(|h| 1.05 * h),
        h_uncertainty: None,
        common: CommonErrors {
            eta_changes: vec![0.8 * standard_error, -0.1 * standard_error],
            h_changes_w_m2k: h.map(|h| 0.01 * h).into_iter().collect(),
            flow_corrected_standard_error_ratio: 0.005,
            pressure_ratio_standard_error: 0.0012 * pressure_ratio,
        },
        method: Method::Dynamic,
        verdict,
        warnings: warning.into_iter().collect(),
        window: None,
        residual_rms_k: eta.map(|_| 0.05),
        dt2_k: Some(-12.5),
        dtc_k: None,
    };
    MapPoint { flow_corrected_kg_s: flow_kg_s, pressure_ratio, eta, identified, shift: None }
}

/// [`turbo_a`] with a fitted surface.
#[allow(dead_code)]
pub fn fitted() -> CompressorMap {
    let options = mapper_maps::MapFitOptions { leave_one_out: false, ..Default::default() };
    mapper_maps::fit_map(turbo_a(), &options).unwrap()
}
