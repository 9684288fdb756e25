//! The joint method: all steps of a campaign together.
//!
//! Two things are predicted and compared with the recording: T2 by eqs. 1-3 with the measured housing temperature, and the change of that
//! temperature within each step, by the heat that the gas gives to the housing. Each step keeps its own efficiency. The shared parameters are
//! estimated once, from all steps: the convection law, the area share before the wheel, the probe's lag, the effect of a hotter wall,
//! preheating in the inlet, the housing's balance, the sensors' errors, and how efficiency varies over the map. The housing is one part, or
//! more if the recording says so. See `docs/explanation/identification.md` for the reasons, assumptions and limits.

pub(crate) mod expected;
pub(crate) mod fit;
pub(crate) mod judge;
pub(crate) mod step_model;
pub(crate) mod thermal_model;
pub(crate) mod uncertainty;

use crate::faults::balances::efficiency::FittedEfficiencies;
use crate::joint::fit::input_noise::Whitening;
use crate::joint::fit::refinements::{Gain, Refinements};
use crate::joint::fit::solve::{Covariance, Member, Problem};
use crate::joint::step_model::parameters::{ETA, INLET, LN_INNER_CONDUCTANCE, LOGIT_INNER, bounds};
use crate::joint::step_model::parts::{Division, Parts};
use crate::joint::step_model::rows::{Row, StepRows};
use crate::joint::uncertainty::{Number, Numbers};
use crate::single_step::dynamic::{Estimate, FittedReadings};
use crate::step_data::end_state::EndState;
use crate::step_data::samples;
use crate::step_outcome::findings::Findings;
use crate::{Choice, IdentifyConfig};
use mapper_core::{
    Channel, EstimateUncertainty, FitFailure, LeftOut, Recording, ThermalModel, Verdict, Warning, Window,
    confidence_interval_95,
};
use mapper_numerics::least_squares::ROUNDS;
use mapper_numerics::statistics::rms;
use serde::Serialize;

/// Growth of the points' standard errors above which leaving a region out costs more than it gains. Judgement: a region is excluded if
/// the errors at most double.
const MAX_LOST_RATIO: f64 = 2.0;

/// Maximum error of the efficiencies, fraction, that only the declaration of alpha_A, probe and heating/cooling ratio excludes. Bound:
/// above it, a machine not as declared could pass for one that is.
pub const MAX_PRIOR_SENSITIVITY_ETA: f64 = 0.0125;

/// Channels on which the prediction of a step depends.
const DRIVING: [Channel; 6] =
    [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2, Channel::CompressorFlow];
/// Minimum number of steps for the shared parameters. Bound: coefficient and exponent of a law, and one more.
const MIN_SHARING: usize = 3;

/// Share of steps with frozen readings above which the balance of the housing is not used. Bound: that of the steps that a fit may exclude.
const MAX_FROZEN_SHARE: f64 = 1.0 / 3.0;
/// Number of samples at the limit of a sensor that distort a step. Bound: one could be an outlier, and a second one chance.
const MIN_TOUCHES: usize = 3;

/// ln of the odds above which a housing has more parts. Bound: 150 to 1; recordings of one part give less than 1e-9, of two more than 1e80.
const PARTS_LN_ODDS: f64 = 5.0;
/// Error that is left with three parts over the change from two to three. Bound: an error that falls with the number of parts,
/// (1/3)/(1/2 - 1/3); with its square it would be 0.8.
const LEFT_OVER_CHANGE: f64 = 2.0;
/// Share of the area on the part with the thermocouple up to which the other one may be an inner wall. Bound: recordings of inner walls give less
/// than 0.05.
const INNER_WALL_AREA: f64 = 0.25;

/// The efficiency that the dynamic method (Burke et al.) finds in a step which another method has identified.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DynamicEfficiency {
    /// Place of the step, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::test_plan::step_number::serialize")]
    pub step: usize,
    /// Isentropic efficiency, total to total, fraction.
    pub eta: f64,
    /// Lower end of its 95 % interval.
    pub eta_low: f64,
    /// Upper end.
    pub eta_high: f64,
}

/// Result of the method for a recording.
#[derive(Debug)]
pub(crate) struct Joint {
    pub(crate) estimates: Vec<Estimate>,
    /// Shared parameters of the points; `None` if there are none.
    pub(crate) thermal: Option<ThermalModel>,
    /// Result of the dynamic method for the steps that it can use.
    pub(crate) dynamic: Vec<DynamicEfficiency>,
    /// The efficiencies before the smoothness prior; `None` if nothing was fitted jointly.
    pub(crate) fitted: Option<FittedEfficiencies>,
}

