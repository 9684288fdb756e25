//! Steps of all runs on one axis of time, and the stretches of them over which readings are averaged.

use mapper_core::{Channel, NoiseColour, Recording, StepMarker};

/// Begin and end of the averages after a jump, s; later ones are as long as the last.
const EDGES_S: [f64; 5] = [5.0, 15.0, 35.0, 65.0, 95.0];
const LATER_S: f64 = 60.0;
/// Shorter stretches are left out, s.
const SHORTEST_S: f64 = 5.0;

/// Relative difference below which two commands are the same point: other programs write them rounded.
const SAME_COMMAND: f64 = 1e-3;

/// What is read and compared with the model, in this order.
pub(crate) const OUTPUTS: [Channel; 8] = [
    Channel::ShaftSpeed,
    Channel::P2,
    Channel::CompressorFlow,
    Channel::TurbineFlow,
    Channel::T2,
    Channel::Tc,
    Channel::Tt,
    Channel::T4,
];

/// A step of one of the runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CampaignStep {
    pub run: usize,
    /// Number within its run, as its marker has it.
    pub index: usize,
    /// Run time, s.
    pub start_s: f64,
    pub end_s: f64,
    /// What is added to run time for the time of the campaign, s.
    pub offset_s: f64,
    /// Number of its operating point among all.
    pub condition: usize,
    /// Operating point before it; `None` for the first step of a run.
    pub from: Option<usize>,
    pub valve_opening_ratio: f64,
    pub p3_pa: f64,
}

/// A stretch of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Block {
    /// Position of its step among all steps.
    pub step: usize,
    /// Run time, s.
    pub start_s: f64,
    pub end_s: f64,
}

impl Block {
    pub fn length_s(&self) -> f64 {
        self.end_s - self.start_s
    }
}

/// Steps of all runs, each with its operating point.
pub(crate) fn steps(runs: &[&Recording]) -> Vec<CampaignStep> {
    let mut conditions: Vec<(f64, f64)> = Vec::new();
    let mut steps: Vec<CampaignStep> = Vec::new();
    let mut offset_s = 0.0;
    for (run, recording) in runs.iter().enumerate() {
        let mut from = None;
        for marker in &recording.steps {
            let condition = condition_of(marker, &mut conditions);
            steps.push(CampaignStep {
                run,
                index: marker.index,
                start_s: marker.start_s,
                end_s: marker.end_s,
                offset_s,
                condition,
                from,
                valve_opening_ratio: marker.valve_opening_ratio,
                p3_pa: marker.p3_pa,
            });
            from = Some(condition);
        }
        // Between two runs time stands still: only the time that was measured is known.
        offset_s += recording.steps.last().map_or(0.0, |marker| marker.end_s);
    }
    steps
}

fn condition_of(marker: &StepMarker, conditions: &mut Vec<(f64, f64)>) -> usize {
    let key = (marker.p3_pa, marker.valve_opening_ratio);
    let same = |a: f64, b: f64| (a - b).abs() <= SAME_COMMAND * a.abs().max(b.abs());
    match conditions.iter().position(|known| same(known.0, key.0) && same(known.1, key.1)) {
        Some(position) => position,
        None => {
            conditions.push(key);
            conditions.len() - 1
        }
    }
}

/// The stretches of all steps.
pub(crate) fn blocks(steps: &[CampaignStep]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for (position, step) in steps.iter().enumerate() {
        let length_s = step.end_s - step.start_s;
        let mut edge_s = EDGES_S[0];
        let mut edges = EDGES_S[1..].iter().copied();
        while length_s - edge_s >= SHORTEST_S {
            let mut next_s = edges.next().unwrap_or(edge_s + LATER_S).min(length_s);
            if length_s - next_s < SHORTEST_S {
                next_s = length_s;
            }
            blocks.push(Block {
                step: position,
                start_s: step.start_s + edge_s,
                end_s: step.start_s + next_s,
            });
            edge_s = next_s;
        }
    }
    blocks
}

/// Mean of a channel over a stretch; `None` where fewer than three samples are in it.
pub(crate) fn mean(recording: &Recording, channel: Channel, block: &Block) -> Option<f64> {
    // The sample at the end belongs to the next jump.
    let values = recording.series.get(&channel)?.slice(block.start_s, block.end_s - 1e-6).1;
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.len() >= 3 && mean.is_finite()).then_some(mean)
}

/// Variance of the mean of `samples` readings over `length_s`, over the variance of one reading.
pub(crate) fn mean_variance_ratio(colour: NoiseColour, length_s: f64, samples: usize) -> f64 {
    let coloured = colour.first_order_share_ratio.clamp(0.0, 1.0).powi(2);
    let share = (colour.time_constant_s / length_s).max(0.0);
    let first_order =
        if share > 0.0 { 2.0 * share * (1.0 - share * (1.0 - (-1.0 / share).exp())) } else { 0.0 };
    (1.0 - coloured) / samples.max(1) as f64 + coloured * first_order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_of_a_mean_is_that_of_white_and_first_order_noise() {
        let colour = |share| NoiseColour { first_order_share_ratio: share, time_constant_s: 2.0 };
        assert!((mean_variance_ratio(colour(0.0), 30.0, 300) - 1.0 / 300.0).abs() < 1e-15);
        // Integral of exp(-|t - s|/2) over the square of 30 s, over 900 s2: (2*2*30 - 2*4*(1 - exp(-15)))/900.
        let expected = (120.0 - 8.0 * (1.0 - (-15.0_f64).exp())) / 900.0;
        assert!((mean_variance_ratio(colour(1.0), 30.0, 300) - expected).abs() < 1e-12);
    }

    #[test]
    fn a_step_of_two_minutes_has_five_stretches_without_holes() {
        let step = CampaignStep {
            run: 0,
            index: 0,
            start_s: 100.0,
            end_s: 220.0,
            offset_s: 0.0,
            condition: 0,
            from: None,
            valve_opening_ratio: 1.0,
            p3_pa: 2e5,
        };
        let blocks = blocks(&[step]);
        let edges: Vec<(f64, f64)> = blocks.iter().map(|block| (block.start_s, block.end_s)).collect();
        assert_eq!(edges, [(105.0, 115.0), (115.0, 135.0), (135.0, 165.0), (165.0, 195.0), (195.0, 220.0)]);
        assert!(super::blocks(&[CampaignStep { end_s: 104.0, ..step }]).is_empty());
    }
}
