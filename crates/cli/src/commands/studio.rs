//! `mapper studio`: the workbench, the runs below a directory in the browser.

use crate::environment::registry;
use crate::interrupt;
use crate::output::failure::{Code, Failure};
use crate::output::standard_output;
use clap::Args;
use mapper_history::History;
use mapper_live::{Studio as Workbench, TlsFiles, parse_address};
use mapper_session::SessionError;
use std::net::SocketAddr;
use std::path::PathBuf;

/// Search, tag and compare the runs below a directory in the browser
#[derive(Debug, Args)]
pub struct Studio {
    /// Directory with run folders, at any depth
    #[arg(default_value = "runs", value_name = "DIR")]
    pub directory: PathBuf,
    /// Address of the page; other computers need TLS or a tunnel to read it safely
    #[arg(long, value_name = "ADDRESS", default_value = "7374", value_parser = parse_address)]
    pub address: SocketAddr,
    /// Serve it over TLS with this certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "key", hide_short_help = true)]
    pub cert: Option<PathBuf>,
    /// Private key of that certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "cert", hide_short_help = true)]
    pub key: Option<PathBuf>,
    /// The history that keeps the catalogue [default: DIR/history.db]
    #[arg(long, value_name = "FILE")]
    pub db: Option<PathBuf>,
}

impl Studio {
    pub fn run(&self) -> Result<(), Failure> {
        // The history would make it, and a mistyped name would show an empty catalogue.
        if !self.directory.is_dir() {
            let message =
                format!("{} is not a directory; name one with run folders", self.directory.display());
            return Err(Failure::new(Code::BadInput, message));
        }
        let path = self.db.clone().unwrap_or_else(|| self.directory.join("history.db"));
        let history = History::open(&path).map_err(SessionError::from)?;
        let tls = self.cert.clone().zip(self.key.clone());
        let tls = tls.map(|(certificate, key)| TlsFiles { certificate, key });
        interrupt::end_at_once()?;
        let studio = Workbench::open(self.address, tls.as_ref(), self.directory.clone(), history, registry());
        let studio = studio.map_err(Failure::of_live)?;
        if !self.address.ip().is_loopback() && tls.is_none() {
            standard_output::say(
                "warning: other computers can read this page and its token WITHOUT encryption; use --cert and --key, or ssh -L\n",
            );
        }
        standard_output::say(&format!("studio: {}\n", studio.url()));
        // The pages are served by their own thread until a signal ends the process.
        loop {
            std::thread::park();
        }
    }
}