/// Identifies all steps. `end_states` and `findings`: one for each step; a step without an end state gets no estimate. `alone`: each step fitted
/// alone, with its findings. `is_refused`: the readings are refused already, so other explanations are not searched.
pub(crate) fn estimate(
    recording: &Recording,
    end_states: &[Option<EndState>],
    alone: (Vec<Estimate>, Vec<Findings>),
    config: &IdentifyConfig,
    is_refused: bool,
    findings: &mut [Findings],
) -> Joint {
    let (alone, own_findings) = alone;
    let mut dynamic = Vec::new();
    for ((step, estimate), own) in recording.steps.iter().zip(&alone).zip(&own_findings) {
        if let (Some((eta, Some(error))), true) = (estimate.eta, own.verdict != Verdict::Unusable) {
            let (eta_low, eta_high) = confidence_interval_95(eta, error.combined_standard_error());
            dynamic.push(DynamicEfficiency { step: step.index, eta, eta_low, eta_high });
        }
    }
    let steps = fit::start::steps(recording, end_states, config, findings);
    let frozen: Vec<bool> = frozen_steps(recording, &steps, findings);
    let mut without_balance = config.clone();
    without_balance.joint.balance = Choice::Fixed;
    // The balance follows Tc through the run: where it is missing in many steps, the others do not determine what it determines.
    let is_interrupted =
        frozen.iter().filter(|is_frozen| **is_frozen).count() as f64 > MAX_FROZEN_SHARE * steps.len() as f64;
    let config = if is_interrupted { &without_balance } else { config };
    let attempt = match Attempt::new(&steps, &frozen, &alone, config) {
        Some(first) if !is_refused && !first.thermal.doubts.is_empty() => {
            Some(first.without_a_region(&steps, config).unwrap_or(first))
        }
        first => first,
    };
    let Some(attempt) = attempt else {
        // Single-step results are better than none.
        let mut estimates = vec![Estimate::default(); recording.steps.len()];
        for step in &steps {
            findings[step.position].doubt(Warning::FitFailed(FitFailure::AllSteps));
            estimates[step.position] = alone[step.position].clone();
        }
        return Joint { estimates, thermal: None, dynamic, fitted: None };
    };
    let truncation = attempt.truncation.as_deref();
    let fitted = uncertainty::as_measured(&attempt.problem, &steps, truncation, config);
    let Attempt { problem, numbers, thermal, prior_sensitivity, left_out, .. } = attempt;
    let mut estimates = vec![Estimate::default(); recording.steps.len()];
    let predictions = problem.predictions(&problem.shared, &problem.locals(), None);
    let whitened = problem.whitened();
    for (i, (member, step)) in problem.members.iter().zip(&steps).enumerate() {
        let own = &mut findings[step.position];
        let (Number { value: eta, uncertainty: eta_error, interval, .. }, ln_h) =
            (numbers.eta[i], numbers.ln_h[i]);
        let fitted_h_w_m2k = problem.model.at_end(&step.end, &problem.shared, &member.local).h_w_m2k;
        let h_w_m2k = fitted_h_w_m2k * ln_h.value.exp();
        let h_error = EstimateUncertainty {
            noise_standard_error: h_w_m2k * ln_h.uncertainty.noise_standard_error,
            bias_standard_error: h_w_m2k * ln_h.uncertainty.bias_standard_error,
        };
        let errors = [eta_error, h_error].map(|error| error.combined_standard_error());
        if ![eta, h_w_m2k, errors[0], errors[1]].iter().all(|number| number.is_finite()) {
            own.refuse(Warning::FitFailed(FitFailure::NotFinite));
            continue;
        }
        let (first, last) = (step.rows.first(), step.rows.last());
        let change = |read: fn(&Row) -> f64| first.zip(last).map(|(first, last)| read(last) - read(first));
        let t_s: Vec<f64> = step.rows.iter().map(|row| row.t_s).collect();
        let rows = t_s.len().max(1);
        let of_channels = member.measured_k.chunks(rows).zip(predictions[i].readings_k.chunks(rows));
        let fitted: Vec<FittedReadings> = [Channel::T2, Channel::Tc]
            .into_iter()
            .zip(of_channels)
            .map(|(channel, (read_k, fitted_k))| FittedReadings {
                channel,
                t_s: t_s.clone(),
                read_k: read_k.to_vec(),
                fitted_k: fitted_k.to_vec(),
            })
            .collect();
        let residual =
            fitted.first().map(|t2| t2.read_k.iter().zip(&t2.fitted_k).map(|(read, found)| read - found));
        let [eta_rows, ln_h_rows] = numbers.budgets[i].clone();
        let eta_rows = eta_rows.into_iter().map(|row| uncertainty::in_unit(row, 1.0, "1")).collect();
        let h_rows =
            ln_h_rows.into_iter().map(|row| uncertainty::in_unit(row, h_w_m2k, "W/(m2 K)")).collect();
        estimates[step.position] = Estimate {
            budgets: [eta_rows, h_rows],
            eta_errors: numbers.eta_errors[i].clone(),
            eta: Some((eta, Some(eta_error))),
            h_w_m2k: Some((h_w_m2k, Some(h_error))),
            intervals: Some([
                interval,
                (fitted_h_w_m2k * ln_h.interval.0.exp(), fitted_h_w_m2k * ln_h.interval.1.exp()),
            ]),
            common: [
                numbers.common[0][i].clone(),
                numbers.common[1][i].iter().map(|by_ln_h| h_w_m2k * by_ln_h).collect(),
            ],
            window: first.zip(last).map(|(first, last)| Window { start_s: first.t_s, end_s: last.t_s }),
            residual_rms_k: residual.and_then(rms),
            fitted,
            dt2_k: change(|row| row.t2_k),
            dtc_k: change(|row| row.tc_k),
        };
        let dt2_k = estimates[step.position].dt2_k;
        judge::judge_step(&problem, (i, &whitened[i]), eta_error, dt2_k, config, own);
        if let Some(region) = left_out.as_ref().filter(|_| member.excluded) {
            own.doubt(Warning::LeftOut(region.clone()));
        }
        if !samples::begins_with_jump(&recording.steps, step.position) {
            own.remark(Warning::FromConvectionLaw { convection_origin: None });
        }
        own.remark_undeclared(config);
        if prior_sensitivity > MAX_PRIOR_SENSITIVITY_ETA {
            own.doubt(Warning::PriorDominated { eta_error: prior_sensitivity });
        }
        for doubt in &thermal.doubts {
            own.doubt(Warning::ModelDoubted(doubt.clone()));
        }
    }
    Joint { estimates, thermal: Some(thermal), dynamic, fitted }
}

