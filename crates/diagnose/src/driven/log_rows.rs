//! Complete rows of a log: driving and judged channels of one side of the machine.

use crate::driven::DrivenError;
use mapper_core::{Channel, Recording};
use mapper_identify::DECLARED_INTERVAL_S;
use mapper_observe::plausible::is_reading;

/// Maximum number of rows, evenly spread over a longer log: five minutes at 10 Hz. The sampler evaluates them some hundred thousand times.
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

/// Minimum pressure ratio of compressor or turbine: below it the work is so small that temperatures do not show the efficiency.
pub(crate) const MIN_PRESSURE_RATIO: f64 = 1.02;
/// Minimum flow, kg/s: the equations of the gas path divide by it.
pub(crate) const MIN_FLOW_KG_S: f64 = 1e-3;
/// The channels of the compressor side.
pub(crate) const COMPRESSOR: SideChannels<'_> = SideChannels {
    drives: &[Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::P2, Channel::T1],
    judged: &[Channel::T2, Channel::Tc],
    is_usable: |row| {
        let [speed_rpm, flow_kg_s, p1_pa, p2_pa, _] = *row else { return false };
        p2_pa >= MIN_PRESSURE_RATIO * p1_pa && flow_kg_s >= MIN_FLOW_KG_S && speed_rpm > 0.0
    },
};

/// Complete rows, as columns of equal length. SI units.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rows {
    /// Time, s, rising.
    pub t_s: Vec<f64>,
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
    /// Rows of the compressor side at the times of T2.
    ///
    /// # Errors
    /// [`DrivenError::Channel`] if speed, flow, P1, P2, T1 or T2 is missing.
    pub fn of_compressor(recording: &Recording) -> Result<Self, DrivenError> {
        Rows::read(recording, COMPRESSOR)
    }

    /// The driving channels, in the requested order.
    pub(crate) fn drives<const N: usize>(&self) -> [&[f64]; N] {
        std::array::from_fn(|place| self.drives.get(place).map_or(&[][..], |(_, column)| column))
    }

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
        let spacing_s = DECLARED_INTERVAL_S.max(span_s / MAX_ROWS as f64);
        let empty = |channels: &[Channel]| channels.iter().map(|channel| (*channel, Vec::new())).collect();
        let mut rows =
            Rows { drives: empty(channels.drives), judged: empty(channels.judged), ..Rows::default() };
        let mut row = Vec::with_capacity(series.len());
        for (t_s, value) in judged.t_s.iter().zip(&judged.values) {
            if rows.t_s.last().is_some_and(|last_s| t_s - last_s < 0.999 * spacing_s) {
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
    #[expect(clippy::len_without_is_empty, reason = "nothing asks whether there are rows")]
    pub fn len(&self) -> usize {
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
