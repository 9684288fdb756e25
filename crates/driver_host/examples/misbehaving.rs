//! A driver with faults, for tests: it measures T2 in simulated time. The name of the link by which it is started selects the fault.

use mapper_driver_host::protocol::{Encoding, Message, VERSION, decode, encode, read_frame, write_frame};
use serde_json::{Value, json};
use std::io::{Stdout, Write, stdin, stdout};

fn main() {
    let fault = std::env::args().next().unwrap_or_default();
    // The fault is in the file name, because a driver has no settings before its hello.
    let fault = fault.rsplit("mapper-backend-").next().unwrap_or_default().to_owned();
    let mut driver = Misbehaving { fault, out: stdout(), sequence: 0 };
    let mut stdin = stdin();
    if driver.fault == "deaf" {
        driver.wait();
    }
    while let Ok(Some(body)) = read_frame(&mut stdin, 1 << 20) {
        let Ok(message) = decode(&body) else { break };
        if let (Some(id), Some(method)) = (message.id, message.method) {
            driver.answer(id, &method, &message.params);
        }
    }
}

struct Misbehaving {
    fault: String,
    out: Stdout,
    sequence: u64,
}

impl Misbehaving {
    fn is(&self, fault: &str) -> bool {
        self.fault == fault
    }

    /// For ever.
    fn wait(&self) {
        loop {
            std::thread::park();
        }
    }

    fn raw(&mut self, bytes: &[u8]) {
        let _ = self.out.write_all(bytes).and_then(|()| self.out.flush());
    }

    fn send(&mut self, message: &Message) {
        let body = encode(message, Encoding::Json).unwrap_or_default();
        let _ = write_frame(&mut self.out, &body, u32::MAX);
    }

    fn samples(&mut self, sequence: u64, t_s: &[f64]) {
        let columns = json!([{"channel": "T2", "values": t_s}]);
        let params = json!({"stream": "rig", "sequence": sequence, "t_s": t_s, "columns": columns});
        self.send(&Message::note("samples", params));
    }

    fn hello(&self) -> Value {
        let major = if self.is("wrong_version") { VERSION.major + 1 } else { VERSION.major };
        let name = if self.is("wrong_name") { "another" } else { &self.fault };
        let magic = if self.is("wrong_magic") { "telnet" } else { "mapper-backend" };
        json!({
            "magic": magic, "protocol": {"major": major, "minor": 99}, "name": name, "version": "1", "frame_limit_bytes": 100_000,
            "session": "one", "a field of another time": [1, {"x": null}],
        })
    }

    fn answer(&mut self, id: u64, method: &str, params: &Value) {
        let result = match method {
            "hello" => match self.fault.as_str() {
                "mute" => return,
                "garbage" => return self.raw(b"Welcome to the test cell! login: "),
                "half_a_frame" => {
                    self.raw(&[0, 0, 1, 0, b'{']);
                    std::process::exit(0);
                }
                "too_large" => return self.raw(&[0x7f, 0xff, 0xff, 0xff, b'{']),
                "dies_at_once" => {
                    #[allow(clippy::print_stderr, reason = "its last words are looked for")]
                    {
                        eprintln!("no licence for this rig");
                    }
                    std::process::exit(3);
                }
                _ => self.hello(),
            },
            "describe" => {
                let channel = if self.is("unknown_channel") { "T99" } else { "T2" };
                let unit = if self.is("wrong_unit") { "degC" } else { "K" };
                let rate_hz = if self.is("no_rate") { 0.0 } else { 10.0 };
                json!({"identity": "x", "description": {
                    "channels": [{"name": channel, "unit": unit}], "sample_rate_hz": rate_hz, "simulated_time": true,
                    "safe": {"p3_slew_pa_s": null, "valve_opening_ratio": 1.0, "within_s": 1.0},
                }})
            }
            "poll" => {
                self.poll(params["until_s"].as_f64().unwrap_or(0.0));
                json!({"next_sequence": self.sequence})
            }
            // Alive, with its pipe, until that is closed.
            "set" if self.is("hangs") => return drop(std::io::copy(&mut stdin(), &mut std::io::sink())),
            "set" if self.is("exits_armed") => std::process::exit(1),
            "make_safe" if self.is("not_safe") => {
                let error = json!({"code": "lost", "message": "the valve does not answer"});
                return self.send(&Message {
                    id: Some(id),
                    error: serde_json::from_value(error).ok(),
                    ..Message::default()
                });
            }
            _ => json!({}),
        };
        if self.is("answers_twice") {
            // Late answers to what was asked long ago, and to what was never asked.
            for id in [id.saturating_sub(1), id + 1000] {
                self.send(&Message { id: Some(id), result: Some(json!({})), ..Message::default() });
            }
        }
        self.send(&Message { id: Some(id), result: Some(result), ..Message::default() });
    }

    /// Ten samples a second; the fault begins with the second poll.
    fn poll(&mut self, until_s: f64) {
        let first_sequence = self.sequence;
        let mut t_s = Vec::new();
        while self.sequence as f64 / 10.0 <= until_s {
            t_s.push(self.sequence as f64 / 10.0);
            self.sequence += 1;
        }
        if first_sequence == 0 {
            return self.samples(first_sequence, &t_s);
        }
        match self.fault.as_str() {
            "twice" => {
                self.samples(first_sequence, &t_s);
                self.samples(first_sequence, &t_s);
            }
            "reordered" => {
                let half = t_s.len() / 2;
                self.samples(first_sequence + half as u64, &t_s[half..]);
                self.samples(first_sequence, &t_s[..half]);
            }
            "backward" => {
                let earlier: Vec<f64> = t_s.iter().map(|t_s| t_s - 1.0).collect();
                self.samples(first_sequence, &earlier);
            }
            "no_numbers" => self.send(&Message::note("samples", json!({"t_s": "soon"}))),
            "flood" => {
                let mut sequence = first_sequence;
                // More than any host keeps.
                for _ in 0..300 {
                    let many: Vec<f64> = (0..10_000).map(|i| (sequence + i) as f64 / 10.0).collect();
                    self.samples(sequence, &many);
                    sequence += 10_000;
                }
            }
            _ => self.samples(first_sequence, &t_s),
        }
    }
}