/// Whether a reading on which the prediction depends stood still in each step, or touched the end of its range if it stood still in another: gas
/// and housing did not.
fn frozen_steps(recording: &Recording, steps: &[StepRows], findings: &[Findings]) -> Vec<bool> {
    let stuck = |step: &StepRows| {
        findings[step.position].warnings.iter().find_map(|warning| match warning {
            Warning::Stuck { channel, .. } | Warning::FrozenChannel { channel, .. } => Some(*channel),
            _ => None,
        })
    };
    let mut limits: Vec<(Channel, f64)> = Vec::new();
    for channel in
        DRIVING.into_iter().filter(|channel| steps.iter().any(|step| stuck(step) == Some(*channel)))
    {
        let values = recording.series.get(&channel).map_or(&[][..], |series| &series.values);
        limits.push((channel, values.iter().copied().fold(f64::NEG_INFINITY, f64::max)));
        limits.push((channel, values.iter().copied().fold(f64::INFINITY, f64::min)));
    }
    let touches = |step: &StepRows, (channel, limit): &(Channel, f64)| {
        let of = recording.series.get(channel).zip(recording.steps.get(step.position));
        of.is_some_and(|(series, marker)| {
            let values = series.slice(marker.start_s, marker.end_s).1;
            values.iter().filter(|value| *value == limit).count() >= MIN_TOUCHES
        })
    };
    let is_frozen = |step: &StepRows| {
        stuck(step).is_some_and(|channel| DRIVING.contains(&channel))
            || limits.iter().any(|limit| touches(step, limit))
    };
    steps.iter().map(is_frozen).collect()
}

/// A fit with its results.
struct Attempt<'a> {
    problem: Problem<'a>,
    covariance: Covariance,
    numbers: Numbers,
    thermal: ThermalModel,
    /// Error of the efficiencies if parameters shrunk to their declared values are not as declared, fraction.
    prior_sensitivity: f64,
    /// See [`Fitted`].
    truncation: Option<Vec<[f64; 2]>>,
    /// Reason for excluding the excluded steps, if any.
    left_out: Option<LeftOut>,
}

