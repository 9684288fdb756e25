//! MDF, version 3: the `.dat` files of older measuring systems, as INCA writes them.

use crate::mdf::{MdfSource, check_channel_count, column, forward_rows, wanted_channels};
use falcon_mdf::mdf3::Mdf3File;
use mapper_recording::logs::{
    Group, Layout, Log, LogError, LogFile, LogFinding, LogFormat, LogOptions, RowSink,
};
use std::collections::BTreeSet;

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises, open, write: None };

const NAME: &str = "MDF3";

/// Maximum number of samples of a group: with all its channels it is decoded at once.
const MAX_SAMPLES: u32 = 20_000_000;

/// The identification block of a version before 4: its text is `3.30` and the like.
fn recognises(head: &[u8]) -> bool {
    let version = head.get(8..16).and_then(|text| std::str::from_utf8(text).ok());
    let major =
        version.and_then(|text| text.trim_matches(['\0', ' ']).split('.').next()?.parse::<u32>().ok());
    head.starts_with(b"MDF     ") && major.is_some_and(|major| major < 4)
}

/// Indices of a channel: data group, channel group, channel.
type ChannelIndex = (usize, usize, usize);

struct Mdf3 {
    path: LogFile,
    file: Mdf3File,
    layout: Layout,
    masters: Vec<ChannelIndex>,
    channels: Vec<ChannelIndex>,
    missing: Vec<f64>,
}

fn open(path: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    let failed = |error: falcon_mdf::error::Mf4Error| path.content_error(NAME, error.to_string());
    options.allow_only(&["missing"]).map_err(|why| path.content_error(NAME, why))?;
    let file = Mdf3File::from_source(MdfSource::open(path, NAME)?).map_err(failed)?;
    check_channel_count(path, NAME, file.channel_count())?;
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
            let clock_name = channel_group.channels.get(clock).map_or("", |channel| channel.name.as_str());
            layout.groups.push(Group {
                name: format!("group {}", layout.groups.len() + 1),
                clock: format!("`{clock_name}`, counts seconds"),
            });
            masters.push((data, number, clock));
            let mut names = BTreeSet::new();
            for (index, channel) in
                channel_group.channels.iter().enumerate().filter(|(index, _)| *index != clock)
            {
                let texts = [&*channel.name, &*channel.unit, &*channel.description];
                layout.columns.push(column(&mut names, texts, layout.groups.len() - 1));
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
        let values_of = |(data, group, channel): ChannelIndex| {
            let values = self.file.channel_physical(data, group, channel);
            values
                .map(|values| values.to_f64())
                .map_err(|error| self.path.content_error(NAME, error.to_string()))
        };
        for (group, master) in self.masters.iter().enumerate() {
            let channels = wanted_channels(&self.layout, wanted, &self.channels, group);
            if channels.is_empty() {
                continue;
            }
            let times_s = values_of(*master)?;
            let columns: Vec<Vec<f64>> =
                channels.into_iter().map(|channel| values_of(*channel)).collect::<Result<_, _>>()?;
            forward_rows(group, times_s.into_iter(), &columns, &self.missing, sink)?;
        }
        Ok(())
    }
}
