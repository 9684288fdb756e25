//! The inputs that act on the machine: as recorded, without the errors of their sensors.

use crate::gap::residuals::nuisance::Circumstances;
use mapper_core::Channel;
use mapper_observe::channels::{INPUT_CHANNELS, boundary_condition};
use mapper_observe::model_inputs::smoothed_inputs::SmoothedInputs;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::instruments::{ChannelPath, Surroundings};
use mapper_physics::simulation::inputs::Inputs;

/// Walls and flows along a recording: they scale the errors of sensors.
#[derive(Debug, Clone, Default)]
pub(crate) struct SurroundingsHistory {
    pub(crate) t_s: Vec<f64>,
    /// Values of [`MEASURED`]; flows as ratios.
    pub(crate) rows: Vec<[f64; MEASURED.len()]>,
}

/// Wall and flow of the compressor, and of the turbine.
pub(crate) const MEASURED: [Channel; 4] =
    [Channel::Tc, Channel::CompressorFlow, Channel::Tt, Channel::TurbineFlow];

impl SurroundingsHistory {
    /// Surroundings of a sensor at a time; `None` without a history.
    fn at(&self, channel: Channel, t_s: f64, opening_ratio: f64) -> Option<Surroundings> {
        let after = self.t_s.partition_point(|t| *t <= t_s).min(self.rows.len().checked_sub(1)?);
        let before = after.saturating_sub(1);
        let span_s = self.t_s[after] - self.t_s[before];
        let share = if span_s > 0.0 { ((t_s - self.t_s[before]) / span_s).clamp(0.0, 1.0) } else { 0.0 };
        let at = |i: usize| self.rows[before][i] + share * (self.rows[after][i] - self.rows[before][i]);
        let first = if Surroundings::channels(channel).0 == Channel::Tt { 2 } else { 0 };
        Some(Surroundings { wall_k: at(first), flow_ratio: at(first + 1), opening_ratio })
    }
}

/// The inputs of a recording without the errors that its circumstances give their sensors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TrueInputs<'a> {
    pub(crate) recorded: &'a SmoothedInputs,
    /// Errors of their sensors.
    pub(crate) circumstances: &'a Circumstances,
    /// Quantities that act on the sensors; `None` if no error depends on them.
    pub(crate) history: Option<&'a SurroundingsHistory>,
}

impl TrueInputs<'_> {
    /// The value behind a reading. An input's lag is not modelled: a stand holds its inputs, and that of P3 is its actuator's.
    fn true_value(
        &self,
        t_s: f64,
        channel: Channel,
        path: &ChannelPath,
        read: f64,
        opening_ratio: f64,
    ) -> f64 {
        let at_sensor = (read - path.offset) / path.gain_ratio;
        let around = self.history.and_then(|history| history.at(channel, t_s, opening_ratio));
        around.map_or(at_sensor, |around| path.behind(at_sensor, &around))
    }
}

impl Inputs for TrueInputs<'_> {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let mut boundary = self.recorded.at(t_s);
        let opening_ratio = boundary.valve_opening_ratio;
        for (channel, path) in INPUT_CHANNELS.into_iter().zip(&self.circumstances.paths) {
            if *path != ChannelPath::default()
                && let Some(value) = boundary_condition(&mut boundary, channel)
            {
                *value = self.true_value(t_s, channel, path, *value, opening_ratio);
            }
        }
        for (perturbation, by) in &self.circumstances.perturbations {
            perturbation.adjust_boundary(&mut boundary, *by);
        }
        boundary
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.recorded.next_kink_s(t_s)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        self.recorded.is_constant_after(t_s)
    }
}
