//! `mapper-lab-server`: the virtual lab of a campaign behind a real server, in real or scaled time. It serves to rehearse a night, including
//! interlocks and effects; docs/how-to/rig.md has the addresses.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod ak;
mod modbus;
mod opcua_nodes;
mod stand;

use clap::Parser;
use mapper_backends::BACKENDS;
use mapper_campaign::campaign::BackendChoice;
use mapper_session::{Registry, nominal_model};
use opcua_nodes::{Protection, ServeError, Shared};
use stand::Stand;
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;
use tokio::runtime::Runtime;
use tokio::task::JoinHandle;

/// Interval between two steps of the lab.
const STEP: Duration = Duration::from_millis(20);

/// Serve the virtual lab of a campaign like a real gas stand, to rehearse a night. As a PLC must, it cuts the air after 2 s without a heartbeat
/// and above 1.05 times the campaign's speed limit, until the trip is acknowledged. Several servers may share one stand.
#[derive(Parser)]
#[command(name = "mapper-lab-server", version)]
#[command(group(clap::ArgGroup::new("servers").required(true).multiple(true).args(["modbus", "opcua", "ak"])))]
struct Arguments {
    /// Campaign of the simulated machine; if it names another backend, the virtual lab runs with default settings
    campaign: PathBuf,
    /// Serve Modbus TCP at this address, e.g. 127.0.0.1:5020; port 0 picks a free one
    #[arg(long, value_name = "ADDRESS")]
    modbus: Option<SocketAddr>,
    /// Serve OPC UA at this address, e.g. 127.0.0.1:4840: signed and encrypted, for the user $PLC_USER with the password $PLC_PASSWORD, or
    /// anonymous if they are not set
    #[arg(long, value_name = "ADDRESS")]
    opcua: Option<SocketAddr>,
    /// Serve OPC UA without encryption, for any client
    #[arg(long, requires = "opcua")]
    clear: bool,
    /// Serve readings as AK telegrams at this address, e.g. 127.0.0.1:8888 (read only)
    #[arg(long, value_name = "ADDRESS")]
    ak: Option<SocketAddr>,
    /// Print a line for each speed read and each setpoint written over OPC UA: `SECONDS read RPM`, `SECONDS write NAME`. Times are on this
    /// computer's monotonic clock, after decryption, so that latency can be measured in an encrypted session
    #[arg(long, requires = "opcua")]
    stamps: bool,
    /// Seconds of the lab per second of wall time, 0.1 to 100
    #[arg(long, default_value_t = 1.0)]
    speed: f64,
    /// Serve other computers too; over Modbus, any of them may write without a password
    #[arg(long)]
    public: bool,
}

