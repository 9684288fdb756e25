//! The user's options for a log, for properties that automatic detection gets wrong.

use mapper_table::{DateOrder, TextEncoding};
use mapper_yaml::keys::{Key, KeyError, set_key, store};
use mapper_yaml::units::{Kind, parse};

/// Properties of a log that the user states; the reader detects the others.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LogOptions {
    /// Character between the cells of a line; a blank matches any number of blanks.
    pub separator: Option<char>,
    /// Decimal sign: `.` or `,`.
    pub decimal: Option<char>,
    /// Character encoding.
    pub encoding: Option<TextEncoding>,
    /// Row of the names, from 1; empty rows do not count.
    pub names_row: Option<usize>,
    /// Row of the units, from 1; 0 if there is none.
    pub units_row: Option<usize>,
    /// First row of data, from 1.
    pub data_row: Option<usize>,
    /// Columns of the clock: one, or one with the date and one with the time of day.
    pub time: Vec<String>,
    /// Unit of a counting clock, s.
    pub time_unit_s: Option<f64>,
    /// Order of the parts of a date.
    pub date_order: Option<DateOrder>,
    /// Samples per second of a log without a clock, Hz, > 0.
    pub rate_hz: Option<f64>,
    /// Sheet of a workbook.
    pub sheet: Option<String>,
    /// Values that mark missing readings, in the log's unit.
    pub missing: Vec<f64>,
}

/// Every key.
pub const OPTION_KEYS: [Key<LogOptions>; 12] = [
    Key {
        name: "separator",
        description: "Character between the cells of a line: a character, `tab` or `blank`.",
        example: ";",
        set: |options, text| store(&mut options.separator, separator(text)),
    },
    Key {
        name: "decimal",
        description: "Decimal sign: `.` or `,`.",
        example: ",",
        set: |options, text| {
            store(&mut options.decimal, one_char(text).filter(|sign| [',', '.'].contains(sign)))
        },
    },
    Key {
        name: "encoding",
        description: "Character encoding: utf-8, latin-1, utf-16le or utf-16be.",
        example: "latin-1",
        set: |options, text| store(&mut options.encoding, TextEncoding::of_name(text)),
    },
    Key {
        name: "names_row",
        description: "Row of the names, from 1; empty rows do not count.",
        example: "1",
        set: |options, text| store(&mut options.names_row, text.parse().ok().filter(|row| *row > 0)),
    },
    Key {
        name: "units_row",
        description: "Row of the units, from 1; 0 if there is none.",
        example: "2",
        set: |options, text| store(&mut options.units_row, text.parse().ok()),
    },
    Key {
        name: "data_row",
        description: "First row of data, from 1; empty rows do not count.",
        example: "3",
        set: |options, text| store(&mut options.data_row, text.parse().ok().filter(|row| *row > 0)),
    },
    Key {
        name: "time",
        description: "Column of the clock; a column of dates and one of times of day with ` + ` between them.",
        example: "Date + Time",
        set: |options, text| {
            options.time = text.split(" + ").map(|name| name.trim().to_owned()).collect();
            options.time.iter().all(|name| !name.is_empty()).then_some(())
        },
    },
    Key {
        name: "time_unit",
        description: "Unit of a clock that counts: s, ms, min or h.",
        example: "ms",
        set: |options, text| {
            store(&mut options.time_unit_s, parse(Kind::Duration, &format!("1 {text}")).ok())
        },
    },
    Key {
        name: "date_order",
        description: "Order of the parts of a date: day_first, month_first or year_first.",
        example: "day_first",
        set: |options, text| store(&mut options.date_order, date_order(text)),
    },
    Key {
        name: "rate",
        description: "Samples per second of a log without a clock.",
        example: "10 Hz",
        set: |options, text| {
            let rate_hz = parse(Kind::Frequency, text).ok().filter(|rate| *rate > 0.0);
            store(&mut options.rate_hz, rate_hz)
        },
    },
    Key {
        name: "sheet",
        description: "Sheet of a workbook; all sheets if none is named.",
        example: "Data",
        set: |options, text| store(&mut options.sheet, Some(text.to_owned())),
    },
    Key {
        name: "missing",
        description: "Values that mark missing readings, with blanks between them.",
        example: "-9999",
        set: |options, text| {
            let values: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
            options.missing = values?;
            Some(())
        },
    },
];

fn one_char(text: &str) -> Option<char> {
    let mut chars = text.chars();
    chars.next().filter(|_| chars.next().is_none())
}

fn separator(text: &str) -> Option<char> {
    match text {
        "tab" | "\\t" => Some('\t'),
        "blank" => Some(' '),
        text => one_char(text).filter(char::is_ascii),
    }
}

fn date_order(text: &str) -> Option<DateOrder> {
    match text {
        "day_first" => Some(DateOrder::DayFirst),
        "month_first" => Some(DateOrder::MonthFirst),
        "year_first" => Some(DateOrder::YearFirst),
        _ => None,
    }
}

impl LogOptions {
    /// Sets one key.
    pub fn set(&mut self, key: &str, value: &str) -> Result<(), KeyError> {
        set_key(&OPTION_KEYS, self, key, value)
    }

    fn keys_set(&self) -> Vec<&'static str> {
        [
            ("separator", self.separator.is_some()),
            ("decimal", self.decimal.is_some()),
            ("encoding", self.encoding.is_some()),
            ("names_row", self.names_row.is_some()),
            ("units_row", self.units_row.is_some()),
            ("data_row", self.data_row.is_some()),
            ("time", !self.time.is_empty()),
            ("time_unit", self.time_unit_s.is_some()),
            ("date_order", self.date_order.is_some()),
            ("rate", self.rate_hz.is_some()),
            ("sheet", self.sheet.is_some()),
            ("missing", !self.missing.is_empty()),
        ]
        .into_iter()
        .filter_map(|(key, given)| given.then_some(key))
        .collect()
    }

    /// Checks that only keys that a format uses are set.
    pub fn allow_only(&self, used: &[&str]) -> Result<(), String> {
        match self.keys_set().into_iter().find(|key| !used.contains(key)) {
            Some(key) => Err(format!(
                "`{key}` does not apply to this format: delete it; the format's keys are {}",
                used.join(", ")
            )),
            None => Ok(()),
        }
    }

    /// Checks that no key that a format does not use is set.
    pub fn refuse_keys(&self, unused: &[&str]) -> Result<(), String> {
        let used: Vec<&str> =
            OPTION_KEYS.iter().map(|key| key.name).filter(|key| !unused.contains(key)).collect();
        self.allow_only(&used)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_that_a_format_does_not_use_are_refused() {
        for key in OPTION_KEYS {
            let mut options = LogOptions::default();
            options.set(key.name, key.example).unwrap();
            assert!(
                options.allow_only(&[key.name]).is_ok()
                    && options.allow_only(&["x"]).unwrap_err().contains(key.name)
            );
            assert!(options.refuse_keys(&[key.name]).is_err() && options.refuse_keys(&["x"]).is_ok());
        }
    }

    #[test]
    fn every_example_is_a_value_of_its_key_and_nonsense_is_none() {
        for key in OPTION_KEYS {
            LogOptions::default().set(key.name, key.example).unwrap();
        }
        for (key, value) in
            [("separator", "ab"), ("decimal", ";"), ("rate", "0 Hz"), ("names_row", "0"), ("x", "1")]
        {
            assert!(LogOptions::default().set(key, value).is_err(), "{key}: {value}");
        }
    }
}
