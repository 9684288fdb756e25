//! Declared errors of the model's equations, on recordings of the adaptive simulator.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::gap::common::{Visits, declared, record_of};
use mapper_core::{Recording, StructureTolerances};
use mapper_diagnose::gap::causes::calibration::Calibration;
use mapper_diagnose::gap::diagnose::{GapRequest, diagnose};
use mapper_diagnose::gap::findings::report::{Diagnosis, Verdict};
use mapper_physics::rig::effect::{Rig, add};
use mapper_physics::simulation::model::Model;

const VISITS: Visits = Visits { speeds_rpm: &[90e3, 140e3, 60e3, 120e3, 70e3, 130e3], dwell_s: 60.0 };

fn ask(recording: &Recording, structure: StructureTolerances) -> Diagnosis {
    let mut declared = declared();
    declared.tolerances.structure = structure;
    let candidates = ["tip_diameter", "bearing_friction", "flowmeter_gain"];
    diagnose(GapRequest {
        tolerances_declared: true,
        experiments: Vec::new(),
        recording,
        declared,
        healthy: None,
        model: Model::nominal(),
        effects: candidates.iter().map(|id| mapper_effects::find(id).unwrap()).collect(),
        calibration: Calibration::shipped().unwrap(),
        linearised: None,
        progress: &|_, _| {},
    })
    .unwrap()
    .diagnosis
}

/// A machine whose housing has two walls instead of one, which no candidate describes, and what acts on it besides.
fn two_walls(more: &[(&str, &[f64])]) -> Recording {
    let mut rig = Rig::new(Model::nominal());
    for (effect, values) in [("inner_node", [0.2, 150.0].as_slice())].iter().chain(more) {
        add(&mut rig, mapper_effects::find(effect).unwrap().as_ref(), values).unwrap();
    }
    record_of(&rig, &VISITS, 5)
}

/// The second wall changes T2 by 1.4 K and Tc by 1.6 K, root mean square. A machine with it is within tolerance if a tenth of each is declared,
/// and a cause that acts on another balance is still named.
#[test]
fn an_error_of_the_equations_is_a_cause_only_beyond_its_declaration() {
    let structure = StructureTolerances { t2_ratio: 0.1, tc_ratio: 0.1, ..StructureTolerances::default() };
    let plain = two_walls(&[]);
    assert_ne!(ask(&plain, StructureTolerances::default()).verdict, Verdict::WithinTolerance);
    assert_eq!(ask(&plain, structure).verdict, Verdict::WithinTolerance);
    let rubbing = ask(&two_walls(&[("bearing_friction", &[1e-6])]), structure);
    assert_eq!(rubbing.verdict, Verdict::Explained);
    assert_eq!(rubbing.candidates[0].effects, ["bearing_friction"]);
}
