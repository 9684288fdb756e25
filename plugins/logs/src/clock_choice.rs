//! Finds the clocks of a table, selects the ones to read, and assigns columns to them.

use crate::clock::{
    Clock, GroupClock, NS_PER_HOUR, Sample, SampleRow, Spread, cells, count_unit_s, describe_unit,
    is_clock_name, restart_offset_ns,
};
use crate::table_head::HeadColumn;
use mapper_recording::logs::{Group, LogFinding, LogOptions};
use mapper_table::{
    DateOrder, Instant, NS_PER_DAY, guess_order, minutes_and_seconds, parse_instant, parse_number,
};

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Clocks {
    pub(crate) groups: Vec<(Group, GroupClock)>,
    /// Group of each column; `None` for clocks.
    pub(crate) group_of: Vec<Option<usize>>,
    pub(crate) findings: Vec<LogFinding>,
    /// Time 0 in nanoseconds since 1970, if there is a date.
    pub(crate) start_time_ns: Option<u64>,
}

/// Maximum count of a counter, s (eleven days); larger ones are dates since some epoch.
const MAX_COUNT_S: f64 = 1e6;

/// Minimum number of rows per step back: a recording may have been restarted.
const MIN_ROWS_PER_RESTART: usize = 20;

/// Maximum number of clocks in a table; further columns with clock names are data.
const MAX_CLOCKS: usize = 100;

#[derive(Debug, Clone)]
struct Candidate {
    clock: Clock,
    at: usize,
    readings_s: Vec<Option<f64>>,
    dated: bool,
}

impl Candidate {
    fn present(&self) -> impl Iterator<Item = f64> + '_ {
        self.readings_s.iter().flatten().copied()
    }

    fn first_s(&self) -> f64 {
        self.present().next().unwrap_or(0.0)
    }

    fn distinct(&self) -> usize {
        let mut readings: Vec<f64> = self.present().collect();
        readings.dedup();
        readings.len()
    }

    /// Whether the readings increase, except for a few restarts, or would do so in order of time.
    fn is_running(&self) -> bool {
        let readings: Vec<f64> = self.present().collect();
        // A clock with a resolution of seconds may be constant over these rows; a constant number is not a clock.
        let is_moving = readings.len() < 2 || readings.first() < readings.last();
        let is_running = MIN_ROWS_PER_RESTART * self.reversal_count() <= readings.len()
            && (is_moving || matches!(self.clock, Clock::Instant { .. }));
        is_running || self.is_disordered()
    }

    fn reversal_count(&self) -> usize {
        let readings: Vec<f64> = self.present().collect();
        readings.windows(2).filter(|pair| pair[1] < pair[0]).count()
    }

    /// Whether the rows are out of order: readings go back and are all different, but each quarter of the rows is later than the previous one,
    /// except near its ends.
    fn is_disordered(&self) -> bool {
        let readings: Vec<f64> = self.present().collect();
        let mut distinct = readings.clone();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        let quarter = readings.len() / 4;
        let middle = |of: &[f64]| {
            let mut of = of.to_vec();
            of.sort_by(f64::total_cmp);
            of.get(of.len() / 2).copied().unwrap_or(f64::NAN)
        };
        let middles: Vec<f64> = readings.chunks(quarter.max(1)).take(4).map(middle).collect();
        quarter >= 2
            && MIN_ROWS_PER_RESTART * self.reversal_count() > readings.len()
            && distinct.len() == readings.len()
            && middles.windows(2).all(|pair| pair[0] < pair[1])
    }

    fn resolution_s(&self) -> f64 {
        let readings: Vec<f64> = self.present().collect();
        readings
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .filter(|step| *step > 0.0)
            .fold(f64::INFINITY, f64::min)
    }

    fn has_pace_of(&self, other: &Candidate) -> bool {
        let tolerance_s = 1.01 * self.resolution_s().max(other.resolution_s()).min(60.0);
        self.readings_s.iter().zip(&other.readings_s).all(|pair| match pair {
            (Some(a), Some(b)) => ((a - self.first_s()) - (b - other.first_s())).abs() <= tolerance_s,
            (None, None) => true,
            _ => false,
        })
    }
}

