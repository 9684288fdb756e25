//! The command line for users.

use crate::link::{LinkError, endpoints};
use crate::settings::{SettingError, is_endpoint};
use crate::store::{Store, StoreError, fingerprint, valid};
use clap::{Parser, Subcommand};
use mapper_core::terminal_text;
use opcua::crypto::X509;
use std::io::Write;
use std::process::ExitCode;

/// Drive a gas stand behind a PLC or another controller that speaks OPC UA. `mapper` starts this driver without arguments for a campaign with
/// `backend: {opcua: ...}`; docs/how-to/rig.md, "Over OPC UA", has its settings. With `--socket PATH` it serves the hosts that connect there,
/// docs/reference/protocol.md. The commands below are for manual use.
#[derive(Parser)]
#[command(name = "mapper-backend-opcua", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Pin the server's current certificate; any other certificate is refused from then on.
    ///
    /// Compare the fingerprint with the one that the server itself shows.
    Trust {
        /// As in the campaign: opc.tcp://HOST:PORT
        endpoint: String,
        /// Pin it only if this is its SHA-256.
        #[arg(long, value_name = "SHA256")]
        fingerprint: Option<String>,
        /// Replace a different pinned certificate.
        #[arg(long)]
        replace: bool,
    },
    /// Print the path of this program's own certificate, which the server must trust; create it if missing.
    Certificate,
}

#[derive(Debug, thiserror::Error)]
enum CommandError {
    #[error(transparent)]
    Link(#[from] LinkError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("{0}")]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Setting(#[from] SettingError),
    #[error("{0} has no certificate: it offers no encryption")]
    NoCertificate(String),
    #[error("the certificate has the fingerprint {found}, not {wanted}; nothing was pinned")]
    OtherFingerprint { found: String, wanted: String },
}

pub(crate) fn run() -> ExitCode {
    match Arguments::parse().command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // If standard error is closed, the message is lost.
            let _ = writeln!(std::io::stderr(), "error: {}", terminal_text(&error.to_string()));
            ExitCode::FAILURE
        }
    }
}

impl Command {
    fn run(self) -> Result<(), CommandError> {
        let store = Store::of_environment()?;
        match self {
            Command::Certificate => print(&store.own()?.display().to_string()),
            Command::Trust { endpoint, fingerprint, replace } => {
                trust(&store, &endpoint, fingerprint, replace)
            }
        }
    }
}

fn print(words: &str) -> Result<(), CommandError> {
    // The names in a certificate are those of the server.
    Ok(writeln!(std::io::stdout(), "{}", terminal_text(words))?)
}

fn trust(store: &Store, endpoint: &str, wanted: Option<String>, replace: bool) -> Result<(), CommandError> {
    if !is_endpoint(endpoint) {
        return Err(SettingError::Endpoint(endpoint.to_owned()).into());
    }
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let offered = runtime.block_on(endpoints(store, endpoint))?;
    let der = offered.iter().map(|offer| offer.server_certificate.as_ref()).find(|der| !der.is_empty());
    let der = der.ok_or_else(|| CommandError::NoCertificate(endpoint.to_owned()))?;
    let certificate = X509::from_der(der).map_err(|_| CommandError::NoCertificate(endpoint.to_owned()))?;
    let found = fingerprint(der);
    print(&format!("{endpoint}\nsubject      {}", certificate.subject_name()))?;
    if let (Ok(from), Ok(to)) = (certificate.not_before(), certificate.not_after()) {
        print(&format!("valid        {} to {}", from.format("%Y-%m-%d"), to.format("%Y-%m-%d")))?;
    }
    print(&format!("fingerprint  SHA-256 {found}"))?;
    valid(endpoint, &certificate)?;
    let plain = |text: &str| text.replace([':', ' '], "").to_ascii_uppercase();
    if let Some(wanted) = wanted.filter(|wanted| plain(wanted) != plain(&found)) {
        return Err(CommandError::OtherFingerprint { found, wanted });
    }
    if let Some(pinned_certificate) = store.trusted(endpoint)? {
        let pinned = fingerprint(&crate::link::der(&pinned_certificate));
        if pinned != found && !replace {
            return Err(StoreError::Changed { server: endpoint.to_owned(), found, pinned }.into());
        }
    }
    let file = store.trust(endpoint, der)?;
    print(&format!("trusted from now on: {}", file.display()))?;
    print(&format!("our own certificate, for the server to trust: {}", store.own()?.display()))
}
