//! The history file, an SQLite database, and its errors.

use crate::{Comparison, Metric, Night, PointRow, RunKey, RunRow, compare};
use rusqlite::{Connection, OpenFlags, Transaction, TransactionBehavior, params};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

const APPLICATION_ID: i32 = 0x6d61_7072;
/// Version of the table layout.
const LAYOUT: i32 = 1;
/// Time to wait for a lock of another process. A night is written in milliseconds, so a longer lock is a fault.
const BUSY_TIMEOUT: Duration = Duration::from_secs(60);

/// A stored night, without its runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StoredNight {
    /// Number of the night, ascending.
    pub id: i64,
    /// Name of the nightly campaign.
    pub name: String,
    /// Start, ms since 1970-01-01 00:00 UTC.
    pub started_ms: i64,
    /// Wall-clock duration, s.
    pub duration_s: f64,
    /// Program and version.
    pub program: String,
    /// Whether it started a new band.
    pub accepted: bool,
    /// Whether a metric was outside its band.
    pub moved: bool,
}

/// A stored run with its night.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ListedRun {
    /// Its night.
    pub night: StoredNight,
    /// The run; without its points.
    #[serde(flatten)]
    pub run: RunRow,
}

/// Which runs are listed.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Filter {
    /// Of this machine or campaign only.
    pub machine: Option<String>,
    /// By this method only.
    pub method: Option<String>,
    /// Not older than this, ms since 1970-01-01 00:00 UTC.
    pub since_ms: Option<i64>,
}

/// An open history.
pub struct History {
    connection: Connection,
    path: PathBuf,
}

/// Rejects a pipe or a device, which SQLite would wait for.
fn check_plain(path: &Path) -> Result<(), HistoryError> {
    match mapper_yaml::open_file(path) {
        Err(error) if error.kind() == ErrorKind::InvalidInput => {
            Err(HistoryError::Foreign { path: path.to_owned(), reason: error.to_string() })
        }
        // SQLite reports any other problem.
        _ => Ok(()),
    }
}

