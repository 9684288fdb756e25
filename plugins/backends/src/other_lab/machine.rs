//! The machine of the other lab: its equations and parameters.
//!
//! Map, turbine, bearing and the closure terms of single parts are the model's own, so that every effect has the same meaning here.
//! The coupling of the parts differs.

use mapper_core::Channel;
use mapper_physics::gas::air;
use mapper_physics::laws::compression::after_wheel;
use mapper_physics::laws::turbine::{TurbineInlet, TurbineState};
use mapper_physics::laws::{compression, housing, turbine};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::{Model, Outputs, State};

/// Shaft, two pressures, duct flow, turbine housing, probe tip, gas of the first volume, separation, nodes, their inner
/// walls, hidden temperatures of hooks, inner mass of the turbine housing.
pub(crate) const STATES: usize = 19;
const SHAFT: usize = 0;
const P_FIRST: usize = 1;
const DUCT_FLOW: usize = 2;
const P_SECOND: usize = 3;
const TURBINE: usize = 4;
const TIP: usize = 5;
const GAS: usize = 6;
const SEPARATION: usize = 7;
const OUTER: usize = 8;
const INNER: usize = 12;
const EXTRA: usize = 16;
const TURBINE_INNER: usize = 18;

/// Typical magnitudes of the states.
pub(crate) const SIZES: [f64; STATES] =
    [1e4, 1e5, 0.1, 1e5, 5e2, 3e2, 3e2, 1.0, 3e2, 3e2, 3e2, 3e2, 3e2, 3e2, 3e2, 3e2, 3e2, 3e2, 5e2];

/// Specific heat ratio of air in the volumes.
const GAMMA: f64 = 1.4;
/// Position on the speed line at which the flow separates, and the distance back to its reattachment.
const SEPARATION_POSITION: f64 = 0.90;
const REATTACHMENT_DISTANCE: f64 = 0.12;
/// Width of that transition as a position on the speed line, and its time, s.
const TRANSITION: f64 = 0.04;
const SEPARATION_S: f64 = 0.5;

/// State, outputs and rates at one instant.
pub(crate) struct Evaluation {
    pub(crate) state: State,
    pub(crate) outputs: Outputs,
    pub(crate) rates: [f64; STATES],
}

/// All states of a machine that correspond to the lumped model's `state`.
pub(crate) fn start(model: &Model, boundary: &BoundaryConditions, state: &State) -> [f64; STATES] {
    let outputs = model.prepare(boundary).evaluate(state);
    let mut y = [state.tc_k; STATES];
    y[SHAFT] = state.shaft_speed_rad_s;
    y[P_FIRST] = state.p2_pa;
    y[P_SECOND] = state.p2_pa;
    y[DUCT_FLOW] = outputs.flow_kg_s;
    y[TURBINE] = state.tt_k;
    y[TIP] = state.t2_tip_k;
    y[GAS] = outputs.t2_k;
    y[SEPARATION] = 0.0;
    y[INNER..EXTRA].fill(state.inner_k);
    y[EXTRA..TURBINE_INNER].copy_from_slice(&state.extra_k);
    y[TURBINE_INNER] = state.tt_k;
    y
}

/// The state as the rig's sensors define it: P2 before the valve, Tc at its probe.
pub(crate) fn lumped_state(y: &[f64; STATES]) -> State {
    State {
        shaft_speed_rad_s: y[SHAFT],
        p2_pa: y[P_SECOND],
        tc_k: y[OUTER + PROBE_NODE],
        tt_k: y[TURBINE],
        t2_tip_k: y[TIP],
        inner_k: y[INNER + PROBE_NODE],
        extra_k: [y[EXTRA], y[EXTRA + 1]],
    }
}

fn node_values(y: &[f64; STATES], first: usize) -> [f64; NODES] {
    std::array::from_fn(|node| y[first + node])
}

fn mean(values: &[f64; NODES], shares: &[f64; NODES]) -> f64 {
    values.iter().zip(shares).map(|(value, share)| value * share).sum()
}

