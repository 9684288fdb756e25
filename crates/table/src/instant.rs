//! Dates and times of day in the notations of logs.

use jiff::civil::Date;

/// Permitted years. Bound: the range of 64 bits in nanoseconds, and no log is older.
const YEARS: std::ops::RangeInclusive<i64> = 1970..=2200;

/// Maximum length of a date with its time and zone, bytes. Bound: the longest notation has 35.
const MAX_TEXT_BYTES: usize = 40;

/// Number of days in [`YEARS`], the maximum of durations too. Source: the calendar.
const MAX_DAYS: i64 = 84_371;

/// Nanoseconds in a second. Source: a definition.
const NS_PER_S: i64 = 1_000_000_000;
/// Nanoseconds per day. Source: a definition.
pub const NS_PER_DAY: i64 = 86_400 * NS_PER_S;

/// The order of the parts of a date.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DateOrder {
    /// 22.11.2026.
    DayFirst,
    /// 11/22/2026.
    MonthFirst,
    /// 2026-11-22.
    YearFirst,
}

/// A date, a time of day, or both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Instant {
    /// Days since 1970-01-01.
    pub day: Option<i64>,
    /// Nanoseconds since midnight; times of another zone are shifted to UTC relative to `day`.
    pub ns_of_day: Option<i64>,
}

impl Instant {
    /// Nanoseconds since 1970-01-01, or since midnight without a date.
    pub fn ns(self) -> i64 {
        self.day.unwrap_or(0).saturating_mul(NS_PER_DAY).saturating_add(self.ns_of_day.unwrap_or(0))
    }
}

