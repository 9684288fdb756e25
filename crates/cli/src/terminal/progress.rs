//! Progress on standard error: a bar, lines, or JSON.

use crate::output::standard_error::say;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mapper_core::{StepKind, StepMarker, terminal_json, terminal_text};
use mapper_report::{progress_text, short_duration, with_messages, wrapped};
use mapper_session::SessionEvent;
use serde_json::json;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};

/// Interval at which the clock of a bar is redrawn.
const REDRAW_INTERVAL: Duration = Duration::from_millis(250);
/// Maximum width of a warning, columns.
const COLUMNS: usize = 80;
/// Number of times in a run that a program receives the rig's time: steps of half a per cent.
const RIG_TIME_MESSAGES: f64 = 200.0;
/// The current activity is above the bar, the progress below it.
const RUN_BAR: &str = "{prefix}\n[{bar:14}] {msg}";
const PIECES_BAR: &str = "[{bar:30}] {pos} of {len}, {elapsed} so far{msg}";
const WORK_BAR: &str = "[{bar:30}] {percent:>3} %, {elapsed} so far  {wide_msg}";
const SPINNER: &str = "{spinner} {wide_msg} {elapsed}";

/// The consumer of the progress.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProgressFormat {
    Bar,
    Lines,
    Json,
    Quiet,
}

impl ProgressFormat {
    /// As written on the command line.
    pub const NAMES: [&str; 4] = ["bar", "lines", "json", "off"];

    /// The format with this name; an unknown name disables progress.
    pub fn from_name(name: &str) -> Self {
        match name {
            "bar" => ProgressFormat::Bar,
            "lines" => ProgressFormat::Lines,
            "json" => ProgressFormat::Json,
            _ => ProgressFormat::Quiet,
        }
    }

    fn shows(self, event: &SessionEvent) -> bool {
        use SessionEvent as E;
        match self {
            ProgressFormat::Quiet => false,
            ProgressFormat::Json => !matches!(event, E::Readings { .. }),
            ProgressFormat::Lines => {
                matches!(
                    event,
                    E::RunStarted { .. }
                        | E::StepStarted { .. }
                        | E::Reported(_)
                        | E::Progress { .. }
                        | E::PiecesDone { .. }
                )
            }
            ProgressFormat::Bar => !matches!(
                event,
                E::StepEnded(_) | E::Readings { .. } | E::PointEstimated(_) | E::PointIdentified(_)
            ),
        }
    }
}

/// Maximum number of queued events.
const MAX_QUEUED_EVENTS: usize = 4096;
/// Maximum time that a session waits for a slow consumer. It waits once; after that, events are lost until the queue has room.
const SEND_TIMEOUT: Duration = Duration::from_millis(10);
/// Longest wait at the end for the queued events to be shown.
const FLUSH_TIMEOUT: Duration = Duration::from_secs(1);

/// Shows events on its own thread: no sender waits for a terminal or pipe. One that is held or unread loses lines; the run goes on.
pub struct Progress {
    manner: ProgressFormat,
    to: SyncSender<Queued>,
    stalled: AtomicBool,
}

enum Queued {
    Event(Box<SessionEvent>),
    Clear(SyncSender<()>),
}

impl Progress {
    /// Shows nothing before the first event.
    pub fn new(manner: ProgressFormat) -> Self {
        let (to, queued) = sync_channel(MAX_QUEUED_EVENTS);
        // If the thread cannot be started, the work continues without progress.
        let started =
            std::thread::Builder::new().name("progress".to_owned()).spawn(move || show_all(manner, &queued));
        let manner = if started.is_ok() { manner } else { ProgressFormat::Quiet };
        Progress { manner, to, stalled: AtomicBool::new(false) }
    }

    pub fn show(&self, event: &SessionEvent) {
        if !self.manner.shows(event) {
            return;
        }
        match self.to.try_send(Queued::Event(Box::new(event.clone()))) {
            Ok(()) => self.stalled.store(false, Ordering::Relaxed),
            Err(TrySendError::Full(queued)) if !self.stalled.load(Ordering::Relaxed) => {
                std::thread::sleep(SEND_TIMEOUT);
                self.stalled.store(self.to.try_send(queued).is_err(), Ordering::Relaxed);
            }
            Err(_) => {}
        }
    }

    /// Shows the current activity before a total is known.
    pub fn begin(&self, what: &str) {
        self.show(&SessionEvent::Progress { done_ratio: 0.0, what: what.to_owned() });
    }

    /// Shows how many of the pieces of work are done.
    pub fn pieces(&self, done: usize, of: usize) {
        self.show(&SessionEvent::PiecesDone { done, of });
    }

