//! Prepares a recording for the fit, and estimates noise and spreads from the fit.

use crate::faults::smooth::ANY_ROUGHNESS;
use crate::joint::fit::inlet;
use crate::joint::fit::input_noise_spline::InputNoiseSpline;
use crate::joint::fit::solve::{Member, Problem};
use crate::joint::step_model::model::reynolds;
use crate::joint::step_model::model::{Setting, StepHistory};
use crate::joint::step_model::parameters::{
    ALPHA, BAROMETER, BENDS, ETA, EXPONENT, FIRST_READING, FLOW_GAIN, GAIN_CHANNELS, GAINS, HUMIDITY, INLET,
    LN_AREA, LN_COEFFICIENT, LN_DEVIATION, LN_HEATING_COOLING_RATIO, LOCAL, OFFSET_CHANNELS, OFFSETS,
    PROBE_MM2, Prior, REFINEMENTS, SHARED, SLOPE, SURFACE,
};
use crate::joint::step_model::rows::{StepRows, condensed};
use crate::joint::step_model::smoothing::SHORTEST_HALF_S;
use crate::joint::step_model::surface::{SurfaceScale, TERM_COUNT, dot};
use crate::single_step::dynamic::{self, Estimate};
use crate::step_data::cleaning::cleaned;
use crate::step_data::end_state::EndState;
use crate::step_data::samples::{Row, Samples};
use crate::step_data::window;
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, WindowRule, step_data::commands};
use mapper_core::unit_factors::MM_PER_M;
use mapper_core::{Channel, Choice, Recording, TooFew, Warning, Window};
use mapper_numerics::coloured_noise::{BlockNoise, WhiteningFilter};
use mapper_numerics::parallel;
use mapper_numerics::statistics::{DOUBT_SIGMAS, mean};
use mapper_observe::declared::usual_noise_sigma;
use nalgebra::DVector;

/// Prior of ln of the Nusselt coefficient about that of Appendix A, one standard deviation. Bound: a factor of 20 either way, more than
/// correlations of pipes, bends and volutes differ.
const LN_COEFFICIENT_SIGMA: f64 = 3.0;
/// Prior of the Reynolds number's exponent. Source: 0.8 for turbulent pipes (Dittus and Boelter), 1.13 in Appendix A of the paper.
const EXPONENT_MEAN: f64 = 0.9;
/// Its standard deviation. Bound: from laminar, 0.3, to proportional to flow and above, 1.4.
const EXPONENT_SIGMA: f64 = 0.5;
/// Minimum start value of the square of a fitted probe's diameter, mm2. Bound: a start value only; at 0 the derivative would vanish.
const START_PROBE_MM2: f64 = 0.5;
/// Efficiencies of single steps that count for the start value. Bound: those of compressors, choke included.
const START_ETAS: std::ops::Range<f64> = 0.2..0.95;
/// Start value of the efficiency if no step gives one. Bound: a start value only; mean of compressor maps.
const USUAL_ETA: f64 = 0.65;
/// Range of a step's start value. Bound: a start value only.
const START_CLAMP_ETA: (f64, f64) = (0.3, 0.9);
/// Spread of h about the law before the recording determines it. Bound: a start value only, three times [`LAW_SIGMA`].
const START_DEVIATION_SIGMA: f64 = 0.01;
/// Error of the first reading as the state of the probe, K, one standard deviation. Bound: above any lag after the first seconds.
const FIRST_READING_SIGMA_K: f64 = 5.0;
/// Error of the surface's slope within a step, ratio, one standard deviation. Judgement: surfaces through a few points bend differently from maps.
const SLOPE_SIGMA: f64 = 0.05;
/// Step of the logarithm of the spreads that are tried. Bound: spreads a tenth apart give the same weights to the points.
const SPREAD_STEP_LN: f64 = 0.1;
/// Parameters of a step that its residual determines. Source: degrees of freedom: efficiency, first reading and h.
const FITTED_PER_STEP: f64 = 3.0;
/// Minimum noise of a block mean, K. Bound: rounding of readings to 0.001 K.
const MIN_NOISE_K: f64 = 3e-4;
/// Minimum share of white noise in the noise of a step. Bound: keeps the whitening regular.
const MIN_WHITE_RATIO: f64 = 0.1;

