//! Complete rows of a log: driving and judged channels of one side of the machine.

use crate::driven::DrivenError;
use mapper_core::{Channel, Recording, SAMPLE_INTERVAL_S, is_reading};
use mapper_numerics::statistics::EXCLUDE_SIGMAS;
use mapper_observe::declared::usual_noise_sigma;

/// Maximum number of rows, evenly spread over a longer log. Bound: five minutes at 10 Hz, enough for every unknown.
const MAX_ROWS: usize = 3_000;

/// The channels of one side of the machine.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SideChannels<'a> {
    pub(crate) drives: &'a [Channel],
    /// Judged channels. The first is required, and its times define the rows.
    pub(crate) judged: &'a [Channel],
    /// Whether the equations of the side apply at these values of `drives`.
    pub(crate) is_usable: fn(&[f64]) -> bool,
}

/// Minimum pressure ratio of compressor or turbine. Bound: below it the work is so small that temperatures do not show the efficiency.
const MIN_PRESSURE_RATIO: f64 = 1.02;
/// Share of the spacing at which a row counts as the next. Bound: rounding of times.
const SPACING_SHARE: f64 = 0.999;

/// Whether a side does enough work for its temperatures to show its efficiency. The equations divide by the flow, which a meter must
/// distinguish from none.
pub(crate) fn does_work(speed_rpm: f64, flow_kg_s: f64, low_pa: f64, high_pa: f64) -> bool {
    let min_flow_kg_s = EXCLUDE_SIGMAS * usual_noise_sigma(Channel::CompressorFlow);
    high_pa >= MIN_PRESSURE_RATIO * low_pa && flow_kg_s >= min_flow_kg_s && speed_rpm > 0.0
}

/// Complete rows, as columns of equal length. SI units.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Rows {
    /// Time, s, rising.
    pub(crate) t_s: Vec<f64>,
    /// Driving channels, in the requested order.
    pub(crate) drives: Vec<(Channel, Vec<f64>)>,
    /// Their rates of change, per second; empty if not requested.
    pub(crate) rates: Vec<Vec<f64>>,
    /// Judged channels, in the requested order; NaN if not measured (never for the first).
    pub(crate) judged: Vec<(Channel, Vec<f64>)>,
    /// Number of times of the first judged channel without a complete row.
    pub(crate) lost: usize,
}

impl Rows {
    /// Rows of a recording at the times of the first judged channel.
    pub(crate) fn read(recording: &Recording, channels: SideChannels<'_>) -> Result<Self, DrivenError> {
        let Some(first) = channels.judged.first() else {
            return Ok(Rows::default());
        };
        let judged = recording.require(*first)?;
        let mut series = Vec::with_capacity(channels.drives.len());
        for channel in channels.drives {
            series.push((*channel, recording.require(*channel)?));
        }
        let span_s =
            judged.t_s.last().zip(judged.t_s.first()).map_or(0.0, |(last_s, first_s)| last_s - first_s);
        let spacing_s = SAMPLE_INTERVAL_S.max(span_s / MAX_ROWS as f64);
        let empty = |channels: &[Channel]| channels.iter().map(|channel| (*channel, Vec::new())).collect();
        let mut rows =
            Rows { drives: empty(channels.drives), judged: empty(channels.judged), ..Rows::default() };
        let mut row = Vec::with_capacity(series.len());
        for (t_s, value) in judged.t_s.iter().zip(&judged.values) {
            if rows.t_s.last().is_some_and(|last_s| t_s - last_s < SPACING_SHARE * spacing_s) {
                continue;
            }
            row.clear();
            row.extend(series.iter().map_while(|(channel, series)| {
                // No extrapolation beyond the ends of a channel.
                let inside = series.t_s.first() <= Some(t_s) && series.t_s.last() >= Some(t_s);
                series.interpolate(*t_s).filter(|value| inside && is_reading(*channel, *value))
            }));
            if row.len() < series.len() || !is_reading(*first, *value) || !(channels.is_usable)(&row) {
                rows.lost += 1;
                continue;
            }
            // Spacing over the whole log may give one row too many.
            if rows.t_s.len() > MAX_ROWS {
                break;
            }
            rows.t_s.push(*t_s);
            for ((_, column), value) in rows.drives.iter_mut().zip(&row) {
                column.push(*value);
            }
            for (channel, column) in &mut rows.judged {
                let other = || recording.series.get(channel).and_then(|other| other.interpolate(*t_s));
                let read = if channel == first { Some(*value) } else { other() };
                column.push(read.filter(|k| is_reading(*channel, *k)).unwrap_or(f64::NAN));
            }
        }
        Ok(rows)
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Readings of a driving channel; empty for any other.
    pub(crate) fn drive(&self, channel: Channel) -> &[f64] {
        self.drives.iter().find(|(of, _)| *of == channel).map_or(&[], |(_, column)| column)
    }

    /// First reading of a judged channel; `None` if it was not measured.
    pub(crate) fn first_judged(&self, channel: Channel) -> Option<f64> {
        let (_, column) = self.judged.iter().find(|(of, _)| *of == channel)?;
        column.iter().copied().find(|reading| reading.is_finite())
    }

    /// Time from a row to the next one, s; 0 for the last.
    pub(crate) fn elapsed_s(&self, row: usize) -> f64 {
        self.t_s.get(row + 1).map_or(0.0, |next_s| next_s - self.t_s[row])
    }

    /// Every `n`-th row, so that at most `max_rows` remain.
    pub(crate) fn thinned(&self, max_rows: usize) -> Rows {
        let every = self.len().div_ceil(max_rows.max(1)).max(1);
        let thin = |column: &[f64]| column.iter().copied().step_by(every).collect::<Vec<f64>>();
        let each = |columns: &[(Channel, Vec<f64>)]| columns.iter().map(|(c, v)| (*c, thin(v))).collect();
        let rates = self.rates.iter().map(|column| thin(column)).collect();
        Rows {
            t_s: thin(&self.t_s),
            drives: each(&self.drives),
            rates,
            judged: each(&self.judged),
            lost: self.lost,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::Series;

    /// A day at 10 Hz is read to its end, but thinned to the maximum number of rows; a missing driving channel is an error.
    #[test]
    fn a_long_log_is_thinned() {
        let channels = SideChannels {
            drives: &[Channel::ShaftSpeed, Channel::P2],
            judged: &[Channel::T2],
            is_usable: |row| row[1] > 0.0,
        };
        let t_s: Vec<f64> = (0..864_000).map(|i| 0.1 * f64::from(i)).collect();
        let series = [(Channel::ShaftSpeed, 1e5), (Channel::P2, 2e5), (Channel::T2, 380.0)];
        let series =
            series.map(|(of, value)| (of, Series { t_s: t_s.clone(), values: vec![value; t_s.len()] }));
        let mut recording = Recording { series: series.into(), ..Recording::default() };
        let rows = Rows::read(&recording, channels).unwrap();
        assert!((2_000..=3_001).contains(&rows.len()), "{}", rows.len());
        assert!(rows.t_s.last().unwrap() > &86_000.0);
        recording.series.remove(&Channel::P2);
        assert!(matches!(Rows::read(&recording, channels), Err(DrivenError::Channel(_))));
    }
}
