//! All readings compared with the model.

use crate::drift::causes::cause::{Cause, FOULING_FLOW_SHARE, is_relative};
use crate::drift::runs::time_axis::{Block, CampaignStep};
use crate::drift::sensitivity::drive::Prediction;
use crate::drift::sensitivity::knobs::{KNOBS, difference_step};
use mapper_core::Channel;
use mapper_observe::channels::{DRIVERS, OUTPUTS};
use mapper_observe::perturbation::Perturbation;

/// Effect of a constant of one standard deviation on readings and points.
#[derive(Debug, Clone)]
pub(crate) struct Constant {
    /// Readings, segment by segment.
    pub readings: Vec<f64>,
    /// Efficiency at the end of each step, fraction.
    pub eta: Vec<f64>,
    /// Heat-transfer coefficient at the end of each step, W/(m2 K).
    pub h_w_m2k: Vec<f64>,
}

impl Constant {
    /// The same, scaled by this factor.
    pub fn times(&self, factor: f64) -> Constant {
        let times = |values: &[f64]| values.iter().map(|value| factor * value).collect();
        Constant { readings: times(&self.readings), eta: times(&self.eta), h_w_m2k: times(&self.h_w_m2k) }
    }

    /// The sum of both.
    pub fn plus(mut self, other: Constant) -> Constant {
        let add = |into: &mut Vec<f64>, from: &[f64]| {
            into.iter_mut().zip(from).for_each(|(into, from)| *into += from);
        };
        add(&mut self.readings, &other.readings);
        add(&mut self.eta, &other.eta);
        add(&mut self.h_w_m2k, &other.h_w_m2k);
        self
    }
}

/// All readings compared with the model.
pub(crate) struct Readings {
    pub runs: usize,
    pub steps: Vec<CampaignStep>,
    /// Number of compared segments.
    pub blocks: Vec<Block>,
    /// Compared channels, as positions in [`OUTPUTS`].
    pub columns: Vec<usize>,
    /// Reading minus model, channel by channel, segment by segment.
    pub difference: Vec<f64>,
    /// The model, in the same order.
    pub model: Vec<f64>,
    /// Sensitivity of readings and points to each of [`KNOBS`], per unit.
    pub answers: Vec<Constant>,
    /// Efficiency and heat-transfer coefficient of the model at the end of each step.
    pub step_ends: Vec<(f64, f64)>,
    /// Mean of each of [`DRIVERS`].
    pub input_levels: Vec<f64>,
    /// Positions of the compared segments among all.
    pub kept: Vec<usize>,
    /// Every segment with its readings and the nominal model's, including those not compared.
    pub all: Vec<(Block, [Option<f64>; OUTPUTS.len()], [f64; OUTPUTS.len()])>,
}

impl Readings {
    pub fn answer(&self, knob: Perturbation) -> Option<&Constant> {
        KNOBS.iter().position(|other| *other == knob).and_then(|index| self.answers.get(index))
    }

    pub fn input_level(&self, channel: Channel) -> f64 {
        DRIVERS
            .iter()
            .position(|input| *input == channel)
            .and_then(|index| self.input_levels.get(index))
            .copied()
            .unwrap_or(0.0)
    }

    /// Start of the campaign and end of its last step, campaign time, s.
    pub fn span_s(&self) -> (f64, f64) {
        let start = self.steps.first().map_or(0.0, |step| step.start_s + step.offset_s);
        let end = self.steps.last().map_or(0.0, |step| step.end_s + step.offset_s);
        (start, end)
    }

    /// Effect of a constant cause of unit size on readings and points; `None` if it has no effect.
    pub fn signature(&self, cause: Cause) -> Option<Constant> {
        match cause {
            Cause::Sensors(channels) => {
                self.sum(channels.iter().filter_map(|channel| self.of_sensor(*channel)))
            }
            Cause::Fouling => {
                let of = |knob, factor| Some(self.answer(knob)?.times(factor));
                self.sum(
                    [of(Perturbation::Efficiency, 1.0)?, of(Perturbation::Flow, FOULING_FLOW_SHARE)?]
                        .into_iter(),
                )
            }
            Cause::BearingFriction => self.answer(Perturbation::Friction).cloned(),
        }
    }

