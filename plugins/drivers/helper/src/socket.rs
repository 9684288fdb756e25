//! Connections of a driver: standard input and output, or a socket.

use crate::Open;
use crate::server::Server;
use crate::serving::{
    DriverEvent, OutputQueue, QUEUE_LENGTH, forward_messages, forward_signals, new_session_name, serve_one,
    wait_for_event,
};
use mapper_driver_host::protocol::{
    Code, Encoding, FIRST_FRAME_LIMIT_BYTES, Failure, Message, decode, encode, read_frame, write_frame,
};
use std::io::{Error, ErrorKind, Write};
use std::net::Shutdown;
use std::os::unix::fs::{DirBuilderExt, FileTypeExt, PermissionsExt};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::time::Duration;

/// Time in which a refused host must send its first message and read the refusal.
const REFUSAL_TIMEOUT: Duration = Duration::from_secs(1);

/// Serves hosts that connect to the socket at `path`, one after the other and each with its own rig, until a signal ends it. A host
/// that connects while another is served, or while its rig becomes safe, is refused. Only the user can access the socket.
pub fn serve_at(
    path: &Path,
    name: &'static str,
    version: &'static str,
    open: impl Open + 'static,
) -> ExitCode {
    let (sender, events) = sync_channel(QUEUE_LENGTH);
    let busy = Arc::new(AtomicBool::new(false));
    let bound = bind(path).and_then(|(listener, file)| {
        forward_signals(sender.clone())?;
        let (sender, busy) = (sender.clone(), busy.clone());
        std::thread::Builder::new()
            .name("door".to_owned())
            .spawn(move || accept_hosts(&listener, &sender, &busy))
            .map(|_| file)
    });
    // The socket file is removed when the driver ends.
    let _file = match bound {
        Ok(file) => file,
        Err(error) => {
            // If standard error is closed, the message is lost.
            let _ = writeln!(std::io::stderr(), "error: {}: {error}", path.display());
            return ExitCode::FAILURE;
        }
    };
    let open = Rc::new(open);
    loop {
        let host = match wait_for_event(&events, None) {
            Some(DriverEvent::Connected(host)) => host,
            Some(DriverEvent::Terminate) => return ExitCode::SUCCESS,
            _ => continue,
        };
        let open = open.clone();
        let server = Server::new(name, version, new_session_name(), Box::new(move |settings| open(settings)));
        let served = serve_host(server, &host, sender.clone(), &events);
        // Discards unread data: the host has disconnected or sent an invalid frame.
        let _ = host.shutdown(Shutdown::Both);
        busy.store(false, Ordering::SeqCst);
        if served.unwrap_or(false) {
            return ExitCode::SUCCESS;
        }
    }
}

fn serve_host(
    server: Server,
    host: &UnixStream,
    sender: SyncSender<DriverEvent>,
    events: &std::sync::mpsc::Receiver<DriverEvent>,
) -> std::io::Result<bool> {
    let output = OutputQueue::into_pipe(host.try_clone()?)?;
    forward_messages(host.try_clone()?, sender)?;
    Ok(serve_one(server, events, &output))
}

fn accept_hosts(listener: &UnixListener, sender: &SyncSender<DriverEvent>, busy: &AtomicBool) {
    loop {
        match listener.accept() {
            Ok((host, _)) if busy.swap(true, Ordering::SeqCst) => refuse_host(host),
            Ok((host, _)) => {
                if sender.send(DriverEvent::Connected(host)).is_err() {
                    return;
                }
            }
            // For example, no file handles left: a passing condition.
            Err(_) => std::thread::sleep(Duration::from_millis(100)),
        }
    }
}

fn refuse_host(mut host: UnixStream) {
    let timed = host
        .set_read_timeout(Some(REFUSAL_TIMEOUT))
        .and_then(|()| host.set_write_timeout(Some(REFUSAL_TIMEOUT)));
    if timed.is_err() {
        return;
    }
    let Ok(Some(body)) = read_frame(&mut host, FIRST_FRAME_LIMIT_BYTES) else { return };
    let Some(id) = decode(&body).ok().and_then(|message| message.id) else { return };
    let refusal_text = "this driver serves another host, or is still making its rig safe; try again later";
    let refusal = Message::answer(id, Err(Box::new(Failure::new(Code::Refused, refusal_text))));
    if let Ok(body) = encode(&refusal, Encoding::MessagePack) {
        // If this fails, the host has disconnected.
        let _ = write_frame(&mut host, &body, FIRST_FRAME_LIMIT_BYTES);
    }
}

/// The socket's file, removed when the driver ends.
struct SocketFile(PathBuf);

impl Drop for SocketFile {
    fn drop(&mut self) {
        // Another process may have removed it.
        let _ = std::fs::remove_file(&self.0);
    }
}

/// Listens at `path`. Removes the socket of a killed driver, but neither a socket in use nor another kind of file.
fn bind(path: &Path) -> std::io::Result<(UnixListener, SocketFile)> {
    if let Some(directory) = path.parent().filter(|directory| !directory.as_os_str().is_empty()) {
        std::fs::DirBuilder::new().recursive(true).mode(0o700).create(directory)?;
    }
    if let Ok(metadata) = path.symlink_metadata() {
        if !metadata.file_type().is_socket() {
            return Err(Error::new(ErrorKind::AlreadyExists, "the file exists and is not a socket"));
        }
        if UnixStream::connect(path).is_ok() {
            return Err(Error::new(ErrorKind::AddrInUse, "another driver listens on this socket"));
        }
        std::fs::remove_file(path)?;
    }
    let listener = UnixListener::bind(path)?;
    let file = SocketFile(path.to_owned());
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o600))?;
    Ok((listener, file))
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_socket_of_a_killed_driver_is_removed() {
        let directory = std::env::temp_dir().join(format!("mapper-socket-{}", std::process::id()));
        let path = directory.join("below/rig.socket");
        let (listener, file) = bind(&path).unwrap();
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        assert!(bind(&path).err().unwrap().to_string().contains("another driver listens"));
        // As after a kill.
        std::mem::forget(file);
        drop(listener);
        let (_listener, file) = bind(&path).unwrap();
        drop(file);
        assert!(!path.exists());
        std::fs::write(&path, "notes").unwrap();
        assert!(bind(&path).err().unwrap().to_string().contains("not a socket"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "notes");
        std::fs::remove_dir_all(&directory).unwrap();
    }
}
