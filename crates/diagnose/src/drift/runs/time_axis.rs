//! Steps of all runs on one time axis, and their segments, over which readings are averaged.

use mapper_core::{Channel, NoiseColour, Recording, StepPoint};
use mapper_numerics::coloured_noise::ColouredNoise;
use mapper_observe::averages::mean_reading::{BEFORE_S, mean_between};
use mapper_observe::averages::schedule::Schedule;

/// Lengths of the segments of a step: from 5 s after a jump on, increasing.
pub(crate) const SEGMENTS: Schedule = Schedule {
    first_s: 5.0,
    lengths_s: &[(15.0, 10.0), (35.0, 20.0), (95.0, 30.0), (f64::INFINITY, 60.0)],
    shortest_s: 5.0,
    shortest_ratio: 0.0,
};

/// A step of one of the runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CampaignStep {
    pub run: usize,
    /// Number within its run, from its marker.
    pub index: usize,
    /// Run time, s.
    pub start_s: f64,
    pub end_s: f64,
    /// Offset from run time to campaign time, s.
    pub offset_s: f64,
    /// Number of its operating point.
    pub condition: usize,
    /// Number of the operating point before it; `None` for the first step of a run.
    pub from: Option<usize>,
    pub valve_opening_ratio: f64,
    pub p3_pa: f64,
}

/// A segment of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Segment {
    /// Position of its step among all steps.
    pub step: usize,
    /// Run time, s.
    pub start_s: f64,
    pub end_s: f64,
}

impl Segment {
    pub fn length_s(&self) -> f64 {
        self.end_s - self.start_s
    }
}

/// Steps of all runs, each with its operating point.
pub(crate) fn steps(runs: &[&Recording]) -> Vec<CampaignStep> {
    let mut conditions: Vec<StepPoint> = Vec::new();
    let mut steps: Vec<CampaignStep> = Vec::new();
    let mut offset_s = 0.0;
    for (run, recording) in runs.iter().enumerate() {
        let mut from = None;
        for marker in &recording.steps {
            let point = StepPoint::of(recording, marker);
            let known = conditions.iter().position(|known| known.is_same(&point));
            let condition = known.unwrap_or_else(|| {
                conditions.push(point);
                conditions.len() - 1
            });
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
        // Only measured time counts, so the time axis has no gap between two runs.
        offset_s += recording.steps.last().map_or(0.0, |marker| marker.end_s);
    }
    steps
}

pub(crate) fn segments(steps: &[CampaignStep]) -> Vec<Segment> {
    let of_step = |(position, step): (usize, &CampaignStep)| {
        let segments = SEGMENTS.segments(step.start_s, step.end_s, 0.0);
        segments.into_iter().map(move |(start_s, end_s)| Segment { step: position, start_s, end_s })
    };
    steps.iter().enumerate().flat_map(of_step).collect()
}

/// Mean of a channel over a segment; `None` if it has fewer than three samples.
pub(crate) fn mean(recording: &Recording, channel: Channel, segment: &Segment) -> Option<f64> {
    mean_between(recording, channel, segment.start_s, segment.end_s, 3)
}

/// Ratio of the variance of a channel's mean over a segment to that of one reading.
pub(crate) fn mean_variance_ratio(
    colour: NoiseColour,
    recording: &Recording,
    channel: Channel,
    segment: &Segment,
) -> f64 {
    let samples = recording
        .series
        .get(&channel)
        .map_or(1, |series| series.range(segment.start_s, segment.end_s - BEFORE_S).len());
    ColouredNoise::new(colour.first_order_share_ratio, colour.time_constant_s)
        .variance_of_mean(samples, segment.length_s())
}
