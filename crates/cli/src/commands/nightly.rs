//! `mapper nightly`: full maps on the simulated rig, kept in a history and compared with the nights before.

use crate::arguments::NightlyArguments;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::nightly_run::NightlyRun;
use crate::{assembly_line, interrupt, output};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mapper_campaign::{CampaignError, Nightly, NightlyError};
use mapper_core::Method;
use mapper_history::{Comparison, History, Night, RunKey, RunRow};
use serde_json::json;
use std::fmt::Write;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Runs the night, appends it, says what moved.
pub fn nightly(arguments: &NightlyArguments) -> Result<(), Failure> {
    let nightly = mapper_campaign::load_nightly(&arguments.nightly).map_err(|error| match error {
        NightlyError::Read { .. } => Failure::new(Code::Failure, error),
        NightlyError::Mistakes(findings) => Failure::of_campaign(CampaignError::Mistakes(findings)),
    })?;
    let runs = prepare(&nightly)?;
    // Opened before the work: a history that cannot be written is known at once, not in the morning.
    let path = arguments.db.clone().unwrap_or_else(|| nightly.history.clone());
    let mut history = History::open(&path).map_err(|error| Failure::new(Code::Failure, error))?;
    let stop = interrupt::stop_flag()?;
    let started = jiff::Timestamp::now();
    let Some(rows) = run_all(&runs, arguments.jobs, &stop)? else {
        return Err(Failure::new(
            Code::Interrupted,
            "stopped by the operator; nothing was added to the history",
        ));
    };
    let night = Night {
        name: nightly.name.clone(),
        started_ms: started.as_millisecond(),
        duration_s: jiff::Timestamp::now().duration_since(started).as_secs_f64(),
        program: concat!("mapper ", env!("CARGO_PKG_VERSION")).to_owned(),
        accepted: arguments.accept,
        runs: rows,
    };
    let comparison =
        history.append(&night, nightly.nights).map_err(|error| Failure::new(Code::Failure, error))?;
    if arguments.json {
        output::print_json(&json!({
            "history": path,
            "night": night,
            "comparison": comparison,
            "quiet": comparison.is_quiet(),
        }))?;
    } else {
        output::print(&text(&night, &comparison, &path))?;
    }
    if comparison.is_quiet() || (arguments.accept && comparison.failed.is_empty()) {
        return Ok(());
    }
    let message =
        "tonight is not as the nights before; what is right after all is made the new band by `--accept`";
    Err(if arguments.json { Failure::told(Code::Moved) } else { Failure::new(Code::Moved, message) })
}

/// All runs of the night. Mistakes in its campaigns are shown before anything runs.
fn prepare(nightly: &Nightly) -> Result<Vec<NightlyRun>, Failure> {
    let mut runs: Vec<NightlyRun> = Vec::new();
    for group in &nightly.groups {
        let campaign = mapper_campaign::load(&group.campaign).map_err(Failure::of_campaign)?;
        if campaign.sequence.is_some() {
            return Err(Failure::new(
                Code::BadInput,
                format!(
                    "{}: a nightly run compares the same points night after night; a campaign whose steps come from a \
                     script may visit others, so that it cannot be one",
                    group.campaign.display()
                ),
            ));
        }
        let model = assembly_line::nominal_model(&campaign)?;
        let methods = if group.methods.is_empty() {
            vec![campaign.identification.method]
        } else {
            group.methods.iter().map(|name| method(name)).collect::<Result<_, _>>()?
        };
        let seeds = if group.seeds.is_empty() { vec![campaign.seed] } else { group.seeds.clone() };
        for method in methods {
            for &seed in &seeds {
                let mut campaign = campaign.clone();
                campaign.identification.method = method;
                campaign.seed = seed;
                let key = RunKey {
                    campaign: campaign.name.clone(),
                    machine: campaign.machine.name.clone(),
                    method: method.to_string(),
                    seed,
                };
                if runs.iter().any(|run| run.key == key) {
                    return Err(Failure::new(
                        Code::BadInput,
                        format!(
                            "{key} stands in the nightly campaign twice; campaigns need names of their own"
                        ),
                    ));
                }
                runs.push(NightlyRun { campaign, model: model.clone(), key });
            }
        }
    }
    Ok(runs)
}

/// A method as campaigns write it.
fn method(name: &str) -> Result<Method, Failure> {
    serde_json::from_value(json!(name))
        .map_err(|error| Failure::new(Code::BadInput, format!("`{name}` is no method: {error}")))
}

