//! A run that goes on although its steps depend on all that was measured: what was recorded is told to the source of the steps once
//! more, which then stands where it stood.
//!
//! The source sees one time that goes on over all parts. Equal calls, equal steps: each is held against the recorded one.

use crate::SessionError;
use crate::resume::{AGAIN_FROM, BrokenOff};
use mapper_core::{
    ChannelColumn, ElementColumn, Event, PlanStep, Recording, SampleBatch, Series, StepKind, StepMarker,
    step_number,
};
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use mapper_runner::{RunEnd, RunError, StepSource, StepSourceError};

/// What was read is told in pieces of so long, s, as it was polled.
const PIECE_S: f64 = 1.0;
/// Between two parts of a run, in the time that the source sees, s.
const BETWEEN_S: f64 = 1.0;
/// Half of what a recording rounds times to, and what sums of sample times are off, s.
const ROUNDED_S: f64 = 1e-6;
/// Targets that differ by less are the same, ratio: what a recording keeps of them.
const SAME_RATIO: f64 = 1e-9;

/// The steps of a source that has been told what there is, from the first missing one on.
struct GoesOn<'a> {
    inner: &'a mut dyn StepSource,
    /// The step that is made once more.
    again: Option<PlanStep>,
    making_again: bool,
    /// What the source sees of run time is later by this, s.
    later_s: f64,
    notes: Vec<String>,
}

/// Drives the steps; those of a broken-off run from where they stood.
pub(crate) fn going_on(
    broken_off: Option<&BrokenOff>,
    steps: &mut dyn StepSource,
    drive: impl FnOnce(&mut dyn StepSource) -> Result<RunEnd, RunError>,
) -> Result<RunEnd, RunError> {
    let Some(broken_off) = broken_off else { return drive(steps) };
    let mut goes_on = GoesOn::after(broken_off, steps).map_err(StepSourceError::of)?;
    drive(&mut goes_on)
}

impl<'a> GoesOn<'a> {
    /// Tells `inner` what the parts of a broken-off run have measured.
    ///
    /// # Errors
    /// [`SessionError::NotResumable`] where the source now yields another step than was recorded; what reading says.
    fn after(broken_off: &BrokenOff, inner: &'a mut dyn StepSource) -> Result<Self, SessionError> {
        let mut told = Told { inner, broken_off, later_s: 0.0, last: None, held: 0 };
        for part in &broken_off.parts {
            let path = broken_off.directory.join(&part.recording);
            let holds = |index: usize| index < AGAIN_FROM && part.saved.contains(&index);
            if !part.saved.iter().any(|index| holds(*index)) {
                continue;
            }
            let read = read_recording(&path, &ChannelMap::native(), &ReadOptions::default())?;
            let steps: Vec<StepMarker> =
                read.recording.steps.iter().filter(|step| holds(step.index)).copied().collect();
            told.part(read.recording, &steps)?;
        }
        let Told { inner, later_s, last, held, .. } = told;
        // What was said then stands in the recordings.
        inner.take_notes();
        let again = last.map(|last: PlanStep| PlanStep {
            index: AGAIN_FROM + broken_off.parts.len(),
            kind: StepKind::Repeat,
            from: None,
            ..last
        });
        let said = format!(
            "resumed: {} steps hold, and were told to the source of the steps again; {}nobody knows how far the housings have cooled, so they \
             are warmed up again{}",
            held,
            if broken_off.soaked() { "the soak is not repeated; " } else { "" },
            if again.is_some() { ", and the last step that holds is made once more" } else { "" },
        );
        Ok(GoesOn { inner, again, making_again: false, later_s, notes: vec![said] })
    }

    fn seen(&self, marker: &StepMarker) -> StepMarker {
        StepMarker { start_s: marker.start_s + self.later_s, end_s: marker.end_s + self.later_s, ..*marker }
    }
}

impl StepSource for GoesOn<'_> {
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(self.inner)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(self.inner)
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        if let Some(again) = self.again.take() {
            self.making_again = true;
            return Ok(Some(again));
        }
        self.making_again = false;
        self.inner.next_step()
    }

    fn begins(&mut self, marker: &StepMarker) {
        if !self.making_again {
            let seen = self.seen(marker);
            self.inner.begins(&seen);
        }
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        let mut seen = batch.clone();
        seen.t_s.iter_mut().for_each(|t_s| *t_s += self.later_s);
        seen.events.iter_mut().for_each(|event| event.t_s += self.later_s);
        let ends = self.inner.on_batch(&seen);
        ends && !self.making_again
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let seen = self.seen(marker);
        if self.making_again { Ok(()) } else { self.inner.after_step(&seen) }
    }

    fn skipped(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let seen = self.seen(marker);
        if self.making_again { Ok(()) } else { self.inner.skipped(&seen) }
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.inner.take_notes());
        notes
    }
}

/// A source that is being told.
struct Told<'a, 'b> {
    inner: &'a mut dyn StepSource,
    broken_off: &'b BrokenOff,
    later_s: f64,
    last: Option<PlanStep>,
    held: usize,
}

impl Told<'_, '_> {
    fn part(&mut self, recording: Recording, steps: &[StepMarker]) -> Result<(), SessionError> {
        let mut pieces = Pieces::new(recording, self.later_s);
        for step in steps {
            let seen = StepMarker {
                start_s: step.start_s + self.later_s,
                end_s: step.end_s + self.later_s,
                ..*step
            };
            // Before the first step the source has it handed out already, as in the run.
            self.handed_out(&seen)?;
            pieces.tell(self.inner, seen.start_s);
            self.inner.begins(&seen);
            pieces.tell(self.inner, seen.end_s);
            self.inner.after_step(&seen).map_err(|error| self.refused(error.to_string()))?;
            self.held += 1;
        }
        if let Some(last) = steps.last() {
            self.later_s += last.end_s + BETWEEN_S;
        }
        Ok(())
    }

    /// Has the source hand out the step that was recorded; those that a guard had left out come before it.
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
            // What stands near surge is no place to come from.
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

/// A recording, cut into batches as they came.
struct Pieces {
    /// All in the time that the source sees.
    recording: Recording,
    /// Times of all channels.
    t_s: Vec<f64>,
    /// Where each series stands.
    cursors: Vec<usize>,
    /// Samples and events told.
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

    /// Tells all up to a time, a second at a time.
    fn tell(&mut self, source: &mut dyn StepSource, until_s: f64) {
        while self.until_s < until_s {
            let piece_s = (self.until_s + PIECE_S).min(until_s);
            // A recording keeps whole nanoseconds of a time.
            let end_s = piece_s + ROUNDED_S;
            let to = self.t_s.partition_point(|t_s| *t_s <= end_s).max(self.done);
            let t_s = self.t_s.get(self.done..to).unwrap_or_default().to_vec();
            // Each series is gone through once, for all pieces together.
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
            // Whether it would end the step is known: the step has ended.
            source.on_batch(&batch);
            (self.done, self.events_done, self.until_s) = (to, events_to, piece_s);
        }
    }
}
