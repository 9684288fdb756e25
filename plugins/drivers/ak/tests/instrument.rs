//! The driver against a simulated instrument, since no public one exists. It answers as the manuals print it: in pieces, late and torn.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{Backend, Channel};
use mapper_driver_host::{DEFAULT_TIMEOUTS, Driver};
use serde_json::json;
use std::io::{Read, Write};
use std::net::TcpListener;

/// Answers each request with the next item and repeats the last one. Returns its address.
fn instrument(answers: &'static [&'static [&'static [u8]]]) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let mut asked = 0;
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut bytes = [0; 64];
            while let Ok(count) = stream.read(&mut bytes) {
                if count == 0 {
                    break;
                }
                assert_eq!(&bytes[..count], b"\x02 AKON K0\x03");
                for piece in answers[asked.min(answers.len() - 1)] {
                    stream.write_all(piece).unwrap();
                    stream.flush().unwrap();
                }
                asked += 1;
            }
        }
    });
    address
}

fn driver(address: &str, code: &str) -> Result<Driver, mapper_core::BackendError> {
    let settings = json!({
        // Only the torn answer runs into this timeout. It is long, so that a busy machine loses no other answer.
        "address": address, "rate": "5 Hz", "timeout": "800 ms",
        "read": {"m_c": {"code": code, "value": 1, "scale": 0.001}, "T1": {"code": code, "value": 2, "offset": 273.15}},
    });
    Driver::start_program(env!("CARGO_BIN_EXE_mapper-backend-ak").as_ref(), "ak", &settings, DEFAULT_TIMEOUTS)
}

/// An answer in pieces, one with Testo's don't-care byte, a torn one (which forces a new connection), and an invalid one.
#[test]
fn incomplete_answers_give_no_reading() {
    let address = instrument(&[
        &[b"\x02 AKON 0 50.0 20.0\x03"],
        &[b"\x020AK", b"ON 0 51.5 2.1E+01\x03"],
        &[b"\x02 AKON 0 52"],
        &[b"\x02 AKON 1 #9.9 22\x03"],
        &[b"\x02 AKON 1 53.0 22.0\x03"],
    ]);
    let mut rig = driver(&address, "AKON").unwrap();
    assert!(!rig.describe().controls);
    rig.arm().unwrap();
    let (mut flows, mut temperatures, mut t_s) = (Vec::new(), Vec::new(), 0.0);
    while flows.last() != Some(&0.053) {
        t_s += 0.2;
        let batch = rig.poll(t_s).unwrap();
        flows.extend(batch.column(Channel::CompressorFlow).unwrap());
        temperatures.extend(batch.column(Channel::T1).unwrap());
        assert!(t_s < 30.0, "{flows:?}");
    }
    let read =
        |values: &[f64]| -> Vec<f64> { values.iter().copied().filter(|value| value.is_finite()).collect() };
    // Equal within a unit in the last place: 51.5 times 0.001.
    let equal = |found: &[f64], wanted: [f64; 2]| found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9);
    let (flows, temperatures) = (read(&flows), read(&temperatures));
    assert!(flows.len() == 2 && equal(&flows, [0.0515, 0.053]), "{flows:?}");
    assert!(temperatures.len() == 3 && equal(&temperatures, [294.15, 295.15]), "{temperatures:?}");
    rig.disarm().unwrap();
}

#[test]
fn an_instrument_is_never_controlled() {
    let refused = driver("127.0.0.1:1", "SREM").err().unwrap().to_string();
    assert!(refused.contains("only read"), "{refused}");
}
