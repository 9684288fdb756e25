//! The search for surge: the approach to a line's surge-side end, and the resulting mark.

use crate::{Channel, Recording, Series, StepKind};
use serde::{Deserialize, Serialize};

/// Settings of the approach to surge at the end of a speed line: the valve closes in small steps until the surge flow is
/// known, or until the margin has fallen to [`SurgeSearchSettings::closest_margin_ratio`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurgeSearchSettings {
    /// Minimum surge margin of the approach, relative to the current estimate of the surge flow, ratio, > 0.
    pub closest_margin_ratio: f64,
    /// Maximum change of the valve opening in one step while the surge line may be near, ratio, > 0.
    pub step_ratio: f64,
    /// Time at each opening, s; the rig follows during the first [`SurgeSearchSettings::SETTLE_S`].
    pub dwell_s: f64,
    /// Standard error of the surge flow at which a line is finished, ratio, > 0, without the flow meter's gain.
    pub wanted_standard_error_ratio: f64,
    /// Maximum number of steps of one line, without the return to safe flow.
    pub most_steps: usize,
    /// Coefficient of variation of a pressure at soft surge over that far from surge, ratio, > 1.
    pub soft_growth_ratio: f64,
}

impl SurgeSearchSettings {
    /// Time after a small step until speed and pressures have followed, s. Bound: the time constant of a rotor is about a second.
    pub const SETTLE_S: f64 = 5.0;
}

impl Default for SurgeSearchSettings {
    fn default() -> Self {
        SurgeSearchSettings {
            // Bound: the uncertainty of a nominal surge line is larger.
            closest_margin_ratio: 0.03,
            // Bound: ten steps from the middle of a line to its end.
            step_ratio: 0.03,
            // Bound: gas and probe settle, the housing may not.
            dwell_s: 25.0,
            // Bound: the gain of a flow meter, which the search cannot reduce.
            wanted_standard_error_ratio: 0.008,
            // Bound: effort; a line needs a third of them.
            most_steps: 40,
            // Judgement: SAE J1826 (2022) asks for the knee of its growth, and leaves the criterion to the stand; twice is above its scatter, and
            // before deep surge.
            soft_growth_ratio: 2.0,
        }
    }
}

/// Evidence for the surge flow of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SurgeFoundBy {
    /// Extrapolated growth of the variation of pressures and flow. The compressor was not in surge.
    Precursor,
    /// The compressor went into surge: the flow lies between the last opening without surge and the one that surged.
    Surge,
    /// The surge line of a map file, without standard errors.
    File,
}

/// The surge-side end of a speed line, with one standard error of each of its values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SurgeMark {
    /// Target shaft speed of the line (physical), rpm.
    pub target_speed_rpm: f64,
    /// Corrected speed of the mark, rpm.
    pub speed_corrected_rpm: f64,
    /// Corrected flow at surge, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Standard error without the flow meter's gain, kg/s.
    pub flow_standard_error_kg_s: f64,
    /// Standard error that all corrected flows share through the flow meter's gain, kg/s.
    pub flow_common_standard_error_kg_s: f64,
    /// Total pressure ratio P2/P1 at surge.
    pub pressure_ratio: f64,
    /// Standard error.
    pub pressure_ratio_standard_error: f64,
    /// Smallest corrected flow measured during the approach, kg/s.
    pub closest_flow_corrected_kg_s: f64,
    /// Run time at the end of the measurement with this flow, s.
    pub closest_end_s: f64,
    /// Evidence.
    pub found_by: SurgeFoundBy,
    /// Number of openings in the approach.
    pub steps: usize,
    /// Soft surge, if a pressure was sampled fast.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soft: Option<SoftSurge>,
}

/// The onset of fluctuations before surge, as SAE J1826 (2022) describes it, with its criterion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SoftSurge {
    /// The pressure that fluctuates.
    pub channel: Channel,
    /// Its coefficient of variation at soft surge: the criterion.
    pub variation_ratio: f64,
    /// The same far from surge.
    pub quiet_ratio: f64,
    /// Corrected flow, kg/s, at the speed of the mark.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio.
    pub pressure_ratio: f64,
}

/// A line on which surge was not found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SurgeNotFound {
    /// Target shaft speed of the line (physical), rpm.
    pub target_speed_rpm: f64,
    /// Number of openings in the approach.
    pub openings: usize,
    /// Whether the openings would suffice to locate surge; the variation of pressures and flow did not grow over them.
    pub enough: bool,
}

impl SurgeMark {
    /// Standard error of the flow, the flow meter's gain included, kg/s.
    pub fn flow_total_standard_error_kg_s(&self) -> f64 {
        self.flow_standard_error_kg_s.hypot(self.flow_common_standard_error_kg_s)
    }

    /// Multiplies corrected speed and flows, for a change of the reference state.
    pub(crate) fn scale(&mut self, speed_factor: f64, flow_factor: f64) {
        self.speed_corrected_rpm *= speed_factor;
        for flow in [
            &mut self.flow_corrected_kg_s,
            &mut self.flow_standard_error_kg_s,
            &mut self.flow_common_standard_error_kg_s,
            &mut self.closest_flow_corrected_kg_s,
        ] {
            *flow *= flow_factor;
        }
        self.soft.iter_mut().for_each(|soft| soft.flow_corrected_kg_s *= flow_factor);
    }
}

impl Recording {
    /// Splits the recording at the first approach to surge, and returns the rest. Approaches contain no points and must not affect the
    /// identification. `None` if the recording has no approach.
    pub fn split_off_approaches(&mut self) -> Option<Recording> {
        let first = self.steps.iter().position(|step| step.kind == StepKind::Approach)?;
        let from_s = self.steps[first].start_s;
        let split = |series: &mut Series| {
            // A sample at the very end of the previous step belongs to that step.
            let at = series.t_s.partition_point(|t_s| *t_s <= from_s);
            Series { t_s: series.t_s.split_off(at), values: series.values.split_off(at) }
        };
        let after = self.events.partition_point(|event| event.t_s < from_s);
        Some(Recording {
            series: self.series.iter_mut().map(|(channel, series)| (*channel, split(series))).collect(),
            elements: self.elements.iter_mut().map(|(element, series)| (*element, split(series))).collect(),
            steps: self.steps.split_off(first),
            events: self.events.split_off(after),
            // Provenance of readings is only needed with the complete run.
            ..Recording::default()
        })
    }
}
