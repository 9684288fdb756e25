//! A first login that is given back. The library's own session leaves a failed login to the server, which keeps it until it times out: some
//! wrong passwords, and the server has no sessions left. This one closes what it opened, whatever came of it.

use crate::store::APPLICATION_URI;
use opcua::client::services::{ActivateSession, CloseSession, CreateSession};
use opcua::client::transport::{ConnectorBuilder, SecureChannelEventLoop, Transport, TransportPollResult};
use opcua::client::{Client, IdentityToken, UARequest};
use opcua::types::{ApplicationDescription, ApplicationType, EndpointDescription, Error, NodeId, StatusCode};
use std::future::Future;
use std::pin::pin;
use std::time::Duration;
use tokio::net::TcpStream;

/// For each request.
const REQUEST: Duration = Duration::from_secs(1);
/// How long a server may keep the session where it never hears that it is closed, ms.
const KEPT_MS: f64 = 10_000.0;
/// Where a server listens if its endpoint does not say (IANA).
const PORT: u16 = 4840;

/// Whether anybody listens there, `HOST` or `HOST:PORT`, by what the system says: the library's words for it are a status code.
///
/// # Errors
/// Those of the connection.
pub(crate) async fn reach(server: &str) -> std::io::Result<()> {
    let has_port = server.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let place = if has_port { server.to_owned() } else { format!("{server}:{PORT}") };
    TcpStream::connect(place).await.map(drop)
}

/// Logs in and out again.
///
/// # Errors
/// Why nobody is let in.
pub(crate) async fn try_login(
    client: &Client,
    endpoint: &EndpointDescription,
    identity: IdentityToken,
) -> Result<(), Error> {
    let store = client.certificate_store();
    let channel = client
        .session_builder()
        .user_identity_token(identity.clone())
        .connect_to_endpoint_directly(endpoint.clone())?
        .build_channel(store.clone())?;
    let connector = endpoint.endpoint_url.as_ref().build()?;
    let mut events = channel.connect_no_retry(&connector).await?;
    let description = ApplicationDescription {
        application_uri: APPLICATION_URI.into(),
        product_uri: APPLICATION_URI.into(),
        application_name: "mapper".into(),
        application_type: ApplicationType::Client,
        ..ApplicationDescription::default()
    };
    let create =
        CreateSession::new_manual(store, endpoint, 0, REQUEST, NodeId::null(), channel.request_handle())
            .endpoint_url(endpoint.endpoint_url.clone())
            .client_description(description)
            .client_cert_from_store(store)
            .session_name("mapper, first login")
            .session_timeout(KEPT_MS);
    let created = meanwhile(&mut events, create.send(&channel)).await;
    let done = match created {
        Err(error) => Err(error),
        Ok(created) => {
            let token = created.authentication_token;
            let handle = channel.request_handle();
            let mut activate =
                ActivateSession::new_manual(endpoint.clone(), 0, REQUEST, token.clone(), handle)
                    .identity_token(identity);
            // Without encryption there is no key, and none is needed.
            if let Ok(key) = store.read().read_own_pkey() {
                activate = activate.private_key(key);
            }
            let activated = meanwhile(&mut events, activate.send(&channel)).await;
            let close = CloseSession::new_manual(0, REQUEST, token, channel.request_handle());
            // What it answers changes nothing: the channel goes too.
            let _ = meanwhile(&mut events, close.send(&channel)).await;
            activated.map(drop)
        }
    };
    channel.close_channel().await;
    while !matches!(events.poll().await, TransportPollResult::Closed(_)) {}
    done
}

/// Waits for an answer; somebody has to carry what goes and comes on the channel meanwhile.
async fn meanwhile<T: Transport + Send + Sync + 'static, A>(
    events: &mut SecureChannelEventLoop<T>,
    request: impl Future<Output = Result<A, Error>>,
) -> Result<A, Error> {
    let mut request = pin!(request);
    loop {
        tokio::select! {
            answer = &mut request => return answer,
            event = events.poll() => {
                if let TransportPollResult::Closed(status) = event {
                    let status = if status.is_good() { StatusCode::BadConnectionClosed } else { status };
                    return Err(Error::new(status, "the server closed the connection"));
                }
            }
        }
    }
}
