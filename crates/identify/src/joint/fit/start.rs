//! Prepares a recording for the fit, and estimates noise and spreads from the fit.

use crate::faults::end_readings::ANY_ROUGHNESS;
use crate::joint::fit::input_noise::{InputNoise, Whitening};
use crate::joint::fit::solve::{Member, Problem};
use crate::joint::fit::{refinements, step_noise};
use crate::joint::step_model::gas_path::{Setting, reynolds};
use crate::joint::step_model::linearised::{Model, StepHistory};
use crate::joint::step_model::parameters::{
    ALPHA, BAROMETER, BEARING, ETA, EXPONENT, EXTERNAL, FIRST_READING, FLOW_GAIN, GAIN_CHANNELS, GAINS, HEAT,
    HEAT_BY_TC, HUMIDITY, INLET, LN_AREA, LN_CAPACITY, LN_COEFFICIENT, LN_DEVIATION,
    LN_HEATING_COOLING_RATIO, LN_INNER_CONDUCTANCE, LN_OIL, LN_THIRD_CONDUCTANCE, LOCAL, LOGIT_AREA,
    LOGIT_BEARING, LOGIT_INNER, LOGIT_THIRD, LOGIT_THIRD_AREA, OFFSET_CHANNELS, OFFSETS, PREHEAT, PROBE_MM2,
    Place, Prior, RADIATION, REFINEMENTS, SHARED, STEP_HEAT, SURFACE, SurfaceScale, TC_LAG, TERM_COUNT,
    THERMOMETERS,
};
use crate::joint::step_model::parts::Parts;
use crate::joint::step_model::rows::{StepRows, condensed};
use crate::single_step::dynamic::{self, Estimate};
use crate::step_data::end_state::EndState;
use crate::step_data::samples::{Samples, cleaned};
use crate::step_data::{end_state, samples};
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, WindowRule};
use mapper_core::unit_factors::MM_PER_M;
use mapper_core::{Channel, Choice, Recording, Series, StepMarker, TooFew, Warning, Window};
use mapper_numerics::parallel;
use mapper_numerics::statistics::{DOUBT_SIGMAS, mean};
use nalgebra::DVector;

/// Prior of ln of the Nusselt coefficient about that of Appendix A, one standard deviation. Bound: a factor of 20 either way, more than
/// correlations of pipes, bends and volutes differ.
const LN_COEFFICIENT_SIGMA: f64 = 3.0;
/// Prior of the Reynolds number's exponent. Source: 0.8 for turbulent pipes (Dittus and Boelter), 1.13 in Appendix A of the paper.
const EXPONENT_MEAN: f64 = 0.9;
/// Its standard deviation. Bound: from laminar, 0.3, to proportional to flow and above, 1.4.
const EXPONENT_SIGMA: f64 = 0.5;
/// Minimum start value of the square of a fitted probe's diameter without the balance, mm2. Bound: a start value only; a probe without lag has no time history from
/// which to find one.
const START_PROBE_MM2: f64 = 0.5;
/// Efficiencies of single steps that count for the start value. Bound: those of compressors, choke included.
const START_ETAS: std::ops::Range<f64> = 0.2..0.95;
/// Start value of the efficiency if no step gives one. Bound: a start value only; mean of compressor maps.
const USUAL_ETA: f64 = 0.65;
/// Range of a step's start value. Bound: a start value only.
const START_CLAMP_ETA: (f64, f64) = (0.3, 0.9);
/// Spread of h about the law before the recording determines it. Bound: a start value only, three times [`LAW_SIGMA`].
const START_DEVIATION_SIGMA: f64 = 0.01;
/// Error of the first reading as the state of the probe, K, one standard deviation. Bound: noise of a mean over half a second, and the bend of T2
/// within it.
const FIRST_READING_SIGMA_K: f64 = 5.0;
/// Step of the logarithm of the spreads that are tried. Bound: spreads a tenth apart give the same weights to the points.
const SPREAD_STEP_LN: f64 = 0.1;

