//! On a rig of other equations: everything is outside the effect library, until a baseline shows the rig's behaviour.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_campaign::Campaign;
use mapper_core::{NoiseColour, Recording};
use mapper_diagnose::gap;
use mapper_diagnose::gap::{
    BaselineRecording, Calibration, ClosureSearch, Diagnosis, GapRequest, RigRecording, Verdict,
};
use mapper_observe::Declared;
use mapper_physics::rig::effect::Effect;
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_validation::blind::{CaseKind, Draw, Laboratory, OutsideUse, make};
use std::path::Path;
use std::sync::Arc;

/// Nothing changed: within tolerance. A cause came: it is named. Without the baseline it is outside the effect library.
#[test]
fn a_baseline_separates_a_cause_from_structure() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns/gap_rig.yaml");
    let mut campaign = mapper_campaign::load(&path).unwrap();
    campaign.points.truncate(6);
    campaign.timing.dwell = mapper_core::Dwell::Fixed(60.0);
    let effects: Vec<Arc<dyn Effect>> =
        ["valve_area", "oil_scale"].iter().map(|id| mapper_effects::find(id).unwrap()).collect();
    let declared = declared(&campaign);
    let scratch = tempfile::tempdir().unwrap();
    let read = |name: &str| -> Recording {
        let options = ReadOptions::default();
        read_recording(&scratch.path().join(name), &ChannelMap::native(), &options).unwrap().recording
    };
    for (kind, folder) in [(CaseKind::None, "none"), (CaseKind::Single, "single")] {
        let draw = Draw {
            kinds: vec![kind],
            laboratory: Laboratory::OtherLab,
            baseline: true,
            sigma_range: [30.0, 60.0],
            ..Draw::new(9, 1, OutsideUse::Check)
        };
        let made = make(&campaign, &effects[..1], &draw, &scratch.path().join(folder), &|_| {}).unwrap();
        assert!(made.manifest.baseline);
        let recording = read(&format!("{folder}/case_0000.mcap"));
        let baseline = read(&format!("{folder}/case_0000.baseline.mcap"));
        let ask = |baseline: Option<&Recording>| -> Diagnosis {
            let model = mapper_campaign::nominal_model(&campaign).unwrap();
            let of_rig = |recording: &Recording| {
                RigRecording::simulated(recording.clone(), declared.clone(), model.clone())
            };
            let baseline = baseline.map(|recording| BaselineRecording {
                name: "baseline".to_owned(),
                recording: of_rig(recording),
            });
            let question = GapRequest {
                recording: of_rig(&recording),
                baseline,
                effects: effects.clone(),
                experiments: Vec::new(),
                closure_search: ClosureSearch::Never,
                calibration: Calibration::shipped().unwrap(),
                warnings: Vec::new(),
                progress: &|_, _| {},
            };
            gap(question).unwrap().diagnosis
        };
        let since = ask(Some(&baseline));
        if kind == CaseKind::None {
            assert_eq!(since.verdict, Verdict::WithinTolerance, "{:?}", since.candidates);
        } else {
            assert!(ask(None).probability_outside > 0.99);
            assert_eq!(since.verdict, Verdict::Explained, "{:?}", since.candidates);
            assert_eq!(since.candidates[0].effects, ["valve_area"]);
        }
    }
}

fn declared(campaign: &Campaign) -> Declared {
    Declared {
        sensors: mapper_session::declared(campaign, &ChannelMap::native()),
        noise_colour: NoiseColour::default(),
        tolerances: campaign.tolerances,
        nominal: campaign.boundary,
        common_offsets: Vec::new(),
        actuators: None,
    }
}
