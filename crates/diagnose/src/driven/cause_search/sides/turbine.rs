//! Turbine side of the model. Flow, pressures and speed are measured; efficiency, heat transfer and housing are free parameters.

use crate::driven::Parameter;
use crate::driven::cause_search::sides::side::{Side, Smooth, Which, truth};
use crate::driven::density::{ALIKE_S, HOUSING_ALIKE_S};
use crate::driven::log_rows::{Rows, SMALLEST_FLOW_KG_S, WORKING_RATIO, Wanted};
use crate::driven::parameters::Spread;
use mapper_core::Channel;
use mapper_physics::laws::housing::turbine_capacity_j_k;
use mapper_physics::laws::turbine::TurbineInlet;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::{Rig, Submodel};
use mapper_physics::rig::instruments::ChannelFollower;
use mapper_physics::simulation::model::rad_s_of_rpm;
use std::f64::consts::LN_2;

const fn unknown(
    name: &'static str,
    unit: &'static str,
    middle: f64,
    width: f64,
    spread: Spread,
    description: &'static str,
) -> Parameter {
    Parameter { name, description, unit, middle, width, spread }
}

/// Free parameters, in the order of [`TurbineSide::predict`]: scale factors on the campaign's machine, with heat transfer and housing
/// priors from other turbines of its size.
static UNKNOWNS: [Parameter; 9] = [
    unknown("eta_t", "", 1.0, 0.1, Spread::Normal, "best turbine efficiency, over the declared one"),
    unknown(
        "u_c",
        "",
        1.0,
        0.08,
        Spread::Normal,
        "blade-speed ratio of the best efficiency, over the declared one",
    ),
    unknown(
        "eta_t_ratio",
        "",
        0.0,
        0.05,
        Spread::Normal,
        "change of the efficiency per unit of the logarithm of P3/P4",
    ),
    unknown(
        "h_t",
        "",
        1.0,
        0.4,
        Spread::LogNormal,
        "heat transfer inside the housing, over Appendix A's law on the declared area",
    ),
    unknown(
        "capacity",
        "",
        1.0,
        0.4,
        Spread::LogNormal,
        "heat capacity of the housing, over the declared one",
    ),
    unknown(
        "loss",
        "W/K",
        4.0,
        0.8,
        Spread::LogNormal,
        "conductance from the housing to what surrounds it: oil, compressor, engine bay",
    ),
    unknown("surroundings", "K", 345.0, 40.0, Spread::Normal, "temperature of what surrounds the housing"),
    unknown(
        "housing_start",
        "K",
        0.0,
        60.0,
        Spread::Normal,
        "housing at the start, over its reading or, without one, over T4 there",
    ),
    unknown("t4_offset", "K", 0.0, 2.0, Spread::Normal, "fixed offset of T4 less that of T3"),
];

/// The turbine side.
pub(crate) struct TurbineSide {
    rows: Rows,
}

impl Side for TurbineSide {
    const WHICH: Which = Which::Turbine;
    const PRESSURE: Channel = Channel::P3;

    fn wanted() -> Wanted<'static> {
        Wanted {
            drives: &[Channel::ShaftSpeed, Channel::TurbineFlow, Channel::P3, Channel::T3, Channel::P4],
            judged: &[Channel::T4, Channel::Tt],
            works: |row| {
                let [speed_rpm, flow_kg_s, p3_pa, _, p4_pa] = *row else { return false };
                p3_pa >= WORKING_RATIO * p4_pa && flow_kg_s >= SMALLEST_FLOW_KG_S && speed_rpm > 0.0
            },
        }
    }

    fn unknowns() -> &'static [Parameter] {
        &UNKNOWNS
    }

    fn smooth() -> &'static [Smooth] {
        // T4: error of a parabola over the blade-speed ratio, at a temperature drop of some hundred kelvin.
        &[
            Smooth { median_k: 0.45, width: 0.25, alike_s: ALIKE_S },
            Smooth { median_k: 8.0, width: 0.0, alike_s: HOUSING_ALIKE_S },
        ]
    }

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
        let read = |channel: Channel| truth(rows, rig, channel);
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
        let first = |channel: Channel| {
            let column = rows.judged.iter().find(|(of, _)| *of == channel);
            column.and_then(|(_, column)| column.iter().copied().find(|k| k.is_finite()))
        };
        let mut tt_k = first(Channel::Tt).or_else(|| first(Channel::T4)).unwrap_or(f64::NAN) + start_k;
        for i in 0..rows.len() {
            let (p3_pa, t3_k, p4_pa) = (p3s_pa[i].max(1.001 * p4s_pa[i]), t3s_k[i], p4s_pa[i]);
            let boundary = BoundaryConditions { p3_pa, t3_k, p4_pa, ..BoundaryConditions::default() };
            // Set the turbine capacity to the measured flow.
            params.turbine.choked_flow_kg_s = choked_kg_s;
            let declared_kg_s = TurbineInlet::new(&params.turbine, &boundary).flow_kg_s;
            params.turbine.choked_flow_kg_s = choked_kg_s * flows_kg_s[i].max(1e-4) / declared_kg_s;
            params.turbine.peak_efficiency = best + eta_ratio * ((p3_pa / p4_pa).ln() - LN_2);
            let inlet = TurbineInlet::new(&params.turbine, &boundary);
            let turbine = inlet.at(tt_k, rad_s_of_rpm(speeds_rpm[i]));
            columns[0].push(t4_probe.read(rows.t_s[i], turbine.t4_k) + t4_offset_k);
            columns[1].push(tt_probe.read(rows.t_s[i], tt_k));
            // Exact exponential relaxation towards the current equilibrium: bounded over any gap in the log.
            let elapsed_s = rows.t_s.get(i + 1).map_or(0.0, |next_s| next_s - rows.t_s[i]);
            let gas_w_k = turbine.h_w_m2k * params.turbine.internal_area_m2;
            let conductance_w_k = gas_w_k + loss_w_k;
            let net_w = turbine.heat_w - loss_w_k * (tt_k - surroundings_k);
            let share = -(-conductance_w_k * elapsed_s / turbine_capacity_j_k(&params, tt_k)).exp_m1();
            tt_k += net_w / conductance_w_k * share;
        }
        columns
    }

    fn free(effect: &str) -> Option<&'static str> {
        match effect {
            "turbine_efficiency" => {
                Some("turbine efficiency is free here within a tenth: it stands among the unknowns (eta_t)")
            }
            _ => None,
        }
    }

    fn silent(&self, submodel: Submodel) -> &'static str {
        match submodel {
            Submodel::TurbineFlow => "flow is as measured here: no swallowing curve is asked",
            Submodel::Actuator => "P3 is as measured here: nobody set it",
            Submodel::Shaft => "speed is as measured here: no balance of powers is asked",
            Submodel::TurbineHousing => "the heat between housing and surroundings is free here",
            _ => "it acts on the compressor's side",
        }
    }
}
