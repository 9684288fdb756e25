//! Reports the shared parameters of a joint fit.

use crate::IdentifyConfig;
use crate::joint::fit::refinements::Refinements;
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::judge;
use crate::joint::step_model::parameters::{
    ALPHA, EXPONENT, HEAT, HEAT_BY_TC, HOUSING, LN_AREA, LN_CAPACITY, LN_COEFFICIENT, LN_DEVIATION,
    LN_HEATING_COOLING_RATIO, LN_INNER_CONDUCTANCE, LN_THIRD_CONDUCTANCE, LOGIT_AREA, LOGIT_INNER,
    LOGIT_THIRD, OFFSET_CHANNELS, OFFSETS, PREHEAT, PROBE_MM2, STEP_HEAT, SURFACE, TC_LAG, symbol,
};
use crate::joint::step_model::rows::StepRows;
use crate::joint::uncertainty::Numbers;
use mapper_core::unit_factors::M_PER_MM;
use mapper_core::{
    ConvectionLaw, CorrelatedPair, EstimateUncertainty, IdentifiedHousing, Origin, SharedValue, ThermalModel,
};
use mapper_inference::posterior::is_identified;

/// Step of the derivative of a transformed parameter. Bound: between rounding and curvature for parameters of order 1.
const TRANSFORM_STEP: f64 = 1e-6;

/// Correlation above which two parameters count as entangled. Bound: from here the errors of the two grow more than threefold, 1 / sqrt(1
/// - r^2).
const ENTANGLED: f64 = 0.95;

pub(crate) fn thermal_model(
    problem: &Problem<'_>,
    covariance: &Covariance,
    numbers: &Numbers,
    refinements: Option<&Refinements>,
    steps: &[StepRows],
    config: &IdentifyConfig,
) -> ThermalModel {
    let of = |index: usize, transform: &dyn Fn(f64) -> f64| {
        value(problem, covariance, refinements, index, transform)
    };
    let setting = &problem.model.setting;
    let reynolds: Vec<f64> = steps
        .iter()
        .zip(&problem.members)
        .map(|(step, member)| {
            let at_end = problem.model.at_end(&step.end, &problem.shared, &member.local);
            setting.reynolds_reference * at_end.ln_reynolds.exp()
        })
        .collect();
    let range = reynolds.iter().fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(*x), high.max(*x)));
    let deviations: f64 = problem.members.iter().map(|member| member.local[LN_DEVIATION].powi(2)).sum();
    let reference = setting.reynolds_reference;
    let exponent = problem.shared[EXPONENT];
    let convection = Some(ConvectionLaw {
        diameter_m: setting.outlet_diameter_m,
        coefficient: of(LN_COEFFICIENT, &|x| x.exp() * reference.powf(-exponent)),
        exponent: of(EXPONENT, &|x| x),
        reynolds_reference: reference,
        reynolds_range: range,
        deviation_ratio: (deviations / (problem.members.len() as f64).max(1.0)).sqrt(),
    });
    let mut entangled = Vec::new();
    for (row, a) in covariance.fitted.iter().enumerate() {
        for (column, b) in covariance.fitted.iter().enumerate().skip(row + 1) {
            if *a >= SURFACE || *b >= SURFACE {
                continue;
            }
            let correlation = covariance.shared[(row, column)]
                / (covariance.shared[(row, row)] * covariance.shared[(column, column)]).sqrt();
            if correlation.abs() > ENTANGLED {
                entangled.push(CorrelatedPair { first: symbol(*a), second: symbol(*b), correlation });
            }
        }
    }
    ThermalModel {
        convection,
        internal_area_m2: setting.internal_area_m2,
        alpha_area_ratio: of(ALPHA, &|x| x),
        inlet: problem.inlet,
        probe_diameter_m: probe(problem, covariance),
        heating_cooling_ratio: of(LN_HEATING_COOLING_RATIO, &f64::exp),
        housing: problem.model.has_balance.then(|| housing(problem, &of)),
        offsets: OFFSET_CHANNELS
            .iter()
            .enumerate()
            .filter(|(i, _)| problem.active[OFFSETS + i])
            .map(|(i, channel)| (*channel, of(OFFSETS + i, &|x| x)))
            .collect(),
        entangled,
        doubts: judge::doubts(problem, numbers, config),
    }
}

