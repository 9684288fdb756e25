//! Decides how far the valve may be closed in the next step.

use crate::surge::estimate::SurgeEstimate;
use crate::surge::surge_reading::SurgeReading;
use mapper_core::SurgeSeek;

/// Decision after a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Move {
    /// Go to this opening, relative to the nominal area; if it is the opening of the last reading, repeat the reading.
    To(f64),
    /// The line is done.
    Done(Why),
}

/// Why a line is finished.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Why {
    /// The surge flow is known with the required accuracy.
    Known,
    /// Closing further would violate the required distance or the safe distance.
    NearEnough,
    /// The maximum number of steps was reached.
    Steps,
}

/// Step of the opening while surge is far by the nominal map, ratio.
const FAR_STEP_RATIO: f64 = 0.08;
/// Surge margin of the nominal map beyond which surge is far, ratio: the nominal surge line is uncertain.
const FAR_MARGIN_RATIO: f64 = 0.35;
/// Step that is allowed whatever the highest possible surge flow, ratio. If surge were that near, the variation would already be
/// larger at this opening, and only further readings can decide.
const SMALL_STEP_RATIO: f64 = 0.007;
/// Maximum extrapolation of the law, in multiples of the smallest margin: the start of the growth differs between rigs.
const TRUSTED_MARGINS: f64 = 1.4;
/// Minimum distance to the highest possible surge flow, ratio.
const KEPT_RATIO: f64 = 0.005;
/// Minimum useful step, ratio.
const MIN_STEP_RATIO: f64 = 0.004;
/// Maximum number of readings at one opening.
const MAX_LOOKS: usize = 3;

/// Expected number of readings of a line on a machine like the nominal one, from a surge margin on.
pub fn expected_looks(margin_ratio: f64, seek: &SurgeSeek) -> usize {
    let (mut flow, mut looks) = (1.0 + margin_ratio, 1);
    while flow > 1.0 + 1.3 * seek.closest_margin_ratio && looks < seek.most_steps {
        let far = flow - 1.0 > FAR_MARGIN_RATIO;
        flow *= 1.0 - if far { FAR_STEP_RATIO.max(seek.step_ratio) } else { seek.step_ratio };
        looks += 1;
    }
    // A few more near surge, where the steps get smaller.
    (looks + 3).min(seek.most_steps)
}

/// The next move after these readings, of which there is at least one. `nominal_margin_ratio`: surge margin of the nominal machine
/// at the last opening; `None` if unknown.
pub fn next_move(looks: &[SurgeReading], seek: &SurgeSeek, nominal_margin_ratio: Option<f64>) -> Move {
    let Some(last) = looks.last() else { return Move::Done(Why::Steps) };
    if looks.len() >= seek.most_steps {
        return Move::Done(Why::Steps);
    }
    let opening = last.valve_opening_ratio;
    let estimate = SurgeEstimate::of(looks);
    let Some(estimate) = estimate.filter(|estimate| estimate.seen) else {
        let far = nominal_margin_ratio.is_some_and(|margin| margin > FAR_MARGIN_RATIO);
        let step = match estimate {
            // The variation grows, but at too few openings to estimate how fast.
            Some(estimate) if estimate.grows => 0.5 * seek.step_ratio,
            _ if far => FAR_STEP_RATIO.max(seek.step_ratio),
            _ => seek.step_ratio,
        };
        return Move::To(opening * (1.0 - step));
    };
    let margin_ratio = estimate.closest_flow_kg_s / estimate.flow_corrected_kg_s - 1.0;
    let near = margin_ratio <= TRUSTED_MARGINS * seek.closest_margin_ratio;
    if near && estimate.standard_error_ratio() <= seek.wanted_standard_error_ratio {
        return Move::Done(Why::Known);
    }
    // Near surge, pressures hardly change with flow: the flow is proportional to the opening.
    let flow_kg_s = estimate.closest_flow_kg_s;
    let possible_kg_s = estimate.flow_corrected_kg_s + 2.0 * estimate.standard_error_kg_s;
    let safe_kg_s = possible_kg_s.max(estimate.highest_flow_kg_s) * (1.0 + KEPT_RATIO);
    let lowest_kg_s = (flow_kg_s * (1.0 - seek.step_ratio))
        .max(safe_kg_s.min(flow_kg_s * (1.0 - SMALL_STEP_RATIO)))
        .max(estimate.flow_corrected_kg_s * (1.0 + seek.closest_margin_ratio));
    let step = 1.0 - lowest_kg_s / flow_kg_s;
    if step >= MIN_STEP_RATIO {
        return Move::To(opening * (1.0 - step));
    }
    let here = looks.iter().rev().take_while(|look| look.valve_opening_ratio == opening).count();
    if here < MAX_LOOKS { Move::To(opening) } else { Move::Done(Why::NearEnough) }
}
