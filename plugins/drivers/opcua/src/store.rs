//! Values of nodes, and their store.

use mapper_core::Quality;
use opcua::crypto::{CertificateStore, X509, X509Data};
use opcua::types::{DataValue, StatusCode, StatusCodeLimit, Variant, VariantTypeId};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// Maximum size of a certificate in DER, bytes: usual ones have one or two kilobytes.
const MAX_CERTIFICATE_BYTES: usize = 1 << 16;

/// Our application URI in OPC UA, which our certificate contains.
pub(crate) const APPLICATION_URI: &str = "urn:mapper:backend:opcua";
/// Validity of our own certificate, days.
const VALID_DAYS: u32 = 10 * 365;
const KEY_BITS: u32 = 2048;

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

    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

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

    pub(crate) fn pinned(&self, endpoint: &str) -> Result<X509, StoreError> {
        let Some(certificate) = self.trusted(endpoint)? else {
            return Err(StoreError::NotTrusted(endpoint.to_owned()));
        };
        valid(endpoint, &certificate)?;
        Ok(certificate)
    }

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

pub(crate) fn server(endpoint: &str) -> &str {
    let after = endpoint.strip_prefix("opc.tcp://").unwrap_or(endpoint);
    after.split('/').next().unwrap_or(after)
}

/// SHA-256 of a certificate in the usual notation.
pub(crate) fn fingerprint(der: &[u8]) -> String {
    let bytes: Vec<String> = Sha256::digest(der).iter().map(|byte| format!("{byte:02X}")).collect();
    bytes.join(":")
}

/// The number in a value; NaN if it is not a number. A Boolean is 1 or 0.
pub(crate) fn number(value: &Variant) -> f64 {
    match value {
        Variant::Boolean(value) => f64::from(u8::from(*value)),
        Variant::SByte(value) => f64::from(*value),
        Variant::Byte(value) => f64::from(*value),
        Variant::Int16(value) => f64::from(*value),
        Variant::UInt16(value) => f64::from(*value),
        Variant::Int32(value) => f64::from(*value),
        Variant::UInt32(value) => f64::from(*value),
        Variant::Int64(value) => *value as f64,
        Variant::UInt64(value) => *value as f64,
        Variant::Float(value) => f64::from(*value),
        Variant::Double(value) => *value,
        _ => f64::NAN,
    }
}

pub(crate) fn type_name(value: &Variant) -> String {
    match value.type_id() {
        VariantTypeId::Empty => "empty".to_owned(),
        VariantTypeId::Scalar(scalar) => format!("{scalar:?}"),
        VariantTypeId::Array(scalar, _) => format!("array of {scalar:?}"),
    }
}

pub(crate) fn is_number(value: &Variant) -> bool {
    !matches!(value, Variant::Boolean(_))
        && (matches!(value, Variant::Float(_) | Variant::Double(_)) || !number(value).is_nan())
}

pub(crate) fn is_whole(value: &Variant) -> bool {
    !matches!(value, Variant::Float(_) | Variant::Double(_))
}

/// The number as a value of the same type as `variant`; `None` if it does not fit.
pub(crate) fn same_type(variant: &Variant, number: f64) -> Option<Variant> {
    let rounded = number.round();
    let within = |low: f64, high: f64| (low..=high).contains(&rounded).then_some(rounded);
    // Each cast is of a whole number within the range of its type.
    Some(match variant {
        Variant::Boolean(_) => Variant::Boolean(within(0.0, 1.0)? == 1.0),
        Variant::SByte(_) => Variant::SByte(within(f64::from(i8::MIN), f64::from(i8::MAX))? as i8),
        Variant::Byte(_) => Variant::Byte(within(0.0, f64::from(u8::MAX))? as u8),
        Variant::Int16(_) => Variant::Int16(within(f64::from(i16::MIN), f64::from(i16::MAX))? as i16),
        Variant::UInt16(_) => Variant::UInt16(within(0.0, f64::from(u16::MAX))? as u16),
        Variant::Int32(_) => Variant::Int32(within(f64::from(i32::MIN), f64::from(i32::MAX))? as i32),
        Variant::UInt32(_) => Variant::UInt32(within(0.0, f64::from(u32::MAX))? as u32),
        // Beyond 2^53 a double cannot represent every integer.
        Variant::Int64(_) => Variant::Int64(within(-9.0e15, 9.0e15)? as i64),
        Variant::UInt64(_) => Variant::UInt64(within(0.0, 9.0e15)? as u64),
        Variant::Float(_) if (number as f32).is_finite() => Variant::Float(number as f32),
        Variant::Double(_) if number.is_finite() => Variant::Double(number),
        _ => return None,
    })
}

/// The code without its additional bits (Part 4 of the specification, 7.39).
fn code(status: StatusCode) -> u32 {
    status.bits() & 0xFFFF_0000
}

