//! Sentences of the warnings about points: the one place where they are written.

mod of_fit;
mod of_readings;
mod of_step;
pub(crate) mod sentence;

use crate::diagnosis::gap_warning_text::gap_warning_text;
use crate::plan::plan_remark_text::plan_remark_text;
use crate::point_results::result_remark_text::result_remark_text;
use crate::point_results::warning_text::sentence::Sentence;
use mapper_core::{ModelDoubt, PlanRemark, ResultRemark, Warning};
use mapper_diagnose::gap::GapWarning;
use mapper_recording::logs::LogFinding;
use mapper_recording::logs::proposal::ProposalRemark;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// The sentence of a warning, with values, units and remedy.
pub fn warning_text(warning: &Warning) -> String {
    sentence_of(warning).to_string()
}

/// The sentence of an argument against the joint model.
pub fn model_doubt_text(doubt: &ModelDoubt) -> String {
    of_fit::model_doubt(doubt).to_string()
}

pub(crate) fn sentence_of(warning: &Warning) -> Sentence {
    let sentence = of_readings::sentence_of(warning);
    let sentence =
        sentence.or_else(|| of_step::sentence_of(warning)).or_else(|| of_fit::sentence_of(warning));
    sentence.unwrap_or_else(|| match warning {
        Warning::Other { message, .. } if !message.is_empty() => message.clone().into(),
        other => other.code().to_owned().into(),
    })
}

/// A JSON value in which each warning, doubt, remark and finding has its sentence as `message`, for people.
pub fn with_messages(mut value: Value) -> Value {
    add_messages(&mut value);
    value
}

fn add_messages(value: &mut Value) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(add_messages),
        Value::Object(entries) => {
            for (key, entry) in entries {
                match (key.as_str(), entry) {
                    ("warnings", Value::Array(all)) => {
                        for one in all {
                            if has_code(one, Warning::CODES) {
                                add_message(one, warning_text);
                            } else if has_code(one, GapWarning::CODES) {
                                add_message(one, gap_warning_text);
                            }
                        }
                    }
                    ("remarks", Value::Array(all)) => {
                        for one in all {
                            if has_code(one, PlanRemark::CODES) {
                                add_message(one, plan_remark_text);
                            } else if has_code(one, ResultRemark::CODES) {
                                add_message(one, result_remark_text);
                            } else if has_code(one, ProposalRemark::CODES) {
                                add_message::<ProposalRemark>(one, ToString::to_string);
                            }
                        }
                    }
                    ("findings", Value::Array(all)) => {
                        for one in all.iter_mut().filter(|one| has_code(one, LogFinding::CODES)) {
                            add_message::<LogFinding>(one, ToString::to_string);
                        }
                    }
                    ("doubts", Value::Array(all)) => {
                        all.iter_mut().for_each(|one| add_message(one, model_doubt_text))
                    }
                    (_, entry) => add_messages(entry),
                }
            }
        }
        _ => {}
    }
}

fn has_code(value: &Value, codes: &[&str]) -> bool {
    value.get("code").and_then(Value::as_str).is_some_and(|code| codes.contains(&code))
}