/// Start of the used part of a step after the last command change, s: h and efficiency are modelled while the operating point settles, and the
/// first seconds only show where the surface is wrong, or what smoothing does not follow, which looks like area before the wheel. Bound: shaft and
/// outlet volume of a fast stand settle within it.
pub(crate) const START_S: f64 = 3.0;
/// The same with the balance of the housing, s: alpha_A and probe then follow from it, and what smoothing leaves of the first seconds would act on
/// both. Calibrated: as above; from 4 s on one of eighteen recordings ended in a wrong minimum.
pub(crate) const START_WITH_BALANCE_S: f64 = 6.0;
/// Part of a step at its end with which its operating point is compared, ratio. Bound: long enough for a mean, short enough to have settled.
const TAIL_RATIO: f64 = 0.25;
/// Distance of the speed from its mean there within which a window may begin, ratio. Bound: the surface's slope is known to some per cent, and
/// so far from the end it makes errors of a tenth of a point.
const SPEED_BAND_RATIO: f64 = 0.015;
/// The same of the flow. Bound: as for the speed; efficiency varies less along a line.
const FLOW_BAND_RATIO: f64 = 0.05;
/// Shortest window that a slow operating point leaves, s. Bound: a probe and a housing are then still visible.
const SHORTEST_S: f64 = 8.0;
/// Length of the means that are compared, s. Bound: noise of a flow meter at 10 Hz is then below 1 %.
const SECOND_S: f64 = 1.0;

/// Prior of the relative error of the housing's free convection. Source: correlations of free convection about bodies (Incropera, table 9)
/// scatter by a quarter, and the air of a cell moves.
const EXTERNAL_SIGMA: f64 = 0.5;
/// The same of the conductance to the bearing. Bound: section and length of a bearing housing are known to a quarter.
const BEARING_SIGMA: f64 = 0.3;
/// Prior of ln of the conductance to the oil. Bound: within a factor of two of the declared one.
const LN_OIL_SIGMA: f64 = 0.4;
/// Prior of the view factor times area to the turbine housing, m2. Bound: a heat shield leaves a hundredth of a square metre.
const RADIATION_SIGMA_M2: f64 = 0.01;
/// Prior of heat from another source, W. Bound: a tenth of what a hot housing exchanges with its gas.
const HEAT_SIGMA_W: f64 = 30.0;
/// The same if the turbine housing or the oil is not recorded: their mean, W. Bound: turbine housings of 400 to 900 K behind 1.5 W/K.
const NEIGHBOURS_W: f64 = 60.0;
/// Its standard deviation, W. Bound: turbine housings of 400 to 900 K behind 1.5 W/K.
const NEIGHBOURS_SIGMA_W: f64 = 100.0;
/// Prior of heat in proportion to Tc, W/K. Source: a cooled housing takes some 2 W/K.
const HEAT_BY_TC_SIGMA_W_K: f64 = 2.0;
/// Prior of the heat that a step's balance does not have, W: its spread is fitted. Bound: a hundredth of what a hot housing exchanges.
pub(crate) const STEP_HEAT_SIGMA_W: f64 = 3.0;
/// Priors of the housing's division: mean and standard deviation of logits of shares, and of ln of conductances in W/K. Bound: shares of 0.05 to
/// 0.85 within two standard deviations; conductances of 2 to 280 W/K, 1 to 110 W/K to a third part, which is farther away.
const DIVISION_PRIORS: [(Place, (f64, f64)); 7] = [
    (LOGIT_INNER, (-0.5, 1.2)),
    (LN_INNER_CONDUCTANCE, (3.2, 1.2)),
    (LOGIT_AREA, (-0.5, 1.2)),
    (LOGIT_BEARING, (0.0, 1.2)),
    (LOGIT_THIRD, (-1.0, 1.2)),
    (LN_THIRD_CONDUCTANCE, (2.3, 1.2)),
    (LOGIT_THIRD_AREA, (-0.5, 1.2)),
];
/// Start values of a third part. Bound: start values only; a small one, so that the other parts begin where they were.
const THIRD_START: [(Place, f64); 2] = [(LOGIT_THIRD, -1.5), (LOGIT_THIRD_AREA, -2.0)];