    /// Removes the bar once all events are shown.
    pub fn clear(&self) {
        let (done, is_done) = sync_channel(1);
        if self.to.try_send(Queued::Clear(done)).is_ok() {
            let _ = is_done.recv_timeout(FLUSH_TIMEOUT);
        }
    }
}

/// Shows the queued events before an error.
impl Drop for Progress {
    fn drop(&mut self) {
        self.clear();
    }
}

fn show_all(manner: ProgressFormat, queued: &Receiver<Queued>) {
    let target = match manner {
        ProgressFormat::Bar => ProgressDrawTarget::stderr(),
        _ => ProgressDrawTarget::hidden(),
    };
    let shown = ProgressDisplay { bar: ProgressBar::with_draw_target(None, target) };
    let mut state = State::default();
    for queued in queued {
        match (queued, manner) {
            (Queued::Event(event), ProgressFormat::Json) => print_json(&event, &mut state),
            (Queued::Event(event), ProgressFormat::Lines) => say_lines(&event, &mut state),
            (Queued::Event(event), ProgressFormat::Bar) => shown.draw(&event, &mut state),
            (Queued::Event(_), ProgressFormat::Quiet) => {}
            (Queued::Clear(done), _) => {
                shown.bar.finish_and_clear();
                let _ = done.try_send(());
            }
        }
    }
}

#[derive(Default)]
struct State {
    template: Option<&'static str>,
    last_line: String,
    began: Option<Instant>,
    steps: usize,
    /// Number of the current step, from 1.
    step: usize,
    duration_s: f64,
    /// Rig time last sent to a program, s.
    sent_s: f64,
}

struct ProgressDisplay {
    bar: ProgressBar,
}

impl ProgressDisplay {
    fn draw(&self, event: &SessionEvent, state: &mut State) {
        match event {
            SessionEvent::RunStarted { steps, duration_s, .. } => {
                (state.steps, state.duration_s, state.step) = (*steps, *duration_s, 0);
                self.set_style(state, RUN_BAR, Some(duration_s.ceil() as u64));
                self.bar.set_prefix("soak, then warm-up");
            }
            SessionEvent::RigTime { t_s } => {
                self.bar.set_position(*t_s as u64);
                let left_s = self.bar.eta().as_secs_f64();
                self.bar.set_message(progress_text(state.step, state.steps, *t_s, state.duration_s, left_s));
            }
            SessionEvent::StepStarted { marker, left_s } => {
                state.step = marker.number().unwrap_or(state.step);
                // A hold moves the end of the run.
                state.duration_s = marker.start_s + left_s;
                self.bar.set_length(state.duration_s.ceil() as u64);
                self.bar.set_prefix(format!(
                    "{}, {} at this point",
                    place(marker),
                    short_duration(marker.end_s - marker.start_s)
                ));
            }
            SessionEvent::Reported(event) => {
                self.bar.println(terminal_text(&event_line(event.t_s, &event.message)))
            }
            SessionEvent::Progress { done_ratio, what } => {
                if *done_ratio > 0.0 || state.template == Some(WORK_BAR) {
                    self.set_style(state, WORK_BAR, Some(1000));
                    self.bar.set_position((1000.0 * done_ratio) as u64);
                } else {
                    self.set_style(state, SPINNER, None);
                }
                self.bar.set_message(terminal_text(what));
            }
            SessionEvent::PiecesDone { done, of } => {
                self.set_style(state, PIECES_BAR, Some(*of as u64));
                self.bar.set_position(*done as u64);
                if *done > 0 {
                    self.bar.set_message(format!(", {} left", short_duration(self.bar.eta().as_secs_f64())));
                }
            }
            SessionEvent::StepEnded(_)
            | SessionEvent::RigReleased
            | SessionEvent::Readings { .. }
            | SessionEvent::PointEstimated(_)
            | SessionEvent::PointIdentified(_) => {}
        }
    }

    /// Sets the style and length of the bar if they changed; its clock shows that work continues.
    fn set_style(&self, state: &mut State, template: &'static str, length: Option<u64>) {
        if state.template == Some(template) {
            return;
        }
        state.template = Some(template);
        // A template that does not parse leaves the plain style.
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style.progress_chars("=> "));
        }
        self.bar.reset();
        match length {
            Some(length) => self.bar.set_length(length),
            None => self.bar.unset_length(),
        }
        self.bar.set_message("");
        self.bar.enable_steady_tick(REDRAW_INTERVAL);
    }
}

fn place(marker: &StepMarker) -> String {
    marker.to.map_or_else(String::new, |point| point.in_words())
}