    /// The part of a signature that the model includes once the cause is planted: all but the drift of output sensors.
    pub fn planted_signature(&self, cause: Cause) -> Option<Constant> {
        match cause {
            Cause::Sensors(channels) => {
                let inputs = channels.iter().filter(|channel| DRIVERS.contains(channel));
                self.sum(inputs.filter_map(|channel| self.of_sensor(*channel)))
            }
            Cause::Fouling | Cause::BearingFriction => self.signature(cause),
        }
    }

    fn of_sensor(&self, channel: Channel) -> Option<Constant> {
        // An input that reads too high drives the model too high: the true value is lower.
        if DRIVERS.contains(&channel) {
            return Some(self.answer(Perturbation::Input(channel))?.times(-1.0));
        }
        let output = OUTPUTS.iter().position(|output| *output == channel)?;
        let column = self.columns.iter().position(|column| *column == output)?;
        let count = self.columns.len();
        let of_row = |row: usize| match row % count == column {
            true if is_relative(channel) => self.model[row],
            true => 1.0,
            false => 0.0,
        };
        let steps = self.steps.len();
        let readings = (0..self.difference.len()).map(of_row).collect();
        Some(Constant { readings, eta: vec![0.0; steps], h_w_m2k: vec![0.0; steps] })
    }

    /// `None` if there is nothing to add, or it has no effect.
    fn sum(&self, parts: impl Iterator<Item = Constant>) -> Option<Constant> {
        parts.reduce(Constant::plus).filter(|sum| sum.readings.iter().any(|value| *value != 0.0))
    }

    /// The same readings with another prediction; `None` if it covers less than the first one.
    pub fn around(&self, base: Prediction, turned: &[Prediction]) -> Option<Readings> {
        let columns = &self.columns;
        let rows = |values: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            self.kept
                .iter()
                .flat_map(|block| columns.iter().map(move |column| values(*block, *column)))
                .collect()
        };
        let answers = KNOBS
            .iter()
            .zip(turned)
            .map(|(knob, turned)| Constant {
                readings: rows(&|block, column| {
                    (turned.means[block][column] - base.means[block][column]) / difference_step(*knob)
                }),
                eta: (0..self.steps.len())
                    .map(|step| {
                        finite((turned.step_ends[step].0 - base.step_ends[step].0) / difference_step(*knob))
                    })
                    .collect(),
                h_w_m2k: (0..self.steps.len())
                    .map(|step| {
                        finite((turned.step_ends[step].1 - base.step_ends[step].1) / difference_step(*knob))
                    })
                    .collect(),
            })
            .collect();
        let readings = Readings {
            runs: self.runs,
            steps: self.steps.clone(),
            blocks: self.blocks.clone(),
            columns: self.columns.clone(),
            difference: rows(&|block, column| {
                self.all[block].1[column].unwrap_or(f64::NAN) - base.means[block][column]
            }),
            model: rows(&|block, column| base.means[block][column]),
            answers,
            step_ends: base.step_ends,
            input_levels: self.input_levels.clone(),
            kept: self.kept.clone(),
            all: self.all.clone(),
        };
        readings.difference.iter().all(|value| value.is_finite()).then_some(readings)
    }

    /// Subtracts a linear effect from the model: `of_rows` in the readings, `of_steps` at the steps' ends.
    pub fn give_back(&mut self, part: &Constant, of_rows: &[f64], of_steps: &[f64]) {
        for ((difference, shown), size) in self.difference.iter_mut().zip(&part.readings).zip(of_rows) {
            *difference += shown * size;
        }
        for (step, ((eta, h_w_m2k), size)) in self.step_ends.iter_mut().zip(of_steps).enumerate() {
            *eta -= part.eta[step] * size;
            *h_w_m2k -= part.h_w_m2k[step] * size;
        }
    }
}

/// 0 for steps that the model cannot follow; they give no point.
fn finite(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}
