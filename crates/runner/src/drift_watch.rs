//! Compares repeated jumps during a run: a difference beyond the declared uncertainty is confirmed first, then acted upon.

use crate::step_source::{StepSource, StepSourceError};
use mapper_core::{
    Channel, DeclaredUncertainty, OnDrift, OperatingPoint, PlanStep, SampleBatch, StepKind, StepMarker,
};
use std::collections::{BTreeMap, VecDeque};

/// Time at the end of a step whose readings are compared, s.
const END_S: f64 = 20.0;
/// Threshold of a difference in declared standard deviations: 95 %.
const THRESHOLD_SIGMAS: f64 = 1.96;
/// Compared channels. T2 is taken relative to T1 and P2 relative to P1, so that changes of the inlet are not drift.
const COMPARED_CHANNELS: [Channel; 4] = [Channel::T2, Channel::P2, Channel::CompressorFlow, Channel::Tc];

/// The steps of another source; a reference jump is repeated if it differs from its first visit.
///
/// The current step is finished and the jump is repeated. If the repeat differs too, the watch applies [`OnDrift`].
pub struct DriftWatch<'a> {
    inner: &'a mut dyn StepSource,
    on_drift: OnDrift,
    declared: BTreeMap<Channel, DeclaredUncertainty>,
    /// Readings at the end of the first visit of each jump.
    first: Vec<((OperatingPoint, OperatingPoint), Vec<f64>)>,
    /// Previous step: a jump is repeated with both of its steps.
    before: Option<PlanStep>,
    current: Option<PlanStep>,
    readings: VecDeque<(f64, Vec<f64>)>,
    inserted: VecDeque<PlanStep>,
    /// Whether the current jump is a confirmation.
    confirming: bool,
    next_index: usize,
    /// Total duration of the inserted steps, s.
    delay_s: f64,
    notes: Vec<String>,
    /// Why the run ends before its last step.
    end_reason: Option<String>,
}

impl<'a> DriftWatch<'a> {
    /// Watches the steps of `inner`; channels that are missing in `declared` are not compared.
    pub fn new(
        inner: &'a mut dyn StepSource,
        on_drift: OnDrift,
        declared: BTreeMap<Channel, DeclaredUncertainty>,
    ) -> Self {
        DriftWatch {
            inner,
            on_drift,
            declared,
            first: Vec::new(),
            before: None,
            current: None,
            readings: VecDeque::new(),
            inserted: VecDeque::new(),
            confirming: false,
            next_index: 0,
            delay_s: 0.0,
            notes: Vec::new(),
            end_reason: None,
        }
    }

    /// Why drift ended the run before its last step; `None` if it did not.
    pub fn end_reason(&self) -> Option<&str> {
        self.end_reason.as_deref()
    }

    /// Means at the end of the step, in the order of [`WATCHED`]; NaN for missing channels.
    fn mean_readings(&self) -> Vec<f64> {
        let count = self.readings.len() as f64;
        (0..COMPARED_CHANNELS.len())
            .map(|column| self.readings.iter().map(|(_, values)| values[column]).sum::<f64>() / count)
            .collect()
    }

    /// Describes the differences beyond the declared uncertainty.
    fn describe_differences(&self, first: &[f64], now: &[f64]) -> Vec<String> {
        let mut differences = Vec::new();
        for ((channel, first), now) in COMPARED_CHANNELS.iter().zip(first).zip(now) {
            let Some(declared) = self.declared.get(channel) else { continue };
            let fixed = declared.fixed_sigma(*channel, *first);
            // Noise of consecutive samples is correlated: they count as one sample in two seconds.
            let noise = declared.noise_sigma * (2.0 * 2.0 / END_S).sqrt();
            let limit = THRESHOLD_SIGMAS * fixed.hypot(noise);
            let change = now - first;
            if limit > 0.0 && change.abs() > limit {
                differences.push(format!(
                    "{} by {change:+.4} {unit} (declared: {limit:.4} {unit})",
                    channel.symbol(),
                    unit = channel.unit()
                ));
            }
        }
        differences
    }

