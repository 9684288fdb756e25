//! Denoises the driving channels.
//!
//! A model driven by noisy readings fits better the less it responds to them, so noise would favour causes that reduce the response. Each reading is
//! therefore replaced by the straight line through as many neighbours as lie on one within the noise of the sensor, so few are used where a drive changes its slope.

use crate::driven::log_rows::Rows;
use crate::driven::side::CORRELATION_S;
use mapper_observe::Declared;
use std::ops::Range;

/// Numbers of neighbours tried on each side. Bound: from a line within the correlation time at 10 Hz down to the fewest whose scatter shows a bend.
const NEIGHBOURS: [usize; 5] = [12, 8, 5, 3, 2];
/// Readings lie on a line if their mean squared distance is below this multiple of the variance of the noise. Source: one in twenty sets of six
/// readings fails by chance.
const LINE_RATIO: f64 = 1.5;

/// Rows with denoised drives and the rates of these.
pub(crate) fn denoised(rows: &Rows, declared: &Declared) -> Rows {
    let mut denoised = rows.clone();
    denoised.rates.clear();
    for (channel, column) in &mut denoised.drives {
        let sigma = declared.noise_sigma(*channel);
        let read = rows.drive(*channel);
        let lines = (0..rows.len()).map(|i| denoised_at(&rows.t_s, read, i, sigma));
        let (values, rates) = lines.unzip();
        *column = values;
        denoised.rates.push(rates);
    }
    denoised
}

/// Value and rate of the line through the neighbours of a reading, per second.
fn denoised_at(t_s: &[f64], read: &[f64], i: usize, sigma: f64) -> (f64, f64) {
    for count in NEIGHBOURS {
        let (first, last) = (i.saturating_sub(count), (i + count).min(read.len() - 1));
        // Both sides, or one side only with as many readings.
        let ranges =
            [first..last + 1, i.saturating_sub(2 * count)..i + 1, i..(i + 2 * count).min(read.len() - 1) + 1];
        for range in ranges {
            if range.len() < 4 || t_s[range.end - 1] - t_s[range.start] > 2.0 * CORRELATION_S {
                continue;
            }
            if let Some(line) = line(t_s, read, i, range, sigma) {
                return line;
            }
        }
    }
    let (before, after) = (i.saturating_sub(1), (i + 1).min(read.len() - 1));
    let elapsed_s = t_s[after] - t_s[before];
    (read[i], if elapsed_s > 0.0 { (read[after] - read[before]) / elapsed_s } else { 0.0 })
}

/// Value at `i` of the straight line through a range, and its slope; `None` if the readings do not lie on it.
fn line(t_s: &[f64], read: &[f64], i: usize, range: Range<usize>, sigma: f64) -> Option<(f64, f64)> {
    let n = range.len() as f64;
    let mean = |values: &[f64]| values[range.clone()].iter().sum::<f64>() / n;
    let (t0, v0) = (mean(t_s), mean(read));
    let (tt, tv) = range.clone().fold((0.0, 0.0), |(tt, tv), k| {
        let t = t_s[k] - t0;
        (tt + t * t, tv + t * (read[k] - v0))
    });
    let slope = if tt > 0.0 { tv / tt } else { 0.0 };
    let squares: f64 = range.map(|k| (read[k] - v0 - slope * (t_s[k] - t0)).powi(2)).sum();
    (squares <= LINE_RATIO * (n - 2.0) * sigma * sigma).then(|| (v0 + slope * (t_s[i] - t0), slope))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, DeclaredUncertainty};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Level, ramp and level with noise of 50: a third of the noise remains on the levels, and the corners stay in place.
    #[test]
    fn noise_goes_and_corners_stay() {
        let sigma = 50.0;
        let t_s: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let truth: Vec<f64> = t_s.iter().map(|t| 5e4 + 4.5e4 * (t - 8.0).clamp(0.0, 2.0)).collect();
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
        let read = truth.iter().map(|v| v + sigma * noise()).collect();
        let rows = Rows {
            t_s,
            drives: vec![(Channel::ShaftSpeed, read)],
            rates: Vec::new(),
            judged: Vec::new(),
            lost: 0,
        };
        let declared = Declared {
            sensors: [(
                Channel::ShaftSpeed,
                DeclaredUncertainty { noise_sigma: sigma, ..Default::default() },
            )]
            .into(),
            noise_colour: Default::default(),
            tolerances: Default::default(),
            nominal: Default::default(),
            common_offsets: Vec::new(),
            actuators: None,
        };
        let denoised = denoised(&rows, &declared);
        let off = |range: Range<usize>| {
            let squares = range.clone().map(|i| (denoised.drives[0].1[i] - truth[i]).powi(2)).sum::<f64>();
            (squares / range.len() as f64).sqrt()
        };
        assert!(off(0..75) < 0.4 * sigma && off(105..200) < 0.4 * sigma, "{} {}", off(0..75), off(105..200));
        assert!(off(75..105) < 1.2 * sigma, "{}", off(75..105));
    }
}
