//! The session with a server. It is polled with Read; the library reconnects by itself, within a second of the server's return.

use crate::login::{check_reachable, try_login};
use crate::settings::{Security, User};
use crate::store::{APPLICATION_URI, Store, StoreError, describe_status, fingerprint, is_written, server};
use futures::{StreamExt, pin_mut};
use mapper_controller::Target;
use opcua::client::services::Read;
use opcua::client::{Client, ClientBuilder, IdentityToken, Session, SessionPollResult, UARequest};
use opcua::crypto::{SecurityPolicy, X509};
use opcua::types::{
    AttributeId, DataValue, DateTime, EndpointDescription, Error, MessageSecurityMode, NodeId, NumericRange,
    QualifiedName, ReadValueId, StatusCode, TimestampsToReturn, Variant, WriteValue,
};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// Time for each of endpoint list, first login and session.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(4);
/// Total time for opening: shorter than the 10 s that a host waits for arming.
const OPEN_TIMEOUT: Duration = Duration::from_secs(9);
/// Time for a write, including a reconnection: shorter than the 2 s that a host waits.
const WRITE_TIMEOUT: Duration = Duration::from_millis(1500);
/// Initial and maximum pause between two attempts to connect.
const RETRY: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(1));
/// A server that is silent for this many seconds gets a new connection.
const MAX_SILENCE_S: u64 = 4;

#[derive(Debug, thiserror::Error)]
pub(crate) enum LinkError {
    #[error("{server} did not answer within {} ms", within.as_millis())]
    Late { server: String, within: Duration },
    #[error("{server} did not answer a read within {} ms (`timeout`, at most 800 ms; slower controllers are not supported)", within.as_millis())]
    Slow { server: String, within: Duration },
    #[error("{server}: {message}")]
    Failed { server: String, message: String },
    #[error(
        "{server} refuses the login: {message}. Check user and password, and whether the server trusts {certificate_path}"
    )]
    LoginRefused { server: String, message: String, certificate_path: String },
    #[error(
        "no server answers at {server}: {source}. Check that the server runs, and its address and port (`mapper-lab-server --opcua` prints its own)"
    )]
    NotReachable { server: String, source: std::io::Error },
    #[error(
        "{server} has no session left: {message}. Close the programs that use its sessions, wait until the server drops abandoned ones (a minute \
                 to an hour), or restart it"
    )]
    NoSessionLeft { server: String, message: String },
    #[error("{server} has no endpoint with {policy}; it offers {offered}")]
    NoEndpoint { server: String, policy: String, offered: String },
    #[error("the node {node} {message}")]
    Node { node: NodeId, message: String },
    #[error(
        "{server} refuses {value} for the node {node}: {message}. Check its `unit`, or `scale` and `offset`, below `write`, and the range that the \
                 server accepts"
    )]
    Refused { server: String, node: NodeId, value: f64, message: String },
    #[error("the node {node} cannot hold {value}")]
    DoesNotFit { node: NodeId, value: f64 },
    #[error("the type of {} is not known yet", .0.name())]
    Unknown(Target),
    #[error(transparent)]
    Store(#[from] StoreError),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Connecting,
    Connected,
    Failed(StatusCode),
}

pub(crate) struct Answer {
    pub(crate) values: Vec<DataValue>,
    /// Time of sending, by the server's own clock.
    pub(crate) sent: DateTime,
}

struct Open {
    session: Arc<Session>,
    state: watch::Receiver<State>,
    task: JoinHandle<()>,
}

/// A session that is opened when the rig is armed.
pub(crate) struct Link {
    runtime: Runtime,
    endpoint: String,
    security: Security,
    user: Option<User>,
    within: Duration,
    open: Option<Open>,
}

pub(crate) fn policy(security: Security) -> SecurityPolicy {
    match security {
        Security::Basic256Sha256 => SecurityPolicy::Basic256Sha256,
        Security::Aes128Sha256RsaOaep => SecurityPolicy::Aes128Sha256RsaOaep,
        Security::Aes256Sha256RsaPss => SecurityPolicy::Aes256Sha256RsaPss,
        Security::None => SecurityPolicy::None,
    }
}

