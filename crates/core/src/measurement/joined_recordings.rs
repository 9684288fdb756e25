//! Several recordings of one machine as one: steps at the same point follow each other, times continue.

use crate::measurement::jump::{HeldPoint, StepPoint};
use crate::{
    ChannelColumn, Element, ElementColumn, Provenance, Quality, Recording, SampleBatch, Series, StepKind,
    StepMarker, TruthColumn,
};
use std::collections::BTreeMap;

/// Time between two joined recordings, s. Bound: much longer than the thermal time constant of any housing, so that the last step of one
/// recording does not count as the start of the first jump of the next.
const RECORDING_GAP_S: f64 = 3600.0;

/// Origin of a step of a joined recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepOrigin {
    /// Number of the recording, from 0.
    pub recording: usize,
    /// Index of the step in its recording.
    pub step: usize,
}

/// Joins recordings in the given order; a single one stays unchanged. Times and step indices continue from recording to recording. Steps at a
/// point of an earlier recording become repeats if the same jump led to it, and returns otherwise, so that each point is on the map once. Points
/// are compared by target, by command, or by measurement if neither is known. Also returns the origin of each step, in order.
pub fn join_recordings(recordings: Vec<Recording>) -> (Recording, Vec<StepOrigin>) {
    let alone = recordings.len() < 2;
    let mut joined = Recording::default();
    let mut origins = Vec::new();
    // The point of each step, and the measured one before it, if only measurements identify the points.
    let mut step_points: Vec<StepPoints> = Vec::new();
    for (number, mut recording) in recordings.into_iter().enumerate() {
        origins.extend(recording.steps.iter().map(|step| StepOrigin { recording: number, step: step.index }));
        if alone {
            return (recording, origins);
        }
        let shift_s = end_s(&joined).map_or(0.0, |end_s| end_s + RECORDING_GAP_S) - start_s(&recording);
        let before = joined.steps.len();
        let points: Vec<StepPoint> =
            recording.steps.iter().map(|step| StepPoint::of(&recording, step)).collect();
        let from = std::iter::once(None).chain(points.iter().map(|point| point.held));
        step_points.extend(points.iter().copied().zip(from));
        for (step, own_points) in recording.steps.iter_mut().zip(step_points[before..].to_vec()) {
            step.kind = kind((step, own_points), &joined.steps[..before], &step_points);
            step.index = joined.steps.len();
            step.start_s += shift_s;
            step.end_s += shift_s;
            joined.steps.push(*step);
        }
        recording.events.iter_mut().for_each(|event| event.t_s += shift_s);
        joined.events.append(&mut recording.events);
        append(&mut joined.series, recording.series, shift_s);
        append::<Element>(&mut joined.elements, recording.elements, shift_s);
    }
    (joined, origins)
}

fn append<K: Ord>(joined: &mut BTreeMap<K, Series>, more: BTreeMap<K, Series>, shift_s: f64) {
    for (key, mut series) in more {
        let together = joined.entry(key).or_default();
        together.t_s.extend(series.t_s.iter().map(|t_s| t_s + shift_s));
        together.values.append(&mut series.values);
    }
}

/// The point of a step, and the measured point of the step before it.
type StepPoints = (StepPoint, Option<HeldPoint>);

fn kind(
    (step, (point, before)): (&StepMarker, StepPoints),
    earlier: &[StepMarker],
    earlier_points: &[StepPoints],
) -> StepKind {
    let same = |a: Option<HeldPoint>, b: Option<HeldPoint>| match (a, b) {
        (Some(a), Some(b)) => a.is_same(&b),
        (None, None) => true,
        _ => false,
    };
    let at_the_point = |(_, (other, _)): &(&StepMarker, &StepPoints)| point.is_same(other);
    // A repeat serves only for comparison: the point itself may come later, by another jump.
    let mut same_points = earlier
        .iter()
        .zip(earlier_points)
        .filter(|(other, _)| other.kind.measures())
        .filter(at_the_point)
        .peekable();
    if step.kind != StepKind::Point || same_points.peek().is_none() {
        return step.kind;
    }
    let has_same_jump = |(other, (_, other_before)): (&StepMarker, &StepPoints)| {
        other.from == step.from && same(before, *other_before)
    };
    if same_points.any(has_same_jump) { StepKind::Repeat } else { StepKind::Return }
}

fn all(recording: &Recording) -> impl Iterator<Item = &Series> {
    recording.series.values().chain(recording.elements.values())
}

fn start_s(recording: &Recording) -> f64 {
    all(recording).filter_map(|series| series.t_s.first().copied()).reduce(f64::min).unwrap_or(0.0)
}

fn end_s(recording: &Recording) -> Option<f64> {
    all(recording).filter_map(|series| series.t_s.last().copied()).reduce(f64::max)
}

