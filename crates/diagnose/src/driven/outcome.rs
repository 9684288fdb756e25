//! Result of the identification from a log without steps, and its error on held-out rows.

use crate::driven::compressor_side::{Declared, Predicted, predict};
use crate::driven::density::{CORRELATION_S, CorrelatedNoise, log_density};
use crate::driven::ensemble::draws;
use crate::driven::parameters::{COUNT, PARAMETERS, Parameter, Values};
use crate::driven::{DrivenError, Rows};
use mapper_inference::interval::IDENTIFIED_RATIO;
use mapper_numerics::statistics::{mean, quantile, rms};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::apparent_efficiency;
use mapper_physics::machine::params::Params;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

/// Posterior of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FoundParameter {
    /// The parameter with its prior.
    #[serde(flatten)]
    pub parameter: Parameter,
    /// Median.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the log identifies it; otherwise the prior dominates.
    pub identified: bool,
}

/// A part of the log compared with its prediction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Judged {
    /// Time of its first row, s.
    pub from_s: f64,
    /// Time of its last row, s.
    pub until_s: f64,
    /// Rows.
    pub rows: usize,
    /// Root mean square of T2 minus its mean prediction, K.
    pub rms_k: f64,
    /// Expected value of `rms_k`, K: median and 95 % interval over the posterior.
    pub expected_rms_k: f64,
    /// Its lower end, K.
    pub expected_low_k: f64,
    /// Its upper end, K.
    pub expected_high_k: f64,
    /// Share of the readings within their 95 % interval.
    pub inside_ratio: f64,
}

/// Influence of a parameter on the T2 reading over the fitted part, K rms: median and 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moves {
    /// Median, K.
    pub rms_k: f64,
    /// Lower end, K.
    pub low_k: f64,
    /// Upper end, K.
    pub high_k: f64,
}

/// T2 over time, measured and predicted, K.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Trace {
    /// Times, s.
    pub t_s: Vec<f64>,
    /// Measured.
    pub read_k: Vec<f64>,
    /// Mean prediction.
    pub predicted_k: Vec<f64>,
    /// Lower end of the 95 % interval.
    pub low_k: Vec<f64>,
    /// Upper end.
    pub high_k: Vec<f64>,
    /// Isentropic efficiency, mean, fraction.
    pub efficiency: Vec<f64>,
    /// Apparent efficiency of the readings, `T1 (PR^kappa - 1)/(T2 - T1)`, fraction: for comparison only, since heat and lag distort it.
    pub apparent_efficiency: Vec<f64>,
}

/// Identification result.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DrivenOutcome {
    /// End of the fitted part, s.
    pub fitted_until_s: f64,
    /// The parameters.
    pub parameters: Vec<FoundParameter>,
    /// Influence of the probe's lag on T2.
    pub probe_moves: Moves,
    /// Influence of heat to and from the housing on T2.
    pub heat_moves: Moves,
    /// The fitted part.
    pub fitted: Judged,
    /// The held-out part; `None` if everything was fitted.
    pub held_out: Option<Judged>,
    /// T2 over all rows.
    pub trace: Trace,
    /// Unusable rows of T2.
    pub lost_rows: usize,
}

/// Identifies the compressor side from all rows before `fit_until_s`, and predicts the others from their driving channels alone. The same
/// seed gives the same result.
///
/// # Errors
/// [`DrivenError::TooFewRows`] if there are too few rows to fit.
pub fn identify(
    rows: &Rows,
    params: Params,
    fit_until_s: f64,
    seed: u64,
) -> Result<DrivenOutcome, DrivenError> {
    let fitted = rows.t_s.partition_point(|t_s| *t_s < fit_until_s);
    let needed = 2 * COUNT;
    if fitted < needed {
        return Err(DrivenError::TooFewRows { rows: fitted, until_s: fit_until_s, needed });
    }
    let declared = Declared::new(&params, rows);
    let sample: Vec<Values> = draws(|standard| log_density(standard, rows, &declared, fitted), seed)
        .iter()
        .map(Values::of_standard)
        .collect();
    let predicted: Vec<Predicted> =
        sample.iter().map(|values| predict(rows, &declared, values, rows.len())).collect();
    let noisy = with_noise(&sample, &predicted, rows, seed);
    let trace = trace(params.compressor.air(), rows, &predicted, &noisy);
    let judged = |from: usize, until: usize| judged(rows, &trace, &noisy, from, until);
    let influence = |name: &str| influence(&sample, &predicted, rows, &declared, fitted, name);
    Ok(DrivenOutcome {
        fitted_until_s: fit_until_s,
        parameters: PARAMETERS
            .iter()
            .enumerate()
            .map(|(i, parameter)| posterior(*parameter, i, &sample))
            .collect(),
        probe_moves: influence("probe"),
        heat_moves: influence("h"),
        fitted: judged(0, fitted),
        held_out: (fitted < rows.len()).then(|| judged(fitted, rows.len())),
        trace,
        lost_rows: rows.lost,
    })
}

