//! Blind cases from end to end: made, sealed, scored without diagnoses and with those of an oracle.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_campaign::Campaign;
use mapper_core::Channel;
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_validation::blind::{
    ANSWERS_NAME, BlindError, CreatedCases, Draw, OutsideUse, Planted, Share, Truth, make, plant, score,
};
use serde_json::json;
use std::path::Path;

/// The gap rig with two points.
fn campaign() -> Campaign {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns/gap_rig.yaml");
    let mut campaign = mapper_campaign::load(&path).unwrap();
    campaign.points.truncate(2);
    campaign
}

fn made(seed: u64, cases: usize, directory: &Path) -> CreatedCases {
    let draw = Draw::new(seed, cases, OutsideUse::Check);
    make(&campaign(), &mapper_effects::catalogue(), &draw, directory, &|_| {}).unwrap()
}

#[test]
fn the_same_seed_gives_the_same_files_and_the_seal() {
    let scratch = tempfile::tempdir().unwrap();
    let (a, b) = (scratch.path().join("a"), scratch.path().join("b"));
    let made_a = made(5, 4, &a);
    assert_eq!(made_a, made(5, 4, &b));
    for name in &made_a.manifest.cases {
        let file = format!("{name}.mcap");
        assert!(std::fs::read(a.join(&file)).unwrap() == std::fs::read(b.join(&file)).unwrap());
    }
    // A directory with cases is not overwritten.
    let draw = Draw::new(6, 1, OutsideUse::Check);
    assert!(make(&campaign(), &mapper_effects::catalogue(), &draw, &a, &|_| {}).is_err());
    // Answers that were changed are not opened.
    let answers = a.join(ANSWERS_NAME);
    let text = std::fs::read_to_string(&answers).unwrap();
    std::fs::write(&answers, text.replacen("case_0000", "case_0009", 1)).unwrap();
    assert!(matches!(score::score(&a), Err(BlindError::Seal { .. })));
}

#[test]
fn recordings_hold_the_schedule_and_nothing_of_the_truth() {
    let scratch = tempfile::tempdir().unwrap();
    let made = made(7, 3, scratch.path());
    for (name, truth) in made.manifest.cases.iter().zip(&made.answers) {
        let path = scratch.path().join(format!("{name}.mcap"));
        let report = read_recording(&path, &ChannelMap::native(), &ReadOptions::default()).unwrap();
        assert!(report.warnings.is_empty(), "{:?}", report.warnings);
        let recording = report.recording;
        assert_eq!(recording.steps.len(), 2);
        assert_eq!([recording.steps[0].start_s, recording.steps[1].end_s], [30.0, 270.0]);
        assert_eq!(recording.series[&Channel::T2].t_s.len(), 2701);
        let bytes = std::fs::read(&path).unwrap();
        assert!(!bytes.windows(6).any(|window| window == b"/truth"));
        // The true speed at the end of a step is what the sensor says there, within its noise of 30 rpm, five times.
        let speed = &recording.series[&Channel::ShaftSpeed];
        let gained = truth.effects.contains_key("speed_gain");
        assert!(gained || (speed.values.last().unwrap() - truth.points[1].speed_rpm).abs() < 150.0);
    }
}

/// An oracle that knows all answers has the full score; without diagnoses no case is right.
#[test]
fn an_oracle_scores_full_and_silence_scores_nothing() {
    let scratch = tempfile::tempdir().unwrap();
    let made = made(11, 12, scratch.path());
    let silent = score::score(scratch.path()).unwrap();
    assert!(silent.cases.iter().all(|case| !case.right) && silent.squared_miss_mean == Some(1.0));
    for truth in &made.answers {
        let path = scratch.path().join(format!("{}.diagnosis.json", truth.name));
        std::fs::write(path, oracle(truth).to_string()).unwrap();
    }
    let full = score::score(scratch.path()).unwrap();
    for share in [full.none, full.single, full.pair, full.one_of_pair, full.outside, full.covered] {
        assert_eq!(share.hits, share.trials);
    }
    assert_eq!(full.falsely_explained.hits, 0);
    assert_eq!(full.none.trials + full.single.trials + full.pair.trials + full.outside.trials, 12);
    assert!(full.squared_miss_mean.unwrap() < 1e-12 && full.parameter_error_median.unwrap() < 1e-12);
    assert_ne!(full.none, Share::default());
}

