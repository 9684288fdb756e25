//! Results of the nights, as tables.

use crate::formatting::{number, table};
use mapper_history::{ListedRun, Metric, median};
use std::collections::BTreeMap;

/// A time of the history in UTC by a strftime format; a dash if it is not a time.
pub fn time(ms: i64, format: &str) -> String {
    jiff::Timestamp::from_millisecond(ms)
        .map_or_else(|_| "-".to_owned(), |time| time.strftime(format).to_string())
}

fn heads(first: &[&str], figures: &[Metric]) -> Vec<String> {
    let figure_heads = figures.iter().map(|figure| format!("{figure} {}", figure.display_unit().0));
    first.iter().map(|head| (*head).to_owned()).chain(figure_heads).collect()
}

fn format_metric(figure: Metric, value: Option<f64>) -> String {
    let decimals = match figure {
        Metric::GoodPoints | Metric::HMean | Metric::HTrueMean | Metric::RigMinutes => 1,
        _ => 3,
    };
    number::number(value.map(|value| figure.display_unit().1 * value), decimals)
}

fn state(listed: &ListedRun) -> &'static str {
    match (listed.night.accepted, listed.night.moved) {
        (true, _) => "accepted",
        (_, true) => "moved",
        _ => "",
    }
}

/// A row per night, campaign and method: medians over the seeds.
pub fn groups_text(runs: &[ListedRun], figures: &[Metric]) -> String {
    let mut groups: BTreeMap<(i64, i64, &str, &str), Vec<&ListedRun>> = BTreeMap::new();
    for listed in runs {
        let key = (
            listed.night.started_ms,
            listed.night.id,
            listed.run.key.campaign.as_str(),
            listed.run.key.method.as_str(),
        );
        groups.entry(key).or_default().push(listed);
    }
    let mut table =
        table::with_heads(&heads(&["night (UTC)", "campaign", "method", "seeds", "night is"], figures));
    for ((started_ms, _, campaign, method), group) in &groups {
        let mut row = vec![
            time(*started_ms, "%Y-%m-%d %H:%M"),
            (*campaign).to_owned(),
            (*method).to_owned(),
            group.len().to_string(),
            group.first().map(|listed| state(listed)).unwrap_or_default().to_owned(),
        ];
        row.extend(figures.iter().map(|figure| {
            format_metric(
                *figure,
                median(group.iter().filter_map(|listed| listed.run.figures.get(figure).copied())),
            )
        }));
        table.add_row(row);
    }
    format!("{table}\n\n{} rows of {} runs; figures are medians over the seeds.\n", groups.len(), runs.len())
}

/// A row per run.
pub fn runs_text(runs: &[ListedRun], figures: &[Metric]) -> String {
    let mut table =
        table::with_heads(&heads(&["night (UTC)", "campaign", "method", "seed", "night is"], figures));
    let mut failures = String::new();
    for listed in runs {
        let key = &listed.run.key;
        let started = time(listed.night.started_ms, "%Y-%m-%d %H:%M");
        if let Some(failure) = &listed.run.failure {
            failures.push_str(&format!("{started} {key} failed: {failure}\n"));
        }
        let mut row = vec![
            started,
            key.campaign.clone(),
            key.method.clone(),
            key.seed.to_string(),
            state(listed).to_owned(),
        ];
        row.extend(
            figures.iter().map(|figure| format_metric(*figure, listed.run.figures.get(figure).copied())),
        );
        table.add_row(row);
    }
    format!("{table}\n\n{failures}{} runs.\n", runs.len())
}

/// One run of a night for a program.
pub fn listed_run_json(listed: &ListedRun) -> serde_json::Value {
    let ListedRun { night, run } = listed;
    let figures: BTreeMap<&str, Option<f64>> =
        Metric::ALL.into_iter().map(|figure| (figure.name(), run.figures.get(&figure).copied())).collect();
    serde_json::json!({
        "night": {
            "id": night.id, "name": night.name, "started": time(night.started_ms, "%Y-%m-%dT%H:%M:%SZ"),
            "duration_s": night.duration_s, "program": night.program, "accepted": night.accepted, "moved": night.moved,
        },
        "campaign": run.key.campaign, "machine": run.key.machine, "method": run.key.method, "seed": run.key.seed,
        "campaign_sha256": run.campaign_sha256, "model_sha256": run.model_sha256,
        "failure": run.failure, "figures": figures,
    })
}
