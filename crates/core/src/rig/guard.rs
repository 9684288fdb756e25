//! Guards, their reactions, and the end of a run: the same for the runner, the journal and the reports.

use crate::enums::named_enum;
use crate::{Channel, FrozenLimit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

named_enum! {
    /// A guard, by its key in campaigns.
    pub enum GuardName {
        /// Shaft speed.
        Overspeed = "overspeed",
        /// Compressor outlet temperature, T2.
        CompressorOutletTemperature = "compressor_outlet_temperature",
        /// Turbine inlet temperature, T3.
        TurbineInletTemperature = "turbine_inlet_temperature",
        /// Turbine inlet pressure, P3.
        TurbineInletPressure = "turbine_inlet_pressure",
        /// Oil inlet temperature.
        OilTemperature = "oil_temperature",
        /// Change of the compressor housing.
        HousingGradient = "housing_gradient",
        /// Variation of pressure and flow.
        Surge = "surge",
        /// A target speed that is missed at the end of the step.
        Speed = "speed",
        /// Time within the speeds to avoid.
        AvoidedSpeed = "avoided_speed",
        /// Flow through the back-pressure valve against its command.
        Valve = "valve",
        /// Samples in order, in time, and not frozen.
        Signals = "signals",
        /// The state that the rig reports.
        Rig = "rig",
    }
}

/// Reaction when a guard trips, mildest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(transform = crate::enums::flatten_to_names)]
pub enum Reaction {
    /// Report the violation, and continue.
    Note,
    /// Hold the setpoints until the condition has ended, and extend the step by this time.
    Hold,
    /// Go back, and approach the step again in smaller steps.
    SmallerSteps,
    /// Skip the step.
    SkipStep,
    /// End the run in the safe state.
    Safe,
    /// End the run in the safe state, and lock the rig until an operator acknowledges it.
    Latch,
}

impl Reaction {
    /// Whether the reaction ends the run.
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

/// A guard of one channel. Without bounds it checks only that the channel delivers readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SignalGuard {
    /// Name.
    pub name: GuardName,
    /// The channel.
    pub channel: Channel,
    /// Highest value, unit of the channel.
    pub above: Option<f64>,
    /// Lowest value while gas flows, unit of the channel.
    pub below: Option<f64>,
    /// Largest change.
    pub change: Option<LargestChange>,
    /// Hysteresis: a violation ends only when the value is within the bound by this margin, unit of the channel, >= 0.
    pub hysteresis: f64,
    /// The guard trips when a value has been beyond a bound for this time, s, >= 0.
    pub dwell_s: f64,
    /// The guard trips after this time without a good reading, s, > 0.
    pub age_s: f64,
    /// The guard trips if the reading is frozen; `None`: not checked.
    pub frozen: Option<FrozenLimit>,
    /// Reaction to a bound; a missing signal ends the run in any case.
    pub reaction: Reaction,
}

/// The guard against surge: variation of flow and pressure from one tenth of a second to the next.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SurgeVariation {
    /// Threshold of the variation of the compressor's flow, one standard deviation over the flow, ratio.
    pub flow_ratio: f64,
    /// Threshold of the simultaneous variation of P2 or P1, one standard deviation over the pressure, ratio.
    pub pressure_ratio: f64,
    /// Time until the guard trips, s: a jump may touch the surge line.
    pub dwell_s: f64,
    /// Reaction.
    pub reaction: Reaction,
}

/// The guard of the target speed of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SpeedBand {
    /// Largest deviation in the last seconds of a step, ratio.
    pub band_ratio: f64,
    /// Reaction.
    pub reaction: Reaction,
}

/// All guards of a run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct GuardSet {
    /// Guards of single channels.
    pub signals: Vec<SignalGuard>,
    /// Guard against surge.
    pub surge: Option<SurgeVariation>,
    /// Guard of the speed.
    pub speed: Option<SpeedBand>,
    /// Reaction to a valve that does not follow its commands.
    pub valve: Option<Reaction>,
    /// When the flow, which has no guard of its own, counts as frozen; `None`: not checked.
    pub frozen_flow: Option<FrozenLimit>,
}

impl GuardSet {
    /// Whether there is a guard of this name that ends the run.
    pub fn ends_on(&self, name: GuardName) -> bool {
        match name {
            GuardName::Surge => self.surge.is_some_and(|guard| guard.reaction.ends_the_run()),
            GuardName::Speed => self.speed.is_some_and(|guard| guard.reaction.ends_the_run()),
            GuardName::Valve => self.valve.is_some_and(Reaction::ends_the_run),
            // Always present.
            GuardName::Signals | GuardName::Rig => true,
            name => self.signals.iter().any(|guard| {
                let bound = guard.above.is_some() || guard.below.is_some() || guard.change.is_some();
                guard.name == name && bound && guard.reaction.ends_the_run()
            }),
        }
    }
}

/// The safe shutdown: open the valve and switch the heater off at once, reduce the turbine inlet pressure at its slew rate, cut the air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(rename = "SafeShutdown")]
pub struct SafeTrajectory {
    /// Rate at which P3 goes down, Pa/s, > 0; `null`: the air is cut at once.
    #[serde(default)]
    pub p3_slew_pa_s: Option<f64>,
    /// Opening of the back-pressure valve during the shutdown, ratio; a step with a larger opening keeps it.
    pub valve_opening_ratio: f64,
    /// Maximum duration of the shutdown, s, > 0: the air is then cut at any P3.
    pub within_s: f64,
}

impl Default for SafeTrajectory {
    /// The air is cut at once.
    fn default() -> Self {
        SafeTrajectory {
            p3_slew_pa_s: None,
            valve_opening_ratio: 1.0,
            // Bound: a guard that waits longer does not guard.
            within_s: 20.0,
        }
    }
}

/// The report of a guard.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trip {
    /// Run time, s.
    pub t_s: f64,
    /// The guard that tripped.
    pub guard: GuardName,
    /// The required reaction.
    pub reaction: Reaction,
    /// One sentence with values and units.
    pub reason: String,
}

/// How a run ended; its `code` is stable. The rig is safe in all cases.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "code", rename_all = "snake_case")]
#[allow(missing_docs, reason = "the variants describe their values")]
pub enum RunEnding {
    /// Every step was executed.
    Completed,
    /// Drift was detected, and the campaign asks to stop in that case.
    Drifted { reason: String },
    /// The operator stopped the run at this run time.
    Interrupted { t_s: f64 },
    /// A guard tripped.
    Tripped(Trip),
    /// The rig, the script or the recording failed. The runner reports it as an error; files have it as this.
    Failed { reason: String },
}
