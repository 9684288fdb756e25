//! A failure that lasts or returns is reported once for each reason, and once when it is over.

use std::collections::BTreeSet;

/// Time without a failure after which it is over, s: long enough that a failure of every second sample is one.
const QUIET_S: f64 = 3.0;
/// Maximum number of reported reasons: a reason may contain a number that always differs.
const MAX_REASONS: usize = 5;

/// A failure of one kind.
#[derive(Debug, Default)]
pub struct Outage {
    reasons: BTreeSet<String>,
    samples: usize,
    last_s: f64,
}

impl Outage {
    /// Takes the failure of the sample at this run time, s, or `None` without one. Returns a message that begins with `what`, if there is something to report.
    pub fn update(&mut self, what: &str, t_s: f64, failure: Option<String>) -> Option<String> {
        if let Some(reason) = failure {
            (self.samples, self.last_s) = (self.samples + 1, t_s);
            let message = format!("{what}: {reason}");
            let is_new = self.reasons.len() < MAX_REASONS && self.reasons.insert(reason);
            return is_new.then_some(message);
        }
        if self.samples == 0 || t_s - self.last_s < QUIET_S {
            return None;
        }
        let ended = std::mem::take(self);
        Some(format!(
            "{what}: over since {:.1} s; number of affected samples: {}",
            ended.last_s, ended.samples
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_that_comes_and_goes_is_reported_once() {
        let mut outage = Outage::default();
        let mut messages = Vec::new();
        for sample in 0..200_u32 {
            let failure = match sample {
                100.. => None,
                _ if sample.is_multiple_of(2) => None,
                50.. => Some(format!("late by {sample} ms")),
                _ => Some("busy".to_owned()),
            };
            messages.extend(outage.update("missing readings", 0.1 * f64::from(sample), failure));
        }
        assert_eq!(messages.len(), MAX_REASONS + 1, "{messages:?}");
        assert_eq!(messages[0], "missing readings: busy");
        assert_eq!(
            messages[MAX_REASONS],
            "missing readings: over since 9.9 s; number of affected samples: 50"
        );
    }
}
