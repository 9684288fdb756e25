//! Certificates on disk: our own, and the pinned one of each server.

use opcua::crypto::{CertificateStore, X509, X509Data};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Maximum size of a certificate in DER, bytes: usual ones have one or two kilobytes.
const MAX_CERTIFICATE_BYTES: usize = 1 << 16;

/// Our application URI in OPC UA, which our certificate contains.
pub(crate) const APPLICATION_URI: &str = "urn:mapper:backend:opcua";
/// Validity of our own certificate, days.
const VALID_DAYS: u32 = 10 * 365;
const KEY_BITS: u32 = 2048;

/// Why a certificate is unavailable.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StoreError {
    #[error("set MAPPER_STATE_DIR or HOME: the certificates have no directory")]
    NoDirectory,
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error("failed to make a certificate: {0}")]
    NotCreated(String),
    #[error("{} is not a certificate", .0.display())]
    NotACertificate(PathBuf),
    #[error("the certificate of {0} is not trusted yet: `mapper-backend-opcua trust {0}`")]
    NotTrusted(String),
    #[error(
        "{server} has another certificate than the trusted one: {found} instead of {pinned}. If the server was given a new one, run \
                 `mapper-backend-opcua trust {server} --replace`; otherwise another server answers"
    )]
    Changed { server: String, found: String, pinned: String },
    #[error("the certificate of {server} {words}; give the server a new one and trust it")]
    Expired { server: String, words: String },
}

/// Its directory name below the user's state.
const DIRECTORY: &str = "opcua";

/// The directory of certificates.
#[derive(Debug, Clone)]
pub(crate) struct Store {
    root: PathBuf,
}

impl Store {
    /// In `$MAPPER_STATE_DIR`, `$XDG_STATE_HOME/mapper` or `~/.local/state/mapper`.
    pub(crate) fn of_environment() -> Result<Store, StoreError> {
        let variable =
            |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
        let state = variable("MAPPER_STATE_DIR")
            .or_else(|| variable("XDG_STATE_HOME").map(|state| state.join("mapper")))
            .or_else(|| variable("HOME").map(|home| home.join(".local/state/mapper")));
        Ok(Store { root: state.ok_or(StoreError::NoDirectory)?.join(DIRECTORY) })
    }

    /// Its directory.
    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    /// Our own certificate; it is created if missing.
    pub(crate) fn own(&self) -> Result<PathBuf, StoreError> {
        let store = CertificateStore::new(&self.root);
        let (certificate, key) = (store.own_certificate_path(), store.own_private_key_path());
        if certificate.exists() && key.exists() {
            return Ok(certificate);
        }
        for directory in [certificate.parent(), key.parent()].into_iter().flatten() {
            self.directory(directory)?;
        }
        CertificateStore::create_certificate_and_key(&about(VALID_DAYS), true, &certificate, &key)
            .map_err(StoreError::NotCreated)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            std::fs::set_permissions(&key, std::fs::Permissions::from_mode(0o600))
                .map_err(|source| StoreError::File { path: key, source })?;
        }
        Ok(certificate)
    }

    /// Makes a directory with access for the user only, since it holds a key.
    fn directory(&self, path: &Path) -> Result<(), StoreError> {
        let mut made = std::fs::DirBuilder::new();
        made.recursive(true);
        #[cfg(unix)]
        std::os::unix::fs::DirBuilderExt::mode(&mut made, 0o700);
        made.create(path).map_err(|source| StoreError::File { path: path.to_owned(), source })
    }

    fn pin(&self, endpoint: &str) -> PathBuf {
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-.".contains(c) { c } else { '_' };
        let name: String = server(endpoint).to_ascii_lowercase().chars().map(plain).collect();
        self.root.join("servers").join(format!("{name}.der"))
    }

    /// The pinned certificate of a server, still valid.
    pub(crate) fn pinned(&self, endpoint: &str) -> Result<X509, StoreError> {
        let Some(certificate) = self.trusted(endpoint)? else {
            return Err(StoreError::NotTrusted(endpoint.to_owned()));
        };
        valid(endpoint, &certificate)?;
        Ok(certificate)
    }

    /// The trusted certificate; `None` if there is none.
    pub(crate) fn trusted(&self, endpoint: &str) -> Result<Option<X509>, StoreError> {
        let path = self.pin(endpoint);
        if !path.exists() {
            return Ok(None);
        }
        let der = mapper_yaml::read_limited(&path, MAX_CERTIFICATE_BYTES)
            .map_err(|source| StoreError::File { path: path.clone(), source })?;
        X509::from_der(&der).map(Some).map_err(|_| StoreError::NotACertificate(path))
    }

    /// Trusts this certificate from now on. Returns its file.
    pub(crate) fn trust(&self, endpoint: &str, der: &[u8]) -> Result<PathBuf, StoreError> {
        let path = self.pin(endpoint);
        self.directory(path.parent().unwrap_or(&self.root))?;
        std::fs::write(&path, der).map_err(|source| StoreError::File { path: path.clone(), source })?;
        Ok(path)
    }
}

