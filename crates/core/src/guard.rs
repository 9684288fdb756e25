//! What a run is guarded by: the vocabulary of campaigns, rigs and runner.

use crate::Channel;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A guard, by the key that campaigns write it under.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GuardName {
    /// Shaft speed.
    Overspeed,
    /// Compressor outlet temperature, T2.
    CompressorOutletTemperature,
    /// Turbine inlet temperature, T3.
    TurbineInletTemperature,
    /// Turbine inlet pressure, P3.
    TurbineInletPressure,
    /// Oil inlet temperature.
    OilTemperature,
    /// Change of the compressor housing.
    HousingGradient,
    /// Variation of pressure and flow.
    Surge,
    /// A speed that is not reached, or lost.
    Speed,
    /// Samples in order, in time, and alive.
    Signals,
    /// What the rig says of itself.
    Rig,
}

impl std::fmt::Display for GuardName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            GuardName::Overspeed => "overspeed",
            GuardName::CompressorOutletTemperature => "compressor_outlet_temperature",
            GuardName::TurbineInletTemperature => "turbine_inlet_temperature",
            GuardName::TurbineInletPressure => "turbine_inlet_pressure",
            GuardName::OilTemperature => "oil_temperature",
            GuardName::HousingGradient => "housing_gradient",
            GuardName::Surge => "surge",
            GuardName::Speed => "speed",
            GuardName::Signals => "signals",
            GuardName::Rig => "rig",
        })
    }
}

/// What is done when a guard trips, mildest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::schema::names_alone)]
pub enum Reaction {
    /// Say it, and go on.
    Note,
    /// Hold the setpoints until it is over, and make the step so much longer.
    Hold,
    /// Go back, and approach the step again in smaller steps.
    SmallerSteps,
    /// Leave the step out.
    SkipStep,
    /// End the run in the safe state.
    Safe,
    /// End the run in the safe state, and let no other begin before somebody has acknowledged it.
    Latch,
}

impl Reaction {
    /// Whether it ends the run.
    pub fn ends_the_run(self) -> bool {
        self >= Reaction::Safe
    }
}

/// A change that must not be exceeded within a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LargestChange {
    /// Largest change, up or down, unit of the channel, > 0.
    pub change: f64,
    /// Within this time, s, > 0.
    pub within_s: f64,
}

/// A guard over one channel. Without any bound it still watches that the channel is alive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SignalGuard {
    /// Its name.
    pub name: GuardName,
    /// The channel.
    pub channel: Channel,
    /// Highest value, unit of the channel.
    pub above: Option<f64>,
    /// Lowest value while gas flows, unit of the channel.
    pub below: Option<f64>,
    /// Largest change.
    pub change: Option<LargestChange>,
    /// A value beyond a bound counts until it is so far back, unit of the channel, >= 0.
    pub hysteresis: f64,
    /// A value trips that has been beyond a bound for so long, s, >= 0.
    pub dwell_s: f64,
    /// Without a good reading for so long the guard trips, s, > 0.
    pub age_s: f64,
    /// A reading trips that has not changed by a bit for so long after a jump of the setpoints, s; `None`: not watched.
    pub frozen_s: Option<f64>,
    /// What is done about a bound; a signal that is not there ends the run in any case.
    pub reaction: Reaction,
}

/// The guard against surge: how much flow and pressure vary from one tenth of a second to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SurgeVariation {
    /// Variation of the compressor's flow that counts, one standard deviation over the flow, ratio.
    pub flow_ratio: f64,
    /// Variation of P2 or P1 that counts with it, one standard deviation over the pressure, ratio.
    pub pressure_ratio: f64,
    /// A jump may touch the surge line: it trips after so long, s.
    pub dwell_s: f64,
    /// What is done.
    pub reaction: Reaction,
}

/// The guard over the speed that a step asks for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedBand {
    /// Largest deviation of the last seconds of a step, ratio.
    pub band_ratio: f64,
    /// What is done.
    pub reaction: Reaction,
}

/// All guards of a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct GuardSet {
    /// One channel each.
    pub signals: Vec<SignalGuard>,
    /// Against surge.
    pub surge: Option<SurgeVariation>,
    /// Over the speed.
    pub speed: Option<SpeedBand>,
}

impl GuardSet {
    /// Whether a guard of this name is there that ends the run.
    pub fn ends_on(&self, name: GuardName) -> bool {
        match name {
            GuardName::Surge => self.surge.is_some_and(|guard| guard.reaction.ends_the_run()),
            GuardName::Speed => self.speed.is_some_and(|guard| guard.reaction.ends_the_run()),
            // Always there.
            GuardName::Signals | GuardName::Rig => true,
            name => self.signals.iter().any(|guard| {
                let bound = guard.above.is_some() || guard.below.is_some() || guard.change.is_some();
                guard.name == name && bound && guard.reaction.ends_the_run()
            }),
        }
    }
}

/// The way into the safe state: valve open and heater off at once, turbine inlet pressure down at a slew, air off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SafeTrajectory {
    /// How fast P3 is taken down, Pa/s, > 0; `None`: the air is cut at once.
    pub p3_slew_pa_s: Option<f64>,
    /// Opening of the back-pressure valve on the way, ratio: a step that has more keeps it.
    pub valve_opening_ratio: f64,
    /// Longest time of the way, s, > 0: the air is cut then, wherever P3 is.
    pub within_s: f64,
}

impl Default for SafeTrajectory {
    /// The air is cut at once.
    fn default() -> Self {
        SafeTrajectory { p3_slew_pa_s: None, valve_opening_ratio: 1.0, within_s: 20.0 }
    }
}
