//! The grid of docs/explanation/planner.md, a request, and a housing with one time constant per point.

use mapper_core::{Dwell, Limits, OperatingPoint, RigActuators, SettleBands, Timing, VisitOrder, WindowRule};
use mapper_physics::gas::air;
use mapper_physics::laws::housing;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::FollowOutlet;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::steady;
use mapper_planner::PlanRequest;
use mapper_planner::housing::Chain;

/// Points along speed lines, in the order of conventional mapping.
pub fn grid() -> Vec<OperatingPoint> {
    [50e3, 70e3, 90e3, 110e3, 130e3, 150e3]
        .iter()
        .flat_map(|speed| [0.5, 0.7, 1.0].map(|valve| (*speed, valve)))
        .map(|(speed_rpm, valve_opening_ratio)| OperatingPoint { speed_rpm, valve_opening_ratio })
        .collect()
}

pub fn request<'a>(model: &'a Model, points: &'a [OperatingPoint], order: VisitOrder) -> PlanRequest<'a> {
    PlanRequest {
        campaign_name: "test",
        campaign_canonical: "{}",
        model,
        boundary: BoundaryConditions::default(),
        follow_outlet: FollowOutlet::default(),
        points,
        order,
        timing: Timing { warm_up_s: 3600.0, dwell: Dwell::Fixed(120.0), cool_down_s: 0.0 },
        window: WindowRule::Fixed { start_s: 10.0, end_s: 110.0 },
        settle_bands: SettleBands::default(),
        limits: Limits {
            speed_max_rpm: 180e3,
            p3_min_pa: 110e3,
            p3_max_pa: 400e3,
            p3_stroke_s: None,
            t3_max_k: None,
            t2_max_k: None,
            surge_margin_min_ratio: None,
            housing_gradient_max_k: None,
            overshoot_max_ratio: None,
            avoid: mapper_core::AvoidedSpeeds::NONE,
        },
        actuators: RigActuators::default(),
        repeats: None,
        return_to_first: false,
        appended: None,
        method: None,
        effort: 0.3,
        seed: 1,
    }
}

/// The compressor housing alone: it approaches the point's steady temperature with the point's time constant,
/// `C/(h A/(1 + NTU) + G_bearing)`.
pub struct SimpleHousing {
    settled_k: Vec<f64>,
    time_constant_s: Vec<f64>,
}

impl SimpleHousing {
    pub fn of(model: &Model, points: &[OperatingPoint]) -> Self {
        let params = &model.params;
        let rows: Vec<(f64, f64)> = points
            .iter()
            .map(|point| {
                let boundary = BoundaryConditions {
                    valve_opening_ratio: point.valve_opening_ratio,
                    ..BoundaryConditions::default()
                };
                let steady = steady::hold_speed(model, point.speed_rpm, &boundary).unwrap();
                let (outputs, tc_k) = (&steady.outputs, steady.state.tc_k);
                let gas_w_k = outputs.h_w_m2k * params.compressor.internal_area_m2;
                let cp = air::heat_capacity_j_kgk(outputs.t2_prime_k);
                let conductance_w_k = gas_w_k / (1.0 + gas_w_k / (outputs.flow_kg_s * cp))
                    + housing::bearing_conductance_w_k(&params.bearing);
                (tc_k, housing::compressor_capacity_j_k(params, tc_k) / conductance_w_k)
            })
            .collect();
        SimpleHousing {
            settled_k: rows.iter().map(|row| row.0).collect(),
            time_constant_s: rows.iter().map(|row| row.1).collect(),
        }
    }
}

impl Chain for SimpleHousing {
    type State = f64;

    fn len(&self) -> usize {
        self.settled_k.len()
    }

    fn first(&self, to: usize) -> f64 {
        self.settled_k[to]
    }

    fn step(&self, _from: usize, to: usize, tc_k: f64) -> (f64, f64) {
        let (distance_k, tau_s) = (tc_k - self.settled_k[to], self.time_constant_s[to]);
        let left_k = |t_s: f64| distance_k * (-t_s / tau_s).exp();
        (left_k(110.0) - left_k(10.0), self.settled_k[to] + left_k(120.0))
    }

    fn settled(&self, at: usize) -> f64 {
        self.settled_k[at]
    }

    fn is_indistinguishable(&self, a: f64, b: f64) -> bool {
        (a - b).abs() < 0.01
    }
}