pub(crate) fn choose_clocks(sample: &Sample<'_>, options: &LogOptions) -> Result<Clocks, String> {
    let mut clocks = Clocks { group_of: vec![Some(0); sample.columns.len()], ..Clocks::default() };
    let candidates = match (options.time.as_slice(), options.rate_hz) {
        ([], Some(rate_hz)) => {
            clocks.findings.push(LogFinding::Rate { rate_hz });
            let clock = Clock::Rate { interval_s: 1.0 / rate_hz };
            clocks.groups.push((
                Group::default(),
                GroupClock { clock, zero_s: 0.0, zero_ns: 0, spread: None, disordered: false },
            ));
            return Ok(clocks);
        }
        ([], None) => find_candidates(sample, options, &mut clocks.findings),
        (names, _) => vec![named_clock(names, sample, options)?],
    };
    let Some(first) = candidates.first() else {
        let names: Vec<&str> = sample.columns.iter().map(|column| column.name.as_str()).take(40).collect();
        return Err(format!(
            "no column is a clock; name it (`time`) or give the rate (`rate: 10 Hz`); if each row is a steady point, \
             `mapper map reduce` makes a map of the file; the columns are {}",
            names.join(", ")
        ));
    };
    // Clocks with the same pace belong to one group.
    let mut groups: Vec<Vec<&Candidate>> = vec![vec![first]];
    for candidate in &candidates[1..] {
        match groups.iter_mut().find(|group| group[0].has_pace_of(candidate)) {
            Some(group) => group.push(candidate),
            None => groups.push(vec![candidate]),
        }
    }
    let name_of = |candidate: &Candidate| {
        let names = candidate.clock.columns().into_iter().filter_map(|column| sample.columns.get(column));
        names.map(|column| column.name.as_str()).collect::<Vec<_>>().join(" + ")
    };
    for clock in candidates.iter().flat_map(|candidate| candidate.clock.columns()) {
        clocks.group_of[clock] = None;
    }
    let chosen: Vec<&Candidate> = groups.iter().map(|group| finest_clock(group)).collect();
    // Groups with clocks of different epochs are aligned at their first rows.
    let is_epoch = |candidate: &Candidate| candidate.first_s().abs() > MAX_COUNT_S || candidate.dated;
    let mixed = chosen.iter().any(|candidate| is_epoch(candidate) != is_epoch(chosen[0]));
    let common_s = chosen.iter().map(|candidate| candidate.first_s()).fold(f64::INFINITY, f64::min);
    let dated = groups
        .iter()
        .flatten()
        .find(|candidate| candidate.dated && matches!(candidate.clock, Clock::Instant { .. }));
    for (index, (group, candidate)) in groups.iter().zip(&chosen).enumerate() {
        let epoch = is_epoch(candidate) || matches!(candidate.clock, Clock::Instant { .. });
        let zero_s = if mixed {
            candidate.first_s()
        } else if epoch {
            common_s
        } else {
            0.0
        };
        let name = if groups.len() == 1 { String::new() } else { name_of(candidate) };
        let mut words = format!("`{}`", name_of(candidate));
        if let Clock::Count { unit_s, .. } = candidate.clock {
            words.push_str(&format!(", counts {}", describe_unit(unit_s)));
        }
        let spread = spread(candidate);
        if let Some(Spread { interval_s, rows, .. }) = spread {
            words.push_str(&format!(
                ", {rows} rows share each reading and are placed {interval_s:.3} s apart"
            ));
        }
        let disordered = candidate.is_disordered();
        if disordered {
            words.push_str(", rows are out of order and were sorted by it");
        }
        let others = group.iter().filter(|other| other.at != candidate.at);
        let others = others.map(|other| name_of(other)).collect();
        clocks.findings.push(LogFinding::Clock { group: name.clone(), clock: words.clone(), others });
        let zero_ns = (zero_s * 1e9).round();
        let clock = GroupClock {
            clock: candidate.clock.clone(),
            zero_s,
            zero_ns: exact_zero_ns(candidate, sample, zero_ns),
            spread,
            disordered,
        };
        clocks.groups.push((Group { name, clock: words }, clock));
        if index > 0 {
            let from = group.iter().map(|clock| clock.at).min().unwrap_or(candidate.at);
            for of in clocks.group_of.iter_mut().skip(from).flatten() {
                *of = index;
            }
        }
    }
    if mixed {
        clocks.findings.push(LogFinding::DifferentEpochs);
    }
    if let (Some(dated), Some((_, first))) = (dated, clocks.groups.first()) {
        let start_s = dated.first_s()
            - if matches!(first.clock, Clock::Count { .. }) {
                chosen[0].first_s() - first.zero_s
            } else {
                0.0
            };
        let before_s = first.spread.map_or(0.0, |spread| spread.interval_s * spread.missing_at_start as f64);
        let start_s = start_s + before_s;
        clocks.start_time_ns = (start_s > 0.0).then_some((start_s * 1e9) as u64);
    }
    Ok(clocks)
}

