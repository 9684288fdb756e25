//! Declared errors of the model's equations, on recordings of the adaptive simulator.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::gap::diagnose::gap;
use crate::gap::report::{Diagnosis, Verdict};
use crate::gap::request::{BaselineRecording, GapRequest, RigRecording};
use crate::inside::gap::common::{Visits, declared, effects, record_of, request};
use mapper_core::Recording;
use mapper_observe::averages::OUTPUTS;
use mapper_observe::declared::Declared;
use mapper_physics::rig::effect::{Rig, add};
use mapper_physics::simulation::model::Model;

const VISITS: Visits = Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3, 70e3, 130e3], dwell_s: 60.0 };

fn ask(recording: &Recording, declared: Declared, baseline: Option<&Recording>) -> Diagnosis {
    let candidates = ["tip_diameter", "bearing_friction", "flowmeter_gain"];
    let baseline = baseline.map(|baseline| BaselineRecording {
        name: "monday".to_owned(),
        recording: RigRecording::simulated(baseline.clone(), declared.clone(), Model::nominal()),
    });
    let recording = request(recording, declared, Model::nominal(), effects(&candidates));
    gap(GapRequest { baseline, ..recording }).unwrap().diagnosis
}

/// A machine whose housing has two walls instead of one, which no candidate describes, and what acts on it besides.
fn two_walls(more: &[(&str, &[f64])], seed: u64) -> Recording {
    let mut rig = Rig::new(Model::nominal());
    for (effect, values) in [("inner_node", [0.2, 150.0].as_slice())].iter().chain(more) {
        add(&mut rig, mapper_effects::find(effect).unwrap().as_ref(), values).unwrap();
    }
    record_of(&rig, &VISITS, seed)
}

/// A machine whose housing has two walls is within tolerance if what a fault-free recording measures is declared, and a cause that acts on
/// another balance is still named.
#[test]
fn an_error_of_the_equations_is_a_cause_only_beyond_its_declaration() {
    let plain = two_walls(&[], 5);
    assert_ne!(ask(&plain, declared(), None).verdict, Verdict::WithinTolerance);
    let mut with_structure = declared();
    let lacking = ask(&plain, declared(), Some(&two_walls(&[], 6))).baseline.unwrap().lacking;
    for (channel, error) in
        OUTPUTS.iter().filter_map(|channel| Some((channel, lacking.get(channel.symbol())?)))
    {
        if let Some(ratio) = with_structure.tolerances.structure.of_mut(*channel) {
            *ratio = error.declare.structure_ratio;
        }
        if let (Some(sensor), Some(offset)) = (with_structure.sensors.get_mut(channel), error.declare.offset)
        {
            sensor.offset_sigma = offset;
        }
    }
    assert_eq!(ask(&plain, with_structure.clone(), None).verdict, Verdict::WithinTolerance);
    let rubbing = ask(&two_walls(&[("bearing_friction", &[1e-6])], 7), with_structure, None);
    assert_eq!(rubbing.verdict, Verdict::Explained);
    assert_eq!(rubbing.candidates[0].effects, ["bearing_friction"]);
}
