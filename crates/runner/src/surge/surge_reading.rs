//! The readings at one opening of the valve during an approach to surge.

use crate::surge::variation::Variation;
use mapper_core::{Channel, Recording, ReferenceState, StepMarker, SurgeSearchSettings};
use mapper_numerics::statistics::mean;

/// Channels whose variation indicates surge.
pub const PRECURSOR_CHANNELS: [Channel; 3] = [Channel::P2, Channel::CompressorFlow, Channel::P1];

/// Means and variation at one opening.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurgeReading {
    /// Valve opening relative to the nominal area.
    pub valve_opening_ratio: f64,
    /// Run time of its end, s.
    pub end_s: f64,
    /// Corrected speed, rpm.
    pub speed_corrected_rpm: f64,
    /// Physical speed, rpm.
    pub speed_rpm: f64,
    /// Corrected flow, kg/s.
    pub flow_corrected_kg_s: f64,
    /// Total pressure ratio P2/P1.
    pub pressure_ratio: f64,
    /// Total inlet pressure P1, Pa.
    pub p1_pa: f64,
    /// Variation of [`PRECURSOR_CHANNELS`]; `None` if a channel has too few samples.
    pub variations: [Option<Variation>; PRECURSOR_CHANNELS.len()],
}

impl SurgeReading {
    /// The reading of a step, from [`SurgeSearchSettings::SETTLE_S`] after its start on. `None` if a mean or every variation is unknown:
    /// the step was too short, or a channel is missing.
    pub fn of(recording: &Recording, step: &StepMarker, reference: ReferenceState) -> Option<Self> {
        let samples = |channel: Channel| -> Option<(Vec<f64>, Vec<f64>)> {
            let series = recording.series.get(&channel)?;
            let (t_s, values) = series.slice(step.start_s + SurgeSearchSettings::SETTLE_S, step.end_s);
            Some(t_s.iter().zip(values).filter(|(_, value)| value.is_finite()).unzip())
        };
        let level = |channel: Channel| mean(&samples(channel)?.1).filter(|level| *level > 0.0);
        let (speed_rpm, flow_kg_s) = (level(Channel::ShaftSpeed)?, level(Channel::CompressorFlow)?);
        let (t1_k, p1_pa, p2_pa) = (level(Channel::T1)?, level(Channel::P1)?, level(Channel::P2)?);
        let variations = PRECURSOR_CHANNELS.map(|channel| {
            let (t_s, values) = samples(channel)?;
            Variation::of(&t_s, &values)
        });
        variations.iter().any(Option::is_some).then_some(SurgeReading {
            valve_opening_ratio: step.valve_opening_ratio,
            end_s: step.end_s,
            speed_corrected_rpm: reference.corrected_speed_rpm(speed_rpm, t1_k),
            speed_rpm,
            flow_corrected_kg_s: reference.corrected_flow_kg_s(flow_kg_s, t1_k, p1_pa),
            pressure_ratio: p2_pa / p1_pa,
            p1_pa,
            variations,
        })
    }
}
