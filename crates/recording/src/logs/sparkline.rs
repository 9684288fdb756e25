//! Sparklines: a trace as one line of text.

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
        value => BARS[((8.0 * (value - low) / (high - low)) as usize).min(7)],
    };
    (0..width).map(|index| bar(share(index))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_rises_a_constant_is_level_and_a_gap_is_blank() {
        let ramp: Vec<f64> = (0..16).map(f64::from).collect();
        assert_eq!(sparkline(&ramp, 8), "▁▂▃▄▅▆▇█");
        assert_eq!(sparkline(&[2.0; 5], 3), "▄▄▄");
        assert_eq!(sparkline(&[0.0, f64::NAN, 1.0], 3), "▁ █");
        assert_eq!(sparkline(&[], 8), "");
    }
}