/// A client that does not retry a failed connection, or retries forever.
fn client(store: &Store, tries: i32) -> Result<Client, String> {
    let built = ClientBuilder::new()
        .application_name("mapper")
        .application_uri(APPLICATION_URI)
        .product_uri(APPLICATION_URI)
        .session_name("mapper")
        .pki_dir(store.root())
        .create_sample_keypair(false)
        // The certificate is compared with the pinned one, byte by byte, before a session is made; names in it add nothing.
        .trust_server_certs(true)
        .verify_server_certs(false)
        .session_retry_limit(tries)
        .session_retry_initial(RETRY.0)
        .session_retry_max(RETRY.1)
        .keep_alive_interval(Duration::from_secs(1))
        .max_failed_keep_alive_count(MAX_SILENCE_S)
        .request_timeout(Duration::from_secs(1))
        .recreate_subscriptions(false);
    built.client().map_err(|errors| errors.join("; "))
}

pub(crate) async fn endpoints(store: &Store, endpoint: &str) -> Result<Vec<EndpointDescription>, LinkError> {
    let failed = |message: String| LinkError::Failed { server: server(endpoint).to_owned(), message };
    let client = client(store, 0).map_err(failed)?;
    let late_error = || LinkError::Late { server: server(endpoint).to_owned(), within: CONNECT_TIMEOUT };
    let not_reachable = |source| LinkError::NotReachable { server: server(endpoint).to_owned(), source };
    timeout(CONNECT_TIMEOUT, check_reachable(server(endpoint)))
        .await
        .map_err(|_| late_error())?
        .map_err(not_reachable)?;
    let endpoints_request = timeout(CONNECT_TIMEOUT, client.get_server_endpoints_from_url(endpoint));
    endpoints_request.await.map_err(|_| late_error())?.map_err(|error| failed(error.to_string()))
}

/// Status codes for a refused login: a retry could lock the account.
fn is_refusal(status: StatusCode) -> bool {
    [
        StatusCode::BadUserAccessDenied,
        StatusCode::BadIdentityTokenInvalid,
        StatusCode::BadIdentityTokenRejected,
        StatusCode::BadSecurityChecksFailed,
        StatusCode::BadCertificateUntrusted,
        StatusCode::BadCertificateInvalid,
        StatusCode::BadCertificateTimeInvalid,
        StatusCode::BadCertificateUriInvalid,
        StatusCode::BadCertificateUseNotAllowed,
        StatusCode::BadSecurityPolicyRejected,
    ]
    .contains(&status)
}

impl Link {
    pub(crate) fn new(
        endpoint: String,
        security: Security,
        user: Option<User>,
        within: Duration,
    ) -> std::io::Result<Link> {
        // The session has its own thread: keep-alives and reconnections do not wait for the next sample.
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        Ok(Link { runtime, endpoint, security, user, within, open: None })
    }

    fn server(&self) -> String {
        server(&self.endpoint).to_owned()
    }

    fn failed(&self, message: impl Into<String>) -> LinkError {
        LinkError::Failed { server: self.server(), message: message.into() }
    }

    fn choose(
        &self,
        store: &Store,
        offered: Vec<EndpointDescription>,
    ) -> Result<EndpointDescription, LinkError> {
        let policy = policy(self.security);
        let mode = match self.security {
            Security::None => MessageSecurityMode::None,
            _ => MessageSecurityMode::SignAndEncrypt,
        };
        let uri = policy.to_uri();
        let fits =
            |one: &&EndpointDescription| one.security_mode == mode && one.security_policy_uri.as_ref() == uri;
        let Some(found) = offered.iter().find(fits) else {
            let name = |one: &EndpointDescription| {
                let uri = one.security_policy_uri.as_ref();
                format!("{} {:?}", uri.rsplit('#').next().unwrap_or(uri), one.security_mode)
            };
            let offered: Vec<String> = offered.iter().map(name).collect();
            let (server, policy) = (self.server(), format!("{policy} {mode:?}"));
            return Err(LinkError::NoEndpoint { server, policy, offered: offered.join(", ") });
        };
        let mut found = found.clone();
        if self.security != Security::None {
            let pinned = store.pinned(&self.endpoint)?;
            let (offered, pinned) = (found.server_certificate.as_ref().to_vec(), der(&pinned));
            if offered != pinned {
                let (found, pinned) = (fingerprint(&offered), fingerprint(&pinned));
                return Err(StoreError::Changed { server: self.endpoint.clone(), found, pinned }.into());
            }
        }
        // A server may report any host name, so the given address is used.
        found.endpoint_url = self.endpoint.as_str().into();
        Ok(found)
    }

