//! Errors of a model after a jump: correlated over the logarithm of time, because the parts of the machine follow with time constants from tenths of
//! a second to minutes.

use nalgebra::DMatrix;

/// Values within this time after a jump are fully correlated, s: the usual lag of P3 behind its command.
const AT_ONCE_S: f64 = 0.3;

/// Covariance within a step of errors proportional to each of `histories`, correlated over time.
pub(crate) fn covariance_of_errors(since_jump_s: &[f64], histories: [&[f64]; 2]) -> DMatrix<f64> {
    let n = since_jump_s.len();
    let at: Vec<f64> = since_jump_s.iter().map(|t_s| (t_s.max(0.0) + AT_ONCE_S).ln()).collect();
    DMatrix::from_fn(n, n, |i, j| {
        let sum: f64 = histories.iter().map(|history| history[i] * history[j]).sum();
        sum * (-(at[i] - at[j]).abs()).exp()
    })
}