/// Checks that this certificate is valid today.
pub(crate) fn valid(endpoint: &str, certificate: &X509) -> Result<(), StoreError> {
    let refused = |error: opcua::types::Error| StoreError::Expired {
        server: server(endpoint).to_owned(),
        words: match certificate.not_after() {
            Ok(day) => format!("is not valid now (until {})", day.format("%Y-%m-%d %H:%M UTC")),
            Err(_) => format!("is not valid: {error}"),
        },
    };
    certificate.is_time_valid(&opcua::types::DateTime::now().as_chrono()).map_err(refused).map(|_| ())
}

/// Contents of our own certificate.
fn about(valid_days: u32) -> X509Data {
    let text = || "mapper".to_owned();
    X509Data {
        key_size: KEY_BITS,
        common_name: text(),
        organization: text(),
        organizational_unit: text(),
        country: "XX".to_owned(),
        state: "-".to_owned(),
        alt_host_names: X509Data::alt_host_names(APPLICATION_URI, None, false, true, false),
        certificate_duration_days: valid_days,
    }
}

/// Host and port of an endpoint.
pub(crate) fn server(endpoint: &str) -> &str {
    let after = endpoint.strip_prefix("opc.tcp://").unwrap_or(endpoint);
    after.split('/').next().unwrap_or(after)
}

/// SHA-256 of a certificate in the usual notation.
pub(crate) fn fingerprint(der: &[u8]) -> String {
    let bytes: Vec<String> = Sha256::digest(der).iter().map(|byte| format!("{byte:02X}")).collect();
    bytes.join(":")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_server_is_its_host_and_port() {
        assert_eq!(server("opc.tcp://plc.lab:4840/stand/1"), "plc.lab:4840");
        let store = Store { root: PathBuf::from("/state") };
        assert_eq!(store.pin("opc.tcp://PLC:4840/"), store.pin("opc.tcp://plc:4840"));
        assert_eq!(store.pin("opc.tcp://../x:1"), PathBuf::from("/state/servers/...der"));
    }

    /// One that is never valid, and ours.
    #[test]
    fn an_expired_certificate_is_refused() {
        let scratch = tempfile::tempdir().unwrap();
        let (store, endpoint) = (Store { root: scratch.path().join("opcua") }, "opc.tcp://plc:4840");
        assert!(matches!(store.pinned(endpoint), Err(StoreError::NotTrusted(_))));
        let (expired, _) = X509::cert_and_pkey(&about(0)).unwrap();
        store.trust(endpoint, &expired.to_der().unwrap()).unwrap();
        let refused = store.pinned(endpoint).err().unwrap().to_string();
        assert!(refused.contains("is not valid now"), "{refused}");
        let own = store.own().unwrap();
        assert_eq!(store.own().unwrap(), own);
        store.trust(endpoint, &std::fs::read(own).unwrap()).unwrap();
        assert!(store.pinned(endpoint).is_ok());
    }
}
