//! Explains why an efficiency is uncertain: too small a signal, offsets, or noise.

use crate::IdentifyConfig;
use crate::step_outcome::findings::Findings;
use mapper_core::{EstimateUncertainty, EtaSignal, Warning, WideInterval};

/// Marks an efficiency as doubtful or unusable if its interval is too wide. `dt2_k`: change of T2 in the window; `shared`: whether shared parameters
/// contribute to its errors.
pub(crate) fn judge(
    eta: EstimateUncertainty,
    dt2_k: f64,
    shared: bool,
    config: &IdentifyConfig,
    findings: &mut Findings,
) {
    let limits = &config.thresholds;
    let (eta_sigma, needed_dt2_k) = (eta.combined_standard_error(), limits.dt2_k);
    let warning = match dt2_k.abs() < needed_dt2_k {
        true => Warning::SmallGradient { dt2_k, needed_dt2_k, eta_sigma },
        false => wide(eta, EtaSignal::Transient { dt2_k, shared }),
    };
    if eta_sigma > limits.unusable_sigma_eta {
        findings.refuse(warning);
    } else {
        findings.doubt(warning);
    }
}

/// The dominant origin of a wide interval.
pub(crate) fn wide(eta: EstimateUncertainty, signal: EtaSignal) -> Warning {
    let (eta_noise_sigma, eta_bias_sigma) = (eta.noise_standard_error, eta.bias_standard_error);
    let interval = WideInterval { eta_noise_sigma, eta_bias_sigma, signal };
    match eta_bias_sigma >= eta_noise_sigma {
        true => Warning::OffsetsDominate(interval),
        false => Warning::NoiseDominates(interval),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cause_has_its_own_code() {
        let table = [
            (0.05, 0.01, 0.2, "small_gradient"),
            (0.01, 0.05, 0.2, "small_gradient"),
            (0.01, 0.05, -39.0, "offsets_dominate"),
            (0.05, 0.01, -39.0, "noise_dominates"),
        ];
        for (noise_standard_error, bias_standard_error, dt2_k, expected) in table {
            let eta = EstimateUncertainty { noise_standard_error, bias_standard_error };
            let mut findings = Findings::new();
            judge(eta, dt2_k, false, &IdentifyConfig::default(), &mut findings);
            assert_eq!(findings.warnings[0].code(), expected);
        }
    }
}
