//! Compressor side of the model with all effects. Flow is measured and efficiency is fitted; the map is not used.

use crate::driven::side::{
    CORRELATION_S, HOUSING_CORRELATION_S, ModelError, Parameter, Rows, Side, SideChannels, SideModel,
    does_work, log_normal, normal, relaxed_k, true_drive,
};
use mapper_core::{Channel, SAMPLE_INTERVAL_S};
use mapper_identify::EFFICIENCY;
use mapper_numerics::statistics::mean;
use mapper_physics::compressor_map::closed_form_map::OnePointMap;
use mapper_physics::laws::housing::compressor_capacity_j_k;
use mapper_physics::machine::params::{BoundaryConditions, MODEL_REFERENCE};
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::instruments::ChannelFollower;
use mapper_physics::simulation::model::{State, rad_s_of_rpm};
use std::sync::Arc;

/// Unknowns, in the order of [`CompressorSide::predict`]. The area split and the probe keep their declared values, because they are library causes. The
/// prior of the efficiency is wide and includes map shapes beyond a parabola, so that no cause is named for a good compressor.
/// Bound: published maps of automotive compressors, and housings from bare to insulated, lie within two sigmas.
const UNKNOWNS: [Parameter; 16] = {
    const fn further(name: &'static str, description: &'static str) -> Parameter {
        normal(name, "", 0.0, 0.15, description)
    }
    [
        normal("eta", "", 0.72, 0.10, "isentropic efficiency, total to total, at middle speed and flow"),
        normal("eta_speed", "", 0.0, 0.12, "its change per unit of relative speed"),
        normal("eta_speed_2", "", -0.10, 0.12, "its curvature over relative speed"),
        normal("eta_flow", "", 0.0, 0.12, "its change per unit of the logarithm of the flow coefficient"),
        normal("eta_flow_2", "", -0.5, 0.3, "its curvature over the logarithm of the flow coefficient"),
        log_normal(
            "h",
            "",
            1.0,
            0.5,
            "heat transfer inside the housing, over Appendix A's law on the declared area",
        ),
        log_normal("capacity", "", 1.0, 0.5, "heat capacity of the housing, over the declared one"),
        log_normal("loss", "W/K", 2.0, 1.0, "conductance from the housing to oil, turbine and engine bay"),
        normal("surroundings", "K", 345.0, 25.0, "temperature of the surroundings of the housing"),
        normal("housing_start", "K", 0.0, 20.0, "housing minus the mean of T1 and T2, at the start"),
        normal("t2_offset", "K", 0.0, 1.0, "constant offset of T2 minus that of T1"),
        further("eta_speed_flow", "change of the efficiency with speed times flow coefficient, logarithms"),
        further("eta_speed_3", "cube of the efficiency over relative speed"),
        further("eta_speed_2_flow", "change of the efficiency with speed squared times flow coefficient"),
        further("eta_speed_flow_2", "change of the efficiency with speed times flow coefficient squared"),
        further("eta_flow_3", "cube of the efficiency over the logarithm of the flow coefficient"),
    ]
};

/// Geometric means of speed, rpm, and flow coefficient over the rows; 1 without any.
fn middles(rows: &Rows) -> (f64, f64) {
    let of = |channel: Channel| rows.drive(channel);
    let [speed_rpm, flow_kg_s, p1_pa, t1_k] =
        [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::T1].map(of);
    let flow = |i: usize| flow_coefficient(speed_rpm[i], flow_kg_s[i], p1_pa[i], t1_k[i]).ln();
    let geometric = |mean: Option<f64>| mean.map_or(1.0, f64::exp);
    (geometric(mean(speed_rpm.iter().map(|rpm| rpm.ln()))), geometric(mean((0..rows.len()).map(flow))))
}

/// Flow over speed at inlet density, kg K/(s Pa rpm): the flow coefficient without wheel size and gas constant.
fn flow_coefficient(speed_rpm: f64, flow_kg_s: f64, p1_pa: f64, t1_k: f64) -> f64 {
    flow_kg_s * t1_k / (p1_pa * speed_rpm)
}

/// Errors of T2 (a polynomial map and a single node of a housing) and of Tc (one thermocouple for a whole housing). Judgement: medians of the
/// residuals of good engine logs.
const MODEL_ERRORS: [ModelError; 2] = [
    ModelError { median_k: 0.18, width: 0.25, correlation_s: CORRELATION_S },
    ModelError { median_k: 3.0, width: 0.0, correlation_s: HOUSING_CORRELATION_S },
];
/// Inlet pressure of a turbine with which the model has a solution, Pa. Bound: any; the compressor side does not depend on it.
const TURBINE_P3_PA: f64 = 150e3;
/// Outlet pressure of a state whose housing and probe alone are used, Pa. Bound: any.
const ANY_PA: f64 = 1e5;
/// Minimum flow of the equations, which divide by it, kg/s. Bound: a thousandth of any compressor's flow.
pub(crate) const MIN_FLOW_KG_S: f64 = 1e-4;
/// Minimum time between rows, s. Bound: avoids a division by zero.
const MIN_ELAPSED_S: f64 = 1e-9;

