//! Dates and times of day in the notations of logs.

use jiff::civil::Date;
use mapper_logs::DateOrder;

/// Permitted years: the range of 64 bits in nanoseconds, and no log is older.
const YEARS: std::ops::RangeInclusive<i64> = 1970..=2200;

const NS_PER_S: i64 = 1_000_000_000;
/// Nanoseconds per day.
pub(crate) const NS_PER_DAY: i64 = 86_400 * NS_PER_S;

/// A date, a time of day, or both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Instant {
    /// Days since 1970-01-01.
    pub(crate) day: Option<i64>,
    /// Nanoseconds since midnight; times of another zone are shifted to UTC relative to `day`.
    pub(crate) ns_of_day: Option<i64>,
}

impl Instant {
    /// Nanoseconds since 1970-01-01, or since midnight without a date.
    pub(crate) fn ns(self) -> i64 {
        self.day.unwrap_or(0).saturating_mul(NS_PER_DAY).saturating_add(self.ns_of_day.unwrap_or(0))
    }
}

/// A date, a time of day, or both with a blank, `T` or `_` between them.
pub(crate) fn parse_instant(text: &str, order: DateOrder) -> Option<Instant> {
    let text = text.trim();
    if !text.starts_with(|c: char| c.is_ascii_digit()) || text.len() > 40 || !text.is_ascii() {
        return None;
    }
    let Some(end_of_first) = text.find([' ', 'T', '_']) else {
        return match date(text, order) {
            Some(day) => Some(Instant { day: Some(day), ns_of_day: None }),
            None => Some(Instant { day: None, ns_of_day: Some(time_of_day(text)?) }),
        };
    };
    let (first, rest) = (&text[..end_of_first], text[end_of_first + 1..].trim());
    match date(first, order) {
        Some(day) => Some(Instant { day: Some(day), ns_of_day: Some(time_of_day(rest)?) }),
        None => Some(Instant { day: None, ns_of_day: Some(time_of_day(text)?) }),
    }
}

/// The order of day, month and year in some dates, from their separators and numbers above 12.
pub(crate) fn guess_order<'a>(dates: impl Iterator<Item = &'a str>) -> (DateOrder, bool) {
    let mut doubtful = None;
    for text in dates {
        let Some((parts, sign)) = date_parts(text.trim().split([' ', 'T', '_']).next().unwrap_or_default())
        else {
            continue;
        };
        match (parts[0], parts[1], sign) {
            (first, ..) if first > 31 => return (DateOrder::YearFirst, true),
            (.., '.') => return (DateOrder::DayFirst, true),
            (first, ..) if first > 12 => return (DateOrder::DayFirst, true),
            (_, second, _) if second > 12 => return (DateOrder::MonthFirst, true),
            (.., '/') => doubtful = Some(DateOrder::MonthFirst),
            _ => {}
        }
    }
    (doubtful.unwrap_or(DateOrder::DayFirst), doubtful.is_none())
}

fn date_parts(text: &str) -> Option<([i64; 3], char)> {
    let sign = text.chars().find(|c| ['.', '/', '-'].contains(c))?;
    let mut parts = text.split(sign);
    let mut next = || {
        let part = parts.next()?;
        let whole = (1..=4).contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_digit());
        part.parse::<i64>().ok().filter(|_| whole)
    };
    let found = [next()?, next()?, next()?];
    parts.next().is_none().then_some((found, sign))
}

fn date(text: &str, order: DateOrder) -> Option<i64> {
    let ([a, b, c], _) = date_parts(text)?;
    let (year, month, day) = match order {
        _ if a > 31 => (a, b, c),
        DateOrder::YearFirst => (a, b, c),
        DateOrder::DayFirst => (c, b, a),
        DateOrder::MonthFirst => (c, a, b),
    };
    let year = if year < 100 { year + 2000 } else { year };
    if !YEARS.contains(&year) {
        return None;
    }
    let date =
        Date::new(i16::try_from(year).ok()?, i8::try_from(month).ok()?, i8::try_from(day).ok()?).ok()?;
    let epoch = Date::new(1970, 1, 1).ok()?;
    Some(i64::from(date.since(epoch).ok()?.get_days()))
}