/// Expected spread of the points' efficiencies about the surface, fraction: maps are not polynomials. Calibrated:
/// `benches/identification.py`, 0.0006; a machine with a map that drops steeply at choke has 0.005.
pub(crate) const SURFACE_SIGMA: f64 = 1e-3;
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

/// Start of the used part of a step after its last command change, s.
pub(crate) fn start_after_s(config: &IdentifyConfig) -> f64 {
    if has_balance(config) { START_WITH_BALANCE_S } else { START_S }
}

/// Whether the change of Tc is an observation: without its noise it has no weight against T2.
fn has_balance(config: &IdentifyConfig) -> bool {
    config.joint.balance == Choice::Fitted && config.sensor(Channel::Tc).noise_sigma > 0.0
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
    let after_s = start_after_s(config);
    let start_s = samples::settled_s(recording, step).max(step.start_s) + after_s;
    if start_s.is_nan() || start_s >= step.end_s {
        let late = TooFew::LateCommands { before_end_s: step.end_s - start_s };
        own.refuse(Warning::TooFewSamples(late));
        return None;
    }
    let start_s = reached_s(recording, step, start_s);
    let window = Window { start_s, end_s: step.end_s };
    let before = Samples::of(recording, Window { start_s: step.start_s, end_s: start_s }, config, true);
    let samples = cleaned(Samples::of(recording, window, config, true), config, own);
    if !dynamic::enough(&samples, config, own) {
        return None;
    }
    if !config.declared.is_empty() {
        // The fit follows changes within the step, but the point is the settled end of the step.
        let needed_s = WindowRule::settled_end_s(step.end_s - step.start_s);
        if let Some(end_state::Settling { slowest, settled_s, whole: false, .. }) =
            end_state::settling(recording, step, &config.settle_bands)
            && settled_s < needed_s.floor()
        {
            let quantity = slowest.to_owned();
            own.doubt(Warning::NotStabilised { quantity, settled_s, needed_s, used_s: None });
        }
    }
    condensed(recording, position, (&before, &samples), end_state, config)
}

/// Time from which on speed and flow stay near their values at the end of the step, s; at least `start_s`.
fn reached_s(recording: &Recording, step: &StepMarker, start_s: f64) -> f64 {
    let tail_s = step.end_s - TAIL_RATIO * (step.end_s - start_s);
    let latest_s = (step.end_s - SHORTEST_S).max(start_s);
    let bands = [(Channel::ShaftSpeed, SPEED_BAND_RATIO), (Channel::CompressorFlow, FLOW_BAND_RATIO)];
    bands.into_iter().fold(start_s, |found_s, (channel, band_ratio)| {
        let Some(series) = recording.series.get(&channel) else { return found_s };
        let blocks = step_blocks(series, start_s, step.end_s);
        let tail = blocks.iter().filter(|(t_s, _)| *t_s >= tail_s).map(|(_, value)| *value);
        let Some(end) = mean(tail) else { return found_s };
        let off = |(_, value): &&(f64, f64)| (value / end - 1.0).abs() > band_ratio;
        let last = blocks.iter().filter(|(t_s, _)| *t_s < latest_s).rfind(off);
        last.map_or(found_s, |(t_s, _)| found_s.max((t_s + 0.5 * SECOND_S).min(latest_s)))
    })
}