impl SampleBatch {
    /// Appends the samples and events of `more`. A column that only one of them has is NaN in the other.
    pub fn append(&mut self, more: SampleBatch) {
        let before = self.t_s.len();
        let after = before + more.t_s.len();
        if before == 0 && after > 0 {
            self.first_sequence = more.first_sequence;
        }
        let missing = |values: Vec<f64>| -> Vec<f64> {
            let mut all = vec![f64::NAN; before];
            all.extend(values);
            all
        };
        for column in more.columns {
            match self.columns.iter_mut().find(|known| known.channel == column.channel) {
                Some(known) => known.values.extend(column.values),
                None => self.columns.push(ChannelColumn { values: missing(column.values), ..column }),
            }
        }
        for column in more.elements {
            match self.elements.iter_mut().find(|known| known.element == column.element) {
                Some(known) => known.values.extend(column.values),
                None => self.elements.push(ElementColumn { values: missing(column.values), ..column }),
            }
        }
        for column in more.truth {
            match self.truth.iter_mut().find(|known| known.name == column.name) {
                Some(known) => known.values.extend(column.values),
                None => self.truth.push(TruthColumn { values: missing(column.values), ..column }),
            }
        }
        for from in more.provenance {
            let known = match self.provenance.iter_mut().position(|known| known.channel == from.channel) {
                Some(known) => known,
                None => {
                    let (source_t_s, quality) = (self.t_s.clone(), vec![Quality::Good; before]);
                    self.provenance.push(Provenance { channel: from.channel, source_t_s, quality });
                    self.provenance.len() - 1
                }
            };
            if let Some(known) = self.provenance.get_mut(known) {
                known.source_t_s.extend(from.source_t_s);
                known.quality.extend(from.quality);
            }
        }
        self.t_s.extend(more.t_s);
        self.events.extend(more.events);
        self.fast.extend(more.fast);
        for from in &mut self.provenance {
            // A sample without source time was taken when it arrived.
            let known = from.source_t_s.len().min(after);
            from.source_t_s.extend(self.t_s.get(known..).unwrap_or_default());
            from.quality.resize(after, Quality::Good);
        }
        let columns = self.columns.iter_mut().map(|column| &mut column.values);
        let elements = self.elements.iter_mut().map(|column| &mut column.values);
        let truth = self.truth.iter_mut().map(|column| &mut column.values);
        columns.chain(elements).chain(truth).for_each(|values| values.resize(after, f64::NAN));
    }

