//! Readings without the causes of a gap.

use crate::gap::best_fit::fitted_causes::Changes;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::inside::gap::common::{Visits, declared, record_of};
use mapper_core::{Channel, Recording};
use mapper_observe::averages::Table;
use mapper_physics::rig::effect::{Rig, add};
use mapper_physics::simulation::model::Model;

const VISITS: Visits = Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3], dwell_s: 60.0 };

/// A recording of a rig with an effect of this size, or without it, and what the effect adds according to the model.
fn planted(id: &str, value: f64) -> (Recording, Recording, Changes) {
    let effect = mapper_effects::find(id).unwrap();
    let mut rig = Rig::new(Model::nominal());
    let without = record_of(&rig, &VISITS, 11);
    add(&mut rig, effect.as_ref(), &[value]).unwrap();
    let with = record_of(&rig, &VISITS, 11);
    let table = Table::new(&with).unwrap();
    let study = Study::new(&with, table, declared(), Model::nominal(), vec![effect]);
    let hypothesis = Hypothesis { effects: vec![(0, vec![value])], ..study.nothing() };
    let changes = Changes::of(&study, &hypothesis).unwrap();
    (with, without, changes)
}

#[test]
fn an_offset_changes_its_own_channel_by_its_size_and_no_other() {
    for (id, channel) in [("t1_offset", Channel::T1), ("t2_offset", Channel::T2), ("tc_offset", Channel::Tc)]
    {
        let (with, _, changes) = planted(id, 2.0);
        let corrected = changes.subtracted_from(with.clone());
        for other in [Channel::T1, Channel::T2, Channel::Tc, Channel::P2, Channel::CompressorFlow] {
            let expected = if other == channel { 2.0 } else { 0.0 };
            for (before, after) in with.series[&other].values.iter().zip(&corrected.series[&other].values) {
                // Rounding of differences of some 400 K or 200 kPa.
                assert!((before - after - expected).abs() < 1e-9 * before.abs().max(1.0), "{id}: {other}");
            }
        }
    }
}

/// The error of an input's sensor is subtracted from its own reading alone: the machine never had it.
#[test]
fn an_input_without_the_error_of_its_sensor_is_that_of_the_machine() {
    for (id, value, channel) in [
        ("t1_towards_wall", 0.05, Channel::T1),
        ("p1_with_flow_squared", 6e3, Channel::P1),
        ("p3_offset", 2e3, Channel::P3),
    ] {
        let (with, without, changes) = planted(id, value);
        let corrected = changes.subtracted_from(with.clone());
        assert_eq!(corrected.series[&Channel::T2].values, with.series[&Channel::T2].values, "{id}");
        let rms = |recording: &Recording| {
            let pairs = recording.series[&channel].values.iter().zip(&without.series[&channel].values);
            (pairs.map(|(a, b)| (a - b).powi(2)).sum::<f64>() / without.series[&channel].values.len() as f64)
                .sqrt()
        };
        let (before, after) = (rms(&with), rms(&corrected));
        // The walls and flows that scale it are the nominal machine's at block means.
        assert!(before > 0.0 && after < 0.05 * before, "{id}: {before} before, {after} after");
    }
}

/// The adaptive simulator with and without the effect has equal noise: after the subtraction both readings are equal.
#[test]
fn readings_without_a_cause_are_those_of_a_rig_that_never_had_it() {
    for (id, value) in [("recirculation", 0.05), ("inlet_preheat", 2.0), ("stem_conduction", 0.1)] {
        let (with, without, changes) = planted(id, value);
        let corrected = changes.subtracted_from(with.clone());
        let largest_k = |recording: &Recording| {
            let (ours, theirs) = (&recording.series[&Channel::T2], &without.series[&Channel::T2]);
            let settled = ours
                .t_s
                .iter()
                .zip(ours.values.iter().zip(&theirs.values))
                .filter(|(t_s, _)| **t_s % 60.0 > 10.0);
            settled.map(|(_, (ours, theirs))| (ours - theirs).abs()).fold(0.0, f64::max)
        };
        let (before_k, after_k) = (largest_k(&with), largest_k(&corrected));
        // A tenth of a sample's noise is lost between two integrators and the driven model's smoothed inputs.
        assert!(
            before_k > 0.5 && after_k < 0.05 * before_k + 0.02,
            "{id}: {before_k} K before, {after_k} K after"
        );
    }
}

/// A wheel, turbine, bearing or valve that differs is measured as it is: no reading is biased, so none is changed.
#[test]
fn a_machine_that_differs_keeps_its_readings() {
    for (id, value) in [
        ("efficiency_scale", 0.97),
        ("flow_map_scale", 1.03),
        ("turbine_efficiency", 0.95),
        ("turbine_capacity", 1.03),
        ("bearing_friction", 1e-6),
        ("valve_area", 1.05),
    ] {
        let (with, without, changes) = planted(id, value);
        assert_ne!(with.series[&Channel::P2].values, without.series[&Channel::P2].values, "{id}");
        assert_eq!(changes.subtracted_from(with.clone()), with, "{id}");
    }
}
