//! The text next to a progress bar.

/// Progress of a run: `step` counts from 1 and is 0 before the first step.
pub fn progress_text(step: usize, steps: usize, t_s: f64, duration_s: f64, left_s: f64) -> String {
    let place = match step {
        0 => "before step 1".to_owned(),
        step => format!("step {step} of {}", steps.max(step)),
    };
    // Inserted steps make a run longer than planned.
    let whole_s = duration_s.max(t_s);
    format!(
        "{place}, {} of {} of rig time, {} left",
        short_duration(t_s),
        short_duration(whole_s),
        short_duration(left_s)
    )
}

/// A short form of a duration: 1.4 s, 43 s, 22 min, 2 h 04 min.
pub fn short_duration(duration_s: f64) -> String {
    let duration_s = duration_s.max(0.0);
    let minutes = (duration_s / 60.0).round() as u64;
    match duration_s {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 99.5 => format!("{s:.0} s"),
        _ if minutes < 60 => format!("{minutes} min"),
        _ => format!("{} h {:02} min", minutes / 60, minutes % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_fit_next_to_a_bar_of_80_columns() {
        assert_eq!(
            progress_text(12, 57, 1320.0, 7440.0, 1.4),
            "step 12 of 57, 22 min of 2 h 04 min of rig time, 1.4 s left"
        );
        assert!(
            progress_text(0, 0, 7441.0, 7440.0, 0.0).starts_with("before step 1, 2 h 04 min of 2 h 04 min")
        );
        let longest = progress_text(999, 999, 99.0 * 3600.0, 99.9 * 3600.0, 99.9 * 3600.0);
        assert!(longest.len() <= 78, "{longest}");
        assert_eq!(
            [9.94, 9.96, 99.4, 99.6, 3599.0].map(short_duration),
            ["9.9 s", "10 s", "99 s", "2 min", "1 h 00 min"]
        );
    }
}
