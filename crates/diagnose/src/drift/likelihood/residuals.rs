//! Residuals of the best explanation: segments that the model cannot follow, and noise above the declaration.

use crate::drift::likelihood::candidates::Candidates;
use crate::drift::likelihood::low_rank::LowRank;
use crate::drift::runs::request::Unsolvable;
use crate::drift::sensitivity::readings::Readings;
use mapper_inference::descent::ROUNDS;
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, median};
use mapper_observe::perturbation::UNINFORMATIVE;
use nalgebra::{DMatrix, DVector};

/// Excludes segments that are outliers even for the best explanation: the model cannot follow the machine there (surge, a valve at its stop).
/// Returns their number, the noise without them, and the residual of the best explanation.
pub(crate) fn leave_out(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    constants: &DMatrix<f64>,
    candidates: &Candidates,
) -> Result<(usize, LowRank, DMatrix<f64>), Unsolvable> {
    let count = readings.columns.len();
    let mut out = vec![false; own.len()];
    let mut noise = LowRank::new(own, constants)?;
    let mut residual = unexplained(&noise, &readings.difference, candidates);
    for _ in 0..ROUNDS {
        let sizes: Vec<f64> = (0..own.len())
            .map(|segment| {
                residual.rows(segment * count, count).iter().map(|value| value * value).sum::<f64>()
                    / count as f64
            })
            .collect();
        let kept = (0..own.len()).filter(|segment| !out[*segment]).map(|segment| sizes[segment]);
        let usual = median(kept).unwrap_or(1.0).max(1.0);
        let far: Vec<usize> = (0..own.len())
            .filter(|segment| !out[*segment] && sizes[*segment] > EXCLUDE_SIGMAS * EXCLUDE_SIGMAS * usual)
            .collect();
        if far.is_empty() {
            break;
        }
        for segment in far {
            out[segment] = true;
            own[segment] *= UNINFORMATIVE * UNINFORMATIVE;
        }
        noise = LowRank::new(own, constants)?;
        residual = unexplained(&noise, &readings.difference, candidates);
    }
    Ok((out.iter().filter(|out| **out).count(), noise, residual))
}

/// Residual after constants and the most probable causes, whitened.
fn unexplained(noise: &LowRank, difference: &DMatrix<f64>, candidates: &Candidates) -> DMatrix<f64> {
    let explained = candidates.likelihood(noise, difference).explain(&candidates.priors).unwrap_or_default();
    let mut residual = difference.clone();
    for member in explained.members {
        residual -= candidates.columns.columns(member.index, 1) * member.value;
    }
    noise.inverse_times(&noise.whiten(residual))
}

/// Increases each channel's noise to match the residual of the best explanation, whitened by `noise`.
pub(crate) fn inflate(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    noise: &LowRank,
    residual: &DMatrix<f64>,
) {
    let count = readings.columns.len();
    let rows = residual.nrows() as f64;
    // Constants use up their share of the degrees of freedom.
    let free = (1.0 - noise.degrees_of_freedom() / rows).max(0.2);
    let factors: Vec<f64> = (0..count)
        .map(|column| {
            let own: Vec<f64> =
                residual.iter().skip(column).step_by(count).map(|value| value * value).collect();
            (own.iter().sum::<f64>() / own.len().max(1) as f64 / free).max(1.0).sqrt()
        })
        .collect();
    let scale = DMatrix::from_diagonal(&DVector::from_vec(factors));
    for covariance in own {
        *covariance = &scale * &*covariance * &scale;
    }
}