fn oracle(truth: &Truth) -> serde_json::Value {
    let ids: Vec<&String> = truth.effects.keys().collect();
    let outside = ids.iter().any(|id| id.starts_with("X_"));
    let verdict = if outside {
        "unexplained"
    } else if ids.is_empty() {
        "within_tolerance"
    } else {
        "explained"
    };
    let parameters: serde_json::Map<String, serde_json::Value> = truth
        .effects
        .iter()
        .filter_map(|(id, value)| {
            let value = value.as_f64()?;
            Some((id.clone(), json!({"value": value, "low": value - 1e-9, "high": value + 1e-9, "unit": ""})))
        })
        .collect();
    let known = verdict == "explained";
    json!({
        "verdict": verdict,
        "locations": [],
        "candidates": if known { json!([{"effects": ids, "probability": 1.0, "parameters": parameters}]) } else { json!([]) },
        "probability_none": if verdict == "within_tolerance" { 1.0 } else { 0.0 },
        "probability_outside": if outside { 1.0 } else { 0.0 },
        "gap": {"gap_reduction": 1.0},
    })
}

/// What was planted is what the score holds the diagnosis to; an effect, a parameter or a size that nothing can have is not sealed.
#[test]
fn a_planted_cause_is_sealed_and_scored() {
    let scratch = tempfile::tempdir().unwrap();
    let (campaign, catalogue) = (campaign(), mapper_effects::catalogue());
    let cause =
        |id: &str, parameter: Option<&str>, value| (id.to_owned(), parameter.map(str::to_owned), value);
    let sealed = |name: &str, causes: &[(String, Option<String>, f64)], outside| {
        plant(&campaign, &catalogue, Planted { name: "night", causes, outside }, &scratch.path().join(name))
    };
    let refused = |causes: &[_]| sealed("refused", causes, None).unwrap_err();
    assert!(matches!(refused(&[cause("valve_aera", None, 1.05)]), BlindError::UnknownCause { .. }));
    assert!(matches!(refused(&[cause("valve_area", None, 3.0)]), BlindError::CauseRange { .. }));
    assert!(matches!(refused(&[cause("valve_area", None, f64::NAN)]), BlindError::CauseRange { .. }));
    assert!(matches!(refused(&[cause("inner_node", Some("phi"), 0.3)]), BlindError::CauseParameters { .. }));
    assert!(!scratch.path().join("refused").exists());
    let one = [cause("valve_area", None, 1.05)];
    let wall = [cause("inner_node", Some("phi"), 0.3), cause("inner_node", Some("G"), 15.0)];
    let scored = |name: &str| score::score(&scratch.path().join(name)).unwrap();
    for (name, causes) in [("one", &one[..]), ("wall", &wall[..])] {
        let manifest = sealed(name, causes, None).unwrap();
        assert_eq!(manifest.cases, ["night"]);
        let id = &causes[0].0;
        let parameter = if causes.len() == 1 { json!(1.05) } else { json!({"phi": 0.3, "G": 15.0}) };
        let answers = std::fs::read(scratch.path().join(name).join(ANSWERS_NAME)).unwrap();
        let answers: serde_json::Value = serde_json::from_slice(&answers).unwrap();
        assert_eq!(answers[0]["effects"], json!({ id.as_str(): parameter }));
        // Without a diagnosis it is wrong, and of one cause.
        assert_eq!((scored(name).single.hits, scored(name).single.trials), (0, 1));
    }
    sealed("outside", &[], Some("a heater of 40 W on the outlet duct")).unwrap();
    assert_eq!(scored("outside").outside.trials, 1);
    sealed("none", &[], None).unwrap();
    assert_eq!(scored("none").none.trials, 1);
    assert!(sealed("none", &[], None).is_err(), "a seal is not replaced");
}