    fn report_drift(&mut self, differences: &str) {
        let consequence = match self.on_drift {
            OnDrift::Continue => "the run continues (`on_drift: continue`)",
            OnDrift::Hold => "the run is held in its safe state; inspect the rig before you continue",
            OnDrift::Zero => {
                "the run is stopped without flow: zero the sensors, then run the remaining steps"
            }
        };
        let note = format!("drift: the repeated jump differs again, {differences}; {consequence}");
        if self.on_drift != OnDrift::Continue {
            self.end_reason = Some(note.clone());
        }
        self.notes.push(note);
    }
}

impl StepSource for DriftWatch<'_> {
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(self.inner)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(self.inner)
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        if self.end_reason.is_some() {
            return Ok(None);
        }
        let next = match self.inserted.pop_front() {
            Some(step) => Some(step),
            None => self.inner.next_step()?,
        };
        let next = next.map(|step| PlanStep {
            index: self.next_index,
            // The real origin: a step that follows an inserted one starts from it.
            from: self.current.as_ref().map_or(step.from, |current| Some(current.to)),
            start_s: step.start_s + self.delay_s,
            ..step
        });
        if next.is_some() {
            self.next_index += 1;
            self.before = self.current.take();
            self.current.clone_from(&next);
            self.readings.clear();
        }
        Ok(next)
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        for (index, t_s) in batch.t_s.iter().enumerate() {
            let value = |channel| batch.column(channel).and_then(|values| values.get(index)).copied();
            let over = |channel| value(channel).unwrap_or(f64::NAN);
            let row = COMPARED_CHANNELS
                .iter()
                .map(|channel| match channel {
                    Channel::T2 => over(Channel::T2) - value(Channel::T1).unwrap_or(0.0),
                    // In pascals at an inlet pressure of 100 kPa.
                    Channel::P2 => over(Channel::P2) * value(Channel::P1).map_or(1.0, |p1_pa| 1e5 / p1_pa),
                    channel => over(*channel),
                })
                .collect();
            self.readings.push_back((*t_s, row));
        }
        let from_s = self.readings.back().map_or(0.0, |(t_s, _)| t_s - END_S);
        while self.readings.front().is_some_and(|(t_s, _)| *t_s < from_s) {
            self.readings.pop_front();
        }
        self.inner.on_batch(batch)
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        self.inner.after_step(marker)?;
        let compared = !self.readings.is_empty() && marker.kind != StepKind::Approach;
        let Some(jump) = marker.from.zip(marker.to).filter(|_| compared) else {
            return Ok(());
        };
        let now = self.mean_readings();
        let Some((_, first)) = self.first.iter().find(|(known, _)| *known == jump) else {
            self.first.push((jump, now));
            return Ok(());
        };
        let differences = self.describe_differences(first, &now).join(", ");
        if !differences.is_empty() && self.confirming {
            self.report_drift(&differences);
            // The reported state is the new reference for all jumps, so that it is not reported at every repeat.
            self.first.clear();
            self.first.push((jump, now));
        } else if !differences.is_empty()
            && let (Some(before), Some(current)) = (&self.before, &self.current)
            && self.inserted.is_empty()
        {
            self.notes.push(format!(
                "drift? a repeated jump differs from its first visit, {differences}; it is repeated"
            ));
            self.delay_s += before.dwell_s + current.dwell_s;
            self.inserted.extend([before.clone(), current.clone()]);
            self.confirming = true;
            return Ok(());
        } else if self.confirming && self.inserted.is_empty() {
            self.notes.push("drift: not confirmed, the run continues".to_owned());
        }
        if self.inserted.is_empty() {
            self.confirming = false;
        }
        Ok(())
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.inner.take_notes());
        notes
    }
}
