//! Compresses a long series to a bounded number of means, and draws a series in one line of text.

/// Maximum number of means; a power of two. Bound: memory; more than a line on screen shows.
const MAX_BINS: usize = 512;

/// A series as means over equal numbers of rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Trace {
    bins: Vec<(f64, u32)>,
    rows_per_bin: u64,
    rows: u64,
}

impl Default for Trace {
    fn default() -> Self {
        Trace { bins: Vec::new(), rows_per_bin: 1, rows: 0 }
    }
}

impl Trace {
    /// Adds the next row; NaN counts as a row without a value.
    pub fn push(&mut self, value: f64) {
        let bin = usize::try_from(self.rows / self.rows_per_bin).unwrap_or(MAX_BINS);
        if bin >= MAX_BINS {
            self.bins = self
                .bins
                .chunks(2)
                .map(|pair| pair.iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1)))
                .collect();
            self.rows_per_bin *= 2;
            return self.push(value);
        }
        if bin == self.bins.len() {
            self.bins.push((0.0, 0));
        }
        if let Some(bin) = self.bins.get_mut(bin).filter(|_| value.is_finite()) {
            bin.0 += value;
            bin.1 += 1;
        }
        self.rows += 1;
    }

    /// The means, in order; NaN if there was no value.
    pub fn means(&self) -> Vec<f64> {
        self.bins.iter().map(|(sum, count)| sum / f64::from(*count)).collect()
    }
}

/// Eighths of a line's height.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// A sparkline of at most `width` characters from the minimum to the maximum of `values`; each character shows the mean of its share of
/// them, a blank if it has none.
pub fn sparkline(values: &[f64], width: usize) -> String {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let low = finite().fold(f64::INFINITY, f64::min);
    let high = finite().fold(f64::NEG_INFINITY, f64::max);
    let width = width.min(values.len());
    let share = |index: usize| {
        let part =
            values.get(index * values.len() / width..(index + 1) * values.len() / width).unwrap_or_default();
        let (mut sum, mut count) = (0.0, 0.0);
        for value in part.iter().filter(|value| value.is_finite()) {
            sum += value;
            count += 1.0;
        }
        sum / count
    };
    let bar = |value: f64| match value {
        value if !value.is_finite() => ' ',
        _ if high <= low => BARS[3],
        value => BARS[((BARS.len() as f64 * (value - low) / (high - low)) as usize).min(BARS.len() - 1)],
    };
    (0..width).map(|index| bar(share(index))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_ramp_keeps_its_shape_in_few_means() {
        let mut trace = Trace::default();
        (0..100_000).for_each(|row| trace.push(f64::from(row)));
        let means = trace.means();
        assert!((MAX_BINS / 4..=MAX_BINS).contains(&means.len()), "{}", means.len());
        assert!(means.is_sorted());
        let whole: f64 = means.iter().take(means.len() - 1).sum::<f64>() / (means.len() - 1) as f64;
        assert!((whole / 50_000.0 - 1.0).abs() < 0.02, "{whole}");
    }

    #[test]
    fn a_ramp_rises_a_constant_is_level_and_a_gap_is_blank() {
        let ramp: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(sparkline(&ramp, 8), "▁▂▃▄▅▆▇█");
        assert_eq!(sparkline(&[2.0; 5], 3), "▄▄▄");
        assert_eq!(sparkline(&[0.0, f64::NAN, 1.0], 3), "▁ █");
        assert_eq!(sparkline(&[], 8), "");
    }
}
