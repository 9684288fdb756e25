//! Complete rows of a log: what drives one side of the machine, and what is judged.

use crate::DrivenError;
use mapper_core::{Channel, Recording};
use mapper_observe::plausible::is_reading;

/// Rows are taken no denser than this, s: nothing on either side that is judged is faster than a probe.
const SPACING_S: f64 = 0.1;
/// Most rows that are kept, of longer logs spread over all of it: five minutes at 10 Hz. What is sought goes through them some
/// hundred thousand times.
const MAX_ROWS: usize = 3_000;

/// What a side asks of a log.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Wanted<'a> {
    /// Channels that drive.
    pub(crate) drives: &'a [Channel],
    /// Channels that are judged; the first has to be there, and its times are those of the rows.
    pub(crate) judged: &'a [Channel],
    /// Whether the side does what its equations say under these values of `drives`.
    pub(crate) works: fn(&[f64]) -> bool,
}

/// Complete rows, as columns of equal length. SI units.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rows {
    /// Time, s, rising.
    pub(crate) t_s: Vec<f64>,
    /// What drives, in the order asked for.
    pub(crate) drives: Vec<(Channel, Vec<f64>)>,
    /// How fast each of these goes, per second; empty where nobody asked.
    pub(crate) rates: Vec<Vec<f64>>,
    /// What is judged, in the order asked for; NaN where it was not measured, which the first always was.
    pub(crate) judged: Vec<(Channel, Vec<f64>)>,
    /// Rows of the first judged channel that were left out.
    pub(crate) lost: usize,
}

impl Rows {
    /// The rows of a recording at the times of the first judged channel.
    ///
    /// # Errors
    /// [`DrivenError::Channel`] where one that drives, or the first that is judged, is missing.
    pub(crate) fn read(recording: &Recording, wanted: Wanted<'_>) -> Result<Self, DrivenError> {
        let Some(first) = wanted.judged.first() else {
            return Ok(Rows {
                t_s: Vec::new(),
                drives: Vec::new(),
                rates: Vec::new(),
                judged: Vec::new(),
                lost: 0,
            });
        };
        let judged = recording.require(*first)?;
        let mut series = Vec::with_capacity(wanted.drives.len());
        for channel in wanted.drives {
            series.push((*channel, recording.require(*channel)?));
        }
        let span_s =
            judged.t_s.last().zip(judged.t_s.first()).map_or(0.0, |(last_s, first_s)| last_s - first_s);
        let spacing_s = SPACING_S.max(span_s / MAX_ROWS as f64);
        let columns = |channels: &[Channel]| channels.iter().map(|channel| (*channel, Vec::new())).collect();
        let mut rows = Rows {
            t_s: Vec::new(),
            drives: columns(wanted.drives),
            rates: Vec::new(),
            judged: columns(wanted.judged),
            lost: 0,
        };
        let mut row = Vec::with_capacity(series.len());
        for (t_s, value) in judged.t_s.iter().zip(&judged.values) {
            if rows.t_s.last().is_some_and(|last_s| t_s - last_s < 0.999 * spacing_s) {
                continue;
            }
            row.clear();
            row.extend(series.iter().map_while(|(channel, series)| {
                // Beyond the ends of a channel there is no reading.
                let inside = series.t_s.first() <= Some(t_s) && series.t_s.last() >= Some(t_s);
                series.interpolate(*t_s).filter(|value| inside && is_reading(*channel, *value))
            }));
            if row.len() < series.len() || !is_reading(*first, *value) || !(wanted.works)(&row) {
                rows.lost += 1;
                continue;
            }
            // Spread over the log there is one more at most.
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

    /// What a channel that drives read; nothing for one that does not.
    pub(crate) fn drive(&self, channel: Channel) -> &[f64] {
        self.drives.iter().find(|(of, _)| *of == channel).map_or(&[], |(_, column)| column)
    }

    /// Every `n`-th row, so that at most `most` are left.
    pub(crate) fn thinned(&self, most: usize) -> Rows {
        let every = self.len().div_ceil(most.max(1)).max(1);
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
