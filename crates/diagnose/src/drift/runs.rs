//! Recordings of a campaign on one axis of time, their repeats, and whether they can be compared.

use crate::drift::causes::Cause;
use mapper_core::unit_factors::S_PER_H;
use mapper_core::{
    Channel, Implausible, ModelTolerances, NoiseColour, Recording, RigActuators, StepPoint, check_running,
    step_number,
};
use mapper_identify::{IdentifyConfig, LONGEST_BRIDGE_S};
use mapper_numerics::coloured_noise::ColouredNoise;
use mapper_numerics::statistics::median;
use mapper_observe::averages::{BEFORE_S, INPUT_CHANNELS, OUTPUTS, Schedule, mean_between};
use mapper_observe::declared::Declared;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady::InputsError;
use std::collections::BTreeMap;

/// Minimum number of visits by one jump. Bound: two show a difference, a third shows whether it persists or grows.
const VISITS_NEEDED: usize = 3;
/// Longest total time of all steps, s. Bound: 30 days; beyond it a time in the log is wrong.
const LONGEST_S: f64 = 30.0 * 24.0 * S_PER_H;
/// Longest gap in the times of a channel, in intervals of its samples. Bound: a slow logger that misses some samples has no gap.
const MAX_GAP_INTERVALS: f64 = 20.0;

/// All visits of each repeated jump, by position among the steps; most visits first.
pub(crate) fn groups(steps: &[CampaignStep]) -> Vec<Vec<usize>> {
    let mut by_jump: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (position, step) in steps.iter().enumerate() {
        // A change within one operating point is not a jump.
        if let Some(from) = step.from.filter(|from| *from != step.condition) {
            by_jump.entry((from, step.condition)).or_default().push(position);
        }
    }
    let mut groups: Vec<Vec<usize>> = by_jump.into_values().filter(|visits| visits.len() > 1).collect();
    groups.sort_by_key(|visits| (std::cmp::Reverse(visits.len()), visits.first().copied()));
    groups
}

/// Why no verdict is possible; `None` if one is.
pub(crate) fn refusal(
    runs: &[RecordedRun<'_>],
    steps: &[CampaignStep],
    groups: &[Vec<usize>],
) -> Option<String> {
    if let Some(first) = runs.first()
        && let Some(other) = runs.iter().position(|run| run.fingerprint != first.fingerprint)
    {
        return Some(format!(
            "No verdict: the campaign or machine of recording {} differs from that of recording 1 (other fingerprint), so \
             their differences need not be drift. Compare runs of one campaign on one machine.",
            other + 1
        ));
    }
    if let Some(step) = steps.iter().find(|step| !step.valve_opening_ratio.is_finite()) {
        return Some(format!(
            "No verdict: recording {} has no valve opening, which drives the model. Map the commanded or measured opening as \
             `valve_command`, or give it among `constants`.",
            step.run + 1
        ));
    }
    let length_s = |step: &CampaignStep| step.end_s - step.start_s;
    let whole_s: f64 = steps.iter().map(length_s).sum();
    let longest = steps.iter().max_by(|a, b| length_s(a).total_cmp(&length_s(b)));
    if let Some(step) = longest.filter(|_| whole_s > LONGEST_S) {
        return Some(format!(
            "No verdict: step {} of recording {} lasts {:.1} h of {:.1} h in total; a campaign lasts at most {:.0} h. Look for a \
             wrong time in the log.",
            step_number(step.index),
            step.run + 1,
            length_s(step) / S_PER_H,
            whole_s / S_PER_H,
            LONGEST_S / S_PER_H,
        ));
    }
    for (index, run) in runs.iter().enumerate() {
        if let Some((channel, from_s, to_s)) = gap(run.recording) {
            return Some(format!(
                "No verdict: recording {} has a gap: {} has no samples from {from_s:.1} s to {to_s:.1} s, so the state of the \
                 machine there is unknown. Give the parts before and after the gap as separate recordings.",
                index + 1,
                channel.symbol()
            ));
        }
    }
    let max_visits = groups.first().map_or(0, Vec::len);
    if max_visits >= VISITS_NEEDED {
        return None;
    }
    if max_visits == 2 {
        return Some(
            "No verdict: only one repeat. Two visits show a difference, but not whether it is chance, a step or a steady \
             change; repeat the reference jump at least once more."
                .to_owned(),
        );
    }
    let mut visits: BTreeMap<usize, usize> = BTreeMap::new();
    for step in steps {
        *visits.entry(step.condition).or_default() += 1;
    }
    Some(if visits.values().any(|count| *count > 1) {
        "No verdict: points are repeated, but by different jumps. A transient depends on the point before it, so only visits \
         by the same jump can be compared; repeat the jump, not only the point."
            .to_owned()
    } else {
        "No verdict: no repeats. No jump of this campaign is made twice; plan some (`repeats` in the campaign).".to_owned()
    })
}

/// A channel with a gap within the steps; start and end of the gap, s.
fn gap(recording: &Recording) -> Option<(Channel, f64, f64)> {
    let (start_s, end_s) = (recording.steps.first()?.start_s, recording.steps.last()?.end_s);
    let measured = |channel: &Channel| {
        !matches!(
            channel,
            Channel::P3Command
                | Channel::T3Command
                | Channel::ValveCommand
                | Channel::TOilCommand
                | Channel::TAmb
        )
    };
    for (channel, series) in recording.series.iter().filter(|(channel, _)| measured(channel)) {
        let times = series.slice(start_s, end_s).0;
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Some((*channel, start_s, end_s));
        };
        let inner = times.windows(2).map(|pair| (pair[0], pair[1]));
        let mut intervals = inner.chain([(start_s, *first), (*last, end_s)]);
        // A long sample interval is not a gap.
        let interval_s = (last - first) / times.len().max(2) as f64;
        let longest_s = LONGEST_BRIDGE_S.max(MAX_GAP_INTERVALS * interval_s);
        if let Some((from_s, to_s)) = intervals.find(|(from_s, to_s)| to_s - from_s > longest_s) {
            return Some((*channel, from_s, to_s));
        }
    }
    None
}

