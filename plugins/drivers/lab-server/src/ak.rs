//! The stand as a read-only instrument with the AK protocol. `AKON K0` answers every reading in SI, in the order of the
//! registers, `AKON Kn` the n-th; `ASTZ` reports whether it is remote and whether it has tripped. A missing reading is marked by `#`.

use crate::stand::{Stand, measured};
use mapper_backend_ak::telegram::{Assembler, parse_request, write_answer};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

/// Time between two answers: instruments give some ten a second.
const PACE: Duration = Duration::from_millis(50);
/// Silent connections are closed after this time.
const SILENCE: Duration = Duration::from_secs(60);
const CONNECTIONS: usize = 16;

fn number(reading: Option<f64>) -> String {
    reading.map_or_else(|| "#0".to_owned(), |value| value.to_string())
}

fn answer(stand: &Stand, body: &[u8]) -> Vec<u8> {
    let Ok((code, channel, _)) = parse_request(body) else { return write_answer(None, &[]) };
    let channels = measured();
    let text = match (code.to_string().as_str(), usize::from(channel)) {
        ("AKON", 0) => channels.iter().map(|channel| number(stand.reading(*channel))).collect(),
        ("AKON", n) => match channels.get(n - 1) {
            Some(channel) => vec![number(stand.reading(*channel))],
            None => return write_answer(None, &[]),
        },
        ("ASTZ", _) => {
            let state = if stand.tripped().is_some() { "TRIP" } else { "READY" };
            vec!["SREM".to_owned(), state.to_owned()]
        }
        _ => return write_answer(None, &[]),
    };
    write_answer(Some(code), &text)
}

async fn serve_client(mut stream: TcpStream, stand: Arc<Mutex<Stand>>) -> std::io::Result<()> {
    let (mut assembler, mut bytes) = (Assembler::default(), [0; 512]);
    loop {
        let count = tokio::time::timeout(SILENCE, stream.read(&mut bytes)).await??;
        if count == 0 {
            return Ok(());
        }
        for byte in bytes.iter().take(count) {
            let Some(body) = assembler.push(*byte) else { continue };
            let telegram = match stand.lock() {
                Ok(stand) => answer(&stand, &body),
                Err(_) => return Ok(()),
            };
            tokio::time::sleep(PACE).await;
            stream.write_all(&telegram).await?;
        }
    }
}

pub async fn serve(listener: TcpListener, stand: Arc<Mutex<Stand>>) -> std::io::Result<()> {
    let permits = Arc::new(tokio::sync::Semaphore::new(CONNECTIONS));
    loop {
        let (stream, _) = listener.accept().await?;
        let Ok(permit) = permits.clone().try_acquire_owned() else { continue };
        let stand = stand.clone();
        tokio::spawn(async move {
            // A failure means that the client has disconnected.
            let _ = serve_client(stream, stand).await;
            drop(permit);
        });
    }
}
