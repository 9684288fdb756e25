//! Size and onset of one cause, with everything that is constant fitted beside it.

use crate::candidates::{Candidate, courses, mean_of, weigh};
use crate::cause::Cause;
use crate::course::{Course, CourseKind};
use crate::low_rank::LowRank;
use crate::readings::Readings;
use crate::request::{DriftError, Unsolvable};
use mapper_numerics::statistics::{CHI_SQUARE_1_95, NORMAL_975};
use nalgebra::{DMatrix, DVector};

/// Onsets on the fine grid of the cause that is found.
const FINE_ONSETS: usize = 280;
/// Evidence that is not a difference.
const AS_GOOD: f64 = 0.1;
/// A cause with its best course and size.
pub(crate) struct Fit {
    /// Best course.
    pub course: Course,
    /// Rate or step, unit of the cause.
    pub size: f64,
    /// 95 % interval of the size: the widest over the onsets that the readings allow.
    pub low: f64,
    pub high: f64,
    /// 95 % interval of the onset, time of the campaign, s.
    pub onset_low_s: f64,
    pub onset_high_s: f64,
    /// Most probable constants beside it, in standard deviations.
    pub constants: DVector<f64>,
    /// Noise and constants.
    pub noise: LowRank,
}

impl Fit {
    /// Size of the drift at a time of the campaign, unit of the cause.
    pub fn drift_at(&self, t_s: f64) -> f64 {
        self.size * self.course.at(t_s)
    }
}

/// Fits a cause with courses of one kind. `noise` has the constants in it.
pub(crate) fn fit(
    readings: &Readings,
    noise: LowRank,
    cause: Cause,
    kind: CourseKind,
) -> Result<Fit, DriftError> {
    let nothing = || Unsolvable::Hidden { cause };
    let signature = readings.signature(cause).ok_or_else(nothing)?;
    let (start_s, end_s) = readings.span_s();
    let fine: Vec<Candidate> = courses(start_s, end_s, FINE_ONSETS)
        .into_iter()
        .filter(|course| course.kind == kind)
        .map(|course| Candidate { cause: 0, course })
        .collect();
    let shown = noise.whiten(DMatrix::from_fn(readings.difference.len(), fine.len(), |row, column| {
        signature.readings[row] * mean_of(readings, row, fine[column].course)
    }));
    let inverse = noise.inverse_times(&shown);
    let difference = DMatrix::from_column_slice(readings.difference.len(), 1, &readings.difference);
    let whitened = noise.whiten(difference);
    let profile = weigh(&[(cause, signature.readings)], &fine, &whitened, &shown, &inverse);
    let best = (0..fine.len())
        .max_by(|a, b| profile.evidence[*a].total_cmp(&profile.evidence[*b]))
        .ok_or_else(nothing)?;
    // Where nothing is read for a while, all onsets within are equally good: the middle one is the least wrong.
    let as_good = |index: &usize| profile.evidence[*index] > profile.evidence[best] - AS_GOOD;
    let first = (0..=best).rev().take_while(as_good).last().unwrap_or(best);
    let last = (best..fine.len()).take_while(as_good).last().unwrap_or(best);
    let peak = first.midpoint(last);
    let within: Vec<usize> = (0..fine.len())
        .filter(|index| profile.evidence[*index] > profile.evidence[peak] - CHI_SQUARE_1_95)
        .collect();
    let extreme = |value: &dyn Fn(usize) -> f64, sign: f64| {
        sign * within.iter().map(|index| sign * value(*index)).fold(f64::NEG_INFINITY, f64::max)
    };
    let left = &whitened - shown.columns(peak, 1) * profile.size[peak];
    Ok(Fit {
        course: fine[peak].course,
        size: profile.size[peak],
        low: extreme(&|index| profile.size[index] - NORMAL_975 * profile.sigma[index], -1.0),
        high: extreme(&|index| profile.size[index] + NORMAL_975 * profile.sigma[index], 1.0),
        onset_low_s: extreme(&|index| fine[index].course.onset_s, -1.0),
        onset_high_s: extreme(&|index| fine[index].course.onset_s, 1.0),
        constants: noise.constants(&left).column(0).into_owned(),
        noise,
    })
}
