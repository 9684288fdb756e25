//! `calibration:` of a sensor, and of the campaign.

use crate::checking::Check;
use mapper_yaml::{FindingKind, Step, steps};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether every sensor needs a valid calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CalibrationRule {
    /// An expired calibration, or a reading outside the calibrated range, is a warning.
    #[default]
    Optional,
    /// Every sensor must have a calibration with its due day and range; a contradiction is an error.
    Required,
}

impl CalibrationRule {
    pub(crate) fn is_optional(&self) -> bool {
        *self == CalibrationRule::Optional
    }
}

/// A day, written year-month-day, e.g. `2026-09-01`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(inline, extend("pattern" = r"^[0-9]{4}-[0-9]{2}-[0-9]{2}$", "examples" = ["2026-09-01"]))]
pub struct Date(jiff::civil::Date);

impl Date {
    /// The day in UTC of a time in nanoseconds since 1970; `None` for 0, the start of simulated time.
    pub fn from_epoch_ns(ns: u64) -> Option<Date> {
        let seconds = i64::try_from(ns / 1_000_000_000).ok().filter(|seconds| *seconds > 0)?;
        let instant = jiff::Timestamp::from_second(seconds).ok()?;
        Some(Date(instant.to_zoned(jiff::tz::TimeZone::UTC).date()))
    }
}

impl std::str::FromStr for Date {
    type Err = jiff::Error;

    fn from_str(text: &str) -> Result<Date, jiff::Error> {
        text.parse().map(Date)
    }
}

impl TryFrom<String> for Date {
    type Error = jiff::Error;

    fn try_from(text: String) -> Result<Date, jiff::Error> {
        text.parse()
    }
}

impl From<Date> for String {
    fn from(date: Date) -> String {
        date.to_string()
    }
}

impl std::fmt::Display for Date {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// Calibration of a sensor, according to its certificate.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CalibrationFile<R, U> {
    /// Number of the certificate.
    certificate: Option<String>,
    /// Laboratory that issued the certificate.
    laboratory: Option<String>,
    /// Day of the calibration.
    date: Date,
    /// Last day of validity; without it the calibration does not expire.
    due: Option<Date>,
    /// Calibrated range of readings.
    range: Option<RangeFile<R>>,
    /// Expanded uncertainty on the certificate, k = 2. The declared offset and gain must not be smaller.
    uncertainty: Option<U>,
}

/// Calibrated range of readings.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RangeFile<R> {
    /// Lowest calibrated reading.
    min: R,
    /// Highest calibrated reading.
    max: R,
}

/// Calibration of a sensor, in the channel's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Number of the certificate.
    pub certificate: Option<String>,
    /// Laboratory that issued the certificate.
    pub laboratory: Option<String>,
    /// Day of the calibration.
    pub date: Date,
    /// Last day of validity.
    pub due: Option<Date>,
    /// Calibrated range of readings, lowest and highest.
    pub range: Option<(f64, f64)>,
    /// Expanded uncertainty on the certificate, k = 2.
    pub uncertainty: Option<f64>,
}

impl Calibration {
    /// A calibration with only its day.
    pub(crate) fn from_date(date: Date) -> Self {
        Calibration { certificate: None, laboratory: None, date, due: None, range: None, uncertainty: None }
    }

    /// Whether the calibration has more data than its day.
    pub fn is_certified(&self) -> bool {
        *self != Calibration::from_date(self.date)
    }
}

impl<R: Clone + Into<f64>, U: Clone + Into<f64>> CalibrationFile<R, U> {
    pub(crate) fn calibration(&self) -> Calibration {
        let range = self.range.clone();
        Calibration {
            certificate: self.certificate.clone(),
            laboratory: self.laboratory.clone(),
            date: self.date,
            due: self.due,
            range: range.map(|range| (range.min.into(), range.max.into())),
            uncertainty: self.uncertainty.clone().map(Into::into),
        }
    }
}

/// Checks the days of a sensor's calibration.
pub(crate) fn check(check: &mut Check<'_>, calibration: &[Step]) {
    let at = |key: &str| [calibration, &steps![key]].concat();
    let (date, due) = (check_date(check, &at("date")), check_date(check, &at("due")));
    if let (Some(date), Some(due)) = (date, due)
        && due < date
    {
        let message = format!("the calibration is due on {due}, before its day {date}");
        check.note(FindingKind::Conflict, &at("due"), message, "exchange the days, or correct one");
    }
}

/// Reads the day at a place, and notes a day that does not exist. The schema checks the form.
pub(crate) fn check_date(check: &mut Check<'_>, steps: &[Step]) -> Option<Date> {
    let text = check.text(steps)?;
    let date = text.parse().ok();
    let has_form = text.len() == 10
        && text.bytes().enumerate().all(|(place, byte)| match place {
            4 | 7 => byte == b'-',
            _ => byte.is_ascii_digit(),
        });
    if date.is_none() && has_form {
        let message = format!("`{text}` is not a calendar date");
        let remedy = "write year-month-day, e.g. `2026-09-01`";
        check.note(FindingKind::WrongValue, steps, message, remedy);
    }
    date
}