/// Codes whose quality differs from that of their severity (Part 4, 7.39; Part 8, 6.3). A value that the sensor does not measure now,
/// because it was entered by hand, simulated, or kept from before, would blind the guards, so it is not a reading.
const STATUSES: [(StatusCode, Quality); 10] = [
    (StatusCode::Good, Quality::Good),
    // Sampling has slowed down.
    (StatusCode::GoodOverload, Quality::Good),
    (StatusCode::GoodCommunicationEvent, Quality::Good),
    (StatusCode::GoodLocalOverride, Quality::Bad),
    (StatusCode::GoodEdited, Quality::Bad),
    (StatusCode::UncertainInitialValue, Quality::Bad),
    (StatusCode::UncertainLastUsableValue, Quality::Bad),
    (StatusCode::UncertainNoCommunicationLastUsableValue, Quality::Bad),
    (StatusCode::UncertainSimulatedValue, Quality::Bad),
    (StatusCode::UncertainSubstituteValue, Quality::Bad),
];

/// Quality of a value, from its status: an absent status means good. Any other code of severity Good, such as `GoodClamped`, limits
/// what the number means; so does a value at a limit of its sensor. A value that cannot vary, or whose unit or type has changed, is not a reading.
pub(crate) fn quality(value: &DataValue) -> Quality {
    let Some(status) = value.status else { return Quality::Good };
    let limit = status.limit();
    if status.structure_changed() || status.semantics_changed() || limit == StatusCodeLimit::Constant {
        return Quality::Bad;
    }
    match STATUSES.iter().find(|(listed, _)| code(*listed) == code(status)) {
        Some((_, Quality::Good)) if limit != StatusCodeLimit::None => Quality::Uncertain,
        Some((_, quality)) => *quality,
        None if status.is_good() || status.is_uncertain() => Quality::Uncertain,
        None => Quality::Bad,
    }
}

/// Whether a value was written exactly: only `Good` confirms that. `GoodClamped` means that another value was written, and
/// `GoodCompletesAsynchronously` that the result is still open.
pub(crate) fn is_written(status: StatusCode) -> bool {
    status == StatusCode::Good
}

/// A status with its code, for look-up: `BadOutOfRange (0x803C0000)`.
pub(crate) fn describe_status(status: StatusCode) -> String {
    format!("{status} (0x{:08X})", status.bits())
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

#[cfg(test)]
mod value_tests {
    use super::*;

    /// Round trip of each type; a value that does not fit is not written.
    #[test]
    fn numbers_keep_the_type_of_the_node() {
        for variant in [
            Variant::SByte(0),
            Variant::Byte(0),
            Variant::Int16(0),
            Variant::UInt16(0),
            Variant::Int32(0),
            Variant::UInt32(0),
            Variant::Int64(0),
            Variant::UInt64(0),
            Variant::Float(0.0),
            Variant::Double(0.0),
        ] {
            let value = same_type(&variant, 101.0).unwrap();
            assert_eq!(value.type_id(), variant.type_id());
            assert_eq!(number(&value), 101.0);
            assert_eq!(same_type(&variant, f64::NAN), None, "{variant:?}");
        }
        assert_eq!(same_type(&Variant::Boolean(false), 1.0), Some(Variant::Boolean(true)));
        assert_eq!(same_type(&Variant::Boolean(false), 2.0), None);
        assert_eq!(same_type(&Variant::UInt16(0), 65_536.0), None);
        assert_eq!(same_type(&Variant::Byte(0), -1.0), None);
        assert_eq!(same_type(&Variant::Float(0.0), 1e300), None);
        assert_eq!(same_type(&Variant::Empty, 1.0), None);
        assert!(number(&Variant::from("101")).is_nan());
    }

    #[test]
    fn each_status_has_its_quality() {
        let with = |status| quality(&DataValue { status, ..DataValue::null() });
        assert_eq!(with(None), Quality::Good);
        assert_eq!(with(Some(StatusCode::GoodClamped)), Quality::Uncertain);
        assert_eq!(with(Some(StatusCode::GoodNoData)), Quality::Uncertain);
        assert_eq!(with(Some(StatusCode::GoodOverload)), Quality::Good);
        assert_eq!(with(Some(StatusCode::UncertainSensorNotAccurate)), Quality::Uncertain);
        // Nothing measures them.
        for status in [StatusCode::GoodLocalOverride, StatusCode::UncertainLastUsableValue] {
            assert_eq!(with(Some(status)), Quality::Bad, "{status}");
        }
        // Additional bits change nothing.
        let clipped = StatusCode::from(StatusCode::UncertainSubstituteValue.bits() | 0x0500);
        assert_eq!(with(Some(clipped)), Quality::Bad);
        assert_eq!(with(Some(StatusCode::BadSensorFailure)), Quality::Bad);
        assert!(is_written(StatusCode::Good));
        let others = [
            StatusCode::GoodClamped,
            StatusCode::GoodCompletesAsynchronously,
            StatusCode::GoodOverload,
            StatusCode::UncertainLastUsableValue,
            StatusCode::BadOutOfRange,
        ];
        assert!(!others.into_iter().any(is_written));
    }
}
