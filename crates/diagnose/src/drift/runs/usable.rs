//! Checks a recording before it drives the model.

use crate::drift::runs::request::DriftError;
use mapper_core::{Channel, Recording};
use mapper_numerics::statistics::median;
use mapper_observe::channels::{INPUT_CHANNELS, OUTPUTS};
use mapper_observe::plausible::check_running;

/// Channels that the diagnosis needs.
const NEEDED: [Channel; 4] = [Channel::ShaftSpeed, Channel::P2, Channel::T2, Channel::T1];

/// Checks the inputs and the compared channels within the steps. `lost_ratio`: maximum share of readings that are not numbers.
pub(crate) fn usable(run: usize, recording: &Recording, lost_ratio: f64) -> Result<(), DriftError> {
    let channels: Vec<Channel> =
        NEEDED.into_iter().filter(|channel| recording.require(*channel).is_err()).collect();
    if !channels.is_empty() {
        return Err(DriftError::MissingChannels { run, channels });
    }
    let (Some(first), Some(last)) = (recording.steps.first(), recording.steps.last()) else {
        return Err(DriftError::NoSteps { run });
    };
    for channel in INPUT_CHANNELS.into_iter().chain(OUTPUTS) {
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
