//! Detects dead channels and wrong units: the median reading of a step is impossible for a running machine.
//!
//! The ranges are those of [`mapper_observe::plausible`], wide enough for every turbocharger on a gas stand.

use crate::IdentifyConfig;
use crate::findings::code;
use crate::objections::objection::Objection;
use mapper_core::{Channel, Method, Recording};
use mapper_numerics::statistics::median;
use mapper_observe::plausible::check_running;

/// Channels that every method reads.
pub(crate) const READ: [Channel; 6] =
    [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::T1, Channel::P2, Channel::T2];

/// The channels that a method reads.
pub(crate) fn read_by(config: &IdentifyConfig) -> impl Iterator<Item = Channel> {
    READ.into_iter().chain((config.method != Method::Steady).then_some(Channel::Tc))
}

pub(crate) fn objections(recording: &Recording, config: &IdentifyConfig) -> Vec<Objection> {
    read_by(config)
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
            Some(Objection::new(code::DEAD_CHANNEL, why.to_string(), steps))
        })
        .collect()
}
