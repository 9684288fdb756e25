//! Errors of a model after a jump: correlated over the logarithm of time, because the parts of the machine follow with time constants from tenths of
//! a second to minutes.

use mapper_physics::rig::instruments::NOMINAL_P3_LAG_S;
use nalgebra::DMatrix;


/// Covariance within a step of errors proportional to each of `histories`, correlated over time. Values within the usual lag of P3 after a
/// jump are fully correlated.
pub(crate) fn covariance_of_errors(since_jump_s: &[f64], histories: [&[f64]; 2]) -> DMatrix<f64> {
    let n = since_jump_s.len();
    let at: Vec<f64> = since_jump_s.iter().map(|t_s| (t_s.max(0.0) + NOMINAL_P3_LAG_S).ln()).collect();
    DMatrix::from_fn(n, n, |i, j| {
        let sum: f64 = histories.iter().map(|history| history[i] * history[j]).sum();
        sum * (-(at[i] - at[j]).abs()).exp()
    })
}
