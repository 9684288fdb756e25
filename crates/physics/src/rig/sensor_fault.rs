//! The catalogue of known sensor faults: channel, kind, prior size, and range for a search by runs of the model.
//!
//! Identification and drift test the faults that add to a reading ([`SensorFault::error_per_unit`]). The diagnosis of gaps and logs without
//! steps run the model with a fault as an [`Effect`] ([`effects`], [`log_effects`]). A fault may be common to several channels: thermocouples
//! share a reference junction, pressure transducers a barometer or a supply.

use crate::rig::effect::{Effect, EffectError, EffectInfo, EffectParameter, NamedValues, Rig, Submodel};
use mapper_core::{Channel, Dimension, FaultKind, NOISY_REPEAT_S};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// A fault of one or several sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorFault {
    /// The channels with the same error.
    pub channels: &'static [Channel],
    /// Form of the error.
    pub kind: FaultKind,
    /// Prior size of such faults, one standard deviation, in the unit of `kind`. It is about ten times the declared error of
    /// calibrated sensors, so that an ordinary error is not a fault. The evidence for a fault depends on it only logarithmically.
    pub sigma: f64,
    /// Size in a search by runs of the model; empty if there is none.
    sizes: &'static [Size],
    /// Kinds of recordings that are searched for the fault by runs of the model.
    searched_in: SearchedIn,
}

/// Kind of recording that is searched for a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SearchedIn {
    /// Both kinds of recordings.
    All,
    /// Only logs without steps: a stand holds the inlet of the turbine constant, and declares its probes.
    Logs,
    /// Only recordings of a stand, whose inputs drive a model of the whole machine.
    Stands,
}

/// A size in a search: name and unit, range, and first step.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Size(&'static str, &'static str, f64, f64, f64);

pub use mapper_core::CALIBRATED_AT_K;

const TEMPERATURE_K: f64 = 3.0;
const HOT_GAS_K: f64 = 10.0;
const PRESSURE_PA: f64 = 3e3;
const RATIO: f64 = 0.05;
const LAG_S: f64 = 2.0;
const WALL_RATIO: f64 = 0.1;
/// Turbine inlet pressures are twice those of the compressor.
const TURBINE_PA: f64 = 6e3;
const ELEMENT_LAG: Size = Size("element_lag", "s", 0.0, 30.0, 1.0);

const fn fault(channels: &'static [Channel], kind: FaultKind, sigma: f64) -> SensorFault {
    SensorFault { channels, kind, sigma, sizes: &[], searched_in: SearchedIn::All }
}

const fn searched(
    channels: &'static [Channel],
    kind: FaultKind,
    sigma: f64,
    sizes: &'static [Size],
) -> SensorFault {
    SensorFault { sizes, ..fault(channels, kind, sigma) }
}

const fn in_logs(
    channels: &'static [Channel],
    kind: FaultKind,
    sigma: f64,
    sizes: &'static [Size],
) -> SensorFault {
    SensorFault { searched_in: SearchedIn::Logs, ..searched(channels, kind, sigma, sizes) }
}

const fn on_stands(
    channels: &'static [Channel],
    kind: FaultKind,
    sigma: f64,
    sizes: &'static [Size],
) -> SensorFault {
    SensorFault { searched_in: SearchedIn::Stands, ..searched(channels, kind, sigma, sizes) }
}

