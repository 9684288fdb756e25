//! Turbine side of the model. Flow, pressures and speed are measured; efficiency, heat transfer and housing are free parameters.

use crate::driven::compressor::MIN_FLOW_KG_S;
use crate::driven::side::{
    CORRELATION_S, HOUSING_CORRELATION_S, ModelError, Parameter, Rows, Side, SideChannels, SideModel,
    does_work, log_normal, normal, relaxed_k, true_drive,
};
use mapper_core::Channel;
use mapper_physics::laws::housing::turbine_capacity_j_k;
use mapper_physics::laws::turbine::TurbineInlet;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::instruments::ChannelFollower;
use mapper_physics::simulation::model::rad_s_of_rpm;
use std::f64::consts::LN_2;

/// Unknowns, in the order of [`TurbineSide::predict`]: factors on the campaign's machine. The priors of heat transfer and housing are those of turbines of
/// its size. Bound: published turbines of automotive size, and housings from bare to insulated, lie within two sigmas.
const UNKNOWNS: [Parameter; 9] = [
    normal("eta_t", "", 1.0, 0.1, "best turbine efficiency, over the declared one"),
    normal("u_c", "", 1.0, 0.08, "blade-speed ratio of the best efficiency, over the declared one"),
    normal("eta_t_ratio", "", 0.0, 0.05, "change of the efficiency per unit of the logarithm of P3/P4"),
    log_normal(
        "h_t",
        "",
        1.0,
        0.4,
        "heat transfer inside the housing, over Appendix A's law on the declared area",
    ),
    log_normal("capacity", "", 1.0, 0.4, "heat capacity of the housing, over the declared one"),
    log_normal("loss", "W/K", 4.0, 0.8, "conductance from the housing to oil, compressor and engine bay"),
    normal("surroundings", "K", 345.0, 40.0, "temperature of the surroundings of the housing"),
    normal(
        "housing_start",
        "K",
        0.0,
        60.0,
        "housing minus its reading (T4 if Tt is not measured), at the start",
    ),
    normal("t4_offset", "K", 0.0, 2.0, "constant offset of T4 minus that of T3"),
];

/// Errors of T4 (a parabola over the blade-speed ratio, at a drop of some hundred kelvin) and of Tt (one thermocouple for a whole housing).
/// Judgement: medians of the residuals of good engine logs.
const MODEL_ERRORS: [ModelError; 2] = [
    ModelError { median_k: 0.45, width: 0.25, correlation_s: CORRELATION_S },
    ModelError { median_k: 8.0, width: 0.0, correlation_s: HOUSING_CORRELATION_S },
];
/// Minimum expansion ratio. Bound: the equations need a flow.
const MIN_EXPANSION_RATIO: f64 = 1.001;

pub(crate) struct TurbineSide {
    rows: Rows,
}

impl SideModel for TurbineSide {
    const SIDE: Side = Side::Turbine;
    const PRESSURE: Channel = Channel::P3;
    const UNKNOWNS: &'static [Parameter] = &UNKNOWNS;
    const MODEL_ERRORS: &'static [ModelError] = &MODEL_ERRORS;
    const CHANNELS: SideChannels<'static> = SideChannels {
        drives: &[Channel::ShaftSpeed, Channel::TurbineFlow, Channel::P3, Channel::T3, Channel::P4],
        judged: &[Channel::T4, Channel::Tt],
        is_usable: |row| {
            let [speed_rpm, flow_kg_s, p3_pa, _, p4_pa] = *row else { return false };
            does_work(speed_rpm, flow_kg_s, p4_pa, p3_pa)
        },
    };

    fn of(rows: Rows) -> Self {
        TurbineSide { rows }
    }

    fn rows(&self) -> &Rows {
        &self.rows
    }

    fn predict(&self, rig: &Rig, unknowns: &[f64]) -> Vec<Vec<f64>> {
        let rows = &self.rows;
        let mut columns = vec![Vec::with_capacity(rows.len()), Vec::with_capacity(rows.len())];
        let &[eta, u_c, eta_ratio, h, capacity, loss_w_k, surroundings_k, start_k, t4_offset_k] = unknowns
        else {
            return columns;
        };
        let read = |channel: Channel| true_drive(rows, rig, channel);
        let [speeds_rpm, flows_kg_s, p3s_pa, t3s_k, p4s_pa] = [
            read(Channel::ShaftSpeed),
            read(Channel::TurbineFlow),
            read(Channel::P3),
            read(Channel::T3),
            read(Channel::P4),
        ];
        let mut params = rig.model.params;
        params.turbine.nusselt_coefficient *= h;
        params.turbine.housing_mass_kg *= capacity;
        params.turbine.peak_blade_speed_ratio *= u_c;
        let best = eta * params.turbine.peak_efficiency;
        let choked_kg_s = params.turbine.choked_flow_kg_s;
        let [mut t4_probe, mut tt_probe] =
            [Channel::T4, Channel::Tt].map(|channel| ChannelFollower::new(*rig.instruments.path(channel)));
        let first_k = rows.first_judged(Channel::Tt).or_else(|| rows.first_judged(Channel::T4));
        let mut tt_k = first_k.unwrap_or(f64::NAN) + start_k;
        for i in 0..rows.len() {
            let (p3_pa, t3_k, p4_pa) = (p3s_pa[i].max(MIN_EXPANSION_RATIO * p4s_pa[i]), t3s_k[i], p4s_pa[i]);
            let boundary = BoundaryConditions { p3_pa, t3_k, p4_pa, ..BoundaryConditions::default() };
            // The capacity for which the turbine passes the measured flow.
            params.turbine.choked_flow_kg_s = choked_kg_s;
            let declared_kg_s = TurbineInlet::new(&params.turbine, &boundary).flow_kg_s;
            params.turbine.choked_flow_kg_s = choked_kg_s * flows_kg_s[i].max(MIN_FLOW_KG_S) / declared_kg_s;
            params.turbine.peak_efficiency = best + eta_ratio * ((p3_pa / p4_pa).ln() - LN_2);
            let inlet = TurbineInlet::new(&params.turbine, &boundary);
            let turbine = inlet.at(tt_k, rad_s_of_rpm(speeds_rpm[i]));
            columns[0].push(t4_probe.read(rows.t_s[i], turbine.t4_k) + t4_offset_k);
            columns[1].push(tt_probe.read(rows.t_s[i], tt_k));
            let gas_w_k = turbine.h_w_m2k * params.turbine.internal_area_m2;
            let net_w = turbine.heat_w - loss_w_k * (tt_k - surroundings_k);
            let capacity_j_k = turbine_capacity_j_k(&params, tt_k);
            tt_k = relaxed_k(tt_k, net_w, gas_w_k + loss_w_k, capacity_j_k, rows.elapsed_s(i));
        }
        columns
    }

    fn covered(effect: &str) -> Option<&'static str> {
        match effect {
            "turbine_efficiency" => {
                Some("the unknown eta_t covers it: the turbine efficiency is fitted within a tenth")
            }
            _ => None,
        }
    }

    fn why_silent(&self, submodel: Submodel) -> &'static str {
        match submodel {
            Submodel::TurbineFlow => "the turbine flow is measured: its swallowing curve is not used",
            Submodel::Actuator => "P3 is measured: its command is not used",
            Submodel::Shaft => "the speed is measured: the balance of powers is not used",
            Submodel::TurbineHousing => "the heat between housing and surroundings is fitted as an unknown",
            _ => "it acts on the compressor side",
        }
    }
}
