//! The live page of a run: opened before the run, updated during it, closed after it.

use crate::feed::{Feed, LiveRun};
use crate::request::Access;
use crate::server::{Hub, OperatorCommand, ServedContent, serve};
use crate::tls::{Tls, TlsError, TlsFiles, read};
use mapper_report::page::live_page;
use mapper_session::SessionEvent;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

/// Time for browsers to receive the last message.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// The live page of a run.
pub struct Live {
    listener: Mutex<Option<TcpListener>>,
    address: SocketAddr,
    token: Option<String>,
    tls: Option<Tls>,
    started: OnceLock<(Arc<Feed>, Arc<ServedContent>)>,
}

impl Live {
    /// Binds an address. Browsers on other machines need the token that this creates.
    pub fn open(address: SocketAddr, tls: Option<&TlsFiles>) -> Result<Live, LiveError> {
        let tls = tls.map(read).transpose()?;
        let listen = |source| LiveError::Listen(address, source);
        let listener = TcpListener::bind(address).map_err(listen)?;
        let address = listener.local_addr().map_err(listen)?;
        let token = if address.ip().is_loopback() { None } else { Some(token()?) };
        Ok(Live { listener: Mutex::new(Some(listener)), address, token, tls, started: OnceLock::new() })
    }

    /// URL of the page. The token follows `#`, so that browsers never send it with the address.
    pub fn url(&self) -> String {
        let scheme = if self.tls.is_some() { "https" } else { "http" };
        match &self.token {
            None => format!("{scheme}://{}/", self.address),
            Some(token) => format!("{scheme}://{}/#token={token}", self.address),
        }
    }

    /// Network warning for the operator: other machines can connect, and all traffic is unencrypted.
    pub fn warning(&self) -> Option<&'static str> {
        (self.token.is_some() && self.tls.is_none()).then_some(
            "other computers can reach the live page WITHOUT encryption: everyone on the network can read the readings and the token, and use \
             the buttons with the token. Use a certificate and a key, or serve on 127.0.0.1 and use a tunnel (ssh -L)",
        )
    }

    /// Starts the server.
    pub fn start(&self, run: &LiveRun<'_>) -> Result<(), LiveError> {
        let Some(listener) = self.listener.lock().ok().and_then(|mut listener| listener.take()) else {
            return Ok(());
        };
        let feed = Arc::new(Feed::new(run));
        let feed_for_snapshots = feed.clone();
        let (operator, after_step, now) = (run.operator.clone(), run.after_step.clone(), run.now.clone());
        let feed_for_commands = feed.clone();
        let served = Arc::new(ServedContent {
            page: live_page()?,
            access: Access::new(self.address, self.token.clone(), self.tls.is_some()),
            tls: self.tls.clone(),
            hub: Hub::default(),
            snapshot: Box::new(move || feed_for_snapshots.snapshot()),
            ask: Box::new(move |command| {
                let effect = match command {
                    OperatorCommand::Hold => {
                        operator.hold();
                        "the step is held"
                    }
                    OperatorCommand::Continue => {
                        operator.release();
                        "the step continues"
                    }
                    OperatorCommand::StopAfterStep => {
                        after_step.store(true, Ordering::SeqCst);
                        "the run stops at the end of the step"
                    }
                    OperatorCommand::SafeNow => {
                        after_step.store(true, Ordering::SeqCst);
                        now.store(true, Ordering::SeqCst);
                        "the rig goes into its safe state now"
                    }
                };
                operator.add_message(format!("operator, on the live page: {effect}"));
                feed_for_commands.show_command(command);
            }),
            connections: Arc::default(),
        });
        let for_thread = served.clone();
        let _ = std::thread::Builder::new()
            .name("live".to_owned())
            .spawn(move || serve(&listener, &for_thread))
            .map_err(|source| LiveError::Listen(self.address, source))?;
        // This is the only start, because the listener was just taken.
        let _ = self.started.set((feed, served));
        Ok(())
    }

    /// Forwards a session event. Never waits for a browser.
    pub fn show(&self, event: &SessionEvent) {
        let Some((feed, served)) = self.started.get() else { return };
        for message in feed.process(event) {
            served.hub.publish(&message);
        }
    }

    /// Reports the outcome and the run's page, and waits briefly until browsers have received them.
    pub fn end(&self, outcome: &str, page: Option<&std::path::Path>) {
        let Some((feed, served)) = self.started.get() else { return };
        served.hub.publish(&feed.show_end(outcome, page));
        served.hub.close();
        let deadline = Instant::now() + CLOSE_TIMEOUT;
        while served.connections.any_open() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn token() -> Result<String, LiveError> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(LiveError::Token)?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Why the live page cannot be served.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum LiveError {
    #[error("the live page cannot be served at {0}: {1}; choose another address")]
    Listen(SocketAddr, #[source] std::io::Error),
    #[error("the system cannot generate random numbers for a token: {0}")]
    Token(getrandom::Error),
    /// A defect of the program.
    #[error("failed to write the live page: {0}")]
    Page(#[from] serde_json::Error),
    #[error(transparent)]
    Tls(#[from] TlsError),
}
