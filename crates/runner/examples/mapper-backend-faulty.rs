//! The rig of the runner's tests as a driver that misbehaves on demand: its settings are the place of a fault in the table.

#[allow(dead_code, reason = "how a run ends, only the test asks")]
#[path = "../tests/faults/faulty_driver.rs"]
mod faulty_driver;

use faulty_driver::faulty_backend::FaultyBackend;
use mapper_core::{Backend, BackendError};

fn main() -> std::process::ExitCode {
    mapper_driver::serve("faulty", env!("CARGO_PKG_VERSION"), |settings| {
        #[allow(clippy::print_stdout, reason = "what an author prints must not get between the frames")]
        {
            println!("faulty: {settings}");
        }
        let place = settings.as_u64().and_then(|place| usize::try_from(place).ok());
        let row = place.and_then(|place| faulty_driver::PROTOCOL_FAULTS.get(place));
        let Some((begin_s, fault, _)) = row else {
            let (backend, path) = ("faulty".to_owned(), String::new());
            return Err(BackendError::Settings {
                backend,
                path,
                source: "write the place of a fault".into(),
            });
        };
        Ok(Box::new(FaultyBackend::new(faulty_driver::lab(), vec![(*begin_s, fault.clone())]))
            as Box<dyn Backend>)
    })
}
