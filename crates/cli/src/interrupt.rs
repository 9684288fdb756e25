//! Ctrl-C: once to stop in good order, twice to stop at once.

use crate::exit_code::Code;
use crate::failure::Failure;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A flag that Ctrl-C (or SIGTERM) raises. The second one ends the process at once; what was flushed is kept.
pub fn stop_flag() -> Result<Arc<AtomicBool>, Failure> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = flag.clone();
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::SeqCst) {
            std::process::exit(Code::Interrupted as i32);
        }
    })
    .map_err(|error| Failure::new(Code::Failure, format!("failed to watch for Ctrl-C: {error}")))?;
    Ok(flag)
}
