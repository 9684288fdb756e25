//! Detects dead channels and wrong units: the median reading of a step is impossible for a running machine.
//!
//! The ranges are those of [`mapper_core::plausible`], wide enough for every turbocharger on a gas stand.

use crate::IdentifyConfig;
use crate::needs::needs;
use crate::reading_checks::failed_check::FailedCheck;
use mapper_core::{Recording, Warning, check_running};
use mapper_numerics::statistics::median;

pub(crate) fn failed_checks(recording: &Recording, config: &IdentifyConfig) -> Vec<FailedCheck> {
    needs(config.method)
        .into_iter()
        .filter_map(|channel| {
            let series = recording.series.get(&channel)?;
            let (mut steps, mut middles) = (Vec::new(), Vec::new());
            for (position, step) in recording.steps.iter().enumerate() {
                let values = series.slice(step.start_s, step.end_s).1;
                let Some(middle) = median(values.iter().filter(|value| value.is_finite())) else { continue };
                if check_running(channel, middle).is_err() {
                    steps.push(position);
                    middles.push(middle);
                }
            }
            let why = check_running(channel, median(&middles)?).err()?;
            Some(FailedCheck::new(Warning::DeadChannel { channel, reading: why.value }, steps))
        })
        .collect()
}
