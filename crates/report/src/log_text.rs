//! The content of a log, and a suggested channel map.

use crate::document::{Document, Table};
use mapper_recording::logs::proposal::{Ambient, Certainty, Proposal};
use mapper_recording::logs::{Layout, Restart, Survey, sparkline};

/// Width of a trace, characters.
const TRACE: usize = 20;

/// Maximum number of listed gaps of a group.
const GAPS: usize = 5;

/// Findings, columns, gaps, and the suggestion with its certain and uncertain parts.
pub fn log_contents(format: &str, layout: &Layout, survey: &Survey, proposal: &Proposal) -> Document {
    let mut document = Document::default();
    document.text(format!(
        "{format}, {} columns. Detected layout (in brackets: the option to override it, `--with KEY=VALUE`):",
        layout.columns.len()
    ));
    document.list(layout.findings.iter().map(ToString::to_string));
    for (index, (group, data)) in layout.groups.iter().zip(&survey.groups).enumerate() {
        let several = layout.groups.len() > 1;
        let name = if several { format!("Group {} `{}`", index + 1, group.name) } else { "Rows".to_owned() };
        let rate = if data.interval_s > 0.0 {
            format!(", {} Hz", significant(1.0 / data.interval_s, 3))
        } else {
            String::new()
        };
        let backward = match (data.restart, data.backward) {
            // Its own sentence says more.
            (Some(_), _) | (None, 0) => String::new(),
            (None, rows) => format!("; {rows} rows are not after the row before"),
        };
        let gaps = match data.gap_count {
            0 => "no gaps.".to_owned(),
            1 => "1 gap:".to_owned(),
            count => format!("{count} gaps:"),
        };
        document.text(format!(
            "{name}: {} from {:.3} s to {}{:.3} s{rate}{backward}, {gaps}",
            data.rows,
            data.first_s,
            data.restart.map_or_else(String::new, |Restart { from_s, to_s, .. }| {
                format!("{from_s:.3} s, and again from {to_s:.3} s to ")
            }),
            data.last_s
        ));
        document.text(data.restart.map_or_else(String::new, |restart| restart.describe("")));
        document.list(
            data.gaps.iter().take(GAPS).map(|gap| {
                format!("{:.3} s to {:.3} s ({:.1} s)", gap.from_s, gap.to_s, gap.to_s - gap.from_s)
            }),
        );
    }
    document.table(columns(layout, survey, proposal));
    document.section("Proposed channel map", proposed_map(layout, proposal));
    document
}

fn columns(layout: &Layout, survey: &Survey, proposal: &Proposal) -> Table {
    let several = layout.groups.len() > 1;
    let mut head = vec!["column", "unit", "min", "max", "empty", "trace", "channel"];
    if several {
        head.insert(0, "group");
    }
    let texts =
        (0..head.len()).filter(|index| ["unit", "trace", "channel", "column"].contains(&head[*index]));
    let mut table = Table::new(&head).with_texts(texts);
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
        table.row(row);
    }
    table
}

fn proposed_map(layout: &Layout, proposal: &Proposal) -> Document {
    let list = |names: Vec<&str>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let symbols_of = |certainty: Certainty| {
        let channels = proposal.channels.iter().filter(|proposed| proposed.certainty == certainty);
        list(channels.map(|proposed| proposed.channel.symbol()).collect())
    };
    let name_of = |column: usize| layout.columns.get(column).map_or("", |column| column.name.as_str());
    let mut lines = vec![
        format!("sure: {}", symbols_of(Certainty::Sure)),
        format!("likely: {}", symbols_of(Certainty::Likely)),
        format!("not sure, kept as comments: {}", symbols_of(Certainty::Unsure)),
    ];
    for proposed in proposal.channels.iter().filter(|proposed| !proposed.remarks.is_empty()) {
        lines.push(format!(
            "{} (`{}`): {}",
            proposed.channel,
            name_of(proposed.column),
            proposed.remarks_text()
        ));
    }
    let gauge = proposal.channels.iter().filter(|proposed| proposed.gauge);
    let gauge = gauge.map(|proposed| proposed.channel.symbol()).collect::<Vec<_>>().join(", ");
    match &proposal.ambient {
        None => {}
        Some(Ambient::Column { column, .. }) => {
            lines.push(format!("gauge pressures: {gauge}, over `{}`", name_of(*column)));
        }
        Some(Ambient::Assumed) => lines.push(format!(
            "gauge pressures: {gauge}; the log has no ambient pressure, so 101.3 kPa is assumed; write the reading of the barometer"
        )),
    }
    lines.extend(proposal.remarks.iter().map(ToString::to_string));
    let mut document = Document::default();
    document.list(lines);
    document
}

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