/// Evaluates the machine at one time. `model` is that of the rig, with flow and efficiency scales without separation.
pub(crate) fn evaluate(
    model: &Model,
    structure: &OtherStructure,
    t_s: f64,
    boundary: &BoundaryConditions,
    y: &[f64; STATES],
) -> Evaluation {
    let separation = y[SEPARATION].clamp(0.0, 1.0);
    let mut separated = model.clone();
    let compressor = &mut separated.params.compressor;
    compressor.efficiency_scale_ratio *= 1.0 - structure.hysteresis_ratio * separation;
    compressor.flow_scale_ratio *= 1.0 - 0.5 * structure.hysteresis_ratio * separation;
    let prepared = separated.prepare_at(t_s, boundary);
    let params = &separated.params;
    let compressor = &params.compressor;
    let (outer_k, inner_k) = (node_values(y, OUTER), node_values(y, INNER));
    let has_inner = separated.has_inner_wall();
    let walls_k = if has_inner { inner_k } else { outer_k };
    let wheel = State {
        p2_pa: y[P_FIRST],
        tc_k: mean(&outer_k, &CAPACITY_SHARES),
        inner_k: mean(&inner_k, &AREA_SHARES),
        ..lumped_state(y)
    };
    // The model's own map, wheel and turbine, at the mean wall temperature.
    let lumped = prepared.evaluate(&wheel);
    let mut outputs = lumped;

    // Replace the single wall by the nodes.
    let flow_kg_s = lumped.flow_kg_s;
    let air = compressor.air().between(boundary.p1_pa, wheel.p2_pa);
    let gas_constant_j_kgk = air.gas_constant_j_kgk();
    let rise_ratio = compression::isentropic_rise_ratio(lumped.pressure_ratio, boundary.t1_k, air);
    let bulk_k = compression::compressed_k(boundary.t1_k, rise_ratio, lumped.efficiency, air);
    let cp2_j_kgk = air.heat_capacity_j_kgk(bulk_k);
    outputs.h_w_m2k *= (flow_kg_s / CONVECTION_FLOW_KG_S).powf(structure.convection_exponent_change);
    let whole_w_k = outputs.h_w_m2k * compressor.internal_area_m2;
    let directed_w_k =
        |wall_k: f64, gas_k: f64| whole_w_k * if wall_k > gas_k { compressor.hot_metal_h_ratio } else { 1.0 };
    let after_wheel_w_k =
        |wall_k: f64, gas_k: f64| directed_w_k(wall_k, gas_k) * (1.0 - compressor.alpha_area_ratio);
    let h_ratios = h_ratios(structure);
    let (gas_k, mut heats_w) = heat_nodes(
        &h_ratios,
        structure.mixed_gas,
        after_wheel_w_k,
        lumped.t2_prime_k,
        &walls_k,
        flow_kg_s,
        cp2_j_kgk,
    );
    let one_wall_w_k = after_wheel_w_k(lumped.wall_k, lumped.t2_prime_k) * lumped.h_w_m2k / outputs.h_w_m2k;
    let (one_wall_w, one_wall_k) =
        compression::after_wheel(one_wall_w_k, lumped.t2_prime_k, lumped.wall_k, flow_kg_s, cp2_j_kgk);
    // Keeps the change that hooks make to the outlet gas.
    let gas_k = gas_k + (lumped.t2_k - one_wall_k);
    // Before the wheel, the gas exchanges heat with the shroud. Its temperature is that of the model, at the mean wall temperature.
    heats_w[0] += lumped.compressor_heat_w - one_wall_w;

    // Two volumes and the duct between them.
    let volume_m3 = params.outlet.volume_m3;
    let first_m3 = structure.volume_share_ratio * volume_m3;
    let second_m3 = volume_m3 - first_m3;
    let [p_first_pa, p_second_pa, duct_kg_s, t_first_k] =
        [y[P_FIRST], y[P_SECOND], y[DUCT_FLOW], y[GAS].max(100.0)];
    let section_m2 = 0.25 * std::f64::consts::PI * compressor.outlet_diameter_m.powi(2);
    let density_kg_m3 = p_second_pa / (gas_constant_j_kgk * t_first_k);
    let loss_pa = structure.duct_loss_ratio * duct_kg_s * duct_kg_s.abs()
        / (2.0 * density_kg_m3 * section_m2 * section_m2);
    let duct_rate = section_m2 / structure.duct_length_m * (p_first_pa - p_second_pa - loss_pa);
    let p_first_rate = GAMMA * gas_constant_j_kgk / first_m3 * (flow_kg_s * gas_k - duct_kg_s * t_first_k);
    let gas_kg = p_first_pa * first_m3 / (gas_constant_j_kgk * t_first_k);
    let gas_rate =
        (flow_kg_s * cp2_j_kgk * (gas_k - t_first_k) + first_m3 * p_first_rate) / (gas_kg * cp2_j_kgk);
    let valve_kg_s = (air::GAS_CONSTANT_J_KGK / gas_constant_j_kgk).sqrt()
        * turbine::flow_kg_s(
            boundary.valve_opening_ratio * params.outlet.discharge_coefficient * params.outlet.valve_area_m2,
            p_second_pa,
            t_first_k,
            boundary.p1_pa,
        );
    let p_second_rate = GAMMA * gas_constant_j_kgk * t_first_k / second_m3
        * (duct_kg_s - valve_kg_s + lumped.added.outlet_flow_kg_s);

    // The probe: its stem ends in the flange, its tip in the first volume.
    let chi = params.t2_probe_stem_ratio;
    let recovery_k = lumped.t2_probe_target_k - (lumped.t2_k + chi * (wheel.tc_k - lumped.t2_k));
    outputs.t2_k = gas_k;
    outputs.t2_probe_target_k = t_first_k + chi * (outer_k[FLANGE_NODE] - t_first_k) + recovery_k;
    let tau_s = lumped.t2_probe_time_constant_s;
    outputs.t2_probe_k = if tau_s > 0.0 { y[TIP] } else { outputs.t2_probe_target_k };

    // The metal.
    let bearing_w_k = housing::bearing_conductance_w_k(&params.bearing);
    let bearing_k = housing::bearing_k(
        bearing_w_k,
        params.bearing.oil_conductance_w_k,
        housing::friction_heat_w(&params.bearing, y[SHAFT]),
        outer_k[BACK_NODE],
        y[TURBINE],
        boundary.oil_temperature_k,
    );
    outputs.bearing_k = bearing_k;
    // Efficiency and pressure ratio are those between the stations of P1 and P2: the loss of the duct belongs to the compressor.
    let station_ratio = y[P_SECOND] / boundary.p1_pa;
    outputs.efficiency *= compression::isentropic_rise_ratio(station_ratio, boundary.t1_k, air) / rise_ratio;
    outputs.radiation_w = housing::radiation_w(params.radiation_area_m2, y[TURBINE], outer_k[BACK_NODE]);
    let external_w: [f64; NODES] = std::array::from_fn(|node| {
        housing::external_heat_w(
            compressor.external_area_m2 * EXTERNAL_SHARES[node],
            compressor.emissivity_ratio,
            params.external_convection_ratio,
            outer_k[node],
            boundary.ambient_temperature_k,
        )
    });
    outputs.compressor_external_heat_w = external_w.iter().sum();
    outputs.compressor_heat_w = heats_w.iter().sum();
    outputs.valve_flow_kg_s = valve_kg_s;
    outputs.wall_k = mean(&walls_k, &AREA_SHARES);

    let mut rates = [0.0; STATES];
    let phi = compressor.inner_capacity_ratio;
    for node in 0..NODES {
        let share = CAPACITY_SHARES[node];
        let capacity_j_k = |wall_k: f64| share * housing::compressor_capacity_j_k(params, wall_k);
        let along_w: f64 = [node.checked_sub(1), Some(node + 1).filter(|next| *next < NODES)]
            .into_iter()
            .flatten()
            .map(|neighbour| structure.housing_coupling_w_k * (outer_k[neighbour] - outer_k[node]))
            .sum();
        let gas_w = heats_w[node] + share * lumped.added.inner_heat_w;
        let from_inside_w = if has_inner {
            let inner_w = compressor.inner_conductance_w_k * share * (inner_k[node] - outer_k[node]);
            rates[INNER + node] = (gas_w - inner_w) / (phi * capacity_j_k(inner_k[node]));
            inner_w
        } else {
            gas_w
        };
        let from_bearing_w = if node == BACK_NODE {
            bearing_w_k * (bearing_k - outer_k[node]) + outputs.radiation_w
        } else {
            0.0
        };
        rates[OUTER + node] = (from_inside_w + along_w + from_bearing_w - external_w[node]
            + share * lumped.added.compressor_heat_w)
            / ((1.0 - phi) * capacity_j_k(outer_k[node]));
    }
    let inner_ratio = structure.turbine_inner_ratio;
    let gas_side_k = if inner_ratio > 0.0 { y[TURBINE_INNER] } else { y[TURBINE] };
    let at_model_efficiency = TurbineInlet::new(&params.turbine, boundary).at(gas_side_k, y[SHAFT]);
    outputs.turbine = other_turbine(structure, at_model_efficiency, boundary);
    let turbine_w = prepared.turbine_housing_balance_w(&wheel, &outputs);
    let turbine_capacity_j_k = housing::turbine_capacity_j_k(params, y[TURBINE]);
    let inner_w = if inner_ratio > 0.0 {
        outputs.turbine.heat_w - TURBINE_JOINT_W_K * (y[TURBINE_INNER] - y[TURBINE])
    } else {
        0.0
    };
    rates[TURBINE] = (turbine_w - inner_w) / ((1.0 - inner_ratio) * turbine_capacity_j_k);
    rates[TURBINE_INNER] =
        if inner_ratio > 0.0 { inner_w / (inner_ratio * turbine_capacity_j_k) } else { 0.0 };
    rates[SHAFT] = prepared.shaft_balance_w(&outputs) / (params.shaft_inertia_kgm2 * y[SHAFT]);
    rates[P_FIRST] = p_first_rate;
    rates[DUCT_FLOW] = duct_rate;
    rates[P_SECOND] = p_second_rate;
    rates[TIP] = if tau_s > 0.0 { (outputs.t2_probe_target_k - y[TIP]) / tau_s } else { 0.0 };
    rates[GAS] = gas_rate;
    rates[SEPARATION] = separation_rate(structure, lumped.surge_position_ratio, y[SEPARATION]);
    rates[EXTRA..TURBINE_INNER].copy_from_slice(&lumped.added.extra_rates_k_s);
    Evaluation { state: lumped_state(y), outputs, rates }
}

