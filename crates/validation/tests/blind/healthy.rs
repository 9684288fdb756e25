//! On a rig of other equations: everything is outside the effect library, until a healthy recording shows the rig's behaviour.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::Recording;
use mapper_diagnose::gap::causes::calibration::Calibration;
use mapper_diagnose::gap::diagnose::{GapRequest, diagnose};
use mapper_diagnose::gap::findings::report::{Diagnosis, Verdict};
use mapper_diagnose::gap::model_error::healthy::Healthy;
use mapper_physics::rig::effect::Effect;
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_validation::blind::{CaseKind, Draw, Laboratory, OutsideUse, make, study_without_causes};
use std::path::Path;
use std::sync::Arc;

/// Nothing changed: within tolerance. A cause came: it is named. Without the healthy recording it is outside the effect library.
#[test]
fn a_healthy_recording_separates_a_cause_from_structure() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns/gap_rig.yaml");
    let mut campaign = mapper_campaign::load(&path).unwrap();
    campaign.points.truncate(6);
    campaign.timing.dwell = mapper_core::Dwell::Fixed(60.0);
    let effects: Vec<Arc<dyn Effect>> =
        ["valve_area", "oil_scale"].iter().map(|id| mapper_effects::find(id).unwrap()).collect();
    let declared = study_without_causes(&campaign, Vec::new(), 9).unwrap().0.declared;
    let scratch = tempfile::tempdir().unwrap();
    let read = |name: &str| -> Recording {
        let options = ReadOptions::default();
        read_recording(&scratch.path().join(name), &ChannelMap::native(), &options).unwrap().recording
    };
    for (kind, folder) in [(CaseKind::None, "none"), (CaseKind::Single, "single")] {
        let draw = Draw {
            kinds: vec![kind],
            laboratory: Laboratory::OtherLab,
            healthy: true,
            sigma_range: [30.0, 60.0],
            ..Draw::new(9, 1, OutsideUse::Check)
        };
        let made = make(&campaign, &effects[..1], &draw, &scratch.path().join(folder), &|_| {}).unwrap();
        assert!(made.manifest.healthy);
        let recording = read(&format!("{folder}/case_0000.mcap"));
        let healthy = read(&format!("{folder}/case_0000.healthy.mcap"));
        let ask = |healthy: Option<&Recording>| -> Diagnosis {
            let question = GapRequest {
                recording: &recording,
                declared: declared.clone(),
                healthy: healthy.map(|recording| Healthy {
                    name: "healthy".to_owned(),
                    recording,
                    declared: declared.clone(),
                }),
                model: mapper_campaign::nominal_model(&campaign).unwrap(),
                effects: effects.clone(),
                tolerances_declared: true,
                experiments: Vec::new(),
                calibration: Calibration::shipped().unwrap(),
                linearised: None,
                progress: &|_, _| {},
            };
            diagnose(question).unwrap().diagnosis
        };
        let since = ask(Some(&healthy));
        if kind == CaseKind::None {
            assert_eq!(since.verdict, Verdict::WithinTolerance, "{:?}", since.candidates);
        } else {
            assert!(ask(None).probability_outside > 0.99);
            assert_eq!(since.verdict, Verdict::Explained, "{:?}", since.candidates);
            assert_eq!(since.candidates[0].effects, ["valve_area"]);
        }
    }
}
