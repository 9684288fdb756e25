//! Judges the steps of a recording by the criteria of a test code.

use crate::energy_balance::EnergyBalance;
use mapper_core::{AcceptanceCriteria, Channel, Recording, StepMarker};
use mapper_numerics::statistics::mean;

/// Result of a criterion at all steps.
#[derive(Debug, Clone, PartialEq)]
pub struct CriterionResult {
    /// The channel with the limited fluctuation; `None` for the heat balance.
    pub channel: Option<Channel>,
    /// The limit, ratio.
    pub limit_ratio: f64,
    /// Index of each step with its readings, and the ratio that is compared with the limit.
    pub steps: Vec<(usize, f64)>,
}

impl CriterionResult {
    /// The steps that do not fulfil the criterion.
    pub fn failed(&self) -> impl Iterator<Item = usize> {
        self.steps.iter().filter(|(_, ratio)| *ratio > self.limit_ratio).map(|(step, _)| *step)
    }

    /// The largest ratio; `None` if no step could be judged.
    pub fn largest_ratio(&self) -> Option<f64> {
        self.steps.iter().map(|(_, ratio)| *ratio).reduce(f64::max)
    }
}

/// Judges each criterion at the end of each step. `steps`: the steps with their energy balances.
pub fn judge_acceptance(
    criteria: &AcceptanceCriteria,
    recording: &Recording,
    steps: &[(&StepMarker, EnergyBalance)],
) -> Vec<CriterionResult> {
    let fluctuation = |channel: Channel, step: &StepMarker| {
        let start_s = (step.end_s - criteria.window_s).max(step.start_s);
        let values = recording.series.get(&channel)?.slice(start_s, step.end_s).1;
        let finite = || values.iter().copied().filter(|value| value.is_finite());
        let (low, high) = (finite().reduce(f64::min)?, finite().reduce(f64::max)?);
        Some((high - low) / mean(finite())?.abs())
    };
    let heat_balance = |balance: &EnergyBalance| Some((balance.losses?.w / balance.turbine?.w).abs());
    let fluctuations = criteria.fluctuation_ratio.iter().map(|(&channel, &limit_ratio)| CriterionResult {
        channel: Some(channel),
        limit_ratio,
        steps: steps.iter().filter_map(|(step, _)| Some((step.index, fluctuation(channel, step)?))).collect(),
    });
    let balance = criteria.heat_balance_ratio.map(|limit_ratio| CriterionResult {
        channel: None,
        limit_ratio,
        steps: steps
            .iter()
            .filter_map(|(step, balance)| Some((step.index, heat_balance(balance)?)))
            .collect(),
    });
    fluctuations.chain(balance).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy_balance::Power;
    use mapper_core::{Series, StepKind};

    #[test]
    fn a_step_fails_where_readings_fluctuate_or_heat_is_missing() {
        let mut recording = Recording::default();
        // 100 kPa; 1 % from 10 s to 15 s, and once 5 % before the window.
        let p1 = |t: u32| 1e5 + if t == 3 { 5e3 } else { f64::from(u8::from((10..=15).contains(&t))) * 1e3 };
        let series = Series { t_s: (0..30).map(f64::from).collect(), values: (0..30).map(p1).collect() };
        recording.series.insert(Channel::P1, series);
        let step = |index, start_s, end_s| StepMarker {
            index,
            kind: StepKind::Point,
            start_s,
            end_s,
            from: None,
            to: None,
            p3_pa: 2e5,
            valve_opening_ratio: 1.0,
        };
        let power = |w| Some(Power { w, sigma_w: 0.0 });
        let balance = |losses_w| EnergyBalance {
            compressor: None,
            turbine: power(100.0),
            oil: None,
            water: None,
            losses: power(losses_w),
        };
        let criteria = AcceptanceCriteria {
            name: "own".to_owned(),
            source: "own".to_owned(),
            window_s: 10.0,
            fluctuation_ratio: [(Channel::P1, 0.005), (Channel::P2, 0.005)].into(),
            heat_balance_ratio: Some(0.05),
        };
        let steps = [step(0, 0.0, 14.0), step(1, 16.0, 29.0)];
        let judged =
            judge_acceptance(&criteria, &recording, &[(&steps[0], balance(-4.0)), (&steps[1], balance(6.0))]);
        let failed: Vec<(Option<Channel>, Vec<usize>)> =
            judged.iter().map(|judgement| (judgement.channel, judgement.failed().collect())).collect();
        assert_eq!(failed, [(Some(Channel::P1), vec![0]), (Some(Channel::P2), vec![]), (None, vec![1])]);
        assert!((judged[0].largest_ratio().unwrap() - 0.01).abs() < 1e-4);
        assert_eq!(judged[1].largest_ratio(), None, "P2 was not recorded");
    }
}