impl<'a> Attempt<'a> {
    /// `frozen`: steps with readings that stood still, which the shared parameters do without if enough others are left.
    fn new(
        steps: &'a [StepRows],
        frozen: &[bool],
        alone: &[Estimate],
        config: &IdentifyConfig,
    ) -> Option<Self> {
        let mut problem = fit::start::problem(steps, alone, config)?;
        if frozen.iter().filter(|is_frozen| !**is_frozen).count() >= MIN_SHARING {
            for (member, is_frozen) in problem.members.iter_mut().zip(frozen) {
                (member.contributes, member.excluded) = (!is_frozen, *is_frozen);
            }
        }
        let fitted = best_housing(&mut problem, steps, config)?;
        Attempt::of(problem, fitted, steps, config)
    }

    /// The fit without some steps, from this one on.
    fn without(&self, excluded: &[usize], steps: &'a [StepRows], config: &IdentifyConfig) -> Option<Self> {
        let mut problem = self.problem.clone();
        problem.active[INLET] = false;
        for index in excluded {
            let member = problem.members.get_mut(*index)?;
            (member.contributes, member.excluded) = (false, true);
        }
        minimise(&mut problem, config)?;
        let mut fitted = Fitted::of(&mut problem, config)?;
        fitted.truncation = self.truncation.clone();
        Attempt::of(problem, fitted, steps, config)
    }

    fn of(
        problem: Problem<'a>,
        fitted: Fitted,
        steps: &'a [StepRows],
        config: &IdentifyConfig,
    ) -> Option<Self> {
        let numbers = fitted.numbers(&problem, steps);
        let Fitted { covariance, refined, prior_sensitivity, truncation } = fitted;
        let refinements = refined.as_ref().map(|(refinements, _)| refinements);
        let thermal =
            thermal_model::thermal_model(&problem, &covariance, &numbers, refinements, steps, config);
        Some(Attempt { problem, covariance, numbers, thermal, prior_sensitivity, truncation, left_out: None })
    }

    /// The fit without the region of the map that disagrees most, if any.
    fn without_a_region(&self, steps: &'a [StepRows], config: &IdentifyConfig) -> Option<Self> {
        judge::regions(steps).into_iter().find_map(|of_size| {
            let rests = of_size.into_iter().filter_map(|region| {
                let rest = self.without(&region.steps, steps, config)?;
                let undoubted = rest.thermal.doubts.is_empty() && judge::fits(&rest.problem);
                let sigmas = judge::disagreement(
                    (&self.problem, &self.covariance),
                    (&rest.problem, &rest.covariance),
                )?;
                // The remaining steps must still determine the shared parameters.
                let knows = rest.numbers.middle_error() < MAX_LOST_RATIO * self.numbers.middle_error();
                (undoubted && knows).then_some((region, rest, sigmas))
            });
            let (region, mut rest, sigmas) = rests.max_by(|a, b| a.2.total_cmp(&b.2))?;
            let doubts = self.thermal.doubts.clone();
            rest.left_out = Some(LeftOut::Region { region: region.region, sigmas, doubts });
            Some(rest)
        })
    }
}

/// A problem at its minimum.
struct Fitted {
    covariance: Covariance,
    /// `None` without parameters with a prior to search for.
    refined: Option<(Refinements, Gain)>,
    /// Dependence of the efficiencies on the declaration, fraction.
    prior_sensitivity: f64,
    /// Error that a housing of three parts leaves in each step's efficiency and ln h, by its change from two parts; `None` for other housings.
    truncation: Option<Vec<[f64; 2]>>,
}

