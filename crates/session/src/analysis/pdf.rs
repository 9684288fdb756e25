//! A page as a PDF, printed by a browser that is installed on this machine.

use std::fs::File;
use std::io;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// Names under which a Chromium is on the path.
const BROWSERS: [&str; 7] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
];
/// Maximum time of the browser: a page of 60 points takes 3 s.
const MAX_DURATION: Duration = Duration::from_secs(60);
/// Interval of the checks whether it has ended.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum PrintError {
    #[error("printing needs Chromium or a browser made from it, and none is on the path (looked for {}); install `chromium`, or open the page and print it there", BROWSERS.join(", "))]
    NoBrowser,
    #[error("{0} could not be used: {1}")]
    System(&'static str, #[source] io::Error),
    /// `reason`: how the browser ended, and the last line of its log.
    #[error("{browser} made no PDF ({reason}); open the page and print it there")]
    NoPdf { browser: &'static str, reason: String },
}

/// The PDF of a page. `directory`: for the browser's temporary files; as a snap package it can reach only the user's own directories.
pub fn page_as_pdf(page: &str, directory: &Path) -> Result<Vec<u8>, PrintError> {
    let browser = BROWSERS.into_iter().find(|name| is_on_path(name)).ok_or(PrintError::NoBrowser)?;
    let failed = |source| PrintError::System(browser, source);
    let folder = tempfile::Builder::new().prefix("mapper-print-").tempdir_in(directory).map_err(failed)?;
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("page.html"), page).map_err(failed)?;
    let mut command = Command::new(browser);
    command.args([
        "--headless",
        "--disable-gpu",
        "--no-pdf-header-footer",
        "--print-to-pdf=page.pdf",
        "--user-data-dir=profile",
    ]);
    if is_owned_by_root(folder.path()) {
        // Chromium refuses to run as root with its sandbox; the page makes no requests and has no content of others.
        command.arg("--no-sandbox");
    }
    command.arg("page.html").current_dir(folder.path()).stdin(Stdio::null()).stdout(Stdio::null());
    command.stderr(File::create(at("log")).map_err(failed)?);
    let ended = run_until_deadline(&mut command).map_err(failed)?;
    match (std::fs::read(at("page.pdf")), ended) {
        (Ok(pdf), Some(status)) if status.success() && pdf.starts_with(b"%PDF") => Ok(pdf),
        (_, None) => Err(PrintError::NoPdf {
            browser,
            reason: format!("not ready after {} s", MAX_DURATION.as_secs()),
        }),
        (_, Some(status)) => {
            let log = std::fs::read(at("log")).unwrap_or_default();
            let log = String::from_utf8_lossy(&log);
            let last = log.lines().last().unwrap_or_default();
            Err(PrintError::NoPdf { browser, reason: mapper_core::one_line(&format!("{status}: {last}")) })
        }
    }
}

/// Runs a command, and kills it after [`MAX_DURATION`]; `None` if it was killed.
fn run_until_deadline(command: &mut Command) -> io::Result<Option<ExitStatus>> {
    let (mut child, start) = (command.spawn()?, Instant::now());
    while start.elapsed() < MAX_DURATION {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        std::thread::sleep(POLL_INTERVAL);
    }
    child.kill()?;
    child.wait().map(|_| None)
}

fn is_on_path(name: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path)
        .any(|folder| folder.join(name).is_file() || folder.join(format!("{name}.exe")).is_file())
}

#[cfg(unix)]
fn is_owned_by_root(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|about| std::os::unix::fs::MetadataExt::uid(&about) == 0)
}

#[cfg(not(unix))]
fn is_owned_by_root(_: &Path) -> bool {
    false
}
