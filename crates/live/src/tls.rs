//! TLS for the page, with a certificate from the operator.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Instant;

/// PEM files of the server.
#[derive(Debug, Clone)]
pub struct TlsFiles {
    /// The certificate, followed by intermediate certificates up to one that browsers trust.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
}

/// Why the page cannot be served over TLS.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum TlsError {
    /// `what`: the required content.
    #[error("{}: {why}; it has to be a {what} in PEM", path.display())]
    File { path: PathBuf, what: &'static str, why: String },
    #[error("{} and {} cannot be used together: {why}", files.certificate.display(), files.key.display())]
    Pair { files: TlsFiles, why: String },
    #[error("this program was built without TLS; build it with `--features tls`, or use a tunnel (ssh -L)")]
    NotBuilt,
}

/// A connection with a deadline for its request, so that a slow sender does not keep its slot.
pub(crate) struct DeadlineStream {
    pub(crate) stream: TcpStream,
    pub(crate) until: Instant,
}

impl Read for DeadlineStream {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        if Instant::now() > self.until {
            return Err(std::io::ErrorKind::TimedOut.into());
        }
        self.stream.read(into)
    }
}

impl Write for DeadlineStream {
    fn write(&mut self, from: &[u8]) -> std::io::Result<usize> {
        self.stream.write(from)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.stream.flush()
    }
}

#[cfg(feature = "tls")]
pub(crate) use with::{Tls, read};
#[cfg(not(feature = "tls"))]
pub(crate) use without::{Tls, read};

#[cfg(feature = "tls")]
mod with {
    use super::{DeadlineStream, TlsError, TlsFiles};
    use rustls::crypto::ring;
    use rustls::pki_types::pem::PemObject;
    use rustls::pki_types::{CertificateDer, PrivateKeyDer};
    use rustls::{ServerConfig, ServerConnection, StreamOwned};
    use std::io::Write;
    use std::sync::Arc;

    /// Maximum size of a certificate chain or key, bytes: a certificate has some kilobytes, a chain some certificates.
    const MAX_PEM_BYTES: usize = 1 << 20;

    #[derive(Clone)]
    pub(crate) struct Tls(Arc<ServerConfig>);

    pub(crate) fn read(files: &TlsFiles) -> Result<Tls, TlsError> {
        let file =
            |path: &std::path::Path, what, why: String| TlsError::File { path: path.to_owned(), what, why };
        let certificate = |why| file(&files.certificate, "certificate", why);
        let pair = |source: rustls::Error| TlsError::Pair { files: files.clone(), why: source.to_string() };
        let read = |path| mapper_yaml::read_limited(path, MAX_PEM_BYTES).map_err(|source| source.to_string());
        let pem = read(&files.certificate).map_err(certificate)?;
        let chain: Vec<CertificateDer<'static>> = CertificateDer::pem_slice_iter(&pem)
            .collect::<Result<_, _>>()
            .map_err(|source| certificate(source.to_string()))?;
        if chain.is_empty() {
            return Err(certificate("no certificate in it".to_owned()));
        }
        let key = read(&files.key)
            .and_then(|pem| PrivateKeyDer::from_pem_slice(&pem).map_err(|source| source.to_string()))
            .map_err(|why| file(&files.key, "private key", why))?;
        let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .map_err(pair)?
            .with_no_client_auth()
            .with_single_cert(chain, key)
            .map_err(pair)?;
        Ok(Tls(Arc::new(config)))
    }

    impl Tls {
        /// Runs `answer` on a connection over TLS and closes it properly, so that the client knows that no data were cut off.
        pub(crate) fn serve_over(
            &self,
            stream: DeadlineStream,
            answer: impl FnOnce(&mut StreamOwned<ServerConnection, DeadlineStream>) -> std::io::Result<()>,
        ) -> std::io::Result<()> {
            let connection = ServerConnection::new(self.0.clone()).map_err(std::io::Error::other)?;
            let mut stream = StreamOwned::new(connection, stream);
            let answered = answer(&mut stream);
            stream.conn.send_close_notify();
            stream.flush()?;
            answered
        }
    }
}

#[cfg(not(feature = "tls"))]
mod without {
    use super::{DeadlineStream, TlsError, TlsFiles};

    /// Placeholder for builds without TLS.
    #[derive(Clone)]
    pub(crate) enum Tls {}

    pub(crate) fn read(_files: &TlsFiles) -> Result<Tls, TlsError> {
        Err(TlsError::NotBuilt)
    }

    impl Tls {
        pub(crate) fn serve_over(
            &self,
            _stream: DeadlineStream,
            _answer: impl FnOnce(&mut DeadlineStream) -> std::io::Result<()>,
        ) -> std::io::Result<()> {
            match *self {}
        }
    }
}
