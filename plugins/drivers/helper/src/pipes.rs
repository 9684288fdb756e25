//! Standard input and output.

use crate::Open;
use crate::outlet::Outlet;
use crate::server::Server;
use crate::serving::{WAITING, heed_signals, listen, serve_one, session};
use std::io::Write;
use std::process::ExitCode;
use std::sync::mpsc::sync_channel;

/// Serves one host on standard input and output, until it disconnects and the rig is safe. `name`: the file name of the program is
/// `mapper-backend-NAME`.
pub fn serve(name: &'static str, version: &'static str, open: impl Open + 'static) -> ExitCode {
    let (sender, news) = sync_channel(WAITING);
    if listen(std::io::stdin(), sender.clone()).and_then(|()| heed_signals(sender)).is_err() {
        return ExitCode::FAILURE;
    }
    let Ok(outlet) = frames().and_then(Outlet::into_pipe) else { return ExitCode::FAILURE };
    serve_one(Server::new(name, version, session(), Box::new(open)), &news, &outlet);
    ExitCode::SUCCESS
}

/// The pipe for frames. All other output to standard output, from an author's code or a C library, goes to standard error
/// from now on, since it must not get between the frames.
#[cfg(unix)]
fn frames() -> std::io::Result<impl Write + Send> {
    use std::os::fd::AsFd;
    let out = std::io::stdout().as_fd().try_clone_to_owned()?;
    rustix::stdio::dup2_stdout(std::io::stderr())?;
    Ok(std::io::BufWriter::new(std::fs::File::from(out)))
}

#[cfg(not(unix))]
fn frames() -> std::io::Result<impl Write + Send> {
    Ok(std::io::stdout())
}
