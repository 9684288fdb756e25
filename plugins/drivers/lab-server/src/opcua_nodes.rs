//! The stand as nodes, as in the example of docs/how-to/rig.md: `ns=2;s=NAME` in SI, `air`, `heartbeat`, `tripped`, `acknowledge`.

use crate::stand::{SETPOINTS, Stand, Target, measured};
use mapper_core::Channel;
use opcua::server::address_space::VariableBuilder;
use opcua::server::authenticator::{AuthManager, DefaultAuthenticator};
use opcua::server::diagnostics::NamespaceMetadata;
use opcua::server::node_manager::memory::{SimpleNodeManager, simple_node_manager};
use opcua::server::{
    ANONYMOUS_USER_TOKEN_ID, Server, ServerBuilder, ServerEndpoint, ServerHandle, ServerUserToken,
};
use opcua::types::{DataTypeId, DataValue, DateTime, NodeId, ObjectId, StatusCode, Variant};
use std::collections::BTreeMap;
use std::io::Write;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Instant;

const NAMESPACE: &str = "urn:mapper:lab:stand";
const APPLICATION: &str = "urn:mapper:lab:server";
/// Namespace index of the nodes in docs/how-to/rig.md.
const INDEX: u16 = 2;
/// OPC UA time ticks per second.
const TICKS_HZ: f64 = 1e7;
/// Environment variables of user and password, as in the example of docs/how-to/rig.md, so that server and driver share them.
const USER: (&str, &str) = ("PLC_USER", "PLC_PASSWORD");

#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error("{} is set and {} is not: set both, or neither for anonymous sessions", .0, .1)]
    IncompleteUser(&'static str, &'static str),
    #[error("set MAPPER_STATE_DIR or HOME: the server's certificate has no directory")]
    NoDirectory,
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: std::io::Error },
    #[error("the server cannot be created: {0}")]
    NotBuilt(String),
}

#[derive(Clone)]
pub struct Shared {
    pub stand: Arc<Mutex<Stand>>,
    pub begun: Instant,
    /// Whether speed reads and setpoint writes are printed on standard output, with their times.
    pub stamps: bool,
}

impl Shared {
    fn value(&self, read: impl Fn(&Stand) -> Option<Variant>) -> Result<DataValue, StatusCode> {
        let stand = self.stand.lock().map_err(|_| StatusCode::BadInternalError)?;
        let age_s = (self.begun.elapsed().as_secs_f64() - stand.wall_s()).clamp(0.0, 60.0);
        let now = DateTime::now();
        let value = read(&stand).ok_or(StatusCode::BadNoDataAvailable)?;
        Ok(DataValue {
            value: Some(value),
            status: Some(StatusCode::Good),
            source_timestamp: Some(DateTime::from(now.ticks() - (age_s * TICKS_HZ) as i64)),
            server_timestamp: Some(now),
            ..DataValue::default()
        })
    }

    fn stamp(&self, message: impl std::fmt::Display) {
        if self.stamps {
            let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
            let seconds = now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9;
            // If standard output is closed, the line is lost.
            let _ = writeln!(std::io::stdout(), "{seconds:.6} {message}");
        }
    }

    fn write(&self, name: &str, target: Target, value: &DataValue) -> StatusCode {
        let number = match &value.value {
            Some(Variant::Boolean(on)) => f64::from(u8::from(*on)),
            Some(Variant::Double(number)) => *number,
            Some(Variant::UInt32(count)) => f64::from(*count),
            _ => return StatusCode::BadTypeMismatch,
        };
        let Ok(mut stand) = self.stand.lock() else { return StatusCode::BadInternalError };
        match stand.write(target, number) {
            Ok(()) => {
                drop(stand);
                if target != Target::Heartbeat {
                    self.stamp(format_args!("write {name}"));
                }
                StatusCode::Good
            }
            Err(_) => StatusCode::BadOutOfRange,
        }
    }
}

fn directory() -> Result<PathBuf, ServeError> {
    let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let state = variable("MAPPER_STATE_DIR")
        .or_else(|| variable("XDG_STATE_HOME").map(|state| state.join("mapper")))
        .or_else(|| variable("HOME").map(|home| home.join(".local/state/mapper")));
    let path = state.ok_or(ServeError::NoDirectory)?.join("lab-server");
    let mut builder = std::fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(&path).map_err(|source| ServeError::File { path: path.clone(), source })?;
    Ok(path)
}