fn add_message<T: DeserializeOwned>(value: &mut Value, text: fn(&T) -> String) {
    let typed = serde_json::from_value::<T>(value.clone());
    if let (Ok(typed), Some(entries)) = (typed, value.as_object_mut()) {
        entries.insert("message".to_owned(), text(&typed).into());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::Warning;
    use serde_json::json;

    /// One of each kind, as files have them.
    const ALL: &str = r#"[
        {"code": "dead_channel", "channel": "P2", "reading": 180},
        {"code": "frozen_channel", "channel": "T2", "reading": 300, "from_s": 1, "to_s": 9},
        {"code": "stuck", "channel": "T2", "duration_s": 9},
        {"code": "noisy_channel", "channel": "T2", "noise": 1, "declared_noise": 0.1},
        {"code": "scaled_channel", "kind": "specific_speed", "speed_rpm": 2e3, "flow_kg_s": 0.1, "pressure_ratio": 2, "specific_speed": 0.01},
        {"code": "scaled_channel", "kind": "apparent_efficiency", "rise_k": 1, "t1_k": 300, "pressure_ratio": 2, "isentropic_rise_k": 65, "efficiency": 65},
        {"code": "scaled_channel", "kind": "some_points"},
        {"code": "scaled_channel", "kind": "shaft_power", "compressor_w": 4e3, "turbine_w": 2e3, "power_ratio": 2},
        {"code": "swapped_channels", "kind": "p2_below_p1", "points": 3, "of": 4, "p1_pa": 2e5, "p2_pa": 1e5},
        {"code": "swapped_channels", "kind": "t2_above_t3"},
        {"code": "swapped_channels", "kind": "tc_before_t2", "tc_jump_k": 9, "t2_jump_k": 1},
        {"code": "late_channel", "channel": "T2", "lag_s": -4, "jumps": 7},
        {"code": "contradicted_channel", "faults": [{"fault": "offset of T2", "channels": ["T2"], "value": 2, "sigma": 0.1, "unit": "K",
            "alternatives": ["offset of T1"], "touches_points": true}]},
        {"code": "off_the_nominal_map", "faults": []},
        {"code": "steps_contradict", "kind": "overlap", "first": 1, "first_start_s": 0, "first_end_s": 9, "second": 2, "second_start_s": 5,
            "second_end_s": 20},
        {"code": "steps_contradict", "kind": "shared_number", "number": 3, "steps": 2},
        {"code": "lost_samples", "lost": 3, "samples": 90},
        {"code": "outliers", "count": 2},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "missing", "key": "calibration"}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "missing", "key": "due"}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "expired", "due": "2026-01-31", "day": "2026-02-01"}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "range", "reading": 400, "min": 270, "max": 390}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "uncertainty", "certified": 0.3, "declared": 0.1}},
        {"code": "end_state", "channel": "T2", "lost_before_end_s": 9},
        {"code": "no_transient"},
        {"code": "through_the_law", "convection_origin": null},
        {"code": "through_the_law", "convection_origin": "declared in a.yaml"},
        {"code": "too_few_samples", "kind": "short_step", "step_s": 2},
        {"code": "too_few_samples", "kind": "late_commands", "before_end_s": 2},
        {"code": "too_few_samples", "kind": "samples", "complete": 2, "lost": 3, "needed": 10},
        {"code": "window_cut", "requested_end_s": 60, "step_s": 30},
        {"code": "not_stabilised", "quantity": "flow", "settled_s": 3, "needed_s": 9, "used_s": 12},
        {"code": "not_settled", "channel": "Tc", "drift_k_min": 0.4, "limit_k_min": 0.1},
        {"code": "flow_moved", "flow_change_ratio": 0.02, "eta_error": 0.01, "h_error_w_m2k": 9},
        {"code": "speed_not_reached", "requested_rpm": 9e4, "reached_rpm": 8e4},
        {"code": "apparent"},
        {"code": "surge_end", "evidence": "zero_slope"},
        {"code": "choke_end", "evidence": "vertical"},
        {"code": "no_compression", "kind": "no_t2"},
        {"code": "no_compression", "kind": "no_rise", "rise_k": 0, "pressure_ratio": 1.1},
        {"code": "no_compression", "kind": "no_pressure_rise"},
        {"code": "at_bound", "kind": "eta", "eta": 2},
        {"code": "at_bound", "kind": "h", "h_w_m2k": 0},
        {"code": "fit_failed", "kind": "step"},
        {"code": "fit_failed", "kind": "all_steps"},
        {"code": "fit_failed", "kind": "not_finite"},
        {"code": "poor_fit", "kind": "eta", "eta": 1.1},
        {"code": "poor_fit", "kind": "noise_ratio", "residual_ratio": 2},
        {"code": "poor_fit", "kind": "noise", "residual_k": 0.2, "noise_k": 0.1},
        {"code": "poor_fit", "kind": "shape", "residual_k": 0.2, "block_s": 10, "dt2_k": 9},
        {"code": "small_gradient", "dt2_k": 0.2, "needed_dt2_k": 0.5, "eta_sigma": 0.03},
        {"code": "offsets_dominate", "eta_noise_sigma": 0.01, "eta_bias_sigma": 0.05, "dt2_k": 9, "shared": true},
        {"code": "noise_dominates", "eta_noise_sigma": 0.05, "eta_bias_sigma": 0.01, "rise_k": 9},
        {"code": "prior_dominated", "eta_error": 0.02},
        {"code": "assumed_alpha", "alpha_area_ratio": 0, "alpha_area_sigma_ratio": 0.1, "eta_sigma": 0.02},
        {"code": "nothing_declared"},
        {"code": "heat_corrected", "kind": "corrected", "apparent_eta": 0.6},
        {"code": "heat_corrected", "kind": "too_much_heat", "heat_w": 90},
        {"code": "left_out", "kind": "poor_fit"},
        {"code": "left_out", "kind": "readings"},
        {"code": "left_out", "kind": "region", "region": "choke", "sigmas": 7, "doubts": [{"kind": "scatter", "scatter_ratio": 0.1}]},
        {"code": "off_the_law", "h_deviation_ratio": 0.1},
        {"code": "model_doubted", "kind": "slow_residual", "residual_ratio": 3}
    ]"#;

    #[test]
    fn every_code_has_its_own_sentence() {
        let all: Vec<Warning> = serde_json::from_str(ALL).unwrap();
        let codes: Vec<&str> = all.iter().map(Warning::code).collect();
        assert!(Warning::CODES.iter().all(|code| codes.contains(code)), "{codes:?}");
        let texts: Vec<String> = all.iter().map(warning_text).collect();
        for (index, (warning, text)) in all.iter().zip(&texts).enumerate() {
            assert!(!matches!(warning, Warning::Other { .. }) && text != warning.code(), "{warning:?}");
            assert!(!texts[..index].contains(text), "{text}");
        }
    }

    #[test]
    fn json_keeps_the_values_and_gains_the_sentence() {
        let before = json!({"points": [{"warnings": [{"code": "lost_samples", "lost": 3, "samples": 90}]}], "warnings": ["a sentence"]});
        let mut after = with_messages(before.clone());
        let message = after["points"][0]["warnings"][0].as_object_mut().unwrap().remove("message").unwrap();
        assert!(message.as_str().unwrap().starts_with("3 of 90 samples"));
        assert_eq!(after, before);
    }
}
