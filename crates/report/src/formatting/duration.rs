//! Times and durations as text.

/// Time after the start of the run: `+h:mm`.
pub fn eta(after_s: f64) -> String {
    let minutes = (after_s.max(0.0) / 60.0).round() as u64;
    format!("+{}:{:02}", minutes / 60, minutes % 60)
}

/// A duration as hours and minutes, minutes and seconds, or seconds; rounded, without trailing zeros.
pub fn duration(duration_s: f64) -> String {
    let seconds = duration_s.max(0.0).round() as u64;
    let minutes = (seconds + 30) / 60;
    match (seconds / 60, seconds % 60) {
        (0, seconds) => format!("{seconds} s"),
        (60.., _) => format!("{} h {:02} min", minutes / 60, minutes % 60),
        (minutes, 0) => format!("{minutes} min"),
        (minutes, seconds) => format!("{minutes} min {seconds:02} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounded_and_never_sixty_of_anything() {
        for (seconds, phrases) in [
            (0.4, "0 s"),
            (59.6, "1 min"),
            (90.0, "1 min 30 s"),
            (3599.0, "59 min 59 s"),
            (4959.0, "1 h 23 min"),
            (7199.0, "2 h 00 min"),
        ] {
            assert_eq!(duration(seconds), phrases, "{seconds}");
        }
    }
}
