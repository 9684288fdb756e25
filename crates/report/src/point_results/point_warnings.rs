//! Warnings and remarks about points and results, each sentence once.

use crate::document::Sentence;
use crate::formatting::{Message, significant_digits};
use crate::point_results::warning_text::sentence_of;
use mapper_core::unit_factors::ICE_POINT_K;
use mapper_core::{
    Dimension, IdentifiedPoint, Method, ResultRemark, Verdict, half_width_95, probability_text, step_number,
};

#[derive(Debug, Clone, PartialEq)]
pub struct Doubt<'a> {
    steps: Vec<usize>,
    pub code: &'a str,
    sentence: Sentence,
}

/// All remarks on the points, in order of first step. Warnings that differ only in values are merged into one with their range.
pub fn doubts<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Vec<Doubt<'a>> {
    let mut merged: Vec<Doubt<'a>> = Vec::new();
    for point in points {
        let step = step_number(point.step);
        for warning in &point.warnings {
            let (code, sentence) = (warning.code(), sentence_of(warning));
            let mut same_sentence = merged
                .iter_mut()
                .filter_map(|known| (known.code == code && known.sentence.merge(&sentence)).then_some(known));
            match same_sentence.next() {
                Some(known) if known.steps.last() == Some(&step) => {}
                Some(known) => known.steps.push(step),
                None => merged.push(Doubt { steps: vec![step], code, sentence }),
            }
        }
    }
    merged
}

pub(crate) fn reasons<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Vec<String> {
    let all: Vec<&IdentifiedPoint> = points.collect();
    let first_only: Vec<IdentifiedPoint> = all
        .iter()
        .filter(|point| point.verdict != Verdict::Good)
        .map(|point| IdentifiedPoint {
            warnings: point.warnings.iter().take(1).cloned().collect(),
            ..(*point).clone()
        })
        .collect();
    let named = |doubt: &Doubt<'_>| {
        let is_of_all = doubt.count() == all.len() && all.len() > 1;
        let steps = if is_of_all { "all steps".to_owned() } else { doubt.steps() };
        format!("{steps}: {}", doubt.message())
    };
    doubts(first_only.iter()).iter().map(named).collect()
}

impl Doubt<'_> {
    pub fn message(&self) -> String {
        self.sentence.to_string()
    }

    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// The steps as text: "step 3", "steps 2, 5 to 9".
    pub fn steps(&self) -> String {
        let noun = if self.steps.len() == 1 { "step" } else { "steps" };
        let mut ranges: Vec<(usize, usize)> = Vec::new();
        for step in &self.steps {
            match ranges.last_mut() {
                Some((_, last)) if *last + 1 == *step => *last = *step,
                _ => ranges.push((*step, *step)),
            }
        }
        let numbers = ranges.iter().map(|(first, last)| match last - first {
            0 => first.to_string(),
            1 => format!("{first}, {last}"),
            _ => format!("{first} to {last}"),
        });
        format!("{noun} {}", numbers.collect::<Vec<_>>().join(", "))
    }
}