fn user() -> Result<Option<(String, String)>, ServeError> {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    match (variable(USER.0), variable(USER.1)) {
        (Some(name), Some(password)) => Ok(Some((name, password))),
        (None, None) => Ok(None),
        (Some(_), None) => Err(ServeError::IncompleteUser(USER.0, USER.1)),
        (None, Some(_)) => Err(ServeError::IncompleteUser(USER.1, USER.0)),
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protection {
    /// Signed and encrypted only.
    Encrypted,
    /// Without encryption only, anonymous.
    Clear,
}

pub fn describe_users(protection: Protection) -> Result<String, ServeError> {
    Ok(match (protection, user()?) {
        (Protection::Clear, _) => {
            "unencrypted (`security: none`), for every client, without user and password".to_owned()
        }
        (Protection::Encrypted, Some(_)) => {
            format!("signed and encrypted, for the user in ${} with the password in ${}", USER.0, USER.1)
        }
        (Protection::Encrypted, None) => {
            format!(
                "signed and encrypted, without user and password: ${} and ${} are not set",
                USER.0, USER.1
            )
        }
    })
}

fn builder(at: SocketAddr, pki: &Path, protection: Protection) -> Result<ServerBuilder, ServeError> {
    let users: BTreeMap<String, ServerUserToken> = match (user()?, protection) {
        (Some((name, password)), Protection::Encrypted) => {
            [("lab".to_owned(), ServerUserToken::user_pass(name, password))].into()
        }
        _ => BTreeMap::new(),
    };
    let user_ids: Vec<String> = if users.is_empty() {
        vec![ANONYMOUS_USER_TOKEN_ID.to_owned()]
    } else {
        users.keys().cloned().collect()
    };
    let authenticator: Arc<dyn AuthManager> = Arc::new(DefaultAuthenticator::new(users.clone()));
    let mut builder = ServerBuilder::new()
        .application_name("mapper lab server")
        .application_uri(APPLICATION)
        .product_uri(APPLICATION)
        .pki_dir(pki)
        .create_sample_keypair(protection == Protection::Encrypted)
        // Any client at this computer's own address may rehearse; a PLC asks for a known certificate.
        .trust_client_certs(true)
        .host(at.ip().to_string())
        .port(at.port())
        .discovery_urls(vec!["/".to_owned()])
        .with_authenticator(authenticator)
        .with_node_manager(simple_node_manager(
            NamespaceMetadata { namespace_uri: NAMESPACE.to_owned(), ..NamespaceMetadata::default() },
            "stand",
        ));
    for (name, token) in users {
        builder = builder.add_user_token(name, token);
    }
    let endpoints = match protection {
        Protection::Clear => vec![("clear", ServerEndpoint::new_none("/", &user_ids))],
        Protection::Encrypted => vec![
            ("basic256_sha256", ServerEndpoint::new_basic256sha256_sign_encrypt("/", &user_ids)),
            (
                "aes128_sha256_rsa_oaep",
                ServerEndpoint::new_aes128_sha256_rsaoaep_sign_encrypt("/", &user_ids),
            ),
            ("aes256_sha256_rsa_pss", ServerEndpoint::new_aes256_sha256_rsapss_sign_encrypt("/", &user_ids)),
        ],
    };
    for (name, endpoint) in endpoints {
        builder = builder.add_endpoint(name, endpoint);
    }
    Ok(builder)
}

/// Name, type, and target of a write; `None`: read only.
fn writable() -> Vec<(&'static str, DataTypeId, Target)> {
    let [p3, t3, valve, oil] = SETPOINTS;
    vec![
        ("p3", DataTypeId::Double, p3),
        ("t3", DataTypeId::Double, t3),
        ("valve", DataTypeId::Double, valve),
        ("oil_temperature", DataTypeId::Double, oil),
        ("air", DataTypeId::Boolean, Target::Air),
        ("heartbeat", DataTypeId::UInt32, Target::Heartbeat),
        ("acknowledge", DataTypeId::Boolean, Target::Acknowledge),
    ]
}

fn variant(kind: DataTypeId, value: f64) -> Variant {
    match kind {
        DataTypeId::Boolean => Variant::Boolean(value >= 0.5),
        DataTypeId::UInt32 => Variant::UInt32(value as u32),
        _ => Variant::Double(value),
    }
}

fn add_nodes(handle: &ServerHandle, shared: &Shared) -> Result<(), ServeError> {
    let not_built = |message: &str| ServeError::NotBuilt(message.to_owned());
    let manager = handle.node_managers().get_of_type::<SimpleNodeManager>();
    let manager = manager.ok_or_else(|| not_built("it has no nodes"))?;
    if handle.get_namespace_index(NAMESPACE) != Some(INDEX) {
        return Err(not_built("the namespace of the nodes is not ns=2"));
    }
    let folder = NodeId::new(INDEX, "stand");
    let add_variable = |name: &str, kind: DataTypeId, first: Variant, writes: bool| {
        let id = NodeId::new(INDEX, name);
        let builder =
            VariableBuilder::new(&id, name, name).value(first).data_type(kind).organized_by(&folder);
        let builder = if writes { builder.writable() } else { builder };
        builder.insert(&mut *manager.address_space().write());
        id
    };
    manager.address_space().write().add_folder(&folder, "Stand", "Stand", &ObjectId::ObjectsFolder.into());
    for channel in measured() {
        let id = add_variable(channel.symbol(), DataTypeId::Double, Variant::Double(f64::NAN), false);
        let shared = shared.clone();
        let read = move |stand: &Stand| stand.reading(channel).map(Variant::Double);
        manager.inner().add_read_callback(id, move |_, _, _| {
            let value = shared.value(read);
            if channel == Channel::ShaftSpeed
                && let Some(Variant::Double(rpm)) = value.as_ref().ok().and_then(|value| value.value.as_ref())
            {
                shared.stamp(format_args!("read {rpm}"));
            }
            value
        });
    }
    let id = add_variable("tripped", DataTypeId::Boolean, Variant::Boolean(false), false);
    let stand = shared.clone();
    let tripped = |stand: &Stand| Some(Variant::Boolean(stand.tripped().is_some()));
    manager.inner().add_read_callback(id, move |_, _, _| stand.value(tripped));
    for (name, kind, target) in writable() {
        let id = add_variable(name, kind, variant(kind, 0.0), true);
        let (reads, writes) = (shared.clone(), shared.clone());
        let read = move |stand: &Stand| Some(variant(kind, stand.commanded(target)));
        manager.inner().add_read_callback(id.clone(), move |_, _, _| reads.value(read));
        manager.inner().add_write_callback(id, move |value, _| writes.write(name, target, &value));
    }
    Ok(())
}

pub fn make(at: SocketAddr, shared: &Shared, protection: Protection) -> Result<Server, ServeError> {
    let (server, handle) = builder(at, &directory()?, protection)?.build().map_err(ServeError::NotBuilt)?;
    add_nodes(&handle, shared)?;
    Ok(server)
}
