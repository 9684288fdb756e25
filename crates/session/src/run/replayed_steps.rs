//! Resumes a run whose steps depend on measured data, by replaying the recorded data to the step source.
//!
//! The source sees one continuous time over all parts of the run. It makes the same steps as before, because it gets the same calls; each step is
//! compared with the recorded one.

use crate::SessionError;
use crate::recording::resume::{FIRST_REPEAT_INDEX, InterruptedRun};
use mapper_core::{
    ChannelColumn, ElementColumn, Event, PlanStep, Recording, RunEnding, SampleBatch, Series, StepKind,
    StepMarker, step_number,
};
use mapper_recording::{ChannelMap, ReadOptions, read_recording};
use mapper_runner::{RunError, StepSource, StepSourceError};

/// Length of a replayed batch, s, as in the original polls.
const BATCH_S: f64 = 1.0;
/// Gap between two parts of a run in the source's time, s.
const PART_GAP_S: f64 = 1.0;
/// Half the time resolution of a recording, plus the rounding error of summed sample times, s.
const TIME_TOLERANCE_S: f64 = 1e-6;
/// Relative tolerance for equal targets: the resolution of a recording.
const TARGET_TOLERANCE_RATIO: f64 = 1e-9;

struct ResumedSteps<'a> {
    inner: &'a mut dyn StepSource,
    repeat: Option<PlanStep>,
    repeating: bool,
    /// Offset from run time to the source's time, s.
    offset_s: f64,
    notes: Vec<String>,
}

/// Runs the steps with `drive`. With an interrupted run, its recorded data are replayed to the steps first.
pub(crate) fn drive_resumed(
    interrupted: Option<&InterruptedRun>,
    steps: &mut dyn StepSource,
    drive: impl FnOnce(&mut dyn StepSource) -> Result<RunEnding, RunError>,
) -> Result<RunEnding, RunError> {
    let Some(interrupted) = interrupted else { return drive(steps) };
    let mut resumed = ResumedSteps::replay(interrupted, steps).map_err(StepSourceError::new)?;
    drive(&mut resumed)
}

impl<'a> ResumedSteps<'a> {
    fn replay(interrupted: &InterruptedRun, inner: &'a mut dyn StepSource) -> Result<Self, SessionError> {
        let mut replay = Replay { inner, interrupted, offset_s: 0.0, last: None, replayed_steps: 0 };
        for part in &interrupted.parts {
            let path = interrupted.directory.join(&part.recording);
            let is_saved = |index: usize| index < FIRST_REPEAT_INDEX && part.saved.contains(&index);
            if !part.saved.iter().any(|index| is_saved(*index)) {
                continue;
            }
            let read = read_recording(&path, &ChannelMap::native(), &ReadOptions::default())?;
            let steps: Vec<StepMarker> =
                read.recording.steps.iter().filter(|step| is_saved(step.index)).copied().collect();
            replay.replay_part(read.recording, &steps)?;
        }
        let Replay { inner, offset_s, last, replayed_steps, .. } = replay;
        // These notes are already in the recordings.
        inner.take_notes();
        let repeat = last.map(|last: PlanStep| PlanStep {
            index: FIRST_REPEAT_INDEX + interrupted.parts.len(),
            kind: StepKind::Repeat,
            from: None,
            ..last
        });
        let note = format!(
            "resumed: {} recorded steps are kept and were replayed to the source of the steps; {}{}the housings are warmed up again, because they \
             may have cooled{}",
            replayed_steps,
            interrupted.lost_text().map(|lost| format!("lost and run again: {lost}; ")).unwrap_or_default(),
            if interrupted.has_soak() { "the soak is not repeated; " } else { "" },
            if repeat.is_some() { ", and the last recorded step is repeated" } else { "" },
        );
        Ok(ResumedSteps { inner, repeat, repeating: false, offset_s, notes: vec![note] })
    }
}

fn shift(marker: &StepMarker, offset_s: f64) -> StepMarker {
    StepMarker { start_s: marker.start_s + offset_s, end_s: marker.end_s + offset_s, ..*marker }
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

    fn before_step(&mut self, marker: &StepMarker) {
        if !self.repeating {
            self.inner.before_step(&shift(marker, self.offset_s));
        }
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        let mut shifted = batch.clone();
        shifted.t_s.iter_mut().for_each(|t_s| *t_s += self.offset_s);
        shifted.events.iter_mut().for_each(|event| event.t_s += self.offset_s);
        let ends = self.inner.on_batch(&shifted);
        ends && !self.repeating
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        if self.repeating { Ok(()) } else { self.inner.after_step(&shift(marker, self.offset_s)) }
    }

    fn after_skipped_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        if self.repeating { Ok(()) } else { self.inner.after_skipped_step(&shift(marker, self.offset_s)) }
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.inner.take_notes());
        notes
    }
}

