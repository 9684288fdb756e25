//! Forecast of the offset uncertainty after the soak of a campaign, and after a longer soak.

use crate::recording::identification_config::identification;
use mapper_campaign::Campaign;
use mapper_core::{Channel, PlanRemark};
use mapper_identify::{ZeroSettings, expected_after_zero};
use std::collections::BTreeMap;

/// Channels whose offsets dominate the error of efficiency.
const CHANNELS: [Channel; 5] = [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2];
/// Duration ratio of the longer soak to the planned one.
const LONGER_RATIO: f64 = 2.0;
/// Minimum relative reduction of an offset by a longer soak that is reported.
const MIN_REDUCTION_RATIO: f64 = 0.3;

/// The remark of a plan; `None` without a zero or without declared offsets.
pub(crate) fn zero_remark(campaign: &Campaign) -> Option<PlanRemark> {
    let soak = campaign.zero?;
    let left_after = |soak_s: f64| -> BTreeMap<Channel, f64> {
        let settings = ZeroSettings::from(soak);
        let expected_sigma =
            expected_after_zero(identification(campaign), &settings, soak_s, campaign.boundary.p1_pa)
                .declared;
        CHANNELS
            .into_iter()
            .filter_map(|channel| Some((channel, expected_sigma.get(&channel)?.offset_sigma)))
            .collect()
    };
    let longer_soak_s = LONGER_RATIO * soak.duration_s;
    let (offset_sigmas, mut longer_offset_sigmas) = (left_after(soak.duration_s), left_after(longer_soak_s));
    longer_offset_sigmas.retain(|channel, longer| {
        offset_sigmas
            .get(channel)
            .is_some_and(|expected_sigma| *longer < (1.0 - MIN_REDUCTION_RATIO) * expected_sigma)
    });
    (!offset_sigmas.is_empty()).then_some(PlanRemark::OffsetsAfterSoak {
        soak_s: soak.duration_s,
        offset_sigmas,
        longer_soak_s,
        longer_offset_sigmas,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shipped;

    #[test]
    fn a_longer_soak_is_mentioned_if_it_reduces_an_offset_clearly() {
        let mut campaign = shipped::campaign(&[]);
        let named = |campaign: &_| match zero_remark(campaign) {
            Some(PlanRemark::OffsetsAfterSoak { soak_s, longer_offset_sigmas, .. }) => {
                Some((soak_s, longer_offset_sigmas.into_keys().collect::<Vec<_>>()))
            }
            _ => None,
        };
        // Only the housing has not settled; averaging no longer improves the other sensors.
        assert_eq!(named(&campaign), Some((1800.0, vec![Channel::Tc])));
        let soak = campaign.zero.as_mut().unwrap();
        soak.duration_s = 4.0 * 3600.0;
        assert_eq!(named(&campaign), Some((4.0 * 3600.0, Vec::new())));
        campaign.zero = None;
        assert_eq!(named(&campaign), None);
    }
}
