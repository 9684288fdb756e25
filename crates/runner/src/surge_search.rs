//! The surge search: after all other steps it visits the surge-side end of each line, and closes the valve in small steps as far
//! as the readings allow.

use crate::step_source::{StepSource, StepSourceError};
use crate::surge::{LineEnd, Move, SurgeEstimate, SurgeReading, choose_next_move};
use mapper_core::{
    Channel, EventKind, OperatingPoint, PlanStep, Predicted, Recording, ReferenceState, SampleBatch,
    StepKind, StepMarker, SurgeSearchSettings, valve_area_text,
};

/// Time at the end of a line before the first reading, s: the machine comes from elsewhere on the map.
const ARRIVE_S: f64 = 40.0;
/// Time after the valve was reopened, s.
const RETURN_S: f64 = 10.0;
/// Time at the end of a step over which the speed is averaged, s.
const SPEED_S: f64 = 5.0;
/// Largest correction of the commanded speed, ratio: a larger one indicates a fault rather than a weaker turbine.
const MAX_TRIM_RATIO: f64 = 0.1;
/// Consecutive samples without forward flow that count as surge, independent of the rig's own report.
const REVERSED_SAMPLES: usize = 2;

/// Boundary conditions that hold the machine at a point, by the nominal model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HoldConditions {
    /// Turbine inlet total pressure, Pa.
    pub p3_pa: f64,
    /// Turbine inlet total temperature, K.
    pub t3_k: f64,
    /// Oil inlet temperature, K.
    pub oil_temperature_k: f64,
    /// Prediction for this point.
    pub predicted: Predicted,
    /// Surge margin of the nominal machine, ratio.
    pub surge_margin_ratio: f64,
}

/// Returns the conditions that hold the machine at a point; `None` if they violate the campaign's limits.
pub type HoldConditionsAt<'a> = &'a dyn Fn(OperatingPoint) -> Option<HoldConditions>;

/// The steps of another source, followed by the approaches to surge: one for each speed, slowest first.
pub struct SurgeSearch<'a> {
    inner: &'a mut dyn StepSource,
    seek: SurgeSearchSettings,
    reference: ReferenceState,
    hold: HoldConditionsAt<'a>,
    /// The step nearest surge at each speed, from the inner source.
    line_ends: Vec<PlanStep>,
    /// Remaining lines, the next one last; `None` while the inner source has steps.
    lines: Option<Vec<PlanStep>>,
    approach: Option<Approach>,
    next_index: usize,
    last: Option<OperatingPoint>,
    /// Start of the next step in the plan's time, s.
    start_s: f64,
    notes: Vec<String>,
    surges: usize,
}

struct Approach {
    end: PlanStep,
    stage: Stage,
    readings: Vec<SurgeReading>,
    /// Readings of the current step.
    recording: Recording,
    nominal_margin_ratio: Option<f64>,
    /// Ratio of commanded to wanted speed.
    trim_ratio: f64,
    has_surged: bool,
    reversed_samples: usize,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Arrive,
    /// Take a reading at this opening.
    SurgeReading(f64),
    Return,
    Over,
}

const READ: [Channel; 5] =
    [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::T1, Channel::P1, Channel::P2];

impl<'a> SurgeSearch<'a> {
    /// The steps of `inner`, then the approaches. `reference` is the reference state of corrected values.
    pub fn new(
        inner: &'a mut dyn StepSource,
        seek: SurgeSearchSettings,
        reference: ReferenceState,
        hold: HoldConditionsAt<'a>,
    ) -> Self {
        SurgeSearch {
            inner,
            seek,
            reference,
            hold,
            line_ends: Vec::new(),
            lines: None,
            approach: None,
            next_index: 0,
            last: None,
            start_s: 0.0,
            notes: Vec::new(),
            surges: 0,
        }
    }

    /// Time of a line in addition to its readings, s.
    pub const AROUND_S: f64 = ARRIVE_S + RETURN_S;

    fn update_line_ends(&mut self, step: &PlanStep) {
        let known = self.line_ends.iter_mut().find(|end| (end.to.speed_rpm - step.to.speed_rpm).abs() < 1e-3);
        match known {
            Some(end) if end.to.valve_opening_ratio <= step.to.valve_opening_ratio => {}
            Some(end) => *end = step.clone(),
            None => self.line_ends.push(step.clone()),
        }
    }

