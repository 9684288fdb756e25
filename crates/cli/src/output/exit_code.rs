//! Exit codes of the process.

/// Exit codes, stable for scripts; `mapper --help` lists them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Code {
    /// A file could not be read or written, or the program is at fault.
    Failure = 1,
    // 2 is clap's: wrong arguments.
    /// The campaign or another input file has mistakes; all of them were printed.
    BadInput = 3,
    /// There is no plan, or the plan given is stale.
    NoPlan = 4,
    /// The rig failed or a guard tripped; the rig is safe and the recording is kept.
    Rig = 5,
    /// The recording lacks data that identification needs.
    BadRecording = 6,
    /// A nightly run failed, or a metric is outside the band of the nights before.
    Moved = 7,
    /// Items of a fleet are missing or failed.
    Incomplete = 8,
    /// Stopped by the operator; the rig is safe and the recording is kept.
    Interrupted = 130,
}

/// The table of exit codes for `--help`.
pub const HELP: &str = "\
Exit codes:
  0    done
  1    a file could not be read or written, or the program has a defect
  2    wrong arguments
  3    the campaign or another input file has mistakes (all are printed)
  4    no plan is possible, or the given plan is stale
  5    the rig failed, a guard tripped, or the rig is in use, locked out or without its required guards; the recording is kept
  6    the recording lacks data that identification needs
  7    a nightly run failed, or a metric is outside the band of the nights before
  8    items of a fleet are missing or failed (all are listed)
  130  stopped by the operator; the rig is safe, the recording is kept";