/// A recording with the identity of its campaign and machine.
#[derive(Debug, Clone, Copy)]
pub struct RecordedRun<'a> {
    /// The recording.
    pub recording: &'a Recording,
    /// Identity of campaign and machine, e.g. their hashes; `None` if unknown.
    pub fingerprint: Option<&'a str>,
}

/// Consecutive runs of one machine, with the declarations of machine and rig.
#[derive(Debug, Clone, Copy)]
pub struct DriftRequest<'a> {
    /// The recordings in the order in which they were made.
    pub runs: &'a [RecordedRun<'a>],
    /// The nominal machine.
    pub model: &'a Model,
    /// Boundary conditions for channels that are not recorded.
    pub boundary: BoundaryConditions,
    /// Tolerances of the nominal machine: a constant deviation within them is not drift.
    pub tolerances: ModelTolerances,
    /// Declared uncertainty, window, geometry.
    pub identification: &'a IdentifyConfig,
    /// Declared motion of the actuators.
    pub actuators: Option<RigActuators>,
}

impl DriftRequest<'_> {
    pub(crate) fn declared(&self) -> Declared {
        Declared {
            sensors: self.identification.declared.clone(),
            noise_colour: self.identification.noise_colour,
            tolerances: self.tolerances,
            nominal: self.boundary,
            common_offsets: Vec::new(),
            actuators: self.actuators,
        }
    }
}

/// Why recordings cannot be diagnosed at all.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum DriftError {
    #[error("no recording was given")]
    NoRun,
    #[error("recording {} has no steps: P3_command and valve_command are constant or missing; map them", .run + 1)]
    NoSteps { run: usize },
    #[error("recording {} has no {}; the drift diagnosis needs N, P2, T1 and T2", .run + 1, symbols(.channels))]
    MissingChannels { run: usize, channels: Vec<Channel> },
    #[error(
        "recording {}: {missing} of {all} readings of {channel} are not numbers; repair the channel, or repeat the recording",
        .run + 1
    )]
    NotNumbers { run: usize, channel: Channel, missing: usize, all: usize },
    #[error("recording {}: {source}", .run + 1)]
    Implausible { run: usize, source: Implausible },
    #[error("recording {}: its inputs cannot drive the model: {source}", .run + 1)]
    Inputs { run: usize, source: InputsError },
    #[error(
        "no segment of the recordings can be compared with the model: readings are missing or not numbers, or all points lie at the surge line. Check the channels, their units, and the machine of the campaign"
    )]
    NothingComparable,
    #[error(
        "the nominal model cannot follow recording {}: {source}. Check that it is a recording of the campaign's machine",
        .run + 1
    )]
    Drive { run: usize, source: mapper_physics::simulation::driven::DriveError },
    #[error("the readings cannot be compared with the model: {0}")]
    Unsolvable(#[from] Unsolvable),
}