/// `14:23:05.25`, also with a comma or a colon before the fraction, with AM or PM, with a zone.
fn time_of_day(text: &str) -> Option<i64> {
    let (text, zone_ns) = without_zone(text);
    let upper = text.to_ascii_uppercase();
    let (clock, afternoon) = match (upper.strip_suffix("AM"), upper.strip_suffix("PM")) {
        (Some(clock), _) => (clock, Some(false)),
        (_, Some(clock)) => (clock, Some(true)),
        _ => (upper.as_str(), None),
    };
    let mut parts = clock.trim().splitn(3, ':');
    let whole = |part: &str| -> Option<i64> {
        let digits = (1..=2).contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_digit());
        part.parse().ok().filter(|_| digits)
    };
    let (mut hour, minute) = (whole(parts.next()?)?, whole(parts.next()?)?);
    if let Some(afternoon) = afternoon {
        hour = hour % 12 + if afternoon { 12 } else { 0 };
    }
    let (second, fraction_ns) = match parts.next() {
        None => (0, 0),
        Some(rest) => match rest.find(['.', ',', ':']) {
            None => (whole(rest)?, 0),
            Some(at) => (whole(&rest[..at])?, nanoseconds(&rest[at + 1..])?),
        },
    };
    let fits = hour < 24 && minute < 60 && second <= 60;
    fits.then_some(((hour * 60 + minute) * 60 + second) * NS_PER_S + fraction_ns - zone_ns)
}

/// Text before a zone such as `Z` or `+01:00`, and the zone's offset.
fn without_zone(text: &str) -> (&str, i64) {
    if let Some(text) = text.strip_suffix(['Z', 'z']) {
        return (text, 0);
    }
    let Some(at) = text.rfind(['+', '-']) else { return (text, 0) };
    let sign = if text[at..].starts_with('-') { -1 } else { 1 };
    let digits: String = text[at + 1..].chars().filter(char::is_ascii_digit).collect();
    match (digits.len(), digits.parse::<i64>()) {
        (4, Ok(hhmm)) => (text[..at].trim(), sign * (hhmm / 100 * 60 + hhmm % 100) * 60 * NS_PER_S),
        (2, Ok(hours)) => (text[..at].trim(), sign * hours * 3600 * NS_PER_S),
        _ => (text, 0),
    }
}

/// Digits after a decimal sign, as nanoseconds.
fn nanoseconds(digits: &str) -> Option<i64> {
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let kept = digits.get(..9).unwrap_or(digits);
    let scale = u32::try_from(9 - kept.len()).ok()?;
    Some(kept.parse::<i64>().ok()? * 10i64.pow(scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_times_of_test_stands_mean_the_same_instant() {
        // 2026-11-22 14:03:05.25 is day 20 779 since 1970 (date +%s / 86400).
        let expected = 20_779 * NS_PER_DAY + ((14 * 60 + 3) * 60 + 5) * NS_PER_S + 250_000_000;
        for (text, order) in [
            ("2026-11-22 14:03:05.25", DateOrder::DayFirst),
            ("2026-11-22T14:03:05.250Z", DateOrder::YearFirst),
            ("22.11.2026 14:03:05,25", DateOrder::DayFirst),
            ("22.11.26_14:03:05.250000000", DateOrder::DayFirst),
            ("11/22/2026 2:03:05.25 PM", DateOrder::MonthFirst),
            ("2026-11-22 15:03:05.25+01:00", DateOrder::YearFirst),
        ] {
            assert_eq!(parse_instant(text, order).map(Instant::ns), Some(expected), "{text}");
        }
        assert_eq!(parse_instant("14:03", DateOrder::DayFirst).unwrap().ns(), (14 * 60 + 3) * 60 * NS_PER_S);
        for text in [
            "1.5",
            "12",
            "31.02.2026",
            "25:00:00",
            "1:2:3:4:5",
            "2026-13-01",
            "9026-11-22",
            "T2",
            "1.2.3.4",
            "",
        ] {
            assert_eq!(parse_instant(text, DateOrder::DayFirst), None, "{text}");
        }
    }

    #[test]
    fn the_order_of_a_date_is_seen_where_it_can_be() {
        let order = |texts: &[&str]| guess_order(texts.iter().copied());
        assert_eq!(order(&["03.04.2026"]), (DateOrder::DayFirst, true));
        assert_eq!(order(&["03/04/2026", "03/14/2026"]), (DateOrder::MonthFirst, true));
        assert_eq!(order(&["13/04/2026"]), (DateOrder::DayFirst, true));
        assert_eq!(order(&["03/04/2026"]), (DateOrder::MonthFirst, false));
        assert_eq!(order(&["2026/04/03"]), (DateOrder::YearFirst, true));
    }
}