/// The turbine with the efficiency of this machine.
fn other_turbine(
    structure: &OtherStructure,
    turbine: TurbineState,
    boundary: &BoundaryConditions,
) -> TurbineState {
    let away = (boundary.p3_pa / boundary.p4_pa / TURBINE_EXPANSION_RATIO).ln();
    let ratio = 1.0 + structure.turbine_efficiency_slope * away;
    TurbineState {
        t4_k: turbine.t3_prime_k - ratio * (turbine.t3_prime_k - turbine.t4_k),
        power_w: ratio * turbine.power_w,
        efficiency: ratio * turbine.efficiency,
        ..turbine
    }
}

/// Two stable states between the two thresholds: attached flow separates at the upper one, separated flow reattaches
/// below the lower one.
fn separation_rate(structure: &OtherStructure, place: f64, separation: f64) -> f64 {
    if structure.hysteresis_ratio == 0.0 {
        return 0.0;
    }
    let threshold = SEPARATION_POSITION - REATTACHMENT_DISTANCE * separation;
    let equilibrium = 1.0 / (1.0 + (-(place - threshold) / (0.25 * TRANSITION)).exp());
    (equilibrium - separation) / SEPARATION_S
}

/// Nodes of the housing: shroud, diffuser, scroll, outlet flange.
const NODES: usize = 4;
/// Share of each node in the area after the wheel; the shroud also has the area before the wheel.
const AREA_SHARES: [f64; NODES] = [0.1, 0.3, 0.35, 0.25];
/// Share of the housing's heat capacity.
const CAPACITY_SHARES: [f64; NODES] = [0.2, 0.2, 0.4, 0.2];
/// Share of the external area.
const EXTERNAL_SHARES: [f64; NODES] = [0.15, 0.15, 0.45, 0.25];
/// The node next to the bearing housing, which the turbine radiates to.
const BACK_NODE: usize = 1;
/// The node with the Tc probe.
const PROBE_NODE: usize = 2;
/// The node with the stem of the T2 probe.
const FLANGE_NODE: usize = 3;

