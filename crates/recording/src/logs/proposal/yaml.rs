//! Writes a proposal as the text of a channel map.

use super::channel_proposal::{Ambient, Certainty, Proposal, ProposedChannel};
use crate::logs::Layout;
use serde_json::Value;
use std::fmt::Write;

/// The text of a channel map: certain and likely channels as entries, unsure ones as comments. `options` are the keys and values with
/// which the log was read.
pub fn channel_map_text(
    name: &str,
    layout: &Layout,
    proposal: &Proposal,
    options: &[(String, String)],
) -> String {
    let mut text = format!(
        "# Proposed channel map of {}. Entries with a remark are guesses:\n\
         # look at them. Lines that are comments are doubtful and count only without the `#`.\nchannels:\n",
        remark(name)
    );
    let kept = |proposed: &&ProposedChannel| proposed.certainty > Certainty::Unsure;
    if !proposal.channels.iter().any(|proposed| kept(&proposed)) {
        text.push_str(
            "  # no channel was recognised; write e.g.\n  # T2: {field: \"name of the column\", unit: degC}\n",
        );
    }
    for proposed in &proposal.channels {
        let mut line = format!("{}: {}", proposed.channel.symbol(), source(layout, proposed));
        if !proposed.remarks.is_empty() {
            let _ = write!(line, "  # {}", remark(&proposed.remarks_text()));
        }
        let _ = writeln!(text, "  {}{line}", if kept(&proposed) { "" } else { "# " });
    }
    match &proposal.ambient {
        None => {}
        Some(Ambient::Column { column, unit }) => {
            let _ = writeln!(
                text,
                "\n# Added to gauge pressures.\nambient_pressure: {{{}, unit: {unit}}}",
                place(layout, *column)
            );
        }
        Some(Ambient::Assumed) => {
            text.push_str(
                "\n# Added to gauge pressures. The log does not contain it: write the barometer's reading, e.g. 99.2 kPa, or\n\
                 # {altitude: 300 m}. `unknown` is 101.3 kPa with an uncertainty of 3 kPa.\n\
                 ambient_pressure: unknown\n",
            );
        }
    }
    if !options.is_empty() {
        text.push_str("\n# Options for reading the log.\nlog:\n");
        for (key, value) in options {
            let _ = writeln!(text, "  {key}: {}", quoted(value));
        }
    }
    text
}

fn source(layout: &Layout, proposed: &ProposedChannel) -> String {
    let mut text = if proposed.others.is_empty() {
        format!("{{{}", place(layout, proposed.column))
    } else {
        let columns = std::iter::once(&proposed.column).chain(&proposed.others);
        let names =
            columns.filter_map(|column| layout.columns.get(*column)).map(|column| scalar(&column.name));
        format!("{{{}field: [{}]", topic(layout, proposed.column), names.collect::<Vec<_>>().join(", "))
    };
    if let Some(unit) = proposed.unit {
        let _ = write!(text, ", unit: {}", scalar(unit));
    }
    if proposed.gauge {
        text.push_str(", gauge: true");
    }
    text.push('}');
    text
}

/// Topic (if the log has several groups) and field.
fn place(layout: &Layout, column: usize) -> String {
    let name = layout.columns.get(column).map_or("", |column| column.name.as_str());
    format!("{}field: {}", topic(layout, column), scalar(name))
}

/// The topic of a column, if the log has several groups.
fn topic(layout: &Layout, column: usize) -> String {
    let group = layout.columns.get(column).and_then(|column| layout.groups.get(column.group));
    match group {
        Some(group) if !group.name.is_empty() => format!("topic: {}, ", scalar(&group.name)),
        _ => String::new(),
    }
}

/// The text as a YAML scalar, in quotes unless it is a plain word.
fn scalar(text: &str) -> String {
    const WORDS: [&str; 9] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null"];
    let mut letters = text.chars();
    let normalise = letters.next().is_some_and(|first| first.is_ascii_alphabetic())
        && letters.all(|letter| letter.is_ascii_alphanumeric() || ['_', '/', '.', '^'].contains(&letter))
        && !WORDS.contains(&text.to_lowercase().as_str());
    if normalise { text.to_owned() } else { quoted(text) }
}

/// The text in JSON's quotes, which YAML reads too; YAML needs more characters escaped.
fn quoted(text: &str) -> String {
    let json = Value::from(text).to_string();
    let escaped = |c| if is_plain(c) { c.to_string() } else { format!("\\u{:04x}", u32::from(c)) };
    json.chars().map(escaped).collect()
}

/// The text as a comment on one line.
fn remark(text: &str) -> String {
    text.chars().map(|c| if is_plain(c) { c } else { ' ' }).collect()
}

/// Whether every YAML reader accepts a character unescaped within a line.
fn is_plain(c: char) -> bool {
    !c.is_control() && !matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}')
}
