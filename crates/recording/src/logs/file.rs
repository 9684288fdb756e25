//! A log as a file or as bytes in memory.

use crate::logs::LogError;
use crate::logs::limits::max_memory_bytes;
use std::fs::File;
use std::io::{self, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Input of a log format.
pub trait ReadSeek: Read + Seek {}

impl<T: Read + Seek> ReadSeek for T {}

/// The first bytes of a file compressed by gzip.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// A log on disk or in memory, which may be read several times.
#[derive(Debug, Clone)]
pub struct LogFile {
    path: PathBuf,
    bytes: Option<Arc<[u8]>>,
}

impl LogFile {
    /// A file.
    pub fn from_path(path: &Path) -> Self {
        LogFile { path: path.to_owned(), bytes: None }
    }

    /// Bytes in memory; messages call them `name`.
    pub fn from_bytes(name: &Path, bytes: &[u8]) -> Self {
        LogFile { path: name.to_owned(), bytes: Some(bytes.into()) }
    }

    /// The content of a file compressed by gzip, in memory; `None` for any other.
    ///
    /// # Errors
    /// [`LogError::Read`] if the file cannot be read or unpacked, or unpacks to more than a file of its size may.
    pub(crate) fn unpack(&self) -> Result<Option<LogFile>, LogError> {
        if self.head(GZIP.len())? != GZIP {
            return Ok(None);
        }
        let limit = max_memory_bytes(self.size_bytes()?);
        let mut content = Vec::new();
        flate2::read::MultiGzDecoder::new(self.open()?)
            .take(limit + 1)
            .read_to_end(&mut content)
            .map_err(|error| self.read_error(error))?;
        if content.len() as u64 > limit {
            let why =
                format!("it unpacks to more than {} MiB; unpack it and give the unpacked file", limit >> 20);
            return Err(self.read_error(io::Error::new(io::ErrorKind::FileTooLarge, why)));
        }
        Ok(Some(LogFile { path: self.path.clone(), bytes: Some(content.into()) }))
    }

    /// The file, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The bytes, if they are in memory.
    pub fn bytes(&self) -> Option<&[u8]> {
        self.bytes.as_deref()
    }

    /// The bytes from the start.
    ///
    /// # Errors
    /// [`LogError::Read`] if the file cannot be opened.
    pub fn open(&self) -> Result<Box<dyn ReadSeek>, LogError> {
        match &self.bytes {
            Some(bytes) => Ok(Box::new(Cursor::new(bytes.clone()))),
            None => Ok(Box::new(self.open_path()?)),
        }
    }

    /// The file on disk.
    ///
    /// # Errors
    /// [`LogError::Read`] if it is not a plain file or cannot be opened.
    pub fn open_path(&self) -> Result<File, LogError> {
        mapper_yaml::open_file(&self.path).map_err(|error| self.read_error(error))
    }

    /// Its size, bytes.
    ///
    /// # Errors
    /// [`LogError::Read`] if the file cannot be found.
    pub fn size_bytes(&self) -> Result<u64, LogError> {
        match &self.bytes {
            Some(bytes) => Ok(bytes.len() as u64),
            None => Ok(std::fs::metadata(&self.path).map_err(|error| self.read_error(error))?.len()),
        }
    }

    /// At most the first `count` bytes.
    ///
    /// # Errors
    /// [`LogError::Read`] if the file cannot be read.
    pub fn head(&self, count: usize) -> Result<Vec<u8>, LogError> {
        let mut head = Vec::new();
        let limit = u64::try_from(count).unwrap_or(u64::MAX);
        self.open()?.take(limit).read_to_end(&mut head).map_err(|error| self.read_error(error))?;
        Ok(head)
    }

    /// The error for a file that could not be read.
    pub fn read_error(&self, source: io::Error) -> LogError {
        LogError::Read { path: self.path.clone(), source }
    }

    /// The error for content that cannot be used.
    pub fn content_error(&self, format: &'static str, message: impl Into<String>) -> LogError {
        LogError::Content { path: self.path.clone(), format, message: message.into() }
    }
}