fn event_line(t_s: f64, message: &str) -> String {
    wrapped(&format!("{t_s:8.1} s  {message}"), COLUMNS, 12).trim_end().to_owned()
}

fn say_lines(event: &SessionEvent, state: &mut State) {
    let line = match event {
        SessionEvent::RunStarted { steps, duration_s, .. } => {
            (state.steps, state.duration_s) = (*steps, *duration_s);
            format!("{steps} steps in {} of rig time", short_duration(*duration_s))
        }
        SessionEvent::StepStarted { marker, left_s } => format!(
            "{:8.1} s  {}, {}, for {}, {} left",
            marker.start_s,
            match marker.number() {
                Some(number) if marker.kind != StepKind::Repeat || number <= state.steps => {
                    format!("step {number} of {}", state.steps.max(number))
                }
                _ => "repeated step".to_owned(),
            },
            place(marker),
            short_duration(marker.end_s - marker.start_s),
            short_duration(*left_s)
        ),
        SessionEvent::Reported(event) => event_line(event.t_s, &event.message),
        SessionEvent::Progress { what, done_ratio } if *what != state.last_line => {
            let began = *state.began.get_or_insert_with(Instant::now);
            progress_line(what, *done_ratio, began.elapsed().as_secs_f64())
        }
        SessionEvent::PiecesDone { done, of } => {
            let began = *state.began.get_or_insert_with(Instant::now);
            if !is_printed(*done, *of) {
                return;
            }
            pieces_line(*done, *of, began.elapsed().as_secs_f64())
        }
        _ => return,
    };
    if let SessionEvent::Progress { what, .. } = event {
        state.last_line.clone_from(what);
    }
    say(&format!("{line}\n"));
}

/// Maximum number of lines about finished pieces.
const PIECES_LINES: usize = 200;

fn is_printed(done: usize, of: usize) -> bool {
    done == of || done.is_multiple_of(of.div_ceil(PIECES_LINES).max(1))
}

fn progress_line(what: &str, done_ratio: f64, elapsed_s: f64) -> String {
    if !(done_ratio > 0.0 && done_ratio < 1.0) {
        return what.to_owned();
    }
    let left_s = elapsed_s * (1.0 - done_ratio) / done_ratio;
    format!("{:3.0} %  {what}, {} left", 100.0 * done_ratio, short_duration(left_s))
}

fn pieces_line(done: usize, of: usize, elapsed_s: f64) -> String {
    match done {
        0 => format!("0 of {of} done"),
        _ if done < of => {
            let left_s = elapsed_s * (of - done) as f64 / done as f64;
            format!("{done} of {of} done in {}, {} left", short_duration(elapsed_s), short_duration(left_s))
        }
        _ => format!("{done} of {of} done in {}", short_duration(elapsed_s)),
    }
}

/// One JSON object a line: the event as the session has it. Readings are for a live page and are omitted; the rig's time is thinned.
fn print_json(event: &SessionEvent, state: &mut State) {
    match event {
        SessionEvent::RunStarted { duration_s, .. } => state.duration_s = *duration_s,
        SessionEvent::RigTime { t_s } => {
            if *t_s < state.sent_s + state.duration_s / RIG_TIME_MESSAGES {
                return;
            }
            state.sent_s = *t_s;
        }
        _ => {}
    }
    let value = with_messages(|| serde_json::to_value(event));
    let value = value.unwrap_or_else(|error| json!({ "event": "error", "message": error.to_string() }));
    say(&terminal_json(&format!("{value}\n")));
}

#[cfg(test)]
mod tests {
    use super::{PIECES_LINES, is_printed, pieces_line, progress_line};

    #[test]
    fn a_pipe_gets_the_remaining_time_and_never_a_thousand_lines() {
        assert_eq!(pieces_line(0, 14, 0.0), "0 of 14 done");
        assert_eq!(progress_line("single effects", 0.25, 2.0), " 25 %  single effects, 6.0 s left");
        assert_eq!(progress_line("reading", 0.0, 2.0), "reading");
        // A third done in 20 s: the other two thirds take 40 s.
        assert_eq!(pieces_line(5, 15, 20.0), "5 of 15 done in 20 s, 40 s left");
        assert_eq!(pieces_line(15, 15, 62.0), "15 of 15 done in 62 s");
        for of in [1, 14, 200, 10_007] {
            let lines = (0..=of).filter(|done| is_printed(*done, of)).count();
            assert!(lines <= PIECES_LINES + 2 && is_printed(of, of), "{of}: {lines}");
        }
        assert_eq!((0..=14).filter(|done| is_printed(*done, 14)).count(), 15, "each of a few");
    }
}
