//! Removes samples that are not measurements: spikes, and constant readings of a channel with declared noise.

use crate::IdentifyConfig;
use crate::step_data::samples::{Row, Samples};
use crate::step_outcome::findings::Findings;
use mapper_core::{Channel, Warning, repeats};
use mapper_numerics::statistics::{MIN_VALUES, median_of_sorted, robust_sigma};
use mapper_observe::redundant_sensors::fuse::SPIKE_SIGMAS;
use mapper_physics::rig::sensor_fault::repeats_s;

/// Smallest spike of P1 that is removed, Pa. Bound: one smaller spike among the hundred samples of a window moves the efficiency by
/// 0.01 points.
const MIN_SPIKE_P1_PA: f64 = 500.0;
/// The same of P2, Pa. Bound: as for P1, at twice the pressure.
const MIN_SPIKE_P2_PA: f64 = 1000.0;
/// The same of the flow, kg/s. Bound: a few per cent of the smallest flows.
const MIN_SPIKE_KG_S: f64 = 2e-3;
/// The same of the temperatures, K. Bound: several times the noise of a thermocouple.
const MIN_SPIKE_K: f64 = 1.0;

fn smallest_spike(channel: Channel) -> f64 {
    match channel {
        Channel::P1 => MIN_SPIKE_P1_PA,
        Channel::P2 => MIN_SPIKE_P2_PA,
        Channel::CompressorFlow => MIN_SPIKE_KG_S,
        _ => MIN_SPIKE_K,
    }
}

/// The samples without spikes; reports removals in `findings`.
pub(crate) fn without_spikes(samples: Samples, findings: &mut Findings) -> Samples {
    // A channel without declared noise is never treated as stuck.
    cleaned(samples, &IdentifyConfig::default(), findings)
}

/// The samples without spikes and without those of a stuck channel; reports removals in `findings`.
pub(crate) fn cleaned(mut samples: Samples, config: &IdentifyConfig, findings: &mut Findings) -> Samples {
    let t_s = samples.times_s();
    let mut kept = vec![true; samples.len()];
    let mut spikes = 0;
    for channel in Row::CHANNELS {
        let smallest = smallest_spike(channel);
        let column: Vec<f64> = samples.rows.iter().map(|row| row.read(channel)).collect();
        for index in spikes_of(&column, smallest) {
            spikes += usize::from(kept[index]);
            kept[index] = false;
        }
        let noisy = config.sensor(channel).noise_sigma > 0.0;
        if !noisy {
            continue;
        }
        let stuck = stuck_of(&t_s, &column, repeats_s(channel));
        if let (Some(first), Some(last)) = (stuck.first(), stuck.last()) {
            findings.doubt(Warning::Stuck { channel, duration_s: t_s[*last] - t_s[*first] });
        }
        stuck.into_iter().for_each(|index| kept[index] = false);
    }
    if spikes > 0 {
        findings.remark(Warning::Outliers { count: spikes });
    }
    let mut kept = kept.into_iter();
    samples.rows.retain(|_| kept.next().unwrap_or(false));
    samples
}

fn spikes_of(column: &[f64], smallest: f64) -> Vec<usize> {
    // The sorted neighbours on either side; from one sample to the next, one enters and one leaves.
    let mut sorted: Vec<f64> = Vec::with_capacity(2 * MIN_VALUES + 2);
    let place = |sorted: &[f64], value: f64| sorted.partition_point(|other| other.total_cmp(&value).is_lt());
    for value in column.iter().take(MIN_VALUES) {
        sorted.insert(place(&sorted, *value), *value);
    }
    let mut off = Vec::with_capacity(column.len());
    for (i, value) in column.iter().enumerate() {
        if let Some(coming) = column.get(i + MIN_VALUES) {
            sorted.insert(place(&sorted, *coming), *coming);
        }
        if let Some(going) = i.checked_sub(MIN_VALUES + 1).and_then(|before| column.get(before)) {
            sorted.remove(place(&sorted, *going));
        }
        off.push(value - median_of_sorted(&sorted).unwrap_or(*value));
    }
    let Some(sigma) = robust_sigma(&off) else { return Vec::new() };
    let limit = (SPIKE_SIGMAS * sigma).max(smallest);
    (0..off.len()).filter(|i| off[*i].abs() > limit).collect()
}

fn stuck_of(t_s: &[f64], column: &[f64], repeats_s: f64) -> Vec<usize> {
    let long = repeats(column).filter(|(first, last)| t_s[*last] - t_s[*first] >= repeats_s);
    long.flat_map(|(first, last)| first..=last).collect()
}
