//! Changes since a reference recording, on recordings of the adaptive simulator.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::gap::diagnose::{Diagnosed, gap};
use crate::gap::experiment::GapWarning;
use crate::gap::preconditions::{GapError, Problem};
use crate::gap::report::Verdict;
use crate::gap::request::{BaselineRecording, GapRequest, RigRecording};
use crate::inside::gap::common::{Visits, declared, effects, record_another_night, record_of, request};
use mapper_core::{Channel, Recording};
use mapper_physics::rig::effect::{Rig, add};
use mapper_physics::simulation::model::Model;

const VISITS: Visits = Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3, 70e3, 130e3], dwell_s: 60.0 };

fn ask(recording: &Recording, baseline: Option<&Recording>) -> Result<Diagnosed, GapError> {
    let candidates = ["tip_diameter", "bearing_friction", "flowmeter_gain"];
    let recording = request(recording, declared(), Model::nominal(), effects(&candidates));
    let baseline = baseline.map(|baseline| BaselineRecording {
        name: "monday".to_owned(),
        recording: RigRecording::simulated(baseline.clone(), declared(), Model::nominal()),
    });
    gap(GapRequest { baseline, ..recording })
}

fn rubbing(friction_w_s2: f64) -> Rig {
    let mut rig = Rig::new(Model::nominal());
    add(&mut rig, mapper_effects::find("bearing_friction").unwrap().as_ref(), &[friction_w_s2]).unwrap();
    rig
}

/// If the model structure is correct, a reference recording does not change the result: same cause, size within both intervals. A fault
/// already in the reference recording is not a change.
#[test]
fn a_cause_is_found_with_a_baseline_as_without() {
    let truth = 1e-6;
    let recording = record_of(&rubbing(truth), &VISITS, 5);
    let baseline = record_another_night(&Rig::new(Model::nominal()), &VISITS, 5, 6);
    for baseline in [None, Some(&baseline)] {
        let diagnosis = ask(&recording, baseline).unwrap().diagnosis;
        assert_eq!(diagnosis.verdict, Verdict::Explained);
        assert_eq!(diagnosis.baseline.is_some(), baseline.is_some());
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
    let mut baseline = record_another_night(&rig, &VISITS, 5, 6);
    baseline.series.remove(&Channel::T4);
    let diagnosed = ask(&recording, Some(&baseline)).unwrap();
    let missing = Box::new(GapWarning::ChannelNotRecorded { channel: Channel::T4 });
    assert!(diagnosed.diagnosis.warnings.contains(&GapWarning::BaselineRecording { warning: missing }));
    let channels = &diagnosed.diagnosis.gap.channels;
    assert!(channels.contains_key("T2") && !channels.contains_key("T4"), "{:?}", channels.keys());

    let fewer = Visits { speeds_rpm: &VISITS.speeds_rpm[..5], ..VISITS };
    let refused = |baseline: &Recording| ask(&recording, Some(baseline)).unwrap_err();
    let of_count = refused(&record_another_night(&rig, &fewer, 5, 6));
    assert_eq!(of_count, GapError::Recording(Problem::OtherSteps { baseline: 5, recorded: 6 }));
    let mut opened = baseline.clone();
    opened.steps[3].valve_opening_ratio += 0.05;
    let mut faster = baseline.clone();
    faster.steps[2].p3_pa *= 1.1;
    let mut shorter = baseline;
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