/// Runs everything on `jobs` threads (all cores where it is not given); `None` where the operator stopped it.
fn run_all(
    runs: &[NightlyRun],
    jobs: Option<usize>,
    stop: &AtomicBool,
) -> Result<Option<Vec<RunRow>>, Failure> {
    let failed = |error| {
        Failure::new(Code::Failure, format!("failed to make a directory for the recordings: {error}"))
    };
    let scratch = tempfile::Builder::new().prefix("mapper-nightly-").tempdir().map_err(failed)?;
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let jobs = jobs.unwrap_or(cores).clamp(1, runs.len().max(1));
    let bar = progress(runs.len());
    let next = AtomicUsize::new(0);
    let rows: Mutex<Vec<(usize, Option<RunRow>)>> = Mutex::new(Vec::new());
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(run) = runs.get(index) else { return Ok(()) };
            let directory = scratch.path().join(index.to_string());
            std::fs::create_dir(&directory).map_err(failed)?;
            let row = run.run(&directory, stop);
            // A recording has some megabytes: a night of them need not fit on the disk.
            let _ = std::fs::remove_dir_all(&directory);
            let stopped = row.is_none();
            rows.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((index, row));
            bar.inc(1);
            if stopped {
                return Ok(());
            }
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
        workers.into_iter().try_for_each(|worker| match worker.join() {
            Ok(result) => result,
            Err(_) => Err(Failure::new(Code::Failure, "a run of the night ended in a fault of the program")),
        })
    })?;
    bar.finish_and_clear();
    let mut rows = rows.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    rows.sort_by_key(|(index, _)| *index);
    Ok(rows.into_iter().map(|(_, row)| row).collect())
}

fn progress(runs: usize) -> ProgressBar {
    let target = if std::io::stderr().is_terminal() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    };
    let bar = ProgressBar::with_draw_target(Some(runs as u64), target);
    // A template that does not parse leaves the plain style.
    if let Ok(style) = ProgressStyle::with_template("[{wide_bar}] {pos}/{len} maps, {eta} left") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

/// The night for people.
fn text(night: &Night, comparison: &Comparison, path: &Path) -> String {
    let mut text = String::new();
    for (run, failure) in &comparison.failed {
        let _ = writeln!(text, "failed   {run}: {failure}");
    }
    for run in &comparison.missing {
        let _ = writeln!(text, "missing  {run}: the last nights had it");
    }
    for moved in &comparison.moved {
        let (unit, factor) = moved.figure.shown_unit();
        let value = moved.value.map_or_else(|| "-".to_owned(), |value| format!("{:.4}", factor * value));
        let _ = writeln!(
            text,
            "moved    {}: {} = {value} {unit}; it was {:.4} ({:.4} to {:.4}) in {} {}",
            moved.run,
            moved.figure,
            factor * moved.band.median,
            factor * moved.band.low,
            factor * moved.band.high,
            moved.band.nights,
            nights(moved.band.nights),
        );
    }
    for moved in &comparison.moved_points {
        let shift = |shift| moved.quantity.show_shift(shift, moved.mean_level);
        let _ = write!(
            text,
            "moved    {}: {} at {} of {} points, by {} in the mean",
            moved.run,
            moved.quantity.words(),
            moved.moved,
            moved.compared,
            shift(moved.mean_shift),
        );
        if let Some(largest) = &moved.largest {
            let by = moved.quantity.show_shift(largest.value - largest.band.median, largest.band.median);
            let _ = write!(text, ", most at {} ({by})", largest.place);
        }
        text.push('\n');
    }
    for sentence in &comparison.conclusions {
        let _ = writeln!(text, "{sentence}");
    }
    let points: usize = night.runs.iter().map(|run| run.points.len()).sum();
    let _ = writeln!(
        text,
        "{} maps, {points} points in {:.1} s, in {}.",
        night.runs.len(),
        night.duration_s,
        path.display()
    );
    let _ = match comparison.nights {
        0 => writeln!(text, "The first night: there is nothing to compare with yet."),
        count if comparison.is_quiet() => {
            writeln!(text, "Every figure lies in the band of the last {count} {}.", nights(count))
        }
        _ if night.accepted => writeln!(text, "Accepted: this night begins a new band."),
        _ => Ok(()),
    };
    text
}

fn nights(count: usize) -> &'static str {
    if count == 1 { "night" } else { "nights" }
}