/// All sensor faults.
pub const CATALOGUE: [SensorFault; 60] = {
    use Channel::{CompressorFlow, P1, P2, P3, P4, ShaftSpeed, T1, T2, T3, T4, TOil, Tc, Tt, TurbineFlow};
    use FaultKind::{Drift, Frozen, Gain, Lag, Offset, TowardsWall, WithFlowSquared, WithValve};
    [
        searched(&[T1], Offset, TEMPERATURE_K, &[Size("t1_offset", "K", -20.0, 20.0, 1.5)]),
        searched(&[T2], Offset, TEMPERATURE_K, &[Size("t2_offset", "K", -20.0, 20.0, 1.5)]),
        searched(&[Tc], Offset, TEMPERATURE_K, &[Size("tc_offset", "K", -30.0, 30.0, 2.0)]),
        fault(&[T1, T2, Tc], Offset, TEMPERATURE_K),
        fault(&[T2], Gain, RATIO),
        fault(&[Tc], Gain, RATIO),
        fault(&[T1, T2, Tc], Gain, RATIO),
        fault(&[T1], Drift, TEMPERATURE_K),
        fault(&[T2], Drift, TEMPERATURE_K),
        fault(&[Tc], Drift, TEMPERATURE_K),
        fault(&[T1, T2, Tc], Drift, TEMPERATURE_K),
        on_stands(&[P1], Offset, PRESSURE_PA, &[Size("p1_offset", "Pa", -20e3, 20e3, 800.0)]),
        searched(&[P2], Offset, PRESSURE_PA, &[Size("p2_offset", "Pa", -20e3, 20e3, 800.0)]),
        fault(&[P1, P2], Offset, PRESSURE_PA),
        fault(&[P1], Gain, RATIO),
        fault(&[P2], Gain, RATIO),
        fault(&[P1, P2], Gain, RATIO),
        fault(&[P1], Drift, PRESSURE_PA),
        fault(&[P2], Drift, PRESSURE_PA),
        fault(&[P1, P2], Drift, PRESSURE_PA),
        fault(&[CompressorFlow], Offset, 2e-3),
        searched(&[CompressorFlow], Gain, RATIO, &[Size("flowmeter_gain", "1", 0.7, 1.3, 0.03)]),
        fault(&[CompressorFlow], Drift, RATIO),
        on_stands(&[ShaftSpeed], Gain, RATIO, &[Size("speed_gain", "1", 0.7, 1.3, 0.03)]),
        fault(&[ShaftSpeed], Drift, RATIO),
        fault(&[ShaftSpeed], Offset, 1e3),
        fault(&[TurbineFlow], Drift, RATIO),
        fault(&[P3], Drift, PRESSURE_PA),
        fault(&[T3], Drift, TEMPERATURE_K),
        fault(&[P4], Drift, PRESSURE_PA),
        fault(&[T4], Drift, TEMPERATURE_K),
        fault(&[Tt], Drift, TEMPERATURE_K),
        searched(&[CompressorFlow], Lag, LAG_S, &[Size("flowmeter_lag", "s", 0.0, 30.0, 2.0)]),
        searched(&[T2], TowardsWall, WALL_RATIO, &[Size("stem_conduction", "1", 0.0, 0.5, 0.05)]),
        on_stands(&[T1], TowardsWall, WALL_RATIO, &[Size("t1_towards_wall", "1", 0.0, 0.5, 0.05)]),
        on_stands(&[T3], TowardsWall, WALL_RATIO, &[Size("t3_towards_wall", "1", 0.0, 0.5, 0.05)]),
        on_stands(
            &[T1],
            WithFlowSquared,
            TEMPERATURE_K,
            &[Size("t1_with_flow_squared", "K", -200.0, 200.0, 10.0)],
        ),
        on_stands(
            &[T3],
            WithFlowSquared,
            HOT_GAS_K,
            &[Size("t3_with_flow_squared", "K", -400.0, 400.0, 30.0)],
        ),
        on_stands(
            &[P1],
            WithFlowSquared,
            PRESSURE_PA,
            &[Size("p1_with_flow_squared", "Pa", -60e3, 60e3, 3e3)],
        ),
        on_stands(
            &[P4],
            WithFlowSquared,
            PRESSURE_PA,
            &[Size("p4_with_flow_squared", "Pa", -60e3, 60e3, 3e3)],
        ),
        on_stands(&[T1], WithValve, TEMPERATURE_K, &[Size("t1_with_valve", "K", -20.0, 20.0, 1.5)]),
        on_stands(&[P1], WithValve, PRESSURE_PA, &[Size("p1_with_valve", "Pa", -20e3, 20e3, 800.0)]),
        on_stands(&[P3], Offset, TURBINE_PA, &[Size("p3_offset", "Pa", -40e3, 40e3, 2e3)]),
        on_stands(&[P4], Offset, PRESSURE_PA, &[Size("p4_offset", "Pa", -20e3, 20e3, 800.0)]),
        on_stands(&[TOil], Offset, HOT_GAS_K, &[Size("t_oil_offset", "K", -60.0, 60.0, 5.0)]),
        on_stands(&[Tt], Offset, HOT_GAS_K, &[Size("tt_offset", "K", -60.0, 60.0, 5.0)]),
        in_logs(&[T2], Lag, LAG_S, &[Size("sheath_diameter", "m", 0.0, 0.012, 0.0015), ELEMENT_LAG]),
        in_logs(&[T4], Lag, LAG_S, &[Size("t4_lag", "s", 0.0, 30.0, 1.0)]),
        in_logs(&[T3], Lag, LAG_S, &[Size("t3_lag", "s", 0.0, 30.0, 1.0)]),
        searched(&[T4], Offset, HOT_GAS_K, &[Size("t4_offset", "K", -60.0, 60.0, 5.0)]),
        searched(&[T3], Offset, HOT_GAS_K, &[Size("t3_offset", "K", -60.0, 60.0, 5.0)]),
        searched(&[TurbineFlow], Gain, RATIO, &[Size("turbine_flow_gain", "1", 0.6, 1.5, 0.05)]),
        in_logs(&[TurbineFlow], Lag, LAG_S, &[Size("turbine_flow_lag", "s", 0.0, 30.0, 1.0)]),
        fault(&[ShaftSpeed], Frozen, NOISY_REPEAT_S),
        fault(&[CompressorFlow], Frozen, NOISY_REPEAT_S),
        fault(&[P1], Frozen, NOISY_REPEAT_S),
        fault(&[T1], Frozen, NOISY_REPEAT_S),
        fault(&[P2], Frozen, NOISY_REPEAT_S),
        fault(&[T2], Frozen, NOISY_REPEAT_S),
        fault(&[Tc], Frozen, NOISY_REPEAT_S),
    ]
};

