//! All observers of a run: browsers on its live page, and the Foxglove stream.

use crate::feed::LiveRun;
#[cfg(feature = "foxglove")]
use crate::foxglove_stream::FoxgloveStream;
use crate::live::{Live, LiveError};
use crate::tls::TlsFiles;
use mapper_session::SessionEvent;
use std::net::SocketAddr;
use std::path::Path;
#[cfg(feature = "foxglove")]
use std::sync::OnceLock;

/// Outputs requested by the user.
#[derive(Debug, Clone, Default)]
pub struct ObserverRequest {
    /// Address of the page.
    pub page: Option<SocketAddr>,
    /// Certificate and key for TLS.
    pub tls: Option<TlsFiles>,
    /// Address of the stream for Foxglove and Lichtblick.
    #[cfg(feature = "foxglove")]
    pub foxglove: Option<SocketAddr>,
}

/// The observers, possibly none.
pub struct Observers {
    page: Option<Live>,
    #[cfg(feature = "foxglove")]
    foxglove: OnceLock<FoxgloveStream>,
    // Without the feature only the page uses it.
    #[cfg_attr(not(feature = "foxglove"), expect(dead_code, reason = "the Foxglove stream uses it"))]
    asked: ObserverRequest,
}

impl Observers {
    /// Binds the page's address; serving starts later.
    ///
    /// # Errors
    /// [`LiveError`] if the address is in use, or certificate and key are unusable.
    pub fn open(asked: ObserverRequest) -> Result<Self, LiveError> {
        let page = asked.page.map(|address| Live::open(address, asked.tls.as_ref())).transpose()?;
        Ok(Observers {
            page,
            #[cfg(feature = "foxglove")]
            foxglove: OnceLock::new(),
            asked,
        })
    }

    /// Whether the operator has buttons.
    pub fn has_operator_controls(&self) -> bool {
        self.page.is_some()
    }

    /// Whether any observer shows points as they are identified.
    pub fn show_points(&self) -> bool {
        #[cfg(feature = "foxglove")]
        if self.asked.foxglove.is_some() {
            return true;
        }
        self.page.is_some()
    }

    /// Starts to serve. Returns lines of information for the operator.
    ///
    /// # Errors
    /// [`LiveError`] if the stream's address is in use.
    pub fn start(&self, run: &LiveRun<'_>) -> Result<Vec<String>, LiveError> {
        let mut lines = Vec::new();
        if let Some(page) = &self.page {
            page.start(run)?;
            lines.extend(page.warning().map(|warning| format!("warning: {warning}")));
            lines.push(format!("live page: {}", page.url()));
        }
        #[cfg(feature = "foxglove")]
        if let Some(address) = self.asked.foxglove {
            let stream = FoxgloveStream::open(address, run.start_time_ns, run.channels)?;
            lines.push(format!("for Foxglove and Lichtblick: {}", stream.url()));
            // This is the only start.
            let _ = self.foxglove.set(stream);
        }
        Ok(lines)
    }

    /// Forwards a session event. Never waits for an observer.
    pub fn show(&self, event: &SessionEvent) {
        if let Some(page) = &self.page {
            page.show(event);
        }
        #[cfg(feature = "foxglove")]
        if let Some(stream) = self.foxglove.get() {
            stream.show(event);
        }
    }

    /// Reports the outcome and the run's page.
    pub fn end(&self, outcome: &str, page: Option<&Path>) {
        if let Some(live) = &self.page {
            live.end(outcome, page);
        }
    }
}
