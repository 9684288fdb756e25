//! Forecast of the offset uncertainty after the soak of a campaign, and after a longer soak.

use crate::recording::identification_config::identification;
use mapper_campaign::Campaign;
use mapper_core::{Channel, with_unit};
use mapper_identify::{ZeroSettings, expected_after_zero};

/// Channels whose offsets dominate the error of efficiency.
const CHANNELS: [Channel; 5] = [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2];
/// Duration ratio of the longer soak to the planned one.
const LONGER_RATIO: f64 = 2.0;
/// Minimum relative reduction of an offset by a longer soak that is reported.
const WORTH_IT_RATIO: f64 = 0.3;

/// One sentence for a plan's remarks; `None` without a zero or without declared offsets.
pub(crate) fn zero_remark(campaign: &Campaign) -> Option<String> {
    let soak = campaign.zero?;
    let left_after = |soak_s: f64| {
        let left = expected_after_zero(identification(campaign), &ZeroSettings::from(soak), soak_s);
        CHANNELS.map(|channel| left.declared.get(&channel).map(|declared| declared.offset_sigma))
    };
    let (left, longer) = (left_after(soak.duration_s), left_after(LONGER_RATIO * soak.duration_s));
    let named = |(channel, sigma): (Channel, f64)| {
        let digits = if channel.unit() == "K" { 3 } else { 1 };
        format!("{channel} {}", with_unit(format!("{sigma:.digits$}"), channel.unit()))
    };
    let all: Vec<String> = CHANNELS
        .into_iter()
        .zip(left)
        .filter_map(|(channel, sigma)| Some(named((channel, sigma?))))
        .collect();
    let better: Vec<String> = CHANNELS
        .into_iter()
        .zip(left.into_iter().zip(longer))
        .filter_map(|(channel, (left, longer))| {
            let (left, longer) = (left?, longer?);
            (longer < (1.0 - WORTH_IT_RATIO) * left).then(|| named((channel, longer)))
        })
        .collect();
    if all.is_empty() {
        return None;
    }
    let mut sentence = format!(
        "offset uncertainties after the soak of {:.0} min (one standard deviation): {}",
        soak.duration_s / 60.0,
        all.join(", ")
    );
    if !better.is_empty() {
        let minutes = LONGER_RATIO * soak.duration_s / 60.0;
        sentence += &format!("; after {minutes:.0} min: {}", better.join(", "));
    }
    Some(sentence)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shipped;

    #[test]
    fn a_longer_soak_is_mentioned_if_it_reduces_an_offset_clearly() {
        let mut campaign = shipped::campaign(&[]);
        let half_an_hour = zero_remark(&campaign).unwrap();
        // Only the housing has not settled; averaging no longer improves the other sensors.
        assert!(half_an_hour.contains("60 min: Tc"), "{half_an_hour}");
        let soak = campaign.zero.as_mut().unwrap();
        soak.duration_s = 4.0 * 3600.0;
        let night = zero_remark(&campaign).unwrap();
        assert!(!night.contains("480 min"), "{night}");
        campaign.zero = None;
        assert_eq!(zero_remark(&campaign), None);
    }
}
