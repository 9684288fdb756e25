//! Times of a run as people write them.

/// When something is done, after the start of the run: `+h:mm`.
pub fn eta(after_s: f64) -> String {
    let minutes = (after_s.max(0.0) / 60.0).round() as u64;
    format!("+{}:{:02}", minutes / 60, minutes % 60)
}

/// A duration as hours and minutes, or minutes and seconds.
pub fn duration(duration_s: f64) -> String {
    let seconds = duration_s.max(0.0).round() as u64;
    if seconds >= 3600 {
        format!("{} h {:02} min", seconds / 3600, seconds % 3600 / 60)
    } else {
        format!("{} min {:02} s", seconds / 60, seconds % 60)
    }
}