/// Start of the used part of a step after the last command change without noise, s: h and efficiency are modelled while the operating point
/// settles, and the first seconds only show where the surface is wrong.
pub(crate) const START_S: f64 = SHORTEST_HALF_S;
/// The same with noise, s. Noise can look like a slow probe but for the seconds right after the jump, where the two differ by tens of
/// kelvin. Calibrated: `benches/identification.py`. Inputs are smoothed over 3 s at first: starting at 1.5 s made a probe of 0.7 mm 0.026
/// mm too small, from 2 s on it is within its error (mean of 20 seeds).
pub(crate) const START_WITH_NOISE_S: f64 = 2.0;
/// Expected spread of the points' efficiencies about the surface, fraction: maps are not polynomials. Calibrated:
/// `benches/identification.py`, 0.0006; a machine with a map that drops steeply at choke has 0.005.
pub(crate) const SURFACE_SIGMA: f64 = 1e-3;
/// Relative error of the surface's effect on a prediction. Judgement: surfaces
/// through a few points bend differently from maps.
const SHAPE_ERROR_RATIO: f64 = 0.03;
/// Expected spread of the points' h about the law, ratio. Calibrated: `benches/identification.py`, 0.0022 to 0.003.
pub(crate) const LAW_SIGMA: f64 = 3e-3;
/// Weight of the expected spread, in points. Bound: small next to the dozens of points of a campaign, sufficient without any.
const PRIOR_WEIGHT: f64 = 4.0;
/// Logarithms, in tenths, of the spreads that are tried over the expected one. Bound: from a thirtieth to thirty times.
const SPREAD_RATIOS_LN: std::ops::RangeInclusive<i32> = -34..=34;

/// Condenses every step that has a window with enough samples.
pub(crate) fn steps(
    recording: &Recording,
    end_states: &[Option<EndState>],
    config: &IdentifyConfig,
    findings: &mut [Findings],
) -> Vec<StepRows> {
    let states: Vec<(usize, &EndState)> = end_states
        .iter()
        .enumerate()
        .filter_map(|(position, state)| Some((position, state.as_ref()?)))
        .collect();
    let found = parallel::map(&states, |(position, state)| {
        let mut own = Findings::new();
        (rows_of(recording, *position, state, config, &mut own), own)
    });
    let mut steps = Vec::new();
    for ((position, _), (rows, own)) in states.into_iter().zip(found) {
        if let Some(findings) = findings.get_mut(position) {
            findings.take(own);
            steps.extend(rows);
        }
    }
    steps
}

/// Condenses one step.
fn rows_of(
    recording: &Recording,
    position: usize,
    end_state: &EndState,
    config: &IdentifyConfig,
    own: &mut Findings,
) -> Option<StepRows> {
    let step = recording.steps.get(position)?;
    let after_s = if config.declared.is_empty() { START_S } else { START_WITH_NOISE_S };
    let start_s = commands::settled_s(recording, step).max(step.start_s) + after_s;
    let window = Window { start_s, end_s: step.end_s };
    if start_s.is_nan() || start_s >= step.end_s {
        let late = TooFew::LateCommands { before_end_s: step.end_s - start_s };
        own.refuse(Warning::TooFewSamples(late));
        return None;
    }
    let samples = cleaned(Samples::of(recording, window, config, true), config, own);
    if !dynamic::enough(&samples, config, own) {
        return None;
    }
    if !config.declared.is_empty() {
        // The fit follows changes within the step, but the point is the settled end of the step.
        let needed_s = WindowRule::settled_end_s(step.end_s - step.start_s);
        if let Some(window::Settling { slowest, settled_s, whole: false, .. }) =
            window::settling(recording, step, &config.settle_bands)
            && settled_s < needed_s.floor()
        {
            let quantity = slowest.to_owned();
            own.doubt(Warning::NotStabilised { quantity, settled_s, needed_s, used_s: None });
        }
    }
    condensed(recording, position, &samples, end_state, config)
}