/// Means over a second, with their middle, s.
fn step_blocks(series: &Series, start_s: f64, end_s: f64) -> Vec<(f64, f64)> {
    let count = ((end_s - start_s) / SECOND_S).floor().clamp(0.0, series.t_s.len() as f64) as usize;
    let block = |i: usize| {
        let from_s = start_s + i as f64 * SECOND_S;
        let (_, values) = series.slice(from_s, from_s + SECOND_S);
        Some((from_s + 0.5 * SECOND_S, mean(values.iter().copied().filter(|value| value.is_finite()))?))
    };
    (0..count).filter_map(block).collect()
}

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
    let setting = Setting::of(config, ln_reference.exp());

    let free = Prior { mean: 0.0, sigma: f64::INFINITY };
    let mut priors = [free; SHARED];
    let mut shared = [0.0; SHARED];
    let mut active = [false; SHARED];
    let law = mapper_physics::machine::params::Params::default().compressor;
    shared[EXPONENT] = law.nusselt_exponent;
    shared[LN_COEFFICIENT] = law.nusselt_coefficient.ln() + law.nusselt_exponent * ln_reference;
    priors[LN_COEFFICIENT] = Prior { mean: shared[LN_COEFFICIENT], sigma: LN_COEFFICIENT_SIGMA };
    priors[EXPONENT] = Prior { mean: EXPONENT_MEAN, sigma: EXPONENT_SIGMA };
    active[LN_COEFFICIENT] = true;
    active[EXPONENT] = true;
    REFINEMENTS.into_iter().for_each(|refinement| priors[refinement.index].sigma = refinement.wide_sigma);
    shared[ALPHA] = config.alpha_area_ratio;
    priors[ALPHA].mean = config.alpha_area_ratio;
    active[ALPHA] = choice.alpha_area == Choice::Fitted;
    let probe_mm2 = (MM_PER_M * config.probe_diameter_m).powi(2);
    let start_mm2 = if has_balance(config) { 0.0 } else { START_PROBE_MM2 };
    shared[PROBE_MM2] = if choice.probe == Choice::Fitted { probe_mm2.max(start_mm2) } else { probe_mm2 };
    priors[PROBE_MM2].mean = probe_mm2;
    active[PROBE_MM2] = choice.probe == Choice::Fitted;
    active[LN_HEATING_COOLING_RATIO] = choice.heating_cooling_ratio == Choice::Fitted;
    shared[INLET] = refinements::power_of(config.inlet_convection);
    priors[LN_AREA] = Prior { mean: 0.0, sigma: config.internal_area_sigma_ratio };
    active[LN_AREA] = config.internal_area_sigma_ratio > 0.0;
    if choice.offsets == Choice::Fitted {
        let contact_sigma = if config.declared.is_empty() { 0.0 } else { config.housing_contact_sigma_ratio };
        let mut fit_error = |index: usize, sigma: f64| {
            priors[index] = Prior { mean: 0.0, sigma };
            active[index] = sigma > 0.0;
        };
        for (i, channel) in OFFSET_CHANNELS.into_iter().enumerate() {
            fit_error(OFFSETS + i, config.sensor(channel).offset_sigma);
        }
        for (i, channel) in GAIN_CHANNELS.into_iter().enumerate() {
            // A thermocouple on the housing reads a share of the way to the cell: a gain about the cell's temperature.
            let contact = if channel == Channel::Tc { contact_sigma } else { 0.0 };
            fit_error(GAINS + i, config.sensor(channel).gain_sigma_ratio.hypot(contact));
        }
        fit_error(FLOW_GAIN, config.sensor(Channel::CompressorFlow).gain_sigma_ratio);
        fit_error(BAROMETER, config.barometer_sigma_pa);
        fit_error(THERMOMETERS, config.thermometer_sigma_k);
        fit_error(HUMIDITY, config.humidity_sigma_kg_kg);
    }
    let has_balance = has_balance(config);
    if has_balance {
        active[PREHEAT] = true;
        active[TC_LAG] = true;
        let mut fit = |index: usize, mean: f64, sigma: f64| {
            priors[index] = Prior { mean, sigma };
            shared[index] = mean;
            active[index] = true;
        };
        let rows = || steps.iter().flat_map(|step| &step.rows);
        fit(LN_CAPACITY, 0.0, config.housing.ln_capacity_sigma);
        fit(EXTERNAL, 0.0, EXTERNAL_SIGMA);
        fit(HEAT_BY_TC, 0.0, HEAT_BY_TC_SIGMA_W_K);
        if rows().all(|row| row.has_neighbours()) {
            fit(HEAT, 0.0, HEAT_SIGMA_W);
            fit(BEARING, 0.0, BEARING_SIGMA);
            fit(LN_OIL, 0.0, LN_OIL_SIGMA);
            fit(RADIATION, 0.0, RADIATION_SIGMA_M2);
        } else {
            fit(HEAT, NEIGHBOURS_W, NEIGHBOURS_SIGMA_W);
        }
    }
    let model = Model { setting, housing: config.housing, parts: Parts::One, has_balance };
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
        steps.iter().map(|step| member(step, alone.get(step.position), (&scale, mean_eta), &model)).collect();
    let mut problem = Problem {
        left_over: [0.0; SHARED],
        model,
        members,
        shared,
        priors,
        active,
        surface_sigma: ANY_ROUGHNESS,
        input_noise: InputNoise::none(),
        is_exact: config.declared.is_empty(),
        inlet_sought: choice.inlet_h == Choice::Fitted,
        inlet: None,
    };
    step_noise::begin(&mut problem, config)?;
    Some(problem)
}