/// h of each node over the mean: it falls along the passage and keeps its area mean.
fn h_ratios(structure: &OtherStructure) -> [f64; NODES] {
    let slope = structure.uneven_h_ratio;
    let raw: [f64; NODES] =
        std::array::from_fn(|node| 1.0 + slope * (1.0 - 2.0 * node as f64 / (NODES - 1) as f64));
    let mean: f64 = raw.iter().zip(AREA_SHARES).map(|(raw, share)| raw * share).sum();
    raw.map(|raw| raw / mean)
}

/// Returns the gas temperature after the last node, K, and the heat into each node, W. `conductance_w_k`: total conductance of all nodes
/// at mean h, as a function of wall and gas temperature. `is_mixed`: the gas has one temperature in the whole passage.
fn heat_nodes(
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

/// Name of this backend in campaigns.
pub const NAME: &str = "other_lab";

/// The structure. The defaults were set from the usual design of such machines before any diagnosis, and
/// are not fitted to the results of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherStructure {
    /// Conductance between neighbouring nodes of the housing, W/K, > 0. Aluminium, 160 W/(m K), a wall of 150 mm by 8 mm,
    /// nodes 40 mm apart: 5 W/K.
    pub housing_coupling_w_k: f64,
    /// Decrease of h along the passage, ratio: 0 is uniform; 0.5 is from 1.5 times the mean after the wheel to 0.5
    /// times at the outlet flange.
    pub uneven_h_ratio: f64,
    /// Whether the gas has one temperature in the whole passage, as in the lumped model; otherwise it cools along it.
    pub mixed_gas: bool,
    /// Length of the duct between the two volumes, m, > 0: its gas has inertia.
    pub duct_length_m: f64,
    /// Pressure loss of the duct, relative to its dynamic pressure.
    pub duct_loss_ratio: f64,
    /// Share of the outlet volume between wheel and duct, in the open interval 0..1.
    pub volume_share_ratio: f64,
    /// Loss of efficiency after flow separation, as a ratio; the loss of flow is half of it.
    pub hysteresis_ratio: f64,
    /// Factor on the natural frequencies of all sensors; infinity for sensors without lag.
    pub sensor_speed_ratio: f64,
    /// Added to the exponent of the compressor's law of convection, `h ~ m^n`; h is unchanged at 0.05 kg/s.
    pub convection_exponent_change: f64,
    /// Share of the turbine housing's mass that meets the gas; the other part has the Tt probe and all losses. 0: one mass.
    pub turbine_inner_ratio: f64,
    /// Relative change of the turbine's efficiency for a change of ln(P3/P4) by 1, unchanged at P3/P4 = 2.
    pub turbine_efficiency_slope: f64,
}