    pub(crate) fn open(&mut self) -> Result<(), LinkError> {
        self.close();
        let until = Instant::now() + OPEN_TIMEOUT;
        let store = Store::of_environment()?;
        let certificate_path = match self.security {
            Security::None => None,
            _ => Some(store.own()?),
        };
        let offered = self.runtime.block_on(endpoints(&store, &self.endpoint))?;
        let endpoint = self.choose(&store, offered)?;
        let client = client(&store, -1).map_err(|message| self.failed(message))?;
        let identity = self.user.as_ref().map_or(IdentityToken::Anonymous, |user| {
            IdentityToken::new_user_name(user.name.as_str(), user.password.as_str())
        });
        let left = CONNECT_TIMEOUT.min(until.saturating_duration_since(Instant::now()));
        let tried = try_login(&client, &endpoint, identity.clone());
        match self.runtime.block_on(async { timeout(left, tried).await }) {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(self.login_error(error.status(), certificate_path)),
            Err(_) => return Err(LinkError::Late { server: self.server(), within: left }),
        }
        let built = client
            .session_builder()
            .user_identity_token(identity)
            .connect_to_endpoint_directly(endpoint)
            .and_then(|builder| builder.build(client.certificate_store().clone()));
        let (session, events) = built.map_err(|error| self.failed(error.to_string()))?;
        let (sender, state) = watch::channel(State::Connecting);
        let task = self.runtime.spawn(async move {
            let events = events.enter();
            pin_mut!(events);
            while let Some(event) = events.next().await {
                let _ = match event {
                    Ok(SessionPollResult::Reconnected(_)) => sender.send(State::Connected),
                    Ok(
                        SessionPollResult::ConnectionLost(status)
                        | SessionPollResult::ReconnectFailed(status),
                    )
                    | Err(status) => sender.send(State::Failed(status)),
                    Ok(_) => Ok(()),
                };
            }
        });
        self.open = Some(Open { session, state, task });
        let left = CONNECT_TIMEOUT.min(until.saturating_duration_since(Instant::now()));
        let connected = self.wait(left);
        connected.map_err(|error| {
            self.close();
            match error {
                Some(status) => self.login_error(status, certificate_path),
                None => LinkError::Late { server: self.server(), within: left },
            }
        })
    }

    fn login_error(&self, status: StatusCode, certificate_path: Option<PathBuf>) -> LinkError {
        let (server, message) = (self.server(), describe_status(status));
        match status {
            StatusCode::BadTooManySessions => LinkError::NoSessionLeft { server, message },
            status if is_refusal(status) => {
                let certificate_path = certificate_path.map_or_else(
                    || "it".to_owned(),
                    |certificate_path| certificate_path.display().to_string(),
                );
                LinkError::LoginRefused { server, message, certificate_path }
            }
            _ => LinkError::Failed { server, message },
        }
    }

    fn wait(&mut self, within: Duration) -> Result<(), Option<StatusCode>> {
        let Some(open) = &mut self.open else { return Err(None) };
        let connected = async {
            loop {
                match *open.state.borrow_and_update() {
                    State::Connected => return Ok(()),
                    State::Failed(status) if is_refusal(status) => return Err(status),
                    _ => {}
                }
                if open.state.changed().await.is_err() {
                    return Err(StatusCode::BadConnectionClosed);
                }
            }
        };
        match self.runtime.block_on(async { timeout(within, connected).await }) {
            Ok(done) => done.map_err(Some),
            Err(_) => Err(match *open.state.borrow() {
                State::Failed(status) => Some(status),
                _ => None,
            }),
        }
    }

