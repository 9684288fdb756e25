//! The catalogue: a row for each run folder below a directory, with the operator's tags and comment.

use crate::store::{History, HistoryError};
use mapper_core::RunEnding;
use rusqlite::Error::{FromSqlConversionFailure, ToSqlConversionFailure};
use rusqlite::types::Type;
use rusqlite::{Row, params, params_from_iter};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a run folder contains, as read from its files.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RunSummary {
    /// Name of the machine; empty if the folder does not say.
    pub machine: String,
    /// Serial number of the machine.
    pub serial_number: Option<String>,
    /// Name of the campaign.
    pub campaign: String,
    /// SHA-256 of the campaign as parsed.
    pub campaign_sha256: Option<String>,
    /// Program and version that recorded it.
    pub program: Option<String>,
    /// Start, `YYYY-MM-DD hh:mm:ss UTC`.
    pub started: Option<String>,
    /// The rig and its version, or the log that was imported.
    pub backend: String,
    /// Whether the program ran it; otherwise its results are of the log of another program, or of its recordings.
    pub has_journal: bool,
    /// How the run ended; `None` if it goes on or was killed, and without a journal.
    pub ending: Option<RunEnding>,
    /// Why the folder cannot be read; `None` if it can.
    pub problem: Option<String>,
    /// Points by verdict: good, doubtful, unusable.
    pub points: [usize; 3],
    /// How often the compressor went into surge; `None` without a surge search.
    pub surges: Option<usize>,
    /// Largest change of efficiency between visits of a repeated jump, fraction; `None` without one.
    pub drift: Option<f64>,
    /// Half of the widest 95 % interval of efficiency of a usable point, fraction.
    pub worst_eta_half_width: Option<f64>,
}

impl RunSummary {
    /// Whether it was read, and nothing ended it early.
    pub fn is_regular(&self) -> bool {
        let ended = !self.has_journal || self.ending == Some(RunEnding::Completed);
        self.problem.is_none() && ended
    }
}

/// A catalogued run.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct CataloguedRun {
    /// Its number, the same until the folder is gone.
    pub id: i64,
    /// The folder below the indexed directory, with `/`.
    pub folder: String,
    /// What it contains.
    #[serde(flatten)]
    pub summary: RunSummary,
    /// The operator's tags, in order.
    pub tags: Vec<String>,
    /// The operator's comment.
    pub comment: String,
}

/// Which catalogued runs are listed, newest first.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CatalogueFilter {
    /// Words that all occur in a run's texts, tags or comment.
    pub words: String,
    /// Of this machine only.
    pub machine: Option<String>,
    /// With this tag only.
    pub tag: Option<String>,
    /// Only runs that ask for attention: unreadable, not completed, or with points that are not good.
    pub attention: bool,
    /// Number of runs to skip.
    pub skip: usize,
    /// Maximum number of runs; 0: all.
    pub limit: usize,
}

/// A page of the catalogue.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct CataloguePage {
    /// The runs.
    pub runs: Vec<CataloguedRun>,
    /// Number of runs that the filter lets through.
    pub matching: usize,
    /// Number of all runs.
    pub all: usize,
}

/// A row holds the summary as JSON; its columns are for SQL. Annotations outlive their row, so that a disk that was not mounted costs no comment.
const TABLES: &str = "
CREATE TABLE IF NOT EXISTS catalogue (
  id INTEGER PRIMARY KEY AUTOINCREMENT, folder TEXT NOT NULL UNIQUE, stamp TEXT NOT NULL, regular INTEGER NOT NULL, words TEXT NOT NULL,
  summary TEXT NOT NULL,
  machine TEXT AS (summary ->> 'machine') STORED, serial_number TEXT AS (summary ->> 'serial_number') STORED,
  campaign TEXT AS (summary ->> 'campaign') STORED, campaign_sha256 TEXT AS (summary ->> 'campaign_sha256') STORED,
  program TEXT AS (summary ->> 'program') STORED, started TEXT AS (summary ->> 'started') STORED,
  backend TEXT AS (summary ->> 'backend') STORED, ending TEXT AS (summary ->> '$.ending.code') STORED,
  problem TEXT AS (summary ->> 'problem') STORED, good INTEGER AS (summary ->> '$.points[0]') STORED,
  doubtful INTEGER AS (summary ->> '$.points[1]') STORED, unusable INTEGER AS (summary ->> '$.points[2]') STORED,
  surges INTEGER AS (summary ->> 'surges') STORED, drift REAL AS (summary ->> 'drift') STORED,
  worst_eta_half_width REAL AS (summary ->> 'worst_eta_half_width') STORED
) STRICT;
CREATE INDEX IF NOT EXISTS catalogue_by_time ON catalogue (started, id);
CREATE TABLE IF NOT EXISTS annotation (folder TEXT PRIMARY KEY, tags TEXT NOT NULL, comment TEXT NOT NULL) STRICT, WITHOUT ROWID;";