    /// The next step of the approaches; `None` after the last line.
    fn next_approach_step(&mut self) -> Option<PlanStep> {
        let lines = self.lines.get_or_insert_with(|| {
            let mut lines = std::mem::take(&mut self.line_ends);
            lines.sort_by(|a, b| b.to.speed_rpm.total_cmp(&a.to.speed_rpm));
            lines
        });
        loop {
            if self.approach.as_ref().is_none_or(|approach| approach.stage == Stage::Over) {
                self.approach = Some(Approach::of(lines.pop()?));
            }
            let approach = self.approach.as_mut()?;
            if let Some(step) = approach.step(&self.seek, self.hold) {
                return Some(step);
            }
            // The point is outside the limits: the line ends with the readings so far.
            let speed_rpm = approach.end.to.speed_rpm;
            self.notes.push(format!(
                "surge search: {speed_rpm:.0} rpm cannot be held any further within the limits; the line ends"
            ));
            approach.stage = match approach.stage {
                Stage::SurgeReading(_) => Stage::Return,
                _ => Stage::Over,
            };
        }
    }
}

impl Approach {
    fn of(end: PlanStep) -> Self {
        Approach {
            end,
            stage: Stage::Arrive,
            readings: Vec::new(),
            recording: Recording::default(),
            nominal_margin_ratio: None,
            trim_ratio: 1.0,
            has_surged: false,
            reversed_samples: 0,
        }
    }

    /// The step of the current stage, without index, start time and origin.
    fn step(&mut self, seek: &SurgeSearchSettings, hold: HoldConditionsAt<'_>) -> Option<PlanStep> {
        let safe = self.end.to.valve_opening_ratio;
        let (opening, dwell_s) = match self.stage {
            Stage::Arrive => (safe, ARRIVE_S),
            Stage::SurgeReading(opening) => (opening, seek.dwell_s),
            Stage::Return => (safe, RETURN_S),
            Stage::Over => return None,
        };
        let to = OperatingPoint { speed_rpm: self.end.to.speed_rpm, valve_opening_ratio: opening };
        let mut step =
            PlanStep { kind: StepKind::Approach, to, dwell_s, transition: None, ..self.end.clone() };
        // The return needs no check: the end of the line is within the limits.
        if self.stage != Stage::Return {
            let held = hold(OperatingPoint { speed_rpm: to.speed_rpm * self.trim_ratio, ..to })?;
            (step.p3_pa, step.t3_k, step.oil_temperature_k) = (held.p3_pa, held.t3_k, held.oil_temperature_k);
            step.predicted = held.predicted;
            self.nominal_margin_ratio = Some(held.surge_margin_ratio);
        }
        step.predicted.minutes = dwell_s / 60.0;
        self.recording = Recording::default();
        self.reversed_samples = 0;
        Some(step)
    }

    /// Stores the readings; true if the compressor surges.
    fn read(&mut self, batch: &SampleBatch) -> bool {
        for channel in READ {
            if let Some(values) = batch.column(channel) {
                let series = self.recording.series.entry(channel).or_default();
                series.t_s.extend_from_slice(&batch.t_s);
                series.values.extend_from_slice(values);
            }
        }
        let entered = batch.events.iter().any(|event| event.kind == EventKind::SurgeEntered);
        for flow_kg_s in batch.column(Channel::CompressorFlow).unwrap_or_default() {
            self.reversed_samples = if *flow_kg_s <= 0.0 { self.reversed_samples + 1 } else { 0 };
        }
        let surges = self.stage != Stage::Return && (entered || self.reversed_samples >= REVERSED_SAMPLES);
        self.has_surged |= surges;
        surges
    }

    /// Corrects the commanded speed by the measured one.
    fn trim(&mut self, end_s: f64) {
        let Some(series) = self.recording.series.get(&Channel::ShaftSpeed) else { return };
        let (_, values) = series.slice(end_s - SPEED_S, end_s);
        let finite: Vec<f64> = values.iter().copied().filter(|value| *value > 0.0).collect();
        if !finite.is_empty() {
            let speed_rpm = finite.iter().sum::<f64>() / finite.len() as f64;
            let trim = self.trim_ratio * self.end.to.speed_rpm / speed_rpm;
            self.trim_ratio = trim.clamp(1.0 - MAX_TRIM_RATIO, 1.0 + MAX_TRIM_RATIO);
        }
    }

