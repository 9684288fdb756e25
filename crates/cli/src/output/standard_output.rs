//! Standard output: the results of commands, as text or as one JSON object, and the files that they write.

use crate::output::failure::{Code, Failure};
use crate::output::output_options::paint;
pub use crate::output::standard_error::say;
use crate::output::standard_error::wrap_for_terminal;
use clap::Args;
use mapper_core::{terminal_json, terminal_text};
use mapper_report::{Describe, Document, with_messages};
use mapper_session::{Existing, Gap, MapOut, MapWork, SessionError, write_file};
use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use terminal_size::terminal_size_of;

/// Whether the one JSON object has been printed.
static PRINTED: AtomicBool = AtomicBool::new(false);

/// Options of commands that write files.
#[derive(Debug, Args)]
pub struct FileOutput {
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    /// Replace existing files
    #[arg(long)]
    pub force: bool,
}

impl FileOutput {
    /// Treatment of an existing file.
    pub fn existing(&self) -> Existing {
        if self.force { Existing::Replaced } else { Existing::Kept }
    }

    /// A new file with a map.
    pub fn map<'a>(&self, path: &'a Path, format: Option<&'a str>) -> MapOut<'a> {
        MapOut { path, format, existing: self.existing() }
    }

    /// Writes a file.
    pub fn write(&self, path: &Path, bytes: &[u8]) -> Result<(), SessionError> {
        write_file(path, bytes, self.existing())
    }
}

/// Options for the map file of a command.
#[derive(Debug, Args)]
pub struct MapTarget {
    /// Write the map to this new file; its extension gives the format unless `--to` does
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Format of `--out`
    #[arg(long, value_name = "FORMAT", requires = "out")]
    pub to: Option<String>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl MapTarget {
    /// The file, if asked for.
    pub fn map(&self) -> Option<MapOut<'_>> {
        self.out.as_deref().map(|out| self.output.map(out, self.to.as_deref()))
    }
}

/// Writes text to standard output, on a terminal with long sentences wrapped to its width. A closed pipe ends the command quietly.
pub fn print(text: &str) -> Result<(), Failure> {
    write(&wrap_for_terminal(&terminal_text(text), terminal_size_of(std::io::stdout())))
}

fn write(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => Failure::closed_pipe(),
        _ => Failure::new(Code::Failure, format!("failed to write to standard output: {error}")),
    })
}

/// Writes a document.
pub fn show(document: &Document) -> Result<(), Failure> {
    print(&document.terminal(paint()))
}

/// Writes a result as one JSON object, or as its document.
pub fn show_result(result: &(impl Serialize + Describe), as_json: bool) -> Result<(), Failure> {
    if as_json { print_json(result) } else { show(&result.document()) }
}

/// States that the file next to a recording was not used, and why.
pub fn warn_of_unused(gap: &Gap) {
    if let Some(error) = &gap.not_used {
        say(&format!("diagnosed again: {error}\n"));
    }
}

/// Writes the result of an operation on map files, and its assumptions as warnings.
pub fn print_map_work(work: &MapWork, as_json: bool) -> Result<(), Failure> {
    work.warnings.iter().for_each(|warning| say(&format!("{warning}\n")));
    if as_json { print_json(&work.json) } else { show(&work.document) }
}

/// Writes one JSON object and a line end to standard output; typed messages have their sentences.
pub fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    let value = with_messages(|| serde_json::to_value(value)).map_err(SessionError::from)?;
    write(&terminal_json(&mapper_session::json_text(&value)?))?;
    PRINTED.store(true, Ordering::Relaxed);
    Ok(())
}

/// Whether a JSON object was printed; only one is allowed.
pub fn has_printed() -> bool {
    PRINTED.load(Ordering::Relaxed)
}