impl History {
    /// Opens the history, creating it if it does not exist.
    pub fn open(path: &Path) -> Result<History, HistoryError> {
        if let Some(parent) = path.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            std::fs::create_dir_all(parent)
                .map_err(|source| HistoryError::Directory(parent.to_owned(), source))?;
        }
        check_plain(path)?;
        let mut history = Self::connect(path, OpenFlags::default())?;
        // Checked before the runs of a night, not only when their results are stored.
        let writable = history.prepare().and_then(|()| {
            // Writes a page to the rollback journal, so that a full disk is reported too.
            let transaction = history.connection.transaction_with_behavior(TransactionBehavior::Immediate);
            let written = transaction.and_then(|transaction| {
                transaction.pragma_update(None, "user_version", LAYOUT)?;
                transaction.rollback()
            });
            written.map_err(|source| HistoryError::of_sqlite(path, source))
        });
        match writable {
            Err(HistoryError::Sqlite(path, source)) if is_read_only(&source) => {
                Err(HistoryError::ReadOnly(path))
            }
            writable => writable.map(|()| history),
        }
    }

    /// Opens an existing history for reading.
    pub fn open_existing(path: &Path) -> Result<History, HistoryError> {
        if !path.exists() {
            return Err(HistoryError::Missing(path.to_owned()));
        }
        check_plain(path)?;
        // A night that a killed process did not finish is rolled back, which a read-only connection cannot do.
        let mut history =
            Self::connect(path, OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
        match history.prepare() {
            Err(HistoryError::NoSpace(_)) => Self::open_read_only(path),
            Err(HistoryError::Sqlite(_, source)) if is_read_only(&source) => Self::open_read_only(path),
            prepared => prepared.map(|()| history),
        }
    }

    /// Opens a history without writing anything. In a file with a write-ahead log, nights that only the log contains are not visible.
    pub fn open_read_only(path: &Path) -> Result<History, HistoryError> {
        let flags =
            OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        // Percent signs, question marks and hash marks have a meaning in a URI.
        let escaped = absolute.to_string_lossy().replace('%', "%25").replace('?', "%3f").replace('#', "%23");
        // The side files of a write-ahead log cannot be made; without one, a night that was not finished must not be read.
        let is_immutable = u8::from(has_write_ahead_log(path));
        let history = Self::connect(Path::new(&format!("file:{escaped}?immutable={is_immutable}")), flags)?;
        let mut history = History { path: path.to_owned(), ..history };
        history.prepare()?;
        Ok(history)
    }

    fn connect(path: &Path, flags: OpenFlags) -> Result<History, HistoryError> {
        let fail = |source| HistoryError::of_sqlite(path, source);
        let connection = Connection::open_with_flags(path, flags).map_err(fail)?;
        connection.busy_timeout(BUSY_TIMEOUT).map_err(fail)?;
        Ok(History { connection, path: path.to_owned() })
    }

    fn prepare(&mut self) -> Result<(), HistoryError> {
        let path = self.path.clone();
        let fail = |source: rusqlite::Error| match source.sqlite_error_code() {
            Some(rusqlite::ErrorCode::NotADatabase | rusqlite::ErrorCode::DatabaseCorrupt) => {
                HistoryError::Foreign { path: path.clone(), reason: source.to_string() }
            }
            _ => HistoryError::of_sqlite(&path, source),
        };
        let foreign = |reason: String| HistoryError::Foreign { path: path.clone(), reason };
        // A write-ahead log needs shared memory, which network file systems do not have, and room on the disk even for reading.
        let switched = if self.connection.is_readonly("main").map_err(fail)? {
            Ok(())
        } else {
            self.connection.pragma_update(None, "journal_mode", "DELETE")
        };
        if let Err(error) = switched
            && error.sqlite_error_code() != Some(rusqlite::ErrorCode::DatabaseBusy)
        {
            return Err(fail(error));
        }
        self.connection.pragma_update(None, "foreign_keys", true).map_err(fail)?;
        if read_layout(&self.connection).map_err(fail)? == (APPLICATION_ID, LAYOUT) {
            return Ok(());
        }
        let transaction =
            self.connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(fail)?;
        // Checked again under the lock, because another process may have created the tables in the meantime.
        let (application_id, layout) = read_layout(&transaction).map_err(fail)?;
        let tables: i64 = transaction
            .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
            .map_err(fail)?;
        match (application_id, layout) {
            (APPLICATION_ID, LAYOUT) => return Ok(()),
            (APPLICATION_ID, _) => {
                return Err(foreign(format!("its layout is {layout}; this program reads {LAYOUT}")));
            }
            _ if tables > 0 => return Err(foreign("it is a database of another program".to_owned())),
            _ => {}
        }
        transaction.execute_batch(include_str!("schema.sql")).map_err(fail)?;
        transaction.pragma_update(None, "application_id", APPLICATION_ID).map_err(fail)?;
        transaction.pragma_update(None, "user_version", LAYOUT).map_err(fail)?;
        transaction.commit().map_err(fail)
    }

    /// Reads, with the errors of this file.
    pub(crate) fn read<T>(
        &self,
        read: impl FnOnce(&Connection) -> rusqlite::Result<T>,
    ) -> Result<T, HistoryError> {
        read(&self.connection).map_err(|source| HistoryError::of_sqlite(&self.path, source))
    }

    /// Writes in one transaction.
    pub(crate) fn change<T>(
        &mut self,
        write: impl FnOnce(&Transaction<'_>) -> rusqlite::Result<T>,
    ) -> Result<T, HistoryError> {
        let transaction = self.connection.transaction_with_behavior(TransactionBehavior::Immediate);
        let written = transaction.and_then(|transaction| {
            let written = write(&transaction)?;
            transaction.commit()?;
            Ok(written)
        });
        written.map_err(|source| HistoryError::of_sqlite(&self.path, source))
    }

    /// Compares a night with the band of the last `nights` and appends it, in one transaction, at its start time or the next free millisecond.
    pub fn append(&mut self, night: &mut Night, nights: usize) -> Result<Comparison, HistoryError> {
        self.change(|transaction| append(transaction, night, nights))
    }
    /// Runs, oldest night first, without their points.
    pub fn runs(&self, filter: &Filter) -> Result<Vec<ListedRun>, HistoryError> {
        self.read(|connection| runs(connection, filter))
    }
}

fn runs(connection: &Connection, filter: &Filter) -> rusqlite::Result<Vec<ListedRun>> {
    let mut statement = connection.prepare(&format!(
        "SELECT n.id, n.name, n.started_ms, n.duration_s, n.program, n.accepted, n.moved, {RUN_COLUMNS}, {} \
             FROM run r JOIN night n ON n.id = r.night_id \
             WHERE (?1 IS NULL OR r.machine = ?1 OR r.campaign = ?1) AND (?2 IS NULL OR r.method = ?2) \
               AND (?3 IS NULL OR n.started_ms >= ?3) \
             ORDER BY n.started_ms, n.id, r.id",
        figure_columns("r.")
    ))?;
    statement
        .query_map(params![filter.machine, filter.method, filter.since_ms], |row| {
            let night = StoredNight {
                id: row.get(0)?,
                name: row.get(1)?,
                started_ms: row.get(2)?,
                duration_s: row.get(3)?,
                program: row.get(4)?,
                accepted: row.get(5)?,
                moved: row.get(6)?,
            };
            Ok(ListedRun { night, run: read_run_row(row, 7)? })
        })?
        .collect()
}

fn append(transaction: &Transaction<'_>, night: &mut Night, nights: usize) -> rusqlite::Result<Comparison> {
    let mut same_start = transaction.prepare("SELECT 1 FROM night WHERE started_ms = ?1")?;
    while same_start.exists([night.started_ms])? {
        night.started_ms += 1;
    }
    drop(same_start);
    let earlier = read_earlier_runs(transaction, &night.name, nights)?;
    let mut comparison = compare(night, &earlier);
    let stored: i64 =
        transaction
            .query_row("SELECT count(*) FROM night WHERE name = ?1", [&night.name], |row| row.get(0))?;
    comparison.stored_nights = usize::try_from(stored).unwrap_or_default();
    let moved = !comparison.is_quiet() && !night.accepted;
    transaction.execute(
            "INSERT INTO night (name, started_ms, duration_s, program, accepted, moved) VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
            params![night.name, night.started_ms, night.duration_s, night.program, night.accepted, moved],
        )?;
    let night_id = transaction.last_insert_rowid();
    {
        let mut insert_run = transaction.prepare(&insert_run())?;
        let mut insert_point =
            transaction.prepare("INSERT INTO point VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)")?;
        for run in &night.runs {
            let RunKey { campaign, machine, method, seed } = &run.key;
            let mut values: Vec<rusqlite::types::Value> = vec![
                night_id.into(),
                campaign.clone().into(),
                machine.clone().into(),
                method.clone().into(),
                // SQLite integers are signed; the bits are preserved.
                seed.cast_signed().into(),
                run.campaign_sha256.clone().into(),
                run.model_sha256.clone().into(),
                run.failure.clone().into(),
            ];
            values.extend(Metric::ALL.map(|figure| finite(run.figures.get(&figure).copied()).into()));
            insert_run.execute(rusqlite::params_from_iter(values))?;
            let run_id = transaction.last_insert_rowid();
            for point in &run.points {
                insert_point.execute(params![
                    run_id,
                    point.speed_rpm,
                    point.valve_opening_ratio,
                    i64::try_from(point.visit).unwrap_or(i64::MAX),
                    finite(point.eta),
                    finite(point.eta_true),
                    finite(point.h_w_m2k),
                    finite(point.h_true_w_m2k),
                ])?;
            }
        }
    }
    Ok(comparison)
}

fn read_layout(connection: &Connection) -> rusqlite::Result<(i32, i32)> {
    let read = |pragma| connection.pragma_query_value(None, pragma, |row| row.get(0));
    Ok((read("application_id")?, read("user_version")?))
}

fn read_point_row(row: &rusqlite::Row<'_>, first: usize) -> rusqlite::Result<PointRow> {
    Ok(PointRow {
        speed_rpm: row.get(first)?,
        valve_opening_ratio: row.get(first + 1)?,
        visit: usize::try_from(row.get::<_, i64>(first + 2)?).unwrap_or_default(),
        eta: row.get(first + 3)?,
        eta_true: row.get(first + 4)?,
        h_w_m2k: row.get(first + 5)?,
        h_true_w_m2k: row.get(first + 6)?,
    })
}

const RUN_COLUMNS: &str =
    "r.campaign, r.machine, r.method, r.seed, r.campaign_sha256, r.model_sha256, r.failure";

fn figure_columns(prefix: &str) -> String {
    Metric::ALL.map(|figure| format!("{prefix}{}", figure.name())).join(", ")
}

fn insert_run() -> String {
    let marks: Vec<String> = (1..=8 + Metric::ALL.len()).map(|index| format!("?{index}")).collect();
    format!(
        "INSERT INTO run (night_id, campaign, machine, method, seed, campaign_sha256, model_sha256, failure, {}) VALUES ({})",
        figure_columns(""),
        marks.join(", ")
    )
}

fn read_run_row(row: &rusqlite::Row<'_>, first: usize) -> rusqlite::Result<RunRow> {
    let mut figures = BTreeMap::new();
    for (index, figure) in Metric::ALL.into_iter().enumerate() {
        if let Some(value) = row.get::<_, Option<f64>>(first + 7 + index)? {
            figures.insert(figure, value);
        }
    }
    Ok(RunRow {
        key: RunKey {
            campaign: row.get(first)?,
            machine: row.get(first + 1)?,
            method: row.get(first + 2)?,
            seed: row.get::<_, i64>(first + 3)?.cast_unsigned(),
        },
        campaign_sha256: row.get(first + 4)?,
        model_sha256: row.get(first + 5)?,
        failure: row.get(first + 6)?,
        figures,
        points: Vec::new(),
    })
}

/// The runs that the bands are based on, newest first: those of the last `nights` unmoved nights since the last accepted one.
fn read_earlier_runs(
    transaction: &Transaction<'_>,
    name: &str,
    nights: usize,
) -> rusqlite::Result<BTreeMap<RunKey, Vec<RunRow>>> {
    let mut select_runs = transaction.prepare(&format!(
        "SELECT r.id, {RUN_COLUMNS}, {} FROM run r WHERE r.night_id IN \
           (SELECT id FROM night WHERE name = ?1 AND moved = 0 \
              AND id >= coalesce((SELECT max(id) FROM night WHERE name = ?1 AND accepted = 1), 0) \
            ORDER BY id DESC LIMIT ?2) \
         ORDER BY r.night_id DESC",
        figure_columns("r.")
    ))?;
    let mut select_points = transaction.prepare(
        "SELECT speed_rpm, valve_opening_ratio, visit, eta, eta_true, h_w_m2k, h_true_w_m2k FROM point WHERE run_id = ?1",
    )?;
    let mut earlier: BTreeMap<RunKey, Vec<RunRow>> = BTreeMap::new();
    let limit = i64::try_from(nights).unwrap_or(i64::MAX);
    let mut rows = select_runs.query(params![name, limit])?;
    while let Some(row) = rows.next()? {
        let run_id: i64 = row.get(0)?;
        let mut run = read_run_row(row, 1)?;
        run.points = select_points
            .query_map([run_id], |row| read_point_row(row, 0))?
            .collect::<rusqlite::Result<_>>()?;
        earlier.entry(run.key.clone()).or_default().push(run);
    }
    Ok(earlier)
}

fn is_read_only(error: &rusqlite::Error) -> bool {
    use rusqlite::ErrorCode;
    let code = error.sqlite_error_code();
    matches!(code, Some(ErrorCode::ReadOnly | ErrorCode::CannotOpen | ErrorCode::PermissionDenied))
}

/// Whether the disk is full: also if only the shared memory of a write-ahead log has no room.
fn is_full(error: &rusqlite::Error) -> bool {
    let shared_memory = error.sqlite_error().map(|error| error.extended_code);
    error.sqlite_error_code() == Some(rusqlite::ErrorCode::DiskFull)
        || shared_memory == Some(rusqlite::ffi::SQLITE_IOERR_SHMSIZE)
}

/// Whether a database has a write-ahead log: the version number at this place of its header is 2 then (SQLite, "Database File Format", 1.3.3).
fn has_write_ahead_log(path: &Path) -> bool {
    let mut header = [0; 19];
    let read = mapper_yaml::open_file(path).and_then(|mut file| file.read_exact(&mut header));
    read.is_ok() && header.last() == Some(&2)
}

fn finite(value: Option<f64>) -> Option<f64> {
    value.filter(|value| value.is_finite())
}

/// Errors when a history is read or written.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum HistoryError {
    #[error("failed to create {}: {}", .0.display(), .1)]
    Directory(PathBuf, #[source] std::io::Error),
    #[error("there is no history at {}; run a nightly campaign to make one, or name another file", .0.display())]
    Missing(PathBuf),
    #[error("{} is not a history that this program can read: {reason}; name another file", .path.display())]
    Foreign { path: PathBuf, reason: String },
    #[error("the history {} cannot be written; check the permissions, or name another file", .0.display())]
    ReadOnly(PathBuf),
    #[error("the disk of the history {} is full; make room on it, or name another file", .0.display())]
    NoSpace(PathBuf),
    #[error("the history {} cannot be used: {}", .0.display(), .1)]
    Sqlite(PathBuf, #[source] rusqlite::Error),
}

impl HistoryError {
    fn of_sqlite(path: &Path, source: rusqlite::Error) -> Self {
        let path = path.to_owned();
        if is_full(&source) { HistoryError::NoSpace(path) } else { HistoryError::Sqlite(path, source) }
    }
}
