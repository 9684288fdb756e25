//! Greedy order: from where the housing is now, the jump that moves it most.

use mapper_physics::housing;
use mapper_physics::model::Model;
use mapper_physics::steady::SteadyState;

/// How far the compressor housing moves in the window of a step to `target`, K, when it is at `tc_k` now.
///
/// One time constant per point, `C/(h A + G_bearing)`: enough to rank jumps; the plan itself is forecast in full.
pub fn expected_gradient_k(model: &Model, target: &SteadyState, tc_k: f64, window_s: (f64, f64)) -> f64 {
    let params = &model.params;
    let conductance_w_k = target.outputs.h_w_m2k * params.compressor.internal_area_m2
        / (1.0 + transfer_units(model, target))
        + housing::bearing_conductance_w_k(&params.bearing);
    let time_constant_s = housing::compressor_capacity_j_k(params, target.state.tc_k) / conductance_w_k;
    let left = |t_s: f64| (-t_s / time_constant_s).exp();
    (target.state.tc_k - tc_k).abs() * (left(window_s.0) - left(window_s.1))
}

/// NTU of the gas in the housing: what the gas can give is limited by its own capacity.
fn transfer_units(model: &Model, target: &SteadyState) -> f64 {
    let cp = mapper_physics::air::heat_capacity_j_kgk(target.outputs.t2_prime_k);
    target.outputs.h_w_m2k * model.params.compressor.internal_area_m2 / (target.outputs.flow_kg_s * cp)
}

/// The remaining point (index into `targets`) whose jump moves the housing most; ties go to the first listed.
pub fn next_point(
    model: &Model,
    targets: &[SteadyState],
    remaining: &[usize],
    tc_k: f64,
    window_s: (f64, f64),
) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for &index in remaining {
        let gradient_k = expected_gradient_k(model, &targets[index], tc_k, window_s);
        if best.is_none_or(|(_, best_k)| gradient_k > best_k) {
            best = Some((index, gradient_k));
        }
    }
    best.map(|(index, _)| index)
}
