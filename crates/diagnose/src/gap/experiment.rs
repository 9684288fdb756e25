//! The experiment that a diagnosis recommends, and the warnings about it.

use mapper_core::unit_factors::S_PER_MIN;
use mapper_core::{Channel, OperatingPoint, Series, coded_enum};
use serde::{Deserialize, Serialize};

/// An allowed jump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllowedJump {
    /// Start point, settled.
    pub from: OperatingPoint,
    /// Target point.
    pub to: OperatingPoint,
    /// Turbine inlet total pressure commanded at the start, Pa.
    pub from_p3_pa: f64,
    /// Turbine inlet total pressure commanded by the jump, Pa.
    pub to_p3_pa: f64,
    /// Time at the target, s.
    pub dwell_s: f64,
}

/// An experiment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Experiment {
    /// Start, target and dwell; equal points if only a temperature changes. P3 is the value that holds the target. Unused for a soak.
    pub jump: AllowedJump,
    /// Additional change.
    pub also: AlsoChanged,
}

/// A change in addition to P3 and the valve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AlsoChanged {
    /// Nothing.
    Nothing,
    /// Turbine inlet total temperature changes with the step; K.
    T3 {
        /// Before.
        from_k: f64,
        /// After.
        to_k: f64,
    },
    /// Oil inlet temperature changes with the step; K.
    Oil {
        /// Before.
        from_k: f64,
        /// After.
        to_k: f64,
    },
    /// A model channel is measured that was not recorded before.
    Sensor(Channel),
    /// The machine soaks before the run, so that its temperature sensors can be compared with each other.
    Soak(AtRest),
}

/// How well a soak determines the offsets of the temperature sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtRest {
    /// Time at rest, s, > 0.
    pub duration_s: f64,
    /// Remaining uncertainty of each relative offset, 1 sigma, K, > 0; in the order of [`AtRest::CHANNELS`].
    pub left_sigma_k: [f64; AtRest::CHANNELS.len()],
}

impl AtRest {
    /// Sensors whose offsets a soak determines. If two pressure taps differ, either may be off; the oil supply temperature drifts.
    pub const CHANNELS: [Channel; 3] = [Channel::T1, Channel::T2, Channel::Tc];
}

/// Lag of T3 and oil behind their setpoints on a usual stand, s; campaigns do not declare their own. Bound: heaters follow within a minute.
const SETPOINT_LAG_S: f64 = 20.0;
/// Time to mount a sensor, min. Bound: screwing a thermocouple into a prepared bore, and cooling.
const MOUNTING_MIN: f64 = 30.0;
/// Shortest time of an experiment, min. Bound: a jump and the settling of a probe.
const MIN_MINUTES: f64 = 0.1;
/// Difference between two speeds that count as one, as a ratio. Bound: controllers hold a few rpm.
const SAME_SPEED_RATIO: f64 = 1e-3;

impl Experiment {
    /// A jump without any other change.
    pub fn jump(jump: AllowedJump) -> Experiment {
        Experiment { jump, also: AlsoChanged::Nothing }
    }

    /// Duration, min. Excludes the approach to the start; includes half an hour for mounting a sensor.
    pub fn minutes(&self) -> f64 {
        let mounting = if matches!(self.also, AlsoChanged::Sensor(_)) { MOUNTING_MIN } else { 0.0 };
        let at_work_s =
            if let AlsoChanged::Soak(soak) = self.also { soak.duration_s } else { self.jump.dwell_s };
        (at_work_s / S_PER_MIN).max(MIN_MINUTES) + mounting
    }

    /// Whether only the valve moves, at one speed.
    pub(crate) fn is_valve_step(&self) -> bool {
        let AllowedJump { from, to, .. } = self.jump;
        self.also == AlsoChanged::Nothing
            && (from.speed_rpm - to.speed_rpm).abs() < SAME_SPEED_RATIO * from.speed_rpm.abs()
            && from.valve_opening_ratio != to.valve_opening_ratio
    }

    /// The input that the step changes, as it would be recorded at `t_s` (rising) if the step began at `start_s`.
    pub fn driven(&self, t_s: &[f64], start_s: f64) -> Option<(Channel, Series)> {
        let (channel, from_k, to_k) = match self.also {
            AlsoChanged::Nothing | AlsoChanged::Sensor(_) | AlsoChanged::Soak(_) => return None,
            AlsoChanged::T3 { from_k, to_k } => (Channel::T3, from_k, to_k),
            AlsoChanged::Oil { from_k, to_k } => (Channel::TOil, from_k, to_k),
        };
        let at = |t: &f64| to_k + (from_k - to_k) * (-(t - start_s).max(0.0) / SETPOINT_LAG_S).exp();
        Some((channel, Series { t_s: t_s.to_vec(), values: t_s.iter().map(at).collect() }))
    }
}

coded_enum! {
/// A limit of a diagnosis, by its stable code.
GapWarning {
    /// Effects that show only in this channel cannot be found.
    "channel_not_recorded" ChannelNotRecorded { channel: Channel },
    /// The campaign's value replaces the readings of an input.
    "input_not_recorded" InputNotRecorded { channel: Channel },
    /// Blocks without samples are omitted.
    "gaps_in_recording" GapsInRecording { gaps: usize, missing_s: f64 },
    /// The noise of a typical sensor is used, in the unit of the channel.
    "assumed_noise" AssumedNoise { channel: Channel, noise_sigma: f64 },
    /// The sample times scatter, so changing readings have less weight.
    "uncertain_times" UncertainTimes { scatter_s: f64 },
    /// A limit of the baseline recording.
    "baseline_recording" BaselineRecording { warning: Box<GapWarning> },
    /// A drift during the recording: `subtracted` from a sensor's readings, or of the machine, so that no cause is named.
    "drift" Drift { reason: String, subtracted: bool },
    /// A detected drift was not subtracted, because tolerances alone explain the recording down to noise.
    "drift_not_subtracted" DriftNotSubtracted { reason: String },
    /// Only parts of a recording are readable.
    "recording_incomplete" RecordingIncomplete { reason: String },
}
}

/// Offset of a sensor at rest beyond its declaration, in the unit of the channel; subtracted before the diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OffsetAtRest {
    /// The channel.
    pub channel: Channel,
    /// Offset found at rest.
    pub offset: f64,
    /// Declared standard deviation of the offset.
    pub declared_sigma: f64,
}