const RUNS: &str = "SELECT c.id, c.folder, c.summary, coalesce(a.tags, ''), coalesce(a.comment, '')";
const FROM: &str = "FROM catalogue c LEFT JOIN annotation a ON a.folder = c.folder";

/// Maximum length of a comment, and of all tags of a run, bytes.
const MAX_ANNOTATION_BYTES: usize = 4096;

/// Maximum number of words in a search: SQLite limits the depth of an expression.
const MAX_WORDS: usize = 32;

impl History {
    /// Stamps of the catalogued folders: what their files were when they were read.
    pub fn catalogue_stamps(&self) -> Result<BTreeMap<String, String>, HistoryError> {
        self.with_catalogue(|connection| {
            let mut statement = connection.prepare("SELECT folder, stamp FROM catalogue")?;
            statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?.collect()
        })
    }

    /// Writes rows and removes those of folders that are gone, in one transaction.
    pub fn update_catalogue(
        &mut self,
        read: &[(String, String, RunSummary)],
        gone: &[String],
    ) -> Result<(), HistoryError> {
        self.change(|transaction| {
            transaction.execute_batch(TABLES)?;
            let mut write = transaction.prepare(
                "INSERT INTO catalogue (folder, stamp, regular, words, summary) VALUES (?1, ?2, ?3, ?4, ?5) \
                 ON CONFLICT (folder) DO UPDATE SET stamp = ?2, regular = ?3, words = ?4, summary = ?5",
            )?;
            for (folder, stamp, run) in read {
                let optional = [&run.serial_number, &run.program, &run.started, &run.problem];
                let texts = [folder, &run.machine, &run.campaign, &run.backend].into_iter();
                let texts = texts.chain(optional.into_iter().flatten()).map(|text| text.to_lowercase());
                let json = |error: serde_json::Error| ToSqlConversionFailure(error.into());
                let summary = serde_json::to_value(run).map_err(json)?;
                let code = summary["ending"]["code"].as_str().unwrap_or("unfinished").to_owned();
                let words: Vec<String> = texts.chain([code]).collect();
                let summary = summary.to_string();
                write.execute(params![folder, stamp, run.is_regular(), words.join(" "), summary])?;
            }
            let mut drop_row = transaction.prepare("DELETE FROM catalogue WHERE folder = ?1")?;
            gone.iter().try_for_each(|folder| drop_row.execute([folder]).map(drop))
        })
    }

    /// Sets tags (separated by commas) and comment of a run; both are cut to 4 KiB. Returns whether there is such a run.
    pub fn annotate(&mut self, id: i64, tags: &str, comment: &str) -> Result<bool, HistoryError> {
        let mut tags: Vec<String> = tags.split(',').map(|tag| tag.trim().to_lowercase()).collect();
        tags.retain(|tag| !tag.is_empty());
        tags.sort();
        tags.dedup();
        let (mut tags, mut comment) = (tags.join(","), comment.trim().to_owned());
        for text in [&mut tags, &mut comment] {
            text.truncate(text.floor_char_boundary(MAX_ANNOTATION_BYTES));
        }
        self.change(|transaction| {
            transaction.execute_batch(TABLES)?;
            let written = transaction.execute(
                "INSERT INTO annotation SELECT folder, ?2, ?3 FROM catalogue WHERE id = ?1 \
                 ON CONFLICT (folder) DO UPDATE SET tags = ?2, comment = ?3",
                params![id, tags, comment],
            )?;
            Ok(written > 0)
        })
    }

    /// The run of this number.
    pub fn catalogued(&self, id: i64) -> Result<Option<CataloguedRun>, HistoryError> {
        self.with_catalogue(|connection| {
            let mut statement = connection.prepare(&format!("{RUNS} {FROM} WHERE c.id = ?1"))?;
            statement.query_map([id], read_run)?.next().transpose()
        })
    }