    /// Splits off and returns the samples after the first `at`. Events and fast samples stay.
    pub fn split_off(&mut self, at: usize) -> SampleBatch {
        fn cut<T>(values: &mut Vec<T>, at: usize) -> Vec<T> {
            values.split_off(at.min(values.len()))
        }
        SampleBatch {
            first_sequence: self.first_sequence + at as u64,
            t_s: cut(&mut self.t_s, at),
            columns: self
                .columns
                .iter_mut()
                .map(|column| ChannelColumn { channel: column.channel, values: cut(&mut column.values, at) })
                .collect(),
            elements: self
                .elements
                .iter_mut()
                .map(|column| ElementColumn { element: column.element, values: cut(&mut column.values, at) })
                .collect(),
            provenance: self
                .provenance
                .iter_mut()
                .map(|column| Provenance {
                    channel: column.channel,
                    source_t_s: cut(&mut column.source_t_s, at),
                    quality: cut(&mut column.quality, at),
                })
                .collect(),
            truth: self
                .truth
                .iter_mut()
                .map(|column| TruthColumn {
                    name: column.name.clone(),
                    unit: column.unit.clone(),
                    values: cut(&mut column.values, at),
                })
                .collect(),
            events: Vec::new(),
            fast: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Channel, OperatingPoint};

    fn at(speed_rpm: f64) -> Option<OperatingPoint> {
        Some(OperatingPoint { speed_rpm, valve_opening_ratio: 0.7 })
    }

    fn recording(start_s: f64, jumps: &[(Option<OperatingPoint>, Option<OperatingPoint>)]) -> Recording {
        let steps = jumps.iter().enumerate().map(|(index, (from, to))| StepMarker {
            index,
            kind: StepKind::Point,
            start_s: start_s + 10.0 * index as f64,
            end_s: start_s + 10.0 * (index + 1) as f64,
            from: *from,
            to: *to,
            p3_pa: 2e5,
            valve_opening_ratio: 0.7,
        });
        let t_s: Vec<f64> = (0..=10 * jumps.len()).map(|t| start_s + t as f64).collect();
        let values = vec![1.0; t_s.len()];
        Recording {
            series: [(Channel::T2, Series { t_s, values })].into(),
            steps: steps.collect(),
            ..Recording::default()
        }
    }

    #[test]
    fn a_repeat_leaves_its_point_to_be_measured() {
        let mut first = recording(0.0, &[(None, at(5e4)), (at(5e4), at(9e4))]);
        first.steps[1].kind = StepKind::Repeat;
        let second = recording(700.0, &[(None, at(7e4)), (at(7e4), at(9e4))]);
        let (joined, _) = join_recordings(vec![first, second]);
        assert_eq!(joined.steps[3].kind, StepKind::Point);
    }

    #[test]
    fn what_was_visited_before_is_no_new_point() {
        let first = recording(0.0, &[(None, at(5e4)), (at(5e4), at(9e4))]);
        let second = recording(700.0, &[(None, at(7e4)), (at(5e4), at(9e4)), (at(9e4), at(5e4))]);
        let (joined, origins) = join_recordings(vec![first, second]);
        let kinds: Vec<_> = joined.steps.iter().map(|step| step.kind).collect();
        use StepKind::{Point, Repeat, Return};
        assert_eq!(kinds, [Point, Point, Point, Repeat, Return]);
        assert_eq!(origins[3], StepOrigin { recording: 1, step: 1 });
        let t2 = &joined.series[&Channel::T2];
        assert!(t2.t_s.is_sorted_by(|a, b| a < b), "times rise");
        // Each step keeps its samples.
        for step in &joined.steps {
            assert_eq!(t2.slice(step.start_s, step.end_s).0.len(), 11);
        }
        assert!(joined.steps[2].start_s - joined.steps[1].end_s >= RECORDING_GAP_S);
    }

    /// Speeds and flows that were held for 100 s each, without commands.
    fn measured(points: &[(f64, f64)]) -> Recording {
        let t_s: Vec<f64> = (0..100 * points.len()).map(|t| t as f64).collect();
        let held = |pick: fn(&(f64, f64)) -> f64| Series {
            t_s: t_s.clone(),
            values: t_s.iter().map(|t_s| pick(&points[*t_s as usize / 100])).collect(),
        };
        let step = |index: usize| StepMarker {
            index,
            kind: StepKind::Point,
            start_s: 100.0 * index as f64,
            end_s: 100.0 * index as f64 + 99.0,
            from: None,
            to: None,
            p3_pa: f64::NAN,
            valve_opening_ratio: f64::NAN,
        };
        Recording {
            series: [
                (Channel::ShaftSpeed, held(|point| point.0)),
                (Channel::CompressorFlow, held(|point| point.1)),
            ]
            .into(),
            steps: (0..points.len()).map(step).collect(),
            ..Recording::default()
        }
    }

    #[test]
    fn without_commands_what_was_measured_says_where_a_step_was() {
        let first = measured(&[(6e4, 0.03), (9e4, 0.05), (9e4, 0.04)]);
        // Set by hand: the same jump, the first point of the first run by another jump, and a new point.
        let second = measured(&[(6.02e4, 0.0301), (9.03e4, 0.0496), (6e4, 0.03), (9e4, 0.045)]);
        let (joined, _) = join_recordings(vec![first, second]);
        let kinds: Vec<_> = joined.steps[3..].iter().map(|step| step.kind).collect();
        use StepKind::{Point, Repeat, Return};
        assert_eq!(kinds, [Repeat, Repeat, Return, Point]);
    }

    #[test]
    fn one_recording_stays_as_it_is() {
        let only = recording(3.0, &[(None, None), (None, None)]);
        assert_eq!(join_recordings(vec![only.clone()]).0, only);
    }

    #[test]
    fn pieces_become_the_whole_and_what_is_missing_is_nan() {
        let piece = |first: u64, t_s: &[f64], columns: &[(Channel, &[f64])]| SampleBatch {
            first_sequence: first,
            t_s: t_s.to_vec(),
            columns: columns
                .iter()
                .map(|(channel, values)| ChannelColumn { channel: *channel, values: values.to_vec() })
                .collect(),
            ..SampleBatch::default()
        };
        let mut whole = piece(0, &[], &[]);
        whole.append(piece(0, &[0.0, 0.1], &[(Channel::T2, &[1.0, 2.0]), (Channel::P2, &[5.0, 6.0])]));
        whole.append(piece(2, &[0.2], &[(Channel::P2, &[7.0]), (Channel::T1, &[9.0])]));
        assert_eq!(whole.t_s, [0.0, 0.1, 0.2]);
        assert_eq!(whole.column(Channel::P2).unwrap(), [5.0, 6.0, 7.0]);
        assert_eq!(whole.column(Channel::T2).unwrap()[..2], [1.0, 2.0]);
        assert!(whole.column(Channel::T2).unwrap()[2].is_nan());
        let t1 = whole.column(Channel::T1).unwrap();
        assert!(t1[0].is_nan() && t1[1].is_nan() && t1[2] == 9.0);
    }

    #[test]
    fn what_is_cut_and_appended_again_is_the_same() {
        let whole = SampleBatch {
            first_sequence: 7,
            t_s: vec![0.0, 0.1, 0.2],
            columns: vec![ChannelColumn { channel: Channel::T2, values: vec![1.0, 2.0, 3.0] }],
            provenance: vec![Provenance {
                channel: Channel::T2,
                source_t_s: vec![0.0, 0.0, 0.1],
                quality: vec![Quality::Good, Quality::Bad, Quality::Good],
            }],
            ..SampleBatch::default()
        };
        for at in 0..=3 {
            let mut first = whole.clone();
            let rest = first.split_off(at);
            assert_eq!((first.t_s.len(), rest.first_sequence), (at, 7 + at as u64));
            first.append(rest);
            assert_eq!(first, whole, "cut after {at}");
        }
    }
}