/// Time 0 of dates to the nanosecond: that of the first row.
fn exact_zero_ns(candidate: &Candidate, sample: &Sample<'_>, near_ns: f64) -> i64 {
    let first = sample.rows().find_map(|row| candidate.clock.instant_ns(&row));
    first.filter(|ns| (*ns as f64 - near_ns).abs() < 1e6).unwrap_or(near_ns as i64)
}

/// The clock with the most distinct readings; among equals a counter, then the first.
fn finest_clock<'a>(group: &[&'a Candidate]) -> &'a Candidate {
    let rank = |candidate: &Candidate| (candidate.distinct(), matches!(candidate.clock, Clock::Count { .. }));
    let mut best = group[0];
    for candidate in &group[1..] {
        if rank(candidate) > rank(best) {
            best = candidate;
        }
    }
    best
}

fn spread(candidate: &Candidate) -> Option<Spread> {
    let readings: Vec<f64> = candidate.present().collect();
    let runs: Vec<&[f64]> = readings.chunk_by(|a, b| a == b).collect();
    // The first and the last group may be incomplete.
    let whole = runs.get(1..runs.len().saturating_sub(1)).unwrap_or_default();
    let mut lengths: Vec<usize> = whole.iter().map(|run| run.len()).collect();
    lengths.sort_unstable();
    let rows = *lengths.get(lengths.len() / 2)?;
    let ticks: Vec<f64> = runs.windows(2).map(|pair| pair[1][0] - pair[0][0]).collect();
    let tick_s = ticks.iter().copied().filter(|tick| *tick > 0.0).fold(f64::INFINITY, f64::min);
    let missing_at_start = rows.saturating_sub(runs.first().map_or(0, |run| run.len()));
    let interval_s = tick_s / rows as f64;
    (rows >= 2 && tick_s.is_finite()).then_some(Spread { interval_s, rows, missing_at_start })
}

fn candidate(clock: Clock, at: usize, sample: &Sample<'_>, dated: bool) -> Candidate {
    let reading = |row: SampleRow<'_>| match &clock {
        Clock::Instant { .. } => clock.instant_ns(&row).map(|ns| ns as f64 / 1e9),
        _ => clock.count_s(&row),
    };
    let mut readings_s: Vec<Option<f64>> = sample.rows().map(reading).collect();
    if let Clock::Instant { period_ns, .. } = clock {
        add_restart_offsets(&mut readings_s, period_ns);
    }
    Candidate { clock, at, readings_s, dated }
}

fn add_restart_offsets(readings_s: &mut [Option<f64>], period_ns: i64) {
    let (mut added_ns, mut last_ns) = (0, None);
    for reading in readings_s.iter_mut().flatten() {
        let ns = (*reading * 1e9) as i64;
        added_ns += last_ns.map_or(0, |last| restart_offset_ns(last, ns, period_ns));
        last_ns = Some(ns);
        *reading += added_ns as f64 / 1e9;
    }
}

/// The period of a column, ns: an hour if no cell contains the hour, else a day.
fn period_ns(column: usize, sample: &Sample<'_>) -> i64 {
    let hourless = cells(column, sample).all(|cell| minutes_and_seconds(cell).is_some());
    if hourless { NS_PER_HOUR } else { NS_PER_DAY }
}

