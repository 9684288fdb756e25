//! TLS for the page, with a certificate from the operator.

use std::path::PathBuf;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};

/// Maximum time for the head of a request, or for the first words of TLS.
pub(crate) const HEAD_TIMEOUT: Duration = Duration::from_secs(10);

/// A connection, encrypted or not.
pub(crate) trait Stream: AsyncRead + AsyncWrite + Send {}
impl<S: AsyncRead + AsyncWrite + Send> Stream for S {}

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

#[cfg(feature = "tls")]
pub(crate) use with::{Tls, read};
#[cfg(not(feature = "tls"))]
pub(crate) use without::{Tls, read};

#[cfg(feature = "tls")]
mod with {
    use super::{HEAD_TIMEOUT, Stream, TlsError, TlsFiles};
    use std::pin::Pin;
    use std::sync::Arc;
    use tokio::net::TcpStream;
    use tokio::time::timeout;
    use tokio_rustls::LazyConfigAcceptor;
    use tokio_rustls::rustls::crypto::ring;
    use tokio_rustls::rustls::pki_types::pem::PemObject;
    use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
    use tokio_rustls::rustls::server::Acceptor;
    use tokio_rustls::rustls::{Error, ServerConfig};

    /// Maximum size of a certificate chain or key, bytes: a certificate has some kilobytes, a chain some certificates.
    const MAX_PEM_BYTES: usize = 1 << 20;

    #[derive(Clone)]
    pub(crate) struct Tls(Arc<ServerConfig>);

    pub(crate) fn read(files: &TlsFiles) -> Result<Tls, TlsError> {
        let file =
            |path: &std::path::Path, what, why: String| TlsError::File { path: path.to_owned(), what, why };
        let certificate = |why| file(&files.certificate, "certificate", why);
        let pair = |source: Error| TlsError::Pair { files: files.clone(), why: source.to_string() };
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

    /// The alert that closes a connection (RFC 8446, 6): type 21, version 3.3, 2 bytes, a warning, `close_notify`.
    const CLOSE_NOTIFY: [u8; 7] = [21, 3, 3, 0, 2, 1, 0];

    impl Tls {
        /// The connection over TLS; `None` if the client does not speak it, or not in time.
        pub(crate) async fn accept(&self, stream: TcpStream) -> Option<Pin<Box<dyn Stream>>> {
            let mut hello = LazyConfigAcceptor::new(Acceptor::default(), stream);
            let accept = async { (&mut hello).await?.into_stream(self.0.clone()).await };
            match timeout(HEAD_TIMEOUT, accept).await {
                Ok(stream) => stream.ok().map(|stream| Box::pin(stream) as Pin<Box<dyn Stream>>),
                Err(_) => {
                    // So that the client knows that no data were cut off.
                    let _ = hello.take_io().map(|stream| stream.try_write(&CLOSE_NOTIFY));
                    None
                }
            }
        }
    }
}

#[cfg(not(feature = "tls"))]
mod without {
    use super::{Stream, TlsError, TlsFiles};
    use std::pin::Pin;
    use tokio::net::TcpStream;

    /// Placeholder for builds without TLS.
    #[derive(Clone)]
    pub(crate) enum Tls {}

    pub(crate) fn read(_files: &TlsFiles) -> Result<Tls, TlsError> {
        Err(TlsError::NotBuilt)
    }

    impl Tls {
        #[allow(clippy::unused_async, reason = "as with TLS")]
        pub(crate) async fn accept(&self, _stream: TcpStream) -> Option<Pin<Box<dyn Stream>>> {
            match *self {}
        }
    }
}
