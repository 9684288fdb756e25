//! The proposed channel map of a log, and its text.

use crate::logs::Layout;
use crate::logs::proposal::remark::ProposalRemark;
use mapper_core::Channel;
use serde::Serialize;
use serde_json::Value;
use std::fmt::Write;

/// Flow at surge and at choke of a machine at a shaft speed in rpm, kg/s.
pub type NominalFlows<'a> = &'a dyn Fn(f64) -> (f64, f64);

/// Certainty of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// Contradicted or ambiguous: written as a comment.
    Unsure,
    /// Some property was guessed.
    Likely,
    /// Name, unit and range agree.
    Sure,
}

/// A channel with its proposed column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProposedChannel {
    /// The channel.
    pub channel: Channel,
    /// Index of the column in the layout.
    pub column: usize,
    /// Columns of further sensors at the same place.
    pub others: Vec<usize>,
    /// Unit as written in a channel map; `None` if unknown.
    pub unit: Option<&'static str>,
    /// Whether it is a gauge pressure.
    pub gauge: bool,
    /// Certainty.
    pub certainty: Certainty,
    /// Reasons for the certainty, and assumptions.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub remarks: Vec<ProposalRemark>,
}

impl ProposedChannel {
    /// Its remarks on one line.
    pub fn remarks_text(&self) -> String {
        self.remarks.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    }
}

/// Reference of the gauge pressures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Ambient {
    /// A column.
    Column {
        /// Index of the column in the layout.
        column: usize,
        /// Its unit.
        unit: &'static str,
    },
    /// The standard atmosphere, since no column has the ambient pressure; the user replaces it by the barometer's reading.
    Assumed,
}

/// The proposed channel map of a log.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Proposal {
    /// Channels in the order of the channel table.
    pub channels: Vec<ProposedChannel>,
    /// Reference of gauge pressures; `None` if the log has no gauge pressure.
    pub ambient: Option<Ambient>,
    /// Results of the checks between channels.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub remarks: Vec<ProposalRemark>,
}

impl Proposal {
    /// The entry of a channel.
    pub fn entry(&self, channel: Channel) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.channel == channel)
    }

    /// The entry of a column.
    pub fn channel_of_column(&self, column: usize) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.column == column || proposed.others.contains(&column))
    }
}

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