/// Fits a housing of one part and of two, and keeps the one that the recording favours. Where the gas touches both parts, the real housing
/// has no parts but conducts everywhere: then a third part is added, and the change that it makes gives the error that is left.
fn best_housing<'a>(
    problem: &mut Problem<'a>,
    steps: &'a [StepRows],
    config: &IdentifyConfig,
) -> Option<Fitted> {
    // A fit of one part has moved its parameters to imitate a second one, so all begin at the start.
    let mut start = problem.clone();
    start.members.iter_mut().for_each(|member| member.whitening = Whitening::default());
    minimise(problem, config)?;
    if !problem.model.has_balance || !judge::may_have_parts(problem) {
        return Fitted::of(problem, config);
    }
    for parts in [Parts::Two, Parts::InnerWall] {
        // An inner wall is the limit in which it has all of the area.
        let two_touched = problem.model.parts == Parts::Two
            && Division::of(Parts::Two, &problem.shared).area[0] > INNER_WALL_AREA;
        if parts == Parts::InnerWall && two_touched {
            continue;
        }
        let mut other = fit::start::with_parts(&start, parts);
        fit::step_noise::begin(&mut other, config)?;
        let favoured = minimise_in_stages(&mut other, config)
            .and_then(|()| Some(other.ln_evidence()? - problem.ln_evidence()?));
        // On a bound the part does not exist, and Laplace's method does not hold there.
        let is_inside = [LOGIT_INNER, LN_INNER_CONDUCTANCE].into_iter().all(|index| {
            let (low, high) = bounds(index);
            other.shared[index] > low && other.shared[index] < high
        });
        if is_inside && favoured.is_some_and(|ln_odds| ln_odds > PARTS_LN_ODDS) {
            *problem = other;
        }
    }
    if problem.model.parts != Parts::Two {
        return Fitted::of(problem, config);
    }
    let (two, before) = (problem.shared, point_values(problem, steps));
    *problem = fit::start::with_parts(problem, Parts::Three);
    minimise(problem, config)?;
    problem.left_over = std::array::from_fn(|index| LEFT_OVER_CHANGE * (problem.shared[index] - two[index]));
    let after = point_values(problem, steps);
    let mut fitted = Fitted::of(problem, config)?;
    let left =
        |(after, before): (&[f64; 2], &[f64; 2])| [0, 1].map(|k| LEFT_OVER_CHANGE * (after[k] - before[k]));
    fitted.truncation = Some(after.iter().zip(&before).map(left).collect());
    Some(fitted)
}

/// Efficiency and ln h of each step.
fn point_values(problem: &Problem<'_>, steps: &[StepRows]) -> Vec<[f64; 2]> {
    let of = |(step, member): (&StepRows, &Member<'_>)| {
        let h_w_m2k = problem.model.at_end(&step.end, &problem.shared, &member.local).h_w_m2k;
        [member.local[ETA], h_w_m2k.ln()]
    };
    steps.iter().zip(&problem.members).map(of).collect()
}

/// Fits law, efficiencies and housing first, with all parameters that may be neutral as declared: far from the minimum they imitate another part.
fn minimise_in_stages(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<()> {
    let sought = fit::refinements::sought(problem);
    sought.iter().for_each(|refinement| problem.active[refinement.index] = false);
    approach(problem, config)?;
    sought.iter().for_each(|refinement| problem.active[refinement.index] = true);
    minimise(problem, config)
}

/// Fits, estimates noise and spreads from the fit, excludes steps that fit far worse, and fits again.
fn minimise(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<()> {
    approach(problem, config)?;
    problem.minimise()?;
    Some(())
}

/// The same without the last fit.
fn approach(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<()> {
    for _ in 0..ROUNDS {
        problem.minimise_roughly()?;
        fit::start::refine(problem, config)?;
        judge::exclude(problem, config);
    }
    Some(())
}

impl Fitted {
    /// Evaluates the parameters with a prior of a problem at its minimum, and moves it to the mean of their mixture.
    fn of(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<Self> {
        let inlet_sigma = fit::refinements::settle_inlet(problem)?;
        let open = problem.clone();
        let refinements = fit::refinements::settle(problem, config)?;
        let (covariance, gain) = covariance(problem, refinements.as_ref(), inlet_sigma)?;
        let prior_sensitivity = match &refinements {
            Some(found) => fit::refinements::prior_sensitivity(&open, Some(found))?,
            None => 0.0,
        };
        Some(Fitted { covariance, refined: refinements.zip(gain), prior_sensitivity, truncation: None })
    }

    fn numbers(&self, problem: &Problem<'_>, steps: &[StepRows]) -> Numbers {
        let known = self.refined.as_ref().map(|(refinements, gain)| (refinements, gain));
        let numbers = Numbers::of(problem, &self.covariance, known, steps);
        match &self.truncation {
            Some(changes) => numbers.with_truncation(changes),
            None => numbers,
        }
    }
}

/// The covariance of a problem at the mean of the mixture, including the uncertainty from the mixture and the inlet model; and the regression
/// of all parameters on those with a prior.
fn covariance(
    problem: &mut Problem<'_>,
    refinements: Option<&Refinements>,
    inlet_sigma: Option<f64>,
) -> Option<(Covariance, Option<Gain>)> {
    problem.active[INLET] = false;
    let mut covariance = problem.covariance()?;
    let mut gain = match refinements {
        Some(refinements) => Some(refinements.apply(&mut covariance)?),
        None => None,
    };
    if let Some(sigma) = inlet_sigma {
        covariance = fit::refinements::carry(problem, sigma, &covariance)?;
        let row = covariance.row_of(INLET)?;
        gain = gain.map(|gain| gain.with_row(row));
    }
    Some((covariance, gain))
}
