//! MDF, version 3: the `.dat` files of older measuring systems, as INCA writes them.

use crate::mdf_source::MdfSource;
use falcon_mdf::mdf3::Mdf3File;
use mapper_recording::logs::{
    Column, Group, Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, Row, RowSink,
};
use std::collections::BTreeMap;

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open };

const NAME: &str = "MDF3";

const MAX_CHANNELS: usize = 10_000;

/// Maximum number of samples of a group: with all its channels it is decoded at once.
const MAX_SAMPLES: u32 = 20_000_000;

/// The identification block of a version before 4: its text is `3.30` and the like.
fn recognises(head: &[u8]) -> bool {
    let version = head.get(8..16).and_then(|text| std::str::from_utf8(text).ok());
    let major =
        version.and_then(|text| text.trim_matches(['\0', ' ']).split('.').next()?.parse::<u32>().ok());
    head.starts_with(b"MDF     ") && major.is_some_and(|major| major < 4)
}

/// Indices of a column: data group, channel group, channel.
type Place = (usize, usize, usize);

struct Mdf3 {
    path: LogFile,
    file: Mdf3File,
    layout: Layout,
    masters: Vec<Place>,
    channels: Vec<Place>,
    missing: Vec<f64>,
}

fn open(path: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    let failed = |error: falcon_mdf::error::Mf4Error| path.content_error(NAME, error.to_string());
    options.allow_only(&["missing"]).map_err(|why| path.content_error(NAME, why))?;
    let file = Mdf3File::from_source(MdfSource::open(path, NAME)?).map_err(failed)?;
    if file.channel_count() > MAX_CHANNELS {
        let message = format!("it has {} channels; at most {MAX_CHANNELS} are read", file.channel_count());
        return Err(path.content_error(NAME, message));
    }
    let mut layout = Layout { start_time_ns: file.start_time_ns(), ..Layout::default() };
    let (mut masters, mut channels, mut without_clock) = (Vec::new(), Vec::new(), 0usize);
    for (data, group) in file.data_groups().iter().enumerate() {
        for (number, channel_group) in group.channel_groups.iter().enumerate() {
            let clock = channel_group.channels.iter().position(|channel| channel.is_time());
            let Some(clock) = clock else {
                without_clock += channel_group.channels.len();
                continue;
            };
            if channel_group.cycle_count == 0 || channel_group.channels.len() < 2 {
                continue;
            }
            if channel_group.cycle_count > MAX_SAMPLES {
                let message = format!(
                    "a group has {} samples; at most {MAX_SAMPLES} are read: split the file",
                    channel_group.cycle_count
                );
                return Err(path.content_error(NAME, message));
            }
            let words = channel_group.channels.get(clock).map_or("", |channel| channel.name.as_str());
            layout.groups.push(Group {
                name: format!("group {}", layout.groups.len() + 1),
                clock: format!("`{words}`, counts seconds"),
            });
            masters.push((data, number, clock));
            let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
            for (index, channel) in
                channel_group.channels.iter().enumerate().filter(|(index, _)| *index != clock)
            {
                let count = seen.entry(&channel.name).or_default();
                *count += 1;
                layout.columns.push(Column {
                    name: if *count > 1 {
                        format!("{} ({count})", channel.name)
                    } else {
                        channel.name.clone()
                    },
                    header: channel.name.clone(),
                    unit: Some(channel.unit.trim().to_owned()).filter(|unit| !unit.is_empty()),
                    description: channel.description.chars().take(200).collect(),
                    group: layout.groups.len() - 1,
                });
                channels.push((data, number, index));
            }
        }
    }
    if let [only] = layout.groups.as_mut_slice() {
        only.name = String::new();
    }
    if channels.is_empty() {
        return Err(path.content_error(NAME, "no group has a time channel and another one with samples"));
    }
    layout.findings.push(LogFinding::MdfVersion {
        version: file.version().trim().to_owned(),
        program: file.program().trim().to_owned(),
    });
    if without_clock > 0 {
        layout.findings.push(LogFinding::left_out(without_clock, "their groups have no time channel"));
    }
    Ok(Box::new(Mdf3 {
        path: path.clone(),
        file,
        layout,
        masters,
        channels,
        missing: options.missing.clone(),
    }))
}

impl Log for Mdf3 {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn rows(&mut self, wanted: &[usize], sink: &mut RowSink<'_>) -> Result<(), LogError> {
        let values_of = |(data, group, channel): Place| {
            let values = self.file.channel_physical(data, group, channel);
            values
                .map(|values| values.to_f64())
                .map_err(|error| self.path.content_error(NAME, error.to_string()))
        };
        for (group, master) in self.masters.iter().enumerate() {
            let of_group = |column: &&usize| {
                self.layout.columns.get(**column).is_some_and(|column| column.group == group)
            };
            let places: Vec<Place> = wanted
                .iter()
                .filter(of_group)
                .filter_map(|column| self.channels.get(*column))
                .copied()
                .collect();
            if places.is_empty() {
                continue;
            }
            let times_s = values_of(*master)?;
            let columns: Vec<Vec<f64>> = places.into_iter().map(values_of).collect::<Result<_, _>>()?;
            let mut values: Vec<f64> = Vec::new();
            for (row, t_s) in times_s.iter().enumerate() {
                values.clear();
                values.extend(columns.iter().map(|column| {
                    let value = column.get(row).copied().unwrap_or(f64::NAN);
                    if self.missing.contains(&value) { f64::NAN } else { value }
                }));
                sink(Row { group, t_s: *t_s, values: &values })?;
            }
        }
        Ok(())
    }
}
