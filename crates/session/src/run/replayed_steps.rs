//! Resumes a run whose steps depend on measured data. The recorded data are replayed to the step source, which returns to its earlier state.
//!
//! The source sees one continuous time over all parts. Equal calls give equal steps, and each step is checked against the recorded one.

use crate::SessionError;
use crate::recording::resume::{AGAIN_FROM, BrokenOff};
use mapper_core::{
    ChannelColumn, ElementColumn, Event, PlanStep, Recording, SampleBatch, Series, StepKind, StepMarker,
    step_number,
};
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_runner::{RunEnd, RunError, StepSource, StepSourceError};

/// Length of a replayed batch, s, as in the original polls.
const PIECE_S: f64 = 1.0;
/// Gap between two parts of a run in the source's time, s.
const BETWEEN_S: f64 = 1.0;
/// Half the time resolution of a recording, plus the rounding error of summed sample times, s.
const ROUNDED_S: f64 = 1e-6;
/// Relative tolerance for equal targets: the resolution of a recording.
const SAME_RATIO: f64 = 1e-9;

/// A step source after replay, from the first missing step on.
struct ResumedSteps<'a> {
    inner: &'a mut dyn StepSource,
    /// The step that is repeated.
    repeat: Option<PlanStep>,
    repeating: bool,
    /// Offset from run time to the source's time, s.
    later_s: f64,
    notes: Vec<String>,
}

/// Runs the steps; those of an interrupted run continue from its last state.
pub(crate) fn going_on(
    broken_off: Option<&BrokenOff>,
    steps: &mut dyn StepSource,
    drive: impl FnOnce(&mut dyn StepSource) -> Result<RunEnd, RunError>,
) -> Result<RunEnd, RunError> {
    let Some(broken_off) = broken_off else { return drive(steps) };
    let mut goes_on = ResumedSteps::after(broken_off, steps).map_err(StepSourceError::of)?;
    drive(&mut goes_on)
}

impl<'a> ResumedSteps<'a> {
    /// Replays the measured data of an interrupted run to `inner`.
    ///
    /// # Errors
    /// [`SessionError::NotResumable`] if the source now yields another step than the recorded one; otherwise read errors.
    fn after(broken_off: &BrokenOff, inner: &'a mut dyn StepSource) -> Result<Self, SessionError> {
        let mut replay = Replay { inner, broken_off, later_s: 0.0, last: None, replayed_steps: 0 };
        for part in &broken_off.parts {
            let path = broken_off.directory.join(&part.recording);
            let holds = |index: usize| index < AGAIN_FROM && part.saved.contains(&index);
            if !part.saved.iter().any(|index| holds(*index)) {
                continue;
            }
            let read = read_recording(&path, &ChannelMap::native(), &ReadOptions::default())?;
            let steps: Vec<StepMarker> =
                read.recording.steps.iter().filter(|step| holds(step.index)).copied().collect();
            replay.part(read.recording, &steps)?;
        }
        let Replay { inner, later_s, last, replayed_steps, .. } = replay;
        // These notes are already in the recordings.
        inner.take_notes();
        let repeat = last.map(|last: PlanStep| PlanStep {
            index: AGAIN_FROM + broken_off.parts.len(),
            kind: StepKind::Repeat,
            from: None,
            ..last
        });
        let note = format!(
            "resumed: {} steps hold, and were replayed to the source of the steps; {}it is unknown how far the housings have cooled, so they \
             are warmed up again{}",
            replayed_steps,
            if broken_off.soaked() { "the soak is not repeated; " } else { "" },
            if repeat.is_some() { ", and the last step that holds is made once more" } else { "" },
        );
        Ok(ResumedSteps { inner, repeat, repeating: false, later_s, notes: vec![note] })
    }

    fn shifted(&self, marker: &StepMarker) -> StepMarker {
        StepMarker { start_s: marker.start_s + self.later_s, end_s: marker.end_s + self.later_s, ..*marker }
    }
}

impl StepSource for ResumedSteps<'_> {
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(self.inner)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(self.inner)
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        if let Some(repeat) = self.repeat.take() {
            self.repeating = true;
            return Ok(Some(repeat));
        }
        self.repeating = false;
        self.inner.next_step()
    }

    fn begins(&mut self, marker: &StepMarker) {
        if !self.repeating {
            let shifted = self.shifted(marker);
            self.inner.begins(&shifted);
        }
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        let mut shifted = batch.clone();
        shifted.t_s.iter_mut().for_each(|t_s| *t_s += self.later_s);
        shifted.events.iter_mut().for_each(|event| event.t_s += self.later_s);
        let ends = self.inner.on_batch(&shifted);
        ends && !self.repeating
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let shifted = self.shifted(marker);
        if self.repeating { Ok(()) } else { self.inner.after_step(&shifted) }
    }

    fn skipped(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let shifted = self.shifted(marker);
        if self.repeating { Ok(()) } else { self.inner.skipped(&shifted) }
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.inner.take_notes());
        notes
    }
}

/// A step source during replay.
struct Replay<'a, 'b> {
    inner: &'a mut dyn StepSource,
    broken_off: &'b BrokenOff,
    later_s: f64,
    last: Option<PlanStep>,
    replayed_steps: usize,
}

impl Replay<'_, '_> {
    fn part(&mut self, recording: Recording, steps: &[StepMarker]) -> Result<(), SessionError> {
        let mut pieces = Pieces::new(recording, self.later_s);
        for step in steps {
            let shifted = StepMarker {
                start_s: step.start_s + self.later_s,
                end_s: step.end_s + self.later_s,
                ..*step
            };
            // Before the first step, the source has already handed out its step, as in the original run.
            self.handed_out(&shifted)?;
            pieces.replay_until(self.inner, shifted.start_s);
            self.inner.begins(&shifted);
            pieces.replay_until(self.inner, shifted.end_s);
            self.inner.after_step(&shifted).map_err(|error| self.refused(error.to_string()))?;
            self.replayed_steps += 1;
        }
        if let Some(last) = steps.last() {
            self.later_s += last.end_s + BETWEEN_S;
        }
        Ok(())
    }

