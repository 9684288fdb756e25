//! Variation of flow and pressure from one tenth of a second to the next, and the readings that a search for surge needs.

use mapper_core::{Channel, Recording, ReferenceState, StepMarker, SurgeSearchSettings};
use mapper_numerics::statistics::mean;
use nalgebra::{Matrix3, Vector3};

/// Length of the segments that are detrended by a straight line, s. Drift is not due to surge, and slow sampling may fold fast
/// oscillations to low frequencies.
const SEGMENT_S: f64 = 5.0;
const MIN_SAMPLES: usize = 10;
/// Maximum lag of the autocorrelation, in samples; smaller than a segment.
const MAX_LAG_SAMPLES: usize = 6;
const MIN_SEGMENTS: usize = 1;

/// A variance with its degrees of freedom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variation {
    /// Variance, square of the channel's unit.
    pub variance: f64,
    /// Number of independent degrees of freedom with the same accuracy.
    pub degrees_of_freedom: f64,
}

impl Variation {
    /// The variation of samples; `None` if there are too few.
    pub fn of(t_s: &[f64], values: &[f64]) -> Option<Self> {
        let first_s = *t_s.first()?;
        let mut segments: Vec<Vec<f64>> = Vec::new();
        let mut from = 0;
        while from < t_s.len() {
            let segment = ((t_s[from] - first_s) / SEGMENT_S).floor();
            let count =
                t_s[from..].partition_point(|t| ((t - first_s) / SEGMENT_S).floor() <= segment).max(1);
            let to = from + count;
            if count >= MIN_SAMPLES {
                segments.push(detrend(&t_s[from..to], &values[from..to]));
            }
            from = to;
        }
        if segments.len() < MIN_SEGMENTS {
            return None;
        }
        let samples = segments.iter().map(Vec::len).sum::<usize>() as f64;
        let freedom = samples - 2.0 * segments.len() as f64;
        let lagged = |lag: usize| -> f64 {
            segments.iter().flat_map(|segment| segment.iter().zip(&segment[lag..]).map(|(a, b)| a * b)).sum()
        };
        let square = lagged(0);
        // Bartlett: correlated samples add less information about the variance. Chance alone makes the square of a
        // correlation 1/n.
        let memory: f64 =
            (1..=MAX_LAG_SAMPLES).map(|lag| ((lagged(lag) / square).powi(2) - 1.0 / samples).max(0.0)).sum();
        (square > 0.0).then_some(Variation {
            variance: square / freedom,
            degrees_of_freedom: freedom / (1.0 + 2.0 * memory),
        })
    }
}

/// Residual of the samples about their regression line.
fn detrend(t_s: &[f64], values: &[f64]) -> Vec<f64> {
    let count = t_s.len() as f64;
    let middle_s = t_s.iter().sum::<f64>() / count;
    let level = values.iter().sum::<f64>() / count;
    let (mut across, mut along) = (0.0, 0.0);
    for (t, value) in t_s.iter().zip(values) {
        across += (t - middle_s) * (value - level);
        along += (t - middle_s).powi(2);
    }
    let slope = if along > 0.0 { across / along } else { 0.0 };
    t_s.iter().zip(values).map(|(t, value)| value - level - slope * (t - middle_s)).collect()
}

/// Flows and pressure ratios at one speed, in the order of the readings.
#[derive(Debug, Clone)]
pub(crate) struct SmoothedFlow {
    /// Corrected flow at the speed of the last reading, kg/s.
    pub(crate) flows_kg_s: Vec<f64>,
    /// Relative standard error of the smoothed flow, from the scatter about the curve.
    pub(crate) flow_error_ratio: f64,
}

/// Range of openings above the smallest one that is fitted: beyond it a parabola does not describe a valve.
const REACH_RATIO: f64 = 1.7;

impl SmoothedFlow {
    /// Flows converted to the speed of the last reading by similarity, then smoothed by a parabola of the logarithm of flow over
    /// the logarithm of the opening. With fewer than five readings the flows are as measured.
    pub(crate) fn fit(readings: &[SurgeReading]) -> Option<Self> {
        let last = readings.last()?;
        let to_speed = |reading: &SurgeReading| {
            reading.flow_corrected_kg_s * last.speed_corrected_rpm / reading.speed_corrected_rpm
        };
        let measured: Vec<f64> = readings.iter().map(to_speed).collect();
        let log_distance =
            |reading: &SurgeReading| (reading.valve_opening_ratio / last.valve_opening_ratio).ln();
        let is_near = |reading: &SurgeReading| log_distance(reading).abs() < REACH_RATIO.ln();
        let (mut square, mut right) = (Matrix3::zeros(), Vector3::zeros());
        let mut count = 0usize;
        for (reading, flow) in readings.iter().zip(&measured).filter(|(reading, _)| is_near(reading)) {
            let row = row(log_distance(reading));
            square += row * row.transpose();
            right += row * flow.ln();
            count += 1;
        }
        let unsmoothed = SmoothedFlow { flows_kg_s: measured.clone(), flow_error_ratio: 0.0 };
        let (true, Some(inverse)) = (count >= 5, square.try_inverse()) else { return Some(unsmoothed) };
        let parabola = inverse * right;
        let flow = |reading: &SurgeReading| row(log_distance(reading)).dot(&parabola);
        let pairs = || readings.iter().zip(&measured).filter(|(reading, _)| is_near(reading));
        let residual: f64 = pairs().map(|(reading, measured)| (measured.ln() - flow(reading)).powi(2)).sum();
        let sigma_ratio = (residual / (count - 3).max(1) as f64).sqrt();
        let at_last = row(0.0);
        let flows_kg_s = readings
            .iter()
            .zip(&measured)
            .map(|(reading, measured)| if is_near(reading) { flow(reading).exp() } else { *measured })
            .collect();
        let flow_error_ratio = sigma_ratio * at_last.dot(&(inverse * at_last)).max(0.0).sqrt();
        Some(SmoothedFlow { flows_kg_s, flow_error_ratio })
    }
}

fn row(log_distance: f64) -> Vector3<f64> {
    Vector3::new(1.0, log_distance, log_distance * log_distance)
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    #[test]
    fn a_drift_of_the_mean_does_not_change_the_fast_variance() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 0.5).unwrap();
        let t_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.1).collect();
        let values: Vec<f64> = t_s.iter().map(|t| 100.0 + 0.05 * t + normal.sample(&mut random)).collect();
        let found = Variation::of(&t_s, &values).unwrap();
        // 3840 degrees of freedom determine a variance to 2.3 %.
        assert!((found.variance / 0.25 - 1.0).abs() < 0.08, "{found:?}");
        assert!((3500.0..=3840.0).contains(&found.degrees_of_freedom), "{found:?}");
        assert_eq!(Variation::of(&t_s[..9], &values[..9]), None);
    }

    #[test]
    fn correlated_samples_have_fewer_degrees_of_freedom() {
        let mut random = rand_pcg::Pcg64::seed_from_u64(4);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let t_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.1).collect();
        let mut now = 0.0;
        let values: Vec<f64> = t_s
            .iter()
            .map(|_| {
                now = -0.6 * now + 0.8 * normal.sample(&mut random);
                now
            })
            .collect();
        let found = Variation::of(&t_s, &values).unwrap();
        // Bartlett's formula: 1 + 2 sum 0.36^k = 2.12.
        assert!((found.degrees_of_freedom / (3840.0 / 2.12) - 1.0).abs() < 0.15, "{found:?}");
    }
}
