//! All who look on at a run: browsers on its page, and viewers of its readings.

use crate::live::Live;
use crate::live_error::LiveError;
use crate::live_run::LiveRun;
use crate::tls::TlsFiles;
#[cfg(feature = "foxglove")]
use crate::viewers::Viewers;
use mapper_session::SessionEvent;
use std::path::Path;
#[cfg(feature = "foxglove")]
use std::sync::OnceLock;

/// What was asked for.
#[derive(Debug, Clone, Default)]
pub struct Asked<'a> {
    /// Address of the page.
    pub page: Option<&'a str>,
    /// What it is served with over TLS.
    pub tls: Option<TlsFiles>,
    /// Address of the stream for Foxglove and Lichtblick.
    #[cfg(feature = "foxglove")]
    pub viewers: Option<&'a str>,
}

/// Nobody, or some.
pub struct Observers<'a> {
    page: Option<Live>,
    #[cfg(feature = "foxglove")]
    viewers: OnceLock<Viewers>,
    // Without the feature nothing but the page is left of it.
    #[cfg_attr(not(feature = "foxglove"), expect(dead_code, reason = "viewers look at it"))]
    asked: Asked<'a>,
}

impl<'a> Observers<'a> {
    /// Takes the page's address; nothing is served yet.
    ///
    /// # Errors
    /// [`LiveError`] where it is none, or is taken, or certificate and key are of no use.
    pub fn open(asked: Asked<'a>) -> Result<Self, LiveError> {
        let page = asked.page.map(|address| Live::open(address, asked.tls.as_ref())).transpose()?;
        Ok(Observers {
            page,
            #[cfg(feature = "foxglove")]
            viewers: OnceLock::new(),
            asked,
        })
    }

    /// Whether somebody may press buttons.
    pub fn have_buttons(&self) -> bool {
        self.page.is_some()
    }

    /// Whether anybody is shown points as they are identified.
    pub fn are_there(&self) -> bool {
        #[cfg(feature = "foxglove")]
        if self.asked.viewers.is_some() {
            return true;
        }
        self.page.is_some()
    }

    /// Begins to serve; what whoever starts the run is to be told, a line each.
    ///
    /// # Errors
    /// [`LiveError`] where the stream's address is none of this machine's, or is taken.
    pub fn begin(&self, run: &LiveRun<'_>) -> Result<Vec<String>, LiveError> {
        let mut lines = Vec::new();
        if let Some(page) = &self.page {
            page.begin(run)?;
            lines.extend(page.warning().map(|warning| format!("warning: {warning}")));
            lines.push(format!("live page: {}", page.url()));
        }
        #[cfg(feature = "foxglove")]
        if let Some(address) = self.asked.viewers {
            let viewers = Viewers::open(address, run.start_time_ns, run.channels)?;
            lines.push(format!("for Foxglove and Lichtblick: {}", viewers.url()));
            // It is begun once.
            let _ = self.viewers.set(viewers);
        }
        Ok(lines)
    }

    /// Passes on what the session tells. Never waits for anybody.
    pub fn show(&self, event: &SessionEvent) {
        if let Some(page) = &self.page {
            page.show(event);
        }
        #[cfg(feature = "foxglove")]
        if let Some(viewers) = self.viewers.get() {
            viewers.show(event);
        }
    }

    /// Says how it ended and where the page of the run is.
    pub fn end(&self, outcome: &str, page: Option<&Path>) {
        if let Some(live) = &self.page {
            live.end(outcome, page);
        }
    }
}