fn posterior(parameter: Parameter, place: usize, sample: &[Values]) -> FoundParameter {
    let at = |share: f64| quantile(sample.iter().map(|values| values.0[place]), share).unwrap_or(f64::NAN);
    let (low, high) = (at(0.025), at(0.975));
    let prior = |z: f64| {
        let mut standard = [0.0; COUNT];
        standard[place] = z;
        Values::of_standard(&standard).0[place]
    };
    let identified = high - low < IDENTIFIED_RATIO * (prior(1.96) - prior(-1.96));
    FoundParameter { parameter, value: at(0.5), low, high, identified }
}

/// Simulated readings of each draw, each with noise of its own.
fn with_noise(sample: &[Values], predicted: &[Predicted], rows: &Rows, seed: u64) -> Vec<Vec<f64>> {
    let mut random = Pcg64Mcg::seed_from_u64(seed.wrapping_add(1));
    sample
        .iter()
        .zip(predicted)
        .map(|(values, predicted)| {
            let [.., sigma_k] = values.0;
            let mut noise_k = CorrelatedNoise::new(sigma_k, CORRELATION_S);
            let rows = predicted.t2_k.iter().zip(&rows.t_s);
            rows.map(|(t2_k, t_s)| t2_k + noise_k.next(*t_s, StandardNormal.sample(&mut random))).collect()
        })
        .collect()
}

fn trace(air: Air, rows: &Rows, predicted: &[Predicted], noisy: &[Vec<f64>]) -> Trace {
    let mean_at = |i: usize, pick: &dyn Fn(&Predicted) -> &[f64]| {
        mean(predicted.iter().map(|one| pick(one)[i])).unwrap_or(f64::NAN)
    };
    let end = |i: usize, share: f64| quantile(noisy.iter().map(|one| one[i]), share).unwrap_or(f64::NAN);
    let ([_, _, p1_pa, p2_pa, t1_k], t2_k) = (rows.drives(), &rows.judged[0].1);
    let apparent = |i: usize| {
        let air = air.between(p1_pa[i], p2_pa[i]);
        apparent_efficiency(p2_pa[i] / p1_pa[i], t1_k[i], t2_k[i], air)
    };
    Trace {
        t_s: rows.t_s.clone(),
        read_k: t2_k.clone(),
        predicted_k: (0..rows.len()).map(|i| mean_at(i, &|one| &one.t2_k)).collect(),
        low_k: (0..rows.len()).map(|i| end(i, 0.025)).collect(),
        high_k: (0..rows.len()).map(|i| end(i, 0.975)).collect(),
        efficiency: (0..rows.len()).map(|i| mean_at(i, &|one| &one.efficiency)).collect(),
        apparent_efficiency: (0..rows.len()).map(apparent).collect(),
    }
}

fn judged(rows: &Rows, trace: &Trace, noisy: &[Vec<f64>], from: usize, until: usize) -> Judged {
    let distance = |truth_k: &[f64]| {
        let off = (from..until).map(|i| truth_k[i] - trace.predicted_k[i]);
        rms(off).unwrap_or(f64::NAN)
    };
    let expected: Vec<f64> = noisy.iter().map(|one| distance(one)).collect();
    let at = |share: f64| quantile(&expected, share).unwrap_or(f64::NAN);
    let inside =
        (from..until).filter(|i| (trace.low_k[*i]..=trace.high_k[*i]).contains(&trace.read_k[*i])).count();
    Judged {
        from_s: rows.t_s[from],
        until_s: rows.t_s[until - 1],
        rows: until - from,
        rms_k: distance(&trace.read_k),
        expected_rms_k: at(0.5),
        expected_low_k: at(0.025),
        expected_high_k: at(0.975),
        inside_ratio: inside as f64 / (until - from) as f64,
    }
}

/// Influence of a parameter: change of T2 if it is 0.
fn influence(
    sample: &[Values],
    predicted: &[Predicted],
    rows: &Rows,
    declared: &Declared,
    fitted: usize,
    name: &str,
) -> Moves {
    let distances: Vec<f64> = sample
        .iter()
        .zip(predicted)
        .filter_map(|(values, with)| {
            let without = predict(rows, declared, &values.with(name, 0.0), fitted);
            rms(without.t2_k.iter().zip(&with.t2_k).map(|(without, with)| without - with))
        })
        .collect();
    let at = |share: f64| quantile(&distances, share).unwrap_or(f64::NAN);
    Moves { rms_k: at(0.5), low_k: at(0.025), high_k: at(0.975) }
}
