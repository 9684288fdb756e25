//! A first login that is closed properly. The library leaves a failed login to the server, which keeps the session until it times out: a few
//! wrong passwords, and the server has no sessions left. This login closes whatever it opened, even after a failure.

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
/// Session timeout on the server, if the close request is lost, ms.
const SESSION_TIMEOUT_MS: f64 = 10_000.0;
/// Default port of an OPC UA server (IANA).
const PORT: u16 = 4840;

/// Checks by a plain connection that a server listens at `HOST` or `HOST:PORT`: the library reports only a status code.
pub(crate) async fn check_reachable(server: &str) -> std::io::Result<()> {
    let has_port = server.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    let place = if has_port { server.to_owned() } else { format!("{server}:{PORT}") };
    TcpStream::connect(place).await.map(drop)
}

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
            .session_timeout(SESSION_TIMEOUT_MS);
    let created = await_answer(&mut events, create.send(&channel)).await;
    let done = match created {
        Err(error) => Err(error),
        Ok(created) => {
            let token = created.authentication_token;
            let handle = channel.request_handle();
            let mut activate =
                ActivateSession::new_manual(endpoint.clone(), 0, REQUEST, token.clone(), handle)
                    .identity_token(identity);
            // Without encryption no key is needed.
            if let Ok(key) = store.read().read_own_pkey() {
                activate = activate.private_key(key);
            }
            let activated = await_answer(&mut events, activate.send(&channel)).await;
            let close = CloseSession::new_manual(0, REQUEST, token, channel.request_handle());
            // The answer does not matter: the channel is closed too.
            let _ = await_answer(&mut events, close.send(&channel)).await;
            activated.map(drop)
        }
    };
    channel.close_channel().await;
    while !matches!(events.poll().await, TransportPollResult::Closed(_)) {}
    done
}

/// Waits for an answer while the channel's events are processed.
async fn await_answer<T: Transport + Send + Sync + 'static, A>(
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
