//! Explains why an efficiency is uncertain and what helps: too small a signal, offsets, or noise.

use crate::IdentifyConfig;
use crate::step_outcome::findings::{Findings, code};
use mapper_core::EstimateUncertainty;

/// Doubts an efficiency for the width of its interval, or refuses it: see [`cause`].
pub(crate) fn judge(
    eta: EstimateUncertainty,
    dt2_k: f64,
    also: &str,
    config: &IdentifyConfig,
    findings: &mut Findings,
) {
    let limits = &config.thresholds;
    let (code, message) = cause(eta, dt2_k, limits.dt2_k, also);
    if eta.combined_standard_error() > limits.unusable_sigma_eta {
        findings.refuse(code, message);
    } else {
        findings.doubt(code, message);
    }
}

/// Code and sentence for an efficiency with the standard errors `eta`, of a window in which T2 changes by `dt2_k`, K. `least_dt2_k`: the
/// smallest change that separates efficiency from heat transfer; `also`: systematic sources in addition to declared offsets.
fn cause(eta: EstimateUncertainty, dt2_k: f64, least_dt2_k: f64, also: &str) -> (&'static str, String) {
    let points = |sigma: f64| format!("{:.1}", 100.0 * sigma);
    let all = points(eta.combined_standard_error());
    if dt2_k.abs() < least_dt2_k {
        let message = format!(
            "T2 moves by {dt2_k:+.2} K in the window, less than the {least_dt2_k} K that separate efficiency from heat transfer; eta is \
             uncertain by {all} points (1 sigma): come to this point by a larger jump"
        );
        return (code::SMALL_GRADIENT, message);
    }
    let (noise, bias) = (eta.noise_standard_error, eta.bias_standard_error);
    let (code, what, remedy) = if bias >= noise {
        (
            code::OFFSETS_DOMINATE,
            format!(
                "declared offsets{also} leave eta uncertain by {all} points (1 sigma, noise alone {})",
                points(noise)
            ),
            "begin with a `zero`, or calibrate and declare less",
        )
    } else {
        (
            code::NOISE_DOMINATES,
            format!("noise leaves eta uncertain by {all} points (1 sigma, without it {})", points(bias)),
            "stay longer, or come to this point by a larger jump",
        )
    };
    (code, format!("T2 moves by {dt2_k:+.1} K in the window; {what}: {remedy}"))
}

/// The same for a settled temperature rise, K.
pub(crate) fn cause_of_rise(eta: EstimateUncertainty, rise_k: f64) -> (&'static str, String) {
    let (noise, bias) = (eta.noise_standard_error, eta.bias_standard_error);
    let (code, what, remedy) = if bias >= noise {
        (code::OFFSETS_DOMINATE, "declared offsets", "begin with a `zero`, or calibrate and declare less")
    } else {
        (code::NOISE_DOMINATES, "noise", "average over longer, or quieten the sensors")
    };
    let points = 100.0 * eta.combined_standard_error();
    (
        code,
        format!(
            "{what} leave eta uncertain by {points:.1} points (1 sigma) at a temperature rise of {rise_k:.2} K: {remedy}"
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cause_has_its_own_code() {
        let eta = |noise_standard_error, bias_standard_error| EstimateUncertainty {
            noise_standard_error,
            bias_standard_error,
        };
        let table = [
            (eta(0.05, 0.01), 0.2, code::SMALL_GRADIENT),
            (eta(0.01, 0.05), 0.2, code::SMALL_GRADIENT),
            (eta(0.01, 0.05), -39.0, code::OFFSETS_DOMINATE),
            (eta(0.05, 0.01), -39.0, code::NOISE_DOMINATES),
        ];
        for (eta, dt2_k, expected) in table {
            let (code, message) = cause(eta, dt2_k, 0.5, "");
            assert_eq!(code, expected, "{message}");
            assert!(message.contains("5.1 points"), "{message}");
        }
    }
}
