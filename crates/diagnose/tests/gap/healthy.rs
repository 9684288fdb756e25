//! Changes since a reference recording, on recordings of the adaptive simulator.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::gap::common::{Visits, declared, record_another_night, record_of};
use mapper_core::{Channel, Recording};
use mapper_diagnose::gap::causes::calibration::Calibration;
use mapper_diagnose::gap::diagnose::{Diagnosed, GapError, GapRequest, diagnose};
use mapper_diagnose::gap::findings::report::Verdict;
use mapper_diagnose::gap::findings::warning::GapWarning;
use mapper_diagnose::gap::model_error::healthy::Healthy;
use mapper_diagnose::gap::preconditions::problem::Problem;
use mapper_physics::rig::effect::{Rig, add};
use mapper_physics::simulation::model::Model;

const VISITS: Visits = Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3, 70e3, 130e3], dwell_s: 60.0 };

fn ask(recording: &Recording, healthy: Option<&Recording>) -> Result<Diagnosed, GapError> {
    let candidates = ["tip_diameter", "bearing_friction", "flowmeter_gain"];
    diagnose(GapRequest {
        tolerances_declared: true,
        experiments: Vec::new(),
        recording,
        declared: declared(),
        healthy: healthy.map(|recording| Healthy {
            name: "monday".to_owned(),
            recording,
            declared: declared(),
        }),
        model: Model::nominal(),
        effects: candidates.iter().map(|id| mapper_effects::find(id).unwrap()).collect(),
        calibration: Calibration::shipped().unwrap(),
        linearised: None,
        progress: &|_, _| {},
    })
}

fn rubbing(friction_w_s2: f64) -> Rig {
    let mut rig = Rig::new(Model::nominal());
    add(&mut rig, mapper_effects::find("bearing_friction").unwrap().as_ref(), &[friction_w_s2]).unwrap();
    rig
}

/// If the model structure is correct, a reference recording does not change the result: same cause, size within both intervals. A fault
/// already in the reference recording is not a change.
#[test]
fn a_cause_is_found_with_a_healthy_recording_as_without() {
    let truth = 1e-6;
    let recording = record_of(&rubbing(truth), &VISITS, 5);
    let healthy = record_another_night(&Rig::new(Model::nominal()), &VISITS, 5, 6);
    for healthy in [None, Some(&healthy)] {
        let diagnosis = ask(&recording, healthy).unwrap().diagnosis;
        assert_eq!(diagnosis.verdict, Verdict::Explained);
        assert_eq!(diagnosis.since.is_some(), healthy.is_some());
        let first = &diagnosis.candidates[0];
        assert_eq!(first.effects, ["bearing_friction"]);
        let size = &first.parameters["bearing_friction"];
        assert!((size.low..size.high).contains(&truth), "{size:?}");
    }
    let as_bad = record_another_night(&rubbing(truth), &VISITS, 5, 6);
    let diagnosis = ask(&recording, Some(&as_bad)).unwrap().diagnosis;
    assert_eq!(diagnosis.verdict, Verdict::WithinTolerance, "{:?}", diagnosis.candidates);
}

/// Only identical steps can be compared, and only channels present in both recordings.
#[test]
fn other_steps_are_refused_and_what_one_lacks_is_left_out() {
    let rig = Rig::new(Model::nominal());
    let recording = record_of(&rig, &VISITS, 5);
    let mut healthy = record_another_night(&rig, &VISITS, 5, 6);
    healthy.series.remove(&Channel::T4);
    let diagnosed = ask(&recording, Some(&healthy)).unwrap();
    let missing = Box::new(GapWarning::ChannelNotRecorded { channel: Channel::T4 });
    assert!(diagnosed.diagnosis.warnings.contains(&GapWarning::HealthyRecording { warning: missing }));
    let channels = &diagnosed.diagnosis.gap.channels;
    assert!(channels.contains_key("T2") && !channels.contains_key("T4"), "{:?}", channels.keys());

    let fewer = Visits { speeds_rpm: &VISITS.speeds_rpm[..5], ..VISITS };
    let refused = |healthy: &Recording| ask(&recording, Some(healthy)).unwrap_err();
    let of_count = refused(&record_another_night(&rig, &fewer, 5, 6));
    assert_eq!(of_count, GapError::Recording(Problem::OtherSteps { healthy: 5, recorded: 6 }));
    let mut opened = healthy.clone();
    opened.steps[3].valve_opening_ratio += 0.05;
    let mut faster = healthy.clone();
    faster.steps[2].p3_pa *= 1.1;
    let mut shorter = healthy;
    shorter.steps[4].end_s -= 10.0;
    for (other, step, differs) in [(opened, 3, "valve"), (faster, 2, "P3"), (shorter, 4, "length")] {
        match refused(&other) {
            GapError::Recording(Problem::OtherStep { step: found, what, .. }) => {
                assert!(found == step && what.contains(differs), "{found} {what}");
            }
            other => panic!("{other}"),
        }
    }
}
