//! The gas along the four nodes of the compressor housing.

use super::structure::OtherStructure;
use mapper_physics::laws::compression::after_wheel;

/// Nodes of the housing: shroud, diffuser, scroll, outlet flange.
pub(super) const NODES: usize = 4;
/// Share of each node in the area after the wheel; the shroud also has the area before the wheel.
pub(super) const AREA_SHARES: [f64; NODES] = [0.1, 0.3, 0.35, 0.25];
/// Share of the housing's heat capacity.
pub(super) const CAPACITY_SHARES: [f64; NODES] = [0.2, 0.2, 0.4, 0.2];
/// Share of the external area.
pub(super) const EXTERNAL_SHARES: [f64; NODES] = [0.15, 0.15, 0.45, 0.25];
/// The node next to the bearing housing, which the turbine radiates to.
pub(super) const BACK_NODE: usize = 1;
/// The node with the Tc probe.
pub(super) const PROBE_NODE: usize = 2;
/// The node with the stem of the T2 probe.
pub(super) const FLANGE_NODE: usize = 3;

/// h of each node over the mean: it falls along the passage and keeps its area mean.
pub(super) fn h_ratios(structure: &OtherStructure) -> [f64; NODES] {
    let slope = structure.uneven_h_ratio;
    let raw: [f64; NODES] =
        std::array::from_fn(|node| 1.0 + slope * (1.0 - 2.0 * node as f64 / (NODES - 1) as f64));
    let mean: f64 = raw.iter().zip(AREA_SHARES).map(|(raw, share)| raw * share).sum();
    raw.map(|raw| raw / mean)
}

/// Returns the gas temperature after the last node, K, and the heat into each node, W. `conductance_w_k`: total conductance of all nodes
/// at mean h, as a function of wall and gas temperature. `is_mixed`: the gas has one temperature in the whole passage.
pub(super) fn heat_nodes(
    h_ratios: &[f64; NODES],
    is_mixed: bool,
    conductance_w_k: impl Fn(f64, f64) -> f64,
    gas_k: f64,
    walls_k: &[f64; NODES],
    flow_kg_s: f64,
    cp_j_kgk: f64,
) -> (f64, [f64; NODES]) {
    let node_w_k =
        |node: usize, gas_k: f64| conductance_w_k(walls_k[node], gas_k) * h_ratios[node] * AREA_SHARES[node];
    if is_mixed {
        // Each node meets the outlet gas: eq. 3 with several walls.
        let nodes_w_k: [f64; NODES] = std::array::from_fn(|node| node_w_k(node, gas_k));
        let stream_w_k = flow_kg_s * cp_j_kgk;
        let from_walls_w: f64 = nodes_w_k.iter().zip(walls_k).map(|(node, wall_k)| node * wall_k).sum();
        let out_k = (stream_w_k * gas_k + from_walls_w) / (stream_w_k + nodes_w_k.iter().sum::<f64>());
        return (out_k, std::array::from_fn(|node| nodes_w_k[node] * (out_k - walls_k[node])));
    }
    let mut gas_k = gas_k;
    let heats_w = std::array::from_fn(|node| {
        let (heat_w, next_k) = after_wheel(node_w_k(node, gas_k), gas_k, walls_k[node], flow_kg_s, cp_j_kgk);
        gas_k = next_k;
        heat_w
    });
    (gas_k, heats_w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_to_one_and_the_mean_of_h_is_kept() {
        for shares in [AREA_SHARES, CAPACITY_SHARES, EXTERNAL_SHARES] {
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        let ratios = h_ratios(&OtherStructure::default());
        let mean: f64 = ratios.iter().zip(AREA_SHARES).map(|(ratio, share)| ratio * share).sum();
        assert!((mean - 1.0).abs() < 1e-12 && ratios[0] > 1.4 && ratios[3] < 0.7, "{ratios:?}");
    }

    /// The heat into the nodes equals the loss of the gas.
    #[test]
    fn the_gas_loses_what_the_nodes_take() {
        let walls_k = [330.0, 325.0, 320.0, 318.0];
        let ratios = h_ratios(&OtherStructure::default());
        for is_mixed in [false, true] {
            let (out_k, heats_w) = heat_nodes(&ratios, is_mixed, |_, _| 4.0, 390.0, &walls_k, 0.04, 1008.0);
            let lost_w = 0.04 * 1008.0 * (390.0 - out_k);
            assert!((heats_w.iter().sum::<f64>() - lost_w).abs() < 1e-9, "{heats_w:?} {lost_w}");
        }
    }
}
