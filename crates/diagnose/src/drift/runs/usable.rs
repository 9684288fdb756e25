//! Checks whether a recording can be examined, before the model is driven by it.

use crate::drift::runs::request::DriftError;
use mapper_core::{Channel, Recording};
use mapper_numerics::statistics::median;
use mapper_observe::channels::{DRIVERS, OUTPUTS};
use mapper_observe::plausible::check_running;

/// Channels needed to judge drift.
const NEEDED: [Channel; 4] = [Channel::ShaftSpeed, Channel::P2, Channel::T2, Channel::T1];

/// Checks the model inputs and the compared channels, within the steps. `lost_ratio`: maximum share of readings that are not numbers.
///
/// # Errors
/// [`DriftError`] with the missing or wrong input.
pub(crate) fn usable(run: usize, recording: &Recording, lost_ratio: f64) -> Result<(), DriftError> {
    let missing: Vec<Channel> =
        NEEDED.into_iter().filter(|channel| recording.require(*channel).is_err()).collect();
    if !missing.is_empty() {
        return Err(DriftError::MissingChannels { run, channels: missing });
    }
    let (Some(first), Some(last)) = (recording.steps.first(), recording.steps.last()) else {
        return Err(DriftError::NoSteps { run });
    };
    for channel in DRIVERS.into_iter().chain(OUTPUTS) {
        let Some(series) = recording.series.get(&channel) else { continue };
        let values = series.slice(first.start_s, last.end_s).1;
        let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        let (missing, all) = (values.len() - finite.len(), values.len());
        if missing as f64 > lost_ratio * all as f64 {
            return Err(DriftError::NotNumbers { run, channel, missing, all });
        }
        if let Some(middle) = median(&finite) {
            check_running(channel, middle).map_err(|source| DriftError::Implausible { run, source })?;
        }
    }
    Ok(())
}
