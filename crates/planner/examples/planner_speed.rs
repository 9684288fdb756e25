//! Benchmark of the planner: orders a grid of any size on the nominal machine, and prints gradients, bounds and time.
//!
//! `planner_speed POINTS [ORDER] [EFFORT] [SEED] [DWELL]`: 18 is the grid of docs/explanation/planner.md, others are rectangular grids from
//! 50 to 150 krpm and opening 0.5 to 2.5. Prints one line: points, order, effort, seed, sum, smallest, bounds, seconds.

#![allow(clippy::print_stdout, reason = "what it prints is what it is for")]

use mapper_core::{
    Dwell, Limits, OperatingPoint, Repeats, RigActuators, SettleBands, Timing, VisitOrder, WindowRule,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::FollowOutlet;
use mapper_physics::simulation::model::Model;
use mapper_planner::{PlanRequest, make_plan};
use std::time::Instant;

fn grid(points: usize) -> Vec<OperatingPoint> {
    let (speeds, openings, widest) = match points {
        18 => (6, vec![0.5, 0.7, 1.0], 1.0),
        _ => {
            let openings = ((points as f64).sqrt() * 0.7).round().max(1.0) as usize;
            (points.div_ceil(openings), Vec::new(), 2.5)
        }
    };
    let openings = if openings.is_empty() {
        let count = points.div_ceil(speeds);
        (0..count).map(|i| 0.5 + (widest - 0.5) * i as f64 / (count - 1).max(1) as f64).collect()
    } else {
        openings
    };
    let speed_rpm = |i: usize| 50e3 + 100e3 * i as f64 / (speeds - 1).max(1) as f64;
    (0..speeds)
        .flat_map(|i| {
            openings
                .iter()
                .map(move |valve| OperatingPoint { speed_rpm: speed_rpm(i), valve_opening_ratio: *valve })
        })
        .take(points)
        .collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let count: usize = arguments.next().map_or(Ok(18), |text| text.parse())?;
    let order = match arguments.next().as_deref() {
        Some("min_gradient") => VisitOrder::MinGradient,
        _ => VisitOrder::ThermalGradient,
    };
    let effort: f64 = arguments.next().map_or(Ok(1.0), |text| text.parse())?;
    let seed: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let dwell_s: f64 = arguments.next().map_or(Ok(120.0), |text| text.parse())?;
    let (model, points) = (Model::nominal(), grid(count));
    let request = PlanRequest {
        campaign_name: "speed",
        campaign_canonical: "{}",
        model: &model,
        boundary: BoundaryConditions::default(),
        follow_outlet: FollowOutlet::default(),
        points: &points,
        order,
        timing: Timing { warm_up_s: 3600.0, dwell: Dwell::Fixed(dwell_s), cool_down_s: 0.0 },
        window: WindowRule::Fixed { start_s: 10.0, end_s: dwell_s - 10.0 },
        settle_bands: SettleBands::default(),
        limits: Limits {
            speed_max_rpm: 180e3,
            p3_min_pa: 110e3,
            p3_max_pa: 500e3,
            p3_stroke_s: None,
            t3_max_k: None,
            t2_max_k: None,
            surge_margin_min_ratio: None,
            housing_gradient_max_k: None,
            overshoot_max_ratio: None,
            avoid: mapper_core::AvoidedSpeeds::NONE,
        },
        actuators: RigActuators::default(),
        repeats: Some(Repeats { jump: None, every_steps: 12, at_least: 2 }),
        return_to_first: true,
        appended: None,
        method: None,
        effort,
        bound: true,
        seed,
    };
    let started = Instant::now();
    let plan = make_plan(&request)?;
    let seconds = started.elapsed().as_secs_f64();
    let bound = plan.bound.map_or((f64::NAN, f64::NAN), |bound| (bound.sum_gradient_k, bound.min_gradient_k));
    println!(
        "{count} points, {}, effort {effort}, seed {seed}: {:.1} K in total (bound {:.1}), {:.2} K at minimum (bound {:.2}), {seconds:.2} s",
        plan.objective,
        plan.figures.sum_gradient_k,
        bound.0,
        plan.figures.min_gradient_k.unwrap_or(f64::NAN),
        bound.1,
    );
    Ok(())
}
