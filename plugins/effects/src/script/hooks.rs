//! Functions of a script as hooks of the model.

use super::engine::{At, HOOK_NAMES, Numbers, Program};
use mapper_core::{CHANNELS, Channel};
use mapper_physics::machine::hooks::{Hooks, Site};
use std::sync::{Arc, OnceLock};

/// A program with the values of its parameters.
#[derive(Debug)]
pub(super) struct ScriptHooks {
    program: Arc<Program>,
    numbers: Numbers,
    defined: [bool; HOOK_NAMES.len()],
    /// Name of the function for each channel that has one.
    readings: [Option<String>; CHANNELS.len()],
    fault: OnceLock<String>,
}

impl ScriptHooks {
    pub(super) fn new(program: Arc<Program>, numbers: Numbers) -> Self {
        let defined = HOOK_NAMES.map(|(name, _)| program.defines(name));
        let readings = CHANNELS.map(|row| {
            let name = format!("reading_{}", row.symbol);
            program.defines(&name).then_some(name)
        });
        ScriptHooks { program, numbers, defined, readings, fault: OnceLock::new() }
    }

    fn change(&self, index: usize, site: &Site<'_>, value: f64) -> f64 {
        if !self.defined[index] {
            return value;
        }
        let arguments = (At::new(site), self.numbers.clone(), value);
        self.program.call(HOOK_NAMES[index].0, arguments, &self.fault)
    }

    fn add(&self, index: usize, site: &Site<'_>) -> f64 {
        if !self.defined[index] {
            return 0.0;
        }
        self.program.call(HOOK_NAMES[index].0, (At::new(site), self.numbers.clone()), &self.fault)
    }
}

impl Hooks for ScriptHooks {
    fn flow_kg_s(&self, site: &Site<'_>, flow_kg_s: f64) -> f64 {
        self.change(0, site, flow_kg_s)
    }

    fn efficiency(&self, site: &Site<'_>, efficiency: f64) -> f64 {
        self.change(1, site, efficiency)
    }

    fn h_w_m2k(&self, site: &Site<'_>, h_w_m2k: f64) -> f64 {
        self.change(2, site, h_w_m2k)
    }

    fn gas_before_k(&self, site: &Site<'_>, t1_prime_k: f64) -> f64 {
        self.change(3, site, t1_prime_k)
    }

    fn gas_after_k(&self, site: &Site<'_>, t2_prime_k: f64) -> f64 {
        self.change(4, site, t2_prime_k)
    }

    fn gas_outlet_k(&self, site: &Site<'_>, t2_k: f64) -> f64 {
        self.change(5, site, t2_k)
    }

    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.add(6, site)
    }

    fn heat_to_inner_w(&self, site: &Site<'_>) -> f64 {
        self.add(7, site)
    }

    fn heat_to_turbine_w(&self, site: &Site<'_>) -> f64 {
        self.add(8, site)
    }

    fn shaft_torque_nm(&self, site: &Site<'_>) -> f64 {
        self.add(9, site)
    }

    fn flow_to_outlet_kg_s(&self, site: &Site<'_>) -> f64 {
        self.add(10, site)
    }

    fn reading(&self, site: &Site<'_>, channel: Channel, value: f64) -> f64 {
        match &self.readings[channel as usize] {
            Some(name) => self.program.call(name, (At::new(site), self.numbers.clone(), value), &self.fault),
            None => value,
        }
    }

    fn fault(&self) -> Option<String> {
        self.fault.get().cloned()
    }
}
