//! The registers of the rig.

use crate::blocks::{Block, blocks};
use crate::link::{Link, LinkError, Table};
use crate::settings::{SettingError, Settings, wrong};
use mapper_controller::{Controller, Reading, Target, rig};
use mapper_core::{Backend, BackendError, Channel};
use serde_json::Value;
use std::collections::BTreeMap;
use std::time::Duration;

/// Makes the rig; nothing is connected.
pub(crate) fn open(value: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let settings = Settings::read(value)?;
    let within = Duration::from_secs_f64(settings.timeout_s());
    let link = Link::new(settings.address, settings.unit, within)
        .map_err(|error| wrong("", SettingError::Form(serde::de::Error::custom(error))))?;
    let tables = [Table::Holding, Table::Input];
    let pieces = |table: Table| {
        let of_table = settings.read.values().filter(move |place| place.table == table);
        let pieces = of_table.map(|place| Block { start: place.register, count: place.form.count() });
        blocks(&pieces.collect::<Vec<_>>()).into_iter().map(move |block| (table, block))
    };
    let blocks = tables.into_iter().flat_map(pieces).collect();
    Ok(rig(settings.stand(), Registers { settings, link, blocks }))
}

struct Registers {
    settings: Settings,
    link: Link,
    blocks: Vec<(Table, Block)>,
}

/// Time for the values of one call, second tries included: the host waits for 2 s.
const WRITES_WITHIN: std::time::Duration = std::time::Duration::from_millis(1700);

/// Why the rig was lost.
#[derive(Debug, thiserror::Error)]
enum RegisterError {
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error(transparent)]
    Setting(#[from] SettingError),
}

impl Controller for Registers {
    type Error = RegisterError;

    fn open(&mut self) -> Result<(), RegisterError> {
        for (table, block) in self.blocks.clone() {
            self.link.read(table, block)?;
        }
        Ok(())
    }

    fn read(&mut self, _: f64) -> BTreeMap<Channel, Reading> {
        let mut all = BTreeMap::new();
        for (table, block) in self.blocks.clone() {
            match self.link.read(table, block) {
                Ok(registers) => {
                    all.extend((block.start..).zip(registers).map(|(at, value)| ((table, at), value)));
                }
                Err(LinkError::Refused { .. }) => {}
                // The others are not asked for: each would wait for its own deadline.
                Err(_) => break,
            }
        }
        let reading = |(channel, place): (&Channel, &crate::settings::Place)| {
            let words: Vec<u16> = (place.register..place.register + place.form.count())
                .filter_map(|at| all.get(&(place.table, at)).copied())
                .collect();
            (*channel, Reading::good(self.settings.value(place, &words)))
        };
        self.settings.read.iter().map(reading).collect()
    }

    fn write(&mut self, values: &[(Target, f64)]) -> Result<(), RegisterError> {
        let settings = &self.settings;
        self.link.together(WRITES_WITHIN, |link| {
            for (target, value) in values {
                let place = settings.place(*target);
                let registers = settings.registers(&place, *value);
                let registers = registers.ok_or(SettingError::DoesNotFit { value: *value })?;
                link.write(place.register, &registers)?;
            }
            Ok(())
        })
    }

    fn close(&mut self) {
        self.link.close();
    }
}
