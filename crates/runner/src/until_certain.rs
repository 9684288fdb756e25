//! Ends the steps of another source as soon as somebody who looks at their readings says that enough is known.

use crate::source::{StepSource, StepSourceError};
use mapper_core::{PlanStep, Recording, SampleBatch, StepMarker};

/// How long a step may last, and when it is looked at, s after its jump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DwellBounds {
    /// The first look.
    pub first_look_s: f64,
    /// Time from one look to the next.
    pub apart_s: f64,
    /// Longest time at the point.
    pub longest_s: f64,
}

/// Says when enough is known of a step. Everything it is told comes from the run itself: equal readings, equal answers.
pub trait Certainty {
    /// The step comes next; `None` where it lasts as planned.
    fn bounds(&mut self, step: &PlanStep) -> Option<DwellBounds>;

    /// Looks at the readings of the step, from its jump to `marker.end_s`, which is now; the one step of `readings` is `marker`. The
    /// reason why it may end, in words with figures, or `None`.
    fn look(&mut self, readings: &Recording, marker: &StepMarker) -> Option<String>;

    /// The step has ended, by a look or by its longest time.
    fn ended(&mut self, readings: &Recording, marker: &StepMarker);

    /// A guard has left the step out.
    fn left_out(&mut self);
}

/// Steps of another source, each ended when enough is known of it.
pub struct UntilCertain<'a> {
    inner: &'a mut dyn StepSource,
    certainty: &'a mut dyn Certainty,
    /// The step that was handed out and is not over.
    now: Option<PlanStep>,
    bounds: Option<DwellBounds>,
    /// What is read since its jump; its marker once there was one.
    readings: Recording,
    next_look_s: f64,
    reason: Option<String>,
    notes: Vec<String>,
}

impl<'a> UntilCertain<'a> {
    /// The steps of `inner`, ended by `certainty`.
    pub fn new(inner: &'a mut dyn StepSource, certainty: &'a mut dyn Certainty) -> Self {
        UntilCertain {
            inner,
            certainty,
            now: None,
            bounds: None,
            readings: Recording::default(),
            next_look_s: f64::INFINITY,
            reason: None,
            notes: Vec::new(),
        }
    }

    /// Keeps what was read since the jump, and looks at it where it is time to.
    fn read(&mut self, batch: &SampleBatch) {
        // Steps that others put in between are none of these.
        let Some(marker) = self.readings.steps.first().copied().filter(|_| self.now.is_some()) else {
            return;
        };
        for column in &batch.columns {
            let series = self.readings.series.entry(column.channel).or_default();
            series.t_s.extend_from_slice(&batch.t_s);
            series.values.extend_from_slice(&column.values);
        }
        let (Some(&now_s), Some(bounds)) = (batch.t_s.last(), self.bounds) else { return };
        // Sums of sample times end a little before the second does.
        if self.reason.is_some() || now_s - marker.start_s < self.next_look_s - 1e-6 {
            return;
        }
        self.next_look_s += bounds.apart_s;
        let marker = StepMarker { end_s: now_s, ..marker };
        self.readings.steps = vec![marker];
        self.reason = self.certainty.look(&self.readings, &marker);
    }
}

impl StepSource for UntilCertain<'_> {
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(self.inner)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(self.inner)
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let next = self.inner.next_step()?;
        self.bounds = next.as_ref().and_then(|step| self.certainty.bounds(step));
        let next = next.map(|step| PlanStep {
            dwell_s: self.bounds.map_or(step.dwell_s, |bounds| bounds.longest_s),
            ..step
        });
        self.now.clone_from(&next);
        self.readings = Recording::default();
        Ok(next)
    }

    fn begins(&mut self, marker: &StepMarker) {
        if self.now.is_some() {
            // Made again from its jump on, what was read before is of another one.
            self.readings = Recording { steps: vec![*marker], ..Recording::default() };
            self.next_look_s = self.bounds.map_or(f64::INFINITY, |bounds| bounds.first_look_s);
            self.reason = None;
        }
        self.inner.begins(marker);
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        self.read(batch);
        // Asked again until the step is over: a guard may hold it for a while.
        let ends = self.inner.on_batch(batch);
        ends || (self.now.is_some() && self.reason.is_some())
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        if self.now.take().is_some() {
            self.readings.steps = vec![*marker];
            self.certainty.ended(&self.readings, marker);
            self.notes.extend(self.reason.take());
        }
        self.inner.after_step(marker)
    }

    fn skipped(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        if self.now.take().is_some() {
            self.certainty.left_out();
            self.reason = None;
        }
        self.inner.skipped(marker)
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.inner.take_notes());
        notes
    }
}