pub(crate) struct CompressorSide {
    rows: Rows,
    middle_speed_rpm: f64,
    middle_flow: f64,
}

impl SideModel for CompressorSide {
    const SIDE: Side = Side::Compressor;
    const PRESSURE: Channel = Channel::P2;
    const UNKNOWNS: &'static [Parameter] = &UNKNOWNS;
    const MODEL_ERRORS: &'static [ModelError] = &MODEL_ERRORS;
    const CHANNELS: SideChannels<'static> = SideChannels {
        drives: &[Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::P2, Channel::T1],
        judged: &[Channel::T2, Channel::Tc],
        is_usable: |row| {
            let [speed_rpm, flow_kg_s, p1_pa, p2_pa, _] = *row else { return false };
            does_work(speed_rpm, flow_kg_s, p1_pa, p2_pa)
        },
    };

    fn of(rows: Rows) -> Self {
        let (middle_speed_rpm, middle_flow) = middles(&rows);
        CompressorSide { rows, middle_speed_rpm, middle_flow }
    }

    fn rows(&self) -> &Rows {
        &self.rows
    }

    fn predict(&self, rig: &Rig, unknowns: &[f64]) -> Vec<Vec<f64>> {
        let rows = &self.rows;
        let mut columns = vec![Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len())];
        let &[
            eta,
            eta_speed,
            eta_speed_2,
            eta_flow,
            eta_flow_2,
            h,
            capacity,
            loss_w_k,
            surroundings_k,
            start_k,
            t2_offset_k,
            sf,
            sss,
            ssf,
            sff,
            fff,
        ] = unknowns
        else {
            return columns;
        };
        let read = |channel: Channel| true_drive(rows, rig, channel);
        let [speeds_rpm, flows_kg_s, p1s_pa, p2s_pa, t1s_k] = [
            read(Channel::ShaftSpeed),
            read(Channel::CompressorFlow),
            read(Channel::P1),
            read(Channel::P2),
            read(Channel::T1),
        ];
        let mut model = rig.model.clone();
        model.params.compressor.nusselt_coefficient *= h;
        model.params.compressor.housing_mass_kg *= capacity;
        let params = model.params;
        let compressor = params.compressor;
        let inner_ratio = compressor.inner_capacity_ratio;
        let dry_flow_ratio = compressor.air().dry_flow_ratio();
        let [mut t2_probe, mut tc_probe] =
            [Channel::T2, Channel::Tc].map(|channel| ChannelFollower::new(*rig.instruments.path(channel)));
        let mut state = self.start(rig, start_k, t2_offset_k);
        let mut tip = Tip { start_k: state.t2_tip_k, last: None };
        for i in 0..rows.len() {
            let (p1_pa, t1_k) = (p1s_pa[i], t1s_k[i]);
            let boundary =
                BoundaryConditions { t1_k, p1_pa, p3_pa: TURBINE_P3_PA, ..BoundaryConditions::default() };
            // With recirculation, the flow through the wheel exceeds the outlet flow.
            let wheel_kg_s = flows_kg_s[i].max(MIN_FLOW_KG_S) * (1.0 + compressor.recirculation_ratio);
            let speed = (speeds_rpm[i] / self.middle_speed_rpm).ln();
            let flow =
                (flow_coefficient(speeds_rpm[i], wheel_kg_s, p1s_pa[i], t1s_k[i]) / self.middle_flow).ln();
            let efficiency = (eta
                + (eta_speed + eta_speed_2 * speed) * speed
                + (eta_flow + eta_flow_2 * flow) * flow
                + speed * flow * (sf + ssf * speed + sff * flow)
                + sss * speed.powi(3)
                + fff * flow.powi(3))
            .clamp(*EFFICIENCY.start(), *EFFICIENCY.end());
            let flow_corrected_kg_s =
                wheel_kg_s * dry_flow_ratio / MODEL_REFERENCE.physical_flow_kg_s(1.0, t1s_k[i], p1s_pa[i]);
            model.map = Arc::new(OnePointMap { reference: MODEL_REFERENCE, flow_corrected_kg_s, efficiency });
            state.shaft_speed_rad_s = rad_s_of_rpm(speeds_rpm[i]);
            state.p2_pa = p2s_pa[i];
            let prepared = model.prepare_at(rows.t_s[i], &boundary);
            let outputs = prepared.evaluate(&state);
            state.t2_tip_k =
                tip.follow(rows.t_s[i], outputs.t2_probe_target_k, outputs.t2_probe_time_constant_s);
            columns[0].push(t2_probe.read(rows.t_s[i], state.t2_tip_k) + t2_offset_k);
            columns[1].push(tc_probe.read(rows.t_s[i], state.tc_k));
            let next_k = |from_k: f64, net_w: f64, conductance_w_k: f64, capacity_j_k: f64| {
                relaxed_k(from_k, net_w, conductance_w_k, capacity_j_k, rows.elapsed_s(i))
            };
            let gas_w_k = outputs.h_w_m2k * compressor.internal_area_m2 + compressor.inlet_conductance_w_k;
            let gas_w = outputs.compressor_heat_w + outputs.added.inner_heat_w;
            let lost_w = loss_w_k * (state.tc_k - surroundings_k) - outputs.added.compressor_heat_w;
            let capacity_j_k = compressor_capacity_j_k(&params, state.tc_k);
            if model.has_inner_wall() {
                let tie_w_k = compressor.inner_conductance_w_k;
                let inner_w = gas_w - outputs.inner_heat_w;
                let inner_k = next_k(state.inner_k, inner_w, gas_w_k + tie_w_k, inner_ratio * capacity_j_k);
                let outer_w = outputs.inner_heat_w - lost_w;
                state.tc_k =
                    next_k(state.tc_k, outer_w, loss_w_k + tie_w_k, (1.0 - inner_ratio) * capacity_j_k);
                state.inner_k = inner_k;
            } else {
                state.tc_k = next_k(state.tc_k, gas_w - lost_w, gas_w_k + loss_w_k, capacity_j_k);
            }
        }
        columns
    }

    fn covered(effect: &str) -> Option<&'static str> {
        match effect {
            "efficiency_scale" => {
                Some("the unknown eta covers it: the efficiency is fitted, and no map is used")
            }
            "htc_scale" => Some("the unknown h covers it: h is fitted within a factor of 1.6"),
            _ => None,
        }
    }

    fn why_silent(&self, submodel: Submodel) -> &'static str {
        match submodel {
            Submodel::CompressorFlow => "the flow is measured: no map is used",
            Submodel::Actuator | Submodel::Outlet => "P2 and flow are measured: P3 and valve are not used",
            Submodel::Shaft => "the speed is measured: the balance of powers is not used",
            Submodel::TurbineFlow | Submodel::TurbineHousing => {
                "it acts on the turbine side, or on the heat between housing and surroundings, which is fitted as an unknown"
            }
            Submodel::CompressorHousing => {
                "the heat between housing and surroundings is fitted as an unknown"
            }
            Submodel::TcProbe => "Tc is not recorded",
            _ => "no judged channel changes with it in this log",
        }
    }
}