/// The fit with its start values.
pub(crate) fn problem<'a>(
    steps: &'a [StepRows],
    alone: &[Estimate],
    config: &IdentifyConfig,
) -> Option<Problem<'a>> {
    let places: Vec<(f64, f64)> = steps.iter().map(|step| step.end.place).collect();
    let scale = SurfaceScale::of(&places)?;
    let choice = &config.joint;
    let reynolds = |step: &StepRows| reynolds(step.end.flow_kg_s, config.outlet_diameter_m, step.end.t2_k);
    let ln_reference = steps.iter().map(|step| reynolds(step).ln()).sum::<f64>() / steps.len() as f64;
    let setting = Setting {
        rest_pressure_pa: config.rest_pressure_pa,
        air: config.air,
        internal_area_m2: config.internal_area_m2,
        outlet_diameter_m: config.outlet_diameter_m,
        inlet_diameter_m: config.inlet_diameter_m,
        reynolds_reference: ln_reference.exp(),
    };

    let free = Prior { mean: 0.0, sigma: f64::INFINITY };
    let mut priors = [free; SHARED];
    let mut shared = [0.0; SHARED];
    let mut active = [false; SHARED];
    let mut lowest = [f64::NEG_INFINITY; SHARED];
    let law = mapper_physics::machine::params::Params::default().compressor;
    shared[EXPONENT] = law.nusselt_exponent;
    shared[LN_COEFFICIENT] = law.nusselt_coefficient.ln() + law.nusselt_exponent * ln_reference;
    priors[LN_COEFFICIENT] = Prior { mean: shared[LN_COEFFICIENT], sigma: LN_COEFFICIENT_SIGMA };
    priors[EXPONENT] = Prior { mean: EXPONENT_MEAN, sigma: EXPONENT_SIGMA };
    active[LN_COEFFICIENT] = true;
    active[EXPONENT] = true;
    REFINEMENTS.into_iter().for_each(|(index, sigma, ..)| priors[index].sigma = sigma);
    shared[ALPHA] = config.alpha_area_ratio;
    priors[ALPHA].mean = config.alpha_area_ratio;
    active[ALPHA] = choice.alpha_area == Choice::Fitted;
    let probe_mm2 = (MM_PER_M * config.probe_diameter_m).powi(2);
    shared[PROBE_MM2] =
        if choice.probe == Choice::Fitted { probe_mm2.max(START_PROBE_MM2) } else { probe_mm2 };
    priors[PROBE_MM2].mean = probe_mm2;
    active[PROBE_MM2] = choice.probe == Choice::Fitted;
    lowest[PROBE_MM2] = 0.0;
    active[LN_HEATING_COOLING_RATIO] = choice.heating_cooling_ratio == Choice::Fitted;
    shared[INLET] = inlet::power_of(config.inlet_convection);
    priors[LN_AREA] = Prior { mean: 0.0, sigma: config.internal_area_sigma_ratio };
    active[LN_AREA] = config.internal_area_sigma_ratio > 0.0;
    if choice.offsets == Choice::Fitted {
        let mut fit_error = |index: usize, sigma: f64| {
            priors[index] = Prior { mean: 0.0, sigma };
            active[index] = sigma > 0.0;
        };
        for (i, channel) in OFFSET_CHANNELS.into_iter().enumerate() {
            fit_error(OFFSETS + i, config.sensor(channel).offset_sigma);
            fit_error(BENDS + i, config.sensor(channel).offset_sigma);
        }
        for (i, channel) in GAIN_CHANNELS.into_iter().enumerate() {
            fit_error(GAINS + i, config.sensor(channel).gain_sigma_ratio);
        }
        fit_error(FLOW_GAIN, config.sensor(Channel::CompressorFlow).gain_sigma_ratio);
        fit_error(BAROMETER, config.barometer_sigma_pa);
        fit_error(HUMIDITY, config.humidity_sigma_kg_kg);
    }
    let etas: Vec<f64> = steps
        .iter()
        .filter_map(|step| alone.get(step.position)?.eta.map(|(eta, _)| eta))
        .filter(|eta| START_ETAS.contains(eta))
        .collect();
    let mean_eta = mean(&etas).unwrap_or(USUAL_ETA);
    shared[SURFACE] = mean_eta;
    for (k, sigma) in SurfaceScale::prior_sigmas().into_iter().enumerate() {
        priors[SURFACE + k] = Prior { mean: shared[SURFACE + k], sigma };
        active[SURFACE + k] = true;
    }

    let members =
        steps.iter().map(|step| member(step, alone.get(step.position), &scale, mean_eta, config)).collect();
    Some(Problem {
        setting,
        members,
        shared,
        priors,
        active,
        lowest,
        surface_sigma: ANY_ROUGHNESS,
        input_noise: InputNoiseSpline::default(),
        probe_fitted: choice.probe == Choice::Fitted,
        inlet_sought: choice.inlet_h == Choice::Fitted,
        inlet: None,
    })
}

