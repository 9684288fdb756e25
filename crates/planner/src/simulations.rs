//! Steps that were simulated, kept: a plan is made in rounds that come by the same states again and again.

use mapper_physics::forecast::{StepForecast, forecast_step};
use mapper_physics::model::{Model, State};
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::SimulationError;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Most points of a plan whose steps are kept, which come to some twenty times as many, and most steps that are kept, of 30 kB each.
const MOST_POINTS: usize = 100;
const MOST_KEPT: usize = 2000;

/// Steps of one machine, each simulated to the longest dwell once and ended where it is asked for. What they give is the same whether
/// they were kept or not.
#[derive(Debug)]
pub struct Simulations {
    longest_s: f64,
    keeps: bool,
    kept: Mutex<HashMap<Vec<u64>, Vec<Kept>>>,
}

type Kept = (BoundaryConditions, Arc<StepForecast>);

impl Simulations {
    /// For plans of so many points of one model, whose steps last up to `longest_s`.
    pub fn new(longest_s: f64, points: usize) -> Self {
        Simulations { longest_s, keeps: points <= MOST_POINTS, kept: Mutex::default() }
    }

    /// The step of `dwell_s` from `state` at `boundary`.
    pub(crate) fn step(
        &self,
        model: &Model,
        state: State,
        boundary: &BoundaryConditions,
        dwell_s: f64,
    ) -> Result<StepForecast, SimulationError> {
        if !self.keeps || dwell_s > self.longest_s {
            return forecast_step(model, state, boundary, dwell_s);
        }
        let key = bits(&state);
        let found = {
            let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            let of_state = kept.get(&key).into_iter().flatten();
            of_state.filter(|(at, _)| at == boundary).map(|(_, step)| Arc::clone(step)).next()
        };
        let long = match found {
            Some(long) => long,
            None => {
                let long = Arc::new(forecast_step(model, state, boundary, self.longest_s)?);
                let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
                if kept.len() < MOST_KEPT {
                    kept.entry(key).or_default().push((*boundary, Arc::clone(&long)));
                }
                long
            }
        };
        // Between two rows a step has an end of its own.
        long.ended_at(dwell_s).map_or_else(|| forecast_step(model, state, boundary, dwell_s), Ok)
    }
}

fn bits(state: &State) -> Vec<u64> {
    let State { shaft_speed_rad_s, p2_pa, tc_k, tt_k, t2_tip_k, inner_k, extra_k } = state;
    let named = [shaft_speed_rad_s, p2_pa, tc_k, tt_k, t2_tip_k, inner_k];
    named.into_iter().chain(extra_k).map(|value| value.to_bits()).collect()
}
