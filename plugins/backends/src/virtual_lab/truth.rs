//! True values known only to the simulator, sample by sample; recorded under /truth and read by scoring alone.

use mapper_core::TruthColumn;
use mapper_physics::simulation::model::Outputs;

type Reader = fn(&Outputs) -> f64;

/// Columns from the model's outputs: name, unit, value. Undefined (NaN) at standstill.
const FROM_OUTPUTS: [(&str, &str, Reader); 9] = [
    ("eta", "1", |outputs| outputs.efficiency),
    ("h_w_m2k", "W/(m2 K)", |outputs| outputs.h_w_m2k),
    ("flow_kg_s", "kg/s", |outputs| outputs.flow_kg_s),
    ("pressure_ratio", "1", |outputs| outputs.pressure_ratio),
    ("surge_position_ratio", "1", |outputs| outputs.surge_position_ratio),
    ("t1_prime_k", "K", |outputs| outputs.t1_prime_k),
    ("t2_prime_k", "K", |outputs| outputs.t2_prime_k),
    ("t2_gas_k", "K", |outputs| outputs.t2_k),
    ("compressor_power_w", "W", |outputs| outputs.compressor_power_w),
];

/// Collects truth into columns.
#[derive(Debug, Default)]
pub struct TruthRecorder {
    from_outputs: [Vec<f64>; FROM_OUTPUTS.len()],
    speed_rpm: Vec<f64>,
    tc_k: Vec<f64>,
    tt_k: Vec<f64>,
    surge_flow_kg_s: Vec<f64>,
}

impl TruthRecorder {
    /// Adds one sample: shaft speed, temperatures of both housings, surge flow at this speed; `outputs` is `None` at standstill.
    pub fn push(&mut self, [speed_rpm, tc_k, tt_k, surge_flow_kg_s]: [f64; 4], outputs: Option<&Outputs>) {
        for (column, (_, _, read)) in self.from_outputs.iter_mut().zip(FROM_OUTPUTS) {
            column.push(outputs.map_or(f64::NAN, read));
        }
        self.speed_rpm.push(speed_rpm);
        self.tc_k.push(tc_k);
        self.tt_k.push(tt_k);
        self.surge_flow_kg_s.push(surge_flow_kg_s);
    }

    /// The columns.
    pub fn finish(self) -> Vec<TruthColumn> {
        let column = |name: &str, unit: &str, values| TruthColumn {
            name: name.to_owned(),
            unit: unit.to_owned(),
            values,
        };
        let mut columns: Vec<TruthColumn> = FROM_OUTPUTS
            .iter()
            .zip(self.from_outputs)
            .map(|((name, unit, _), values)| column(name, unit, values))
            .collect();
        columns.push(column("speed_rpm", "rpm", self.speed_rpm));
        columns.push(column("tc_k", "K", self.tc_k));
        columns.push(column("tt_k", "K", self.tt_k));
        columns.push(column("surge_flow_kg_s", "kg/s", self.surge_flow_kg_s));
        columns
    }
}