/// Sensors of the compressor.
const OF_COMPRESSOR: [Channel; 7] = {
    use Channel::{CompressorFlow, P1, P2, ShaftSpeed, T1, T2, Tc};
    [ShaftSpeed, CompressorFlow, P1, T1, P2, T2, Tc]
};

/// Sensors of the turbine that are compared at rest: pressures with each other, temperatures with all others.
const TURBINE_AT_REST: [Channel; 5] = [Channel::P3, Channel::P4, Channel::T3, Channel::T4, Channel::Tt];

/// Faults of the compressor's sensors that add to a reading in proportion to their size, and offsets of the turbine's, which a rest shows.
pub fn additive() -> impl Iterator<Item = &'static SensorFault> {
    use FaultKind::{Drift, Gain, Offset, TowardsWall};
    CATALOGUE.iter().filter(|fault| {
        let additive = matches!(fault.kind, Offset | Gain | Drift)
            || (fault.kind == TowardsWall && matches!(fault.channels, [Channel::T1 | Channel::T2]));
        let of_turbine = fault.kind == Offset && TURBINE_AT_REST.contains(&fault.channels[0]);
        additive && (of_turbine || fault.channels.iter().all(|channel| OF_COMPRESSOR.contains(channel)))
    })
}

/// Readings at which gain errors vanish: those of an isothermal zero; without one, no pressure and 20 degC.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ExactReadings {
    /// Of P1 and P2, Pa.
    pub pressure_pa: f64,
    /// Of the thermometers, K.
    pub temperature_k: f64,
}

impl Default for ExactReadings {
    fn default() -> Self {
        ExactReadings { pressure_pa: 0.0, temperature_k: CALIBRATED_AT_K }
    }
}

impl ExactReadings {
    /// Error of a reading for a gain error of 1.
    pub fn gain_error(&self, channel: Channel, reading: f64) -> f64 {
        match channel {
            Channel::P1 | Channel::P2 => reading - self.pressure_pa,
            _ if channel.info().dimension == Dimension::Temperature => reading - self.temperature_k,
            _ => channel.gain_distance(reading),
        }
    }
}

