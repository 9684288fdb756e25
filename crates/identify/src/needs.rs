//! Channels that each method needs.

use mapper_core::{Channel, Method, Recording, ResultRemark};

/// Channels that every point needs: its position on the map, and the temperature rise.
const EVERY: [Channel; 6] =
    [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::T1, Channel::P2, Channel::T2];

/// Channels that a method needs.
pub fn needs(method: Method) -> Vec<Channel> {
    let housing = (method != Method::Steady).then_some(Channel::Tc);
    EVERY.into_iter().chain(housing).collect()
}

/// Channels that a method needs and the recording does not have.
pub fn missing(recording: &Recording, method: Method) -> Vec<Channel> {
    needs(method).into_iter().filter(|channel| recording.require(*channel).is_err()).collect()
}

/// The default method for a recording, and why it differs from `usual`. Without a housing temperature no heat-transfer model applies, so only
/// the apparent efficiency remains.
pub fn method_for(recording: &Recording, usual: Method) -> (Method, Option<ResultRemark>) {
    let lost = missing(recording, usual);
    if lost.is_empty() || usual == Method::Steady || !missing(recording, Method::Steady).is_empty() {
        return (usual, None);
    }
    (Method::Steady, Some(ResultRemark::ConventionalMapping { usual, missing: lost }))
}

/// Symbols with descriptions.
pub(crate) fn names(channels: &[Channel]) -> String {
    let named = |channel: &Channel| format!("{channel} ({})", channel.info().description);
    channels.iter().map(named).collect::<Vec<_>>().join(", ")
}
