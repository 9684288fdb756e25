//! Extension points of the model: named places in the gas path and the metal.
//!
//! [Parameters](crate::machine::params::Params) change the model's numbers; hooks make all other changes. Each receives the model's value
//! and returns the value to use.

use crate::machine::params::{BoundaryConditions, MAX_EXTRA, State};
use mapper_core::Channel;
use std::sync::Arc;

/// Data at the call of a hook; values from later in the gas path are NaN.
#[derive(Debug, Clone, Copy)]
pub struct Site<'a> {
    /// Time, s; NaN in a steady state and while all inputs are constant.
    pub t_s: f64,
    /// Boundary conditions.
    pub boundary: &'a BoundaryConditions,
    /// States.
    pub state: &'a State,
    /// Hidden temperatures of the called hook, K.
    pub extra_k: &'a [f64],
    /// Temperature of the metal that touches the compressor's gas, K.
    pub wall_k: f64,
    /// Total pressure ratio P2/P1.
    pub pressure_ratio: f64,
    /// Compressor mass flow, kg/s.
    pub flow_kg_s: f64,
    /// Isentropic efficiency of the compressor, fraction.
    pub efficiency: f64,
    /// Heat-transfer coefficient between gas and compressor housing, W/(m2 K).
    pub h_w_m2k: f64,
    /// Gas before the compressor wheel, K.
    pub t1_prime_k: f64,
    /// Gas after the compressor wheel, K.
    pub t2_prime_k: f64,
    /// Gas at the compressor outlet, K.
    pub t2_k: f64,
    /// Temperature of the bearing housing, K.
    pub bearing_k: f64,
}

impl<'a> Site<'a> {
    /// A site before the gas path is evaluated.
    #[inline]
    pub(crate) fn before_gas_path(
        t_s: f64,
        boundary: &'a BoundaryConditions,
        state: &'a State,
        wall_k: f64,
        pressure_ratio: f64,
        bearing_k: f64,
    ) -> Self {
        Site {
            t_s,
            boundary,
            state,
            extra_k: &[],
            wall_k,
            pressure_ratio,
            flow_kg_s: f64::NAN,
            efficiency: f64::NAN,
            h_w_m2k: f64::NAN,
            t1_prime_k: f64::NAN,
            t2_prime_k: f64::NAN,
            t2_k: f64::NAN,
            bearing_k,
        }
    }
}

/// An extension of the model. Every method does nothing by default; all must be smooth in their
/// arguments, or the integration takes small steps.
pub trait Hooks: std::fmt::Debug + Send + Sync {
    /// Compressor mass flow, kg/s.
    fn flow_kg_s(&self, _site: &Site<'_>, flow_kg_s: f64) -> f64 {
        flow_kg_s
    }

    /// Isentropic efficiency, fraction.
    fn efficiency(&self, _site: &Site<'_>, efficiency: f64) -> f64 {
        efficiency
    }

    /// Convection between gas and compressor housing, W/(m2 K).
    fn h_w_m2k(&self, _site: &Site<'_>, h_w_m2k: f64) -> f64 {
        h_w_m2k
    }

    /// Gas before compression (station 1'), K.
    fn gas_before_k(&self, _site: &Site<'_>, t1_prime_k: f64) -> f64 {
        t1_prime_k
    }

    /// Gas after compression, before it meets the housing (station 2'), K.
    fn gas_after_k(&self, _site: &Site<'_>, t2_prime_k: f64) -> f64 {
        t2_prime_k
    }

    /// Gas at the outlet (station 2), at probe and valve, K.
    fn gas_outlet_k(&self, _site: &Site<'_>, t2_k: f64) -> f64 {
        t2_k
    }

    /// Heat added to the compressor housing (its outer part), W.
    fn heat_to_compressor_w(&self, _site: &Site<'_>) -> f64 {
        0.0
    }

    /// Heat added to the inner wall of the compressor housing, W; to the housing if it is one node.
    fn heat_to_inner_w(&self, _site: &Site<'_>) -> f64 {
        0.0
    }

    /// Heat added to the turbine housing, W.
    fn heat_to_turbine_w(&self, _site: &Site<'_>) -> f64 {
        0.0
    }

    /// Flow added to the volume after the compressor, at its gas temperature, kg/s; a leak is negative.
    fn flow_to_outlet_kg_s(&self, _site: &Site<'_>) -> f64 {
        0.0
    }

    /// Torque added to the shaft, N m.
    fn shaft_torque_nm(&self, _site: &Site<'_>) -> f64 {
        0.0
    }

    /// The input of the sensor of `channel`, in the channel's unit.
    fn reading(&self, _site: &Site<'_>, _channel: Channel, value: f64) -> f64 {
        value
    }