impl Message for ResultRemark {
    fn message(&self) -> String {
        match self {
            ResultRemark::RecordingIncomplete { file: Some(file), reason } => format!("{file}: {reason}"),
            ResultRemark::RecordingIncomplete { file: None, reason }
            | ResultRemark::FormatNotWritten { reason } => reason.clone(),
            ResultRemark::ConventionalMapping { usual, missing } => {
                let named =
                    missing.iter().map(|channel| format!("{channel} ({})", channel.info().description));
                format!(
                    "the recording has no {}, which `{usual}` needs: the efficiencies are those of conventional mapping (`{}`), in which \
                     heat that the housing takes or gives counts as work; no heat-transfer coefficient is identified",
                    named.collect::<Vec<_>>().join(", "),
                    Method::Steady
                )
            }
            ResultRemark::HeldFixed { parameters } => format!(
                "held fixed as declared (`identification.joint`): {}; if the declaration is wrong, all efficiencies and intervals are wrong",
                parameters.join(", ")
            ),
            ResultRemark::UnknownAmbientPressure { pressure_pa, sigma_pa } => format!(
                "the ambient pressure is unknown: it counts as {:.1} kPa with a standard uncertainty of {:.0} kPa, which the intervals include; \
                 write what the barometer read or the altitude of the stand as `ambient_pressure` in the channel map",
                1e-3 * pressure_pa,
                1e-3 * sigma_pa
            ),
            ResultRemark::UnusedRest { start_s, end_s } => format!(
                "from {start_s:.0} to {end_s:.0} s, before the first step, the machine rests and its sensors read alike: \
                 `zero: {{soak: {:.0} min}}` in the campaign subtracts what they read differently there, which leaves less of the declared \
                 offsets in the intervals",
                (end_s - start_s) / 60.0
            ),
            ResultRemark::CellContradicts { channel, reading, reference, common_sigma } => {
                let (sensors, instrument, unit, scale, zero) = match channel.info().dimension {
                    Dimension::Pressure => ("pressure sensors", "declared barometer", "kPa", 1e-3, 0.0),
                    _ => ("thermometers", "cell's thermometer", "degC", 1.0, ICE_POINT_K),
                };
                let unit_of_difference = if unit == "kPa" { "kPa" } else { "K" };
                format!(
                    "at rest all {sensors} together read {:.2} {unit}, and the {instrument} {:.2} {unit}: one of them is wrong by {:+.2} \
                     {unit_of_difference}; every interval contains an error of {:.2} {unit_of_difference} of all {sensors}; check the {instrument} \
                     and the calibration of the {sensors}",
                    scale * (reading - zero),
                    scale * (reference - zero),
                    scale * (reading - reference),
                    scale * half_width_95(*common_sigma)
                )
            }
            ResultRemark::PeriodicError { channel, period_s, amplitude } => format!(
                "{channel} has a periodic error at rest, {} {} with a period of {period_s:.0} s as recorded: pick-up of the mains that the sampling \
                 folds down, for example; it counts as noise of this sensor, so that it is taken for no fault; check screen, earth and filter",
                significant_digits(*amplitude, 2),
                channel.unit()
            ),
            ResultRemark::BladeCount { blades, set } => format!(
                "all speeds are {blades}/{set} of those of the declared map or of the grid: is the speed sensor set to the right number of blades? \
                 For a wheel with {blades} blades it must not count {set}; correct it there, or the column, and check `sensors: N: {{blades: ...}}`"
            ),
            ResultRemark::Corrected { causes, probability } => format!(
                "corrected for {}, which the diagnosis of this recording names with {}: without this correction the efficiencies differ",
                causes.join(" + "),
                probability_text(*probability)
            ),
            ResultRemark::WidenedByGap { causes, largest_sigma } => format!(
                "the rig departs from its model, and the cause is not certain ({}): the efficiencies are not corrected, and every interval is widened by the possible effect of the cause, up to +/- {:.1} points",
                if causes.is_empty() { "not in the effect library".to_owned() } else { causes.join(" or ") },
                100.0 * half_width_95(*largest_sigma)
            ),
            ResultRemark::DriftSubtracted { reason } => {
                format!("the drift of a sensor was subtracted: {reason}")
            }
            ResultRemark::NoMap { reason } => format!("there is no map: {reason}"),
            ResultRemark::MapNotFitted { reason } => format!("the map is not fitted: {reason}"),
            ResultRemark::NothingToCompare { run } => format!("{run} has no map to compare this one with"),
            ResultRemark::Other { message, .. } if !message.is_empty() => message.clone(),
            other => other.code().to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_a_range_and_pairs_are_not() {
        let steps_text = |steps: &[usize]| {
            Doubt { steps: steps.to_vec(), code: "", sentence: Sentence(Vec::new()) }.steps()
        };
        assert_eq!(steps_text(&[3]), "step 3");
        assert_eq!(steps_text(&[2, 5, 6, 7, 9, 10]), "steps 2, 5 to 7, 9, 10");
    }
}