    pub(crate) fn read(&mut self, nodes: &[NodeId], attribute: AttributeId) -> Result<Answer, LinkError> {
        let wanted: Vec<ReadValueId> = nodes
            .iter()
            .map(|node| ReadValueId {
                node_id: node.clone(),
                attribute_id: attribute as u32,
                index_range: NumericRange::None,
                data_encoding: QualifiedName::null(),
            })
            .collect();
        let within = self.within;
        let Some(open) = &self.open else { return Err(self.failed("no session is open")) };
        let session = open.session.clone();
        // A maximum age of 0 requests a new value.
        let read = Read::new(&session)
            .nodes_to_read(wanted)
            .timestamps_to_return(TimestampsToReturn::Source)
            .max_age(0.0)
            .send(session.channel());
        let read = async { timeout(within, read).await };
        match self.runtime.block_on(read) {
            Err(_) => Err(LinkError::Slow { server: self.server(), within }),
            Ok(Err(error)) => Err(self.failed(error.to_string())),
            Ok(Ok(answer)) => {
                let values = answer.results.unwrap_or_default();
                match values.len() == nodes.len() {
                    true => Ok(Answer { values, sent: answer.response_header.timestamp }),
                    false => {
                        let message = format!("{} values received, {} requested", values.len(), nodes.len());
                        Err(self.failed(message))
                    }
                }
            }
        }
    }

    /// Writes values in one request, so in no defined order. Waits for a connection that is coming back, and retries.
    pub(crate) fn write(
        &mut self,
        values: &[(NodeId, Variant, f64)],
        until: Instant,
    ) -> Result<(), LinkError> {
        let write: Vec<WriteValue> = values
            .iter()
            .map(|(node, value, _)| WriteValue {
                node_id: node.clone(),
                attribute_id: AttributeId::Value as u32,
                index_range: NumericRange::None,
                value: DataValue::value_only(value.clone()),
            })
            .collect();
        loop {
            let left = until.saturating_duration_since(Instant::now());
            self.wait(left).map_err(|status| match status {
                Some(status) => self.failed(describe_status(status)),
                None => LinkError::Late { server: self.server(), within: WRITE_TIMEOUT },
            })?;
            let Some(open) = &self.open else { return Err(self.failed("no session is open")) };
            let session = open.session.clone();
            let left = until.saturating_duration_since(Instant::now());
            let answer = self.runtime.block_on(async { timeout(left, session.write(&write)).await });
            match answer {
                Err(_) => return Err(LinkError::Late { server: self.server(), within: WRITE_TIMEOUT }),
                // Writing the same value twice does no harm. The state reports a lost connection a moment later.
                Ok(Err(error)) if is_temporary(&error) && !left.is_zero() => {
                    self.runtime.block_on(async { tokio::time::sleep(Duration::from_millis(20)).await });
                }
                Ok(Err(error)) => return Err(self.failed(error.to_string())),
                Ok(Ok(answers)) => return self.check_statuses(values, &answers),
            }
        }
    }

    fn check_statuses(
        &self,
        values: &[(NodeId, Variant, f64)],
        answers: &[StatusCode],
    ) -> Result<(), LinkError> {
        if answers.len() != values.len() {
            return Err(self.failed(format!(
                "{} values written, {} answers received",
                values.len(),
                answers.len()
            )));
        }
        match values.iter().zip(answers).find(|(_, status)| !is_written(**status)) {
            None => Ok(()),
            Some(((node, _, value), status)) => Err(LinkError::Refused {
                server: self.server(),
                node: node.clone(),
                value: *value,
                message: describe_status(*status),
            }),
        }
    }

    /// Deadline of a write that starts now. A heartbeat does not wait: the next one comes soon, and samples would be delayed.
    pub(crate) fn deadline(&self, is_heartbeat: bool) -> Instant {
        Instant::now() + if is_heartbeat { self.within } else { WRITE_TIMEOUT }
    }

    pub(crate) fn close(&mut self) {
        if let Some(open) = self.open.take() {
            let _ = self
                .runtime
                .block_on(async { timeout(Duration::from_secs(1), open.session.disconnect()).await });
            open.task.abort();
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.close();
    }
}

fn is_temporary(error: &Error) -> bool {
    [
        StatusCode::BadNotConnected,
        StatusCode::BadConnectionClosed,
        StatusCode::BadSecureChannelClosed,
        StatusCode::BadSessionIdInvalid,
        StatusCode::BadSessionClosed,
        StatusCode::BadSessionNotActivated,
        StatusCode::BadCommunicationError,
    ]
    .contains(&error.status())
}

/// A certificate in DER form.
pub(crate) fn der(certificate: &X509) -> Vec<u8> {
    certificate.as_byte_string().as_ref().to_vec()
}