    /// Number of hidden temperatures of the hooks, at most [`MAX_EXTRA`].
    fn extra_states(&self) -> usize {
        0
    }

    /// Rates of the hidden temperatures, K/s; `rates` has [`extra_states`](Hooks::extra_states) elements.
    fn extra_rates_k_s(&self, _site: &Site<'_>, _rates: &mut [f64]) {}

    /// The first fault so far, if any: hooks cannot fail, so they return NaN and keep the reason.
    fn fault(&self) -> Option<String> {
        None
    }
}

/// The hooks of a model, each with its index among the hidden temperatures.
#[derive(Debug, Clone, Default)]
pub struct HookList {
    placed: Vec<PositionedHooks>,
    extra_states: usize,
}

#[derive(Debug, Clone)]
struct PositionedHooks {
    hooks: Arc<dyn Hooks>,
    first_extra: usize,
    extra_states: usize,
}

/// The hooks need more hidden temperatures than a model can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the effects need {needed} hidden temperatures together; a model has room for {MAX_EXTRA}: try fewer effects at once"
)]
pub struct TooManyExtraStates {
    /// Number of hidden temperatures needed.
    pub needed: usize,
}

/// The part of hooks that belongs to the machine's characteristics: flow, efficiency, torque and leaks.
#[derive(Debug)]
struct Characteristics(Arc<dyn Hooks>);

impl Hooks for Characteristics {
    fn flow_kg_s(&self, site: &Site<'_>, flow_kg_s: f64) -> f64 {
        self.0.flow_kg_s(site, flow_kg_s)
    }

    fn efficiency(&self, site: &Site<'_>, efficiency: f64) -> f64 {
        self.0.efficiency(site, efficiency)
    }

    fn flow_to_outlet_kg_s(&self, site: &Site<'_>) -> f64 {
        self.0.flow_to_outlet_kg_s(site)
    }

    fn shaft_torque_nm(&self, site: &Site<'_>) -> f64 {
        self.0.shaft_torque_nm(site)
    }
}

impl HookList {
    /// Only what belongs to the machine's characteristics, of hooks without hidden temperatures.
    #[must_use]
    pub fn characteristics(&self) -> HookList {
        let own = self.placed.iter().filter(|one| one.extra_states == 0);
        let own =
            own.map(|one| PositionedHooks { hooks: Arc::new(Characteristics(one.hooks.clone())), ..*one });
        HookList { placed: own.collect(), extra_states: 0 }
    }

    /// Adds hooks after the existing ones, and passes them the values that those returned.
    pub fn push(&mut self, hooks: Arc<dyn Hooks>) -> Result<(), TooManyExtraStates> {
        let extra_states = hooks.extra_states();
        let needed = self.extra_states.saturating_add(extra_states);
        if needed > MAX_EXTRA {
            return Err(TooManyExtraStates { needed });
        }
        self.placed.push(PositionedHooks { hooks, first_extra: self.extra_states, extra_states });
        self.extra_states = needed;
        Ok(())
    }

    /// Whether the list has no hooks.
    #[inline]
    pub fn is_empty(&self) -> bool {
        self.placed.is_empty()
    }

    /// Number of hidden temperatures of all hooks.
    pub fn extra_states(&self) -> usize {
        self.extra_states
    }

    /// The first fault of any hook.
    pub fn fault(&self) -> Option<String> {
        self.placed.iter().find_map(|placed| placed.hooks.fault())
    }

    /// Passes `value` through each hook in order.
    pub(crate) fn fold(
        &self,
        site: &Site<'_>,
        value: f64,
        call: impl Fn(&dyn Hooks, &Site<'_>, f64) -> f64,
    ) -> f64 {
        self.placed.iter().fold(value, |value, placed| call(placed.hooks.as_ref(), &placed.site(site), value))
    }

    /// The input of the sensor of `channel`, given `value`.
    pub fn reading(&self, site: &Site<'_>, channel: Channel, value: f64) -> f64 {
        self.fold(site, value, |hooks, site, value| hooks.reading(site, channel, value))
    }

    pub(crate) fn extra_rates_k_s(&self, site: &Site<'_>) -> [f64; MAX_EXTRA] {
        let mut rates = [0.0; MAX_EXTRA];
        for placed in self.placed.iter().filter(|placed| placed.extra_states > 0) {
            let range = placed.first_extra..placed.first_extra + placed.extra_states;
            placed.hooks.extra_rates_k_s(&placed.site(site), &mut rates[range]);
        }
        rates
    }
}

impl PositionedHooks {
    fn site<'a>(&self, site: &Site<'a>) -> Site<'a> {
        let extra = &site.state.extra_k;
        Site { extra_k: &extra[self.first_extra..self.first_extra + self.extra_states], ..*site }
    }
}