/// A step with its start values. `found`: result of the step alone; `mean_eta` replaces an efficiency that it does not give.
pub(crate) fn member<'a>(
    step: &'a StepRows,
    found: Option<&Estimate>,
    scale: &SurfaceScale,
    mean_eta: f64,
    config: &IdentifyConfig,
) -> Member<'a> {
    let free = Prior { mean: 0.0, sigma: f64::INFINITY };
    let end_terms = scale.terms(step.end.place);
    let terms = step
        .rows
        .iter()
        .map(|row| {
            let here = scale.terms(row.place);
            std::array::from_fn::<f64, TERM_COUNT, _>(|k| here[k] - end_terms[k])
        })
        .collect();
    let eta = found
        .and_then(|found| found.eta)
        .map_or(mean_eta, |(eta, _)| eta)
        .clamp(START_CLAMP_ETA.0, START_CLAMP_ETA.1);
    let first_k = step.rows.first().map_or(step.end.t2_k, |row| row.t2_k);
    let mut local = [0.0; LOCAL];
    let mut own = [free; LOCAL];
    local[ETA] = eta;
    own[LN_DEVIATION] = Prior { mean: 0.0, sigma: START_DEVIATION_SIGMA };
    local[FIRST_READING] = first_k;
    own[FIRST_READING] = Prior { mean: first_k, sigma: FIRST_READING_SIGMA_K };
    local[SLOPE] = 1.0;
    own[SLOPE] = Prior { mean: 1.0, sigma: SLOPE_SIGMA };
    // Refined from the residual.
    let noise_k = usual_noise_sigma(Channel::T2);
    Member {
        history: StepHistory { rows: &step.rows, terms },
        measured_k: step.rows.iter().map(|row| row.t2_k).collect(),
        whitening: whitening(step, config, noise_k, noise_k, |_| 0.0),
        coupling: std::array::from_fn(|i| {
            i.checked_sub(SURFACE).and_then(|k| end_terms.get(k)).copied().unwrap_or(0.0)
        }),
        local,
        priors: own,
        contributes: true,
        excluded: false,
    }
}

/// `shape_k`: effect of the surface on the prediction at each row, K. Part of it is wrong, and varies as slowly as it does.
fn whitening(
    step: &StepRows,
    config: &IdentifyConfig,
    sigma_k: f64,
    white_sigma_k: f64,
    shape_k: impl Fn(usize) -> f64,
) -> WhiteningFilter {
    let noise = step.rows.iter().enumerate().map(|(i, row)| {
        let wrong = SHAPE_ERROR_RATIO * shape_k(i) / sigma_k;
        (row.t_s, BlockNoise { first_order: row.noise.first_order + wrong * wrong, ..row.noise }, true)
    });
    WhiteningFilter::new(noise, config.noise_colour.time_constant_s, sigma_k, white_sigma_k)
}

/// Estimates the noise of each step and the spreads of the points about surface and law from the fit; `None` if the equations are singular.
pub(crate) fn refine(problem: &mut Problem<'_>, steps: &[StepRows], config: &IdentifyConfig) -> Option<()> {
    set_weights(problem, steps, config);
    let covariance = problem.with_exact_readings().covariance()?;
    let of_steps = || problem.members.iter().zip(&covariance.own).filter(|(member, _)| member.contributes);
    let off_surface: Vec<(f64, f64)> = of_steps()
        .map(|(member, (own, mixed))| {
            let coupling = DVector::from_iterator(
                covariance.fitted.len(),
                covariance.fitted.iter().map(|index| member.coupling[*index]),
            );
            let by_shared = &covariance.shared * &coupling;
            let variance =
                own[(ETA, ETA)] - 2.0 * mixed.row(ETA).transpose().dot(&coupling) + coupling.dot(&by_shared);
            (member.off_surface(&problem.shared, &member.local), variance)
        })
        .collect();
    let off_law: Vec<(f64, f64)> = of_steps()
        .map(|(member, (own, _))| (member.local[LN_DEVIATION], own[(LN_DEVIATION, LN_DEVIATION)]))
        .collect();
    problem.surface_sigma = spread(&off_surface, problem.surface_sigma, SURFACE_SIGMA);
    let before = problem.members.first().map_or(LAW_SIGMA, |member| member.priors[LN_DEVIATION].sigma);
    let sigma = spread(&off_law, before, LAW_SIGMA);
    for member in &mut problem.members {
        member.priors[LN_DEVIATION].sigma = sigma;
    }
    Some(())
}

