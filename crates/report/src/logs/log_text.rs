//! The content of a log as a table, and a suggested channel map.

use crate::formatting::table::{COLUMNS, TextTable, with_heads};
use crate::formatting::wrapped::wrapped;
use mapper_recording::logs::proposal::{Ambient, Certainty, Proposal};
use mapper_recording::logs::{Layout, Survey, sparkline};
use std::fmt::Write;

/// Width of a trace, characters.
const TRACE: usize = 20;

/// Maximum number of listed gaps of a group.
const GAPS: usize = 5;

/// Findings, columns, gaps, and the suggestion with its certain and uncertain parts.
pub fn log_text(format: &str, layout: &Layout, survey: &Survey, proposal: &Proposal) -> String {
    let mut text = format!(
        "{format}, {} columns. Detected layout (in brackets: the option to override it, `--with KEY=VALUE`):\n",
        layout.columns.len()
    );
    for finding in &layout.findings {
        let _ = writeln!(text, "  {finding}");
    }
    text = wrapped(&text, COLUMNS, 4);
    for (index, (group, data)) in layout.groups.iter().zip(&survey.groups).enumerate() {
        let several = layout.groups.len() > 1;
        let name = if several { format!("Group {} `{}`", index + 1, group.name) } else { "Rows".to_owned() };
        let rate = if data.interval_s > 0.0 {
            format!(", {} Hz", significant(1.0 / data.interval_s, 3))
        } else {
            String::new()
        };
        let _ =
            write!(text, "\n{name}: {} from {:.3} s to {:.3} s{rate}", data.rows, data.first_s, data.last_s);
        if data.backward > 0 {
            let _ = write!(text, "; {} rows are not after the row before", data.backward);
        }
        let _ = match data.gap_count {
            0 => writeln!(text, ", no gaps."),
            1 => writeln!(text, ", 1 gap:"),
            count => writeln!(text, ", {count} gaps:"),
        };
        for gap in data.gaps.iter().take(GAPS) {
            let _ =
                writeln!(text, "  {:.3} s to {:.3} s ({:.1} s)", gap.from_s, gap.to_s, gap.to_s - gap.from_s);
        }
    }
    let _ = writeln!(text, "\n{}", columns(layout, survey, proposal));
    text.push_str(&wrapped(&proposal_text(layout, proposal), COLUMNS, 4));
    text
}

fn columns(layout: &Layout, survey: &Survey, proposal: &Proposal) -> TextTable {
    let several = layout.groups.len() > 1;
    let mut head = vec!["column", "unit", "min", "max", "empty", "trace", "channel"];
    if several {
        head.insert(0, "group");
    }
    let texts =
        (0..head.len()).filter(|index| ["unit", "trace", "channel", "column"].contains(&head[*index]));
    let mut table = with_heads(&head).with_texts(texts);
    for (index, (column, data)) in layout.columns.iter().zip(&survey.columns).enumerate() {
        let is_ambient =
            matches!(&proposal.ambient, Some(Ambient::Column { column, .. }) if *column == index);
        let without_channel = if is_ambient { "ambient pressure".to_owned() } else { String::new() };
        let channel = proposal.channel_of_column(index).map_or(without_channel, |proposed| {
            let mark = match proposed.certainty {
                Certainty::Sure => "",
                Certainty::Likely => " (likely)",
                Certainty::Unsure => " ?",
            };
            format!("{}{mark}", proposed.channel.symbol())
        });
        let total = data.count + data.missing;
        let empty = match data.missing {
            0 => String::new(),
            missing if missing == total => "all".to_owned(),
            missing => format!("{:.1} %", 100.0 * missing as f64 / total as f64),
        };
        let mut row = vec![
            cut(&column.name),
            column.unit.clone().unwrap_or_default(),
            significant(data.min, 5),
            significant(data.max, 5),
            empty,
            sparkline(&data.trace.means(), TRACE),
            channel,
        ];
        if several {
            row.insert(0, (column.group + 1).to_string());
        }
        table.add_row(row);
    }
    table
}

/// The suggestion: channels with a remark, and the relations between channels.
fn proposal_text(layout: &Layout, proposal: &Proposal) -> String {
    let mut text = String::new();
    let symbols_of = |certainty: Certainty| -> Vec<&str> {
        proposal
            .channels
            .iter()
            .filter(|proposed| proposed.certainty == certainty)
            .map(|proposed| proposed.channel.symbol())
            .collect()
    };
    let list = |names: Vec<&str>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let _ = writeln!(text, "\nProposed channel map\n  sure: {}", list(symbols_of(Certainty::Sure)));
    let _ = writeln!(text, "  likely: {}", list(symbols_of(Certainty::Likely)));
    let _ = writeln!(text, "  not sure, kept as comments: {}", list(symbols_of(Certainty::Unsure)));
    for proposed in proposal.channels.iter().filter(|proposed| !proposed.remarks.is_empty()) {
        let name = layout.columns.get(proposed.column).map_or("", |column| column.name.as_str());
        let _ = writeln!(text, "  {} (`{name}`): {}", proposed.channel, proposed.remarks_text());
    }
    let gauge: Vec<&str> = proposal
        .channels
        .iter()
        .filter(|proposed| proposed.gauge)
        .map(|proposed| proposed.channel.symbol())
        .collect();
    match &proposal.ambient {
        None => {}
        Some(Ambient::Column { column, .. }) => {
            let name = layout.columns.get(*column).map_or("", |column| column.name.as_str());
            let _ = writeln!(text, "  gauge pressures: {}, over `{name}`", gauge.join(", "));
        }
        Some(Ambient::Assumed) => {
            let _ = writeln!(
                text,
                "  gauge pressures: {}; the log has no ambient pressure, so 101.3 kPa is assumed; write the reading of the \
                 barometer",
                gauge.join(", ")
            );
        }
    }
    for remark in &proposal.remarks {
        let _ = writeln!(text, "  {remark}");
    }
    text
}

/// A name shortened for a table.
fn cut(name: &str) -> String {
    let clean: String = name.chars().take(40).map(|c| if c.is_control() { '?' } else { c }).collect();
    if name.chars().count() > 40 { format!("{clean}...") } else { clean }
}

/// A number with this many significant digits; `-` for a missing one.
fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let size = value.abs();
    if size >= 1e9 || size > 0.0 && size < 1e-4 {
        return format!("{value:.*e}", digits - 1);
    }
    let before = if size >= 1.0 { size.log10().floor() as usize + 1 } else { 1 };
    let text = format!("{value:.*}", digits.saturating_sub(before));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}