#[derive(Debug, thiserror::Error)]
enum LabError {
    #[error("{0}")]
    Campaign(String),
    #[error("other computers can reach {0}; use 127.0.0.1, or add --public if that is intended")]
    Public(SocketAddr),
    #[error("--speed {0} is outside 0.1 to 100")]
    Speed(f64),
    #[error("{0}: {1}")]
    Listen(SocketAddr, std::io::Error),
    #[error("{0}")]
    Io(#[from] std::io::Error),
    #[error("{0}")]
    Lab(#[from] mapper_core::BackendError),
    #[error("{0}")]
    Serve(#[from] ServeError),
    #[error("the OPC UA server ended: {0}")]
    OpcUa(String),
    #[error("a thread of this program failed")]
    Thread,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // If standard error is closed, the message is lost.
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn make(arguments: &Arguments) -> Result<Stand, LabError> {
    let campaign_error = |message: String| LabError::Campaign(message);
    let mut campaign =
        mapper_campaign::load(&arguments.campaign).map_err(|error| campaign_error(error.to_string()))?;
    if !BACKENDS.iter().any(|plugin| plugin.name == campaign.backend.name) {
        let name = mapper_backends::virtual_lab::NAME.to_owned();
        campaign.backend = BackendChoice { name, settings: serde_json::json!({}) };
    }
    // Clients poll at their own rate: a slower sampling rate would give them readings up to one sample old.
    if let Some(settings) = campaign.backend.settings.as_object_mut() {
        let rate_hz = (1.0 / STEP.as_secs_f64() / arguments.speed).clamp(10.0, 50.0);
        settings.entry("sample_rate").or_insert_with(|| format!("{rate_hz} Hz").into());
    }
    let registry =
        Registry { backends: BACKENDS.to_vec(), effects: mapper_effects::catalogue(), ..Registry::empty() };
    let model = nominal_model(&campaign).map_err(|error| campaign_error(error.to_string()))?;
    let lab = registry.make_backend(&campaign, &model).map_err(|error| campaign_error(error.to_string()))?;
    Ok(Stand::new(lab, campaign.limits.speed_max_rpm, arguments.speed)?)
}

fn listen(
    runtime: &Runtime,
    arguments: &Arguments,
    at: SocketAddr,
) -> Result<(TcpListener, SocketAddr), LabError> {
    if !at.ip().is_loopback() && !arguments.public {
        return Err(LabError::Public(at));
    }
    let listener = runtime.block_on(TcpListener::bind(at)).map_err(|error| LabError::Listen(at, error))?;
    let at = listener.local_addr()?;
    Ok((listener, at))
}

/// Starts every requested server; a line for each on standard output gives its address.
fn serve(
    runtime: &Runtime,
    arguments: &Arguments,
    shared: &Shared,
) -> Result<Vec<JoinHandle<Result<(), LabError>>>, LabError> {
    let mut serving = Vec::new();
    let mut out = std::io::stdout();
    // Programs read the addresses from the first lines, so notes for the user follow all of them.
    let mut notes = Vec::new();
    if let Some(at) = arguments.modbus {
        let (listener, at) = listen(runtime, arguments, at)?;
        let served = modbus::serve(listener, shared.stand.clone());
        serving.push(runtime.spawn(async { Ok(served.await?) }));
        writeln!(out, "modbus {at}")?;
        let [own, other] = modbus::UNITS;
        notes.push(format!(
            "modbus: `unit: {own}` or {other}; every client that reaches it may write, without a password"
        ));
    }
    if let Some(at) = arguments.opcua {
        let (listener, at) = listen(runtime, arguments, at)?;
        let protection = if arguments.clear { Protection::Clear } else { Protection::Encrypted };
        let entered = runtime.enter();
        let server = opcua_nodes::make(at, shared, protection)?;
        drop(entered);
        serving.push(runtime.spawn(async { server.run_with(listener).await.map_err(LabError::OpcUa) }));
        writeln!(out, "opcua opc.tcp://{at}")?;
        notes.push(format!("opcua: {}", opcua_nodes::describe_users(protection)?));
    }
    if let Some(at) = arguments.ak {
        let (listener, at) = listen(runtime, arguments, at)?;
        let served = ak::serve(listener, shared.stand.clone());
        serving.push(runtime.spawn(async { Ok(served.await?) }));
        writeln!(out, "ak {at}")?;
        notes.push("ak: read-only, for every client, without a password".to_owned());
    }
    for note in notes {
        writeln!(out, "{note}")?;
    }
    Ok(serving)
}

fn run(arguments: &Arguments) -> Result<(), LabError> {
    if !(0.1..=100.0).contains(&arguments.speed) {
        return Err(LabError::Speed(arguments.speed));
    }
    let stand = Arc::new(Mutex::new(make(arguments)?));
    // One thread for the controlling client, one for observers.
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let shared = Shared { stand: stand.clone(), begun: Instant::now(), stamps: arguments.stamps };
    let serving = serve(&runtime, arguments, &shared)?;
    let mut reported = false;
    while !serving.iter().any(JoinHandle::is_finished) {
        let mut stand = stand.lock().map_err(|_| LabError::Thread)?;
        stand.advance(shared.begun.elapsed().as_secs_f64())?;
        let tripped = stand.tripped().map(str::to_owned);
        drop(stand);
        match (&tripped, reported) {
            (Some(why), false) => {
                let how = "1 in register 113, or true in the node ns=2;s=acknowledge, acknowledges it";
                writeln!(std::io::stdout(), "tripped: {why}; {how}")?
            }
            (None, true) => writeln!(std::io::stdout(), "acknowledged")?,
            _ => {}
        }
        reported = tripped.is_some();
        std::thread::sleep(STEP);
    }
    for ended in serving.into_iter().filter(JoinHandle::is_finished) {
        runtime.block_on(ended).map_err(|_| LabError::Thread)??;
    }
    Ok(())
}
