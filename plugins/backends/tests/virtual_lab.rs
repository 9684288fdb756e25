//! The virtual lab as a rig: its response to setpoints, polls, trips and stops.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_backends::virtual_lab::{
    ActuatorDynamics, LabElement, LabElements, LabSettings, SensorErrors, Start, VirtualLab,
};
use mapper_core::{
    Backend, BackendError, Channel, DeclaredUncertainty, EventKind, RedundantSensors, RigMode, SampleBatch,
    Setpoints,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady;

fn ideal() -> LabSettings {
    LabSettings::ideal(Model::nominal(), BoundaryConditions::default())
}

fn setpoints(p3_pa: f64, valve_opening_ratio: f64) -> Setpoints {
    Setpoints { mode: RigMode::Running, p3_pa, t3_k: 773.15, valve_opening_ratio, oil_temperature_k: 323.15 }
}

fn p3_pa(speed_rpm: f64, valve_opening_ratio: f64) -> f64 {
    let boundary = BoundaryConditions { valve_opening_ratio, ..Default::default() };
    steady::hold_speed(&Model::nominal(), speed_rpm, &boundary).unwrap().boundary.p3_pa
}

fn last(batch: &SampleBatch, channel: Channel) -> f64 {
    batch.last(channel).unwrap()
}

/// The reference jump 110 -> 50 krpm at opening 0.7, row t = 110 s of the independent implementation.
#[test]
fn an_ideal_lab_is_the_model() {
    let mut lab = VirtualLab::new(ideal());
    lab.arm().unwrap();
    lab.set(&setpoints(p3_pa(110e3, 0.7), 0.7)).unwrap();
    let before = lab.poll(5.0).unwrap();
    assert!((last(&before, Channel::ShaftSpeed) - 110e3).abs() < 0.1);
    lab.set(&setpoints(p3_pa(50e3, 0.7), 0.7)).unwrap();
    for second in 6..=115 {
        let batch = lab.poll(f64::from(second)).unwrap();
        if second == 115 {
            let reference = reference_row();
            for (channel, expected) in [
                (Channel::ShaftSpeed, reference[0]),
                (Channel::P2, reference[1]),
                (Channel::Tc, reference[2]),
                (Channel::T2, reference[3]),
            ] {
                let found = last(&batch, channel);
                // The lab integrates to 1e-6 per step.
                assert!((found / expected - 1.0).abs() < 2e-5, "{channel}: {found} against {expected}");
            }
        }
    }
}

fn reference_row() -> [f64; 4] {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../crates/physics/tests/reference/transients.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let row = text.lines().find(|line| line.starts_with("110000,50000,0.7,110,")).unwrap();
    let values: Vec<f64> = row.split(',').map(|value| value.parse().unwrap()).collect();
    [values[4], values[5], values[6], values[13]]
}

fn noisy() -> LabSettings {
    let errors = SensorErrors {
        white_sigma: 0.08,
        coloured_sigma: 0.06,
        coloured_time_constant_s: 2.0,
        offset: 0.3,
        ..SensorErrors::default()
    };
    LabSettings {
        sensors: [(Channel::T2, errors), (Channel::T1, errors)].into(),
        p3_actuator: ActuatorDynamics::new(0.3, 50e3),
        valve_actuator: ActuatorDynamics::new(0.2, 1.0),
        seed: 42,
        ..ideal()
    }
}

fn session(settings: LabSettings) -> Vec<SampleBatch> {
    let mut lab = VirtualLab::new(settings);
    lab.arm().unwrap();
    lab.set(&setpoints(150e3, 0.7)).unwrap();
    let first = lab.poll(3.0).unwrap();
    lab.set(&setpoints(180e3, 1.0)).unwrap();
    vec![first, lab.poll(7.25).unwrap(), lab.poll(12.0).unwrap()]
}

/// Four T2 sensors; the second has an offset of 3 K, the third sticks after 5 s, the fourth has a tip of 4 mm.
fn with_four() -> LabSettings {
    let each = DeclaredUncertainty { noise_sigma: 0.1, offset_sigma: 0.25, gain_sigma_ratio: 0.0 };
    let declared = RedundantSensors::alike(Channel::T2, 4, each);
    let healthy = LabElement {
        errors: SensorErrors { white_sigma: 0.08, ..SensorErrors::default() },
        probe_diameter_m: None,
        lag_s: 0.0,
        stuck_after_s: f64::INFINITY,
    };
    let elements = vec![
        healthy,
        LabElement { errors: SensorErrors { offset: 3.0, ..healthy.errors }, ..healthy },
        LabElement { stuck_after_s: 5.0, ..healthy },
        LabElement { probe_diameter_m: Some(4e-3), ..healthy },
    ];
    LabSettings { redundant: [(Channel::T2, LabElements { declared, elements })].into(), ..noisy() }
}

#[test]
fn each_of_several_sensors_reads_by_itself_and_the_other_channels_as_without_them() {
    let (batches, without) = (session(with_four()), session(noisy()));
    assert_eq!(batches, session(with_four()));
    for (with, without) in batches.iter().zip(&without) {
        assert!(without.elements.is_empty());
        for (with, without) in with.columns.iter().zip(&without.columns) {
            assert_eq!(with.channel, without.channel);
            assert!(with.channel == Channel::T2 || with == without, "{}", with.channel);
        }
    }
    let column = |number: usize| -> Vec<f64> {
        batches.iter().flat_map(|batch| batch.elements[number - 1].values.clone()).collect()
    };
    let [healthy, off, stuck, slow] = [1, 2, 3, 4].map(column);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    // Noise of a mean of 120: 0.08/sqrt(60) K.
    assert!((mean(&off) - mean(&healthy) - 3.0).abs() < 0.05);
    assert!(stuck[50..].iter().all(|value| *value == stuck[49]) && stuck[48] != stuck[49]);
    // From 3 s on the machine speeds up, and a tip of 4 mm needs some 9 s to follow.
    assert!(healthy[45] - slow[45] > 1.0, "{} {}", healthy[45], slow[45]);
    // The channel is the mean of the consistent sensors: 3 K are more than eight standard deviations.
    let together: Vec<f64> =
        batches.iter().flat_map(|batch| batch.column(Channel::T2).unwrap().to_vec()).collect();
    let first = mean(&together[..30]);
    assert!((first - mean(&healthy[..30])).abs() < 0.1, "{first}");
}

#[test]
fn equal_seeds_give_equal_samples_and_sequence_and_time_have_no_gaps() {
    let batches = session(noisy());
    assert_eq!(batches, session(noisy()));
    assert_ne!(batches, session(LabSettings { seed: 43, ..noisy() }));
    let mut next = 0;
    for batch in &batches {
        assert_eq!(batch.first_sequence, next);
        for t_s in &batch.t_s {
            assert!((t_s - next as f64 * 0.1).abs() < 1e-9);
            next += 1;
        }
    }
    assert_eq!(next, 121);
}

#[test]
fn from_standstill_it_runs_up_to_the_speed_that_was_asked_for_and_back_to_rest() {
    let mut lab = VirtualLab::new(LabSettings { start: Start::Standstill, ..noisy() });
    lab.arm().unwrap();
    let rest = Setpoints { mode: RigMode::Standstill, ..setpoints(110e3, 0.7) };
    lab.set(&rest).unwrap();
    let soak = lab.poll(10.0).unwrap();
    assert_eq!(last(&soak, Channel::ShaftSpeed), 0.0);
    assert_eq!(last(&soak, Channel::P2), 100e3);
    lab.set(&setpoints(p3_pa(90e3, 0.7), 0.7)).unwrap();
    let run = lab.poll(1800.0).unwrap();
    assert!((last(&run, Channel::ShaftSpeed) - 90e3).abs() < 50.0);
    lab.set(&rest).unwrap();
    let stop = lab.poll(2100.0).unwrap();
    assert_eq!(last(&stop, Channel::ShaftSpeed), 0.0);
    // The housing is still warm: it was above ambient and cannot cool quickly.
    assert!(last(&stop, Channel::Tc) > 305.0);
}

#[test]
fn surge_and_overspeed_are_shown_and_overspeed_cuts_the_air() {
    let mut lab = VirtualLab::new(LabSettings { trip_speed_rpm: 120e3, surge_swing_ratio: 0.1, ..noisy() });
    lab.arm().unwrap();
    lab.set(&setpoints(p3_pa(90e3, 0.5), 0.5)).unwrap();
    lab.poll(5.0).unwrap();
    lab.set(&setpoints(p3_pa(90e3, 0.5), 0.2)).unwrap();
    let surged = lab.poll(15.0).unwrap();
    assert!(surged.events.iter().any(|event| event.kind == EventKind::SurgeEntered));
    lab.set(&setpoints(p3_pa(150e3, 1.0), 1.0)).unwrap();
    let tripped = lab.poll(200.0).unwrap();
    let kinds: Vec<EventKind> = tripped.events.iter().map(|event| event.kind).collect();
    assert!(kinds.contains(&EventKind::SurgeLeft));
    assert!(kinds.contains(&EventKind::OverspeedEntered));
    assert_eq!(last(&lab.poll(300.0).unwrap(), Channel::ShaftSpeed), 0.0);
}

#[test]
fn calls_out_of_order_and_impossible_setpoints_are_refused() {
    let mut lab = VirtualLab::new(ideal());
    assert!(matches!(lab.poll(1.0), Err(BackendError::OutOfOrder { .. })));
    lab.arm().unwrap();
    assert!(matches!(lab.arm(), Err(BackendError::OutOfOrder { .. })));
    assert!(matches!(lab.poll(1.0), Err(BackendError::OutOfOrder { .. })));
    let too_much = lab.set(&setpoints(1e9, 0.7));
    assert!(matches!(too_much, Err(BackendError::SetpointOutOfRange { quantity: "P3", .. })));
    assert!(lab.set(&setpoints(f64::NAN, 0.7)).is_err());
    lab.make_safe().unwrap();
    lab.disarm().unwrap();
}

/// A wall-tap reading, converted to total pressure, equals the reading of a total-pressure probe.
#[test]
fn static_taps_read_less_by_the_dynamic_pressure() {
    let taps = [(Channel::P1, 0.040), (Channel::P2, 0.035)];
    let at = |static_tap_pipe_diameters_m| {
        let mut lab = VirtualLab::new(LabSettings { static_tap_pipe_diameters_m, ..ideal() });
        lab.arm().unwrap();
        lab.set(&setpoints(p3_pa(110e3, 1.0), 1.0)).unwrap();
        lab.poll(1.0).unwrap()
    };
    let (total, tapped) = (at([].into()), at(taps.into()));
    for (channel, temperature, diameter_m) in
        [(Channel::P1, Channel::T1, 0.040), (Channel::P2, Channel::T2, 0.035)]
    {
        let (flow_kg_s, t_k) = (last(&tapped, Channel::CompressorFlow), last(&tapped, temperature));
        let read_pa = last(&tapped, channel);
        let total_pa =
            mapper_physics::gas::pressure_tap::static_to_total_pa(read_pa, flow_kg_s, t_k, diameter_m);
        assert!(read_pa < last(&total, channel) - 500.0, "{channel}: {read_pa}");
        assert!((total_pa / last(&total, channel) - 1.0).abs() < 1e-9);
    }
}

/// A heater that follows more air with a lag of 20 s, in closed form; and a loss of P1 with the square of the flow.
#[test]
fn t3_sags_when_more_air_comes_and_p1_falls_with_the_flow() {
    let settings = LabSettings { heater_sag_k: 20.0, inlet_loss_pa: 3e3, ..ideal() };
    let t3_actuator = ActuatorDynamics::new(20.0, f64::INFINITY);
    let mut lab = VirtualLab::new(LabSettings { t3_actuator, ..settings });
    lab.arm().unwrap();
    let before = setpoints(150e3, 0.7);
    lab.set(&before).unwrap();
    lab.poll(5.0).unwrap();
    lab.set(&setpoints(200e3, 0.7)).unwrap();
    let batch = lab.poll(25.0).unwrap();
    let column = |channel| batch.column(channel).unwrap();
    for (t_s, t3_k) in batch.t_s.iter().zip(column(Channel::T3)) {
        let expected_k = before.t3_k - 20.0 * 0.5 * (-(t_s - 5.0) / 20.0).exp();
        assert!((t3_k - expected_k).abs() < 1e-6, "{t_s} s: {t3_k} K, {expected_k} K");
    }
    let flows = &column(Channel::CompressorFlow);
    for (p1_pa, flow_kg_s) in column(Channel::P1)[1..].iter().zip(flows.iter()) {
        assert!(
            (p1_pa - (100e3 - 3e3 * (flow_kg_s / 0.1).powi(2))).abs() < 1e-6,
            "{p1_pa} Pa, {flow_kg_s} kg/s"
        );
    }
}