    /// The catalogued runs that a filter lets through, newest first.
    pub fn catalogue(&self, filter: &CatalogueFilter) -> Result<CataloguePage, HistoryError> {
        self.with_catalogue(|connection| {
            let (mut conditions, mut values) = (vec!["1".to_owned()], Vec::<String>::new());
            for word in filter.words.to_lowercase().split_whitespace().take(MAX_WORDS) {
                values.push(word.to_owned());
                let place = values.len();
                conditions.push(format!(
                    "(instr(c.words, ?{place}) > 0 OR instr(coalesce(a.tags, '') || ' ' || lower(coalesce(a.comment, '')), ?{place}) > 0)"
                ));
            }
            if let Some(machine) = &filter.machine {
                values.push(machine.clone());
                conditions.push(format!("c.machine = ?{}", values.len()));
            }
            if let Some(tag) = &filter.tag {
                values.push(format!(",{},", tag.to_lowercase()));
                conditions.push(format!("instr(',' || coalesce(a.tags, '') || ',', ?{}) > 0", values.len()));
            }
            if filter.attention {
                conditions.push("(c.problem IS NOT NULL OR NOT c.regular OR c.doubtful + c.unusable > 0)".to_owned());
            }
            // One pass over all rows: their numbers, of which a page is read.
            let conditions = conditions.join(" AND ");
            let order = "ORDER BY c.started DESC, c.id DESC";
            let mut numbers = connection.prepare(&format!("SELECT c.id {FROM} WHERE {conditions} {order}"))?;
            let numbers: Vec<i64> = numbers
                .query_map(params_from_iter(&values), |row| row.get(0))?
                .collect::<rusqlite::Result<_>>()?;
            let limit = if filter.limit == 0 { usize::MAX } else { filter.limit };
            let mut read = connection.prepare(&format!("{RUNS} {FROM} WHERE c.id = ?1"))?;
            let runs = numbers.iter().skip(filter.skip).take(limit);
            let runs = runs.map(|id| read.query_row([id], read_run)).collect::<rusqlite::Result<_>>()?;
            let all: i64 = connection.query_row("SELECT count(*) FROM catalogue", [], |row| row.get(0))?;
            let (matching, all) = (numbers.len(), usize::try_from(all).unwrap_or_default());
            Ok(CataloguePage { runs, matching, all })
        })
    }

    /// Names to filter by: machines, and tags in use.
    pub fn catalogue_names(&self) -> Result<(Vec<String>, Vec<String>), HistoryError> {
        self.with_catalogue(|connection| {
            let names = |sql: &str| -> rusqlite::Result<Vec<String>> {
                connection.prepare(sql)?.query_map([], |row| row.get(0))?.collect()
            };
            let machines =
                names("SELECT DISTINCT machine FROM catalogue WHERE machine <> '' ORDER BY machine")?;
            let tags =
                names("SELECT DISTINCT a.tags FROM annotation a JOIN catalogue c ON c.folder = a.folder")?;
            let mut tags: Vec<String> = tags.iter().flat_map(|tags| split_tags(tags)).collect();
            tags.sort();
            tags.dedup();
            Ok((machines, tags))
        })
    }

    /// Reads the catalogue; a history of nights alone has none, which is empty.
    fn with_catalogue<T: Default>(
        &self,
        read: impl FnOnce(&rusqlite::Connection) -> rusqlite::Result<T>,
    ) -> Result<T, HistoryError> {
        self.read(|connection| {
            let found = "SELECT count(*) FROM sqlite_schema WHERE name IN ('catalogue', 'annotation')";
            let tables: i64 = connection.query_row(found, [], |row| row.get(0))?;
            if tables < 2 { Ok(T::default()) } else { read(connection) }
        })
    }
}

fn split_tags(tags: &str) -> Vec<String> {
    tags.split(',').filter(|tag| !tag.is_empty()).map(str::to_owned).collect()
}

fn read_run(row: &Row<'_>) -> rusqlite::Result<CataloguedRun> {
    let summary = serde_json::from_str(row.get_ref(2)?.as_str()?);
    Ok(CataloguedRun {
        id: row.get(0)?,
        folder: row.get(1)?,
        summary: summary.map_err(|error| FromSqlConversionFailure(2, Type::Text, error.into()))?,
        tags: split_tags(&row.get::<_, String>(3)?),
        comment: row.get(4)?,
    })
}