/// Converts a parameter from its fitted to its reported form.
type Transform<'a> = &'a dyn Fn(f64) -> f64;

/// The housing; `of` reports a parameter.
fn housing(problem: &Problem<'_>, of: &dyn Fn(usize, Transform<'_>) -> SharedValue) -> IdentifiedHousing {
    let same = |x: f64| x;
    let part = |index: usize, transform: Transform<'_>| {
        problem.model.parts.parameters().contains(&index).then(|| of(index, transform))
    };
    let share = |logit: f64| 1.0 / (1.0 + (-logit).exp());
    IdentifiedHousing {
        capacity_ratio: of(LN_CAPACITY, &f64::exp),
        inner_capacity_ratio: part(LOGIT_INNER, &share),
        inner_conductance_w_k: part(LN_INNER_CONDUCTANCE, &f64::exp),
        outer_area_ratio: part(LOGIT_AREA, &share),
        third_capacity_ratio: part(LOGIT_THIRD, &share),
        third_conductance_w_k: part(LN_THIRD_CONDUCTANCE, &f64::exp),
        inlet_conductance_w_k: of(PREHEAT, &same),
        tc_lag_s: of(TC_LAG, &same),
        other_heat_w: of(HEAT, &same),
        other_heat_w_k: of(HEAT_BY_TC, &same),
        step_heat_w: problem.members.first().map_or(0.0, |member| member.priors[STEP_HEAT].sigma),
    }
}

/// A reported parameter; `transform` converts from the fitted to the reported form.
fn value(
    problem: &Problem<'_>,
    covariance: &Covariance,
    refinements: Option<&Refinements>,
    index: usize,
    transform: Transform<'_>,
) -> SharedValue {
    let Some(row) = covariance.row_of(index) else {
        return SharedValue::assumed(transform(problem.shared[index]));
    };
    let fitted = problem.shared[index];
    let reported = transform(fitted);
    let variance = covariance.shared[(row, row)].max(0.0);
    let sigma = variance.sqrt();
    let slope =
        (transform(fitted + TRANSFORM_STEP) - transform(fitted - TRANSFORM_STEP)) / (2.0 * TRANSFORM_STEP);
    let mut bias = 0.0;
    for (other, index) in covariance.fitted.iter().enumerate() {
        if (OFFSETS..HOUSING).contains(index) {
            bias += covariance.shared[(row, other)].powi(2) * problem.priors[*index].weight();
        }
    }
    let beforehand = problem.priors[index].sigma;
    // For a parameter with a prior, use the error from the recording alone.
    let known = refinements.and_then(|refinements| refinements.free(index)).map_or(sigma, |(_, error)| error);
    let uninformed = !is_identified(known, beforehand);
    let is_offset = (OFFSETS..HOUSING).contains(&index);
    // The coefficient is that of the declared area, as h is.
    let area =
        if index == LN_COEFFICIENT && problem.active[LN_AREA] { problem.priors[LN_AREA].sigma } else { 0.0 };
    SharedValue {
        // An offset has its declared spread even if the recording adds nothing.
        value: (!uninformed || is_offset).then_some(reported),
        uncertainty: EstimateUncertainty {
            noise_standard_error: slope.abs() * (variance - bias.min(variance)).max(0.0).sqrt(),
            bias_standard_error: slope.abs() * bias.min(variance).sqrt().hypot(area),
        },
        origin: if uninformed { Origin::NotIdentifiable } else { Origin::Fitted },
    }
}

/// The probe's diameter. Its square is fitted, which is 0 for an ideal probe: the error is then the largest probe that noise could hide.
fn probe(problem: &Problem<'_>, covariance: &Covariance) -> SharedValue {
    let square = problem.shared[PROBE_MM2].max(0.0);
    let Some(sigma) = covariance.error_of(PROBE_MM2) else {
        return SharedValue::assumed(M_PER_MM * square.sqrt());
    };
    let error_m = M_PER_MM * ((square + sigma).sqrt() - square.sqrt());
    SharedValue {
        value: is_identified(sigma, problem.priors[PROBE_MM2].sigma).then_some(M_PER_MM * square.sqrt()),
        uncertainty: EstimateUncertainty { noise_standard_error: error_m, bias_standard_error: 0.0 },
        origin: Origin::Fitted,
    }
}
