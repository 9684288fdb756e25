//! Sentences of typed warnings, remarks and findings. Each has its words in one place of this crate, as its [`Message`].

use mapper_core::{ModelDoubt, PlanRemark, ResultRemark, Warning, with_sentences};
use mapper_diagnose::gap::GapWarning;
use mapper_recording::logs::LogFinding;
use mapper_recording::logs::proposal::ProposalRemark;
use std::any::Any;

/// A value with a sentence for people, with values, units and remedy.
pub trait Message {
    /// The sentence.
    fn message(&self) -> String;
}

/// The sentence of a typed message for JSON; `None` for a value of another type.
pub fn sentence(value: &dyn Any) -> Option<String> {
    fn of<T: Message + 'static>(value: &dyn Any) -> Option<String> {
        value.downcast_ref::<T>().map(Message::message)
    }
    of::<Warning>(value)
        .or_else(|| of::<ResultRemark>(value))
        .or_else(|| of::<PlanRemark>(value))
        .or_else(|| of::<GapWarning>(value))
        .or_else(|| of::<ModelDoubt>(value))
        .or_else(|| value.downcast_ref::<LogFinding>().map(ToString::to_string))
        .or_else(|| value.downcast_ref::<ProposalRemark>().map(ToString::to_string))
}

/// JSON that `work` makes on this thread has the sentence of each typed message.
pub fn with_messages<R>(work: impl FnOnce() -> R) -> R {
    with_sentences(sentence, work)
}

#[cfg(test)]
mod tests {
    use super::*;

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
        {"code": "from_convection_law", "convection_origin": null},
        {"code": "from_convection_law", "convection_origin": "declared in a.yaml"},
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
        let texts: Vec<String> = all.iter().map(Message::message).collect();
        for (index, (warning, text)) in all.iter().zip(&texts).enumerate() {
            assert!(!matches!(warning, Warning::Other { .. }) && text != warning.code(), "{warning:?}");
            assert!(!texts[..index].contains(text), "{text}");
        }
    }

    #[test]
    fn points_in_json_have_the_sentences_of_their_warnings() {
        let all: Vec<Warning> = serde_json::from_str(ALL).unwrap();
        let json = with_messages(|| serde_json::json!(mapper_core::JsonMessages(&all)));
        let messages = json.as_array().unwrap().iter().map(|one| one["message"].as_str().unwrap());
        assert!(messages.eq(all.iter().map(Message::message)));
        assert_eq!(serde_json::from_value::<Vec<Warning>>(json).unwrap(), all, "a reader ignores them");
    }
}
