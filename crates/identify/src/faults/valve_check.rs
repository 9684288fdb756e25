//! Whether the back-pressure valve follows its commands, during a run: the balance of the valve alone, command by command.

use crate::IdentifyConfig;
use crate::faults::balances::valve::{Opening, ln_area, valve_rows};
use crate::faults::end_readings::{CHANNELS, PerChannel, Readings};
use crate::faults::found_fault::{FoundFault, Law, Machine, Suspect};
use crate::faults::nominal_rig::NominalRig;
use crate::faults::{Hypotheses, find};
use mapper_core::{Channel, Method, ModelTolerances};
use mapper_physics::simulation::model::Model;
use std::collections::BTreeMap;

/// Change of the area between two halves of the readings, ratio, below which the valve is at rest. Bound: a valve that needs a minute for its
/// stroke changes by more.
const AT_REST_RATIO: f64 = 0.02;
/// Number of commands that are compared. Bound: the cost grows with its cube, and this takes a millisecond.
const MAX_COMMANDS: usize = 60;

/// The valve after a command.
#[derive(Debug, Clone, PartialEq)]
pub enum ValveState {
    /// It still moves, or the readings are not sufficient.
    Unknown,
    /// It is not known to stand still.
    Follows,
    /// It stands where it stood under another command.
    StandsStill {
        /// The opening that flow and pressures have.
        opening_ratio: f64,
    },
}

/// The commands of a run so far, and the flow that followed.
#[derive(Debug, Clone)]
pub struct ValveCheck {
    config: IdentifyConfig,
    model: Model,
    tolerances: ModelTolerances,
    commands: Vec<(Opening, Readings)>,
}

impl ValveCheck {
    /// Channels of its readings, in their order.
    pub const CHANNELS: [Channel; CHANNELS.len()] = CHANNELS;

    /// A check of the declared valve.
    pub fn new(config: IdentifyConfig, model: Model, tolerances: ModelTolerances) -> Self {
        ValveCheck { config, model, tolerances, commands: Vec::new() }
    }

    /// Judges the valve by readings after a command, the medians of an earlier and a later half of `samples` over `duration_s`.
    pub fn judge(
        &mut self,
        command_ratio: f64,
        [earlier, later]: [PerChannel; 2],
        (samples, duration_s): (usize, f64),
    ) -> ValveState {
        let [earlier, latest] = [earlier, later].map(|values| self.readings(values));
        let change = (ln_area(&latest) - ln_area(&earlier)).abs();
        if change.is_nan() || change >= AT_REST_RATIO {
            return ValveState::Unknown;
        }
        let before = self.commands.last().map(|(opening, _)| *opening);
        let step = before.map_or(0, |before| before.step + 1);
        let side = before.map_or(0.0, |before| (command_ratio - before.position).signum());
        self.commands.push((Opening { step, position: command_ratio, side }, latest));
        let excess = self.commands.len().saturating_sub(MAX_COMMANDS);
        self.commands.drain(..excess);
        self.stands_still_at(step, samples, duration_s)
            .map_or(ValveState::Follows, |opening_ratio| ValveState::StandsStill { opening_ratio })
    }

    fn readings(&self, mut values: PerChannel) -> Readings {
        let [t1_k, t2_k, tc_k, p1_pa, p2_pa, flow_kg_s, _] = values;
        values[3] = self.config.inlet_tap.total_pa(p1_pa, flow_kg_s, t1_k);
        values[4] = self.config.outlet_tap.total_pa(p2_pa, flow_kg_s, t2_k);
        // The wall does not matter to the flow.
        values[2] = if tc_k.is_finite() { tc_k } else { t2_k };
        Readings { values, run_ratio: 0.0, exact_at: self.config.exact_at, air: self.config.air }
    }

    /// The opening at which the valve stands still under the command of this number.
    fn stands_still_at(&self, step: usize, samples: usize, duration_s: f64) -> Option<f64> {
        let conditions = BTreeMap::new();
        let nominal =
            NominalRig { model: &self.model, tolerances: &self.tolerances, conditions: &conditions };
        let colour = self.config.noise();
        let noise = CHANNELS.map(|channel| {
            self.config.sensor(channel).noise_sigma * colour.variance_of_mean(samples, duration_s).sqrt()
        });
        let rows = valve_rows(&self.commands, &noise, Some(&nominal), true)?;
        let opening = |machine: &Machine| match machine {
            Machine::ValveStuck { last, opening_ratio, .. } if *last == step => Some(*opening_ratio),
            _ => None,
        };
        // Most valves follow.
        rows.by_machine.iter().find_map(|(machine, _)| opening(machine))?;
        let hypotheses = Hypotheses::of(&[(Law::Valve, rows)], &self.config, Some(&nominal));
        let found = |fault: FoundFault| match fault.suspect {
            Suspect::Machine(machine) => opening(&machine),
            Suspect::Sensor(_) | Suspect::Unmodelled(_) => None,
        };
        find(&hypotheses, Method::Steady, &[]).into_iter().find_map(found)
    }
}
