//! Files of a run that grow: its recording and its journal.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Faults of a disk: called before each write with the file and its number of bytes, 0 for a synchronisation; returns how many of them the
/// disk takes, or its error. For tests.
pub type DiskFaults = Arc<dyn Fn(&Path, usize) -> io::Result<usize> + Send + Sync>;

/// A file of a run that grows: its recording or its journal.
pub struct RunFile {
    file: File,
    path: PathBuf,
    faults: Option<DiskFaults>,
}

impl RunFile {
    /// A file that is open for writing.
    pub fn new(file: File, path: &Path, faults: Option<DiskFaults>) -> Self {
        RunFile { file, path: path.to_owned(), faults }
    }

    /// Hands everything written to the disk.
    ///
    /// # Errors
    /// The error of the system.
    pub fn sync_data(&self) -> io::Result<()> {
        self.faults.as_ref().map_or(Ok(0), |faults| faults(&self.path, 0))?;
        self.file.sync_data()
    }
}

impl io::Write for RunFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.faults.as_ref().map_or(Ok(bytes.len()), |faults| faults(&self.path, bytes.len()))?;
        self.file.write(bytes.get(..taken).unwrap_or(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}
