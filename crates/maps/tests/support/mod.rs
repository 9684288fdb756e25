//! Maps from rows of numbers.

use mapper_core::{
    CommonErrors, CompressorMap, IdentifiedPoint, MapPoint, Method, ReferenceState, SpeedLine, StepKind,
    Verdict,
};

/// Corrected speed (rpm), corrected flow (kg/s), pressure ratio, efficiency.
pub type Row = [f64; 4];

/// Lines of rows with equal speed.
pub fn map_of(rows: &[Row]) -> CompressorMap {
    let lines = rows
        .chunk_by(|a, b| a[0] == b[0])
        .map(|rows| SpeedLine {
            speed_corrected_rpm: rows[0][0],
            speed_spread_rpm: 0.0,
            target_speed_rpm: None,
            points: rows.iter().map(point).collect(),
        })
        .collect();
    CompressorMap {
        machine: "test".to_owned(),
        reference: ReferenceState::SAE,
        method: Method::Imported,
        efficiency: None,
        gas: None,
        wheel_diameter_m: None,
        lines,
        surge: Vec::new(),
        fitted: None,
    }
}

fn point(row: &Row) -> MapPoint {
    let [speed_rpm, flow_kg_s, pressure_ratio, eta] = *row;
    let identified = IdentifiedPoint {
        step: 0,
        kind: StepKind::Point,
        target: None,
        speed_rpm,
        valve_opening_ratio: 1.0,
        flow_kg_s,
        flow_corrected_kg_s: flow_kg_s,
        speed_corrected_rpm: speed_rpm,
        pressure_ratio,
        t1_k: 298.0,
        p1_pa: 100_000.0,
        eta: Some(eta),
        eta_low: None,
        eta_high: None,
        eta_allowance: None,
        eta_uncertainty: None,
        h_w_m2k: None,
        h_low_w_m2k: None,
        h_high_w_m2k: None,
        h_uncertainty: None,
        common: CommonErrors::default(),
        method: Method::Imported,
        verdict: Verdict::Good,
        warnings: Vec::new(),
        window: None,
        residual_rms_k: None,
        dt2_k: None,
        dtc_k: None,
    };
    MapPoint { flow_corrected_kg_s: flow_kg_s, pressure_ratio, eta: Some(eta), identified, shift: None }
}
