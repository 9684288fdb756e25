//! A reading that does not move although the setpoints jump.

use crate::guards::guard::CommandedState;
use mapper_core::{Channel, FrozenLimit, readable};

/// The last readings of a channel that may freeze.
#[derive(Debug, Clone)]
pub(crate) struct FrozenReading {
    limit: FrozenLimit,
    /// Start of the period of constant readings, s, and their value.
    constant_since: Option<(f64, f64)>,
}

impl FrozenReading {
    pub(crate) fn new(limit: FrozenLimit) -> Self {
        FrozenReading { limit, constant_since: None }
    }

    /// Takes a reading. Describes the fault if the channel has not moved since before the last jump.
    pub(crate) fn check(
        &mut self,
        t_s: f64,
        value: f64,
        channel: Channel,
        state: &CommandedState,
    ) -> Option<String> {
        let unchanged = |(_, constant): &(f64, f64)| self.limit.is_constant(*constant, value);
        let (since_s, constant) = self.constant_since.filter(unchanged).unwrap_or((t_s, value));
        self.constant_since = Some((since_s, constant));
        let jumped_s = state.jumped_s.filter(|_| state.running)?;
        if t_s - jumped_s < self.limit.after_s || since_s > jumped_s {
            return None;
        }
        let value = readable(value, channel.unit());
        Some(format!(
            "is frozen: {value} since {since_s:.1} s, though the setpoints jumped at {jumped_s:.1} s"
        ))
    }
}
