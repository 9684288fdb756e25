//! `mapper-lab-server`: the virtual lab of a campaign behind a real server, in real or scaled time. A stand to rehearse a night on, interlocks and
//! effects included; docs/rig.md has the addresses.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod modbus;
mod stand;

use clap::Parser;
use mapper_backends::BACKENDS;
use mapper_campaign::campaign::BackendChoice;
use mapper_session::{Registry, nominal_model};
use stand::Stand;
use std::io::Write;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::net::TcpListener;

/// How often the lab goes on.
const STEP: Duration = Duration::from_millis(20);

/// The virtual lab of a campaign behind a real server, to rehearse a night on. As a PLC has to, it cuts the air without a heartbeat for 2 s and
/// above 1.05 times the campaign's limit of speed, and holds it off until somebody acknowledges that.
#[derive(Parser)]
#[command(name = "mapper-lab-server", version)]
struct Arguments {
    /// Campaign whose machine stands there; its virtual lab, or one without settings where it names another backend
    campaign: PathBuf,
    /// Serve Modbus TCP there, e.g. 127.0.0.1:5020; port 0: any that is free
    #[arg(long, value_name = "ADDRESS")]
    modbus: SocketAddr,
    /// Seconds of the lab in one second on the wall, 0.1 to 100
    #[arg(long, default_value_t = 1.0)]
    speed: f64,
    /// Serve other computers too: whoever reaches this one may write, without a password
    #[arg(long)]
    public: bool,
}

#[derive(Debug, thiserror::Error)]
enum LabError {
    #[error("{0}")]
    Campaign(String),
    #[error("{0} is not of this computer alone; write 127.0.0.1, or --public where that is meant")]
    Public(SocketAddr),
    #[error("--speed {0} is outside 0.1 to 100")]
    Speed(f64),
    #[error("{0}: {1}")]
    Listen(SocketAddr, std::io::Error),
    #[error("{0}")]
    Io(#[from] std::io::Error),
    #[error("{0}")]
    Lab(#[from] mapper_core::BackendError),
    #[error("a thread of this program failed")]
    Thread,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Where standard error is closed nobody is told.
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn make(arguments: &Arguments) -> Result<Stand, LabError> {
    let wrong = |words: String| LabError::Campaign(words);
    let mut campaign =
        mapper_campaign::load(&arguments.campaign).map_err(|error| wrong(error.to_string()))?;
    if !BACKENDS.iter().any(|plugin| plugin.name == campaign.backend.name) {
        let name = mapper_backends::virtual_lab::NAME.to_owned();
        campaign.backend = BackendChoice { name, settings: serde_json::json!({}) };
    }
    let registry =
        Registry { backends: BACKENDS.to_vec(), effects: mapper_effects::catalogue(), ..Registry::default() };
    let model = nominal_model(&campaign).map_err(|error| wrong(error.to_string()))?;
    let lab = registry.make_backend(&campaign, &model).map_err(|error| wrong(error.to_string()))?;
    Ok(Stand::new(lab, campaign.limits.speed_max_rpm, arguments.speed)?)
}

fn run(arguments: &Arguments) -> Result<(), LabError> {
    if !(0.1..=100.0).contains(&arguments.speed) {
        return Err(LabError::Speed(arguments.speed));
    }
    let address = arguments.modbus;
    if !address.ip().is_loopback() && !arguments.public {
        return Err(LabError::Public(address));
    }
    let stand = Arc::new(Mutex::new(make(arguments)?));
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let listener =
        runtime.block_on(TcpListener::bind(address)).map_err(|error| LabError::Listen(address, error))?;
    writeln!(std::io::stdout(), "modbus {}", listener.local_addr()?)?;
    let serving = runtime.spawn(modbus::serve(listener, stand.clone()));
    let (begun, mut said) = (Instant::now(), false);
    while !serving.is_finished() {
        let mut stand = stand.lock().map_err(|_| LabError::Thread)?;
        stand.advance(begun.elapsed().as_secs_f64())?;
        let tripped = stand.tripped().map(str::to_owned);
        drop(stand);
        match (&tripped, said) {
            (Some(why), false) => {
                writeln!(std::io::stdout(), "tripped: {why}; 1 in register 113 acknowledges it")?
            }
            (None, true) => writeln!(std::io::stdout(), "acknowledged")?,
            _ => {}
        }
        said = tripped.is_some();
        std::thread::sleep(STEP);
    }
    Ok(runtime.block_on(serving).map_err(|_| LabError::Thread)??)
}