fn named_clock(names: &[String], sample: &Sample<'_>, options: &LogOptions) -> Result<Candidate, String> {
    let find = |name: &String| {
        let is = |column: &HeadColumn| column.name == *name || column.header == *name;
        sample
            .columns
            .iter()
            .position(is)
            .ok_or_else(|| format!("the column `{name}`, which `time` names, does not exist"))
    };
    let columns: Vec<usize> = names.iter().map(find).collect::<Result<_, _>>()?;
    let order = options.date_order.unwrap_or_else(|| order_of(columns[0], sample).0);
    let clock = match columns.as_slice() {
        [date, time] => {
            let (date, time) =
                if date_and_time_in(*time, sample, order).0 { (*time, *date) } else { (*date, *time) };
            candidate(
                Clock::Instant { date: Some(date), time, order, period_ns: NS_PER_DAY },
                date.min(time),
                sample,
                true,
            )
        }
        [column] if instant_share(*column, sample, order) > 0.5 => candidate(
            Clock::Instant { date: None, time: *column, order, period_ns: period_ns(*column, sample) },
            *column,
            sample,
            date_and_time_in(*column, sample, order).0,
        ),
        [column] => {
            let unit_s = options.time_unit_s.unwrap_or_else(|| count_unit_s(*column, sample));
            candidate(Clock::Count { column: *column, unit_s }, *column, sample, false)
        }
        _ => return Err("`time` names one column, or a date and a time of day".to_owned()),
    };
    if clock.present().next().is_none() {
        return Err(format!(
            "`{}`, which `time` names, contains neither numbers nor times",
            names.join(" + ")
        ));
    }
    Ok(clock)
}

fn find_candidates(
    sample: &Sample<'_>,
    options: &LogOptions,
    findings: &mut Vec<LogFinding>,
) -> Vec<Candidate> {
    let mut candidates: Vec<Candidate> = Vec::new();
    let mut dates: Vec<usize> = Vec::new();
    for (at, column) in sample.columns.iter().enumerate() {
        let (guessed, sure) = order_of(at, sample);
        let order = options.date_order.unwrap_or(guessed);
        if instant_share(at, sample, order) > 0.8 {
            let (has_date, has_time) = date_and_time_in(at, sample, order);
            if has_date && !sure && options.date_order.is_none() {
                findings.push(LogFinding::AmbiguousDate { column: column.name.clone() });
            }
            if !has_time {
                dates.push(at);
                continue;
            }
            let date = dates.pop().filter(|_| !has_date);
            let clock = Clock::Instant {
                date,
                time: at,
                order: date.map_or(order, |date| options.date_order.unwrap_or(order_of(date, sample).0)),
                period_ns: period_ns(at, sample),
            };
            candidates.push(candidate(clock, date.unwrap_or(at), sample, has_date || date.is_some()));
        } else if is_clock_name(column) {
            let unit_s = options.time_unit_s.unwrap_or_else(|| count_unit_s(at, sample));
            let count = candidate(Clock::Count { column: at, unit_s }, at, sample, false);
            if 2 * count.present().count() > sample.rows.len().min(4) {
                candidates.push(count);
            }
        }
    }
    candidates.retain(Candidate::is_running);
    candidates.truncate(MAX_CLOCKS);
    candidates
}

fn order_of(column: usize, sample: &Sample<'_>) -> (DateOrder, bool) {
    guess_order(cells(column, sample))
}

fn instant_share(column: usize, sample: &Sample<'_>, order: DateOrder) -> f64 {
    let (mut instants, mut all) = (0.0, 0.0);
    for cell in cells(column, sample) {
        all += 1.0;
        // Of numbers, only a date with its time counts: `20261122140305`.
        let is_whole = |instant: Instant| instant.day.is_some() && instant.ns_of_day.is_some();
        let is_number = || parse_number(cell.as_bytes(), sample.decimal).is_some();
        if parse_instant(cell, order).is_some_and(|instant| is_whole(instant) || !is_number()) {
            instants += 1.0;
        }
    }
    if all > 0.0 { instants / all } else { 0.0 }
}

fn date_and_time_in(column: usize, sample: &Sample<'_>, order: DateOrder) -> (bool, bool) {
    let first = cells(column, sample).find_map(|cell| parse_instant(cell, order)).unwrap_or_default();
    (first.day.is_some(), first.ns_of_day.is_some())
}
