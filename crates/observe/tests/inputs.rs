//! Inputs of the model from a recording: their jumps are kept, whatever the error of the transducer.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::{Channel, DeclaredUncertainty, NoiseColour, Recording, Series, StepKind, StepMarker};
use mapper_observe::Declared;
use mapper_observe::averages::Table;
use mapper_observe::model_inputs::lagged_command::Response;
use mapper_observe::model_inputs::smoothed_inputs::SmoothedInputs;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::steady::Inputs;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

const STEP_S: f64 = 60.0;

/// P3 jumps between three levels. Its transducer has a gain error of 0.2 % and an offset, and P4 follows the flow.
#[test]
fn jumps_are_kept_for_a_transducer_with_a_gain_error() {
    let levels_pa = [150e3, 220e3, 120e3, 190e3, 130e3, 165e3, 145e3, 240e3];
    let lag_s = 0.3;
    let steps: Vec<StepMarker> = levels_pa
        .iter()
        .enumerate()
        .map(|(index, p3_pa)| StepMarker {
            index,
            kind: StepKind::Point,
            start_s: STEP_S * index as f64,
            end_s: STEP_S * (index + 1) as f64,
            from: None,
            to: None,
            p3_pa: *p3_pa,
            valve_opening_ratio: 0.7,
        })
        .collect();
    let t_s: Vec<f64> = (0..4800).map(|i| 0.1 * f64::from(i)).collect();
    let p3_pa = |t_s: f64| {
        let step = (t_s / STEP_S) as usize;
        let before = levels_pa[step.saturating_sub(1)];
        let since_s = t_s - STEP_S * step as f64;
        levels_pa[step] + (before - levels_pa[step]) * (-since_s / lag_s).exp()
    };
    let read_p3_pa = |t_s: f64| 1.002 * p3_pa(t_s) + 100.0;
    let p4_pa = |t_s: f64| 110e3 + 2e-3 * (p3_pa(t_s) - 150e3);
    let mut random = Pcg64::seed_from_u64(11);
    let mut series = |sigma_pa: f64, exact: &dyn Fn(f64) -> f64| {
        let noisy = |t_s: &f64| exact(*t_s) + sigma_pa * random.sample::<f64, _>(StandardNormal);
        Series { t_s: t_s.clone(), values: t_s.iter().map(noisy).collect() }
    };
    let (p3_sigma_pa, p4_sigma_pa) = (80.0, 30.0);
    let recording = Recording {
        series: [(Channel::P3, series(p3_sigma_pa, &read_p3_pa)), (Channel::P4, series(p4_sigma_pa, &p4_pa))]
            .into(),
        steps,
        ..Recording::default()
    };
    let noise = |noise_sigma| DeclaredUncertainty { noise_sigma, ..Default::default() };
    let declared = Declared {
        sensors: [(Channel::P3, noise(p3_sigma_pa)), (Channel::P4, noise(p4_sigma_pa))].into(),
        noise_colour: NoiseColour::default(),
        tolerances: Default::default(),
        nominal: BoundaryConditions::default(),
        common_offsets: Vec::new(),
        actuators: None,
    };
    let table = Table::new(&recording).unwrap();
    let responses = (Response::lag(lag_s), Response::lag(0.0));
    let inputs = SmoothedInputs::read(&table, &recording, &declared, responses);
    // The noise of 5 s at 10 Hz, and four standard deviations of it. A gain that is smeared over a jump is off by half of 0.2 % of 120 kPa.
    let allowed = |sigma_pa: f64| 4.0 * sigma_pa / 50f64.sqrt();
    for t_s in
        (1..8).flat_map(|step| [-0.1, 2.0, 5.0, 20.0].map(|since_s| STEP_S * f64::from(step) + since_s))
    {
        let at = inputs.at(t_s);
        let [p3_off_pa, p4_off_pa] = [at.p3_pa - read_p3_pa(t_s), at.p4_pa - p4_pa(t_s)];
        assert!(p3_off_pa.abs() < allowed(p3_sigma_pa), "P3 at {t_s} s: {p3_off_pa} Pa");
        assert!(p4_off_pa.abs() < allowed(p4_sigma_pa), "P4 at {t_s} s: {p4_off_pa} Pa");
    }
}