/// A date, a time of day, or both with a blank, `T` or `_` between them.
///
/// Also a date with the name of its month (`18-Nov-2025 10:20`), the day of the year before the time (`322:10:20:30`, as in IRIG
/// time codes), and days before it (`0 days 00:00:10`).
pub fn parse_instant(text: &str, order: DateOrder) -> Option<Instant> {
    let text = text.trim();
    if text.len() > MAX_TEXT_BYTES {
        return None;
    }
    // `2025年11月18日 09:30:00`
    if let Some((first, rest)) = text.split_once('日').filter(|_| text.contains('年')) {
        let time = rest.trim().replace(['时', '時', '分'], ":").replace('秒', "");
        let text = format!("{} {time}", first.replace(['年', '月'], "-"));
        return parse_instant(&text, DateOrder::YearFirst);
    }
    if let Some(instant) = named_month(text) {
        return Some(instant);
    }
    if !text.starts_with(|c: char| c.is_ascii_digit()) || !text.is_ascii() {
        return None;
    }
    if let Some(instant) = day_of_year(text).or_else(|| days_and_time(text)).or_else(|| compact(text)) {
        return Some(instant);
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

/// The first three letters of the months in English, German, French and Spanish; `jui` is the start of two French ones.
const MONTHS: [&[&str]; 12] = [
    &["jan", "ene"],
    &["feb", "fev"],
    &["mar", "mrz"],
    &["apr", "avr", "abr"],
    &["may", "mai"],
    &["jun", "juin"],
    &["jul", "juil"],
    &["aug", "aou", "ago"],
    &["sep"],
    &["oct", "okt"],
    &["nov"],
    &["dec", "dez", "dic"],
];

/// `18-Nov-2025`, `Nov 18, 2025` or `2025 Nov 18`, with or without a time of day after it.
fn named_month(text: &str) -> Option<Instant> {
    let (first, rest) = split_word(text)?;
    let (second, rest) = split_word(rest)?;
    let (third, rest) = split_word(rest)?;
    let (year, month, day) = match (month_of(first), month_of(second)) {
        (Some(month), _) => (third, month, second),
        (None, Some(month)) if first.len() == 4 => (first, month, third),
        (None, Some(month)) => (third, month, first),
        _ => return None,
    };
    let number = |word: &str| -> Option<i64> { word.parse().ok() };
    let (year, day) = (number(year)?, number(day)?);
    let year = if year < 100 { year + 2000 } else { year };
    let date = civil_day(year, month, day)?;
    let rest = rest.trim_start_matches(['T', '_', ' ']);
    let ns_of_day = if rest.is_empty() { None } else { Some(time_of_day(rest)?) };
    Some(Instant { day: Some(date), ns_of_day })
}

/// The digits or letters at the start of a text, and the rest after separators.
fn split_word(text: &str) -> Option<(&str, &str)> {
    let digits = text.starts_with(|c: char| c.is_ascii_digit());
    let ends = |c: char| if digits { !c.is_ascii_digit() } else { !c.is_alphabetic() };
    let end = text.find(ends).unwrap_or(text.len());
    let (word, rest) = text.split_at_checked(end)?;
    (!word.is_empty()).then(|| (word, rest.trim_start_matches([' ', '-', '/', '.', ','])))
}

fn month_of(word: &str) -> Option<i64> {
    let plain: String = word
        .to_lowercase()
        .chars()
        .map(|letter| match letter {
            'ä' => 'a',
            'é' => 'e',
            'û' => 'u',
            letter => letter,
        })
        .collect();
    let known = |names: &&[&str]| names.iter().any(|name| plain.starts_with(name));
    i64::try_from(MONTHS.iter().position(known)?).ok().map(|index| index + 1)
}

/// `322:10:20:30.5` without a year, `2025:322:10:20:30.5` and `2025-322T10:20:30.5` with one.
fn day_of_year(text: &str) -> Option<Instant> {
    let (date, time) = match text.matches(':').count() {
        2 => text.split_once(['T', ' '])?,
        3 => text.split_once(':')?,
        4 => {
            let (year, rest) = text.split_once(':')?;
            let (day, _) = rest.split_once(':')?;
            text.split_at_checked(year.len() + 1 + day.len()).map(|(date, time)| (date, &time[1..]))?
        }
        _ => return None,
    };
    let (year, day) = match date.split_once([':', '-']) {
        Some((year, day)) => (Some(year.parse::<i16>().ok().filter(|_| year.len() == 4)?), day),
        None => (None, date),
    };
    let day = day.parse::<i64>().ok().filter(|number| day.len() == 3 && (1..=366).contains(number))?;
    let ns_of_day = time_of_day(time)?;
    Some(match year {
        Some(year) => {
            Instant { day: Some(civil_day(i64::from(year), 1, 1)? + day - 1), ns_of_day: Some(ns_of_day) }
        }
        // Without a year it is a count of days, not a date.
        None => Instant { day: None, ns_of_day: Some(day * NS_PER_DAY + ns_of_day) },
    })
}

/// `20261122140305` or `20261122140305.25`: date and time of day without separators.
fn compact(text: &str) -> Option<Instant> {
    let (digits, fraction) = text.split_once('.').unwrap_or((text, "0"));
    if digits.len() != 14 || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let part = |from: usize, to: usize| digits.get(from..to)?.parse::<i64>().ok();
    let day = civil_day(part(0, 4)?, part(4, 6)?, part(6, 8)?)?;
    let time = format!("{}:{}:{}.{fraction}", &digits[8..10], &digits[10..12], &digits[12..]);
    Some(Instant { day: Some(day), ns_of_day: Some(time_of_day(&time)?) })
}

/// `0 days 00:00:10.5`, as Python writes durations.
fn days_and_time(text: &str) -> Option<Instant> {
    let (days, rest) = text.split_once(' ')?;
    let time = rest.strip_prefix("days").or_else(|| rest.strip_prefix("day"))?;
    let days: i64 = days.parse().ok().filter(|days| (0..=MAX_DAYS).contains(days))?;
    let ns = time_of_day(time.trim_start_matches([',', ' ']))?;
    Some(Instant { day: None, ns_of_day: Some(days * NS_PER_DAY + ns) })
}

/// Minutes, and seconds with their fraction, as Excel writes times into text files (`mm:ss.0`), ns.
pub fn minutes_and_seconds(text: &str) -> Option<i64> {
    let (minute, rest) = text.trim().split_once(':')?;
    let (second, fraction) = rest.split_once(['.', ','])?;
    let whole = |part: &str| -> Option<i64> {
        let digits = part.len() == 2 && part.bytes().all(|byte| byte.is_ascii_digit());
        part.parse().ok().filter(|number| digits && *number < 60)
    };
    Some((whole(minute)? * 60 + whole(second)?) * NS_PER_S + nanoseconds(fraction)?)
}

/// The order of day, month and year in some dates, from their separators and numbers above 12.
pub fn guess_order<'a>(dates: impl Iterator<Item = &'a str>) -> (DateOrder, bool) {
    let mut doubtful = None;
    for text in dates {
        let Some((parts, separator)) =
            date_parts(text.trim().split([' ', 'T', '_']).next().unwrap_or_default())
        else {
            continue;
        };
        match (parts[0], parts[1], separator) {
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
    let separator = text.chars().find(|c| ['.', '/', '-'].contains(c))?;
    let mut parts = text.split(separator);
    let mut next = || {
        let part = parts.next()?;
        let whole = (1..=4).contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_digit());
        part.parse::<i64>().ok().filter(|_| whole)
    };
    let found = [next()?, next()?, next()?];
    parts.next().is_none().then_some((found, separator))
}

fn date(text: &str, order: DateOrder) -> Option<i64> {
    let ([a, b, c], _) = date_parts(text)?;
    let (year, month, day) = match order {
        _ if a > 31 => (a, b, c),
        DateOrder::YearFirst => (a, b, c),
        DateOrder::DayFirst => (c, b, a),
        DateOrder::MonthFirst => (c, a, b),
    };
    civil_day(if year < 100 { year + 2000 } else { year }, month, day)
}

fn civil_day(year: i64, month: i64, day: i64) -> Option<i64> {
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
    if let Some(ns) = minutes_and_seconds(clock) {
        return afternoon.is_none().then_some(ns - zone_ns);
    }
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
            ("22-Nov-2026 14:03:05.25", DateOrder::MonthFirst),
            ("Nov 22, 2026 2:03:05.25 PM", DateOrder::DayFirst),
            ("22 novembre 2026 14:03:05,25", DateOrder::DayFirst),
            ("22.Nov.26 14:03:05.25", DateOrder::DayFirst),
            ("2026-326T14:03:05.25", DateOrder::DayFirst),
            ("2026:326:14:03:05.25", DateOrder::DayFirst),
            ("2026年11月22日 14:03:05.25", DateOrder::DayFirst),
            ("2026年11月22日 14时03分05.25秒", DateOrder::DayFirst),
            ("20261122140305.25", DateOrder::DayFirst),
        ] {
            assert_eq!(parse_instant(text, order).map(Instant::ns), Some(expected), "{text}");
        }
        // 0 days, and day 2 of a year, without a date.
        let of_day = |text: &str| parse_instant(text, DateOrder::DayFirst).map(Instant::ns);
        assert_eq!(of_day("1 days 00:00:10.5"), Some(NS_PER_DAY + 10_500_000_000));
        assert_eq!(of_day("002:00:00:10.5"), Some(2 * NS_PER_DAY + 10_500_000_000));
        assert_eq!(of_day("20:30.5"), Some((20 * 60 + 30) * NS_PER_S + 500_000_000));
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
            "31-Feb-2026",
            "400:10:20:30",
            "Speed 1 2026",
            "5 days",
            "20261322140305",
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