/// Standard deviation of a zero-mean normal distribution, from posterior means and variances found with another one, `under_sigma`. Returns
/// the most probable value under an inverse chi-square prior about `expected`.
fn spread(posteriors: &[(f64, f64)], under_sigma: f64, expected: f64) -> f64 {
    // Values and variances from the recording alone.
    let seen: Vec<(f64, f64)> = posteriors
        .iter()
        .filter_map(|(value, variance)| {
            let information = 1.0 / variance - under_sigma.powi(-2);
            (information > 0.0).then(|| (value / (variance * information), 1.0 / information))
        })
        .collect();
    let ln_density = |sigma: f64| -> f64 {
        let of_point = |(value, variance): &(f64, f64)| {
            let total = sigma * sigma + variance;
            // A bad step must not widen its own tolerance.
            -0.5 * (total.ln() + (value * value / total).min(DOUBT_SIGMAS * DOUBT_SIGMAS))
        };
        let prior = -PRIOR_WEIGHT * (sigma.ln() + 0.5 * (expected / sigma).powi(2));
        seen.iter().map(of_point).sum::<f64>() + prior
    };
    // Bad steps give the density several maxima.
    SPREAD_RATIOS_LN
        .map(|tenths| expected * (SPREAD_STEP_LN * f64::from(tenths)).exp())
        .max_by(|a, b| ln_density(*a).total_cmp(&ln_density(*b)))
        .unwrap_or(expected)
}

/// Sensitivity of the fitted efficiency to the offsets, from the sensitivities of T2 to the readings and to the efficiency; `None` if T2 does
/// not depend on the efficiency.
pub(crate) fn coupled(slopes: &[f64; 6], by_eta: f64) -> Option<[f64; OFFSET_CHANNELS.len()]> {
    let coupled = std::array::from_fn(|i| -slopes[i] / by_eta);
    coupled.iter().all(|x: &f64| x.is_finite()).then_some(coupled)
}

/// Sets the noise of each step and the sensitivity of its efficiency to offsets, at the current parameters.
pub(crate) fn set_weights(problem: &mut Problem<'_>, steps: &[StepRows], config: &IdentifyConfig) {
    let declared = Row::CHANNELS.map(|channel| config.sensor(channel).noise_sigma);
    for (i, step) in steps.iter().enumerate().take(problem.members.len()) {
        let member = &problem.members[i];
        let slopes = problem.setting.sensitivities(&step.end, &problem.shared, &member.local);
        let expected: f64 = slopes.iter().zip(&declared).map(|(slope, sigma)| (slope * sigma).powi(2)).sum();
        // Without a declaration the residual gives the noise.
        let sigma_k = if expected > 0.0 {
            expected.sqrt()
        } else {
            let predicted_k = problem.setting.predict_t2_k(&member.history, &problem.shared, &member.local);
            let square: f64 =
                member.measured_k.iter().zip(&predicted_k).skip(1).map(|(a, b)| (a - b).powi(2)).sum();
            (square / (member.measured_k.len() as f64 - FITTED_PER_STEP).max(1.0)).sqrt().max(MIN_NOISE_K)
        };
        let by_eta = problem.setting.by_efficiency(&step.end, &problem.shared, &member.local);
        if let Some(coupled) = coupled(&slopes, by_eta) {
            problem.members[i].coupling[BENDS..].copy_from_slice(&coupled);
        }
        let white_sigma_k = if expected > 0.0 { declared[1].max(MIN_WHITE_RATIO * sigma_k) } else { sigma_k };
        let terms = &problem.members[i].history.terms;
        let surface = crate::joint::step_model::model::surface_of(&problem.shared);
        let shape_k = |row: usize| terms.get(row).map_or(0.0, |terms| by_eta * dot(terms, surface));
        let new = whitening(step, config, sigma_k, white_sigma_k, shape_k);
        problem.members[i].whitening = new;
    }
}
