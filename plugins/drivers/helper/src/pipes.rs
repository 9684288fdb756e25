//! Standard input and output.

use crate::Open;
use crate::output_queue::OutputQueue;
use crate::server::Server;
use crate::serving::{QUEUE_LENGTH, forward_messages, forward_signals, new_session_name, serve_one};
use std::io::Write;
use std::process::ExitCode;
use std::sync::mpsc::sync_channel;

/// Serves one host on standard input and output, until it disconnects and the rig is safe. `name`: the file name of the program is
/// `mapper-backend-NAME`.
pub fn serve(name: &'static str, version: &'static str, open: impl Open + 'static) -> ExitCode {
    let (sender, events) = sync_channel(QUEUE_LENGTH);
    if forward_messages(std::io::stdin(), sender.clone()).and_then(|()| forward_signals(sender)).is_err() {
        return ExitCode::FAILURE;
    }
    let Ok(output) = frame_output().and_then(OutputQueue::into_pipe) else { return ExitCode::FAILURE };
    serve_one(Server::new(name, version, new_session_name(), Box::new(open)), &events, &output);
    ExitCode::SUCCESS
}

/// The pipe for frames. All other output to standard output, from an author's code or a C library, goes to standard error
/// from now on, since it must not get between the frames.
#[cfg(unix)]
fn frame_output() -> std::io::Result<impl Write + Send> {
    use std::os::fd::AsFd;
    let out = std::io::stdout().as_fd().try_clone_to_owned()?;
    rustix::stdio::dup2_stdout(std::io::stderr())?;
    Ok(std::io::BufWriter::new(std::fs::File::from(out)))
}

#[cfg(not(unix))]
fn frame_output() -> std::io::Result<impl Write + Send> {
    Ok(std::io::stdout())
}