    /// Makes the source hand out the recorded step. Steps that a guard skipped come before it.
    fn handed_out(&mut self, recorded: &StepMarker) -> Result<(), SessionError> {
        loop {
            let next = self.inner.next_step().map_err(|error| self.refused(error.to_string()))?;
            let Some(next) = next else {
                return Err(
                    self.refused(format!("there is no step {} any more", step_number(recorded.index)))
                );
            };
            if next.index < recorded.index {
                let left_out = StepMarker {
                    index: next.index,
                    kind: next.kind,
                    from: next.from,
                    to: Some(next.to),
                    end_s: recorded.start_s,
                    ..*recorded
                };
                self.inner.begins(&left_out);
                self.inner.skipped(&left_out).map_err(|error| self.refused(error.to_string()))?;
                continue;
            }
            let near = |a: f64, b: f64| (a - b).abs() <= SAME_RATIO * a.abs().max(b.abs());
            let same = next.index == recorded.index
                && next.kind == recorded.kind
                && recorded.to.is_some_and(|to| {
                    near(to.speed_rpm, next.to.speed_rpm)
                        && near(to.valve_opening_ratio, next.to.valve_opening_ratio)
                });
            if !same {
                let to = recorded.to.unwrap_or(next.to);
                return Err(self.refused(format!(
                    "step {} led to {:.1} rpm at an opening of {:.4} and would now lead to {:.1} rpm at {:.4}",
                    step_number(recorded.index),
                    to.speed_rpm,
                    to.valve_opening_ratio,
                    next.to.speed_rpm,
                    next.to.valve_opening_ratio
                )));
            }
            // A point near surge is not a valid start for a jump.
            if next.kind != StepKind::Approach {
                self.last = Some(next);
            }
            return Ok(());
        }
    }

    fn refused(&self, what: String) -> SessionError {
        let why = format!(
            "from what was recorded its steps come out otherwise: {what}; `mapper identify` makes the map of what there is"
        );
        SessionError::NotResumable { run: self.broken_off.directory.clone(), why }
    }
}

/// A recording, divided into batches as in the original run.
struct Pieces {
    /// The recording in the source's time.
    recording: Recording,
    /// Times of all channels.
    t_s: Vec<f64>,
    /// Read position in each series.
    cursors: Vec<usize>,
    /// Number of replayed samples and events.
    done: usize,
    events_done: usize,
    until_s: f64,
}

impl Pieces {
    fn new(mut recording: Recording, later_s: f64) -> Self {
        let series = recording.series.values_mut().chain(recording.elements.values_mut());
        for t_s in series.flat_map(|series| &mut series.t_s) {
            *t_s += later_s;
        }
        recording.events.iter_mut().for_each(|event| event.t_s += later_s);
        // Most channels are sampled together.
        let mut clocks: Vec<&[f64]> = Vec::new();
        for series in recording.series.values().chain(recording.elements.values()) {
            if !clocks.contains(&series.t_s.as_slice()) {
                clocks.push(&series.t_s);
            }
        }
        let mut t_s = clocks.concat();
        t_s.sort_by(f64::total_cmp);
        t_s.dedup();
        let cursors = vec![0; recording.series.len() + recording.elements.len()];
        Pieces { recording, t_s, cursors, done: 0, events_done: 0, until_s: later_s }
    }

    /// Replays all data up to a time, in batches of one second.
    fn replay_until(&mut self, source: &mut dyn StepSource, until_s: f64) {
        while self.until_s < until_s {
            let piece_s = (self.until_s + PIECE_S).min(until_s);
            // A recording rounds times to whole nanoseconds.
            let end_s = piece_s + ROUNDED_S;
            let to = self.t_s.partition_point(|t_s| *t_s <= end_s).max(self.done);
            let t_s = self.t_s.get(self.done..to).unwrap_or_default().to_vec();
            // Passes through each series once for all batches.
            let values = |(series, at): (&Series, &mut usize)| -> Vec<f64> {
                let value = |t_s: &f64| {
                    while series.t_s.get(*at).is_some_and(|own_s| own_s < t_s) {
                        *at += 1;
                    }
                    let here = series.t_s.get(*at) == Some(t_s);
                    series.values.get(*at).copied().filter(|_| here).unwrap_or(f64::NAN)
                };
                t_s.iter().map(value).collect()
            };
            let mut cursors = self.cursors.iter_mut();
            let columns = self.recording.series.iter().zip(cursors.by_ref());
            let columns = columns.map(|((channel, series), at)| ChannelColumn {
                channel: *channel,
                values: values((series, at)),
            });
            let columns = columns.collect();
            let elements = self.recording.elements.iter().zip(cursors);
            let elements = elements.map(|((element, series), at)| ElementColumn {
                element: *element,
                values: values((series, at)),
            });
            let elements = elements.collect();
            let due = |event: &Event| event.t_s <= end_s;
            let events_to = self.recording.events.partition_point(due).max(self.events_done);
            let events = self.recording.events.get(self.events_done..events_to).unwrap_or_default().to_vec();
            let batch = SampleBatch {
                first_sequence: self.done as u64,
                columns,
                elements,
                events,
                t_s,
                ..SampleBatch::default()
            };
            // The return value is not needed: the end of the step is already recorded.
            source.on_batch(&batch);
            (self.done, self.events_done, self.until_s) = (to, events_to, piece_s);
        }
    }
}