/// All drifts, of compressor and turbine.
pub fn drifts() -> impl Iterator<Item = &'static SensorFault> {
    CATALOGUE.iter().filter(|fault| fault.kind == FaultKind::Drift)
}

/// Maximum time for which a noisy channel can repeat one value, s; infinite if the noise of the channel is not known.
pub fn repeats_s(channel: Channel) -> f64 {
    let frozen = |fault: &&SensorFault| fault.kind == FaultKind::Frozen && fault.channels == [channel];
    CATALOGUE.iter().find(frozen).map_or(f64::INFINITY, |fault| fault.sigma)
}

/// Effects for the effect library, by kind: the faults that a diagnosis of a stand searches for.
pub fn effects() -> Vec<Arc<dyn Effect>> {
    let mut faults: Vec<SensorFault> =
        searched_for().filter(|fault| fault.searched_in != SearchedIn::Logs).collect();
    faults.sort_by_key(|fault| fault.kind);
    faults.into_iter().map(FaultEffect::of).collect()
}

/// Further effects for logs without steps, of the compressor's sensors or the turbine's.
pub fn log_effects(compressor: bool) -> Vec<Arc<dyn Effect>> {
    let of_side = |fault: &SensorFault| OF_COMPRESSOR.contains(&fault.channels[0]) == compressor;
    searched_for()
        .filter(|fault| fault.searched_in == SearchedIn::Logs && of_side(fault))
        .map(FaultEffect::of)
        .collect()
}

/// Whether an effect is a fault that no log without steps is searched for.
pub fn is_only_on_stands(id: &str) -> bool {
    let mut on_stands = searched_for().filter(|fault| fault.searched_in == SearchedIn::Stands);
    on_stands.any(|fault| fault.sizes[0].0 == id)
}

fn searched_for() -> impl Iterator<Item = SensorFault> {
    CATALOGUE.into_iter().filter(|fault| !fault.sizes.is_empty())
}

impl SensorFault {
    /// Error of a channel's reading by a fault of size 1; 0 for kinds that do not add to a reading. `housing_k`: Tc. `run_ratio`: time since
    /// the start of the run over its length. `rest`: where gain errors vanish.
    pub fn error_per_unit(
        &self,
        channel: Channel,
        reading: f64,
        housing_k: f64,
        run_ratio: f64,
        rest: ExactReadings,
    ) -> f64 {
        if !self.channels.contains(&channel) {
            return 0.0;
        }
        let relative = matches!(channel, Channel::CompressorFlow | Channel::ShaftSpeed);
        match self.kind {
            FaultKind::Offset => 1.0,
            FaultKind::Gain => rest.gain_error(channel, reading),
            FaultKind::Drift if relative => run_ratio * reading,
            FaultKind::Drift => run_ratio,
            FaultKind::TowardsWall => housing_k - reading,
            _ => 0.0,
        }
    }

