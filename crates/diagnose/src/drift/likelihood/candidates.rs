//! All causes with all their time histories, as hypotheses of one likelihood.

use crate::drift::causes::cause::Cause;
use crate::drift::causes::time_history::{Course, CourseKind};
use crate::drift::likelihood::low_rank::LowRank;
use crate::drift::runs::request::Unsolvable;
use crate::drift::sensitivity::readings::Readings;
use mapper_inference::hypotheses::{Hypothesis, Likelihood, Priors};
use nalgebra::DMatrix;

/// Prior probability of drift: one campaign in two has one. Judgement: repeats are made if drift is expected.
const EXPECTED_DRIFTS: f64 = 0.5;
/// Prior weight of rare causes relative to the others: judgement. Sensors at the compressor, its machine and the flow meters drift. The other
/// sensors are better maintained, and few sensors share a common part that drifts.
const SELDOM: f64 = 0.25;

/// Onsets for one of the grid, a grid step to either side of a detected cause: a step of P2 dated 40 s late leaves twenty standard errors in
/// one segment, which other causes would absorb.
const CLOSER: usize = 8;

/// Number of onsets tried over a campaign: the fit refines the onset of a detected cause.
pub(crate) const ONSETS: usize = 36;
/// Number of onsets on the fine grid of a detected cause: closer than the compared segments.
pub(crate) const FINE_ONSETS: usize = ONSETS * CLOSER;

/// A cause, by its position among the observable ones, with a time history.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Candidate {
    pub cause: usize,
    pub course: Course,
}

/// The observable causes, and all their time histories.
pub(crate) struct Candidates {
    pub causes: Vec<Cause>,
    pub all: Vec<Candidate>,
    /// Effect of each on the readings at size 1 (rate per hour, or step), a column each.
    pub shown: DMatrix<f64>,
    /// Their priors.
    pub priors: Priors,
}

impl Candidates {
    /// All causes with `onsets` onsets over the campaign, and closer ones about those that are `known`.
    pub fn new(
        readings: &Readings,
        onsets: usize,
        known: &[(Cause, Course)],
    ) -> Result<Candidates, Unsolvable> {
        let shows = |cause: Cause| Some((cause, readings.signature(cause)?.readings));
        let shown: Vec<(Cause, Vec<f64>)> = Cause::all().into_iter().filter_map(shows).collect();
        let (start_s, end_s) = readings.span_s();
        let courses = courses(start_s, end_s, onsets);
        let mut all: Vec<Candidate> = (0..shown.len())
            .flat_map(|cause| courses.iter().map(move |course| Candidate { cause, course: *course }))
            .collect();
        let on_grid = all.len();
        let spacing_s = (end_s - start_s) / onsets as f64;
        for (known, course) in known {
            let Some(cause) = shown.iter().position(|(cause, _)| cause == known) else { continue };
            let closer = (0..2 * CLOSER).map(|part| ((part as f64 + 0.5) / CLOSER as f64 - 1.0) * spacing_s);
            let onsets_s = closer.map(|by_s| course.onset_s + by_s).chain([course.onset_s]);
            let within = onsets_s.filter(|onset_s| (start_s..end_s).contains(onset_s));
            all.extend(within.map(|onset_s| Candidate { cause, course: Course { onset_s, ..*course } }));
        }
        if all.is_empty() {
            return Err(Unsolvable::NothingShows);
        }
        let weight = |cause: &Cause| if is_seldom(*cause) { SELDOM } else { 1.0 };
        let weights: f64 = shown.iter().map(|(cause, _)| weight(cause)).sum();
        let hypothesis = |(place, Candidate { cause: family, course }): (usize, &Candidate)| {
            let cause = shown[*family].0;
            let sigma = cause.sigma_of(course.kind, end_s - start_s);
            // Onsets next to one of the grid share its prior.
            let share = if place < on_grid { 1.0 } else { 0.5 / CLOSER as f64 };
            let prior = share * EXPECTED_DRIFTS * weight(&cause) / weights / courses.len() as f64;
            Hypothesis {
                family: *family,
                sigma,
                ln_prior: prior.ln(),
                at_least_zero: cause.is_at_least_zero(),
            }
        };
        let hypotheses = all.iter().enumerate().map(hypothesis).collect();
        let value = |row: usize, column: usize| {
            let Candidate { cause, course } = all[column];
            shown[cause].1[row] * mean_of(readings, row, course)
        };
        Ok(Candidates {
            shown: DMatrix::from_fn(readings.difference.len(), all.len(), value),
            causes: shown.iter().map(|(cause, _)| *cause).collect(),
            priors: Priors { always: Vec::new(), hypotheses },
            all,
        })
    }

    /// Evidence of the readings for them, in addition to noise and constants.
    pub fn likelihood(&self, noise: &LowRank, difference: &DMatrix<f64>) -> Likelihood {
        let shown = noise.whiten(self.shown.clone());
        let inverse = noise.inverse_times(&shown);
        let pull = inverse.tr_mul(&noise.whiten(difference.clone()));
        // Not `tr_mul`, which computes dot products one by one: five times as slow for a thousand columns.
        Likelihood::of(shown.transpose() * &inverse, pull.column(0).into_owned())
    }

    pub fn cause(&self, index: usize) -> Cause {
        self.causes[self.all[index].cause]
    }
}

fn is_seldom(cause: Cause) -> bool {
    use mapper_core::Channel::{CompressorFlow, P2, T1, T2, Tc, TurbineFlow};
    match cause {
        Cause::Sensors([channel]) => ![T1, T2, Tc, P2, CompressorFlow, TurbineFlow].contains(channel),
        Cause::Sensors(_) => true,
        Cause::Fouling | Cause::BearingFriction => false,
    }
}

/// Ramps from the start on, steps from after it; both until the remaining time is too short to detect them.
pub(crate) fn courses(start_s: f64, end_s: f64, count: usize) -> Vec<Course> {
    let length_s = end_s - start_s;
    let mut courses = Vec::new();
    for index in 0..count {
        let share = index as f64 / count as f64;
        if share <= 0.88 {
            courses.push(Course { kind: CourseKind::Ramp, onset_s: start_s + share * length_s });
        }
        // A step at the very start is a constant.
        if (0.04..=0.97).contains(&share) {
            courses.push(Course { kind: CourseKind::Step, onset_s: start_s + share * length_s });
        }
    }
    courses
}

pub(crate) fn mean_of(readings: &Readings, row: usize, course: Course) -> f64 {
    let block = &readings.blocks[row / readings.columns.len()];
    let offset_s = readings.steps[block.step].offset_s;
    course.mean(block.start_s + offset_s, block.end_s + offset_s)
}