struct Replay<'a, 'b> {
    inner: &'a mut dyn StepSource,
    interrupted: &'b InterruptedRun,
    offset_s: f64,
    last: Option<PlanStep>,
    replayed_steps: usize,
}

impl Replay<'_, '_> {
    fn replay_part(&mut self, recording: Recording, steps: &[StepMarker]) -> Result<(), SessionError> {
        let mut batches = BatchReplay::new(recording, self.offset_s);
        for step in steps {
            let shifted = shift(step, self.offset_s);
            // Before the first step, the source has already handed out its step, as in the original run.
            self.advance_to(&shifted)?;
            batches.replay_until(self.inner, shifted.start_s);
            self.inner.before_step(&shifted);
            batches.replay_until(self.inner, shifted.end_s);
            self.inner.after_step(&shifted).map_err(|error| self.mismatch(error.to_string()))?;
            self.replayed_steps += 1;
        }
        if let Some(last) = steps.last() {
            self.offset_s += last.end_s + PART_GAP_S;
        }
        Ok(())
    }

    /// Advances the source to the recorded step. Steps before it were skipped by a guard, and are skipped again.
    fn advance_to(&mut self, recorded: &StepMarker) -> Result<(), SessionError> {
        loop {
            let next = self.inner.next_step().map_err(|error| self.mismatch(error.to_string()))?;
            let Some(next) = next else {
                return Err(self.mismatch(format!("step {} no longer exists", step_number(recorded.index))));
            };
            if next.index < recorded.index {
                let skipped_step = StepMarker {
                    index: next.index,
                    kind: next.kind,
                    from: next.from,
                    to: Some(next.to),
                    end_s: recorded.start_s,
                    ..*recorded
                };
                self.inner.before_step(&skipped_step);
                self.inner
                    .after_skipped_step(&skipped_step)
                    .map_err(|error| self.mismatch(error.to_string()))?;
                continue;
            }
            let near = |a: f64, b: f64| (a - b).abs() <= TARGET_TOLERANCE_RATIO * a.abs().max(b.abs());
            let same = next.index == recorded.index
                && next.kind == recorded.kind
                && recorded.to.is_some_and(|to| {
                    near(to.speed_rpm, next.to.speed_rpm)
                        && near(to.valve_opening_ratio, next.to.valve_opening_ratio)
                });
            if !same {
                let to = recorded.to.unwrap_or(next.to);
                return Err(self.mismatch(format!(
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

    fn mismatch(&self, difference: String) -> SessionError {
        let why = format!(
            "replaying the recorded data gives other steps: {difference}; identify the recorded steps instead"
        );
        SessionError::NotResumable { run: self.interrupted.directory.clone(), why }
    }
}

struct BatchReplay {
    recording: Recording,
    t_s: Vec<f64>,
    cursors: Vec<usize>,
    replayed_samples: usize,
    replayed_events: usize,
    until_s: f64,
}

impl BatchReplay {
    fn new(mut recording: Recording, offset_s: f64) -> Self {
        let series = recording.series.values_mut().chain(recording.elements.values_mut());
        for t_s in series.flat_map(|series| &mut series.t_s) {
            *t_s += offset_s;
        }
        recording.events.iter_mut().for_each(|event| event.t_s += offset_s);
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
        BatchReplay { recording, t_s, cursors, replayed_samples: 0, replayed_events: 0, until_s: offset_s }
    }

    fn replay_until(&mut self, source: &mut dyn StepSource, until_s: f64) {
        while self.until_s < until_s {
            let batch_end_s = (self.until_s + BATCH_S).min(until_s);
            // A recording rounds times to whole nanoseconds.
            let end_s = batch_end_s + TIME_TOLERANCE_S;
            let to = self.t_s.partition_point(|t_s| *t_s <= end_s).max(self.replayed_samples);
            let t_s = self.t_s.get(self.replayed_samples..to).unwrap_or_default().to_vec();
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
            let events_to = self.recording.events.partition_point(due).max(self.replayed_events);
            let events =
                self.recording.events.get(self.replayed_events..events_to).unwrap_or_default().to_vec();
            let batch = SampleBatch {
                first_sequence: self.replayed_samples as u64,
                columns,
                elements,
                events,
                t_s,
                ..SampleBatch::default()
            };
            // The return value is not needed: the end of the step is already recorded.
            source.on_batch(&batch);
            (self.replayed_samples, self.replayed_events, self.until_s) = (to, events_to, batch_end_s);
        }
    }
}
