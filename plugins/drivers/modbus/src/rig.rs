//! The registers of the rig.

use crate::link::{Link, LinkError, Table};
use crate::registers::{Block, Order, group_registers};
use crate::settings::{RegisterSettings, SettingError, Settings, settings_error};
use mapper_controller::{Controller, Reading, Target, is_plausible, rig};
use mapper_core::{Backend, BackendError, Channel};
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::Duration;

pub(crate) fn open(value: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let settings = Settings::read(value)?;
    let within = Duration::from_secs_f64(settings.timeout_s());
    let link = Link::new(settings.address, settings.unit, within)
        .map_err(|error| settings_error("", SettingError::Form(serde::de::Error::custom(error))))?;
    let tables = [Table::Holding, Table::Input];
    let pieces = |table: Table| {
        let of_table = settings.read.values().filter(move |entry| entry.table == table);
        let pieces = of_table.map(|entry| Block { start: entry.register, count: entry.form.count() });
        group_registers(&pieces.collect::<Vec<_>>()).into_iter().map(move |block| (table, block))
    };
    let blocks = tables.into_iter().flat_map(pieces).collect();
    Ok(rig(settings.stand(), Registers { settings, link, blocks, last: BTreeMap::new() }))
}

struct Registers {
    settings: Settings,
    link: Link,
    blocks: Vec<(Table, Block)>,
    last: BTreeMap<(Table, u16), u16>,
}

impl Registers {
    fn last_words(&self, entry: &RegisterSettings) -> Vec<u16> {
        (entry.register..entry.register + entry.form.count())
            .filter_map(|at| self.last.get(&(entry.table, at)).copied())
            .collect()
    }

    /// An order that makes all readings of the last read plausible.
    fn find_plausible_order(&self) -> Option<(Order, Order)> {
        let both = [Order::Big, Order::Little];
        let orders = both.into_iter().flat_map(|words| both.map(|bytes| (words, bytes)));
        let fits = |(words, bytes): &(Order, Order)| {
            self.settings.read.iter().all(|(channel, entry)| {
                let value = entry.value(&self.last_words(entry), *words, *bytes);
                value.is_finite() && is_plausible(*channel, value)
            })
        };
        orders.into_iter().find(fits)
    }
}

/// Time for the writes of one call, retries included: the host waits for 2 s.
const WRITES_WITHIN: std::time::Duration = std::time::Duration::from_millis(1700);

#[derive(Debug, thiserror::Error)]
enum RegisterError {
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error(
        "{source}. The value was {key} = {value} (SI), written as {registers}: check `words` and `bytes`, `type`, `scale` and `offset` of \
                 `write.{key}`, and the range that the controller accepts"
    )]
    Written { source: Box<LinkError>, key: &'static str, value: f64, registers: String },
}

impl RegisterError {
    /// A controller may rightly refuse a value, so the error shows what was written.
    fn of_write(source: LinkError, target: Target, value: f64, registers: &[u16]) -> RegisterError {
        // The number of a heartbeat does not matter.
        if !matches!(source, LinkError::Refused { .. }) || target == Target::Heartbeat {
            return source.into();
        }
        let registers: Vec<_> = registers.iter().map(|word| format!("{word:#06x}")).collect();
        RegisterError::Written {
            source: Box::new(source),
            key: target.name(),
            value,
            registers: registers.join(" "),
        }
    }
}

impl Controller for Registers {
    type Error = RegisterError;

    fn open(&mut self) -> Result<(), RegisterError> {
        for (table, block) in self.blocks.clone() {
            self.link.read(table, block)?;
        }
        Ok(())
    }

    fn read(&mut self, _: f64) -> (BTreeMap<Channel, Reading>, Option<RegisterError>) {
        let mut all = BTreeMap::new();
        let mut failed = None;
        for (table, block) in self.blocks.clone() {
            match self.link.read(table, block) {
                Ok(registers) => {
                    all.extend((block.start..).zip(registers).map(|(at, value)| ((table, at), value)));
                }
                Err(refused @ LinkError::Refused { .. }) => failed = Some(refused),
                // The remaining registers are skipped: each would run into its own timeout.
                Err(error) => {
                    failed = Some(error);
                    break;
                }
            }
        }
        self.last = all;
        let reading = |(channel, entry): (&Channel, &RegisterSettings)| {
            let words = self.last_words(entry);
            let is_whole = words.len() == usize::from(entry.form.count());
            is_whole.then(|| (*channel, Reading::good(self.settings.value(entry, &words))))
        };
        (self.settings.read.iter().filter_map(reading).collect(), failed.map(RegisterError::from))
    }

    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), RegisterError> {
        let settings = &self.settings;
        self.link.write_group(WRITES_WITHIN, |link| {
            for (target, value) in values {
                let entry = settings.write.of(*target);
                let registers = settings.registers(entry, *value);
                let registers = registers.ok_or(SettingError::DoesNotFit { value: *value })?;
                let refused = |source| RegisterError::of_write(source, *target, *value, &registers);
                link.write(entry.register, &registers).map_err(refused)?;
            }
            Ok(())
        })
    }

    fn describe_source(&self, channel: Channel) -> String {
        let Some(entry) = self.settings.read.get(&channel) else { return "no register".to_owned() };
        let (words, bytes) = (self.settings.words.name(), self.settings.bytes.name());
        let order = format!("`words: {words}`, `bytes: {bytes}`");
        let holds: Vec<_> = self.last_words(entry).iter().map(|word| format!("{word:#06x}")).collect();
        format!(
            "register {} ({}, as {} with {order}, scale {}, offset {})",
            entry.register,
            holds.join(" "),
            entry.form.name(),
            entry.scale,
            entry.offset
        )
    }

    fn remedy(&self) -> String {
        match self.find_plausible_order() {
            Some((words, bytes)) => {
                let (words, bytes) = (words.name(), bytes.name());
                format!("With `words: {words}` and `bytes: {bytes}` all channels are plausible")
            }
            None => "Check `words` and `bytes`, and `register`, `type`, `scale` and `offset` of the channel"
                .to_owned(),
        }
    }

    fn close(&mut self) {
        self.link.close();
    }
}
