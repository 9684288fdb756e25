//! Decides how far the valve may be closed in the next step.

use crate::surge::estimate::SurgeEstimate;
use crate::surge::surge_reading::SurgeReading;
use mapper_core::SurgeSearchSettings;

/// Decision after a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Move {
    /// Move the valve to this opening, relative to the nominal area. The opening of the last reading means that it is repeated.
    To(f64),
    /// The line is done.
    Done(LineEnd),
}

/// Reason for the end of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineEnd {
    /// The surge flow is known with the required accuracy.
    AccuracyReached,
    /// Closing further would violate the required distance or the safe distance.
    DistanceReached,
    /// The maximum number of steps was reached.
    MaxSteps,
}

/// Step of the opening while surge is far by the nominal map, ratio.
const FAR_STEP_RATIO: f64 = 0.08;
/// Surge margin of the nominal map beyond which surge is far, ratio: the nominal surge line is uncertain.
const FAR_MARGIN_RATIO: f64 = 0.35;
/// Step that is allowed whatever the highest possible surge flow, ratio. If surge were that near, the variation would already be
/// larger at this opening, and only further readings can decide.
const SMALL_STEP_RATIO: f64 = 0.007;
/// Maximum extrapolation of the law, in multiples of the smallest margin: the start of the growth differs between rigs.
const MAX_EXTRAPOLATION: f64 = 1.4;
/// Minimum distance to the highest possible surge flow, ratio.
const MIN_DISTANCE_RATIO: f64 = 0.005;
/// Minimum useful step, ratio.
const MIN_STEP_RATIO: f64 = 0.004;
const MAX_READINGS_AT_OPENING: usize = 3;

/// Expected number of readings of a line on a machine like the nominal one, from a surge margin on.
pub fn expected_readings(margin_ratio: f64, seek: &SurgeSearchSettings) -> usize {
    let (mut flow, mut readings) = (1.0 + margin_ratio, 1);
    while flow > 1.0 + 1.3 * seek.closest_margin_ratio && readings < seek.most_steps {
        let far = flow - 1.0 > FAR_MARGIN_RATIO;
        flow *= 1.0 - if far { FAR_STEP_RATIO.max(seek.step_ratio) } else { seek.step_ratio };
        readings += 1;
    }
    // A few more near surge, where the steps are smaller.
    (readings + 3).min(seek.most_steps)
}

/// Chooses the next move; `readings` has at least one reading. `nominal_margin_ratio`: surge margin of the nominal machine
/// at the last opening; `None` if unknown.
pub fn choose_next_move(
    readings: &[SurgeReading],
    seek: &SurgeSearchSettings,
    nominal_margin_ratio: Option<f64>,
) -> Move {
    let Some(last) = readings.last() else { return Move::Done(LineEnd::MaxSteps) };
    if readings.len() >= seek.most_steps {
        return Move::Done(LineEnd::MaxSteps);
    }
    let opening = last.valve_opening_ratio;
    let estimate = SurgeEstimate::of(readings);
    let Some(estimate) = estimate.filter(|estimate| estimate.is_usable) else {
        let far = nominal_margin_ratio.is_some_and(|margin| margin > FAR_MARGIN_RATIO);
        let step = match estimate {
            // The variation grows, but at too few openings to estimate how fast.
            Some(estimate) if estimate.has_growth => 0.5 * seek.step_ratio,
            _ if far => FAR_STEP_RATIO.max(seek.step_ratio),
            _ => seek.step_ratio,
        };
        return Move::To(opening * (1.0 - step));
    };
    let margin_ratio = estimate.closest_flow_kg_s / estimate.flow_corrected_kg_s - 1.0;
    let near = margin_ratio <= MAX_EXTRAPOLATION * seek.closest_margin_ratio;
    if near && estimate.standard_error_ratio() <= seek.wanted_standard_error_ratio {
        return Move::Done(LineEnd::AccuracyReached);
    }
    // Near surge, pressures hardly change with flow: the flow is proportional to the opening.
    let flow_kg_s = estimate.closest_flow_kg_s;
    let possible_kg_s = estimate.flow_corrected_kg_s + 2.0 * estimate.standard_error_kg_s;
    let safe_kg_s = possible_kg_s.max(estimate.highest_flow_kg_s) * (1.0 + MIN_DISTANCE_RATIO);
    let lowest_kg_s = (flow_kg_s * (1.0 - seek.step_ratio))
        .max(safe_kg_s.min(flow_kg_s * (1.0 - SMALL_STEP_RATIO)))
        .max(estimate.flow_corrected_kg_s * (1.0 + seek.closest_margin_ratio));
    let step = 1.0 - lowest_kg_s / flow_kg_s;
    if step >= MIN_STEP_RATIO {
        return Move::To(opening * (1.0 - step));
    }
    let count = readings.iter().rev().take_while(|reading| reading.valve_opening_ratio == opening).count();
    if count < MAX_READINGS_AT_OPENING { Move::To(opening) } else { Move::Done(LineEnd::DistanceReached) }
}