/// The problem of a housing of more parts, which the problem of fewer starts.
pub(crate) fn with_parts<'a>(problem: &Problem<'a>, parts: Parts) -> Problem<'a> {
    let mut more = problem.clone();
    more.model.parts = parts;
    for (index, (mean, sigma)) in DIVISION_PRIORS {
        if parts.parameters().contains(&index) && !more.active[index] {
            more.priors[index] = Prior { mean, sigma };
            more.shared[index] =
                THIRD_START.into_iter().find(|(place, _)| *place == index).map_or(mean, |at| at.1);
            more.active[index] = true;
        }
    }
    more
}

/// A step with its start values. `found`: result of the step alone; `mean_eta` replaces an efficiency that it does not give.
fn member<'a>(
    step: &'a StepRows,
    found: Option<&Estimate>,
    (scale, mean_eta): (&SurfaceScale, f64),
    model: &Model,
) -> Member<'a> {
    let free = Prior { mean: 0.0, sigma: f64::INFINITY };
    let end_terms = scale.terms(step.end.place);
    let terms = step
        .lead
        .iter()
        .chain(&step.rows)
        .map(|row| {
            let here = scale.terms(row.place);
            std::array::from_fn::<f64, TERM_COUNT, _>(|k| here[k] - end_terms[k])
        })
        .collect();
    let by_flow = step.lead.iter().chain(&step.rows);
    let by_flow = by_flow.map(|row| scale.by_ln_flow(row.place).map(|slope| slope / row.flow_kg_s)).collect();
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
    own[STEP_HEAT] = Prior { mean: 0.0, sigma: STEP_HEAT_SIGMA_W };
    let mut measured_k: Vec<f64> = step.rows.iter().map(|row| row.t2_k).collect();
    if model.has_balance {
        measured_k.extend(step.rows.iter().map(|row| row.tc_read_k));
    }
    Member {
        history: StepHistory { step, terms, by_flow },
        whitening: Whitening::default(),
        measured_k,
        coupling: std::array::from_fn(|i| {
            i.checked_sub(SURFACE).and_then(|k| end_terms.get(k)).copied().unwrap_or(0.0)
        }),
        local,
        priors: own,
        contributes: true,
        excluded: false,
    }
}

/// Estimates the noise of each step and the spreads of the points about surface and law from the fit; `None` if the equations are singular.
pub(crate) fn refine(problem: &mut Problem<'_>, config: &IdentifyConfig) -> Option<()> {
    step_noise::set(problem, config)?;
    let covariance = problem.covariance()?;
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
    let own = |index: usize| -> Vec<(f64, f64)> {
        of_steps().map(|(member, (own, _))| (member.local[index], own[(index, index)])).collect()
    };
    let (off_law, off_balance) = (own(LN_DEVIATION), own(STEP_HEAT));
    problem.surface_sigma = spread(&off_surface, problem.surface_sigma, SURFACE_SIGMA);
    let before =
        |index: usize, usual: f64| problem.members.first().map_or(usual, |member| member.priors[index].sigma);
    let law_sigma = spread(&off_law, before(LN_DEVIATION, LAW_SIGMA), LAW_SIGMA);
    let heat_sigma_w = if problem.model.has_balance {
        spread(&off_balance, before(STEP_HEAT, STEP_HEAT_SIGMA_W), STEP_HEAT_SIGMA_W)
    } else {
        STEP_HEAT_SIGMA_W
    };
    for member in &mut problem.members {
        member.priors[LN_DEVIATION].sigma = law_sigma;
        member.priors[STEP_HEAT].sigma = heat_sigma_w;
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