impl CompressorSide {
    /// Initial state: the probe at its reading, the housing at its reading or, if it is not measured, at the mean of inlet and outlet.
    fn start(&self, rig: &Rig, start_over_k: f64, t2_offset_k: f64) -> State {
        let rows = &self.rows;
        let first =
            |channel: Channel| Some(rows.first_judged(channel)? - rig.instruments.path(channel).offset);
        let t1_k = rows.drive(Channel::T1).first().copied().unwrap_or(f64::NAN);
        let t2_k = first(Channel::T2).unwrap_or(t1_k) - t2_offset_k;
        let tc_k = first(Channel::Tc).unwrap_or(0.5 * (t1_k + t2_k)) + start_over_k;
        State::new(1.0, ANY_PA, tc_k, tc_k, t2_k)
    }
}

/// Tip of the probe. Between rows its target is a straight line, for which the lag is exact.
struct Tip {
    /// First reading, K.
    start_k: f64,
    /// Time, target and temperature of the previous row.
    last: Option<(f64, f64, f64)>,
}

impl Tip {
    fn follow(&mut self, t_s: f64, target_k: f64, tau_s: f64) -> f64 {
        let tip_k = match self.last {
            _ if tau_s <= 0.0 => target_k,
            // A slow tip starts at its reading, one that follows within a sample at its target.
            None => target_k + (self.start_k - target_k) * tau_s / (tau_s + SAMPLE_INTERVAL_S),
            Some((before_s, before_k, tip_k)) => {
                let elapsed_s = t_s - before_s;
                let slope = (target_k - before_k) / elapsed_s.max(MIN_ELAPSED_S);
                let follows_k = target_k - slope * tau_s;
                follows_k + (tip_k - (before_k - slope * tau_s)) * (-elapsed_s / tau_s).exp()
            }
        };
        self.last = Some((t_s, target_k, tip_k));
        tip_k
    }
}
