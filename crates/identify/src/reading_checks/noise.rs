//! Detects noise far above its declaration: a broken shield, a loose contact, a pulsating flow.
//!
//! Successive samples of a slow quantity differ only by noise. The declared noise sets the weight of each reading and the width of intervals.
//! A channel with several times that noise makes the intervals too narrow.

use crate::IdentifyConfig;
use crate::needs::needs;
use crate::reading_checks::failed_check::FailedCheck;
use crate::step_data::samples::LONGEST_BRIDGE_S;
use mapper_core::{Recording, Warning};
use mapper_numerics::statistics::robust_sigma;

/// Ratio of a sample's standard deviation to the declared one above which intervals are far too narrow. Judgement; noise with a time
/// constant only reduces the difference between samples. Bound: noise with a time constant only reduces the difference between samples.
const MAX_RATIO: f64 = 3.0;

pub(crate) fn failed_checks(recording: &Recording, config: &IdentifyConfig) -> Vec<FailedCheck> {
    needs(config.method)
        .into_iter()
        .filter_map(|channel| {
            let declared = config.declared.get(&channel)?.noise_sigma;
            let series = recording.series.get(&channel)?;
            let close = |pair: &[f64]| pair[1] - pair[0] <= LONGEST_BRIDGE_S;
            let differences: Vec<f64> = series
                .t_s
                .windows(2)
                .zip(series.values.windows(2))
                .filter(|(times, values)| close(times) && values.iter().all(|value| value.is_finite()))
                .map(|(_, values)| (values[1] - values[0]) / std::f64::consts::SQRT_2)
                .collect();
            let found = robust_sigma(&differences)?;
            if !(declared > 0.0 && found > MAX_RATIO * declared) {
                return None;
            }
            let noisy = Warning::NoisyChannel { channel, noise: found, declared_noise: declared };
            Some(FailedCheck::of_all_steps(noisy, recording))
        })
        .collect()
}