/// Why the statistics have no solution.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Unsolvable {
    /// A covariance is not positive definite.
    #[error("the declared noise of a channel is 0 or not a number; declare its noise")]
    NoNoise,
    #[error("a reading, or the model's response to a parameter, is not finite")]
    NotFinite,
    #[error("constants of the campaign are not independent")]
    Dependent,
    #[error("no cause of drift changes a recorded channel")]
    NothingShows,
    #[error("{cause} does not change any recorded channel")]
    Hidden { cause: Cause },
}

fn symbols(channels: &[Channel]) -> String {
    channels.iter().map(|channel| channel.symbol()).collect::<Vec<_>>().join(", ")
}

/// Lengths of the segments of a step: from 5 s after a jump on, increasing. Bound: probes have settled, and a segment is shorter
/// than what still changes in it.
pub(crate) const SEGMENTS: Schedule = Schedule {
    first_s: 5.0,
    lengths_s: &[(15.0, 10.0), (35.0, 20.0), (95.0, 30.0), (f64::INFINITY, 60.0)],
    shortest_s: 5.0,
    shortest_ratio: 0.0,
};

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

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Segment {
    /// Position of its step among all steps.
    pub step: usize,
    /// Run time, s.
    pub start_s: f64,
    pub end_s: f64,
}

impl Segment {
    pub(crate) fn length_s(&self) -> f64 {
        self.end_s - self.start_s
    }
}

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

/// Channels that the diagnosis needs.
const NEEDED: [Channel; 4] = [Channel::ShaftSpeed, Channel::P2, Channel::T2, Channel::T1];

/// Checks the inputs and the compared channels within the steps. `lost_ratio`: maximum share of readings that are not numbers.
pub(crate) fn usable(run: usize, recording: &Recording, lost_ratio: f64) -> Result<(), DriftError> {
    let channels: Vec<Channel> =
        NEEDED.into_iter().filter(|channel| recording.require(*channel).is_err()).collect();
    if !channels.is_empty() {
        return Err(DriftError::MissingChannels { run, channels });
    }
    let (Some(first), Some(last)) = (recording.steps.first(), recording.steps.last()) else {
        return Err(DriftError::NoSteps { run });
    };
    for channel in INPUT_CHANNELS.into_iter().chain(OUTPUTS) {
        let Some(series) = recording.series.get(&channel) else { continue };
        let values = series.slice(first.start_s, last.end_s).1;
        let finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        let (missing, all) = (values.len() - finite.len(), values.len());
        if missing as f64 > lost_ratio * all as f64 {
            return Err(DriftError::NotNumbers { run, channel, missing, all });
        }
        if let Some(middle) = median(&finite) {
            check_running(channel, middle).map_err(|source| DriftError::Implausible { run, source })?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(end_s: f64, valve_opening_ratio: f64) -> CampaignStep {
        CampaignStep {
            run: 0,
            index: 0,
            start_s: 0.0,
            end_s,
            offset_s: 0.0,
            condition: 0,
            from: None,
            valve_opening_ratio,
            p3_pa: 2e5,
        }
    }

    #[test]
    fn a_log_without_a_valve_and_one_with_a_wrong_time_are_refused_by_name() {
        let message = |steps: &[CampaignStep]| refusal(&[], steps, &[]).unwrap();
        assert!(message(&[step(60.0, f64::NAN)]).contains("`valve_command`"));
        // The last step reaches to a time of 1e9 s; or many steps together last for years.
        assert!(message(&[step(60.0, 0.7), step(1e9, 0.7)]).contains("lasts 277777.8 h"));
        assert!(message(&vec![step(8e4, 0.7); 100]).contains("2222.2 h in total"));
        assert!(message(&[step(60.0, 0.7)]).contains("no repeats"));
    }
}
