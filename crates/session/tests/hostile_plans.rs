//! Plans from untrusted or damaged files.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::shipped::campaign;
use mapper_campaign::Campaign;
use mapper_core::Plan;
use mapper_session::{nominal_model, plan, stored_plan};
use proptest::prelude::*;
use serde_json::Value;

/// Two weeks and a day, s: the longest run and the longest step that docs/reference/safety.md allows.
const RUN_MAX_S: f64 = 14.0 * 86_400.0;
const STEP_MAX_S: f64 = 86_400.0;

fn small() -> Campaign {
    campaign(&[
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 110 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 2.0]"),
        ("method: joint ", "method: steady "),
        ("order: thermal_gradient ", "order: listed "),
        ("seed: 1  ", "repeats: off\nseed: 1  "),
    ])
}

/// Every number, text and absent value of a JSON document, in its order.
fn leaves(value: &mut Value) -> Vec<&mut Value> {
    match value {
        Value::Array(values) => values.iter_mut().flat_map(leaves).collect(),
        Value::Object(members) => members.iter_mut().flat_map(|(_, value)| leaves(value)).collect(),
        leaf => vec![leaf],
    }
}

fn any_leaf() -> impl Strategy<Value = Value> {
    prop_oneof![
        any::<f64>().prop_map(Value::from),
        (-9.0..9.0f64).prop_map(|exponent| Value::from(10f64.powf(exponent))),
        any::<i64>().prop_map(Value::from),
        Just(Value::Null),
        ".{0,9}".prop_map(Value::from),
    ]
}

/// What a plan that is taken may ask for, whatever the file held.
fn within(plan: &Plan, campaign: &Campaign) -> bool {
    let limits = &campaign.limits;
    let a_little_more = 1.0 + 1e-8;
    plan.duration_s() <= RUN_MAX_S
        && plan.steps.iter().enumerate().all(|(place, step)| {
            step.index == place
                && step.dwell_s > 0.0
                && step.dwell_s <= STEP_MAX_S * a_little_more
                && step.to.speed_rpm > 0.0
                && step.to.speed_rpm <= limits.speed_max_rpm * a_little_more
                && step.p3_pa * a_little_more >= limits.p3_min_pa
                && step.p3_pa <= limits.p3_max_pa * a_little_more
                && step.t3_k.is_finite()
                && step.oil_temperature_k.is_finite()
                && step.start_s.is_finite()
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn what_is_taken_keeps_to_the_limits(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any_leaf()), 0..4),
        cut in prop::option::of(any::<prop::sample::Index>()),
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..3),
    ) {
        let campaign = small();
        let made = plan(&campaign, &nominal_model(&campaign).unwrap()).unwrap();
        let mut value = serde_json::to_value(&made).unwrap();
        for (place, leaf) in &changes {
            let mut leaves = leaves(&mut value);
            let place = place.index(leaves.len());
            *leaves[place] = leaf.clone();
        }
        let mut bytes = value.to_string().into_bytes();
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        for (place, byte) in flips {
            if !bytes.is_empty() {
                let place = place.index(bytes.len());
                bytes[place] = byte;
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.json");
        std::fs::write(&path, &bytes).unwrap();
        if let Ok(taken) = stored_plan(&path, &made.made_from, &campaign) {
            prop_assert!(within(&taken, &campaign), "{}", String::from_utf8_lossy(&bytes));
        }
        if changes.is_empty() && serde_json::to_vec(&value).unwrap() == bytes {
            prop_assert!(stored_plan(&path, &made.made_from, &campaign).is_ok());
        }
    }
}
