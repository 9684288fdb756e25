//! Sizes and onsets of detected causes, fitted together with all constants.

use crate::drift::causes::cause::Cause;
use crate::drift::causes::time_history::Course;
use crate::drift::likelihood::candidates::{FINE_ONSETS, courses, mean_of};
use crate::drift::likelihood::low_rank::LowRank;
use crate::drift::runs::request::{DriftError, Unsolvable};
use crate::drift::sensitivity::readings::Readings;
use mapper_inference::descent::{ENOUGH, ROUNDS};
use mapper_numerics::statistics::{CHI_SQUARE_1_95, NORMAL_975};
use nalgebra::{DMatrix, DVector};

/// A cause with its best time history and size.
#[derive(Debug, Clone)]
pub(crate) struct Fit {
    pub cause: Cause,
    /// Best time history.
    pub course: Course,
    /// Rate or step, unit of the cause.
    pub size: f64,
    /// 95 % interval of the size: the widest over the onsets compatible with the readings.
    pub low: f64,
    pub high: f64,
    /// 95 % interval of the onset, campaign time, s.
    pub onset_low_s: f64,
    pub onset_high_s: f64,
}

impl Fit {
    /// Size of the drift at a campaign time, unit of the cause.
    pub fn drift_at(&self, t_s: f64) -> f64 {
        self.size * self.course.at(t_s)
    }
}

/// All drifts, with the constants.
pub(crate) struct Fits {
    pub drifts: Vec<Fit>,
    /// Most probable constants, in standard deviations.
    pub constants: DVector<f64>,
    /// Noise and constants.
    pub noise: LowRank,
}

/// Jointly fits all causes, each with a time history of the given kind and initial onset.
pub(crate) fn fit(
    readings: &Readings,
    own: &[DMatrix<f64>],
    columns: &DMatrix<f64>,
    found: &[(Cause, Course)],
) -> Result<Fits, DriftError> {
    let mut found = found.to_vec();
    let mut drifts = Vec::new();
    for _ in 0..if found.len() > 1 { ROUNDS } else { 1 } {
        drifts.clear();
        for place in 0..found.len() {
            let others: Vec<(Cause, Course)> =
                found.iter().enumerate().filter(|(other, _)| *other != place).map(|(_, one)| *one).collect();
            let noise = LowRank::new(own, &with_others(readings, columns, &others)?)?;
            let fit = fit_one(readings, &noise, found[place])?;
            found[place].1 = fit.course;
            drifts.push(fit);
        }
    }
    let mut left = DMatrix::from_column_slice(readings.difference.len(), 1, &readings.difference);
    for Fit { cause, course, size, .. } in &drifts {
        let shown = column(readings, *cause, *course)?;
        left.iter_mut().zip(shown).for_each(|(left, shown)| *left -= size * shown);
    }
    let noise = LowRank::new(own, columns)?;
    let constants = noise.constants(&noise.whiten(left)).column(0).into_owned();
    Ok(Fits { drifts, constants, noise })
}

/// The constants, and the other drifts with their prior sizes.
fn with_others(
    readings: &Readings,
    columns: &DMatrix<f64>,
    others: &[(Cause, Course)],
) -> Result<DMatrix<f64>, DriftError> {
    let (start_s, end_s) = readings.span_s();
    let mut all = columns.clone().resize_horizontally(columns.ncols() + others.len(), 0.0);
    for (place, (cause, course)) in others.iter().enumerate() {
        let sigma = cause.sigma_of(course.kind, end_s - start_s);
        let shown = column(readings, *cause, *course)?;
        all.column_mut(columns.ncols() + place)
            .iter_mut()
            .zip(shown)
            .for_each(|(all, shown)| *all = sigma * shown);
    }
    Ok(all)
}

/// Effect of a cause of size 1 with a time history on the readings.
fn column(readings: &Readings, cause: Cause, course: Course) -> Result<Vec<f64>, DriftError> {
    let signature = readings.signature(cause).ok_or(Unsolvable::Hidden { cause })?;
    let at = |(row, value): (usize, &f64)| value * mean_of(readings, row, course);
    Ok(signature.readings.iter().enumerate().map(at).collect())
}

/// One cause with time histories of one kind. `noise` includes everything else.
fn fit_one(readings: &Readings, noise: &LowRank, (cause, begun): (Cause, Course)) -> Result<Fit, DriftError> {
    let nothing = || Unsolvable::Hidden { cause };
    let (start_s, end_s) = readings.span_s();
    let fine: Vec<Course> =
        courses(start_s, end_s, FINE_ONSETS).into_iter().filter(|course| course.kind == begun.kind).collect();
    let mut shown = DMatrix::zeros(readings.difference.len(), fine.len());
    for (index, course) in fine.iter().enumerate() {
        shown.set_column(index, &DVector::from_vec(column(readings, cause, *course)?));
    }
    let shown = noise.whiten(shown);
    let inverse = noise.inverse_times(&shown);
    let difference = DMatrix::from_column_slice(readings.difference.len(), 1, &readings.difference);
    let pull = inverse.tr_mul(&noise.whiten(difference));
    let information: Vec<f64> = (0..fine.len())
        .map(|index| shown.column(index).dot(&inverse.column(index)).max(f64::MIN_POSITIVE))
        .collect();
    let size = |index: usize| {
        let size = pull[index] / information[index];
        if cause.is_at_least_zero() { size.max(0.0) } else { size }
    };
    let sigma = |index: usize| information[index].sqrt().recip();
    let evidence = |index: usize| size(index).powi(2) * information[index];
    let best = (0..fine.len()).max_by(|a, b| evidence(*a).total_cmp(&evidence(*b))).ok_or_else(nothing)?;
    // During a gap in the readings all onsets are equally good: the middle one has the smallest error.
    let as_good = |index: &usize| evidence(*index) > evidence(best) - ENOUGH;
    let first = (0..=best).rev().take_while(as_good).last().unwrap_or(best);
    let last = (best..fine.len()).take_while(as_good).last().unwrap_or(best);
    let peak = first.midpoint(last);
    let within: Vec<usize> =
        (0..fine.len()).filter(|index| evidence(*index) > evidence(peak) - CHI_SQUARE_1_95).collect();
    let extreme = |value: &dyn Fn(usize) -> f64, sign: f64| {
        sign * within.iter().map(|index| sign * value(*index)).fold(f64::NEG_INFINITY, f64::max)
    };
    Ok(Fit {
        cause,
        course: fine[peak],
        size: size(peak),
        low: extreme(&|index| size(index) - NORMAL_975 * sigma(index), -1.0),
        high: extreme(&|index| size(index) + NORMAL_975 * sigma(index), 1.0),
        onset_low_s: extreme(&|index| fine[index].onset_s, -1.0),
        onset_high_s: extreme(&|index| fine[index].onset_s, 1.0),
    })
}