    /// Decides how the approach continues after a step; a note if the line ends.
    fn decide_next_stage(
        &mut self,
        marker: &StepMarker,
        seek: &SurgeSearchSettings,
        reference: ReferenceState,
    ) -> Option<String> {
        let line = || format!("surge search: {:.0} rpm", self.end.to.speed_rpm);
        let safe = self.end.to.valve_opening_ratio;
        let (stage, note) = match self.stage {
            Stage::Return | Stage::Over => (Stage::Over, None),
            _ if self.has_surged => (
                Stage::Return,
                Some(format!(
                    "{}: surge at valve area {}, the valve opens",
                    line(),
                    valve_area_text(marker.valve_opening_ratio)
                )),
            ),
            Stage::Arrive => (Stage::SurgeReading(safe), None),
            Stage::SurgeReading(_) => {
                self.readings.extend(SurgeReading::of(&self.recording, marker, reference));
                match choose_next_move(&self.readings, seek, self.nominal_margin_ratio) {
                    Move::To(opening) => (Stage::SurgeReading(opening), None),
                    Move::Done(why) => {
                        (Stage::Return, Some(format!("{}: {}", line(), self.describe_result(why))))
                    }
                }
            }
        };
        if !self.has_surged && matches!(self.stage, Stage::Arrive | Stage::SurgeReading(_)) {
            self.trim(marker.end_s);
        }
        self.stage = stage;
        note
    }

    fn describe_result(&self, why: LineEnd) -> String {
        let why = match why {
            LineEnd::AccuracyReached => "required accuracy reached",
            LineEnd::DistanceReached => "minimum distance to surge reached",
            LineEnd::MaxSteps => "maximum number of steps reached",
        };
        match SurgeEstimate::of(&self.readings).filter(|estimate| estimate.is_usable) {
            Some(estimate) => format!(
                "surge at {:.5} kg/s corrected, standard error {:.1} %, from {} openings down to {:.1} % above it ({why}); the valve opens",
                estimate.flow_corrected_kg_s,
                100.0 * estimate.standard_error_ratio(),
                self.readings.len(),
                100.0 * (estimate.closest_flow_kg_s / estimate.flow_corrected_kg_s - 1.0),
            ),
            None => format!("no sign of surge at {} openings ({why}); the valve opens", self.readings.len()),
        }
    }
}

impl StepSource for SurgeSearch<'_> {
    fn inner(&self) -> Option<&dyn StepSource> {
        Some(self.inner)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn StepSource> {
        Some(self.inner)
    }

    fn next_step(&mut self) -> Result<Option<PlanStep>, StepSourceError> {
        let from_inner = if self.lines.is_none() { self.inner.next_step()? } else { None };
        let next = match from_inner {
            Some(step) => {
                self.update_line_ends(&step);
                Some(step)
            }
            None => self.next_approach_step().map(|step| PlanStep {
                index: self.next_index,
                from: self.last,
                start_s: self.start_s,
                ..step
            }),
        };
        if let Some(step) = &next {
            self.next_index = step.index + 1;
            self.last = Some(step.to);
            self.start_s = step.start_s + step.dwell_s;
        }
        Ok(next)
    }

    fn before_step(&mut self, marker: &StepMarker) {
        if self.approach.is_none() {
            self.inner.before_step(marker);
        }
    }

    fn on_batch(&mut self, batch: &SampleBatch) -> bool {
        match &mut self.approach {
            None => self.inner.on_batch(batch),
            Some(approach) => {
                let surges = approach.read(batch);
                surges && approach.stage != Stage::Return
            }
        }
    }

    fn after_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        let Some(approach) = &mut self.approach else { return self.inner.after_step(marker) };
        self.surges += usize::from(
            approach.has_surged && matches!(approach.stage, Stage::Arrive | Stage::SurgeReading(_)),
        );
        let note = approach.decide_next_stage(marker, &self.seek, self.reference);
        self.notes.extend(note);
        Ok(())
    }

    fn after_skipped_step(&mut self, marker: &StepMarker) -> Result<(), StepSourceError> {
        match &mut self.approach {
            None => self.inner.after_skipped_step(marker),
            // The valve opens: a guard limits how far a line is followed.
            Some(approach) => {
                approach.stage = match approach.stage {
                    Stage::SurgeReading(_) | Stage::Arrive => Stage::Return,
                    _ => Stage::Over,
                };
                Ok(())
            }
        }
    }

    fn take_notes(&mut self) -> Vec<String> {
        let mut notes = std::mem::take(&mut self.notes);
        notes.extend(self.inner.take_notes());
        notes
    }
}