    /// The fault as a row of an effect library.
    fn info(&self) -> EffectInfo {
        let channel = self.channels[0];
        let (description, equation, source) = match self.kind {
            FaultKind::Gain => ("reads high or low in proportion", "y = s x", "calibration of the sensor"),
            FaultKind::Lag => ("follows with a lag", "dy/dt = (x - y)/tau", "first-order sensor"),
            FaultKind::TowardsWall => (
                "has a stem that conducts: the tip is drawn towards the housing",
                "T_tip tends to T + chi (T_wall - T)",
                "fin of a thermowell, lumped to its tip: Incropera, Fundamentals of Heat and Mass Transfer, 3.6",
            ),
            FaultKind::WithFlowSquared => (
                "has an error that grows with the square of the flow",
                "y = x + b (G/G0)^2, G = m/A of the inlet pipe, G0 = 120 kg/(s m2)",
                "dynamic pressure at a tap, or gas that is not mixed at the probe",
            ),
            FaultKind::WithValve => (
                "has an error that grows with the opening of the valve",
                "y = x + b u",
                "flow around the sensor that changes with the valve",
            ),
            _ => ("reads high or low by a constant", "y = x + b", "calibration of the sensor"),
        };
        let (submodel, neighbour) = match channel {
            Channel::T1 => (Submodel::T1Probe, Some(Submodel::CompressorGas)),
            Channel::T2 => (Submodel::T2Probe, None),
            Channel::Tc => (Submodel::TcProbe, Some(Submodel::CompressorHousing)),
            Channel::P2 => (Submodel::P2Sensor, Some(Submodel::Outlet)),
            Channel::CompressorFlow => (Submodel::FlowMeter, Some(Submodel::CompressorFlow)),
            Channel::ShaftSpeed => (Submodel::SpeedSensor, None),
            Channel::TurbineFlow => (Submodel::TurbineFlow, None),
            Channel::P1 => (Submodel::P1Sensor, None),
            Channel::P3 => (Submodel::P3Sensor, None),
            Channel::T3 => (Submodel::T3Probe, None),
            Channel::P4 => (Submodel::P4Sensor, None),
            Channel::TOil => (Submodel::OilProbe, None),
            _ => (Submodel::TurbineHousing, None),
        };
        let constant = matches!(self.kind, FaultKind::Offset | FaultKind::Gain);
        let parameter = |&Size(name, unit, low, high, step): &Size| {
            let neutral = if self.kind == FaultKind::Gain { 1.0 } else { 0.0 };
            EffectParameter { name: name.into(), unit: unit.into(), low, high, neutral, typical_step: step }
        };
        EffectInfo {
            id: if let [Size(id, ..)] = self.sizes { *id } else { "sheathed_probe" }.into(),
            name: self.to_string().into(),
            description: format!("the sensor of {channel} {description}").into(),
            equation: equation.into(),
            source: source.into(),
            submodel,
            // A constant error may also appear in a balance that uses the reading.
            also_shows_in: neighbour.filter(|_| constant).into_iter().collect(),
            parameters: self.sizes.iter().map(parameter).collect(),
        }
    }
}

/// A fault as an effect.
#[derive(Debug)]
struct FaultEffect {
    info: EffectInfo,
    fault: SensorFault,
}

impl FaultEffect {
    fn of(fault: SensorFault) -> Arc<dyn Effect> {
        Arc::new(FaultEffect { info: fault.info(), fault })
    }
}

impl Effect for FaultEffect {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError> {
        let mut size = 0.0;
        for Size(name, unit, ..) in self.fault.sizes {
            let value = values.get(name)?;
            match (self.fault.kind, *unit) {
                (FaultKind::Lag, "m") => rig.model.params.t2_probe_diameter_m += value,
                _ => size = value,
            }
        }
        let path = rig.instruments.path_mut(self.fault.channels[0]);
        match self.fault.kind {
            FaultKind::Gain => path.gain_ratio *= size,
            FaultKind::Lag => path.lag_s += size,
            // The stem acts on the tip, which has its own state.
            FaultKind::TowardsWall if self.fault.channels[0] == Channel::T2 => {
                rig.model.params.t2_probe_stem_ratio += size;
            }
            FaultKind::TowardsWall => path.towards_wall_ratio += size,
            FaultKind::WithFlowSquared => path.with_flow_squared += size,
            FaultKind::WithValve => path.with_valve += size,
            _ => path.offset += size,
        }
        Ok(())
    }
}

/// `offset of T2`.
impl fmt::Display for SensorFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names = self.channel_names();
        match self.kind {
            FaultKind::Lag if self.sizes.len() > 1 => write!(f, "sheathed probe of {names}"),
            FaultKind::TowardsWall => write!(f, "conduction along the {names} probe"),
            FaultKind::WithFlowSquared => write!(f, "error of {names} with flow squared"),
            FaultKind::WithValve => write!(f, "error of {names} with valve opening"),
            kind => write!(f, "{kind} of {names}"),
        }
    }
}

impl SensorFault {
    /// The channels in a sentence.
    pub fn channel_names(&self) -> String {
        let names: Vec<String> = self.channels.iter().map(ToString::to_string).collect();
        match names.as_slice() {
            [rest @ .., last] if !rest.is_empty() => format!("{} and {last} together", rest.join(", ")),
            _ => names.join(""),
        }
    }
}