/// Flow at which the other law of convection meets that of the model, kg/s: the middle of the map.
pub(super) const CONVECTION_FLOW_KG_S: f64 = 0.05;
/// Expansion ratio at which both turbines have equal efficiency: the middle of their range.
pub(super) const TURBINE_EXPANSION_RATIO: f64 = 2.0;
/// Conductance between the two masses of the turbine housing, W/K: a flange of 40 cm2, 4000 W/(m2 K) at its joint.
pub(super) const TURBINE_JOINT_W_K: f64 = 16.0;

impl Default for OtherStructure {
    fn default() -> Self {
        OtherStructure {
            housing_coupling_w_k: 5.0,
            uneven_h_ratio: 0.5,
            mixed_gas: false,
            duct_length_m: 0.4,
            duct_loss_ratio: 0.2,
            volume_share_ratio: 0.3,
            hysteresis_ratio: 0.01,
            sensor_speed_ratio: 1.0,
            convection_exponent_change: 0.0,
            turbine_inner_ratio: 0.0,
            turbine_efficiency_slope: 0.0,
        }
    }
}

impl OtherStructure {
    /// Another machine: a turbine housing of two masses, a flatter law of convection, a turbine that gains efficiency with expansion, a
    /// compressor housing of loosely coupled nodes, a short duct, slow sensors, no hysteresis.
    pub fn two_masses() -> Self {
        OtherStructure {
            housing_coupling_w_k: 2.0,
            uneven_h_ratio: 0.2,
            mixed_gas: true,
            duct_length_m: 0.1,
            duct_loss_ratio: 0.5,
            volume_share_ratio: 0.5,
            hysteresis_ratio: 0.0,
            sensor_speed_ratio: 0.5,
            convection_exponent_change: -0.2,
            turbine_inner_ratio: 0.4,
            turbine_efficiency_slope: 0.1,
        }
    }

    /// Second-order sensors: channel, natural frequency in Hz, damping. Pressure lines oscillate, meters are filtered, probes
    /// in a sheath have two lags.
    pub(super) fn sensors(&self) -> Vec<(Channel, f64, f64)> {
        let defaults = [
            (Channel::P2, 8.0, 0.5),
            (Channel::CompressorFlow, 3.0, 0.7),
            (Channel::TurbineFlow, 3.0, 0.7),
            (Channel::T2, 2.0, 1.2),
            (Channel::T4, 1.0, 1.2),
            (Channel::Tc, 0.2, 1.2),
            (Channel::Tt, 0.2, 1.2),
        ];
        if self.sensor_speed_ratio.is_infinite() {
            return Vec::new();
        }
        defaults.map(|(channel, hz, damping)| (channel, hz * self.sensor_speed_ratio, damping)).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Between the thresholds the flow keeps its state.
    #[test]
    fn separated_flow_reattaches_only_below_the_lower_threshold() {
        let structure = OtherStructure::default();
        let rest = |place: f64, from: f64| {
            (0..2000).fold(from, |at, _| at + 0.05 * separation_rate(&structure, place, at))
        };
        assert!(rest(0.84, 0.0) < 0.05 && rest(0.84, 1.0) > 0.95);
        assert!(rest(0.97, 0.0) > 0.95 && rest(0.70, 1.0) < 0.05);
    }

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
